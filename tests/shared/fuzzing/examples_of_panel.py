"""Valid arguments of the public functions of the panel."""

import numpy as np

from fuzzing.examples_of_models import learn_lines
from fuzzing.examples_of_values import Examples
from fuzzing.seeds import valve_demonstrations
from pilotfish import geometry, panel
from pilotfish.demonstrations import frame_from_pose, pose_layout


def panel_examples() -> Examples:
    demonstrations = valve_demonstrations()
    layout = pose_layout()
    target = geometry.pose(np.array([0.4, 0.1, 0.2]), np.array([0.6, 0.0, 0.8, 0.0]))
    frame = frame_from_pose("cup", layout, target)
    demos, fit = learn_lines()
    frames = [each.at(0) for each in demos[0].frames]
    live = panel.compute_reproduction(fit.skill, frames)
    return {
        "compute_reproduction": {"skill": fit.skill, "frames": frames},
        "reproduction_notes": {"skill": fit.skill, "live": live, "frames": frames},
        "is_loopback": {"host": "127.0.0.1"},
        "frame_pose": {"frame": frame, "layout": layout},
        "move_frame": {"frame": frame, "layout": layout, "target": target},
        "view_content": {"demonstrations": demonstrations},
    }
