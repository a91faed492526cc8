"""Show a robot in physics how a carabiner is hooked on a rod, four times, and let it hook where it never did.

Run it:  python examples/hook_a_carabiner.py
"""

import numpy as np

import pilotfish as pf
from pilotfish.environments import TASKS
from pilotfish.simulation import perform, record_demonstrations, situation_from_seed

task = TASKS["carabiner"]

# A simulated person leads the left arm of the robot; the right one follows and pushes the carabiner on a rod.
recordings = [recording for recording, _ in record_demonstrations(task, 4, seed=0)]
for recording in recordings:
    print(
        f"{recording.demonstration.name}: {recording.duration:.1f} s, at most {recording.peak_forces['tool']:.0f} N"
    )

# What was asked of the tool, seen from the rod: six states, each with a Gaussian and a duration.
demonstrations = [pf.add_derivatives(recording.demonstration) for recording in recordings]
fit = pf.learn(demonstrations, states=6, rng=np.random.default_rng(0))

# Rods that stand elsewhere, turned by up to 25 degrees: adapt, plan, track, and springs and dampers do it.
for n in range(3):
    result = perform(fit.skill, task, situation_from_seed(task, "test", 0, n))
    rod = result.frames["rod"].position
    how = "hooked" if result.outcome.success else f"not hooked, {result.outcome.reason}"
    print(f"rod at {np.round(rod, 2).tolist()} m: {how}, at most {result.peak_forces['tool']:.0f} N")
