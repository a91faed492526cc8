"""A flat map of a skill with orientations on S^3, in which plans are made and followed as on R^n."""

from dataclasses import dataclass, replace

import numpy as np

from pilotfish.demonstrations import Layout, Quantity
from pilotfish.errors import InvalidInput
from pilotfish.geometry import (
    conjugate,
    from_rotation_vector,
    inverse_right_jacobian,
    inverse_right_jacobian_derivative,
    karcher_mean,
    multiply,
    normalise,
    right_jacobian,
    tangent_slices,
    to_rotation_vector,
)
from pilotfish.models import AdaptedSkill
from pilotfish.types import Array, Float
from pilotfish.validation import numeric_array, require_type


@dataclass(frozen=True, slots=True, eq=False)
class TangentChart:
    """Orientations as rotation vectors [rad] from a base, angular velocities as the rates of these [rad/s].

    skill is the adapted skill in these columns, an ordinary one: plan and track it as any other. Other
    columns are what they were. manifold_skill is the skill on S^3, bases a unit quaternion for each orientation.
    """

    skill: AdaptedSkill
    manifold_skill: AdaptedSkill
    bases: Float[Array, "R 4"]

    def to_tangent(self, x: Float[Array, "*B D"]) -> Float[Array, "*B E"]:
        """Points of the curved skill as the flat one has them; of q and -q, that nearer to a state's mean."""
        rows = x.reshape(-1, x.shape[-1])
        tangent = _copy_vector_columns(rows, self.manifold_skill.layout)
        for orientation, base in zip(
            _orientation_columns(self.manifold_skill.layout), self.bases, strict=True
        ):
            means = multiply(base, from_rotation_vector(self.skill.means[:, orientation.vector]))
            v = _rotation_vectors(base, _align_signs(rows[:, orientation.quaternion], means))
            tangent[:, orientation.vector] = v
            if orientation.angular_velocity and orientation.rate:
                tangent[:, orientation.rate] = _apply_matrices(
                    inverse_right_jacobian(v), rows[:, orientation.angular_velocity]
                )
        return tangent.reshape(*x.shape[:-1], tangent.shape[1])

    def to_manifold(self, y: Float[Array, "*B E"]) -> Float[Array, "*B D"]:
        """Points of the flat skill, say of a tracked motion, as poses of the world."""
        rows = y.reshape(-1, y.shape[-1])
        x = np.zeros((len(rows), self.manifold_skill.layout.width))
        for columns, tangent_columns, orientation in tangent_slices(
            x.shape[1], self.manifold_skill.layout.orientation_starts
        ):
            if not orientation:
                x[:, columns] = rows[:, tangent_columns]
        for part, base in zip(_orientation_columns(self.manifold_skill.layout), self.bases, strict=True):
            v = rows[:, part.vector]
            x[:, part.quaternion] = multiply(base, from_rotation_vector(v))
            if part.angular_velocity and part.rate:
                x[:, part.angular_velocity] = _apply_matrices(right_jacobian(v), rows[:, part.rate])
        return x.reshape(*y.shape[:-1], x.shape[1])


@dataclass(frozen=True, slots=True)
class _OrientationColumns:
    """Where an orientation and its angular velocity are, in points and in their flat image."""

    quaternion: slice
    vector: slice
    angular_velocity: slice | None
    rate: slice | None


def tangent_chart(model: AdaptedSkill, *, base_pose: Float[Array, " D"] | None = None) -> TangentChart:
    """The adapted skill on a flat map: means by the logarithm, covariances by the map's exact differential.

    The base is the pose given, or the Karcher mean of the states' means: the farther from it, the more the
    map distorts, so that a steady push there is a slightly uneven one of the body. States farther than half
    a turn from the base lie beyond it on the map, next to those that they are nearest to; a skill that goes
    once round or more is not continuous on any map.
    Raises: InvalidInput, when the skill has no orientation on S^3, or at is no pose of its layout.
    Source: Zeestraten et al. 2017, IEEE RA-L 2(3), section V, for tracking in a tangent space; the
    differential, and with it the coupling of turns and their speeds, is exact where they transport.
    """
    require_type(model, "model", AdaptedSkill, "pf.adapt(skill, frames) makes one of a skill")
    orientation_starts = _orientation_columns(model.layout)
    if not orientation_starts:
        raise InvalidInput("the skill has no orientation on S^3, it is flat already: plan it as it is")
    q = np.stack([model.means[:, orientation.quaternion] for orientation in orientation_starts])
    bases = _base_orientations(q, orientation_starts, base_pose, model.layout)
    means = _copy_vector_columns(model.means, model.layout)
    M = np.zeros((*means.shape, means.shape[1])) + np.eye(means.shape[1])
    for orientation, base, orientations in zip(orientation_starts, bases, q, strict=True):
        v = _rotation_vectors(base, _align_sign_chain(orientations, base))
        J = inverse_right_jacobian(v)
        means[:, orientation.vector], M[:, orientation.vector, orientation.vector] = v, J
        if orientation.angular_velocity and orientation.rate:
            speeds = model.means[:, orientation.angular_velocity]
            means[:, orientation.rate], M[:, orientation.rate, orientation.rate] = (
                _apply_matrices(J, speeds),
                J,
            )
            M[:, orientation.rate, orientation.vector] = inverse_right_jacobian_derivative(v, speeds) @ J
    transformed = M @ model.covariances @ M.transpose(0, 2, 1)
    covariances = 0.5 * (transformed + transformed.transpose(0, 2, 1))
    tangent = replace(model, means=means, covariances=covariances, layout=model.layout.tangent)
    return TangentChart(tangent, model, bases)


