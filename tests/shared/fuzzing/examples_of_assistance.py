"""Valid arguments of the public functions of assistance."""

from functools import cache

import numpy as np

from fuzzing.examples_of_values import Examples, new_rng
from fuzzing.seeds import FAST_SETTINGS, valve_demonstrations
from pilotfish import assistance, models


@cache
def _assistant() -> assistance.Assistant:
    skill = models.learn(valve_demonstrations(), states=2, rng=new_rng(), settings=FAST_SETTINGS).skill
    return assistance.make_assistant([assistance.assisted_skill(skill)])


def assistance_examples() -> Examples:
    demos, assistant = valve_demonstrations(), _assistant()
    skill = models.learn(demos, states=2, rng=new_rng(), settings=FAST_SETTINGS).skill
    hand = demos[0].x[0, np.array(demos[0].layout.coordinates)]
    scene = {"frames_observed": list(demos[0].frames), "frames_actual": list(demos[1].frames)}
    state = assistance.initial_state(assistant, hand, **scene)
    command = assistance.Command(hand, "shared")
    calibration = assistance.IntentionCalibration(0.0, 0.2)
    intention = assistance.intention_filter(assistant.skills, calibration)
    frames = list(demos[0].frames)
    return {
        "assisted_skill": {"skill": skill, "gate": assistance.Gate(1.0, 3.0)},
        "direct_skill": {"layout": assistant.layout},
        "misalignment": {"assistant": assistant, "state": state},
        "rest_target": {"assistant": assistant, "state": state, "pose": hand},
        "coverage_distances": {"skill": skill, "demonstration": demos[0]},
        "initial_state": {"assistant": assistant, "pose": hand, **scene, "skill": 0},
        "intention_filter": {"skills": list(assistant.skills), "calibration": calibration},
        "joint_demonstration": {"demo": demos[0]},
        "make_assistant": {"skills": list(assistant.skills), "control_cost": 0.1},
        "predictive_log_densities": {"skill": skill, "demonstration": demos[0], "tempering": 0.2},
        "start_intention": {"intention": intention, "frames": frames},
        "step_intention": {
            "intention": intention,
            "state": assistance.start_intention(intention, frames),
            "pose": hand,
            "frames": frames,
        },
        "step_assistance": {
            "assistant": assistant,
            "state": state,
            "command": command,
            **scene,
            "dt": 0.01,
        },
    }
