"""Valid arguments of functions that convert recordings of a laboratory."""

import numpy as np

from fuzzing.examples_of_values import Examples
from pilotfish.demonstrations import BuildSettings, FrameSource, PartSource, Quantity, Recording, Signal


def recordings_examples() -> Examples:
    """Return valid arguments by the name of the function."""
    t = np.arange(12) * 0.1
    values = np.column_stack([t, t, t, *(1.0 + 0.0 * t, 0.0 * t, 0.0 * t, 0.0 * t), t > 0.5])
    names = ("x", "y", "z", "qw", "qx", "qy", "qz", "gripper")
    hand = Signal("robot", values, names, ("mm",) * 3 + ("",) * 5, t)
    cup = Signal("cup", np.ones((3, 3)), ("px", "py", "pz"), ("m",) * 3, t[:3])
    recording = Recording("reach", (hand, cup), {"phase": ("a",) * 12})
    settings = BuildSettings(
        (
            PartSource("position", Quantity.POSITION, ("x", "y", "z"), "mm"),
            PartSource("orientation", Quantity.QUATERNION, ("q?",)),
        ),
        (FrameSource("cup", ("px", "py", "pz")),),
        0.05,
    )
    columns = (*(f"translation.{axis}" for axis in "xyz"), *(f"rotation.{axis}" for axis in "xyzw"))
    camera = Signal("/tf/camera", np.eye(7)[6:], columns, ("m",) * 3 + ("1",) * 4, t[:1], "base")
    return {
        "to_common_reference_frames": {"signals": [camera], "children": {"/tf/camera": "camera"}},
        "build_demonstration": {"recording": recording, "settings": settings},
        "suggest_settings": {"recordings": [recording]},
        "column_names": {"recording": recording},
        "select_columns": {"recording": recording, "names": ["x", "q*"], "label": "part"},
        "is_unit": {"text": "mm"},
        "parse_unit": {"text": "mm", "label": "unit"},
        "time_unit": {"times": t, "unit": "ms", "label": "times"},
    }
