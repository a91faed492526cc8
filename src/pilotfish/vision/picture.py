"""Picture of what the estimator finds: outlines of markers, and the axes of frames."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, rotation_matrix
from pilotfish.io import atomic_file
from pilotfish.types import Array, Float, UInt8
from pilotfish.validation import require_number, require_type
from pilotfish.vision.camera import Camera, project
from pilotfish.vision.detection import Detections, grey_image
from pilotfish.vision.opencv import require_opencv

COLOURS = ((40, 40, 220), (60, 180, 40), (220, 90, 30))  # of x, y and z: blue, green, red
OUTLINE = (0, 215, 255)
SHIFT = 4  # binary digits of a fraction of a pixel


def draw_detections(
    image: UInt8[Array, "H W *C"],
    camera: Camera,
    detections: Detections,
    frames: Mapping[str, Pose],
    *,
    length: float = 0.05,
) -> UInt8[Array, "H W 3"]:
    """Return a copy of an image with the outlines of markers, and axes x red, y green, z blue.

    Args:
        image: Grey image, or colour image in the order blue, green, red.
        camera: Calibration of the camera.
        detections: Markers in the image.
        frames: Poses in camera axes, by name.
        length: Length of the axes [m].

    Raises:
        InvalidInput: If an argument cannot be used.
    """
    cv2 = require_opencv()
    grey = grey_image(cv2, image)
    require_type(detections, "detections", Detections, "detect_markers(image, dictionary) returns them")
    require_type(frames, "frames", Mapping, "give poses by name")
    require_number(length, "length", 1e-6, 1e3)
    picture = cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR) if image.ndim == 2 else np.array(image)
    for corners in detections.corners.values():
        for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            _draw_line(cv2, picture, start, end, OUTLINE)
    for name, pose in frames.items():
        require_type(pose, f"frame {name!r}", Pose, "geometry.pose(position, quaternion) creates one")
        axes = length * np.concatenate([np.zeros((1, 3)), np.eye(3)])
        pixels = project(camera, axes @ rotation_matrix(pose.quaternion).T + pose.position)
        for end, colour in zip(pixels[1:], COLOURS, strict=True):
            _draw_line(cv2, picture, pixels[0], end, colour)
    return np.asarray(picture)


def _draw_line(
    cv2: Any,
    picture: UInt8[Array, "H W 3"],
    start: Float[Array, " 2"],
    end: Float[Array, " 2"],
    colour: tuple[int, int, int],
) -> None:
    ends = np.stack([start, end])
    if not (np.isfinite(ends).all() and np.abs(ends).max() < 2**15):
        return
    first, last = (tuple(int(value) for value in np.round(point * 2**SHIFT)) for point in ends)
    cv2.line(picture, first, last, colour, max(2, len(picture) // 400), cv2.LINE_AA, SHIFT)


def write_picture(path: Path, image: UInt8[Array, "H W *C"], *, overwrite: bool = False) -> None:
    """Write an image as PNG.

    Args:
        path: File to write.
        image: Grey image, or colour image in the order blue, green, red.
        overwrite: Whether to replace an existing file.

    Raises:
        InvalidInput: If the image or the file cannot be used.
    """
    cv2 = require_opencv()
    grey_image(cv2, image)
    done, data = cv2.imencode(".png", image)
    if not done:
        raise InvalidInput("the image cannot be encoded as PNG")
    with atomic_file(path, overwrite=overwrite) as temporary:
        temporary.write_bytes(data.tobytes())
