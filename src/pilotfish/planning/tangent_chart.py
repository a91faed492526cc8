"""Tangent chart: an adapted skill with orientations on S^3, in columns of R^n where linear planning applies.

Map. Let q_0 be the base of an orientation. The logarithmic map writes q as the rotation vector v in body axes
of the base, q = q_0 exp(v / 2); the exponential map inverts it. Signs of q count, so that v can be up to 2 pi
long and a movement of more than half a turn stays continuous. All other columns are unchanged.

Velocities. The body turns with the angular velocity w = J_r(v) dv/dt in body axes, where J_r is the right
Jacobian. The chart therefore has the rate dv/dt = J_r(v)^-1 w in place of w.

Covariances. A small deviation d in body axes changes v by J_r(v)^-1 d. The rate changes with v as well, so
that
the differential M of the map has one block below its diagonal:

    M = [ J_r^-1                       0      ]    for the columns (v, dv/dt),
        [ (d J_r^-1 / d v)(w) J_r^-1   J_r^-1 ]

and a covariance S becomes M S M'. This is exact for small deviations; it couples rotations and their rates.

Invariants. `to_manifold` inverts `to_tangent`. At the base, M is the identity for a skill at rest. A skill
transformed in the world gives the same chart up to the base.

Keep in step: `to_tangent`, `to_manifold`, the differential and `via_point` use the same rotation vector.
"""

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
from pilotfish.planning.via_points import ViaPoint, named_columns, unit_quaternion
from pilotfish.types import Array, Float
from pilotfish.validation import numeric_array, require_type, shorten_repr


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class TangentChart:
    """Chart of an adapted skill: each orientation is a rotation vector [rad] from a base quaternion.

    Attributes:
        skill: The skill in the columns of the chart; plan and track it like any skill in R^n.
        manifold_skill: The skill on S^3.
        base_quaternions: Base of each orientation.
    """

    skill: AdaptedSkill
    manifold_skill: AdaptedSkill
    base_quaternions: Float[Array, "R 4"]

    def to_tangent(self, x: Float[Array, "*B D"]) -> Float[Array, "*B E"]:
        """Return points of S^3 in the columns of the chart (logarithmic map).

        Args:
            x: Points; of q and -q the one closer to the mean of a state is used.
        """
        rows, layout = x.reshape(-1, x.shape[-1]), self.manifold_skill.layout
        tangent = _copy_vector_columns(rows, layout)
        for columns, base in zip(layout.orientations, self.base_quaternions, strict=True):
            means = multiply(base, from_rotation_vector(self.skill.means[:, columns.rotation_vector]))
            v = _rotation_vectors(base, _align_signs(rows[:, columns.quaternion], means))
            tangent[:, columns.rotation_vector] = v
            if columns.angular_velocity and columns.rotation_rate:
                tangent[:, columns.rotation_rate] = _apply_matrices(
                    inverse_right_jacobian(v), rows[:, columns.angular_velocity]
                )
        return tangent.reshape(*x.shape[:-1], tangent.shape[1])

    def to_manifold(self, y: Float[Array, "*B E"]) -> Float[Array, "*B D"]:
        """Return points of the chart as points of S^3 (exponential map).

        Args:
            y: Points in the columns of the chart, such as a tracked motion.
        """
        rows, layout = y.reshape(-1, y.shape[-1]), self.manifold_skill.layout
        x = np.zeros((len(rows), layout.width))
        for point, tangent, is_orientation in tangent_slices(layout.width, layout.orientation_starts):
            if not is_orientation:
                x[:, point] = rows[:, tangent]
        for columns, base in zip(layout.orientations, self.base_quaternions, strict=True):
            v = rows[:, columns.rotation_vector]
            x[:, columns.quaternion] = multiply(base, from_rotation_vector(v))
            if columns.angular_velocity and columns.rotation_rate:
                x[:, columns.angular_velocity] = _apply_matrices(
                    right_jacobian(v), rows[:, columns.rotation_rate]
                )
        return x.reshape(*y.shape[:-1], x.shape[1])

    def via_point(self, point: ViaPoint) -> ViaPoint:
        """Return a via-point in the columns of the chart.

        The deviation of an orientation is kept; far from the base the chart stretches rotations about other
        axes than that of v, by less than two within half a turn.

        Args:
            point: Via-point in the columns of the skill on S^3.

        Raises:
            InvalidInput: If an orientation is not a whole unit quaternion with one deviation, or an angular
                velocity is not zero: its rate in the chart depends on the orientation.
        """
        require_type(point, "the via-point", ViaPoint, 'pf.via_point("position", ...) makes one')
        layout = self.manifold_skill.layout
        columns, _ = named_columns(point.name, layout)
        part = next(p for p, c in zip(layout.parts, layout.slices, strict=True) if columns[0] < c.stop)
        is_rotation = part.name in {p.name for p in layout.parts if p.quantity is Quantity.ORIENTATION}
        if is_rotation and part.derivative and point.value.any():
            raise InvalidInput(
                f"{point.name!r} is {point.value.tolist()} rad/s, expected 0: in the chart the rate depends "
                "on the orientation; take chart.to_tangent of a whole pose with its velocities"
            )
        if not is_rotation or part.derivative:
            return point
        if len(point.value) != len(columns) or len(set(point.deviation)) > 1 or len(columns) == 1:
            raise InvalidInput(
                f"{point.name!r} is {point.value.tolist()} with deviation {point.deviation.tolist()}, "
                f"expected a whole unit quaternion of {part.name!r} and one angle [rad]"
            )
        pose = self.manifold_skill.means[0].copy()
        pose[columns] = unit_quaternion(point)
        vector = self.to_tangent(pose)[self.skill.layout.columns(part.name)]
        return ViaPoint(point.name, vector, point.time, point.deviation[:1].repeat(len(vector)))


