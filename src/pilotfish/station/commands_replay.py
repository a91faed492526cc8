"""pilotfish replay: a skill in a situation that may never have been shown."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from pilotfish.control import Feedback, Motion, Reference
from pilotfish.demonstrations import Frame, Layout, Part, Quantity, world_frame
from pilotfish.errors import InvalidInput
from pilotfish.files import whole_file
from pilotfish.models import LONGEST_PLAN, AdaptedSkill, Skill, adapt
from pilotfish.planning import ViaPoint, plan, planned_states, through
from pilotfish.station.answers import Answer, answering, example, finite, plain_table, require_new, write_each
from pilotfish.station.following import Setting, followed, gaps, setting, steps_shown, unit_of_gaps
from pilotfish.station.motions import (
    final_state_reached,
    notes_on_the_end,
    notes_on_the_start,
    on_the_sphere,
    places,
    rounded,
    write_motion,
)
from pilotfish.station.pictures import a_picture, require_matplotlib, save_picture
from pilotfish.station.situations import first_mean, frames_in, start_in
from pilotfish.station.wishes import Miss, Wish, WishType, misses, notes_on_misses, points_of
from pilotfish.store import open_skill
from pilotfish.types import Array, Int

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True)
class Choices:
    """What the options say."""

    skill: Path
    frames: Path | None
    start: Path | None
    horizon: int | None
    effort: float
    slack: float
    out: Path | None
    gains: Path | None
    via: tuple[Wish, ...]
    picture: Path | None
    via_picture: Path | None
    force: bool


@dataclass(frozen=True, slots=True, eq=False)
class Replay:
    """The skill where things stand, the states it goes through, what it was asked to follow, what came of it.

    direct is the motion as it would have been without via-points. Reference and feedback have the columns
    of here.flat, motions those of the skill.
    """

    here: Setting
    frames: tuple[Frame, ...]
    states: Int[Array, " T"]
    reference: Reference
    feedback: Feedback
    motion: Motion
    points: tuple[ViaPoint, ...]
    direct: Motion

    @property
    def last(self) -> int:
        return int(self.states[-1])

    @property
    def adapted(self) -> AdaptedSkill:
        return self.here.adapted


FILE = click.Path(path_type=Path)
PART_FACTS = ("final", "largest_acceleration", "start_to_first_target", "distance_to_reference")


@click.command(epilog=example("pilotfish replay valve.skill --frames now.json --out motion.csv"))
@click.argument("skill", type=FILE)
@click.option(
    "--frames",
    type=FILE,
    help="JSON or TOML: where the objects stand. Not needed by a skill in the world's frame alone.",
)
@click.option(
    "--start",
    type=FILE,
    help="JSON or TOML: where the robot starts.  [default: where the skill begins]",
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
    default=9.0,
    show_default=True,
    help="The price of acceleration; a higher one gives a softer motion.",
)
@click.option(
    "--slack",
    type=click.FloatRange(min=0.0),
    callback=finite,
    default=2e-3,
    show_default=True,
    help="Added to every variance before it becomes a weight [unit squared].",
)
@click.option(
    "--via",
    type=WishType(),
    multiple=True,
    help="Pass here at that time, WHAT=NUMBERS@SECONDS+-DEVIATION: position=.4,.1,.3@4s+-.001, "
    "'position z=.3@4s+-.001', orientation=1,0,0,0@4s+-2deg. May be given more than once.",
)
@click.option("--out", type=FILE, help="The motion as a CSV file.")
@click.option("--gains", type=FILE, help="The controller as an NPZ file.")
@click.option("--picture", type=FILE, callback=a_picture, help="The motion as a .png, .svg or .pdf file.")
@click.option(
    "--via-picture",
    type=FILE,
    callback=a_picture,
    help="The columns that --via names over time, as a .png, .svg or .pdf file.",
)
@click.option("--force", is_flag=True, help="Replace files that are there already.")
@answering
def replay(**options: Any) -> Answer:
    """Replay the skill in the file SKILL where the objects stand now.

    The motion is that of a unit mass on every axis, under the tracking controller of the skill.
    """
    asked = Choices(**options)
    inputs = (asked.skill, asked.frames, asked.start)
    outputs = (asked.out, asked.gains, asked.picture, asked.via_picture)
    require_new(*outputs, force=asked.force, inputs=inputs)
    if asked.via_picture and not asked.via:
        raise click.UsageError(
            "--via-picture draws points to pass; name one: --via WHAT=NUMBERS@SECONDS+-DEVIATION"
        )
    if asked.picture or asked.via_picture:
        require_matplotlib()
    replayed = _replay(open_skill(asked.skill), asked)
    figures = _drawn(replayed, asked)  # what cannot be drawn leaves no other file
    _write(replayed, figures, asked)
    return _answer(replayed, asked)


def _replay(skill: Skill, asked: Choices) -> Replay:
    points = points_of(asked.via, skill.layout)
    frames = _frames(skill, asked.frames)
    here = setting(adapt(skill, frames))
    start = here.inward(start_in(asked.start, here.adapted) if asked.start else first_mean(here.adapted))
    horizon = asked.horizon or steps_shown(skill)
    reference = plan(here.flat, start, horizon=horizon, slack=asked.slack)
    states = planned_states(here.flat, start, horizon=horizon)
    feedback, direct = followed(here, reference, start, asked.effort)
    motion = direct
    if points:
        reference = through(reference, here.wishes(points), here.flat.layout)
        feedback, motion = followed(here, reference, start, asked.effort)
    return Replay(here, frames, states, reference, feedback, motion, points, direct)


def _frames(skill: Skill, path: Path | None) -> tuple[Frame, ...]:
    if path:
        return frames_in(path, skill)
    if skill.frame_names == ("world",):
        return (world_frame(skill.width),)
    raise InvalidInput(
        f"the skill was learned in {list(skill.frame_names)}; say where each stands now: --frames FILE"
    )


def _drawn(replayed: Replay, asked: Choices) -> "dict[Path, Figure]":
    """The pictures asked for, by the file that each is to be."""
    figures: dict[Path, Figure] = {}
    if not (asked.picture or asked.via_picture):
        return figures
    from pilotfish import plots  # needs matplotlib

    model, motion, points = replayed.adapted, replayed.motion, replayed.points
    if asked.picture and [part.size > 1 for part in _arms(model.layout)][:1] == [True]:
        figures[asked.picture] = plots.reproduction(model, motion, replayed.frames, points=points)
    elif asked.picture:  # no place to draw a plane of
        figures[asked.picture] = plots.tracked_coordinates(model, replayed.states, motion)
    if asked.via_picture:
        figures[asked.via_picture] = plots.via_points(model.layout, motion, points, without=replayed.direct)
    return figures


def _write(replayed: Replay, figures: "dict[Path, Figure]", asked: Choices) -> None:
    writes: list[Callable[[], None]] = [
        partial(save_picture, figure, path, overwrite=asked.force) for path, figure in figures.items()
    ]
    if asked.out:
        writes.append(partial(_write_motion, replayed, asked.out, asked.force))
    if asked.gains:
        writes.append(partial(_write_gains, replayed, asked.gains, asked.force))
    write_each(*writes)


def _write_motion(replayed: Replay, path: Path, force: bool) -> None:
    with whole_file(path, overwrite=force) as part:
        write_motion(part, replayed.motion, replayed.adapted.layout)


def _write_gains(replayed: Replay, path: Path, force: bool) -> None:
    feedback = replayed.feedback
    with whole_file(path, overwrite=force) as part, part.open("wb") as file:
        np.savez(
            file,
            gains=feedback.gains,
            feedforwards=feedback.feedforwards,
            targets=replayed.reference.targets,
            weights=replayed.reference.weights,
            period=np.float64(replayed.motion.period),
            columns=np.array(replayed.here.flat.layout.names),
            bases=replayed.here.map.bases if replayed.here.map else np.empty((0, 4)),
        )


def _arms(layout: Layout) -> list[Part]:
    """The parts that are positions."""
    return [part for part, _ in places(layout) if part.quantity is Quantity.POSITION]


def _notes(replayed: Replay, asked: Choices, missed: Sequence[Miss]) -> list[str]:
    model = replayed.adapted
    notes = notes_on_the_end(model, replayed.last)
    notes += notes_on_the_start(model, replayed.motion.x[0])
    notes += notes_on_misses(missed, asked.via)
    arms = [part.name for part in _arms(model.layout)]
    if asked.picture and len(arms) > 1:
        others = ", ".join(arms[1:]) if len(arms) < 5 else f"the {len(arms) - 1} other positions"
        notes.append(f"the picture shows {arms[0]} alone, not {others}")
    return notes


def _answer(replayed: Replay, asked: Choices) -> Answer:
    motion, model = replayed.motion, replayed.adapted
    parts: dict[str, dict[str, Any]] = {
        part.name: _part_facts(replayed, here, flat)
        for (part, here), (_, flat) in zip(places(model.layout), places(model.layout.tangent), strict=True)
    }
    files = {
        name: str(path)
        for name in ("out", "gains", "picture", "via_picture")
        if (path := getattr(asked, name))
    }
    missed = misses(replayed.points, asked.via, model.layout, motion)
    notes = _notes(replayed, asked, missed)
    facts = {
        "skill": str(asked.skill),
        "steps": len(motion.x),
        "seconds": rounded(motion.period * (len(motion.x) - 1)),
        "final_state_reached": final_state_reached(model, replayed.last),
        **{fact: {name: told[fact] for name, told in parts.items()} for fact in PART_FACTS},
        "via": [asdict(miss) for miss in missed],
        "notes": notes,
        "files": files,
    }
    rows = [("steps", f"{len(motion.x)}, {facts['seconds']:g} s")]
    for part, _ in places(model.layout):
        rows += _part_rows(part, parts[part.name], model.layout)
    rows += [(miss.label, f"missed by {miss.miss:.3g} {miss.unit}") for miss in missed]
    rows += [("note", note) for note in notes]
    return Answer(plain_table([*rows, *(("written", path) for path in files.values())]), facts)


def _part_facts(replayed: Replay, here: slice, flat: slice) -> dict[str, Any]:
    """Of the columns of one part, and those of its deviations, what PART_FACTS name."""
    motion, layout = replayed.motion, replayed.adapted.layout
    apart = gaps(layout, here, motion.x, replayed.here.outward(replayed.reference.targets))
    return {
        "final": on_the_sphere(motion.x[-1:], layout)[0, here].tolist(),
        "largest_acceleration": float(np.linalg.norm(motion.u[:, flat], axis=1).max()),
        "start_to_first_target": float(apart[0]),
        "distance_to_reference": {"mean": float(apart.mean()), "last": float(apart[-1])},
    }


def _part_rows(part: Part, told: dict[str, Any], layout: Layout) -> list[tuple[str, str]]:
    gap, unit = told["distance_to_reference"], unit_of_gaps(layout, layout.columns(part.name))
    push = "rad" if part.quantity is Quantity.ORIENTATION else part.unit  # a quaternion has the unit 1
    return [
        (f"final {part.name}", f"{' '.join(f'{v:.4f}' for v in told['final'])} [{part.unit}]"),
        ("  largest acceleration", f"{told['largest_acceleration']:.4g} {push}/s²"),
        ("  start to first target", f"{round(told['start_to_first_target'], 9):.4g} {unit}"),
        ("  distance to reference", f"{gap['mean']:.4g} {unit} on average, {gap['last']:.4g} at the end"),
    ]
