"""Aiming a sub-movement by the error that is seen, and missing by noise that grows with its length."""

import numpy as np

from pilotfish.environments.human.offsets import add_offset, clip_offset, offset_norms, pose_difference
from pilotfish.environments.human.person import HumanModel
from pilotfish.geometry import Pose, rotation_matrix
from pilotfish.types import Array, Float


def aim_submovement(
    human_model: HumanModel, hand: Pose, tool: Pose, goal: Pose, rng: np.random.Generator
) -> Float[Array, " 6"]:
    """The way for the hand that takes the tool seen to the goal, but for gain and noise.

    The hand keeps what it is ahead of the tool, as a tool that hangs or presses needs it, up to the lean.
    """
    lead = clip_offset(pose_difference(tool, hand), human_model.max_lead, human_model.max_angular_lead)
    wanted = add_offset(
        tool, add_motor_noise(human_model, human_model.gain * pose_difference(tool, goal), tool, rng)
    )
    return pose_difference(hand, add_offset(wanted, lead))


def add_motor_noise(
    human_model: HumanModel, displacement: Float[Array, " 6"], tool: Pose, rng: np.random.Generator
) -> Float[Array, " 6"]:
    """The way as it comes out: its end scatters along and across it, and about three axes of the turn.

    Noise is drawn in the axes of the tool, so that it turns with the world.
    Source: Schmidt et al. 1979, Psychological Review 86, and Harris & Wolpert 1998, Nature 394: deviations
    proportional to amplitude; Gordon et al. 1994, Exp. Brain Research 99: larger along than across.
    """
    distance, angle = offset_norms(displacement)
    noise, angular_noise = rng.standard_normal((2, 3))
    noise = rotation_matrix(tool.quaternion) @ noise
    direction = displacement[:3] / distance if distance > 0.0 else np.zeros(3)
    on_it = (noise @ direction) * direction
    scatter = max(human_model.min_noise, human_model.parallel_noise * distance) * on_it
    scatter = scatter + max(human_model.min_noise, human_model.perpendicular_noise * distance) * (
        noise - on_it
    )
    turn_scatter = max(human_model.min_angular_noise, human_model.angular_noise * angle) * angular_noise
    return np.asarray(displacement + np.concatenate([scatter, turn_scatter]))
