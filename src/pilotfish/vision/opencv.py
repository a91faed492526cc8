"""OpenCV, the library of the extra `vision`, imported by the function that needs it."""

from importlib import import_module
from typing import Any

from pilotfish.errors import InvalidInput


def require_opencv() -> Any:
    """Return the module cv2.

    Raises:
        InvalidInput: If OpenCV is not installed, or has no detector of markers.
    """
    try:
        cv2 = import_module("cv2")
    except ImportError as error:
        raise InvalidInput("frames from a camera need cv2: pip install '.[vision]' in the clone") from error
    if not hasattr(getattr(cv2, "aruco", None), "ArucoDetector"):
        raise InvalidInput(
            f"OpenCV {cv2.__version__} has no cv2.aruco.ArucoDetector, expected 4.10 or later; "
            "pip install '.[vision]' in the clone"
        )
    return cv2