def tangent_chart(model: AdaptedSkill, *, base_pose: Float[Array, " D"] | None = None) -> TangentChart:
    """Create the tangent chart of an adapted skill.

    The farther from the base, the more the chart distorts: a constant acceleration there is slightly uneven
    for the body. States more than half a turn from the base are placed next to their nearest states. A skill
    of a full turn or more is not continuous in any chart.

    Args:
        model: Adapted skill with orientations on S^3.
        base_pose: Point whose orientations are the bases; None for the Karcher means of the states.

    Raises:
        InvalidInput: If the skill has no orientation on S^3, one has other derivatives than an angular
            velocity, or base_pose is not a point of its layout.

    Source:
        Zeestraten et al. 2017, IEEE RA-L 2(3), section V, for tracking in a tangent space; here covariances
        are transformed by the exact differential instead of parallel transport.
    """
    require_type(model, "model", AdaptedSkill, "pf.adapt(skill, frames) makes one of a skill")
    layout = model.layout
    _require_angular_velocities(layout)
    if not (orientations := layout.orientations):
        raise InvalidInput("the skill has no orientation on S^3, expected one; plan it without a chart")
    q = np.stack([model.means[:, columns.quaternion] for columns in orientations])
    base_quaternions = _base_quaternions(q, base_pose, layout)
    if model.endpoints is None:
        return TangentChart(_to_chart(model, base_quaternions), model, base_quaternions)
    ends, K = model.endpoints, model.states
    means = np.concatenate([model.means, ends.means])  # together, so that signs of the ends follow the states
    covariances = np.concatenate([model.covariances, ends.covariances])
    tangent = _to_chart(replace(model, means=means, covariances=covariances), base_quaternions)
    return TangentChart(
        replace(
            tangent,
            means=tangent.means[:K],
            covariances=tangent.covariances[:K],
            endpoints=replace(
                ends, means=tangent.means[K:], covariances=tangent.covariances[K:], layout=layout.tangent
            ),
        ),
        model,
        base_quaternions,
    )


