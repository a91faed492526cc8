"""Calibrate a camera from views of a chessboard or of a ChArUco board.

Views in which the board is always parallel to itself determine neither the focal length nor the principal
point, however many they are (Zhang 2000, section 3.3). They are refused: by the largest angle between the
boards, and by the standard deviation of the focal length.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import degrees
from typing import Any

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Float, UInt8
from pilotfish.validation import finite_array, require_count, require_number, require_type, shorten_repr
from pilotfish.vision.camera import MAX_PIXELS, Camera
from pilotfish.vision.detection import grey_image, marker_dictionary
from pilotfish.vision.opencv import require_opencv

MIN_VIEWS, MAX_VIEWS = 4, 200
MIN_CORNERS = 6  # of one view
MIN_TILT = 10.0  # degrees, largest angle between the normals of two views
MAX_FOCAL_DEVIATION = 0.03  # standard deviation of the focal length as a share of it
MIN_BOARD, MAX_BOARD = 3, 50  # corners along one side


@dataclass(frozen=True, slots=True)
class CalibrationBoard:
    """Chessboard, or ChArUco board with markers in its white squares.

    Attributes:
        columns: Inner corners along a row of a chessboard; squares along a row of a ChArUco board.
        rows: Inner corners, or squares, along a column.
        square: Side of a square [m].
        marker: Side of a marker [m]; 0 for a chessboard.
        dictionary: Dictionary of the markers of a ChArUco board.
    """

    columns: int
    rows: int
    square: float
    marker: float = 0.0
    dictionary: str = "aruco_4x4_50"

    def __post_init__(self) -> None:
        """Check all values."""
        require_count(self.columns, "columns", MAX_BOARD, MIN_BOARD)
        require_count(self.rows, "rows", MAX_BOARD, MIN_BOARD)
        require_number(self.square, "square", 1e-4, 10.0)
        require_number(self.marker, "marker", 0.0, 10.0)
        if self.marker >= self.square:
            raise InvalidInput(
                f"marker is {self.marker:g} m, expected less than the side of a square, {self.square:g} m"
            )


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class BoardView:
    """Corners of a board in one image.

    Attributes:
        points: Corners in the axes of the board [m]; z is 0.
        pixels: The same corners in the image.
    """

    points: Float[Array, "N 3"]
    pixels: Float[Array, "N 2"]


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """Calibrated camera, and how well its model explains the views.

    Attributes:
        camera: Calibration of the camera.
        rms_error: RMS distance between corners and their projections [pixels].
        focal_deviation: Standard deviations of fx and fy [pixels].
        largest_tilt: Largest angle between the boards of two views [degrees].
        views: Number of views.
    """

    camera: Camera
    rms_error: float
    focal_deviation: tuple[float, float]
    largest_tilt: float
    views: int


def find_board(image: UInt8[Array, "H W *C"], board: CalibrationBoard) -> BoardView | None:
    """Return the corners of a board in an image; None if it is not found.

    Args:
        image: Grey image, or colour image in the order blue, green, red.
        board: Board to look for.

    Raises:
        InvalidInput: If an argument cannot be used.
    """
    cv2 = require_opencv()
    require_type(board, "board", CalibrationBoard, "CalibrationBoard(9, 6, 0.025) creates one")
    grey = grey_image(cv2, image)
    if board.marker:
        return _find_charuco(cv2, grey, board)
    found, corners = cv2.findChessboardCornersSB(grey, (board.columns, board.rows))
    if not found:
        return None
    column, row = np.meshgrid(np.arange(board.columns), np.arange(board.rows))
    points = board.square * np.stack([column.ravel(), row.ravel(), np.zeros(row.size)], axis=1)
    return BoardView(points, np.asarray(corners, dtype=np.float64).reshape(-1, 2))


def _find_charuco(cv2: Any, grey: UInt8[Array, "H W"], board: CalibrationBoard) -> BoardView | None:
    table = marker_dictionary(cv2, board.dictionary)
    model = cv2.aruco.CharucoBoard((board.columns, board.rows), board.square, board.marker, table)
    corners, ids, _, _ = cv2.aruco.CharucoDetector(model).detectBoard(grey)
    if ids is None or len(ids) < MIN_CORNERS:
        return None
    points, pixels = model.matchImagePoints(corners, ids)
    return BoardView(
        np.asarray(points, dtype=np.float64).reshape(-1, 3),
        np.asarray(pixels, dtype=np.float64).reshape(-1, 2),
    )


def calibrate_camera(views: Sequence[BoardView], width: int, height: int) -> Calibration:
    """Return the calibration that explains views of a board best, with distortion k1 k2 p1 p2 k3.

    Args:
        views: Four or more views, in which the board is tilted in different directions.
        width: Width of the images [pixels].
        height: Height of the images [pixels].

    Raises:
        InvalidInput: If there are too few views, or they do not determine the camera.
    """
    cv2 = require_opencv()
    points, pixels = _validate_views(views)
    size = (require_count(width, "width", MAX_PIXELS, 1), require_count(height, "height", MAX_PIXELS, 1))
    try:
        rms, matrix, distortion, turns, _, deviations, _, _ = cv2.calibrateCameraExtended(
            points, pixels, size, None, None
        )
    except cv2.error as error:
        raise _degenerate(f"OpenCV finds no camera: {error.err}") from error
    numbers = np.concatenate([[rms], matrix.ravel(), distortion.ravel(), deviations.ravel()[:2]])
    if not np.isfinite(numbers).all():
        raise _degenerate("no finite calibration explains them")
    tilt = _largest_tilt(cv2, turns)
    focal = np.array([matrix[0, 0], matrix[1, 1]])
    deviation = np.ravel(deviations)[:2]
    if tilt < MIN_TILT:
        raise _degenerate(
            f"the board has nearly the same orientation in all of them, at most {tilt:.1f} degrees apart"
        )
    if (share := float((deviation / np.abs(focal)).max())) > MAX_FOCAL_DEVIATION:
        raise _degenerate(f"the focal length is uncertain by {100 * share:.0f} %")
    fx, fy, cx, cy = (float(matrix[n]) for n in ((0, 0), (1, 1), (0, 2), (1, 2)))
    camera = Camera(*size, fx, fy, cx, cy, tuple(np.ravel(distortion)[:5].tolist()))
    return Calibration(camera, float(rms), (float(deviation[0]), float(deviation[1])), tilt, len(views))


def _validate_views(views: Sequence[BoardView]) -> tuple[list[Array], list[Array]]:
    require_type(views, "views", Sequence, "give a list of results of find_board")
    if not MIN_VIEWS <= len(views) <= MAX_VIEWS:
        raise InvalidInput(
            f"{len(views)} views show the board, expected {MIN_VIEWS} to {MAX_VIEWS}; move and tilt the "
            "board between images"
        )
    points, pixels = [], []
    for n, view in enumerate(views):
        require_type(view, "a view", BoardView, "find_board(image, board) returns one")
        X, u = (
            finite_array(each, f"view {n}: {name}")
            for each, name in ((view.points, "points"), (view.pixels, "pixels"))
        )
        if X.ndim != 2 or X.shape[1:] != (3,) or u.shape != (len(X), 2) or len(X) < MIN_CORNERS:
            raise InvalidInput(
                f"view {n} has points of shape {X.shape} and pixels of shape {u.shape}, expected (N, 3) and "
                f"(N, 2) with N >= {MIN_CORNERS}"
            )
        points.append(X.astype(np.float32))
        pixels.append(u.astype(np.float32))
    return points, pixels


def _degenerate(reason: str) -> InvalidInput:
    return InvalidInput(
        f"the views do not determine the camera: {reason}; tilt the board by 20 to 45 degrees in different "
        "directions, and fill different parts of the image"
    )


def _largest_tilt(cv2: Any, turns: Sequence[Array]) -> float:
    """Return the largest angle between the normals of two boards [degrees]."""
    normals = np.array([cv2.Rodrigues(turn)[0][:, 2] for turn in turns])
    return degrees(float(np.arccos(np.clip(normals @ normals.T, -1.0, 1.0).min())))
