"""Compare reproductions with demonstrations: the errors of Tanwani 2018, table 4.1."""

import numpy as np

from pilotfish.control import Motion
from pilotfish.demonstrations import Demonstration, Layout, Quantity
from pilotfish.errors import InvalidInput
from pilotfish.geometry import angle
from pilotfish.models import Skill
from pilotfish.planning.plan import CONTROL_COST, COVARIANCE_REGULARISATION
from pilotfish.planning.reproduction import Reproduction, reproduce
from pilotfish.types import Array, Float


def reproduce_demonstration(
    skill: Skill,
    demonstration: Demonstration,
    *,
    from_first_state: bool = False,
    control_cost: float = CONTROL_COST,
    covariance_regularisation: float = COVARIANCE_REGULARISATION,
) -> Reproduction:
    """Reproduce a skill in the situation and over the length of a demonstration.

    Args:
        skill: Learned skill.
        demonstration: Demonstration with frames that do not move.
        from_first_state: Start at the mean of the skill's first state instead of the demonstration's first point.
        control_cost: R, the cost of squared acceleration.
        covariance_regularisation: Variance added to every variance before it becomes a weight
            [unit of x squared].

    Raises:
        InvalidInput: If skill and demonstration differ in columns, period or frames, a frame moves, or the
            columns are not coordinates followed by the derivative of each.
    """
    _require_same_columns(skill, demonstration)
    return reproduce(
        skill,
        demonstration.frames,
        None if from_first_state else demonstration.x[0],
        horizon=len(demonstration.x),
        control_cost=control_cost,
        covariance_regularisation=covariance_regularisation,
    )


def mean_squared_error(motion: Motion, demonstration: Demonstration) -> float:
    """The mean over steps and coordinates of the squared difference; derivatives are left out.

    For a pose this mixes m^2 and squared quaternion entries, as the published figures do. Of q and -q, where
    orientations are on S^3, the nearer counts.
    Raises: InvalidInput, when the two differ in shape.
    """
    _require_same_shape(motion, demonstration)
    columns = _coordinates(demonstration.layout)
    x = _align_signs(motion.x, demonstration)
    return float(np.mean((x[:, columns] - demonstration.x[:, columns]) ** 2))


def end_position_error(motion: Motion, demonstration: Demonstration) -> float:
    """The distance between the last positions [unit of the position].

    Raises: InvalidInput, when the two differ in shape or have no position.
    """
    _require_same_shape(motion, demonstration)
    columns = _find_part(demonstration.layout, Quantity.POSITION)
    return float(np.linalg.norm(motion.x[-1, columns] - demonstration.x[-1, columns]))


def end_orientation_error(motion: Motion, demonstration: Demonstration) -> float:
    """The angle [rad] between the last orientations, whatever the length of the motion's quaternion.

    Raises: InvalidInput, when the two differ in shape or have no orientation.
    """
    _require_same_shape(motion, demonstration)
    columns = _find_part(demonstration.layout, Quantity.QUATERNION, Quantity.ORIENTATION)
    return float(angle(motion.x[-1, columns], demonstration.x[-1, columns]))


def largest_acceleration(motion: Motion, layout: Layout) -> float:
    """The largest acceleration of the position that the motion was given [unit of the position/s^2].

    Raises: InvalidInput, when there is no position.
    """
    columns = _find_part(layout.tangent, Quantity.POSITION)
    return float(np.linalg.norm(motion.u[:, columns], axis=1).max())


def _require_same_columns(skill: Skill, demonstration: Demonstration) -> None:
    if (demonstration.layout, demonstration.period) != (skill.layout, skill.period):
        raise InvalidInput(
            f"demonstration {demonstration.name!r} has the columns {', '.join(demonstration.layout.names)} every "
            f"{demonstration.period} s, the skill {', '.join(skill.layout.names)} every {skill.period} s"
        )


def _coordinates(layout: Layout) -> list[int]:
    parts = zip(layout.parts, layout.slices, strict=True)
    return [i for part, here in parts if part.derivative == 0 for i in range(here.start, here.stop)]


def _align_signs(x: Float[Array, "T D"], demonstration: Demonstration) -> Float[Array, "T D"]:
    signed = x.copy()
    for first in demonstration.layout.orientation_starts:
        here = slice(first, first + 4)
        away = np.sum(x[:, here] * demonstration.x[:, here], axis=1, keepdims=True) < 0.0
        signed[:, here] = np.where(away, -x[:, here], x[:, here])
    return signed


def _find_part(layout: Layout, *quantities: Quantity) -> slice:
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
