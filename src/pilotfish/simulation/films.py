"""Films of a simulation as animated images for browsers, and strips of their frames for reports."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pilotfish.environments import CameraView, Ellipsoid, SceneRenderer, ToolCopy, Workcell
from pilotfish.errors import InvalidInput, SkillError
from pilotfish.geometry import Pose
from pilotfish.io import atomic_file
from pilotfish.types import Array, Float, UInt8

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH, HEIGHT = 720, 540
CLOSER, STEEPER = 0.66, 12.0  # distance relative to the task's view; degrees: hand and object fill the image
TO_TOOL = 0.6  # part of the way from the middle of the task's view to the tool at which the camera looks
FOLLOWING = 0.15  # part of the remaining way by which the camera moves with each image
PERIOD = 0.1  # s between frames
FORMATS = {".webp": "WEBP", ".gif": "GIF"}
QUALITY = 70  # of WebP, 0 to 100; ten seconds take about 300 kB
STRIP_FRAME_WIDTH = 2.4  # inches
TIME_TOLERANCE = 1e-6  # s, for rounding of times
Image = UInt8[Array, "H W 3"]


class FilmRecorder:
    """Recorder of images of a workcell; call it after each period.

    The camera is closer than the task's view, on the same side, and slowly follows the tool, so that hand and
    object stay in the image.

    Attributes:
        period: Simulated time between images [s].
        images: Recorded images.
        times: Simulated time of each image [s].
        phases: What happens in each image, in the words of the task; empty for a task without progress.
    """

    def __init__(
        self,
        *,
        period: float = PERIOD,
        frames: Mapping[str, Pose] | None = None,
        path: Float[Array, "T 3"] | None = None,
        distance: float = CLOSER,
    ) -> None:
        """Create a recorder without images.

        Args:
            period: Simulated time between images [s].
            frames: Poses that are drawn into each image as coordinate axes.
            path: Points of a path that is drawn into each image [m].
            distance: Distance of the camera, relative to the task's view.
        """
        self.period = period
        self.images: list[Image] = []
        self.times: list[float] = []
        self.phases: list[str] = []
        self._frames = {} if frames is None else frames
        self._path = np.zeros((0, 3)) if path is None else path
        self._distance = distance
        self._renderer: tuple[Any, SceneRenderer] | None = None
        self._look_at: Float[Array, " 3"] | None = None

    def __call__(
        self,
        cell: Workcell[Any],
        *,
        ellipsoids: Sequence[Ellipsoid] = (),
        tool_copies: Sequence[ToolCopy] = (),
    ) -> None:
        """Record an image if a period has passed since the last one.

        Args:
            cell: Workcell to record.
            ellipsoids: Translucent ellipsoids in this image.
            tool_copies: Translucent copies of a tool in this image.
        """
        if self.times and cell.time < self.times[0] + len(self.times) * self.period - TIME_TOLERANCE:
            return
        renderer, progress = self._renderer_for(cell), cell.task.progress
        self._look_at = self._follow_tool(cell)
        view = view_at(cell.task.view, self._look_at, self._distance)
        self.images.append(
            renderer.render(
                cell.data,
                frames=self._frames,
                path=self._path,
                ellipsoids=ellipsoids,
                tool_copies=tool_copies,
                view=view,
            )
        )
        self.times.append(cell.time)
        self.phases.append(progress.describe(cell.measure_progress()) if progress else "")

    def close(self) -> None:
        """Release the graphics memory; the images stay."""
        if self._renderer:
            self._renderer[1].close()
        self._renderer = None

    def _follow_tool(self, cell: Workcell[Any]) -> Float[Array, " 3"]:
        """Return the point in the middle of the next image."""
        middle = np.array(cell.task.view.look_at)
        goal = middle + TO_TOOL * (cell.arm.tool.position - middle)
        before = goal if self._look_at is None else self._look_at
        return np.asarray(before + FOLLOWING * (goal - before))

    def _renderer_for(self, cell: Workcell[Any]) -> SceneRenderer:
        if self._renderer is None or self._renderer[0] is not cell.model:
            self.close()
            renderer = SceneRenderer(cell.model, cell.task.view, width=WIDTH, height=HEIGHT)
            self._renderer = cell.model, renderer
        return self._renderer[1]


def view_at(view: CameraView, look_at: Float[Array, " 3"], distance: float = CLOSER) -> CameraView:
    """Return a steeper view of a point from another distance, from the side of a view.

    Args:
        view: View of the whole task.
        look_at: Point in the middle of the image, in torso axes [m].
        distance: Distance relative to that of the view.
    """
    x, y, z = look_at.tolist()
    return replace(
        view, look_at=(x, y, z), distance=distance * view.distance, elevation=view.elevation - STEEPER
    )


def require_pillow() -> None:
    """Check that films can be encoded here, before a long computation.

    Raises:
        SkillError: If Pillow is not installed.
    """
    try:
        import PIL.Image  # noqa: F401
    except ImportError as error:
        raise SkillError(f"films need {error.name or error}: pip install '.[sim]' in the clone") from error


def write_film(
    images: Sequence[Image], path: Path, period: float = PERIOD, *, overwrite: bool = True
) -> None:
    """Write images as an endless film; the file is complete or not written.

    Args:
        images: Images of one size.
        path: File with the suffix .webp or .gif.
        period: Time between images [s].
        overwrite: Replace an existing file.

    Raises:
        InvalidInput: If the suffix is another, images is empty, the sizes differ, or the file cannot be
            written.
    """
    film = encode_film(images, path.suffix.lower(), period)
    with atomic_file(path, overwrite=overwrite) as part:
        part.write_bytes(film)


def encode_film(images: Sequence[Image], suffix: str = ".webp", period: float = PERIOD) -> bytes:
    """Return the content of a film file.

    Args:
        images: Images of one size.
        suffix: ".webp" or ".gif".
        period: Time between images [s].

    Raises:
        InvalidInput: If the suffix is another, images is empty, or the sizes differ.
    """
    from PIL.Image import fromarray

    if suffix not in FORMATS:
        raise InvalidInput(f"the suffix of the film is {suffix!r}, expected {' or '.join(FORMATS)}")
    _validate_sizes(images)
    first, *others = map(fromarray, images)
    options = {"duration": max(round(1000 * period), 1), "loop": 0, "save_all": True, "append_images": others}
    film = BytesIO()
    first.save(film, FORMATS[suffix], **options, **({"quality": QUALITY} if suffix == ".webp" else {}))
    return film.getvalue()


def film_strip(images: Sequence[Image], times: Sequence[float], n_images: int = 6) -> "Figure":
    """Return a figure of images side by side, evenly chosen from first to last.

    Args:
        images: Images of one size.
        times: Time of each image [s], for the titles.
        n_images: Number of images in the figure.

    Raises:
        InvalidInput: If there is not a time for each image.
    """
    from matplotlib.figure import Figure

    _validate_sizes(images)
    if len(times) != len(images):
        raise InvalidInput(f"times has {len(times)} entries, expected {len(images)}, one for each image")
    chosen = np.unique(np.linspace(0, len(images) - 1, n_images).round().astype(int))
    height, width, _ = images[0].shape
    figure = Figure(
        figsize=(STRIP_FRAME_WIDTH * len(chosen), STRIP_FRAME_WIDTH * height / width + 0.3),
        layout="constrained",
    )
    for axes, n in zip(figure.subplots(1, len(chosen), squeeze=False)[0], chosen, strict=True):
        axes.imshow(images[n])
        axes.set_title(f"{times[n]:.1f} s", fontsize=9)
        axes.axis("off")
    return figure


def _validate_sizes(images: Sequence[Image]) -> None:
    sizes = sorted({image.shape for image in images})
    if len(sizes) != 1:
        problem = f"have the sizes {sizes}" if sizes else "is empty"
        raise InvalidInput(f"images {problem}, expected one or more of one size")
