"""Pictures that the physics is held against: each task at the beginning of the situation of seed 0.

Made anew, when looks or situations are meant to change, by

    MUJOCO_GL=osmesa .venv/bin/python tests/shared/reference_frames.py

which writes one picture a task to tests/environments/reference_frames, and removes those of tasks that
are no more.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from pilotfish.environments import TASKS, Workcell
from pilotfish.environments.cameras import SceneRenderer, camera_view

FOLDER = Path(__file__).parents[1] / "environments" / "reference_frames"
WIDTH, HEIGHT = 240, 180
OUTLIER_THRESHOLD = 40.0  # of 255: a difference that everybody sees


@dataclass(frozen=True, slots=True)
class ImageDifference:
    """How far two pictures are apart once each is blurred over 3 x 3 pixels.

    mean is the mean absolute difference of 255; strong is the share of pixels where some colour is far off.
    """

    mean: float
    outlier_share: float

    def __le__(self, other: "Difference") -> bool:
        return self.mean <= other.mean and self.outlier_share <= other.outlier_share


# Another Mesa rounds otherwise and draws edges a pixel aside; a thing that is missing is more than this.
TOLERANCE = ImageDifference(3.0, 0.002)


def initial_workcell(task: str) -> Workcell:
    """The workcell of the task in the situation of seed 0, when nothing has moved yet."""
    return Workcell(TASKS[task], TASKS[task].sample_situation(np.random.default_rng(0)))


def render_workcell(cell: Workcell) -> np.ndarray:
    """What it looks like from where its task is seen well."""
    with SceneRenderer(cell.model, camera_view(cell.task.name), width=WIDTH, height=HEIGHT) as renderer:
        return renderer.render(cell.data)


def load_reference(task: str) -> np.ndarray:
    """The picture that was kept of the task."""
    with Image.open(FOLDER / f"{task}.png") as image:
        return np.asarray(image.convert("RGB"))


def compare_images(one: np.ndarray, other: np.ndarray) -> ImageDifference:
    """How far two pictures of one size are apart."""
    apart = np.abs(_blur(one) - _blur(other))
    return ImageDifference(float(apart.mean()), float((apart.max(axis=2) > OUTLIER_THRESHOLD).mean()))


def _blur(render_workcell: np.ndarray) -> np.ndarray:
    windows = np.lib.stride_tricks.sliding_window_view(render_workcell.astype(float), (3, 3), axis=(0, 1))
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
