"""pilotfish perform: a skill carried out by the robot in physics, in situations that were never shown."""

from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Any

import click

from pilotfish.models import LONGEST_PLAN
from pilotfish.station.answers import (
    Answer,
    answering,
    example,
    finite,
    require_new,
    table,
)
from pilotfish.station.commands_record import task_named
from pilotfish.station.output import a_person_watches, remark
from pilotfish.station.rendering import require_mujoco, require_renderer
from pilotfish.store import open_skill

if TYPE_CHECKING:
    from pilotfish.station.execution import Execution

FILE = click.Path(path_type=Path)
ENDINGS = (".webp", ".gif")


def a_film(_: click.Context, parameter: click.Parameter, path: Path | None) -> Path | None:
    """A path that ends in a kind of film.    Raises: click.BadParameter."""
    if path and path.suffix.lower() not in ENDINGS:
        expected = " or ".join(ENDINGS)
        raise click.BadParameter(f"{path} ends in {path.suffix!r}, expected {expected}", param=parameter)
    return path


@click.command(
    epilog=example("pilotfish perform hooking.skill --task carabiner --situations 2 --film hooking.webp")
)
@click.argument("skill", type=FILE)
@click.option("--task", required=True, help="The task that the skill is for; pilotfish tasks lists them.")
@click.option(
    "--situations",
    type=click.IntRange(1, 10_000),
    default=20,
    show_default=True,
    help="How many unseen situations.",
)
@click.option(
    "--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Seed of the situations."
)
@click.option(
    "--horizon",
    type=click.IntRange(2, LONGEST_PLAN),
    help="How many steps.  [default: as many as the demonstrations had on average]",
)
@click.option(
    "--effort",
    type=click.FloatRange(min=0.0, min_open=True),
    callback=finite,
    default=0.1,
    show_default=True,
    help="The price of acceleration; a higher one gives a softer motion.",
)
@click.option(
    "--slack",
    type=click.FloatRange(min=0.0),
    callback=finite,
    default=1e-5,
    show_default=True,
    help="Added to every variance before it becomes a weight [unit squared].",
)
@click.option("--film", type=FILE, callback=a_film, help="The first situation as a .webp or .gif film.")
@click.option("--dressed", is_flag=True, help="The robot wears the meshes of pilotfish[meshes] in the film.")
@click.option("--force", is_flag=True, help="Replace a film that is there already.")
@answering
def perform(skill: Path, task: str, situations: int, seed: int, film: Path | None, **options: Any) -> Answer:
    """Carry out the skill in the file SKILL in physics, in situations never shown, and tell how it went.

    The skill is adapted to where the objects stand, planned and tracked; springs and dampers at 1 kHz carry
    it out. Exit code 0, however many situations succeed.
    """
    if options["dressed"] and not film:
        raise click.UsageError("--dressed is how the robot looks in a film; name one: --film FILE")
    require_mujoco()
    from pilotfish.station.execution import Pursuit, execute  # needs MuJoCo
    from pilotfish.station.films import Camera, require_pillow, write_film
    from pilotfish.station.meshes import baxter_surfaces
    from pilotfish.station.recorder import UNSEEN, situation

    require_new(film, force=options["force"], inputs=(skill,))
    if film:
        require_pillow()
        require_renderer()
    wanted, learned = task_named(task), open_skill(skill)
    pursuit = Pursuit(options["effort"], options["slack"], options["horizon"])
    surfaces = baxter_surfaces() if options["dressed"] else ()
    done = []
    for n in range(situations):
        camera = Camera(wanted.name) if film and n == 0 else None
        where = situation(wanted, UNSEEN, seed, n)
        made = execute(learned, wanted, where, pursuit=pursuit, watch=camera, surfaces=surfaces)
        if camera and film:
            write_film(camera.frames, film, camera.period, overwrite=options["force"])
            camera.close()
        done.append(made)
        if a_person_watches():
            remark(f"situation {n}: {_outcome(made, wanted.unit)}")
    return _answer(done, wanted.unit, film)


def _outcome(made: "Execution", unit: str) -> str:
    how = "done" if made.verdict.success else f"not done, {made.verdict.why}"
    numbers = (
        f"error {made.verdict.error:.2g} {unit}, at most {made.peaks['tool']:.0f} N, {made.seconds:.1f} s"
    )
    return f"{how}; {numbers}"


def _answer(done: "list[Execution]", unit: str, film: Path | None) -> Answer:
    succeeded = sum(made.verdict.success for made in done)
    rows = [
        ("succeeded", f"{succeeded} of {len(done)}"),
        ("error, median", f"{median(made.verdict.error for made in done):.2g} {unit}"),
        ("error, largest", f"{max(made.verdict.error for made in done):.2g} {unit}"),
        ("largest force, median", f"{median(made.peaks['tool'] for made in done):.1f} N"),
        ("time, median", f"{median(made.seconds for made in done):.1f} s"),
    ]
    failures = [
        f"situation {n}: {made.verdict.why}" for n, made in enumerate(done) if not made.verdict.success
    ]
    facts = {
        "succeeded": succeeded,
        "situations": [_facts(made) for made in done],
        "film": str(film) if film else None,
        "unit": unit,
    }
    return Answer("\n".join([table(("what", ""), rows), *failures]), facts)


def _facts(made: "Execution") -> dict[str, object]:
    verdict = made.verdict
    return {
        "success": verdict.success,
        "error": verdict.error,
        "why": verdict.why,
        "peaks": made.peaks,
        "seconds": made.seconds,
    }
