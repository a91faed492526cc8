"""Open a valve, but pass a place that a person points at: exactly there, at that moment, and smoothly.

Run it:  python examples/pass_through_a_point.py
"""

import numpy as np

import pilotfish as pf

# A skill from four openings of a valve, where the valve of the fifth stands.
demonstrations = pf.datasets.valve()
fit = pf.learn(demonstrations[:4], states=7, structure=pf.structures.SemiTied(), rng=np.random.default_rng(0))
unseen = demonstrations[4]
adapted = pf.adapt(fit.skill, unseen.frames)
robot = pf.control.double_integrator(7, period=adapted.period)


def follow(reference):
    """The motion that follows a plan, from where the person began."""
    return pf.track(robot, reference, control_cost=9.0).rollout(unseen.x[0])


plan = pf.plan(adapted, unseen.x[0], horizon=200)
original = follow(plan)

# Four seconds into it: 10 cm above where it would have been, and turned as the person held it there.
step = 40
above, axis_angle_quaternions = original.x[step, :3] + [0.0, 0.0, 0.1], unseen.x[step, 3:7]
via_points = [
    pf.via_point("position", above, time=step * adapted.period, deviation=5e-4),  # m
    pf.via_point(
        "orientation", axis_angle_quaternions, time=step * adapted.period, deviation=np.radians(0.3)
    ),
]
conditioned_motion = follow(pf.planning.condition_on(plan, via_points, adapted.layout))

miss = np.linalg.norm(conditioned_motion.x[step, :3] - above)  # [m]
bent = np.linalg.norm(conditioned_motion.x[:, :3] - original.x[:, :3], axis=1)
away = np.flatnonzero(bent > 1e-3) * adapted.period  # [s]
print(f"the tool passes {1000 * miss:.2f} mm from the point, without the wish 100 mm")
print(f"it leaves its way at {away[0]:.1f} s and is back, to a millimetre, at {away[-1]:.1f} s")
print(f"it ends {1000 * bent[-1]:.3f} mm from where it would have ended")
push, usual_push = np.abs(conditioned_motion.u[:, :3]).max(), np.abs(original.u[:, :3]).max()
print(f"largest acceleration {push:.2f} m/s^2, without the wish {usual_push:.2f} m/s^2")
