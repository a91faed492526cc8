"""Record a mission of the valve, and print the time before each step: recorded_mission.py SKILL OUT."""

import sys

import numpy as np

from pilotfish.environments import TASKS
from pilotfish.io import encode_assisted_skill, open_skill
from pilotfish.simulation import situation_from_seed
from pilotfish.simulation.mission import MissionSettings, run_mission
from pilotfish.simulation.session_recorder import SessionRecorder

skill, out = sys.argv[1:]
task = TASKS["valve"]
with SessionRecorder(out) as recorder:
    run_mission(
        encode_assisted_skill(open_skill(skill)),
        task,
        situation_from_seed(task, "test", 0, 0),
        np.random.default_rng(0),
        MissionSettings(),
        on_step=lambda cell, step, view, given: (
            sys.stdout.write(f"{step.site.time / 1e9}\n") and sys.stdout.flush()
        ),
        recorder=recorder,
    )
