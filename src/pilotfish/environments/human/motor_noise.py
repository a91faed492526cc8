"""Aim of a sub-movement from the observed error, and its signal-dependent motor noise."""

import numpy as np

from pilotfish.environments.human.human_model import HumanModel
from pilotfish.environments.human.pose_offsets import (
    add_offset,
    clip_offset,
    offset_norms,
    pose_difference,
)
from pilotfish.geometry import Pose, rotation_matrix
from pilotfish.types import Array, Float


def aim_submovement(
    human_model: HumanModel, hand: Pose, tool: Pose, goal: Pose, rng: np.random.Generator
) -> Float[Array, " 6"]:
    """Return the displacement of the hand that brings the observed tool to the goal, with gain and noise.

    The hand keeps its lead over the tool, because a tool with weight or contact lags behind. The lead is
    limited to max_lead and max_angular_lead.
    """
    lead = clip_offset(pose_difference(tool, hand), human_model.max_lead, human_model.max_angular_lead)
    displacement = human_model.gain * pose_difference(tool, goal)
    tool_end = add_offset(tool, add_motor_noise(human_model, displacement, tool, rng))
    return pose_difference(hand, add_offset(tool_end, lead))


def add_motor_noise(
    human_model: HumanModel, displacement: Float[Array, " 6"], tool: Pose, rng: np.random.Generator
) -> Float[Array, " 6"]:
    """Return a displacement whose end varies along and across its direction, and about three axes.

    The noise is drawn in tool axes, so that it rotates with the world.

    Source:
        Schmidt et al. 1979, Psychological Review 86, and Harris & Wolpert 1998, Nature 394: deviations
        proportional to amplitude; Gordon et al. 1994, Exp. Brain Research 99: larger along than across.
    """
    distance, angle = offset_norms(displacement)
    noise, angular_noise = rng.standard_normal((2, 3))
    noise = rotation_matrix(tool.quaternion) @ noise
    direction = displacement[:3] / distance if distance > 0.0 else np.zeros(3)
    parallel = (noise @ direction) * direction
    deviation = max(human_model.min_noise, human_model.parallel_noise * distance) * parallel
    deviation = deviation + max(human_model.min_noise, human_model.perpendicular_noise * distance) * (
        noise - parallel
    )
    rotation = max(human_model.min_angular_noise, human_model.angular_noise * angle) * angular_noise
    return np.asarray(displacement + np.concatenate([deviation, rotation]))
