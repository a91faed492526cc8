"""The picture of docs/physics.md: every task done by a learned skill, in a situation that was never shown.

    python docs/physics_pictures.py

Four demonstrations of each task are recorded, a skill is learned, one unseen situation filmed: physics.png.
"""

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

import pilotfish as pf
from pilotfish.simulation.rendering import require_renderer

require_renderer()  # before MuJoCo is imported: it chooses what draws here

from pilotfish.environments import TASKS  # noqa: E402 - after the choice
from pilotfish.simulation.execution import execute  # noqa: E402
from pilotfish.simulation.films import FilmRecorder  # noqa: E402
from pilotfish.simulation.recording import TEST_STREAM, record_demonstrations, situation_from_seed  # noqa: E402

STATES, N_DEMONSTRATIONS, SEED = 7, 4, 1
MOMENTS, WIDTH, HEIGHT, COLOURS = 5, 240, 180, 224


def main() -> None:
    rows = [row(name) for name in sorted(TASKS)]
    sheet = Image.new("RGB", (MOMENTS * WIDTH, len(rows) * HEIGHT))
    for n, frames in enumerate(rows):
        for m, frame in enumerate(frames):
            sheet.paste(frame, (m * WIDTH, n * HEIGHT))
    sheet.quantize(COLOURS).save(Path(__file__).with_name("physics.png"), optimize=True)


def row(name: str) -> list[Image.Image]:
    """Moments of the task being done, each with its time."""
    task, camera = TASKS[name], FilmRecorder(name)
    demonstrations = [
        pf.add_derivatives(made.demonstration)
        for made, _ in record_demonstrations(task, N_DEMONSTRATIONS, SEED)
    ]
    skill = pf.learn(demonstrations, states=STATES, rng=np.random.default_rng(0)).skill
    made = execute(skill, task, situation_from_seed(task, TEST_STREAM, SEED, 0), on_period=camera)
    camera.close()
    print(f"{name}: {'done' if made.outcome.success else made.outcome.reason}")
    chosen = np.linspace(0, len(camera.frames) - 1, MOMENTS).round().astype(int)
    return [small(camera.frames[n], f"{name}, {camera.times[n]:.1f} s") for n in chosen]


def small(frame: np.ndarray, text: str) -> Image.Image:
    image = Image.fromarray(frame).resize((WIDTH, HEIGHT), Image.Resampling.LANCZOS)
    ImageDraw.Draw(image).text((6, HEIGHT - 16), text, fill="black")
    return image


if __name__ == "__main__":
    main()
