"""Valid arguments of the public functions of virtual fixtures."""

from functools import cache

import numpy as np

from fuzzing.examples_of_values import Examples, new_rng
from fuzzing.seeds import valve_demonstrations
from pilotfish import assistance
from pilotfish.demonstrations import Demonstration, to_sphere

STATES = 2


@cache
def _fixture(sphere: bool) -> tuple[list[Demonstration], assistance.VirtualFixture]:
    demos = [to_sphere(demo) if sphere else demo for demo in valve_demonstrations()]
    return demos, assistance.learn_virtual_fixture(demos, rng=new_rng(), states=STATES)


def fixture_examples() -> Examples:
    demos, flat = _fixture(False)
    curved_demos, curved = _fixture(True)
    frames, curved_frames = list(demos[0].frames), list(curved_demos[0].frames)
    x = demos[0].x
    switch = assistance.PhaseSwitch(0, np.array([0.5]), np.array([0.0, 1.0]))
    return {
        "add_phase": {"demo": demos[0], "phase": np.linspace(0.0, 1.0, len(x))},
        "learn_virtual_fixture": {
            "demonstrations": demos,
            "rng": new_rng(),
            "phase": "path",
            "states": STATES,
        },
        "nearest_phase": {"fixture": flat, "pose": x[3], "frames": frames},
        "start_fixture": {"fixture": curved, "frames": curved_frames, "phase": 0.2},
        "step_fixture": {
            "fixture": curved,
            "state": assistance.start_fixture(curved, curved_frames, 0.2),
            "pose": curved_demos[0].x[3],
            "velocity": np.full(6, 0.1),
            "frames": curved_frames,
            "dt": 0.05,
            "observed_frames": list(curved_demos[1].frames),
        },
        "virtual_fixture": {
            "skill": flat.skill,
            "duration": 4.0,
            "recorded_layout": demos[0].layout,
            "switches": [switch],
        },
    }
