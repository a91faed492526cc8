"""Videos, folders and cameras: times, order, and what cannot be read."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from pilotfish.errors import SkillError
from pilotfish.vision import image_files, open_images, read_image


def write_video(path: Path, count: int, rate: float = 20.0) -> None:
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), rate, (64, 48))
    assert writer.isOpened()
    for n in range(count):
        writer.write(np.full((48, 64, 3), 20 * n, dtype=np.uint8))
    writer.release()


def test_video_gives_times_of_its_rate(tmp_path):
    write_video(tmp_path / "a.avi", 8)
    source = open_images(tmp_path / "a.avi", every=3)
    times, images = zip(*source.images, strict=True)
    assert source.count == 3
    np.testing.assert_allclose(times, [0.0, 0.15, 0.3])
    np.testing.assert_allclose([image.mean() for image in images], [0, 60, 120], atol=3)
    assert images[0].shape == (48, 64, 3)
    times, _ = zip(*open_images(tmp_path / "a.avi", period=0.5).images, strict=True)
    np.testing.assert_allclose(times, 0.5 * np.arange(8))


def test_folder_is_read_in_the_order_of_numbers(tmp_path):
    for n in (10, 2, 1):
        cv2.imwrite(str(tmp_path / f"image_{n}.png"), np.full((48, 64, 3), n, dtype=np.uint8))
    (tmp_path / "notes.txt").write_text("no image")
    assert [file.name for file in image_files(tmp_path)] == ["image_1.png", "image_2.png", "image_10.png"]
    pairs = list(open_images(tmp_path, period=0.1).images)
    assert [int(image[0, 0, 0]) for _, image in pairs] == [1, 2, 10]
    np.testing.assert_allclose([time for time, _ in pairs], [0.0, 0.1, 0.2])
    with pytest.raises(SkillError, match="period"):
        open_images(tmp_path)


def test_unreadable_sources_are_explained(tmp_path):
    write_video(tmp_path / "cut.avi", 8)
    (tmp_path / "cut.avi").write_bytes((tmp_path / "cut.avi").read_bytes()[:60])
    (tmp_path / "text.mp4").write_text("no video")
    (tmp_path / "empty.mp4").write_bytes(b"")
    (tmp_path / "bad.png").write_bytes(b"\x89PNG\r\n\x1a\n garbage")
    (tmp_path / "folder").mkdir()
    for name in ("cut.avi", "text.mp4", "empty.mp4", "bad.png", "folder", "missing.mp4", "987"):
        path = name if name == "987" else tmp_path / name
        with pytest.raises(SkillError):
            list(open_images(path, period=0.1).images)
    for image in (tmp_path / "missing.png", tmp_path / "folder"):
        with pytest.raises(SkillError):
            read_image(image)


def test_video_without_images_is_explained(tmp_path):
    write_video(tmp_path / "none.avi", 0)
    with pytest.raises(SkillError):
        list(open_images(tmp_path / "none.avi", period=0.1).images)
