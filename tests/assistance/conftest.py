"""Demonstrations of a simple task: from home to an object and back on the same way."""

from collections.abc import Callable

import numpy as np
import pytest

from pilotfish.demonstrations import (
    Demonstration,
    Layout,
    Part,
    Quantity,
    demonstration,
    frame_from_pose,
    moving_frame_from_poses,
    pose_layout,
    to_sphere,
)
from pilotfish.geometry import Pose, minimum_jerk, multiply, quaternion_exp, quaternion_log

PERIOD, STEPS = 0.05, 80
GRIP = Part("grip", Quantity.SCALAR, 1, "1")
Make = Callable[..., list[Demonstration]]


def object_pose(rng: np.random.Generator) -> Pose:
    turn = quaternion_exp(np.array([0.0, 0.0, rng.uniform(-0.4, 0.4)]))
    return Pose(np.array([0.5, 0.0, 0.2]) + rng.uniform(-0.08, 0.08, size=3), turn)


def there_and_back(pose: Pose, rng: np.random.Generator, steps: int) -> np.ndarray:
    """Return a row per step: up to 1 cm of noise, half of the time for the way there."""
    share = minimum_jerk(1.0 - np.abs(np.linspace(-1.0, 1.0, steps)))[:, None]
    arc = 0.1 * np.sin(np.pi * share) * np.array([0.0, 1.0, 0.0])
    noise = 0.003 * rng.normal(size=3) * np.sin(np.pi * share)
    q = quaternion_exp(
        share * quaternion_log(multiply(pose.quaternion, quaternion_exp(np.array([0.3, 0.2, 0.0]))))
    )
    return np.hstack([share * pose.position + arc + noise, q])


@pytest.fixture
def make(rng: np.random.Generator) -> Make:
    """Return a function that makes demonstrations with the frames of a robot base and of an object."""

    def demonstrations(
        number=6, steps=STEPS, *, sphere=False, grip=False, moving=False, central=False
    ) -> list[Demonstration]:
        layout = Layout(pose_layout().parts + (GRIP,) * grip)
        demos = []
        for m in range(number):
            pose, length = object_pose(rng), steps + 3 * m
            x = there_and_back(pose, rng, length)
            if grip:
                closed = np.arange(length) >= length // 2 + m
                x = np.column_stack([x, closed])
            base = frame_from_pose("base", layout, Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])))
            target = frame_from_pose("object", layout, pose)
            if moving:
                target = moving_frame_from_poses("object", layout, [pose] * length)
            demo = demonstration(x, PERIOD, layout, [base, target], f"reach {m}")
            demos.append(to_sphere(demo) if sphere else demo)
        return central_last(demos) if central else demos

    return demonstrations


def central_last(demos: list[Demonstration]) -> list[Demonstration]:
    """Put the one whose situation is nearest to the mean last: the others cover it."""
    at = np.array([demo.x[len(demo.x) // 2] for demo in demos])
    at = (at - at.mean(axis=0)) / (at.std(axis=0) + 1e-12)
    last = int(np.linalg.norm(at, axis=1).argmin())
    return [*demos[:last], *demos[last + 1 :], demos[last]]
