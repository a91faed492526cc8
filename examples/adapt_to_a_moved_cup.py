"""Learn to reach for a cup from five generated demonstrations, and reach for it in a new place.

Run it:  python examples/adapt_to_a_moved_cup.py
"""

import numpy as np

import pilotfish as pf
from pilotfish.demonstrations import frame_from_pose, pose_layout
from pilotfish.geometry import Pose

PERIOD = 0.05  # [s]
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])  # quaternion w x y z
BASE = Pose(np.zeros(3), UPRIGHT)


def sample_reach(cup, rng):
    """Generate a motion from near the base to above the cup, straight down to it, and a rest there."""
    s = np.linspace(0.0, 1.0, 40)[:, None]
    s = 10 * s**3 - 15 * s**4 + 6 * s**5  # minimum jerk
    start, above = 0.02 * rng.normal(size=3), cup.position + np.array([0.0, 0.0, 0.15])
    segments = [
        start + s * (above - start),
        above + s * (cup.position - above),
        np.tile(cup.position, (20, 1)),
    ]
    x = np.hstack([np.vstack(segments), np.tile(UPRIGHT, (100, 1))])
    frames = [frame_from_pose("base", pose_layout(), BASE), frame_from_pose("cup", pose_layout(), cup)]
    return pf.add_derivatives(pf.demonstration(x, PERIOD, pose_layout(), frames))


rng = np.random.default_rng(0)
places = [[0.5, 0.2, 0.1], [0.6, -0.1, 0.1], [0.4, 0.0, 0.2], [0.5, 0.1, 0.0], [0.6, 0.2, 0.2]]
cups = [Pose(np.array(place), UPRIGHT) for place in places]
skill = pf.learn([sample_reach(cup, rng) for cup in cups], states=6, rng=rng).skill

cup = Pose(np.array([0.7, 0.3, 0.05]), UPRIGHT)  # further away than in any demonstration
frames = [frame_from_pose("base", skill.layout, BASE), frame_from_pose("cup", skill.layout, cup)]
start = np.concatenate([np.zeros(3), UPRIGHT, np.zeros(7)])  # at rest at the base
motion = pf.reproduce(skill, frames, start, horizon=120).motion

error = np.linalg.norm(motion.x[-1, :3] - cup.position)  # [m]
height = motion.x[:, 2].max()  # [m]
print(f"the hand ends {1000 * error:.1f} mm from the cup; its largest height is {1000 * height:.0f} mm")
