"""Replaying a skill where a person also did the task, and how far the two are apart.

The protocol of the published valve figures (Tanwani 2018, table 4.1), for the demonstration and for
reproductions alike.
"""

from dataclasses import dataclass

import numpy as np

from pilotfish.control import Feedback, Motion, Reference, double_integrator, track
from pilotfish.demonstrations import Demonstration, Layout, Quantity
from pilotfish.errors import InvalidInput
from pilotfish.geometry import angle
from pilotfish.models import AdaptedSkill, EMSettings, Skill, adapt
from pilotfish.planning import expected_plan, plan
from pilotfish.types import Array, Float

STATES, TRAINED = 7, 4  # states of the skill; demonstrations to learn from, the rest is new to it
SETTINGS = EMSettings(regularisation=1e-5)
SLACK, EFFORT = 2e-3, 9.0  # added to variances before they become weights; the price R of inputs


@dataclass(frozen=True, slots=True, eq=False)
class Replay:
    """A skill in the situation of a demonstration, and the motion that came of it."""

    skill: AdaptedSkill
    reference: Reference
    feedback: Feedback
    motion: Motion


def replay(
    skill: Skill, demonstration: Demonstration, *, slack: float = SLACK, effort: float = EFFORT
) -> Replay:
    """The skill where the demonstration's objects stood, from where the person began, as many steps long.

    Raises: InvalidInput, when skill and demonstration differ in columns, period or frames, a frame moves, or
    the columns are not coordinates followed by the derivative of each.
    """
    here = _adapted(skill, demonstration)
    start = demonstration.x[0]
    reference = plan(here, start, horizon=len(demonstration.x), slack=slack)
    return _tracked(here, reference, start, effort)


def replay_from_mean(
    skill: Skill, demonstration: Demonstration, *, slack: float = SLACK, effort: float = EFFORT
) -> Replay:
    """As replay, but from the mean of the first state that the skill expects: nothing is known of the start.

    Raises: InvalidInput, as replay does.
    """
    here = _adapted(skill, demonstration)
    reference = expected_plan(here, horizon=len(demonstration.x), slack=slack)
    return _tracked(here, reference, reference.targets[0], effort)


def mean_squared_error(motion: Motion, demonstration: Demonstration) -> float:
    """The mean over steps and coordinates of the squared difference; derivatives are left out.

    For a pose this mixes m^2 and squared quaternion entries, as the published figures do.
    Raises: InvalidInput, when the two differ in shape.
    """
    _require_same_shape(motion, demonstration)
    columns = _coordinates(demonstration.layout)
    return float(np.mean((motion.x[:, columns] - demonstration.x[:, columns]) ** 2))


def end_point_error(motion: Motion, demonstration: Demonstration) -> float:
    """The distance between the last positions [unit of the position].

    Raises: InvalidInput, when the two differ in shape or have no position.
    """
    _require_same_shape(motion, demonstration)
    columns = _first(demonstration.layout, Quantity.POSITION)
    return float(np.linalg.norm(motion.x[-1, columns] - demonstration.x[-1, columns]))


def end_turn_error(motion: Motion, demonstration: Demonstration) -> float:
    """The angle [rad] between the last orientations, whatever the length of the motion's quaternion.

    Raises: InvalidInput, when the two differ in shape or have no orientation.
    """
    _require_same_shape(motion, demonstration)
    columns = _first(demonstration.layout, Quantity.QUATERNION)
    return float(angle(motion.x[-1, columns], demonstration.x[-1, columns]))


def largest_push(motion: Motion, layout: Layout) -> float:
    """The largest acceleration of the position that the motion was given [unit of the position/s^2].

    Raises: InvalidInput, when there is no position.
    """
    columns = _first(layout, Quantity.POSITION)
    return float(np.linalg.norm(motion.u[:, columns], axis=1).max())


def _adapted(skill: Skill, demonstration: Demonstration) -> AdaptedSkill:
    here, learned = (
        (", ".join(given.layout.names), given.period, given.layout) for given in (demonstration, skill)
    )
    if here != learned:
        raise InvalidInput(
            f"demonstration {demonstration.name!r} has the columns {here[0]} every {here[1]} s, the skill "
            f"{learned[0]} every {learned[1]} s"
        )
    return adapt(skill, demonstration.frames)


def _tracked(skill: AdaptedSkill, reference: Reference, start: Float[Array, " D"], effort: float) -> Replay:
    axes = coordinates_with_speeds(skill.layout)
    feedback = track(double_integrator(axes, period=skill.period), reference, effort)
    return Replay(skill, reference, feedback, feedback.rollout(start))


def coordinates_with_speeds(layout: Layout) -> int:
    """How many coordinates there are, when each has its derivative in the second half.

    Raises: InvalidInput, when the columns are others: a double integrator cannot follow them.
    """
    half = layout.width // 2
    here = [part for part, columns in zip(layout.parts, layout.slices, strict=True) if columns.stop <= half]
    there = layout.parts[len(here) :]
    if [(p.name, p.size, p.derivative + 1) for p in here] != [(p.name, p.size, p.derivative) for p in there]:
        raise InvalidInput(
            f"the columns are {', '.join(layout.names)}, expected coordinates, then the derivative of each; "
            "learn it again with them: pf.with_derivatives, or pilotfish learn --speeds"
        )
    return half


def _coordinates(layout: Layout) -> list[int]:
    parts = zip(layout.parts, layout.slices, strict=True)
    return [i for part, here in parts if part.derivative == 0 for i in range(here.start, here.stop)]


def _first(layout: Layout, quantity: Quantity) -> slice:
    for part, columns in zip(layout.parts, layout.slices, strict=True):
        if part.quantity is quantity and part.derivative == 0:
            return columns
    raise InvalidInput(f"the columns are {', '.join(layout.names)}, expected a {quantity.value} among them")


def _require_same_shape(motion: Motion, demonstration: Demonstration) -> None:
    if motion.x.shape != demonstration.x.shape:
        raise InvalidInput(
            f"the motion has shape {motion.x.shape}, expected {demonstration.x.shape} like demonstration "
            f"{demonstration.name!r}"
        )
