"""The report of the demonstration: its pictures, and what to see in them."""

from collections.abc import Sequence

from pilotfish import plots
from pilotfish.demonstrations import Demonstration, Frame
from pilotfish.models import log_likelihood_of_states, most_probable_states
from pilotfish.station.evaluation import EFFORT, SETTINGS, SLACK, TRAINED
from pilotfish.station.lessons import Lesson
from pilotfish.station.report import Notice, Picture, Section, Table

RECORDED = "A person guided a robot arm through opening a valve, which stood at another angle each time. "
GENERATED = "Generated movements stand in for a person who guides a robot arm through opening a valve. "
INTRODUCTION = (
    "From the first four showings a task-parameterised hidden semi-Markov model was learned: seven states "
    "that follow each other, each with a Gaussian as seen from the valve before and from the valve after, "
    "and a duration. Then the skill was adapted to where the valve stands in each situation, four of them "
    "new to it, and a linear-quadratic tracker made the motion. States are numbered from 0, and a state has "
    "the same colour in every picture."
)
AFTERWARDS = (
    "Until the valve is open, its frames tell where the hand must be. Then the hand lets go and leaves as "
    "it likes: there the demonstrations differ from each other, and a replay from what was shown. Errors "
    "of the end measure that last part."
)


def sections(lessons: Sequence[Lesson], measured: Sequence[Table], notice: str) -> tuple[Section, ...]:
    """The report, from the skill of the last lesson; the lessons before serve for comparison."""
    *numbers, errors = measured
    lesson = lessons[-1]
    notices = (Notice(notice),) if notice else ()
    return (
        Section("In short", (*notices, (GENERATED if notice else RECORDED) + INTRODUCTION, errors)),
        Section("What was shown, and what was learned", _learned(lesson)),
        Section("Where each frame is precise", _precise(lesson)),
        Section("New situations", (AFTERWARDS, *_replayed(lesson))),
        Section("How the motion was tracked", _tracked(lesson)),
        Section("What full and semi-tied covariances share", _shared(lessons)),
        Section("All numbers", (_protocol(lessons), *numbers)),
    )


def _learned(lesson: Lesson) -> tuple[Picture, ...]:
    skill, horizon = lesson.fit.skill, len(lesson.shown[0].x)
    return (
        Picture(
            plots.demonstrations_seen(skill, lesson.shown[:TRAINED]),
            "The four demonstrations as each frame sees them, with the one-sigma ellipses of the states. "
            "Paths meet at the origin where the hand grasps (seen from the valve before) and lets go (seen "
            "from the valve after).",
            "Four panels of paths with coloured ellipses, x-y and x-z planes, one row for each frame.",
        ),
        Picture(
            plots.state_graph(skill),
            "The states in the order of time, how probably one follows another, and how long each lasts.",
            f"A chain of {skill.states} numbered nodes with arrows; under each node the density of its "
            "duration.",
        ),
        Picture(
            plots.forward_variable(skill, horizon=horizon),
            "Above: how probably the skill is in each state as time goes by, before anything is observed. "
            "Below: the rescaled forward variable, how probably a visit to each state ends, given that one "
            "does.",
            "Two panels over time in which one coloured curve after the other rises and falls.",
        ),
    )


def _precise(lesson: Lesson) -> tuple[Picture, ...]:
    return (
        Picture(
            plots.deviations(lesson.fit.skill),
            "Standard deviation of each state in each frame. A dip is a phase that all demonstrations share"
            " in that frame: grasping in the first, stopping the turn in the second.",
            "Four panels of lines over the states on a logarithmic scale; the most precise state is shaded.",
        ),
    )


def _replayed(lesson: Lesson) -> tuple[Picture, ...]:
    return tuple(
        Picture(
            plots.reproduction(replay.skill, replay.motion, _standing(shown), human=shown),
            f"{shown.name}, new to the skill: adapted states, the reproduction and the demonstration made "
            "there.",
            f"Two planes and a view in space of the motion for {shown.name}, beside the path that was shown.",
        )
        for replay, shown in zip(lesson.own[TRAINED:], lesson.shown[TRAINED:], strict=True)
    )


def _standing(shown: Demonstration) -> list[Frame]:
    return [given for given in shown.frames if isinstance(given, Frame)]


def _tracked(lesson: Lesson) -> tuple[Picture, ...]:
    replay, shown = lesson.own[TRAINED], lesson.shown[TRAINED]
    seen = log_likelihood_of_states(replay.skill, replay.motion.x[:1])
    states = most_probable_states(replay.skill.dynamics, seen, len(replay.motion.x))
    return (
        Picture(
            plots.tracked_coordinates(replay.skill, states, replay.motion, human=shown),
            f"{shown.name}: the planned states' means with bands of one standard deviation, the motion, and "
            "the demonstration made there. The tracker keeps to narrow bands and yields in wide ones.",
            "Seven panels over time, one for each coordinate of the pose.",
        ),
        Picture(
            plots.gains(replay.feedback, replay.skill.layout),
            f"{shown.name}: how firmly the tracker pulls towards its targets. Towards the end of the "
            "horizon there is nothing left to gain, so stiffness fades.",
            "Four panels over time: stiffness above, damping below, for position and orientation.",
        ),
    )


def _shared(lessons: Sequence[Lesson]) -> tuple[Picture, ...]:
    return (
        Picture(
            plots.component_correlations([lesson.fit.skill for lesson in lessons]),
            "How alike the covariances of any two states are. Sharing a basis makes states alike.",
            "Heat maps of correlation coefficients between states, one for each frame and structure.",
        ),
        Picture(
            plots.basis_vectors(lessons[-1].fit.skill),
            "The basis vectors that all states of a frame share: columns that move together.",
            "Heat maps of the basis, a column for each vector, a row for each coordinate.",
        ),
        Picture(
            plots.likelihood_trace([lesson.fit for lesson in lessons]),
            "The log-likelihood of the demonstrations along the iterations of expectation-maximisation.",
            "Rising curves that level off, one for each covariance structure.",
        ),
    )


def _protocol(lessons: Sequence[Lesson]) -> str:
    skill, shown = lessons[-1].fit.skill, lessons[-1].shown
    return (
        f"{skill.states} states started from time bins, regularisation {SETTINGS.regularisation:g}, slack "
        f"{SLACK:g} added to variances in the plan, effort {EFFORT:g}, period {skill.period:g} s, "
        f"{len(shown[0].x)} steps. The first {TRAINED} situations were shown, the others are new. Errors of"
        f" the end compare the last step with the demonstration's. Made by {skill.provenance.library}."
    )
