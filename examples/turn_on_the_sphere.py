"""Tip a jug over a cup: orientations on the sphere S^3 beside quaternions as four numbers.

Run it:  python examples/turn_on_the_sphere.py
"""

import numpy as np

import pilotfish as pf
from pilotfish import geometry
from pilotfish.demonstrations import frame_from_pose, pose_layout
from pilotfish.geometry import Pose, from_rotation_vector

PERIOD, STEPS = 0.05, 120  # [s]
COSTS = {"control_cost": 1e-2, "covariance_regularisation": 1e-4}
UP, HORIZONTAL = np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0])


def rotation_about(axis, angle):
    """Return the quaternions w x y z of rotations about an axis [rad]."""
    return from_rotation_vector(np.asarray(angle)[..., None] * axis)


def sample_pouring(cup, side, error):
    """Generate a jug above the cup, held from a side [rad], tipped by 150 degrees and held there."""
    s = np.clip(np.linspace(-0.3, 1.3, STEPS), 0.0, 1.0)
    tip = rotation_about(HORIZONTAL, np.radians(150.0) * (10 * s**3 - 15 * s**4 + 6 * s**5))
    hand = geometry.multiply(rotation_about(UP, side), from_rotation_vector(error))
    q = geometry.multiply(cup.quaternion, geometry.multiply(hand, tip))
    x = np.hstack([np.tile(cup.position + 0.2 * UP, (STEPS, 1)), q])
    frames = [frame_from_pose("cup", pose_layout(), cup)]
    return pf.add_derivatives(pf.demonstration(x, PERIOD, pose_layout(), frames))


rng = np.random.default_rng(0)
training = []
for side in np.radians([-30.0, -20.0, -10.0, 0.0, 10.0, 20.0, 30.0]):
    cup = Pose(0.5 * rng.normal(size=3), rotation_about(UP, rng.uniform(-3.0, 3.0)))
    training.append(sample_pouring(cup, side, error=0.03 * rng.normal(size=3)))

cup = Pose(np.array([0.3, 0.4, 0.1]), rotation_about(UP, 2.5))  # a new place
for name, convert in (("four numbers", lambda d: d), ("on the sphere", pf.demonstrations.to_sphere)):
    converted, bins = [convert(d) for d in training], pf.models.TimeBins()  # the same bins for both
    skill = pf.learn(converted, states=5, initialisation=bins, rng=np.random.default_rng(0)).skill
    print(f"{name}, {skill.width} columns; orientation error of the jug by the side that it is held from")
    for side in (0.0, 15.0, 30.0, 60.0):
        test = convert(sample_pouring(cup, np.radians(side), error=np.zeros(3)))
        motion = pf.reproduce(skill, test.frames, test.x[0], horizon=STEPS, **COSTS).motion
        q = motion.x[:, 3:7]
        error = np.degrees(geometry.angle(geometry.normalise(q), test.x[:, 3:7]))
        norm_error = np.abs(np.linalg.norm(q, axis=1) - 1.0).max()
        print(
            f"  {side:2.0f} deg: {error.mean():4.1f} deg on average, {error[-1]:4.1f} at the end; "
            f"norms of quaternions off by {norm_error:.3f}"
        )

# Covariances on the sphere are those of rotation vectors, in the axes of the jug.
deviations = np.sqrt(skill.covariances[0].dense[:, range(3, 6), range(3, 6)])
for k, (x, y, z) in enumerate(np.degrees(deviations)):
    print(f"state {k} deviates by {x:.1f} deg about the jug's x axis, {y:.1f} about y, {z:.1f} about z")
