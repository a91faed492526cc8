"""Learn how a valve is opened from four demonstrations, and open it at an angle never shown.

Run it:  python examples/open_a_valve.py
"""

import numpy as np

import pilotfish as pf

# Eight recorded openings: the tool's pose over time, seen from the valve before and after.
demonstrations = pf.datasets.valve()
training, unseen = demonstrations[:4], demonstrations[4]

# Seven states with durations; all states of a frame share their basis of synergies.
fit = pf.learn(training, states=7, structure=pf.structures.SemiTied(), rng=np.random.default_rng(0))
print(f"log-likelihood {fit.trace[0]:.0f} -> {fit.trace[-1]:.0f} nats; {fit.outcome.reason}")

# Where the valve stands now decides where the movement goes, and how precise it must be on the way.
adapted = pf.adapt(fit.skill, unseen.frames)
reference = pf.plan(adapted, unseen.x[0], horizon=200)

# A unit mass in each coordinate follows the plan, stiff where the demonstrations agreed.
feedback = pf.track(pf.control.double_integrator(7, period=adapted.period), reference, control_cost=9.0)
motion = feedback.rollout(unseen.x[0])

miss = np.linalg.norm(motion.x[:, :3] - unseen.x[:, :3], axis=1)  # [m]
print(f"{unseen.name}: on average {1000 * miss.mean():.0f} mm from what the person did there")
along_x = feedback.stiffness[:, 0, 0]
print(f"stiffness along x: {along_x.min():.1f} to {along_x.max():.1f} 1/s^2")
