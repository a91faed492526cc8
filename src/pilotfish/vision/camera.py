"""Pinhole camera with lens distortion, and its file camera.toml.

A point (X, Y, Z) in camera axes (x right, y down, z ahead) is imaged at

    x = X / Z, y = Y / Z, r2 = x^2 + y^2
    g = (1 + k1 r2 + k2 r2^2 + k3 r2^3) / (1 + k4 r2 + k5 r2^2 + k6 r2^3)
    u = fx (x g + 2 p1 x y + p2 (r2 + 2 x^2)) + cx
    v = fy (y g + p1 (r2 + 2 y^2) + 2 p2 x y) + cy

The centre of the upper left pixel has the coordinates (0, 0), as in OpenCV.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.io import atomic_file, read_file
from pilotfish.types import Array, Float
from pilotfish.validation import (
    finite_array,
    require_count,
    require_number,
    require_table,
    require_type,
    shorten_repr,
)
from pilotfish.vision.strict_tables import MAX_BYTES, parse_toml

CAMERA_FORMAT, CAMERA_VERSION = "pilotfish camera", 1
MAX_PIXELS = 2**15  # along one side of an image
DISTORTION_LENGTHS = (4, 5, 8)  # k1 k2 p1 p2, then k3, then k4 k5 k6
NEEDED_KEYS = ("width", "height", "fx", "fy", "cx", "cy")
OPTIONAL_KEYS = ("distortion",)


@shorten_repr
@dataclass(frozen=True, slots=True)
class Camera:
    """Intrinsic calibration of a camera.

    Attributes:
        width: Width of its images [pixels].
        height: Height of its images [pixels].
        fx: Focal length along the rows [pixels].
        fy: Focal length along the columns [pixels].
        cx: Column of the principal point [pixels].
        cy: Row of the principal point [pixels].
        distortion: k1 k2 p1 p2, and optionally k3, or k3 k4 k5 k6; empty without distortion.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        """Check all values."""
        for name in ("width", "height"):
            require_count(getattr(self, name), name, MAX_PIXELS, 1)
        for name in ("fx", "fy"):
            require_number(getattr(self, name), name, 1.0, 1e6)
        for name in ("cx", "cy"):
            require_number(getattr(self, name), name, -float(MAX_PIXELS), 2.0 * MAX_PIXELS)
        coefficients = finite_array(self.distortion, "distortion", maximum=1e6)
        if coefficients.ndim != 1 or len(coefficients) not in (0, *DISTORTION_LENGTHS):
            raise InvalidInput(
                f"distortion has shape {coefficients.shape}, expected 4, 5 or 8 numbers: k1 k2 p1 p2, "
                "then k3, then k4 k5 k6"
            )
        object.__setattr__(self, "distortion", tuple(coefficients.tolist()))

    @property
    def matrix(self) -> Float[Array, "3 3"]:
        """Intrinsic matrix."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])


def project(camera: Camera, points: Float[Array, "N 3"]) -> Float[Array, "N 2"]:
    """Return the pixels of points in camera axes; NaN for a point that is not ahead of the camera.

    Args:
        camera: Camera.
        points: Points [m].

    Raises:
        InvalidInput: If the points are not a finite array of shape (N, 3).
    """
    require_type(camera, "camera", Camera, "read_camera(path) reads one")
    X = finite_array(points, "points")
    if X.ndim != 2 or X.shape[1] != 3:
        raise InvalidInput(f"points has shape {X.shape}, expected (N, 3)")
    depth = np.where(X[:, 2] > 0.0, X[:, 2], np.nan)
    with np.errstate(over="ignore", invalid="ignore"):
        pixels = _distort(camera, X[:, 0] / depth, X[:, 1] / depth)
    return np.where(np.isfinite(pixels).all(axis=1, keepdims=True), pixels, np.nan)


def _distort(camera: Camera, x: Float[Array, " N"], y: Float[Array, " N"]) -> Float[Array, "N 2"]:
    k = np.zeros(8)
    k[: len(camera.distortion)] = camera.distortion
    k1, k2, p1, p2, k3, k4, k5, k6 = k
    r2 = x * x + y * y
    g = (1 + r2 * (k1 + r2 * (k2 + r2 * k3))) / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
    u = x * g + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    v = y * g + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y
    return np.stack([camera.fx * u + camera.cx, camera.fy * v + camera.cy], axis=1)


def camera_from_table(table: Mapping[str, Any], label: str) -> Camera:
    """Return the camera of the keys width, height, fx, fy, cx, cy and distortion.

    Args:
        table: Table with these keys.
        label: Place in the file; messages begin with it.

    Raises:
        InvalidInput: If a value cannot be used.
    """
    try:
        values = {key: table[key] for key in NEEDED_KEYS}
        return Camera(**values, distortion=tuple(_as_list(table.get("distortion", []))))
    except InvalidInput as error:
        raise InvalidInput(f"{label}: {error}") from error


def _as_list(value: object) -> list[Any]:
    if not isinstance(value, list):
        raise InvalidInput("distortion is not a list, expected 4, 5 or 8 numbers")
    return value


def read_camera(path: Path) -> Camera:
    """Return the camera of a file, as `pilotfish calibrate` writes it.

    Args:
        path: File camera.toml.

    Raises:
        InvalidInput: If it cannot be used; the message names the key and the nearest fix.
    """
    require_type(path, "path", (Path, str), "give the path of camera.toml")
    content = parse_toml(
        read_file(path, "a file of a camera", MAX_BYTES), Path(path).name, CAMERA_FORMAT, CAMERA_VERSION
    )
    notes = ("rms_error", "views")
    return camera_from_table(
        require_table(content, str(path), NEEDED_KEYS, (*OPTIONAL_KEYS, *notes)), str(path)
    )


def write_camera(
    path: Path, camera: Camera, *, rms_error: float, views: int, overwrite: bool = False
) -> None:
    """Write the file of a camera.

    Args:
        path: File to write.
        camera: Camera.
        rms_error: RMS reprojection error of the calibration [pixels].
        views: Number of views of the calibration.
        overwrite: Whether to replace an existing file.

    Raises:
        InvalidInput: If the file cannot be written.
    """
    require_type(camera, "camera", Camera, "calibrate_camera(views, ...) returns one")
    require_number(rms_error, "rms_error", 0.0), require_count(views, "views", 2**31)
    lines = [f'format = "{CAMERA_FORMAT}"', f"version = {CAMERA_VERSION}"]
    lines += [f"{key} = {getattr(camera, key)!r}" for key in ("width", "height")]
    lines += [f"{key} = {float(getattr(camera, key))!r}" for key in ("fx", "fy", "cx", "cy")]
    lines += [f"distortion = {list(camera.distortion)!r}  # k1 k2 p1 p2 k3"]
    lines += [f"rms_error = {float(rms_error)!r}  # pixels", f"views = {views}"]
    with atomic_file(path, overwrite=overwrite) as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")
