"""Images with times from a video file, a folder of images, or a camera.

The time of image n of a video is n divided by the rate that the file states. A camera's times are those at
which its images arrived, beginning with 0.
"""

import os
import re
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.io import is_folder, path_exists
from pilotfish.types import Array, UInt8
from pilotfish.validation import (
    require_count,
    require_number,
    require_period,
    require_printable,
    require_type,
    shorten_repr,
)
from pilotfish.vision.opencv import require_opencv

IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp")
MAX_IMAGES = 10**6
MAX_DEVICE = 999
MAX_FILE_BYTES = 2**28  # of one image
MAX_PIXELS = 2**28  # of one image
DEVICE = re.compile(r"[0-9]{1,3}")
QUIET = {"OPENCV_FFMPEG_LOGLEVEL": "-8", "OPENCV_LOG_LEVEL": "SILENT"}
TimedImage = tuple[float, UInt8[Array, "H W 3"]]


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class ImageSource:
    """Images of a video, a folder or a camera, which are read while they are iterated over, once.

    Attributes:
        name: What is read, for messages.
        count: Number of images that will be given; None if it is not known before.
        images: Iterator of pairs of a time [s] and an image in the order blue, green, red.
    """

    name: str
    count: int | None
    images: Iterator[TimedImage]


def open_images(
    source: str | Path,
    *,
    every: int = 1,
    period: float | None = None,
    duration: float = 10.0,
    clock: Callable[[], float] = time.monotonic,
) -> ImageSource:
    """Return the images of a video file, a folder, a single image file, or a camera.

    Args:
        source: Path of a file or folder, or the number of a camera such as "0".
        every: Give only every nth image.
        period: Time between two images of the source [s]; None takes that of the video. A folder needs it.
        duration: Time for which a camera is read [s].
        clock: Returns the present time [s], for the images of a camera.

    Raises:
        InvalidInput: If it cannot be read, has no images, or has too many.
    """
    require_type(source, "source", (str, Path), "give the path of a video or folder, or a number of a camera")
    require_count(every, "every", MAX_IMAGES, 1)
    if period is not None:
        period = require_period(period)
    require_number(duration, "duration", 1e-3, 1e6)
    os.environ.update({key: value for key, value in QUIET.items() if key not in os.environ})
    cv2 = require_opencv()
    text = require_printable(str(source), "source", 4096)
    if path_exists(text):
        if is_folder(text):
            return _open_folder(Path(text), every, period)
        if Path(text).suffix.lower() in IMAGE_SUFFIXES:
            return ImageSource(text, 1, iter([(0.0, read_image(Path(text)))]))
        return _open_video(cv2, Path(text), every, period)
    if DEVICE.fullmatch(text):
        return _open_device(cv2, int(text), every, duration, clock)
    raise InvalidInput(
        f"{text} does not exist, expected a video, a folder of images, or the number of a camera"
    )


def image_files(folder: Path) -> list[Path]:
    """Return the image files of a folder, with numbers in their names in order.

    Args:
        folder: Folder.

    Raises:
        InvalidInput: If it cannot be read or holds no image.
    """
    require_type(folder, "folder", (str, Path), "give the path of a folder")
    try:
        files = [file for file in Path(folder).iterdir() if file.suffix.lower() in IMAGE_SUFFIXES]
    except (OSError, ValueError) as error:
        raise InvalidInput(f"{folder} cannot be read: {error}; give a folder of images") from error
    if not files:
        raise InvalidInput(f"{folder} holds no image, expected files such as {', '.join(IMAGE_SUFFIXES[:3])}")
    return sorted(files, key=lambda file: (_numbers_in_order(file.name), file.name))


def _numbers_in_order(name: str) -> list[str | int]:
    parts = re.split(r"([0-9]{1,18})", name)
    return [int(part) if n % 2 else part for n, part in enumerate(parts)]


