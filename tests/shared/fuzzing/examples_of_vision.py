"""Valid arguments of the public functions of vision."""

import numpy as np

from fuzzing.examples_of_values import Examples, new_rng
from pilotfish.geometry import Pose, from_rotation_vector
from pilotfish.vision import BoardView, CalibrationBoard, Camera, Detections, Marker, Observation, project

HERE = Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))
CAMERA = Camera(64, 48, 60.0, 60.0, 31.5, 23.5, (0.1, -0.05, 0.0, 0.0, 0.0))


def board_views() -> list[BoardView]:
    column, row = np.meshgrid(np.arange(5.0), np.arange(4.0))
    points = 0.03 * np.stack([column.ravel() - 2.0, row.ravel() - 1.5, np.zeros(row.size)], axis=1)
    turns = 0.5 * new_rng().normal(size=(6, 3))
    poses = [Pose(np.array([0.0, 0.0, 0.4]), from_rotation_vector(turn)) for turn in turns]
    pixels = [
        project(CAMERA, np.array([(pose @ Pose(x, HERE.quaternion)).position for x in points]))
        for pose in poses
    ]
    return [BoardView(points, each) for each in pixels]


def vision_examples() -> Examples:
    image = new_rng().integers(0, 256, (48, 64)).astype(np.uint8)
    square = np.array([[20.0, 10.0], [40.0, 12.0], [39.0, 33.0], [19.0, 30.0]])
    marker = Marker(3, 0.1, "a", HERE)
    return {
        "calibrate_camera": {"views": board_views(), "width": 64, "height": 48},
        "detect_markers": {"image": image, "dictionary": "apriltag_36h11"},
        "draw_detections": {
            "image": image,
            "camera": CAMERA,
            "detections": Detections({3: square}, ()),
            "frames": {"a": Pose(np.array([0.0, 0.0, 1.0]), HERE.quaternion)},
            "length": 0.05,
        },
        "estimate_pose": {"camera": CAMERA, "markers": [marker], "corners": {3: square}, "max_error": 2.0},
        "find_board": {"image": image, "board": CalibrationBoard(4, 3, 0.03)},
        "frame_tracks": {"times": [0.0, 0.1], "observations": [{"a": Observation(HERE, 0.1)}] * 2},
        "marker_bitmap": {"dictionary": "apriltag_36h11", "number": 3, "cell_pixels": 2},
        "project": {"camera": CAMERA, "points": np.array([[0.0, 0.1, 1.0], [0.1, 0.0, 2.0]])},
        "refine_corners": {"grey": image, "corners": square, "cell_share": 0.1},
    }
