"""Learn to reach for a cup from five sketched reaches, then reach for the cup where it stands now.

Run it:  python examples/adapt_to_a_moved_cup.py
"""

import numpy as np

import pilotfish as pf
from pilotfish.demonstrations import add_derivatives, frame_from_pose, pose_layout
from pilotfish.geometry import Pose

PERIOD = 0.05  # [s]
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])  # quaternion w x y z
HOME = Pose(np.zeros(3), UPRIGHT)


def sample_reach(cup, rng):
    """From near the base to above the cup, straight down on it, and a rest there."""
    s = np.linspace(0.0, 1.0, 40)[:, None]
    s = 10 * s**3 - 15 * s**4 + 6 * s**5  # minimum jerk
    home, above = 0.02 * rng.normal(size=3), cup.position + np.array([0.0, 0.0, 0.15])
    way = [home + s * (above - home), above + s * (cup.position - above), np.tile(cup.position, (20, 1))]
    x = np.hstack([np.vstack(way), np.tile(UPRIGHT, (100, 1))])
    frames = [frame_from_pose("base", pose_layout(), HOME), frame_from_pose("cup", pose_layout(), cup)]
    return add_derivatives(pf.demonstration(x, PERIOD, pose_layout(), frames))


rng = np.random.default_rng(0)
places = [[0.5, 0.2, 0.1], [0.6, -0.1, 0.1], [0.4, 0.0, 0.2], [0.5, 0.1, 0.0], [0.6, 0.2, 0.2]]
cups = [Pose(np.array(place), UPRIGHT) for place in places]
skill = pf.learn([sample_reach(cup, rng) for cup in cups], states=6, rng=rng).skill

cup_pose = Pose(np.array([0.7, 0.3, 0.05]), UPRIGHT)  # a place never shown, beyond all others
adapted = pf.adapt(
    skill, [frame_from_pose("base", skill.layout, HOME), frame_from_pose("cup", skill.layout, cup_pose)]
)

start = np.concatenate([np.zeros(3), UPRIGHT, np.zeros(7)])  # at rest at the base
reference = pf.plan(adapted, start, horizon=120, covariance_regularisation=1e-4)
motion = pf.track(pf.control.double_integrator(7, period=PERIOD), reference, control_cost=1e-2).rollout(start)

miss = np.linalg.norm(motion.x[-1, :3] - cup_pose.position)
print(
    f"the hand ends {1000 * miss:.1f} mm from the cup, {1000 * motion.x[:, 2].max():.0f} mm high on its way"
)
