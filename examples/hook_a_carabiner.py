"""Record four demonstrations of hooking a carabiner in physics, learn a skill and execute it on new rods.

Run it:  python examples/hook_a_carabiner.py
"""

import numpy as np

import pilotfish as pf
from pilotfish.environments import TASKS
from pilotfish.simulation import perform, record_demonstrations, situation_from_seed

task = TASKS["carabiner"]

# A human operator model leads the left arm; the right arm follows and pushes the carabiner onto a rod.
recordings = [recording for recording, _ in record_demonstrations(task, 4, seed=0)]
for recording in recordings:
    name, force = recording.demonstration.name, recording.peak_forces["tool"]
    print(f"{name}: {recording.duration:.1f} s, at most {force:.0f} N")

# The commanded tool poses, observed from the rod: six states, each with a Gaussian and a duration.
demonstrations = [pf.add_derivatives(recording.demonstration) for recording in recordings]
fit = pf.learn(demonstrations, states=6, rng=np.random.default_rng(0))

# Rods in other places, turned by up to 25 degrees: adapt, plan, track, and execute by impedance control.
for n in range(3):
    result = perform(fit.skill, task, situation_from_seed(task, "test", 0, n))
    rod = result.frames["rod"].position
    outcome = "hooked" if result.outcome.success else f"not hooked, {result.outcome.reason}"
    print(f"rod at {np.round(rod, 2).tolist()} m: {outcome}, at most {result.peak_forces['tool']:.0f} N")
