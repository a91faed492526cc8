"""Markers, the frames that they carry, and their camera: the file markers.toml (docs/camera-frames.md)."""

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, rotation_matrix
from pilotfish.io import read_file
from pilotfish.types import Array, Float
from pilotfish.validation import (
    first_duplicate,
    nearest_name,
    require_count,
    require_name,
    require_number,
    require_printable,
    require_table,
    require_type,
    short_repr,
    shorten_repr,
)
from pilotfish.vision.camera import NEEDED_KEYS, OPTIONAL_KEYS, Camera, camera_from_table, read_camera
from pilotfish.vision.strict_tables import (
    MAX_BYTES,
    parse_pose,
    parse_toml,
    require_list,
)

MARKERS_FORMAT, MARKERS_VERSION = "pilotfish markers", 1
MIN_SIDE, MAX_SIDE = 0.001, 10.0  # m
MAX_MARKERS = 1000
# Dictionaries by name: the constant of OpenCV and the number of markers.
DICTIONARIES: dict[str, tuple[str, int]] = {
    **{
        f"aruco_{n}x{n}_{size}": (f"DICT_{n}X{n}_{size}", size)
        for n in (4, 5, 6, 7)
        for size in (50, 100, 250, 1000)
    },
    "aruco_original": ("DICT_ARUCO_ORIGINAL", 1024),
    "apriltag_16h5": ("DICT_APRILTAG_16h5", 30),
    "apriltag_25h9": ("DICT_APRILTAG_25h9", 35),
    "apriltag_36h10": ("DICT_APRILTAG_36h10", 2320),
    "apriltag_36h11": ("DICT_APRILTAG_36h11", 587),
}
DEFAULT_DICTIONARY = "apriltag_36h11"


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Marker:
    """Square marker; its axes are x right, y up, z out of the paper, with the origin in its centre.

    Attributes:
        id: Number in the dictionary.
        side: Side of its black square [m].
        frame: Name of the frame that it carries.
        marker_from_frame: Pose of the frame in the axes of the marker.
    """

    id: int
    side: float
    frame: str
    marker_from_frame: Pose

    def __post_init__(self) -> None:
        """Check all values."""
        require_count(self.id, "id", 2**16)
        require_number(self.side, "side", MIN_SIDE, MAX_SIDE)
        require_name(self.frame, "frame")
        require_type(self.marker_from_frame, "marker_from_frame", Pose, "geometry.pose(position, quaternion)")

    @property
    def corners(self) -> Float[Array, "4 3"]:
        """Corners in the axes of the marker [m]: upper left, upper right, lower right, lower left."""
        half = self.side / 2
        return np.array([[-half, half, 0.0], [half, half, 0.0], [half, -half, 0.0], [-half, -half, 0.0]])

    @property
    def corners_in_frame(self) -> Float[Array, "4 3"]:
        """The same corners in the axes of the frame [m]."""
        frame_from_marker = self.marker_from_frame.inverse()
        rotation = rotation_matrix(frame_from_marker.quaternion)
        return np.asarray(self.corners @ rotation.T + frame_from_marker.position)


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class MarkerSetup:
    """Markers, camera, and how poses reach the base frame.

    Attributes:
        dictionary: Name of the dictionary of all markers, from `DICTIONARIES`.
        markers: Markers of the frames; several may carry one frame.
        camera: Calibration of the camera.
        base_from_camera: Pose of a fixed camera; None if a reference marker gives it.
        reference: Marker at a fixed place, whose frame is the base; None with a fixed camera.
    """

    dictionary: str
    markers: tuple[Marker, ...]
    camera: Camera
    base_from_camera: Pose | None = None
    reference: Marker | None = None

    def __post_init__(self) -> None:
        """Check that the parts agree."""
        require_dictionary(self.dictionary, "dictionary")
        require_type(self.camera, "camera", Camera, "read_camera(path) reads one")
        require_type(self.markers, "markers", tuple, "give a tuple of Marker")
        for marker in self.markers:
            require_type(marker, "a marker", Marker, "Marker(id, side, frame, pose) creates one")
        if not self.markers:
            raise InvalidInput("markers is empty, expected at least one marker")
        if self.base_from_camera is not None and self.reference is not None:
            raise InvalidInput(
                "both the pose of the camera and a reference marker are given, expected one of them; "
                "remove position and quaternion of the camera, or the reference"
            )
        everyone = [*self.markers, *([self.reference] if self.reference else [])]
        if (duplicate := first_duplicate(marker.id for marker in everyone)) is not None:
            raise InvalidInput(f"id {duplicate} is given to two markers, expected different ids")
        largest = DICTIONARIES[self.dictionary][1] - 1
        for marker in everyone:
            require_count(marker.id, f"an id of dictionary {self.dictionary}", largest)

    @property
    def frames(self) -> tuple[str, ...]:
        """Names of the frames, in the order of their first markers."""
        return tuple(dict.fromkeys(marker.frame for marker in self.markers))


