"""The report of the demonstration: its pictures, and what to see in them."""

from collections.abc import Sequence

from pilotfish import plots
from pilotfish.cli.demo.demonstrations import StructureEvaluation
from pilotfish.cli.demo.protocol import (
    CONTROL_COST,
    COVARIANCE_REGULARISATION,
    SETTINGS,
    TRAINING_DEMONSTRATIONS,
)
from pilotfish.cli.output.report import Notice, ReportFigure, Section, Table
from pilotfish.demonstrations import Demonstration, Frame
from pilotfish.models import log_state_likelihoods

RECORDED_TEXT = (
    "A person guided a robot arm through opening a valve, which stood at another angle each time. "
)
GENERATED_TEXT = "Generated movements stand in for a person who guides a robot arm through opening a valve. "
INTRODUCTION = (
    "From the first four showings a task-parameterised hidden semi-Markov model was learned: seven states "
    "that follow each other, each with a Gaussian as seen from the valve before and from the valve after, "
    "and a duration. Then the skill was adapted to where the valve stands in each situation, four of them "
    "new to it, and a linear-quadratic tracker made the motion. States are numbered from 0, and a state has "
    "the same colour in every picture."
)
ERROR_NOTE = (
    "Until the valve is open, its frames tell where the hand must be. Then the hand lets go and leaves as "
    "it likes: there the demonstrations differ from each other, and a replay from what was shown. Errors "
    "of the end measure that last part."
)


def report_sections(
    evaluations: Sequence[StructureEvaluation], report_tables: Sequence[Table], notice: str
) -> tuple[Section, ...]:
    """The report, from the skill of the last lesson; the lessons before serve for comparison."""
    *numbers, errors = report_tables
    evaluation = evaluations[-1]
    notices = (Notice(notice),) if notice else ()
    return (
        Section("In short", (*notices, (GENERATED_TEXT if notice else RECORDED_TEXT) + INTRODUCTION, errors)),
        Section("What was shown, and what was learned", _learning_figures(evaluation)),
        Section("Where each frame is precise", _precision_figures(evaluation)),
        Section("New situations", (ERROR_NOTE, *_reproduction_figures(evaluation))),
        Section("How the motion was tracked", _tracking_figures(evaluation)),
        Section("What full and semi-tied covariances share", _covariance_figures(evaluations)),
        Section("All numbers", (_settings_text(evaluations), *numbers)),
    )


def _learning_figures(evaluation: StructureEvaluation) -> tuple[ReportFigure, ...]:
    skill, horizon = evaluation.fit.skill, len(evaluation.demonstrations[0].x)
    return (
        ReportFigure(
            plots.demonstrations_in_frames(skill, evaluation.demonstrations[:TRAINING_DEMONSTRATIONS]),
            "The four demonstrations as each frame sees them, with the one-sigma ellipses of the states. "
            "Paths meet at the origin where the hand grasps (seen from the valve before) and lets go (seen "
            "from the valve after).",
            "Four panels of paths with coloured ellipses, x-y and x-z planes, one row for each frame.",
        ),
        ReportFigure(
            plots.state_graph(skill),
            "The states in the order of time, how probably one follows another, and how long each lasts.",
            f"A chain of {skill.states} numbered nodes with arrows; under each node the density of its "
            "duration.",
        ),
        ReportFigure(
            plots.forward_variable(skill, horizon=horizon),
            "Above: how probably the skill is in each state as time goes by, before anything is observed. "
            "Below: the rescaled forward variable, how probably a visit to each state ends, given that one "
            "does.",
            "Two panels over time in which one coloured curve after the other rises and falls.",
        ),
    )


def _precision_figures(evaluation: StructureEvaluation) -> tuple[ReportFigure, ...]:
    return (
        ReportFigure(
            plots.state_deviations(evaluation.fit.skill),
            "Standard deviation of each state in each frame. A dip is a phase that all demonstrations share"
            " in that frame: grasping in the first, stopping the turn in the second.",
            "Four panels of lines over the states on a logarithmic scale; the most precise state is shaded.",
        ),
    )


def _reproduction_figures(evaluation: StructureEvaluation) -> tuple[ReportFigure, ...]:
    return tuple(
        ReportFigure(
            plots.reproduction(replay.adapted, replay.motion, _static_frames(shown), demonstration=shown),
            f"{shown.name}, new to the skill: adapted states, the reproduction and the demonstration made "
            "there.",
            f"Two planes and a view in space of the motion for {shown.name}, beside the path that was shown.",
        )
        for replay, shown in zip(
            evaluation.from_first_point[TRAINING_DEMONSTRATIONS:],
            evaluation.demonstrations[TRAINING_DEMONSTRATIONS:],
            strict=True,
        )
    )


def _static_frames(shown: Demonstration) -> list[Frame]:
    return [given for given in shown.frames if isinstance(given, Frame)]


def _tracking_figures(evaluation: StructureEvaluation) -> tuple[ReportFigure, ...]:
    replay, shown = (
        evaluation.from_first_point[TRAINING_DEMONSTRATIONS],
        evaluation.demonstrations[TRAINING_DEMONSTRATIONS],
    )
    seen = log_state_likelihoods(replay.adapted, replay.motion.x[:1])
    states = replay.adapted.dynamics.most_probable_states(seen, len(replay.motion.x))
    return (
        ReportFigure(
            plots.tracked_coordinates(replay.adapted, states, replay.motion, demonstration=shown),
            f"{shown.name}: the planned states' means with bands of one standard deviation, the motion, and "
            "the demonstration made there. The tracker keeps to narrow bands and yields in wide ones.",
            "Seven panels over time, one for each coordinate of the pose.",
        ),
        ReportFigure(
            plots.feedback_gains(replay.feedback, replay.adapted.layout),
            f"{shown.name}: how firmly the tracker pulls towards its targets. Towards the end of the "
            "horizon there is nothing left to gain, so stiffness fades.",
            "Four panels over time: stiffness above, damping below, for position and orientation.",
        ),
    )


def _covariance_figures(evaluations: Sequence[StructureEvaluation]) -> tuple[ReportFigure, ...]:
    return (
        ReportFigure(
            plots.covariance_correlations([evaluation.fit.skill for evaluation in evaluations]),
            "How alike the covariances of any two states are. Sharing a basis makes states alike.",
            "Heat maps of correlation coefficients between states, one for each frame and structure.",
        ),
        ReportFigure(
            plots.basis_vectors(evaluations[-1].fit.skill),
            "The basis vectors that all states of a frame share: columns that move together.",
            "Heat maps of the basis, a column for each vector, a row for each coordinate.",
        ),
        ReportFigure(
            plots.likelihood_trace([evaluation.fit for evaluation in evaluations]),
            "The log-likelihood of the demonstrations along the iterations of expectation-maximisation.",
            "Rising curves that level off, one for each covariance structure.",
        ),
    )


def _settings_text(evaluations: Sequence[StructureEvaluation]) -> str:
    skill, shown = evaluations[-1].fit.skill, evaluations[-1].demonstrations
    return (
        f"{skill.states} states started from time bins, regularisation {SETTINGS.regularisation:g}, covariance "
        f"regularisation {COVARIANCE_REGULARISATION:g} in the plan, control cost {CONTROL_COST:g}, period {skill.period:g} s, "
        f"{len(shown[0].x)} steps. The first {TRAINING_DEMONSTRATIONS} situations were shown, the others are new. Errors of"
        f" the end compare the last step with the demonstration's. Made by {skill.provenance.library}."
    )
