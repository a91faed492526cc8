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
from pilotfish.simulation.captions import BAND, GREEN, RED, caption_images
from pilotfish.simulation.films import (
    FOLLOWING,
    TO_TOOL,
    FilmRecorder,
    encode_film,
    film_strip,
    require_pillow,
    view_at,
    write_film,
)

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
    with pytest.raises(SkillError, match=r"pip install '.\[sim\]' in the clone"):
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
    last, look_at = np.zeros(0), np.zeros(3)
    for _ in range(round(0.45 / interval)):
        cell.step_impedance(cell.target, 0.0, round(interval * 1000))
        before = len(camera.images)
        camera(cell)
        if len(camera.images) > before:
            middle = np.array(TASKS["valve"].view.look_at)
            goal = middle + TO_TOOL * (cell.arm.tool.position - middle)
            look_at = look_at + FOLLOWING * (goal - look_at) if before else goal
            view = view_at(TASKS["valve"].view, look_at)
            with SceneRenderer(cell.model, view, width=720, height=540) as renderer:
                last = renderer.render(cell.data)
            np.testing.assert_array_equal(camera.images[-1], last)
    camera.close()
    expected = interval + 0.1 * np.arange(len(camera.times))
    assert len(camera.times) == 5
    assert camera.phases == ["moving"] * 5
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
    assert len(encode_film(camera.images)) < 1_350_000  # 2.25 times the pixels of 480 x 360


def colours(image: np.ndarray) -> set[tuple[int, ...]]:
    return set(map(tuple, image.reshape(-1, 3).tolist()))


@pytest.mark.parametrize(("success", "colour", "other"), [(True, GREEN, RED), (False, RED, GREEN)])
def test_caption_images_draw_bands_and_keep_the_rest(
    success: bool, colour: tuple[int, ...], other: tuple[int, ...]
):
    images = [np.full((540, 720, 3), 128, np.uint8)] * 2
    captioned = caption_images(
        images, [0.0, 1.5], ["moving", "picked up"], title="plate", outcome="outcome", success=success
    )
    assert [image.shape for image in captioned] == [(540, 720, 3)] * 2
    assert np.array_equal(images[0], np.full((540, 720, 3), 128))  # unchanged
    for image in captioned:
        assert BAND in colours(image[:30])
        assert BAND in colours(image[-30:])
        assert colours(image[60:-60]) == {(128, 128, 128)}
        assert colour in colours(image[:40, 360:])
        assert other not in colours(image)
    assert np.array_equal(captioned[0][:60], captioned[1][:60])  # title and outcome
    assert not np.array_equal(captioned[0][-60:, :360], captioned[1][-60:, :360])  # time
    assert not np.array_equal(captioned[0][-60:, 360:], captioned[1][-60:, 360:])  # phase


def test_caption_images_missing_phase_is_refused():
    with pytest.raises(InvalidInput, match="2 times and 1 phases, expected 2 of each"):
        caption_images(plain(2), [0.0, 0.1], ["moving"], title="", outcome="", success=True)


@needs_renderer
def test_film_camera_is_closer_and_keeps_tool_in_image():
    """The tool is nearer than in the task's view, and stays within half of the image's height."""
    cell, camera = initial_workcell("valve"), FilmRecorder()
    view = TASKS["valve"].view
    camera(cell)
    camera.close()
    film_view = view_at(view, cell.arm.tool.position)
    assert film_view.distance < 0.7 * view.distance
    assert film_view.azimuth == view.azimuth
    offset = (1.0 - TO_TOOL) * np.linalg.norm(np.array(view.look_at) - cell.arm.tool.position)
    assert offset / film_view.distance < np.tan(np.radians(22.5))  # MuJoCo's field of view is 45 degrees
