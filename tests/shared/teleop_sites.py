"""A robot's site, a skill and its scene, for tests of teleoperation."""

from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np

import pilotfish as pf
from pilotfish import teleop
from pilotfish.demonstrations import Demonstration
from pilotfish.geometry import Pose, normalise, quaternion_from_rotation_matrix
from pilotfish.io import decode_assisted_skill, encode_assisted_skill


@cache
def demonstrations() -> tuple[Demonstration, ...]:
    return tuple(pf.io.synthetic_valve(np.random.default_rng(0)))


@cache
def skill_bytes() -> bytes:
    skill = pf.learn(demonstrations()[:6], states=7, rng=np.random.default_rng(0)).skill
    return encode_assisted_skill(skill)


@cache
def object_poses() -> Mapping[str, Pose]:
    """Return the poses of the objects of demonstration 6."""
    return {
        frame.name: Pose(frame.b[:3], quaternion_from_rotation_matrix(frame.A[:3, :3]))
        for frame in demonstrations()[6].frames
    }


@cache
def path() -> np.ndarray:
    """Return the poses of demonstration 6."""
    x = demonstrations()[6].x[:, :7].copy()
    x[:, 3:] = normalise(x[:, 3:])
    return x


def robot_settings(**settings: Any) -> teleop.RobotSettings:
    return teleop.RobotSettings(decode_assisted_skill, **settings)
