"""Find square markers in an image, with corners refined to a fraction of a pixel."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Float, UInt8
from pilotfish.validation import require_count, shorten_repr
from pilotfish.vision.camera import MAX_PIXELS
from pilotfish.vision.edge_refinement import refine_corners
from pilotfish.vision.marker_setup import DICTIONARIES, require_dictionary
from pilotfish.vision.opencv import require_opencv

REFINEMENT_WINDOW = 5  # pixels, half of the largest window in which a corner is refined
WINDOW_IN_CELLS = 0.4  # half of the window in cells of the marker, so that it holds one corner only
MIN_IMAGE_SIDE = 8  # pixels


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Detections:
    """Markers in one image.

    Attributes:
        corners: Upper left, upper right, lower right and lower left corner of each marker [pixels], by id.
        repeated: Ids that were found more than once; they are not in corners.
    """

    corners: dict[int, Float[Array, "4 2"]]
    repeated: tuple[int, ...]


def detect_markers(image: UInt8[Array, "H W *C"], dictionary: str) -> Detections:
    """Return the markers of a dictionary in an image.

    Args:
        image: Grey image, or colour image in OpenCV's order blue, green, red.
        dictionary: Name from `DICTIONARIES`.

    Raises:
        InvalidInput: If the image or the dictionary cannot be used.
    """
    cv2 = require_opencv()
    grey = grey_image(cv2, image)
    corners, ids, _ = _detector(cv2, dictionary).detectMarkers(grey)
    cells = marker_dictionary(cv2, dictionary).markerSize + 2
    found: dict[int, Float[Array, "4 2"]] = {}
    numbers = [] if ids is None else [int(number) for number in ids.ravel()]
    repeated = tuple(sorted({number for number in numbers if numbers.count(number) > 1}))
    for number, square in zip(numbers, corners, strict=True):
        if number not in repeated:
            corners_found = np.asarray(square, dtype=np.float64).reshape(4, 2)
            found[number] = refine_corners(grey, corners_found, 1.0 / cells)
    return Detections(found, repeated)


def marker_bitmap(dictionary: str, number: int, cell_pixels: int = 16) -> UInt8[Array, "S S"]:
    """Return the image of a marker without a margin; its outermost cells are black.

    Args:
        dictionary: Name from `DICTIONARIES`.
        number: Id of the marker.
        cell_pixels: Side of each cell [pixels].

    Raises:
        InvalidInput: If the dictionary has no such marker.
    """
    cv2 = require_opencv()
    table = marker_dictionary(cv2, dictionary)
    require_count(number, f"an id of dictionary {dictionary}", DICTIONARIES[dictionary][1] - 1)
    require_count(cell_pixels, "cell_pixels", 256, 1)
    cells = table.markerSize + 2
    return np.asarray(cv2.aruco.generateImageMarker(table, number, cells * cell_pixels), dtype=np.uint8)


def marker_dictionary(cv2: Any, name: str) -> Any:
    """Return OpenCV's dictionary of a name from `DICTIONARIES`."""
    constant = DICTIONARIES[require_dictionary(name, "dictionary")][0]
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, constant))


def _detector(cv2: Any, dictionary: str) -> Any:
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    parameters.cornerRefinementWinSize = REFINEMENT_WINDOW
    parameters.relativeCornerRefinmentWinSize = WINDOW_IN_CELLS
    parameters.minMarkerPerimeterRate = 0.015
    return cv2.aruco.ArucoDetector(marker_dictionary(cv2, dictionary), parameters)


def grey_image(cv2: Any, image: object) -> UInt8[Array, "H W"]:
    """Return a grey image; raise InvalidInput for anything that is not an image of bytes."""
    if not isinstance(image, np.ndarray) or image.dtype != np.uint8 or image.ndim not in (2, 3):
        raise InvalidInput("image is not an array of uint8 of shape (H, W) or (H, W, 3); read one by cv2")
    if image.ndim == 3 and image.shape[2] != 3:
        raise InvalidInput(f"image has shape {image.shape}, expected (H, W) or (H, W, 3)")
    if not all(MIN_IMAGE_SIDE <= side <= MAX_PIXELS for side in image.shape[:2]):
        raise InvalidInput(
            f"image has {image.shape[1]} x {image.shape[0]} pixels, expected {MIN_IMAGE_SIDE} to "
            f"{MAX_PIXELS} along each side"
        )
    grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY) if image.ndim == 3 else image
    return np.ascontiguousarray(grey)
