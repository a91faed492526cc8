"""Intention: which skill of a list the operator follows, in which state, or none.

Hypotheses. Under skill m the commands follow its chain of states in the frames that the operator sees; the
filter of `kernels/occupancy.py` gives the predictive density p_m(x_t | x_1 .. x_t-1). Under "none" any pose
is equally likely, with the log-density `level`. Their probabilities w are filtered together:

    w'_m = (1 - SWITCH) w_m + SWITCH / (M + 1)          the operator may change the intention
    w_m  proportional to w'_m p_m(x_t | x_1 .. x_t-1)

Tempering. In a state, the deviation from its mean persists: the steps of one passage are about one
observation, not as many as there are steps, and the product over steps would be overconfident. The density of
a command in a state is therefore raised to the power `tempering`, the number of states per step of a
demonstration: a passage then counts once. Transitions between states are not dependent in this way and keep
their probabilities: a skill whose states are visited in another order is refuted by each step back.

Level. `calibrate_intention` leaves out each demonstration once, learns from the others, and takes the 2 %
quantile of the predictive log-densities of the steps left out, for the skill where it is lowest.

Unsure is the probability that the most probable skill is not meant: none is, or another that fits as well.

Invariants. Probabilities of skills and none sum to one. Equal skills have equal probabilities. With stale
frames nothing is observed, and the probabilities approach equal ones.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from pilotfish.assistance.assistant import AssistedSkill, assisted_skill, make_assistant
from pilotfish.assistance.coordinates import coordinate_frames
from pilotfish.assistance.occupancy import initial_belief
from pilotfish.assistance.operator_noise import DEFAULT_NOISE, OperatorNoise
from pilotfish.assistance.pose_validation import validate_pose
from pilotfish.assistance.situation import Situation, find_situation, update_situation
from pilotfish.demonstrations import Demonstration, Frame
from pilotfish.errors import InvalidInput, SkillError
from pilotfish.kernels import command_log_likelihoods, observe_command, predict_belief
from pilotfish.models import Skill
from pilotfish.types import Array, Float
from pilotfish.validation import require_number, require_type, shorten_repr

SWITCH = 1e-3  # per step
QUANTILE = 0.02  # of the log-densities of demonstrations left out
MAX_LEVEL, MIN_TEMPERING = 1e6, 1e-6
MIN_LOG_DENSITY = -1e6  # of a command so far away that its density overflows


@dataclass(frozen=True, slots=True)
class IntentionCalibration:
    """Settings of the hypothesis "none" and of the evidence, from `calibrate_intention`.

    Attributes:
        level: Tempered log-density of any command under "none", up to the constant that all skills leave out.
        tempering: Exponent of the density of a command in a state, above 0 to 1.

    Raises:
        InvalidInput: If a number is outside its range.
    """

    level: float
    tempering: float

    def __post_init__(self) -> None:
        require_number(self.level, "level", -MAX_LEVEL, MAX_LEVEL)
        require_number(self.tempering, "tempering", MIN_TEMPERING, 1.0)


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class IntentionFilter:
    """Skills that the operator may intend, and the settings.

    Attributes:
        skills: Prepared skills, with the same coordinates and the same period.
        calibration: Level of "none" and tempering.
        noise: Imprecision of the operator.
    """

    skills: tuple[AssistedSkill, ...]
    calibration: IntentionCalibration
    noise: OperatorNoise


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class IntentionState:
    """State of the filter.

    Attributes:
        probabilities: Probability of each skill, then of none.
        beliefs: Probability of each age and state, (L, K), of each skill, given that it is meant.
        situations: The skills in the frames that the operator sees.
        is_first: Whether no command has been observed.
    """

    probabilities: Float[Array, " M"]
    beliefs: tuple[Array, ...]
    situations: tuple[Situation, ...]
    is_first: bool = True


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Intention:
    """What the operator is likely to intend.

    Attributes:
        skills: Probability of each skill.
        none: Probability of none; skills and none sum to one.
        states: Probability of each state, (K,), of each skill, given that it is meant.
    """

    skills: Float[Array, " S"]
    none: float
    states: tuple[Array, ...]

    @property
    def unsure(self) -> float:
        """Probability that the most probable skill is not meant."""
        return float(1.0 - self.skills.max())


def intention_filter(
    skills: Sequence[AssistedSkill], calibration: IntentionCalibration, *, noise: OperatorNoise | None = None
) -> IntentionFilter:
    """Create the filter of the skill that an operator intends.

    Args:
        skills: Prepared skills, with the same coordinates and the same period.
        calibration: Level of "none" and tempering, from `calibrate_intention`.
        noise: Imprecision of the operator; None is 1 cm and 0.05 rad.

    Raises:
        InvalidInput: If skills is empty, or two differ in coordinates or period.
    """
    assistant = make_assistant(skills, noise=noise)
    require_type(calibration, "calibration", IntentionCalibration, "calibrate_intention(...) makes one")
    periods = [skill.skill.period for skill in assistant.skills]
    if not np.allclose(periods, periods[0], rtol=1e-6):
        raise InvalidInput(f"the periods of the skills are {periods} s, expected equal ones; resample them")
    return IntentionFilter(assistant.skills, calibration, assistant.noise)


def start_intention(intention: IntentionFilter, frames: Sequence[Frame]) -> IntentionState:
    """Return the filter's state before the first command: skills and none are equally probable.

    Args:
        intention: Filter from `intention_filter`.
        frames: Frames that the operator sees, of all skills.

    Raises:
        InvalidInput: If a frame is missing or cannot be used.
        NotPositiveDefinite: If a covariance is singular in these frames.
    """
    _require_filter(intention)
    hypotheses = len(intention.skills) + 1
    return IntentionState(
        np.full(hypotheses, 1.0 / hypotheses),
        tuple(initial_belief(skill.tables) for skill in intention.skills),
        tuple(find_situation(skill, frames, frames, intention.noise) for skill in intention.skills),
    )


def step_intention(
    intention: IntentionFilter,
    state: IntentionState,
    pose: Float[Array, " D"],
    frames: Sequence[Frame] | None,
) -> tuple[IntentionState, Intention]:
    """Observe one command; call it once per period of the skills.

    Args:
        intention: Filter from `intention_filter`.
        state: State after the last command.
        pose: Command, in the coordinates of the skills.
        frames: Frames that the operator saw when he commanded the pose; None if they are stale.

    Returns:
        The next state and the intention.

    Raises:
        InvalidInput: If the pose does not fit. The state remains valid: go on with it.
    """
    _require_filter(intention)
    require_type(state, "state", IntentionState, "begin with start_intention")
    if len(state.beliefs) != len(intention.skills):
        raise InvalidInput(
            f"state has {len(state.beliefs)} skills, expected {len(intention.skills)}; begin with "
            "start_intention"
        )
    x = validate_pose(intention.skills[0].skill.layout, pose)
    level, tempering = intention.calibration.level, intention.calibration.tempering
    situations, beliefs, evidence = [], [], []
    for skill, belief, situation in zip(intention.skills, state.beliefs, state.situations, strict=True):
        situation = update_situation(situation, skill, frames, frames, intention.noise)
        predicted = belief if state.is_first else predict_belief(skill.tables, belief)
        log_density, observed = _observe(predicted, situation, x, tempering)
        situations.append(situation)
        beliefs.append(observed if situation.is_current else predicted)
        evidence.append(log_density if situation.is_current else level)
    probs = _update(state.probabilities, np.array([*evidence, level]))
    states = tuple(belief.sum(axis=0) for belief in beliefs)
    after = IntentionState(probs, tuple(beliefs), tuple(situations), is_first=False)
    return after, Intention(probs[:-1], float(probs[-1]), states)


def calibrate_intention(
    recordings: Sequence[Sequence[Demonstration]],
    learn_skill: Callable[[list[Demonstration]], Skill],
    noise: OperatorNoise = DEFAULT_NOISE,
) -> IntentionCalibration:
    """Calibrate "none" and the tempering by leaving out each demonstration once.

    Args:
        recordings: Demonstrations of each skill, at least three for each.
        learn_skill: Function that learns a skill from some of its demonstrations, as from all.
        noise: Imprecision of the operator.

    Returns:
        The calibration, as at the head of this file.

    Raises:
        InvalidInput: If there are fewer than three demonstrations of a skill, or they do not fit it.
    """
    require_type(recordings, "recordings", Sequence, "pass a list with a list of demonstrations per skill")
    require_type(noise, "noise", OperatorNoise, "OperatorNoise() makes one")
    if not recordings:
        raise InvalidInput("recordings is empty, expected the demonstrations of at least one skill")
    pairs = [_leave_out(demos, learn_skill, f"recordings[{n}]") for n, demos in enumerate(recordings)]
    shares = [min(1.0, skill.states / len(demo.x)) for skill_pairs in pairs for skill, demo in skill_pairs]
    tempering = float(np.mean(shares))
    levels = [
        np.quantile(
            np.concatenate([predictive_log_densities(*pair, tempering, noise) for pair in skill_pairs]),
            QUANTILE,
        )
        for skill_pairs in pairs
    ]
    return IntentionCalibration(max(float(min(levels)), -MAX_LEVEL), tempering)


def _leave_out(
    demonstrations: Sequence[Demonstration], learn_skill: Callable[[list[Demonstration]], Skill], name: str
) -> list[tuple[Skill, Demonstration]]:
    """Return each demonstration with the skill learned from the others."""
    require_type(demonstrations, name, Sequence, "pass a list of demonstrations")
    if len(demonstrations) < 3:
        raise InvalidInput(
            f"{name} has {len(demonstrations)} demonstrations, expected at least 3, so that a skill can be "
            "learned without each; record more"
        )
    for demo in demonstrations:
        require_type(demo, "a demonstration", Demonstration, "create one with pf.demonstration")
    return [
        (learn_skill([demo for i, demo in enumerate(demonstrations) if i != m]), left_out)
        for m, left_out in enumerate(demonstrations)
    ]


def predictive_log_densities(
    skill: Skill, demonstration: Demonstration, tempering: float, noise: OperatorNoise = DEFAULT_NOISE
) -> Float[Array, " T"]:
    """Return the tempered log-density of each step of a demonstration, given those before, up to a constant.

    Args:
        skill: Learned skill.
        demonstration: Recording of the same columns, in its own situation.
        tempering: Exponent of the density of a command in a state, above 0 to 1.
        noise: Imprecision of the operator.

    Raises:
        InvalidInput: If the demonstration does not fit the skill.
    """
    require_type(demonstration, "demonstration", Demonstration, "pf.demonstration makes one")
    require_type(noise, "noise", OperatorNoise, "OperatorNoise() makes one")
    exponent = require_number(tempering, "tempering", MIN_TEMPERING, 1.0)
    prepared = assisted_skill(skill)
    if demonstration.layout != skill.layout:
        raise InvalidInput("the demonstration has other columns than the skill, expected the same layout")
    belief, situation = initial_belief(prepared.tables), None
    densities = np.empty(len(demonstration.x))
    for t, row in enumerate(demonstration.x[:, np.array(skill.layout.coordinates)]):
        if t == 0 or any(frame.is_moving for frame in demonstration.frames):
            frames = coordinate_frames([frame.at(t) for frame in demonstration.frames], skill.layout)
            situation = find_situation(prepared, frames, frames, noise)
        assert situation is not None
        belief = predict_belief(prepared.tables, belief) if t else belief
        x = validate_pose(prepared.skill.layout, row)
        densities[t], belief = _observe(belief, situation, x, exponent)
    return densities


def _observe(
    belief: Float[Array, "L K"], situation: Situation, x: Float[Array, " D"], tempering: float
) -> tuple[float, Float[Array, "L K"]]:
    """Return the predictive log-density of a command, and the belief given the command."""
    try:
        log_likelihoods = tempering * command_log_likelihoods(situation.carried, x)
    except SkillError:  # too far for a finite density
        return MIN_LOG_DENSITY, belief
    with np.errstate(divide="ignore"):
        log_joint = np.log(belief.sum(axis=0)) + log_likelihoods
    density = float(np.logaddexp.reduce(log_joint))
    return max(density, MIN_LOG_DENSITY), observe_command(belief, log_likelihoods)


def _update(before: Float[Array, " M"], log_evidence: Float[Array, " M"]) -> Float[Array, " M"]:
    """Return the probabilities of the hypotheses after a step."""
    changed = (1.0 - SWITCH) * before + SWITCH / len(before)
    joint = changed * np.exp(log_evidence - log_evidence.max())
    return np.asarray(joint / joint.sum())


def _require_filter(intention: IntentionFilter) -> None:
    require_type(intention, "intention", IntentionFilter, "create one with intention_filter")
