"""Demonstrations made for the laws: smooth movements seen from objects that stand and objects that move."""

from pathlib import Path

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
)
from pilotfish.geometry import Pose, multiply, normalise, quaternion_exp

PERIOD = 0.05  # s
TOML = """
format = "pilotfish demonstrations"
version = 1
period = 0.5 # s

[[layout]]
name = "position"
quantity = "position"
size = 2
unit = "m"

[[demonstration]]
name = "first"
file = "first.csv"
frames = [{ name = "cup", A = [[1, 0], [0, 2]], b = [0.5, 0] }]

[[demonstration]]
file = "second.csv"
frames = [{ name = "cup", A = [[1, 0], [0, 2]], b = [0, 0] }]
"""
CSV = "position x,position y\n0,1\n2,3.5\n-4e-3,5\n"


class Maker:
    """Random values; calling it makes a demonstration seen from a cup, and from a shelf or a moving belt."""

    mixed = Layout(
        (
            Part("time", Quantity.SCALAR, 1, "s"),
            Part("position", Quantity.POSITION, 3, "m"),
            Part("orientation", Quantity.QUATERNION, 4, "1"),
            Part("force", Quantity.VECTOR, 3, "N"),
            Part("joints", Quantity.SCALAR, 2, "rad"),
        )
    )

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng

    def pose(self) -> Pose:
        return Pose(self.rng.normal(size=3), normalise(self.rng.normal(size=4)))

    def quaternions(self, steps: int) -> np.ndarray:
        """A smooth turn from anywhere."""
        turns = np.linspace(0, 1, steps)[:, None] * self.rng.uniform(0.3, 0.8, size=3)
        return multiply(normalise(self.rng.normal(size=4)), quaternion_exp(turns))

    def x(self, layout: Layout, steps: int) -> np.ndarray:
        x = np.cumsum(self.rng.normal(scale=0.1, size=(steps, layout.width)), axis=0)
        for columns in layout.quaternions:
            x[:, columns] = self.quaternions(steps)
        return x

    def poses(self, steps: int) -> list[Pose]:
        return [Pose(self.rng.normal(size=3), q) for q in self.quaternions(steps)]

    def __call__(
        self, steps: int = 12, layout: Layout | None = None, *, moving: bool = False, name: str = "a"
    ) -> Demonstration:
        layout = layout or pose_layout()
        cup = frame_from_pose("cup", layout, self.pose())
        if moving:
            other = moving_frame_from_poses("belt", layout, self.poses(steps))
        else:
            other = frame_from_pose("shelf", layout, self.pose())
        return demonstration(self.x(layout, steps), PERIOD, layout, [cup, other], name)


@pytest.fixture
def make(rng: np.random.Generator) -> Maker:
    return Maker(rng)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder as a person would write it."""
    (tmp_path / "demonstrations.toml").write_text(TOML)
    for name in ("first", "second"):
        (tmp_path / f"{name}.csv").write_text(CSV)
    return tmp_path
