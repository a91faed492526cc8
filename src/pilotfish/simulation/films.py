"""Films of the physics in files that browsers show, and strips of their moments for reports."""

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pilotfish.environments import EMPTY_OVERLAY, Overlay, SceneRenderer, Workcell, camera_view
from pilotfish.errors import InvalidInput, SkillError
from pilotfish.io import atomic_file
from pilotfish.types import Array, UInt8

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH, HEIGHT = 480, 360
PERIOD = 0.1  # s between frames
FORMATS = {".webp": "WEBP", ".gif": "GIF"}
QUALITY = 70  # of WebP, 0 to 100: ten seconds take about 300 kB
STRIP_FRAME_WIDTH = 2.4  # inches of a moment in a strip
TIME_TOLERANCE = 1e-6  # s: a moment that is a rounding error early is not missed
Frame = UInt8[Array, "H W 3"]


class FilmRecorder:
    """Watches a task at work, a frame each period [s] of its time; marks are drawn into each."""

    def __init__(self, task: str, *, period: float = PERIOD, overlay: Overlay = EMPTY_OVERLAY) -> None:
        self.task, self.period, self.overlay = task, period, overlay
        self.frames: list[Frame] = []
        self.times: list[float] = []
        self._renderer: tuple[Any, SceneRenderer] | None = None

    def __call__(self, cell: Workcell[Any]) -> None:
        """One frame more, once it is time for it."""
        if self.times and cell.time < self.times[0] + len(self.times) * self.period - TIME_TOLERANCE:
            return
        self.frames.append(self._renderer_for(cell).render(cell.data, self.overlay))
        self.times.append(cell.time)

    def close(self) -> None:
        """The graphics' memory is let go; frames stay."""
        if self._renderer:
            self._renderer[1].close()
        self._renderer = None

    def _renderer_for(self, cell: Workcell[Any]) -> SceneRenderer:
        if self._renderer is None or self._renderer[0] is not cell.model:
            self.close()
            view = camera_view(self.task)
            self._renderer = cell.model, SceneRenderer(cell.model, view, width=WIDTH, height=HEIGHT)
        return self._renderer[1]


def require_pillow() -> None:
    """Raises: SkillError, when films cannot be made here. To be asked before the work, not after it."""
    try:
        import PIL.Image  # noqa: F401
    except ImportError as error:
        raise SkillError(f"films need {error.name or error}: pip install 'pilotfish[sim]'") from error


def write_film(
    frames: Sequence[Frame], path: Path, period: float = PERIOD, *, overwrite: bool = True
) -> None:
    """A film of frames that are a period [s] apart, over and over, in a .webp or .gif file, whole or none.

    Raises: InvalidInput, for another ending, no frames, frames of several sizes, or a path not to be written,
    which one that exists is where overwrite is False.
    """
    film = encode_film(frames, path.suffix.lower(), period)
    with atomic_file(path, overwrite=overwrite) as part:
        part.write_bytes(film)


def encode_film(frames: Sequence[Frame], kind: str = ".webp", period: float = PERIOD) -> bytes:
    """What the file of such a film holds.    Raises: InvalidInput."""
    from PIL import Image

    if kind not in FORMATS:
        raise InvalidInput(f"a film's ending is {kind!r}, expected {' or '.join(FORMATS)}")
    _validate_frame_sizes(frames)
    first, *others = map(Image.fromarray, frames)
    options = {"duration": max(round(1000 * period), 1), "loop": 0, "save_all": True, "append_images": others}
    film = BytesIO()
    first.save(film, FORMATS[kind], **options, **({"quality": QUALITY} if kind == ".webp" else {}))
    return film.getvalue()


def film_strip(frames: Sequence[Frame], times: Sequence[float], moments: int = 6) -> "Figure":
    """A picture of so many moments side by side, evenly from first frame to last, each with its time [s].

    Raises: InvalidInput, when there is not a time for each frame.
    """
    from matplotlib.figure import Figure

    _validate_frame_sizes(frames)
    if len(times) != len(frames):
        raise InvalidInput(f"there are {len(times)} times and {len(frames)} frames, expected as many")
    shown = np.unique(np.linspace(0, len(frames) - 1, moments).round().astype(int))
    height, width, _ = frames[0].shape
    figure = Figure(
        figsize=(STRIP_FRAME_WIDTH * len(shown), STRIP_FRAME_WIDTH * height / width + 0.3),
        layout="constrained",
    )
    for axes, n in zip(figure.subplots(1, len(shown), squeeze=False)[0], shown, strict=True):
        axes.imshow(frames[n])
        axes.set_title(f"{times[n]:.1f} s", fontsize=9)
        axes.axis("off")
    return figure


def _validate_frame_sizes(frames: Sequence[Frame]) -> None:
    sizes = sorted({frame.shape for frame in frames})
    if len(sizes) != 1:
        what = f"frames of sizes {sizes}" if sizes else "no frame"
        raise InvalidInput(f"there are {what}, expected one or more of one size")
