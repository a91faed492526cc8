"""The columns that assistance works on: position, orientation on S^3 and scalars such as a grip.

A skill may be learned with derivatives, and with orientations as four numbers (flat) or on S^3. Assistance
reads and commands poses. It therefore takes the marginal of the coordinates, and describes a deviation d of a
flat quaternion q by the rotation vector v in body axes,

    q + d = q exp(v / 2)  to first order,    v = 2 (E(q) J)' d,    J = the last three columns of the identity,

with E(q) the matrix of multiplication from the left. The component of d along q changes the norm only and is
dropped. Afterwards both kinds of orientation are treated alike, and the sign of a quaternion does not matter.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pilotfish.demonstrations import Frame, Layout, MovingFrame, Quantity
from pilotfish.errors import InvalidInput
from pilotfish.gaussians import cholesky
from pilotfish.gaussians.structures import DenseCovariances
from pilotfish.geometry import left_multiplication_matrix
from pilotfish.models import Endpoints, Skill
from pilotfish.types import Array, Float
from pilotfish.validation import require_type, short_list

SPATIAL_AXES = 3
POSES = ([Quantity.POSITION], [Quantity.POSITION, Quantity.ORIENTATION])
MIN_NORM = 0.1  # of the mean of a flat quaternion; below, the demonstrations have opposite orientations


def coordinate_layout(layout: Layout) -> Layout:
    """Return the coordinates of a layout, with orientations on S^3.

    Args:
        layout: Columns of a skill: a position of three axes, then at most one orientation, then scalars, and
            any derivatives.

    Raises:
        InvalidInput: If the layout has other parts, or in another order.
    """
    require_type(layout, "layout", Layout, "a skill holds one: skill.layout")
    parts = tuple(
        replace(part, quantity=Quantity.ORIENTATION) if part.quantity is Quantity.QUATERNION else part
        for part in layout.parts
        if not part.derivative
    )
    kinds = [part.quantity for part in parts]
    poses = len(kinds) - kinds.count(Quantity.SCALAR)
    if kinds[:poses] not in POSES or parts[0].size != SPATIAL_AXES:
        raise InvalidInput(
            f"the columns are {short_list(layout.names)}, expected a position of three axes, then at most "
            "one orientation, then scalars such as a grip; learn the skill from poses of the tool"
        )
    return Layout(parts)


def pose_width(layout: Layout) -> int:
    """Return the number of tangent columns of the pose: 3, or 6 with an orientation.

    Args:
        layout: Layout from `coordinate_layout`.
    """
    return SPATIAL_AXES + 3 * len(layout.orientation_starts)


def scalar_columns(layout: Layout) -> slice:
    """Return the columns after the pose, such as a grip.

    Args:
        layout: Layout from `coordinate_layout`.
    """
    return slice(SPATIAL_AXES + 4 * len(layout.orientation_starts), layout.width)


def coordinate_skill(skill: Skill) -> Skill:
    """Return the marginal of the coordinates of a skill, with orientations on S^3.

    Args:
        skill: Learned skill, with or without derivatives, flat or on S^3, of any covariance structure.

    Raises:
        InvalidInput: If the columns are not a pose with scalars, a number is not finite, or the mean of a
            flat quaternion has a norm below 0.1.
    """
    require_type(skill, "skill", Skill, "a fit holds one: fit.skill")
    layout = coordinate_layout(skill.layout)
    dense = np.stack([c.dense for c in skill.covariances])
    if not (np.isfinite(skill.means).all() and np.isfinite(dense).all()):
        raise InvalidInput("the skill has means or covariances that are not finite; learn it again")
    means, covariances = _marginal(skill.means, dense, skill, layout)
    for p, name in enumerate(skill.frame_names):
        cholesky(covariances[p], f"frame {name!r}: the covariance of state")
    endpoints = skill.endpoints
    if endpoints is not None:
        diagonal = endpoints.variances[..., None] * np.eye(endpoints.variances.shape[-1])
        end_means, spread = _marginal(endpoints.means, diagonal, skill, layout)
        endpoints = Endpoints(end_means, np.diagonal(spread, axis1=-2, axis2=-1).copy())
    return replace(
        skill,
        means=means,
        covariances=tuple(DenseCovariances(c) for c in covariances),
        layout=layout,
        regularisation=None,
        demonstrated=None,
        endpoints=endpoints,
    )


def coordinate_frames(frames: Sequence[Frame | MovingFrame], layout: Layout) -> tuple[Frame, ...]:
    """Return the frames for the coordinates of a skill.

    Args:
        frames: Frames of all columns of the skill, or of its coordinates only.
        layout: Columns of the skill.

    Raises:
        InvalidInput: If a frame moves, has another number of columns or is not finite.
    """
    require_type(frames, "frames", Sequence, "give a list of frames, say a demonstration's .frames")
    coordinates = np.array(layout.coordinates)
    restricted = []
    for frame in frames:
        require_type(frame, "a frame", Frame, "of a moving frame give frame.at(t), its value at one step")
        for values in (frame.A, frame.b):
            require_type(values, f"an array of frame {frame.name!r}", np.ndarray, "pass np.array(values)")
        if frame.b.shape == (layout.width,) and frame.A.shape == (layout.width, layout.width):
            A, b = frame.A[np.ix_(coordinates, coordinates)], frame.b[coordinates]
        elif frame.b.shape == coordinates.shape and frame.A.shape == coordinates.shape * 2:
            A, b = frame.A.copy(), frame.b.copy()  # the caller may use the arrays again
        else:
            raise InvalidInput(
                f"frame {frame.name!r} has A of shape {frame.A.shape} and b {frame.b.shape}, expected "
                f"{layout.width} columns as in the skill, or its {len(coordinates)} coordinates"
            )
        restricted.append(Frame(frame.name, A, b))
        restricted[-1].require_magnitudes()
    return tuple(restricted)


def _marginal(
    means: Float[Array, "P K D"], covariances: Float[Array, "P K E E"], skill: Skill, layout: Layout
) -> tuple[Float[Array, "P K F"], Float[Array, "P K G G"]]:
    """Return means and covariances of the coordinates, with orientations on S^3."""
    maps = _tangent_maps(means, skill)
    means = means[:, :, np.array(skill.layout.coordinates)]
    for columns in layout.unit_quaternions:
        means[:, :, columns] /= np.linalg.norm(means[:, :, columns], axis=2, keepdims=True)
    marginal = maps @ covariances @ maps.swapaxes(-1, -2)
    return means, 0.5 * (marginal + marginal.swapaxes(-1, -2))


def _tangent_maps(means: Float[Array, "P K D"], skill: Skill) -> Float[Array, "P K G E"]:
    """Return the matrices from deviations of all columns to deviations of the coordinates."""
    layout, blocks = skill.layout, []
    for part, columns, tangent in zip(layout.parts, layout.slices, layout.tangent.slices, strict=True):
        if part.derivative:
            continue
        size = tangent.stop - tangent.start
        is_flat = part.quantity is Quantity.QUATERNION
        rows = _rotation_rows(means[:, :, columns], part.name, skill) if is_flat else np.eye(size)
        block = np.zeros((*means.shape[:2], rows.shape[-2], layout.tangent.width))
        block[..., tangent] = rows
        blocks.append(block)
    return np.concatenate(blocks, axis=2)


def _rotation_rows(q: Float[Array, "P K 4"], name: str, skill: Skill) -> Float[Array, "P K 3 4"]:
    """Return the matrices from deviations of flat quaternions to rotation vectors."""
    norms = np.linalg.norm(q, axis=2)
    if (norms < MIN_NORM).any():
        p, k = np.argwhere(norms < MIN_NORM)[0]
        raise InvalidInput(
            f"the mean of {name!r} in state {k}, frame {skill.frame_names[p]!r}, has norm {norms[p, k]:.3g}, "
            "expected a unit quaternion; learn on S^3, see demonstrations.to_sphere"
        )
    scaled = q / norms[..., None] ** 2
    return np.asarray(2.0 * left_multiplication_matrix(scaled)[..., 1:].swapaxes(-1, -2))