def require_dictionary(value: object, label: str) -> str:
    """Return the name of a dictionary of markers.

    Args:
        value: Name to check.
        label: Name of the value; the message begins with it.

    Raises:
        InvalidInput: If it is unknown.
    """
    name = require_printable(value, label)
    if name not in DICTIONARIES:
        nearest = nearest_name(name, list(DICTIONARIES))
        hint = f"did you mean {nearest!r}?" if nearest else f"known are {', '.join(DICTIONARIES)}"
        raise InvalidInput(f"{label} is {name!r}, expected the name of a dictionary; {hint}")
    return name


def read_markers(path: Path) -> MarkerSetup:
    """Return the content of a file of markers, with its camera, which may be another file.

    Args:
        path: File markers.toml.

    Raises:
        InvalidInput: If a file cannot be used; the message names the place, the value and the nearest fix.
    """
    require_type(path, "path", (Path, str), "give the path of markers.toml")
    path = Path(path)
    data = read_file(path, "a file of markers", MAX_BYTES)
    return parse_markers(data, path.name, path.parent)


def parse_markers(data: bytes, name: str, folder: Path) -> MarkerSetup:
    """Return the markers and the camera that the bytes of a file describe.

    Args:
        data: Content of the file.
        name: Name of the file; messages begin with it.
        folder: Folder to which the name of the file of the camera refers.

    Raises:
        InvalidInput: If it cannot be used; the message names the place, the value and the nearest fix.
    """
    require_type(data, "data", bytes, "read the file in binary mode")
    content = parse_toml(data, require_printable(name, "name"), MARKERS_FORMAT, MARKERS_VERSION)
    table = require_table(content, name, ("camera", "marker"), ("dictionary", "reference"))
    dictionary = require_dictionary(table.get("dictionary", DEFAULT_DICTIONARY), f"{name}: dictionary")
    items = require_list(table["marker"], f"{name}: marker")
    require_count(len(items), f"{name}: the number of markers", MAX_MARKERS)
    markers = tuple(_parse_marker(item, f"{name}: marker {n}") for n, item in enumerate(items))
    camera, base_from_camera = _parse_camera(table["camera"], f"{name}: camera", folder)
    reference = _parse_reference(table["reference"], f"{name}: reference") if "reference" in table else None
    build = partial(MarkerSetup, dictionary, markers, camera, base_from_camera, reference)
    setup: MarkerSetup = _with_label(name, build)
    return setup


def _with_label(label: str, build: Any) -> Any:
    try:
        return build()
    except InvalidInput as error:
        raise InvalidInput(f"{label}: {error}") from error


def _parse_marker(value: object, label: str) -> Marker:
    table = require_table(value, label, ("id", "side", "frame"), ("position", "quaternion"))
    marker_from_frame = parse_pose(table, label)
    build = partial(Marker, table["id"], table["side"], table["frame"], marker_from_frame)
    marker: Marker = _with_label(label, build)
    return marker


def _parse_reference(value: object, label: str) -> Marker:
    """Return the reference marker, whose frame is the base: its pose in the file is base_from_marker."""
    table = require_table(value, label, ("id", "side", "position", "quaternion"))
    marker_from_base = parse_pose(table, label).inverse()
    marker: Marker = _with_label(label, partial(Marker, table["id"], table["side"], "base", marker_from_base))
    return marker


def _parse_camera(value: object, label: str, folder: Path) -> tuple[Camera, Pose | None]:
    """Return the calibration and the pose of the camera, each of which may be missing in the table."""
    by_file = isinstance(value, dict) and "file" in value
    keys = (("file",), ()) if by_file else (NEEDED_KEYS, OPTIONAL_KEYS)
    table = require_table(value, label, keys[0], (*keys[1], "position", "quaternion"))
    given = [key for key in ("position", "quaternion") if key in table]
    if len(given) == 1:
        missing = "quaternion" if given == ["position"] else "position"
        raise InvalidInput(f"{label}: key {missing!r} is missing; the pose of the camera needs both")
    base_from_camera = parse_pose(table, label) if given else None
    if not by_file:
        return camera_from_table(table, label), base_from_camera
    file = table["file"]
    if not isinstance(file, str) or not file:
        raise InvalidInput(f"{label}: file is {short_repr(file)}, expected the name of a file of a camera")
    return read_camera(folder / file), base_from_camera
