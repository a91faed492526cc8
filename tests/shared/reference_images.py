"""Reference images: each task at the start of the situation of seed 0.

After an intended change of the images, write them again by

    MUJOCO_GL=osmesa .venv/bin/python tests/shared/reference_images.py

which writes one image per task to tests/environments/reference_frames and removes others.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from pilotfish.environments import TASKS, SceneRenderer, Workcell

FOLDER = Path(__file__).parents[1] / "environments" / "reference_frames"
WIDTH, HEIGHT = 240, 180
OUTLIER_THRESHOLD = 40.0  # of 255: a clearly visible difference


@dataclass(frozen=True, slots=True)
class ImageDifference:
    """Difference of two images after a blur over 3 x 3 pixels.

    Attributes:
        mean: Mean absolute difference, of 255.
        outlier_share: Share of pixels with a clearly visible difference.
    """

    mean: float
    outlier_share: float

    def __le__(self, other: "ImageDifference") -> bool:
        return self.mean <= other.mean and self.outlier_share <= other.outlier_share


# Other Mesa versions round differently and shift edges by a pixel; a missing object exceeds this.
TOLERANCE = ImageDifference(3.0, 0.002)


def initial_workcell(task: str) -> Workcell:
    """Return the workcell of the task in the situation of seed 0."""
    return Workcell(TASKS[task], TASKS[task].sample_situation(np.random.default_rng(0)))


def render_workcell(cell: Workcell) -> np.ndarray:
    """Return an image of the workcell from the view of its task."""
    with SceneRenderer(cell.model, cell.task.view, width=WIDTH, height=HEIGHT) as renderer:
        return renderer.render(cell.data)


def load_reference(task: str) -> np.ndarray:
    """Return the reference image of the task."""
    with Image.open(FOLDER / f"{task}.png") as image:
        return np.asarray(image.convert("RGB"))


def compare_images(a: np.ndarray, b: np.ndarray) -> ImageDifference:
    """Return the difference of two images of one size."""
    difference = np.abs(_blur(a) - _blur(b))
    return ImageDifference(
        float(difference.mean()), float((difference.max(axis=2) > OUTLIER_THRESHOLD).mean())
    )


def _blur(image: np.ndarray) -> np.ndarray:
    windows = np.lib.stride_tricks.sliding_window_view(image.astype(float), (3, 3), axis=(0, 1))
    return windows.mean(axis=(3, 4))


def main() -> None:
    FOLDER.mkdir(exist_ok=True)
    for task in TASKS:
        Image.fromarray(render_workcell(initial_workcell(task))).save(FOLDER / f"{task}.png", optimize=True)
    for file in FOLDER.glob("*.png"):
        if file.stem not in TASKS:
            file.unlink()


if __name__ == "__main__":
    main()
