"""Films contain their images in order and time, and files are complete or not written."""

import sys
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from drawing import needs_renderer
from PIL import Image
from reference_images import initial_workcell

from pilotfish.environments import TASKS, SceneRenderer
from pilotfish.errors import InvalidInput, SkillError
from pilotfish.simulation.films import FilmRecorder, encode_film, film_strip, require_pillow, write_film

FORMATS = (".webp", ".gif")


def plain(count: int, height: int = 24, width: int = 32) -> list[np.ndarray]:
    """Return uniform grey images of increasing brightness."""
    return [np.full((height, width, 3), round(200 * n / count), np.uint8) for n in range(count)]


def read(film: bytes) -> tuple[list[np.ndarray], list[int], int]:
    """Return images, durations [ms] and the number of loops, 0 for endless."""
    frames, durations = [], []
    with Image.open(BytesIO(film)) as image:
        for n in range(image.n_frames):
            image.seek(n)
            image.load()
            durations.append(image.info["duration"])
            frames.append(np.asarray(image.convert("RGB")))
        return frames, durations, image.info["loop"]


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize(("count", "period"), [(2, 0.1), (7, 0.04)])
def test_encode_film_shows_images_in_order(kind: str, count: int, period: float):
    frames = plain(count)
    decoded, durations, loop = read(encode_film(frames, kind, period))
    assert durations == [1000 * period] * count
    assert loop == 0
    for image, decoded_image in zip(frames, decoded, strict=True):
        assert np.abs(image.astype(int) - decoded_image).max() <= 4  # both kinds lose a little


@pytest.mark.parametrize("kind", FORMATS)
def test_encode_film_single_image_is_picture(kind: str):
    with Image.open(BytesIO(encode_film(plain(1), kind))) as image:
        assert image.size == (32, 24)


@pytest.mark.parametrize("kind", FORMATS)
def test_write_film_equals_encode_film(kind: str, tmp_path: Path):
    write_film(plain(3), tmp_path / f"film{kind.upper()}", 0.05)
    (file,) = tmp_path.iterdir()
    assert file.read_bytes() == encode_film(plain(3), kind, 0.05)


def test_write_film_failure_keeps_old_file(tmp_path: Path):
    old = tmp_path / "film.webp"
    old.write_bytes(b"old")
    for frames in ([], plain(1) + plain(1, height=12)):
        with pytest.raises(InvalidInput, match="one or more of one size"):
            write_film(frames, old)
    with pytest.raises(InvalidInput, match=r"'\.mp4', expected \.webp or \.gif"):
        write_film(plain(2), old.with_suffix(".mp4"))
    assert old.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [old]


def test_require_pillow_missing_is_refused(monkeypatch: pytest.MonkeyPatch):
    for name in ("PIL", "PIL.Image"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(SkillError, match=r"pip install 'pilotfish\[sim\]'"):
        require_pillow()


@pytest.mark.parametrize(
    ("count", "moments", "chosen"), [(11, 6, (0, 2, 4, 6, 8, 10)), (3, 6, (0, 1, 2)), (1, 6, (0,))]
)
def test_film_strip_shows_first_to_last(count: int, moments: int, chosen: tuple[int, ...]):
    frames = plain(count)
    figure = film_strip(frames, [0.5 * n for n in range(count)], moments)
    assert [axes.get_title() for axes in figure.axes] == [f"{0.5 * n:.1f} s" for n in chosen]
    for axes, n in zip(figure.axes, chosen, strict=True):
        np.testing.assert_array_equal(axes.images[0].get_array(), frames[n])


def test_film_strip_missing_times_are_refused():
    with pytest.raises(InvalidInput, match="times has 2 entries, expected 3"):
        film_strip(plain(3), [0.0, 1.0])


@needs_renderer
@pytest.mark.parametrize("interval", [0.02, 0.03])
def test_film_recorder_records_image_per_period(interval: float):
    cell, camera = initial_workcell("valve"), FilmRecorder(period=0.1)
    last = np.zeros(0)
    for _ in range(round(0.45 / interval)):
        cell.step_impedance(cell.target, 0.0, round(interval * 1000))
        before = len(camera.images)
        camera(cell)
        if len(camera.images) > before:
            with SceneRenderer(cell.model, TASKS["valve"].view, width=480, height=360) as renderer:
                last = renderer.render(cell.data)
            np.testing.assert_array_equal(camera.images[-1], last)
    camera.close()
    expected = interval + 0.1 * np.arange(len(camera.times))
    assert len(camera.times) == 5
    assert (np.array(camera.times) - expected >= -1e-6).all()
    assert (np.array(camera.times) - expected < interval).all()


@needs_renderer
def test_film_of_ten_seconds_is_small():
    cell, camera = initial_workcell("valve"), FilmRecorder()
    rng = np.random.default_rng(0)
    for n in range(100):
        if n % 10 == 0:
            cell.arm.q[:] += rng.normal(scale=0.05, size=7)
        cell.step_impedance(cell.target, 0.0, 1)
        camera.times.clear()  # record an image at each call
        camera(cell)
    camera.close()
    assert len(camera.images) == 100
    assert len(encode_film(camera.images)) < 600_000
