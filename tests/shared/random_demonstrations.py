"""Random smooth demonstrations, in fixed and in moving frames."""

import numpy as np

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


class DemonstrationMaker:
    """Random values; a call makes a demonstration with the frame of a cup and of a shelf or a moving belt."""

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
        """Return a smooth rotation that starts at a random orientation."""
        half_angles = np.linspace(0, 1, steps)[:, None] * self.rng.uniform(0.3, 0.8, size=3)
        return multiply(normalise(self.rng.normal(size=4)), quaternion_exp(half_angles))

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
            second = moving_frame_from_poses("belt", layout, self.poses(steps))
        else:
            second = frame_from_pose("shelf", layout, self.pose())
        return demonstration(self.x(layout, steps), PERIOD, layout, [cup, second], name)
