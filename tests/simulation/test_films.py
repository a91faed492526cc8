"""Films hold their frames in order and time, in files that are there whole or not at all."""

import sys
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from drawing import needs_renderer
from PIL import Image
from reference_images import initial_workcell

from pilotfish.environments import SceneRenderer, camera_view
from pilotfish.errors import InvalidInput, SkillError
from pilotfish.simulation.films import FilmRecorder, encode_film, film_strip, require_pillow, write_film

FORMATS = (".webp", ".gif")


def plain(count: int, height: int = 24, width: int = 32) -> list[np.ndarray]:
    """Frames of one grey each, brighter from one to the next."""
    return [np.full((height, width, 3), round(200 * n / count), np.uint8) for n in range(count)]


def read(film: bytes) -> tuple[list[np.ndarray], list[int], int]:
    """Frames, how long each is shown [ms], and how often the film is shown, 0 for ever."""
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
def test_a_film_shows_its_frames_one_after_another(kind: str, count: int, period: float):
    """What is read from a film are its frames in order, each shown for a period, over and over."""
    frames = plain(count)
    seen, durations, loop = read(encode_film(frames, kind, period))
    assert durations == [1000 * period] * count
    assert loop == 0
    for one, other in zip(frames, seen, strict=True):
        assert np.abs(one.astype(int) - other).max() <= 4  # both kinds lose a little


@pytest.mark.parametrize("kind", FORMATS)
def test_a_film_of_one_frame_is_a_picture(kind: str):
    """One frame is enough."""
    with Image.open(BytesIO(encode_film(plain(1), kind))) as image:
        assert image.size == (32, 24)


@pytest.mark.parametrize("kind", FORMATS)
def test_what_is_written_is_the_film(kind: str, tmp_path: Path):
    """The file holds the film's bytes, whatever the case of its ending, and nothing is left beside it."""
    write_film(plain(3), tmp_path / f"film{kind.upper()}", 0.05)
    (file,) = tmp_path.iterdir()
    assert file.read_bytes() == encode_film(plain(3), kind, 0.05)


def test_a_film_that_cannot_be_made_leaves_the_old_one(tmp_path: Path):
    """Frames of two sizes, no frame and another ending are refused in words, and the file stays."""
    old = tmp_path / "film.webp"
    old.write_bytes(b"old")
    for frames in ([], plain(1) + plain(1, height=12)):
        with pytest.raises(InvalidInput, match="one or more of one size"):
            write_film(frames, old)
    with pytest.raises(InvalidInput, match=r"'\.mp4', expected \.webp or \.gif"):
        write_film(plain(2), old.with_suffix(".mp4"))
    assert old.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [old]


def test_without_pillow_films_are_refused_before_the_work(monkeypatch: pytest.MonkeyPatch):
    """The refusal names the extra."""
    for name in ("PIL", "PIL.Image"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(SkillError, match=r"pip install 'pilotfish\[sim\]'"):
        require_pillow()


@pytest.mark.parametrize(
    ("count", "moments", "shown"), [(11, 6, (0, 2, 4, 6, 8, 10)), (3, 6, (0, 1, 2)), (1, 6, (0,))]
)
def test_a_strip_shows_moments_from_first_to_last(count: int, moments: int, shown: tuple[int, ...]):
    """Panels hold the frames named and their times, none twice."""
    frames = plain(count)
    figure = film_strip(frames, [0.5 * n for n in range(count)], moments)
    assert [axes.get_title() for axes in figure.axes] == [f"{0.5 * n:.1f} s" for n in shown]
    for axes, n in zip(figure.axes, shown, strict=True):
        np.testing.assert_array_equal(axes.images[0].get_array(), frames[n])


def test_a_strip_needs_a_time_for_each_frame():
    """The refusal tells both numbers."""
    with pytest.raises(InvalidInput, match="2 times and 3 frames"):
        film_strip(plain(3), [0.0, 1.0])


@needs_renderer
@pytest.mark.parametrize("watched", [0.02, 0.03])
def test_a_camera_takes_a_frame_each_period_of_the_physics(watched: float):
    """However often it looks, frames are a period apart, as near as it looked, and show what was there."""
    cell, camera = initial_workcell("valve"), FilmRecorder("valve", period=0.1)
    last = np.zeros(0)
    for _ in range(round(0.45 / watched)):
        cell.step_impedance(cell.target, 0.0, round(watched * 1000))
        before = len(camera.frames)
        camera(cell)
        if len(camera.frames) > before:
            with SceneRenderer(cell.model, camera_view("valve"), width=480, height=360) as renderer:
                last = renderer.render(cell.data)
            np.testing.assert_array_equal(camera.frames[-1], last)
    camera.close()
    expected = watched + 0.1 * np.arange(len(camera.times))
    assert len(camera.times) == 5
    assert (np.array(camera.times) - expected >= -1e-6).all()
    assert (np.array(camera.times) - expected < watched).all()


@needs_renderer
def test_a_film_of_the_physics_is_small():
    """Ten seconds, of an arm that moves, are less than 600 kB."""
    cell, camera = initial_workcell("valve"), FilmRecorder("valve")
    rng = np.random.default_rng(0)
    for n in range(100):
        if n % 10 == 0:
            cell.arm.q[:] += rng.normal(scale=0.05, size=7)
        cell.step_impedance(cell.target, 0.0, 1)
        camera.times.clear()  # each look is a frame
        camera(cell)
    camera.close()
    assert len(camera.frames) == 100
    assert len(encode_film(camera.frames)) < 600_000
