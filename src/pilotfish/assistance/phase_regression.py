"""Gaussian mixture regression on a phase, in every frame, and the product over frames with its Jacobian.

A mixture over (x, s) is known in P frames. In frame p, with responsibilities h_k(s), conditional means
m_k(s) = Exp_{c_k}(g_k (s - s_k)) and conditional covariances C_k,

    m = the point at which sum_k h_k w_k = 0, where w_k = Log_m(m_k)
    S = sum_k h_k (T_k C_k T_k' + w_k w_k'),  T_k = D_log(w_k) D_exp(g_k (s - s_k)).

On R^n, T_k = I and m = sum_k h_k m_k. The frame maps both to the world. The product over frames has the
mean x that minimises sum_p v_p' L_p v_p, with v_p = Log_{m_p}(x) and precisions L_p = S_p^-1, hence

    F(x, s) = sum_p D_log(v_p)' L_p v_p = 0,           covariance (sum_p D_log(v_p)' L_p D_log(v_p))^-1.

Jacobian. dx/ds = -(dF/dx)^-1 dF/ds, in which m_p and L_p both depend on s: dL = -L dS L, and dS contains
the derivative of the responsibilities, h_k (z_k - sum_j h_j z_j) with the scores z_k = -(s - s_k) /
variance_k. On R^n this is (sum_p L_p)^-1 sum_p (L_p dm_p + dL_p (m_p - x)).

Shrinkage. Four to ten demonstrations in six or seven columns leave directions in which a state has no
variance. In a new scene the frames disagree in them, each without doubt, and the product is far from all. A
share of the mean variance of each part (position, orientation) is therefore added to every C_k.

The phase is the same in all frames: its marginal enters the responsibilities once, not P times.

Keep in step: `_local_regression` with its derivative, and `_frame_product` with its Jacobian.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pilotfish.demonstrations import Frame, Layout
from pilotfish.errors import InvalidInput
from pilotfish.gaussians import (
    ConditionalGaussians,
    cholesky,
    conditional_gaussians,
    precision_cholesky,
    regress_with_responsibilities,
)
from pilotfish.geometry import (
    exp_map,
    exp_map_jacobian,
    from_rotation_vector,
    inverse_right_jacobian_derivative,
    left_multiplication_matrix,
    log_map,
    log_map_jacobian,
    right_jacobian,
    rotation_matrix,
    tangent_slices,
)
from pilotfish.models import Skill
from pilotfish.types import Array, Float
from pilotfish.validation import shorten_repr

PHASE_TOLERANCE = 1e-6  # of the phase, between the frames' means of one state
MIN_QUATERNION_NORM = 0.1  # of a product of quaternions in R^4, as in models.adapt
SHRINKAGE = 0.2  # of the mean variance of a part, added to its variances: see the head of this file
MAX_ITERATIONS, TOLERANCE = 50, 1e-11
SMALL_ANGLE = 1e-4  # rad: below it the series is more exact than the quotient
CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])

Arrays = tuple[Array, Array, Array, Array]


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class PhaseMixture:
    """States of a skill as functions of the phase.

    Attributes:
        log_weights: Logarithm of the weight of each state.
        frames: Conditional densities of the pose given the phase, for each frame; all have the same densities
            of the phase.
        layout: Columns of the pose, without the phase.
    """

    log_weights: Float[Array, " K"]
    frames: tuple[ConditionalGaussians, ...]
    layout: Layout


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Guide:
    """Desired poses at N phases, in the world.

    Deviations of every orientation, in R^4 or on S^3, are rotation vectors [rad] in body axes.

    Attributes:
        means: Poses, with unit quaternions.
        covariances: Covariance of the deviations.
        jacobians: Exact derivative of each mean by the phase, as a deviation.
    """

    means: Float[Array, "N D"]
    covariances: Float[Array, "N E E"]
    jacobians: Float[Array, "N E"]


def condition_on_phase(skill: Skill) -> PhaseMixture:
    """Condition the states of a skill on its last column, the phase.

    Weights are those of a mixture; states of a skill with time order count equally.

    Args:
        skill: Skill whose last column is the phase.

    Raises:
        InvalidInput: If frames transform the phase.
        NotPositiveDefinite: If a covariance is singular.
    """
    K, column = skill.states, np.array([skill.width - 1])
    weights = np.full(K, 1.0 / K) if skill.dynamics.has_time_order else skill.dynamics.initial
    phases = skill.means[:, :, -1]
    if (spread := float(np.ptp(phases, axis=0).max())) > PHASE_TOLERANCE:
        raise InvalidInput(
            f"the mean phase of a state differs by {spread:.3g} between frames, expected the same in all; "
            "frames must not transform the last column"
        )
    covariances = [c.dense for c in skill.covariances]
    variance = np.mean([dense[:, -1, -1] for dense in covariances], axis=0)
    frames = []
    for name, means, dense in zip(skill.frame_names, skill.means, covariances, strict=True):
        conditional = conditional_gaussians(means, dense, column, skill.layout.orientation_starts)
        cholesky(
            conditional.covariances,
            f"the covariance of the pose in frame {name!r}, given the phase, of state",
        )
        frames.append(
            replace(
                conditional,
                precision_cholesky=variance[:, None, None] ** -0.5,
                covariances=_shrink(conditional.covariances, skill.layout),
            )
        )
    with np.errstate(divide="ignore"):
        return PhaseMixture(np.log(weights), tuple(frames), Layout(skill.layout.parts[:-1]))


def _shrink(covariances: Float[Array, "K E E"], layout: Layout) -> Float[Array, "K E E"]:
    """Add a share of the mean variance of each part to the variances of its columns."""
    added = np.zeros(covariances.shape[:2])
    for columns in layout.tangent.slices[:-1]:
        variances = np.diagonal(covariances[:, columns, columns], axis1=1, axis2=2)
        added[:, columns] = SHRINKAGE * variances.mean(axis=1, keepdims=True)
    return covariances + added[..., None] * np.eye(covariances.shape[1])


def regress_on_phase(mixture: PhaseMixture, frames: Sequence[Frame], s: Float[Array, " N"]) -> Guide:
    """Return the desired pose at each phase, its covariance and its derivative.

    Args:
        mixture: States conditioned on the phase.
        frames: Frames in the order of the mixture, in the columns of the pose.
        s: Phases.

    Raises:
        InvalidInput: If frames give opposite orientations.
    """
    h, dh = _responsibilities(mixture, s)
    in_world = [
        _to_world(frame, mixture.layout, _local_regression(conditional, s, h, dh))
        for frame, conditional in zip(frames, mixture.frames, strict=True)
    ]
    aligned = [_align_signs(arrays, in_world[0][0], mixture.layout) for arrays in in_world]
    return _to_unit_quaternions(_frame_product(aligned, mixture.layout.orientation_starts), mixture.layout)


def _responsibilities(
    mixture: PhaseMixture, s: Float[Array, " N"]
) -> tuple[Float[Array, "N K"], Float[Array, "N K"]]:
    """Return p(state | phase) and its derivative by the phase."""
    first = mixture.frames[0]
    W = first.precision_cholesky[:, 0, 0]
    z = W * (s[:, None] - first.input_means[:, 0])
    log_joint = mixture.log_weights + np.log(W) - 0.5 * z**2
    joint = np.exp(log_joint - log_joint.max(axis=1, keepdims=True))
    h = joint / joint.sum(axis=1, keepdims=True)
    scores = -W * z
    return h, h * (scores - np.sum(h * scores, axis=1, keepdims=True))


def _local_regression(
    conditional: ConditionalGaussians, s: Float[Array, " N"], h: Float[Array, "N K"], dh: Float[Array, "N K"]
) -> Arrays:
    """Return mean and covariance in one frame, and their derivatives by the phase."""
    regression = regress_with_responsibilities(conditional, s[:, None], h)
    m, S, dm = regression.means, regression.covariances, regression.jacobians[:, :, 0]
    slopes = conditional.slopes[:, :, 0]
    u = slopes * (s[:, None] - conditional.input_means[:, 0])[:, :, None]
    if starts := conditional.output_orientation_starts:
        w, dw, covariances, half = _terms_on_manifold(conditional, u, m, dm, starts)
    else:
        w, dw = conditional.means + u - m[:, None], slopes - dm[:, None]
        covariances, half = conditional.covariances[None], np.zeros(1)
    covariances = covariances + w[..., :, None] * w[..., None, :]
    half = half + dw[..., :, None] * w[..., None, :]
    half = np.einsum("nk,nkij->nij", h, half)
    return m, S, dm, np.einsum("nk,nkij->nij", dh, covariances) + half + half.swapaxes(-1, -2)


def _terms_on_manifold(
    conditional: ConditionalGaussians,
    u: Float[Array, "N K E"],
    m: Float[Array, "N D"],
    dm: Float[Array, "N E"],
    starts: tuple[int, ...],
) -> Arrays:
    """Return w, dw, T C T' and dT C T'."""
    slopes = conditional.slopes[:, :, 0]
    w = log_map(m[:, None], exp_map(conditional.means[None], u, starts), starts)
    to_point, to_mean = exp_map_jacobian(u, starts), log_map_jacobian(w, starts)
    T = to_mean @ to_point
    dw = _apply(T, slopes) - _apply(to_mean.swapaxes(-1, -2), dm[:, None])
    dT = _jacobian_change(w, dw, starts) @ to_point + to_mean @ _ray_jacobian_change(u, slopes, starts)
    CT = conditional.covariances @ T.swapaxes(-1, -2)
    return w, dw, T @ CT, dT @ CT


def _to_world(frame: Frame, layout: Layout, arrays: Arrays) -> Arrays:
    m, S, dm, dS = arrays
    T = frame.tangent_map(layout)
    return m @ frame.A.T + frame.b, T @ S @ T.T, dm @ T.T, T @ dS @ T.T


def _align_signs(arrays: Arrays, reference: Float[Array, "N D"], layout: Layout) -> Arrays:
    """Give quaternions in R^4 the sign under which they are nearer to those of the reference."""
    m, S, dm, dS = arrays
    if not layout.quaternions:
        return arrays
    signs = np.ones_like(m)
    for columns in layout.quaternions:
        opposite = np.sum(m[:, columns] * reference[:, columns], axis=1) < 0.0
        signs[opposite, columns] = -1.0
    starts = layout.orientation_starts  # on S^3 signs do not matter, and deviations have fewer columns
    tangent = np.ones_like(dm)
    for columns, deviations, is_orientation in tangent_slices(layout.width, starts):
        if not is_orientation:
            tangent[:, deviations] = signs[:, columns]
    outer = tangent[:, :, None] * tangent[:, None, :]
    return signs * m, outer * S, tangent * dm, outer * dS


def _frame_product(
    frames: Sequence[Arrays], starts: tuple[int, ...]
) -> tuple[Float[Array, "N D"], Float[Array, "N E E"], Float[Array, "N E"]]:
    """Return mean, covariance and Jacobian of the product of the frames' Gaussians."""
    m, S, dm, dS = (np.stack(arrays) for arrays in zip(*frames, strict=True))
    W = precision_cholesky(S.reshape(-1, *S.shape[2:]), "the covariance in the world of row").reshape(S.shape)
    L = W.swapaxes(-1, -2) @ W
    x, v = _product_means(m, L, starts)
    Lv = _apply(L, v)
    D, curvature = np.eye(L.shape[-1]), L  # on R^n
    if starts:
        D = log_map_jacobian(v, starts)
        curvature = D.swapaxes(-1, -2) @ L + _transposed_jacobian_change(v, Lv, starts)
    by_phase = -_apply(D.swapaxes(-1, -2) @ L @ dS, Lv) - _apply(curvature @ D.swapaxes(-1, -2), dm)
    jacobian = np.linalg.solve((curvature @ D).sum(axis=0), -by_phase.sum(axis=0)[..., None])[..., 0]
    V = precision_cholesky((D.swapaxes(-1, -2) @ L @ D).sum(axis=0), "the precision of row")
    return x, V.swapaxes(-1, -2) @ V, jacobian


