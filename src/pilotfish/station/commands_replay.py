"""pilotfish replay: a skill in a situation that may never have been shown."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from pilotfish.control import Feedback, Motion, Reference, double_integrator, track
from pilotfish.demonstrations import Frame, Part, Quantity, world_frame
from pilotfish.errors import InvalidInput
from pilotfish.models import AdaptedSkill, Skill, adapt
from pilotfish.planning import plan, planned_states
from pilotfish.station.answers import Answer, answering, example, finite, plain_table, require_new
from pilotfish.station.evaluation import coordinates_with_speeds
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
from pilotfish.store import open_skill, whole_file

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
    picture: Path | None
    force: bool


@dataclass(frozen=True, slots=True, eq=False)
class Replay:
    """The skill where things stand, the state it ends in, what it was asked to follow, what came of it."""

    adapted: AdaptedSkill
    frames: tuple[Frame, ...]
    last: int
    reference: Reference
    feedback: Feedback
    motion: Motion


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
    type=click.IntRange(min=2),
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
@click.option("--out", type=FILE, help="The motion as a CSV file.")
@click.option("--gains", type=FILE, help="The controller as an NPZ file.")
@click.option("--picture", type=FILE, callback=a_picture, help="The motion as a .png, .svg or .pdf file.")
@click.option("--force", is_flag=True, help="Replace files that are there already.")
@answering
def replay(**options: Any) -> Answer:
    """Replay the skill in the file SKILL where the objects stand now.

    The motion is that of a unit mass on every axis, under the tracking controller of the skill.
    """
    asked = Choices(**options)
    inputs = (asked.skill, asked.frames, asked.start)
    require_new(asked.out, asked.gains, asked.picture, force=asked.force, inputs=inputs)
    if asked.picture:
        require_matplotlib()
    replayed = _replay(open_skill(asked.skill), asked)
    figure = _drawn(replayed) if asked.picture else None  # what cannot be drawn leaves no other file
    _write(replayed, figure, asked)
    return _answer(replayed, asked)


def _replay(skill: Skill, asked: Choices) -> Replay:
    axes = coordinates_with_speeds(skill.layout)
    frames = _frames(skill, asked.frames)
    adapted = adapt(skill, frames)
    start = start_in(asked.start, adapted) if asked.start else first_mean(adapted)
    horizon = asked.horizon or _steps_shown(skill)
    reference = plan(adapted, start, horizon=horizon, slack=asked.slack)
    last = int(planned_states(adapted, start, horizon=horizon)[-1])
    feedback = track(double_integrator(axes, skill.period), reference, asked.effort)
    return Replay(adapted, frames, last, reference, feedback, feedback.rollout(start))


def _steps_shown(skill: Skill) -> int:
    """How many steps a demonstration had on average."""
    shown = skill.provenance
    if not shown.demonstrations or shown.datapoints < 2 * len(shown.demonstrations):
        raise InvalidInput("the skill does not say how long its demonstrations were; say --horizon")
    return round(shown.datapoints / len(shown.demonstrations))


def _frames(skill: Skill, path: Path | None) -> tuple[Frame, ...]:
    if path:
        return frames_in(path, skill)
    if skill.frame_names == ("world",):
        return (world_frame(skill.width),)
    raise InvalidInput(
        f"the skill was learned in {list(skill.frame_names)}; say where each stands now: --frames FILE"
    )


def _drawn(replayed: Replay) -> "Figure":
    from pilotfish import plots  # needs matplotlib

    return plots.reproduction(replayed.adapted, replayed.motion, replayed.frames)


def _write(replayed: Replay, figure: "Figure | None", asked: Choices) -> None:
    if asked.picture and figure:
        save_picture(figure, asked.picture)
    if asked.out:
        with whole_file(asked.out) as part:
            write_motion(part, replayed.motion, replayed.adapted.layout)
    if asked.gains:
        with whole_file(asked.gains) as part, part.open("wb") as file:
            feedback = replayed.feedback
            np.savez(
                file,
                gains=feedback.gains,
                feedforwards=feedback.feedforwards,
                targets=replayed.reference.targets,
                weights=replayed.reference.weights,
                period=np.float64(replayed.motion.period),
            )


def _notes(replayed: Replay, asked: Choices) -> list[str]:
    model = replayed.adapted
    notes = notes_on_the_end(model, replayed.last)
    notes += notes_on_the_start(model, replayed.motion.x[0])
    arms = [part.name for part, _ in places(model.layout) if part.quantity is Quantity.POSITION]
    if asked.picture and len(arms) > 1:
        notes.append(f"the picture shows {arms[0]} alone, not {', '.join(arms[1:])}")
    return notes


def _answer(replayed: Replay, asked: Choices) -> Answer:
    motion, model = replayed.motion, replayed.adapted
    parts: dict[str, dict[str, Any]] = {
        part.name: _part_facts(replayed, here) for part, here in places(model.layout)
    }
    files = {name: str(path) for name in ("out", "gains", "picture") if (path := getattr(asked, name))}
    notes = _notes(replayed, asked)
    facts = {
        "skill": str(asked.skill),
        "steps": len(motion.x),
        "seconds": rounded(motion.period * (len(motion.x) - 1)),
        "final_state_reached": final_state_reached(model, replayed.last),
        **{fact: {name: told[fact] for name, told in parts.items()} for fact in PART_FACTS},
        "notes": notes,
        "files": files,
    }
    rows = [("steps", f"{len(motion.x)}, {facts['seconds']:g} s")]
    for part, _ in places(model.layout):
        rows += _part_rows(part, parts[part.name])
    rows += [("note", note) for note in notes]
    return Answer(plain_table([*rows, *(("written", path) for path in files.values())]), facts)


def _part_facts(replayed: Replay, here: slice) -> dict[str, Any]:
    """Of these columns, what PART_FACTS name."""
    motion, targets = replayed.motion, replayed.reference.targets
    gaps = np.linalg.norm(motion.x[:, here] - targets[:, here], axis=1)
    return {
        "final": on_the_sphere(motion.x[-1:], replayed.adapted.layout)[0, here].tolist(),
        "largest_acceleration": float(np.linalg.norm(motion.u[:, here], axis=1).max()),
        "start_to_first_target": float(gaps[0]),
        "distance_to_reference": {"mean": float(gaps.mean()), "last": float(gaps[-1])},
    }


def _part_rows(part: Part, told: dict[str, Any]) -> list[tuple[str, str]]:
    unit, gap = part.unit, told["distance_to_reference"]  # a quaternion has the unit 1
    return [
        (f"final {part.name}", f"{' '.join(f'{v:.4f}' for v in told['final'])} [{unit}]"),
        ("  largest acceleration", f"{told['largest_acceleration']:.4g} {unit}/s²"),
        ("  start to first target", f"{told['start_to_first_target']:.4g} {unit}"),
        ("  distance to reference", f"{gap['mean']:.4g} {unit} on average, {gap['last']:.4g} at the end"),
    ]
