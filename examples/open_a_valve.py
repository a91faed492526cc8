"""Learn to open a valve from four demonstrations, and open it at a new angle.

Run it:  python examples/open_a_valve.py
"""

import numpy as np

import pilotfish as pf

# Eight kinesthetic demonstrations: tool poses over time, with the frames of the valve before and after.
demonstrations = pf.datasets.valve()
training, test = demonstrations[:4], demonstrations[4]

# The states have durations, and a distribution in every frame.
fit = pf.learn(training, rng=np.random.default_rng(0))
first, *_, last = fit.log_likelihoods
print(f"log-likelihood {first:.0f} -> {last:.0f} nats in {fit.convergence.iterations} iterations")

# The pose of the valve now determines the targets, and how closely each is followed.
adapted = pf.adapt(fit.skill, test.frames)
reference = pf.plan(adapted, test.x[0], horizon=len(test.x))

# A unit mass on every axis tracks the reference, stiff where the demonstrations agreed.
system = pf.control.double_integrator(7, period=adapted.period)
feedback = pf.track(system, reference, pf.planning.default_control_cost(adapted))
motion = feedback.rollout(test.x[0])

error = np.linalg.norm(motion.x[:, :3] - test.x[:, :3], axis=1)  # [m]
print(f"{test.name}: on average {1000 * error.mean():.0f} mm from what the person did")
stiffness = feedback.stiffness[:, 0, 0]
print(f"stiffness along x: {stiffness.min():.1f} to {stiffness.max():.1f} 1/s^2")