def _product_means(
    m: Float[Array, "P N D"], L: Float[Array, "P N E E"], starts: tuple[int, ...]
) -> tuple[Float[Array, "N D"], Float[Array, "P N E"]]:
    """Return the means and the tangent vectors to them; on S^3 by Gauss-Newton steps."""
    if not starts:
        x = np.linalg.solve(L.sum(axis=0), _apply(L, m).sum(axis=0)[..., None])[..., 0]
        return x, x - m
    x = m[0]
    for _ in range(MAX_ITERATIONS):
        v = log_map(m, x, starts)
        D = log_map_jacobian(v, starts)
        DL = D.swapaxes(-1, -2) @ L
        step = -np.linalg.solve((DL @ D).sum(axis=0), _apply(DL, v).sum(axis=0)[..., None])[..., 0]
        x = exp_map(x, step, starts)
        if np.abs(step).max(initial=0.0) < TOLERANCE:
            break
    return x, log_map(m, x, starts)


def _to_unit_quaternions(
    arrays: tuple[Float[Array, "N D"], Float[Array, "N E E"], Float[Array, "N E"]],
    layout: Layout,
) -> Guide:
    """Normalise quaternions in R^4 and replace their deviations dq by rotation vectors, 2 q* dq / |q|."""
    means, covariances, jacobians = arrays
    means = means.copy()
    for columns in reversed(layout.quaternions):  # from the last on, so that the columns before stay in place
        norms = np.linalg.norm(means[:, columns], axis=1, keepdims=True)
        if norms.min(initial=1.0) < MIN_QUATERNION_NORM:
            raise InvalidInput(
                f"the frames give opposite orientations: the product of their quaternions has norm "
                f"{norms.min():.3g}, expected about 1; check the orientation of the frames"
            )
        means[:, columns] /= norms
        E = jacobians.shape[1]
        start = columns.start - sum(s < columns.start for s in layout.orientation_starts)
        G = np.zeros((len(means), E - 1, E))
        before, after = np.arange(start), np.arange(start + 4, E)
        G[:, before, before] = G[:, after - 1, after] = 1.0
        inverse = left_multiplication_matrix(means[:, columns] * CONJUGATE)
        G[:, start : start + 3, start : start + 4] = 2.0 / norms[:, :, None] * inverse[:, 1:]
        covariances, jacobians = G @ covariances @ G.swapaxes(-1, -2), _apply(G, jacobians)
    return Guide(means, covariances, jacobians)


