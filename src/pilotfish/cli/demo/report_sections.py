"""Sections of the report of the demo: text, figures and tables."""

from collections.abc import Sequence

from pilotfish import plots
from pilotfish.cli.demo.evaluation_tables import StructureEvaluation
from pilotfish.cli.demo.protocol import (
    CONTROL_COST,
    COVARIANCE_REGULARISATION,
    SETTINGS,
    TRAINING_DEMONSTRATIONS,
)
from pilotfish.cli.output.html_report import Image, Section, figure_image
from pilotfish.cli.output.tables import Table
from pilotfish.demonstrations import Demonstration, Frame

RECORDED_TEXT = "A person guided a robot arm through opening a valve at eight different angles. "
GENERATED_TEXT = "The demonstrations of opening a valve at eight different angles are generated. "
INTRODUCTION = (
    "A task-parameterised hidden semi-Markov model (TP-HSMM) was learned from the first four demonstrations. "
    "It has seven states in a sequence. Each state has a duration, and a Gaussian in two frames: the valve "
    "before and the valve after the turn. Four of the eight situations are new. In each, the skill was "
    "adapted to the frames, and a linear-quadratic tracker (LQT) computed the motion. States are numbered "
    "from 0 and have the same colour in every figure."
)
ERROR_NOTE = (
    "Until the valve is open, the frames determine the position of the hand. Then the person lets go, and "
    "the demonstrations differ from each other. Errors at the end of the motion measure this last part; the "
    "errors at grasp and release, in the summary, measure the task."
)


def report_sections(
    evaluations: Sequence[StructureEvaluation], headline: Table, tables: Sequence[Table], notice: str
) -> tuple[Section, ...]:
    """Return the sections of the report.

    Args:
        evaluations: Evaluations; figures are those of the last one, the others are compared with it.
        headline: Errors at grasp and release.
        tables: Error tables, then the summary.
        notice: Why generated data was used; empty for recorded data.
    """
    *errors, summary = tables
    evaluation = evaluations[-1]
    data_text = GENERATED_TEXT if notice else RECORDED_TEXT
    return (
        Section("Summary", (data_text + INTRODUCTION, headline), notice),
        Section("Demonstrations and learned model", _model_images(evaluation)),
        Section("Precision in each frame", _precision_images(evaluation)),
        Section("New situations", (ERROR_NOTE, *_reproduction_images(evaluation))),
        Section("Tracking", _tracking_images(evaluation)),
        Section("Full and semi-tied covariances", _covariance_images(evaluations)),
        Section("All errors", (_settings_text(evaluations), summary, *errors)),
    )


def _model_images(evaluation: StructureEvaluation) -> tuple[Image, ...]:
    skill, horizon = evaluation.fit.skill, len(evaluation.demonstrations[0].x)
    return (
        figure_image(
            plots.demonstrations_in_frames(skill, evaluation.demonstrations[:TRAINING_DEMONSTRATIONS]),
            "The four demonstrations in each frame, with the one-sigma ellipses of the states. In the frame "
            "before the turn, paths meet at the origin where the hand grasps; in the frame after it, where "
            "the hand lets go.",
            "Four panels of paths with coloured ellipses, x-y and x-z planes, one row for each frame.",
        ),
        figure_image(
            plots.state_graph(skill),
            "States in their order, transition probabilities and duration distributions.",
            f"A chain of {skill.states} numbered nodes with arrows; below each node the density of its "
            "duration.",
        ),
        figure_image(
            plots.forward_variable(skill, horizon=horizon),
            "Above: probability of each state over time before anything is observed. Below: the rescaled "
            "forward variable, the probability that a segment of each state ends, given that one ends.",
            "Two panels over time in which coloured curves rise and fall one after the other.",
        ),
    )


def _precision_images(evaluation: StructureEvaluation) -> tuple[Image, ...]:
    return (
        figure_image(
            plots.state_deviations(evaluation.fit.skill),
            "Standard deviation of each state in each frame. A minimum is a phase in which all "
            "demonstrations agree: grasping in the first frame, the end of the turn in the second.",
            "Four panels of lines over the states on a logarithmic scale; the most precise state is shaded.",
        ),
    )


def _reproduction_images(evaluation: StructureEvaluation) -> tuple[Image, ...]:
    return tuple(
        figure_image(
            plots.reproduction(
                reproduction.adapted, reproduction.motion, _static_frames(demo), demonstration=demo
            ),
            f"{demo.name}, a new situation: adapted states, the reproduction, and the demonstration.",
            f"Two planes and a spatial view of the motion for {demo.name}, with the demonstrated path.",
        )
        for reproduction, demo in zip(
            evaluation.from_first_point[TRAINING_DEMONSTRATIONS:],
            evaluation.demonstrations[TRAINING_DEMONSTRATIONS:],
            strict=True,
        )
    )


def _static_frames(demo: Demonstration) -> list[Frame]:
    return [frame for frame in demo.frames if isinstance(frame, Frame)]


def _tracking_images(evaluation: StructureEvaluation) -> tuple[Image, ...]:
    reproduction = evaluation.from_first_point[TRAINING_DEMONSTRATIONS]
    demo = evaluation.demonstrations[TRAINING_DEMONSTRATIONS]
    adapted, motion = reproduction.adapted, reproduction.motion
    likelihoods = adapted.log_state_likelihoods(motion.x[:1])
    states = adapted.dynamics.most_probable_states(likelihoods, len(motion.x))
    return (
        figure_image(
            plots.tracked_coordinates(adapted, states, motion, demonstration=demo),
            f"{demo.name}: means of the planned states with bands of one standard deviation, the motion, and "
            "the demonstration. The tracker follows narrow bands closely and deviates within wide ones.",
            "Seven panels over time, one for each coordinate of the pose.",
        ),
        figure_image(
            plots.feedback_gains(reproduction.feedback, adapted.layout),
            f"{demo.name}: stiffness and damping of the tracker. They decrease towards the end of the "
            "horizon, where a deviation no longer costs much.",
            "Four panels over time: stiffness above, damping below, for position and orientation.",
        ),
    )


def _covariance_images(evaluations: Sequence[StructureEvaluation]) -> tuple[Image, ...]:
    return (
        figure_image(
            plots.covariance_correlations([evaluation.fit.skill for evaluation in evaluations]),
            "Correlation between the covariances of any two states. A shared basis makes them more similar.",
            "Heat maps of correlation coefficients between states, one for each frame and structure.",
        ),
        figure_image(
            plots.basis_vectors(evaluations[-1].fit.skill),
            "Basis vectors that all states of a frame share: coordinates that move together.",
            "Heat maps of the basis, a column for each vector, a row for each coordinate.",
        ),
        figure_image(
            plots.likelihood_trace([evaluation.fit for evaluation in evaluations]),
            "Log-likelihood of the demonstrations over the iterations of expectation-maximisation.",
            "Increasing curves that level off, one for each covariance structure.",
        ),
    )


def _settings_text(evaluations: Sequence[StructureEvaluation]) -> str:
    skill, demonstrations = evaluations[-1].fit.skill, evaluations[-1].demonstrations
    return (
        f"Settings: {skill.states} states initialised from time bins, regularisation "
        f"{SETTINGS.regularisation:g}, covariance regularisation {COVARIANCE_REGULARISATION:g}, control cost "
        f"{CONTROL_COST:g}, period {skill.period:g} s, {len(demonstrations[0].x)} steps. The first "
        f"{TRAINING_DEMONSTRATIONS} situations were demonstrated, the others are new. Errors at the end "
        f"compare the last step with that of the demonstration. Library: {skill.provenance.library}."
    )
