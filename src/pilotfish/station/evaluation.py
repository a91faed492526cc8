"""Replaying a skill where a person also did the task, and how far the two are apart.

The protocol of the published valve figures (Tanwani 2018, table 4.1), for the demonstration and for
reproductions alike.
"""

from dataclasses import dataclass

import numpy as np

from pilotfish.control import Feedback, Motion, Reference
from pilotfish.demonstrations import Demonstration, Layout, Quantity
from pilotfish.errors import InvalidInput
from pilotfish.geometry import angle
from pilotfish.models import AdaptedSkill, EMSettings, Skill, adapt
from pilotfish.planning import expected_plan, plan
from pilotfish.station.following import followed, setting
from pilotfish.types import Array, Float

STATES, TRAINED = 7, 4  # states of the skill; demonstrations to learn from, the rest is new to it
SETTINGS = EMSettings(regularisation=1e-5)
SLACK, EFFORT = 2e-3, 9.0  # added to variances before they become weights; the price R of inputs


@dataclass(frozen=True, slots=True, eq=False)
class Replay:
    """A skill in the situation of a demonstration, and the motion that came of it.

    Reference and feedback are those of a flat map where orientations are on S^3 (following.Setting).
    """

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
    here = setting(_adapted(skill, demonstration))
    start = here.inward(demonstration.x[0])
    reference = plan(here.flat, start, horizon=len(demonstration.x), slack=slack)
    return Replay(here.adapted, reference, *followed(here, reference, start, effort))


def replay_from_mean(
    skill: Skill, demonstration: Demonstration, *, slack: float = SLACK, effort: float = EFFORT
) -> Replay:
    """As replay, but from the mean of the first state that the skill expects: nothing is known of the start.

    Raises: InvalidInput, as replay does.
    """
    here = setting(_adapted(skill, demonstration))
    reference = expected_plan(here.flat, horizon=len(demonstration.x), slack=slack)
    return Replay(here.adapted, reference, *followed(here, reference, reference.targets[0], effort))


def mean_squared_error(motion: Motion, demonstration: Demonstration) -> float:
    """The mean over steps and coordinates of the squared difference; derivatives are left out.

    For a pose this mixes m^2 and squared quaternion entries, as the published figures do. Of q and -q, where
    orientations are on S^3, the nearer counts.
    Raises: InvalidInput, when the two differ in shape.
    """
    _require_same_shape(motion, demonstration)
    columns = _coordinates(demonstration.layout)
    x = _signed(motion.x, demonstration)
    return float(np.mean((x[:, columns] - demonstration.x[:, columns]) ** 2))


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
    columns = _first(demonstration.layout, Quantity.QUATERNION, Quantity.ORIENTATION)
    return float(angle(motion.x[-1, columns], demonstration.x[-1, columns]))


def largest_push(motion: Motion, layout: Layout) -> float:
    """The largest acceleration of the position that the motion was given [unit of the position/s^2].

    Raises: InvalidInput, when there is no position.
    """
    columns = _first(layout.tangent, Quantity.POSITION)
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


def _coordinates(layout: Layout) -> list[int]:
    parts = zip(layout.parts, layout.slices, strict=True)
    return [i for part, here in parts if part.derivative == 0 for i in range(here.start, here.stop)]


def _signed(x: Float[Array, "T D"], demonstration: Demonstration) -> Float[Array, "T D"]:
    signed = x.copy()
    for first in demonstration.layout.turns:
        here = slice(first, first + 4)
        away = np.sum(x[:, here] * demonstration.x[:, here], axis=1, keepdims=True) < 0.0
        signed[:, here] = np.where(away, -x[:, here], x[:, here])
    return signed


def _first(layout: Layout, *quantities: Quantity) -> slice:
    for part, columns in zip(layout.parts, layout.slices, strict=True):
        if part.quantity in quantities and part.derivative == 0:
            return columns
    wanted = " or ".join(quantity.value for quantity in quantities)
    raise InvalidInput(f"the columns are {', '.join(layout.names)}, expected a {wanted} among them")


def _require_same_shape(motion: Motion, demonstration: Demonstration) -> None:
    if motion.x.shape != demonstration.x.shape:
        raise InvalidInput(
            f"the motion has shape {motion.x.shape}, expected {demonstration.x.shape} like demonstration "
            f"{demonstration.name!r}"
        )