def _to_chart(model: AdaptedSkill, base_quaternions: Float[Array, "R 4"]) -> AdaptedSkill:
    """Return the states in the columns of the chart, with covariances M S M'."""
    layout = model.layout
    means = _copy_vector_columns(model.means, layout)
    M = np.zeros((*means.shape, means.shape[1])) + np.eye(means.shape[1])
    for columns, base in zip(layout.orientations, base_quaternions, strict=True):
        v = _rotation_vectors(base, _align_sign_chain(model.means[:, columns.quaternion], base))
        J = inverse_right_jacobian(v)
        vector, rate = columns.rotation_vector, columns.rotation_rate
        means[:, vector], M[:, vector, vector] = v, J
        if columns.angular_velocity and rate:
            w = model.means[:, columns.angular_velocity]
            means[:, rate], M[:, rate, rate] = _apply_matrices(J, w), J
            M[:, rate, vector] = inverse_right_jacobian_derivative(v, w) @ J
    transformed = M @ model.covariances @ M.transpose(0, 2, 1)
    covariances = 0.5 * (transformed + transformed.transpose(0, 2, 1))
    return replace(model, means=means, covariances=covariances, layout=layout.tangent)


def _require_angular_velocities(layout: Layout) -> None:
    orientations = {part.name for part in layout.parts if part.quantity is Quantity.ORIENTATION}
    for part in layout.parts:
        if part.name in orientations and part.derivative and (part.derivative, part.size) != (1, 3):
            raise InvalidInput(
                f"part {part.name!r} has derivatives other than an angular velocity of three columns; "
                "expected those of pf.demonstrations.to_sphere or pf.add_derivatives"
            )


def _base_quaternions(
    q: Float[Array, "R K 4"], base_pose: Float[Array, " D"] | None, layout: Layout
) -> Float[Array, "R 4"]:
    if base_pose is None:
        return np.stack([karcher_mean(means, np.ones(len(means)), (0,)) for means in q])
    require_type(base_pose, "base_pose", np.ndarray, "pass np.array(pose)")
    base_pose = numeric_array(base_pose, "base_pose")
    if base_pose.shape != (layout.width,) or not np.isfinite(base_pose).all():
        raise InvalidInput(
            f"base_pose is {base_pose.tolist()}, expected {layout.width} finite numbers: "
            f"{', '.join(layout.names)}"
        )
    return normalise(np.stack([base_pose[columns.quaternion] for columns in layout.orientations]))


def _copy_vector_columns(x: Float[Array, "N D"], layout: Layout) -> Float[Array, "N E"]:
    """Copy the columns outside orientations; rotation vectors are zero."""
    tangent = np.zeros((len(x), layout.tangent.width))
    for columns, tangent_columns, is_orientation in tangent_slices(layout.width, layout.orientation_starts):
        if not is_orientation:
            tangent[:, tangent_columns] = x[:, columns]
    return tangent


def _rotation_vectors(base: Float[Array, " 4"], q: Float[Array, "N 4"]) -> Float[Array, "N 3"]:
    """Return the rotation vectors from the base to q, up to 2 pi long: signs of q count."""
    return to_rotation_vector(multiply(conjugate(base), q))


def _apply_matrices(matrices: Float[Array, "N 3 3"], vectors: Float[Array, "N 3"]) -> Float[Array, "N 3"]:
    return np.asarray(np.einsum("nij,nj->ni", matrices, vectors))


def _align_signs(q: Float[Array, "N 4"], means: Float[Array, "K 4"]) -> Float[Array, "N 4"]:
    """Give each q the sign that is closer to the mean nearest to q or -q."""
    dots = q @ means.T
    nearest = np.take_along_axis(dots, np.abs(dots).argmax(axis=1)[:, None], axis=1)
    return np.asarray(np.where(nearest < 0.0, -q, q))


def _align_sign_chain(q: Float[Array, "K 4"], base: Float[Array, " 4"]) -> Float[Array, "K 4"]:
    """Align signs one by one, always of the quaternion nearest to the base or to those aligned before."""
    references, remaining = base[None], q
    order = np.arange(len(q))
    aligned = np.empty_like(q)
    while len(remaining):
        n = int(np.abs(remaining @ references.T).max(axis=1).argmax())
        aligned[order[n]] = _align_signs(remaining[n : n + 1], references)[0]
        references = np.vstack([references, aligned[order[n]]])
        remaining, order = np.delete(remaining, n, axis=0), np.delete(order, n)
    return aligned
