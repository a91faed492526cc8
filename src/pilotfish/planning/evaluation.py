"""Compare reproductions with demonstrations: the errors of Tanwani 2018, table 4.1."""

import numpy as np

from pilotfish.control import Motion
from pilotfish.demonstrations import Demonstration, Layout, Quantity
from pilotfish.errors import InvalidInput
from pilotfish.geometry import angle
from pilotfish.models import Skill
from pilotfish.planning.reproduction import Reproduction, reproduce
from pilotfish.types import Array, Float
from pilotfish.validation import finite_array


def reproduce_demonstration(
    skill: Skill,
    demonstration: Demonstration,
    *,
    from_first_state: bool = False,
    control_cost: float | None = None,
    covariance_regularisation: float | None = None,
    stepwise: bool = False,
) -> Reproduction:
    """Reproduce a skill in the situation and over the length of a demonstration.

    Args:
        skill: Learned skill.
        demonstration: Demonstration with frames that do not move.
        from_first_state: Start where the skill begins instead of at the demonstration's first point.
        control_cost: R, the cost of squared acceleration; None derives it from the scales of the skill.
        covariance_regularisation: Variance added to every variance before it becomes a weight
            [unit of x squared]; None derives it from the scales of the skill.
        stepwise: Whether to plan as published, see `plan`.

    Returns:
        The motion, its controller and its plan.

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
        stepwise=stepwise,
    )


def mean_squared_error(motion: Motion, demonstration: Demonstration) -> float:
    """Return the mean over steps and coordinates of the squared difference, without derivatives.

    For a pose this mixes m^2 and squared quaternion entries, as the published figures do. On S^3 the nearer
    of q and -q counts.

    Args:
        motion: Reproduced motion.
        demonstration: Demonstration with the same number of steps and columns.

    Raises:
        InvalidInput: If the two differ in shape.
    """
    _require_same_shape(motion, demonstration)
    columns = list(demonstration.layout.coordinates)
    x = _align_signs(motion.x, demonstration)
    return float(np.mean((x[:, columns] - demonstration.x[:, columns]) ** 2))


def end_position_error(motion: Motion, demonstration: Demonstration) -> float:
    """Return the distance between the last positions [unit of the position].

    Args:
        motion: Reproduced motion.
        demonstration: Demonstration with the same number of steps and columns.

    Raises:
        InvalidInput: If the two differ in shape or have no position.
    """
    _require_same_shape(motion, demonstration)
    columns = _find_part(demonstration.layout, Quantity.POSITION)
    return float(np.linalg.norm(motion.x[-1, columns] - demonstration.x[-1, columns]))


def end_orientation_error(motion: Motion, demonstration: Demonstration) -> float:
    """Return the angle between the last orientations [rad]; the norm of the quaternions does not matter.

    Args:
        motion: Reproduced motion.
        demonstration: Demonstration with the same number of steps and columns.

    Raises:
        InvalidInput: If the two differ in shape or have no orientation.
    """
    _require_same_shape(motion, demonstration)
    columns = _find_part(demonstration.layout, Quantity.QUATERNION, Quantity.ORIENTATION)
    return float(angle(motion.x[-1, columns], demonstration.x[-1, columns]))


def largest_acceleration(motion: Motion, layout: Layout) -> float:
    """Return the largest commanded acceleration of the position [unit of the position/s^2].

    Args:
        motion: Reproduced motion; its inputs are accelerations in tangent columns.
        layout: Columns of the states.

    Raises:
        InvalidInput: If the layout has no position.
    """
    columns = _find_part(layout.tangent, Quantity.POSITION)
    return float(np.linalg.norm(motion.u[:, columns], axis=1).max())


def time_warped_distance(x: Float[Array, "N D"], y: Float[Array, "M D"]) -> float:
    """Return the mean distance of rows that dynamic time warping pairs [unit of x].

    Warping chooses the monotone sequence of pairs, from the first rows to the last rows, with the least sum
    of distances. Each step advances one row in x, in y, or in both. The mean is over the pairs in it.

    Args:
        x: Positions of one motion.
        y: Positions of another one.

    Raises:
        InvalidInput: If an array has no rows, or the two differ in columns.

    Source:
        Sakoe & Chiba 1978, IEEE Transactions on Acoustics, Speech, and Signal Processing 26(1).
    """
    x, y = finite_array(x, "x"), finite_array(y, "y")
    if x.ndim != 2 or y.ndim != 2 or x.shape[1] != y.shape[1] or not x.size or not y.size:
        raise InvalidInput(f"x and y have shapes {x.shape} and {y.shape}, expected rows of the same columns")
    return warped_mean(np.linalg.norm(x[:, None] - y[None], axis=2))


def warped_mean(distances: Float[Array, "N M"]) -> float:
    """Return the mean of the distances along the path of dynamic time warping.

    Args:
        distances: Distance of row i of one motion from row j of another.
    """
    N, M = distances.shape
    total, pairs = np.full((N + 1, M + 1), np.inf), np.zeros((N + 1, M + 1))
    total[0, 0] = 0.0
    for diagonal in range(2, N + M + 1):  # pairs of one anti-diagonal do not depend on each other
        i = np.arange(max(1, diagonal - M), min(N, diagonal - 1) + 1)
        j = diagonal - i
        rows, columns = np.stack([i - 1, i - 1, i]), np.stack([j - 1, j, j - 1])
        best = np.argmin(total[rows, columns], axis=0)
        before = rows[best, np.arange(len(i))], columns[best, np.arange(len(i))]
        total[i, j] = distances[i - 1, j - 1] + total[before]
        pairs[i, j] = 1.0 + pairs[before]
    return float(total[N, M] / pairs[N, M])


def _require_same_columns(skill: Skill, demonstration: Demonstration) -> None:
    if (demonstration.layout, demonstration.period) != (skill.layout, skill.period):
        raise InvalidInput(
            f"demonstration {demonstration.name!r} has the columns "
            f"{', '.join(demonstration.layout.names)} every {demonstration.period} s, the skill "
            f"{', '.join(skill.layout.names)} every {skill.period} s"
        )


def _align_signs(x: Float[Array, "T D"], demonstration: Demonstration) -> Float[Array, "T D"]:
    aligned = x.copy()
    for orientation in demonstration.layout.orientations:
        q, reference = x[:, orientation.quaternion], demonstration.x[:, orientation.quaternion]
        opposite = np.sum(q * reference, axis=1, keepdims=True) < 0.0
        aligned[:, orientation.quaternion] = np.where(opposite, -q, q)
    return aligned


def _find_part(layout: Layout, *quantities: Quantity) -> slice:
    for part, columns in zip(layout.parts, layout.slices, strict=True):
        if part.quantity in quantities and part.derivative == 0:
            return columns
    expected = " or ".join(quantity.value for quantity in quantities)
    raise InvalidInput(f"the columns are {', '.join(layout.names)}, expected a {expected} among them")


def _require_same_shape(motion: Motion, demonstration: Demonstration) -> None:
    if motion.x.shape != demonstration.x.shape:
        raise InvalidInput(
            f"the motion has shape {motion.x.shape}, expected {demonstration.x.shape} like demonstration "
            f"{demonstration.name!r}"
        )
