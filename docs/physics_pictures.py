"""Draw docs/physics.png: every task performed by a learned skill in a new situation.

    python docs/physics_pictures.py

For each task, four demonstrations are recorded, a skill is learned, and one test situation is filmed.
"""

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

import pilotfish as pf
from pilotfish.rendering import require_renderer

require_renderer()

from pilotfish.environments import TASKS  # noqa: E402 - require_renderer chooses the backend first
from pilotfish.simulation import (  # noqa: E402
    FilmRecorder,
    perform,
    record_demonstrations,
    situation_from_seed,
)

STATES, N_DEMONSTRATIONS, SEED = 7, 4, 1
MOMENTS, WIDTH, HEIGHT, COLOURS = 5, 240, 180, 224


def main() -> None:
    """Draw all tasks, one row each."""
    rows = [film_task(name) for name in sorted(TASKS)]
    sheet = Image.new("RGB", (MOMENTS * WIDTH, len(rows) * HEIGHT))
    for n, images in enumerate(rows):
        for m, image in enumerate(images):
            sheet.paste(image, (m * WIDTH, n * HEIGHT))
    sheet.quantize(COLOURS).save(Path(__file__).with_name("physics.png"), optimize=True)


def film_task(name: str) -> list[Image.Image]:
    """Return images of a performance of the task, each with its time."""
    task, camera = TASKS[name], FilmRecorder()
    demonstrations = [
        pf.add_derivatives(recording.demonstration)
        for recording, _ in record_demonstrations(task, N_DEMONSTRATIONS, SEED)
    ]
    skill = pf.learn(demonstrations, states=STATES, rng=np.random.default_rng(0)).skill
    result = perform(skill, task, situation_from_seed(task, "test", SEED, 0), on_period=camera)
    camera.close()
    print(f"{name}: {'done' if result.outcome.success else result.outcome.reason}")
    chosen = np.linspace(0, len(camera.images) - 1, MOMENTS).round().astype(int)
    return [thumbnail(camera.images[n], f"{name}, {camera.times[n]:.1f} s") for n in chosen]


def thumbnail(image: np.ndarray, text: str) -> Image.Image:
    """Return a small image with a caption."""
    small = Image.fromarray(image).resize((WIDTH, HEIGHT), Image.Resampling.LANCZOS)
    ImageDraw.Draw(small).text((6, HEIGHT - 16), text, fill="black")
    return small


if __name__ == "__main__":
    main()