def read_image(path: Path) -> UInt8[Array, "H W 3"]:
    """Return the image of a file, with the colours blue, green, red.

    Args:
        path: Image file.

    Raises:
        InvalidInput: If it is missing, damaged or too large.
    """
    cv2 = require_opencv()
    require_type(path, "path", (str, Path), "give the path of an image")
    if not path_exists(path) or is_folder(path):
        raise InvalidInput(f"{path} is not a file, expected an image")
    if Path(path).stat().st_size > MAX_FILE_BYTES:
        raise InvalidInput(f"{path} has more than {MAX_FILE_BYTES} bytes, expected a smaller image")
    try:
        image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    except cv2.error as error:  # more pixels than OpenCV's own limit
        raise InvalidInput(f"{path} cannot be read: {error.err}; give a smaller image") from error
    if image is None:
        raise InvalidInput(f"{path} is not an image that OpenCV can read; save it as PNG")
    return np.asarray(image, dtype=np.uint8)


def _open_folder(folder: Path, every: int, period: float | None) -> ImageSource:
    files = image_files(folder)[::every]
    _require_number(len(files), str(folder), every)
    if period is None:
        raise InvalidInput(f"{folder} states no times of its images; give the time between two as the period")
    step = every * period
    return ImageSource(
        str(folder), len(files), ((n * step, read_image(file)) for n, file in enumerate(files))
    )


def _require_number(count: int, name: str, every: int) -> None:
    if count > MAX_IMAGES:
        raise InvalidInput(
            f"{name} has {count} images, expected at most {MAX_IMAGES}; take fewer of them, "
            f"such as every {every * (count // MAX_IMAGES + 1)}th"
        )


def _open_video(cv2: Any, path: Path, every: int, period: float | None) -> ImageSource:
    if not path.is_file():
        raise InvalidInput(f"{path} is not a regular file, expected a video")
    capture = cv2.VideoCapture(str(path))
    if not capture.isOpened():
        raise InvalidInput(
            f"{path} is not a video that OpenCV can read; convert it to MP4 or AVI, or to images"
        )
    stated = int(max(capture.get(cv2.CAP_PROP_FRAME_COUNT), 0.0))
    _require_number(stated // every, str(path), every)
    if period is None:
        rate = float(capture.get(cv2.CAP_PROP_FPS))
        if not 1e-3 <= rate <= 1e5:
            raise InvalidInput(f"{path} states a rate of {rate:g} images per second; give the period")
        period = 1.0 / rate
    step = period
    timed = _read_frames(capture, str(path), every, lambda n: n * step)
    return ImageSource(str(path), -(-stated // every) or None, timed)


def _open_device(
    cv2: Any, number: int, every: int, duration: float, clock: Callable[[], float]
) -> ImageSource:
    capture = cv2.VideoCapture(number)
    if not capture.isOpened():
        raise InvalidInput(
            f"camera {number} cannot be opened; check its number and that no other program uses it"
        )
    start: list[float] = []

    def elapsed(_: int) -> float:
        now = clock()
        if not start:
            start.append(now)
        return now - start[0]

    timed = _read_frames(capture, f"camera {number}", every, elapsed)
    return ImageSource(f"camera {number}", None, _until(timed, duration))


def _until(timed: Iterator[TimedImage], duration: float) -> Iterator[TimedImage]:
    for seconds, image in timed:
        if seconds > duration:
            return
        yield seconds, image


def _read_frames(
    capture: Any, name: str, every: int, time_of: Callable[[int], float]
) -> Iterator[TimedImage]:
    """Yield every nth image; raise InvalidInput if there is none, or too many."""
    n = 0
    try:
        while capture.grab():
            seconds = time_of(n)
            if n % every == 0:
                ok, image = capture.retrieve()
                if not ok:
                    break
                yield seconds, _require_image(image, name)
            n += 1
            if n > MAX_IMAGES * every:
                raise InvalidInput(f"{name} has more than {MAX_IMAGES} images; take fewer of them")
    finally:
        capture.release()
    if n == 0:
        raise InvalidInput(f"{name} has no image that can be read, expected at least one")


def _require_image(image: Any, name: str) -> UInt8[Array, "H W 3"]:
    if image.size > 3 * MAX_PIXELS:
        raise InvalidInput(f"{name} has images of {image.shape[1]} x {image.shape[0]} pixels, too many")
    if image.ndim == 2:
        image = np.repeat(image[:, :, None], 3, axis=2)
    return np.ascontiguousarray(image[:, :, :3], dtype=np.uint8)
