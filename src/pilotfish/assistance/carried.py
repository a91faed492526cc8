"""Shared control that carries the operator's deviation from the scene observed into the actual scene.

The operator acts on a scene that is late or displaced. In the skill adapted to the frames that the operator
saw, state k is N(mu_k, Sigma_k); in the skill adapted to the actual frames it is N(nu_k, T_k). The command x
is a point of the movement, blurred by the operator's imprecision,

    x = s exp(noise),    s ~ N(mu_k, Sigma_k),    noise ~ N(0, S),    S = sigma_op^2 I,

so that the filter of `kernels/occupancy.py` takes N(log_mu_k(x); 0, Sigma_k + S) as the density of x in
state k.

Carry. Each object takes the position of the command with it: frame p moved from (R_p, b_p) to (R'_p, b'_p),
and x to R'_p R_p' (x - b_p) + b'_p. These positions are weighted by the precision L_p of frame p in the
actual scene, as in the product of Gaussians:

    x' = C_k x + c_k,    C_k = (sum_p L_p)^-1 sum_p L_p R'_p R_p',    L_p = R'_p (Sigma_kp)^-1 R'_p',
    c_k = (sum_p L_p)^-1 sum_p L_p (b'_p - R'_p R_p' b_p).

Carrying C_k (x - mu_k), the deviation from the mean of the product, would lose where x is at each object: in
a state that is long in the direction of its movement it ends beside the object that the operator touched.
Deviations of orientations are in body axes, which no frame changes, and scalars do not move: they keep
e = log_mu_k(x). With the same frames x' = x. If all frames move together, the command moves with them.

Fusion. With d_k = x' - nu_k in the position and e elsewhere, the model N(nu_k, T_k) and the operator
N(nu_k + d_k, S) are multiplied:

    mean = nu_k + T_k (T_k + S)^-1 d_k,    covariance = T_k (T_k + S)^-1 S.

Where the demonstrations agree (T_k small) the correction is strong; where they vary the operator decides. An
LQR with the weight T_k^-1 would go to nu_k whatever T_k is: its set point, not its gain, holds the operator.
The states are mixed by their probabilities, with the spread between them in the covariance.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pilotfish.assistance.coordinates import SPATIAL_AXES
from pilotfish.demonstrations import Frame
from pilotfish.gaussians import precision_cholesky
from pilotfish.kernels import CarriedModel
from pilotfish.models import Skill, adapt
from pilotfish.types import Array, Float


def carried_situation(
    skill: Skill,
    frames_observed: Sequence[Frame],
    frames_actual: Sequence[Frame],
    operator_deviations: Float[Array, " E"],
) -> CarriedModel:
    """Adapt a skill to the frames observed by the operator and to the actual frames.

    Args:
        skill: Skill of coordinates, from `coordinate_skill`.
        frames_observed: Frames of the scene that the operator acts on.
        frames_actual: Frames of the scene that the robot acts in.
        operator_deviations: Standard deviation of the operator in each tangent column, positive.

    Raises:
        InvalidInput: If a frame is missing, unknown, singular or of another width.
        NotPositiveDefinite: If a covariance is singular.
    """
    skill = replace(skill, endpoints=None)  # of the states only: to adapt them takes a third of the time
    observed, actual = adapt(skill, frames_observed), adapt(skill, frames_actual)
    S = np.diag(operator_deviations**2)
    K = actual.covariances @ np.linalg.inv(actual.covariances + S)
    C, c = carry_maps(skill, frames_observed, frames_actual)
    offsets, position = np.zeros(K.shape[:2]), slice(0, SPATIAL_AXES)
    offsets[:, position] = (
        np.einsum("kij,kj->ki", C, observed.means[:, position]) + c - actual.means[:, position]
    )
    carry = np.tile(np.eye(K.shape[-1]), (skill.states, 1, 1))
    carry[:, position, position] = C
    return CarriedModel(
        observed.means,
        precision_cholesky(observed.covariances + S, "the covariance observed of state"),
        actual.means,
        np.einsum("kij,kj->ki", K, offsets),
        K @ carry,
        K @ S,
    )


def carry_maps(
    skill: Skill, frames_observed: Sequence[Frame], frames_actual: Sequence[Frame]
) -> tuple[Float[Array, "K 3 3"], Float[Array, "K 3"]]:
    """Return C and c of each state, with which a position observed x is carried to C x + c.

    Args:
        skill: Skill of coordinates, from `coordinate_skill`.
        frames_observed: Frames of the scene that the operator acts on, in any order.
        frames_actual: Frames of the scene that the robot acts in, in any order.
    """
    observed, actual = (
        {frame.name: frame for frame in frames} for frames in (frames_observed, frames_actual)
    )
    columns = slice(0, SPATIAL_AXES)  # the position, among points and deviations
    total, rotated = np.zeros((2, skill.states, SPATIAL_AXES, SPATIAL_AXES))
    shifted = np.zeros((skill.states, SPATIAL_AXES, 1))
    for name, covariances in zip(skill.frame_names, skill.covariances, strict=True):
        before, after = observed[name], actual[name]
        inverse = np.linalg.inv(after.A[columns, columns])
        turn = after.A[columns, columns] @ np.linalg.inv(before.A[columns, columns])
        local = np.linalg.inv(covariances.dense[:, columns, columns])
        precision = inverse.T @ local @ inverse
        total += precision
        rotated += precision @ turn
        shifted += precision @ (after.b[columns] - turn @ before.b[columns])[:, None]
    return np.linalg.solve(total, rotated), np.linalg.solve(total, shifted)[..., 0]