def _orientation_columns(layout: Layout) -> tuple[_OrientationColumns, ...]:
    parts = list(zip(layout.parts, layout.slices, layout.tangent.slices, strict=True))
    found = []
    for part, columns, tangent_columns in parts:
        if part.quantity is Quantity.ORIENTATION:
            rates = [entry for entry in parts if entry[0].name == part.name and entry[0].derivative]
            if any(
                rate.derivative > 1 or rate.size != tangent_columns.stop - tangent_columns.start
                for rate, _, _ in rates
            ):
                raise InvalidInput(
                    f"part {part.name!r} has derivatives other than an angular velocity of three columns; "
                    "expected those of pf.on_sphere or pf.with_derivatives"
                )
            angular_velocity, rate = (rates[0][1], rates[0][2]) if rates else (None, None)
            found.append(_OrientationColumns(columns, tangent_columns, angular_velocity, rate))
    return tuple(found)


def _base_orientations(
    q: Float[Array, "R K 4"],
    orientation_starts: tuple[_OrientationColumns, ...],
    base_pose: Float[Array, " D"] | None,
    layout: Layout,
) -> Float[Array, "R 4"]:
    if base_pose is None:
        return np.stack([karcher_mean(means, np.ones(len(means)), (0,)) for means in q])
    require_type(base_pose, "at", np.ndarray, "give np.array(pose)")
    base_pose = numeric_array(base_pose, "at")
    if base_pose.shape != (layout.width,) or not np.isfinite(base_pose).all():
        raise InvalidInput(
            f"at is {base_pose.tolist()}, expected {layout.width} finite numbers: {', '.join(layout.names)}"
        )
    return normalise(np.stack([base_pose[orientation.quaternion] for orientation in orientation_starts]))


def _copy_vector_columns(x: Float[Array, "N D"], layout: Layout) -> Float[Array, "N E"]:
    """What is no orientation, in its place; zeros where rotation vectors go."""
    tangent = np.zeros((len(x), layout.tangent.width))
    for columns, tangent_columns, orientation in tangent_slices(layout.width, layout.orientation_starts):
        if not orientation:
            tangent[:, tangent_columns] = x[:, columns]
    return tangent


def _rotation_vectors(base: Float[Array, " 4"], q: Float[Array, "N 4"]) -> Float[Array, "N 3"]:
    """Rotation vectors from the base to q, up to 2 pi long: signs of q count."""
    return to_rotation_vector(multiply(conjugate(base), q))


def _apply_matrices(matrices: Float[Array, "N 3 3"], vectors: Float[Array, "N 3"]) -> Float[Array, "N 3"]:
    return np.asarray(np.einsum("nij,nj->ni", matrices, vectors))


def _align_signs(q: Float[Array, "N 4"], means: Float[Array, "K 4"]) -> Float[Array, "N 4"]:
    """Each q with the sign of the mean that it is nearest to, whatever the sign."""
    dots = q @ means.T
    nearest = np.take_along_axis(dots, np.abs(dots).argmax(axis=1)[:, None], axis=1)
    return np.asarray(np.where(nearest < 0.0, -q, q))


def _align_sign_chain(q: Float[Array, "K 4"], base: Float[Array, " 4"]) -> Float[Array, "K 4"]:
    """The same orientations, each on the half of S^3 of the nearest one signed before; the base is first."""
    signed, remaining = base[None], q
    order = np.arange(len(q))
    aligned_orientations = np.empty_like(q)
    while len(remaining):
        n = int(np.abs(remaining @ signed.T).max(axis=1).argmax())
        aligned_orientations[order[n]] = _align_signs(remaining[n : n + 1], signed)[0]
        signed = np.vstack([signed, aligned_orientations[order[n]]])
        remaining, order = np.delete(remaining, n, axis=0), np.delete(order, n)
    return aligned_orientations
