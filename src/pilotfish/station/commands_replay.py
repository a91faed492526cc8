"""pilotfish replay: a skill in a situation that may never have been shown."""

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
import numpy as np

from pilotfish.control import Feedback, Motion, Reference, double_integrator, track
from pilotfish.demonstrations import Frame, Layout, Quantity, world_frame
from pilotfish.errors import InvalidInput
from pilotfish.models import AdaptedSkill, Skill, adapt
from pilotfish.planning import plan
from pilotfish.station.answers import Answer, answering, example, plain_table, require_new
from pilotfish.station.pictures import require_picture, save_picture
from pilotfish.station.situations import first_mean, frames_in, start_in
from pilotfish.store import open_skill, whole_file
from pilotfish.types import Array, Float


@dataclass(frozen=True, slots=True)
class Choices:
    """What the options say."""

    skill: Path
    frames: Path | None
    start: Path | None
    horizon: int
    effort: float
    slack: float
    out: Path | None
    gains: Path | None
    picture: Path | None
    force: bool


@dataclass(frozen=True, slots=True, eq=False)
class Replay:
    """The skill where things stand, what it was asked to follow, and what came of it."""

    adapted: AdaptedSkill
    frames: tuple[Frame, ...]
    reference: Reference
    feedback: Feedback
    motion: Motion


FILE = click.Path(path_type=Path)


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
@click.option("--horizon", type=click.IntRange(min=2), default=200, show_default=True, help="How many steps.")
@click.option(
    "--effort",
    type=float,
    default=9.0,
    show_default=True,
    help="The price of acceleration; a higher one gives a softer motion.",
)
@click.option(
    "--slack",
    type=float,
    default=2e-3,
    show_default=True,
    help="Added to every variance before it becomes a weight [unit squared].",
)
@click.option("--out", type=FILE, help="The motion as a CSV file.")
@click.option("--gains", type=FILE, help="The controller as an NPZ file.")
@click.option("--picture", type=FILE, help="The motion as a .png, .svg or .pdf file.")
@click.option("--force", is_flag=True, help="Replace files that are there already.")
@answering
def replay(**options: Any) -> Answer:
    """Replay the skill in the file SKILL where the objects stand now.

    The motion is that of a unit mass on every axis, under the tracking controller of the skill.
    """
    asked = Choices(**options)
    require_new(asked.out, asked.gains, asked.picture, force=asked.force)
    if asked.picture:
        require_picture(asked.picture)
    replayed = _replay(open_skill(asked.skill), asked)
    _write(replayed, asked)
    return _answer(replayed, asked)


def _replay(skill: Skill, asked: Choices) -> Replay:
    _require_second_order(skill.layout)
    frames = _frames(skill, asked.frames)
    adapted = adapt(skill, frames)
    start = start_in(asked.start, adapted) if asked.start else first_mean(adapted)
    reference = plan(adapted, start, horizon=asked.horizon, slack=asked.slack)
    system = double_integrator(skill.width // 2, skill.period)
    feedback = track(system, reference, asked.effort)
    return Replay(adapted, frames, reference, feedback, feedback.rollout(start))


def _frames(skill: Skill, path: Path | None) -> tuple[Frame, ...]:
    if path:
        return frames_in(path, skill)
    if skill.frame_names == ("world",):
        return (world_frame(skill.width),)
    raise InvalidInput(
        f"the skill was learned in {list(skill.frame_names)}; say where each stands now: --frames FILE"
    )


def _require_second_order(layout: Layout) -> None:
    """Columns are places, then the speed of each, as the system that moves them needs."""
    places = [(part.name, part.size) for part in layout.parts if part.derivative == 0]
    speeds = [(part.name, part.size) for part in layout.parts if part.derivative == 1]
    order = [part.derivative for part in layout.parts]
    if places != speeds or order != sorted(order) or len(order) != 2 * len(places):
        raise InvalidInput(
            f"the skill's columns are {', '.join(layout.names)}, expected places and then the speed of each; "
            "learn it again with --speeds"
        )


def _write(replayed: Replay, asked: Choices) -> None:
    if asked.out:
        with whole_file(asked.out) as part:
            _write_motion(part, replayed.motion, replayed.adapted.layout)
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
    if asked.picture:
        from pilotfish import plots  # needs matplotlib

        save_picture(plots.reproduction(replayed.adapted, replayed.motion, replayed.frames), asked.picture)


def _write_motion(path: Path, motion: Motion, layout: Layout) -> None:
    """Every number with the digits it takes to read it back equal."""
    header = [f"{name} [{unit}]" for name, unit in zip(layout.names, layout.units, strict=True)]
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["time [s]", *header])
        times = [_rounded(motion.period * t) for t in range(len(motion.x))]
        writer.writerows([time, *row] for time, row in zip(times, motion.x.tolist(), strict=True))


def _rounded(seconds: float) -> float:
    """0.3, where float64 multiplies to 0.30000000000000004."""
    return float(f"{seconds:.12g}")


def _answer(replayed: Replay, asked: Choices) -> Answer:
    motion, layout = replayed.motion, replayed.adapted.layout
    still = [(p, h) for p, h in zip(layout.parts, layout.slices, strict=True) if p.derivative == 0]
    final, efforts, distances = {}, {}, {}
    for part, here in still:
        final[part.name] = _unit(motion.x[-1, here], part.quantity).tolist()
        efforts[part.name] = float(np.linalg.norm(motion.u[:, here], axis=1).max())
        gaps = np.linalg.norm(motion.x[:, here] - replayed.reference.targets[:, here], axis=1)
        distances[part.name] = {"mean": float(gaps.mean()), "last": float(gaps[-1])}
    files = {name: str(path) for name in ("out", "gains", "picture") if (path := getattr(asked, name))}
    facts = {
        "skill": str(asked.skill),
        "steps": len(motion.x),
        "seconds": _rounded(motion.period * (len(motion.x) - 1)),
        "final": final,
        "largest_acceleration": efforts,
        "distance_to_reference": distances,
        "files": files,
    }
    rows = [("steps", f"{len(motion.x)}, {facts['seconds']:g} s")]
    for part, _ in still:
        unit, gap = part.unit, distances[part.name]  # a quaternion has the unit 1
        rows += [
            (f"final {part.name}", f"{' '.join(f'{v:.4f}' for v in final[part.name])} [{unit}]"),
            ("  largest acceleration", f"{efforts[part.name]:.4g} {unit}/s²"),
            ("  distance to reference", f"{gap['mean']:.4g} {unit} on average, {gap['last']:.4g} at the end"),
        ]
    return Answer(plain_table([*rows, *(("written", path) for path in files.values())]), facts)


def _unit(values: Float[Array, " d"], quantity: Quantity) -> Float[Array, " d"]:
    """An orientation as a unit quaternion; the motion leaves the sphere a little."""
    return values / np.linalg.norm(values) if quantity is Quantity.QUATERNION else values
