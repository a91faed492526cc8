"""Tip a jug over a cup: orientations on the sphere S^3 beside quaternions as four numbers.

Run it:  python examples/turn_on_the_sphere.py
"""

import numpy as np

import pilotfish as pf
from pilotfish import geometry
from pilotfish.demonstrations import frame_from_pose, pose_layout
from pilotfish.geometry import Pose

PERIOD, STEPS = 0.05, 120  # [s]
UP, HORIZONTAL = np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0])


def axis_angle_quaternions(axis, radians):
    """The quaternions w x y z of turns about an axis."""
    return geometry.from_rotation_vector(np.asarray(radians)[..., None] * axis)


def sample_pouring(cup, side, wobble):
    """The jug above the cup, held from a side [rad], tipped by 150 degrees and held there."""
    s = np.clip(np.linspace(-0.3, 1.3, STEPS), 0.0, 1.0)
    tip = axis_angle_quaternions(HORIZONTAL, np.radians(150.0) * (10 * s**3 - 15 * s**4 + 6 * s**5))
    hand = geometry.multiply(axis_angle_quaternions(UP, side), geometry.from_rotation_vector(wobble))
    q = geometry.multiply(cup.quaternion, geometry.multiply(hand, tip))
    x = np.hstack([np.tile(cup.position + 0.2 * UP, (STEPS, 1)), q])
    frames = [frame_from_pose("cup", pose_layout(), cup)]
    return pf.add_derivatives(pf.demonstration(x, PERIOD, pose_layout(), frames))


def motion_of(skill, situation):
    """Where the cup of this situation stands, beginning as it does: every step in the world."""
    adapted, start = pf.adapt(skill, situation.frames), situation.x[0]
    if not skill.layout.orientation_starts:  # four numbers: flat already
        reference = pf.plan(adapted, start, horizon=STEPS, covariance_regularisation=1e-4)
        return (
            pf.track(pf.control.double_integrator(7, period=PERIOD), reference, control_cost=1e-2)
            .rollout(start)
            .x
        )
    flat = pf.planning.tangent_chart(adapted)  # rotation vectors, on which to plan and track as ever
    start = flat.to_tangent(start)
    reference = pf.plan(flat.skill, start, horizon=STEPS, covariance_regularisation=1e-4)
    motion = pf.track(pf.control.double_integrator(6, period=PERIOD), reference, control_cost=1e-2).rollout(
        start
    )
    return flat.to_manifold(motion.x)


rng = np.random.default_rng(0)
training = []
for side in np.radians([-30.0, -20.0, -10.0, 0.0, 10.0, 20.0, 30.0]):
    cup = Pose(0.5 * rng.normal(size=3), axis_angle_quaternions(UP, rng.uniform(-3.0, 3.0)))
    training.append(sample_pouring(cup, side, wobble=0.03 * rng.normal(size=3)))

cup = Pose(np.array([0.3, 0.4, 0.1]), axis_angle_quaternions(UP, 2.5))  # where none stood before
for name, treated in (("four numbers", lambda d: d), ("on the sphere", pf.to_sphere)):
    skill = pf.learn([treated(d) for d in training], states=5, rng=np.random.default_rng(0)).skill
    print(f"{name}, {skill.width} columns; the jug, held from .. degrees, is turned wrongly by")
    for side in (0.0, 15.0, 30.0, 60.0):
        unseen = treated(sample_pouring(cup, np.radians(side), wobble=np.zeros(3)))
        q = motion_of(skill, unseen)[:, 3:7]
        off = np.degrees(geometry.angle(geometry.normalise(q), unseen.x[:, 3:7]))
        length = np.abs(np.linalg.norm(q, axis=1) - 1.0).max()
        print(
            f"  {side:2.0f} deg: {off.mean():4.1f} deg on average, {off[-1]:4.1f} at its end; "
            f"lengths of quaternions off by {length:.3f}"
        )

# Covariances on the sphere speak of turns: how far each state may turn about the axes of the jug.
spreads = np.sqrt(skill.covariances[0].dense[:, range(3, 6), range(3, 6)])
for k, (x, y, z) in enumerate(np.degrees(spreads)):
    print(f"state {k} turns by +- {x:.1f} deg about the jug's x, {y:.1f} about y, {z:.1f} about z")