def _skew_matrix(v: Float[Array, "*B 3"]) -> Float[Array, "*B 3 3"]:
    return np.asarray(np.cross(v[..., None, :], np.eye(3)).swapaxes(-1, -2))


def _apply(matrices: Float[Array, "*B I J"], vectors: Float[Array, "*#B J"]) -> Float[Array, "*B I"]:
    return np.asarray((matrices @ vectors[..., None])[..., 0])


def _jacobian_change(
    v: Float[Array, "*B E"], dv: Float[Array, "*B E"], starts: tuple[int, ...]
) -> Float[Array, "*B E E"]:
    """Return the derivative of log_map_jacobian(v) in the direction dv."""
    matrix = np.zeros((*v.shape, v.shape[-1]))
    for _, columns, is_orientation in tangent_slices(v.shape[-1] + len(starts), starts):
        if is_orientation:
            by_v = inverse_right_jacobian_derivative(v[..., None, columns], np.eye(3))  # (*B, column, 3, 3)
            matrix[..., columns, columns] = _apply(by_v, dv[..., None, columns]).swapaxes(-1, -2)
    return matrix


def _ray_jacobian_change(
    u: Float[Array, "N K E"], slopes: Float[Array, "K E"], starts: tuple[int, ...]
) -> Float[Array, "N K E E"]:
    """Return the derivative of exp_map_jacobian(u) while u moves along its own ray, by slopes.

    With u = r g, r J(r g) is the integral of exp(-t [g]) from 0 to r: hence dJ/dr = (exp(-[u]) - J(u)) / r.
    Unlike the inverse of J it exists for every u, such as that of a state far away.
    """
    matrix = np.zeros((*u.shape, u.shape[-1]))
    for _, columns, is_orientation in tangent_slices(u.shape[-1] + len(starts), starts):
        if is_orientation:
            v, g = u[..., columns], slopes[:, columns]
            squares = np.sum(g * g, axis=-1)
            r = np.sum(v * g, axis=-1) / np.where(squares > 0.0, squares, 1.0)
            small = np.abs(r) * np.sqrt(squares) < SMALL_ANGLE
            G = _skew_matrix(g)
            series = -0.5 * G + r[..., None, None] / 3.0 * (G @ G)
            change = rotation_matrix(from_rotation_vector(-v)) - right_jacobian(v)
            quotient = change / np.where(small, 1.0, r)[..., None, None]
            matrix[..., columns, columns] = np.where(small[..., None, None], series, quotient)
    return matrix


def _transposed_jacobian_change(
    v: Float[Array, "*B E"], y: Float[Array, "*B E"], starts: tuple[int, ...]
) -> Float[Array, "*B E E"]:
    """Return the derivative of log_map_jacobian(v)' y by v, for which log_map_jacobian(v)' is that of -v."""
    matrix = np.zeros((*v.shape, v.shape[-1]))
    for _, columns, is_orientation in tangent_slices(v.shape[-1] + len(starts), starts):
        if is_orientation:
            matrix[..., columns, columns] = -inverse_right_jacobian_derivative(
                -v[..., columns], y[..., columns]
            )
    return matrix
