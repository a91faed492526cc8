"""Show a robot in physics how a carabiner is hooked on a rod, four times, and let it hook where it never did.

Run it:  python examples/hook_a_carabiner.py
"""

import numpy as np

import pilotfish as pf
from pilotfish.environments import TASKS
from pilotfish.station.execution import execute
from pilotfish.station.recorder import UNSEEN, shown, situation

task = TASKS["carabiner"]

# A simulated person leads the left arm of the robot; the right one follows and pushes the carabiner on a rod.
recordings = [recording for recording, _ in shown(task, 4, seed=0)]
for recording in recordings:
    print(
        f"{recording.demonstration.name}: {recording.seconds:.1f} s, at most {recording.peaks['tool']:.0f} N"
    )

# What was asked of the tool, seen from the rod: six states, each with a Gaussian and a duration.
demonstrations = [pf.with_derivatives(recording.demonstration) for recording in recordings]
fit = pf.learn(demonstrations, states=6, rng=np.random.default_rng(0))

# Rods that stand elsewhere, turned by up to 25 degrees: adapt, plan, track, and springs and dampers do it.
for n in range(3):
    made = execute(fit.skill, task, situation(task, UNSEEN, 0, n))
    rod = made.frames["rod"].position
    how = "hooked" if made.verdict.success else f"not hooked, {made.verdict.why}"
    print(f"rod at {np.round(rod, 2).tolist()} m: {how}, at most {made.peaks['tool']:.0f} N")
