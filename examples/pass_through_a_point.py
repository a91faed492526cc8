"""Open a valve, but pass a place that a person points at: exactly there, at that moment, and smoothly.

Run it:  python examples/pass_through_a_point.py
"""

import numpy as np

import pilotfish as pf

# A skill from four openings of a valve, where the valve of the fifth stands.
demonstrations = pf.datasets.valve()
fit = pf.learn(demonstrations[:4], states=7, structure=pf.SemiTied(), rng=np.random.default_rng(0))
unseen = demonstrations[4]
here = pf.adapt(fit.skill, unseen.frames)
robot = pf.double_integrator(7, period=here.period)


def moved(reference):
    """The motion that follows a plan, from where the person began."""
    return pf.track(robot, reference, effort=9.0).rollout(unseen.x[0])


plan = pf.plan(here, unseen.x[0], horizon=200)
usual = moved(plan)

# Four seconds into it: 10 cm above where it would have been, and turned as the person held it there.
step = 40
above, turned = usual.x[step, :3] + [0.0, 0.0, 0.1], unseen.x[step, 3:7]
wishes = [
    pf.via_point("position", above, time=step * here.period, deviation=5e-4),  # m
    pf.via_point("orientation", turned, time=step * here.period, deviation=np.radians(0.3)),
]
led = moved(pf.through(plan, wishes, here.layout))

miss = np.linalg.norm(led.x[step, :3] - above)  # [m]
bent = np.linalg.norm(led.x[:, :3] - usual.x[:, :3], axis=1)
away = np.flatnonzero(bent > 1e-3) * here.period  # [s]
print(f"the tool passes {1000 * miss:.2f} mm from the point, without the wish 100 mm")
print(f"it leaves its way at {away[0]:.1f} s and is back, to a millimetre, at {away[-1]:.1f} s")
print(f"it ends {1000 * bent[-1]:.3f} mm from where it would have ended")
push, usual_push = np.abs(led.u[:, :3]).max(), np.abs(usual.u[:, :3]).max()
print(f"largest acceleration {push:.2f} m/s^2, without the wish {usual_push:.2f} m/s^2")
