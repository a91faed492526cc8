"""Images of markers and boards, made by warping their bitmaps with the homography of a pinhole camera."""

from collections.abc import Sequence

import cv2
import numpy as np

from pilotfish.geometry import Pose, from_rotation_vector, multiply, rotation_matrix
from pilotfish.types import Array, Float, UInt8
from pilotfish.vision import Camera, Marker, marker_bitmap

DICTIONARY = "apriltag_36h11"
CAMERA = Camera(640, 480, 600.0, 610.0, 315.0, 243.0)
UNIT = np.array([1.0, 0.0, 0.0, 0.0])
CELL = 16  # pixels of the bitmap
OVERSAMPLING = 4


def facing_pose(position: Sequence[float], tilt: float, axis: float = 0.0, turn: float = 0.0) -> Pose:
    """Return the pose of a marker that faces the camera, tilted about an axis in the image plane [rad]."""
    tilted = from_rotation_vector(tilt * np.array([np.cos(axis), np.sin(axis), 0.0]))
    turned = from_rotation_vector(np.array([0.0, 0.0, turn]))
    facing = np.array([0.0, 1.0, 0.0, 0.0])
    return Pose(np.array(position, dtype=float), multiply(tilted, multiply(facing, turned)))


def homography(camera: Camera, camera_from_plane: Pose) -> Float[Array, "3 3"]:
    """Return the matrix that maps (x, y, 1) in a plane [m] to pixels."""
    K = np.array([[camera.fx, 0.0, camera.cx], [0.0, camera.fy, camera.cy], [0.0, 0.0, 1.0]])
    R = rotation_matrix(camera_from_plane.quaternion)
    return K @ np.stack([R[:, 0], R[:, 1], camera_from_plane.position], axis=1)


def apply_homography(H: Float[Array, "3 3"], points: Float[Array, "N 2"]) -> Float[Array, "N 2"]:
    mapped = np.concatenate([points, np.ones((len(points), 1))], axis=1) @ H.T
    return mapped[:, :2] / mapped[:, 2:]


def draw_plane(
    image: UInt8[Array, "H W"],
    picture: UInt8[Array, "R C"],
    width: float,
    camera: Camera,
    camera_from_plane: Pose,
) -> UInt8[Array, "H W"]:
    """Return the image with a picture of a width [m] in a plane; its centre is the plane's origin, y up."""
    scale = width / picture.shape[1]  # m per pixel of the picture
    rows, columns = picture.shape
    to_plane = np.array(
        [[scale, 0.0, -scale * (columns - 1) / 2], [0.0, -scale, scale * (rows - 1) / 2], [0.0, 0.0, 1.0]]
    )
    s = OVERSAMPLING
    to_fine = np.array([[s, 0.0, (s - 1) / 2], [0.0, s, (s - 1) / 2], [0.0, 0.0, 1.0]])
    H = to_fine @ homography(camera, camera_from_plane) @ to_plane
    size = (s * camera.width, s * camera.height)
    fine = cv2.resize(image, size, interpolation=cv2.INTER_NEAREST)
    cv2.warpPerspective(picture, H, size, dst=fine, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_TRANSPARENT)
    return np.asarray(cv2.resize(fine, (camera.width, camera.height), interpolation=cv2.INTER_AREA))


def marker_image(
    placed: Sequence[tuple[Marker, Pose]], camera: Camera = CAMERA, grey: int = 128
) -> UInt8[Array, "H W"]:
    """Return an image of markers whose frames have given poses in camera axes."""
    image = np.full((camera.height, camera.width), grey, dtype=np.uint8)
    for marker, camera_from_frame in placed:
        bitmap = marker_bitmap(DICTIONARY, marker.id, CELL)
        picture = np.pad(bitmap, CELL, constant_values=255)
        camera_from_marker = camera_from_frame @ marker.marker_from_frame.inverse()
        width = marker.side * len(picture) / len(bitmap)
        image = draw_plane(image, picture, width, camera, camera_from_marker)
    return image


def marker_pixels(marker: Marker, camera_from_frame: Pose, camera: Camera = CAMERA) -> Float[Array, "4 2"]:
    """Return the true corners of a marker in the image, by its homography."""
    camera_from_marker = camera_from_frame @ marker.marker_from_frame.inverse()
    half = marker.side / 2
    square = np.array([[-half, half], [half, half], [half, -half], [-half, -half]])
    return apply_homography(homography(camera, camera_from_marker), square)
