"""Open a valve and pass a via-point at a given time.

Run it:  python examples/pass_through_a_point.py
"""

import numpy as np

import pilotfish as pf

# A skill from four demonstrations, in the situation of the fifth.
demonstrations = pf.datasets.valve()
fit = pf.learn(demonstrations[:4], states=7, structure=pf.structures.SemiTied(), rng=np.random.default_rng(0))
test = demonstrations[4]
direct = pf.reproduce(fit.skill, test.frames, test.x[0])

# After four seconds: 10 cm above the direct motion, with the orientation that the person had then.
step = 40
time = step * direct.motion.period  # [s]
position, orientation = direct.motion.x[step, :3] + [0.0, 0.0, 0.1], test.x[step, 3:7]
via_points = [
    pf.via_point("position", position, time=time, deviation=2e-4),  # [m]
    pf.via_point("orientation", orientation, time=time, deviation=np.radians(0.3)),  # [rad]
]
reference = pf.planning.condition_on(direct.reference, via_points, direct.adapted.layout)
feedback = pf.track(direct.feedback.system, reference, pf.planning.default_control_cost(direct.tangent_skill))
motion = feedback.rollout(test.x[0])

error = np.linalg.norm(motion.x[step, :3] - position)  # [m]
distance = np.linalg.norm(motion.x[:, :3] - direct.motion.x[:, :3], axis=1)
apart = np.flatnonzero(distance > 1e-3) * motion.period  # [s]
print(f"the tool passes {1000 * error:.2f} mm from the via-point; the direct motion passes 100 mm from it")
print(f"the motions are more than a millimetre apart from {apart[0]:.1f} s to {apart[-1]:.1f} s")
print(f"the motion ends {1000 * distance[-1]:.3f} mm from the end of the direct motion")
largest, largest_direct = (np.abs(m.u[:, :3]).max() for m in (motion, direct.motion))
print(f"largest acceleration {largest:.2f} m/s^2, of the direct motion {largest_direct:.2f} m/s^2")
