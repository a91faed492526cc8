"""pilotfish reproduce: a skill in a situation that may never have been shown."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from pilotfish.cli.options.via_points import (
    ViaPointError,
    ViaPointOption,
    ViaPointType,
    to_via_points,
    via_point_errors,
    via_point_notes,
)
from pilotfish.cli.output.answers import (
    CommandResult,
    example_epilog,
    format_key_values,
    print_result,
    require_finite_option,
    require_writable_file,
    write_all,
)
from pilotfish.cli.output.motion_notes import coordinate_parts, end_notes, reaches_final_state, start_notes
from pilotfish.cli.output.pictures import require_matplotlib, save_figure, validate_figure_path
from pilotfish.control import Motion
from pilotfish.demonstrations import Frame, Layout, Part, Quantity, distance_unit, distances, world_frame
from pilotfish.errors import InvalidInput
from pilotfish.io import (
    atomic_file,
    normalise_quaternions,
    open_skill,
    read_frames,
    read_start,
    round_time,
    write_motion,
)
from pilotfish.models import MAX_HORIZON, AdaptedSkill, Skill, adapt
from pilotfish.planning import (
    CONTROL_COST,
    COVARIANCE_REGULARISATION,
    Reproduction,
    ViaPoint,
    mean_demonstration_length,
    reproduce,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True)
class ReproduceOptions:
    """What the options say."""

    skill: Path
    frames: Path | None
    start: Path | None
    horizon: int | None
    control_cost: float
    covariance_regularisation: float
    out: Path | None
    gains: Path | None
    via_point: tuple[ViaPointOption, ...]
    plot: Path | None
    via_plot: Path | None
    force: bool


@dataclass(frozen=True, slots=True, eq=False)
class Reproduced:
    """A reproduction, the frames and via-points that were given, and the motion without the via-points."""

    reproduction: Reproduction
    frames: tuple[Frame, ...]
    points: tuple[ViaPoint, ...]
    without_via_points: Motion

    @property
    def adapted(self) -> AdaptedSkill:
        """Adapted skill of the reproduction."""
        return self.reproduction.adapted

    @property
    def motion(self) -> Motion:
        """Motion of the reproduction."""
        return self.reproduction.motion

    @property
    def final_planned_state(self) -> int:
        """State of the last step."""
        return int(self.reproduction.states[-1])


FILE = click.Path(path_type=Path)
PART_KEYS = ("final", "max_acceleration", "start_to_first_target", "distance_to_reference")


@click.command(
    "reproduce", epilog=example_epilog("pilotfish reproduce valve.skill --frames now.json --out motion.csv")
)
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
    type=click.IntRange(2, MAX_HORIZON),
    help="How many steps.  [default: as many as the demonstrations had on average]",
)
@click.option(
    "--control-cost",
    type=click.FloatRange(min=0.0, min_open=True),
    callback=require_finite_option,
    default=CONTROL_COST,
    show_default=True,
    help="R, the cost of squared acceleration; a larger value gives a softer motion.",
)
@click.option(
    "--covariance-regularisation",
    type=click.FloatRange(min=0.0),
    callback=require_finite_option,
    default=COVARIANCE_REGULARISATION,
    show_default=True,
    help="Variance added to every variance before it becomes a weight [unit squared].",
)
@click.option(
    "--via-point",
    type=ViaPointType(),
    multiple=True,
    help="Pass here at that time, WHAT=NUMBERS@SECONDS+-DEVIATION: position=.4,.1,.3@4s+-.001, "
    "'position z=.3@4s+-.001', orientation=1,0,0,0@4s+-2deg. May be given more than once.",
)
@click.option("--out", type=FILE, help="The motion as a CSV file.")
@click.option("--gains", type=FILE, help="The controller as an NPZ file.")
@click.option(
    "--plot", type=FILE, callback=validate_figure_path, help="The motion as a .png, .svg or .pdf file."
)
@click.option(
    "--via-plot",
    type=FILE,
    callback=validate_figure_path,
    help="The columns that --via-point names over time, as a .png, .svg or .pdf file.",
)
@click.option("--force", is_flag=True, help="Replace files that are there already.")
@print_result
def reproduce_command(**options: Any) -> CommandResult:
    """Reproduce the skill in the file SKILL where the objects are now.

    The motion is that of a unit mass on every axis, under the tracking controller of the skill.
    """
    arguments = ReproduceOptions(**options)
    inputs = (arguments.skill, arguments.frames, arguments.start)
    outputs = (arguments.out, arguments.gains, arguments.plot, arguments.via_plot)
    require_writable_file(*outputs, force=arguments.force, inputs=inputs)
    if arguments.via_plot and not arguments.via_point:
        raise click.UsageError(
            "--via-plot draws points to pass; name one: --via-point WHAT=NUMBERS@SECONDS+-DEVIATION"
        )
    if arguments.plot or arguments.via_plot:
        require_matplotlib()
    reproduced = _reproduce(open_skill(arguments.skill), arguments)
    figures = _plot(reproduced, arguments)  # what cannot be drawn leaves no other file
    _write(reproduced, figures, arguments)
    return _to_result(reproduced, arguments)


def _reproduce(skill: Skill, arguments: ReproduceOptions) -> Reproduced:
    points = to_via_points(arguments.via_point, skill.layout)
    frames = _frames(skill, arguments.frames)
    start = read_start(arguments.start, adapt(skill, frames)) if arguments.start else None
    try:
        horizon = arguments.horizon or mean_demonstration_length(skill)
    except InvalidInput as error:
        raise InvalidInput(f"{error} with --horizon") from error
    run = partial(
        reproduce,
        skill,
        frames,
        start,
        horizon=horizon,
        control_cost=arguments.control_cost,
        covariance_regularisation=arguments.covariance_regularisation,
    )
    without_via_points = run()
    if not points:
        return Reproduced(without_via_points, frames, points, without_via_points.motion)
    condition_on = run(via_points=points)
    return Reproduced(condition_on, frames, points, without_via_points.motion)


def _frames(skill: Skill, path: Path | None) -> tuple[Frame, ...]:
    if path:
        return read_frames(path, skill)
    if skill.frame_names == ("world",):
        return (world_frame(skill.width),)
    raise InvalidInput(
        f"the skill was learned in {list(skill.frame_names)}; say where each stands now: --frames FILE"
    )


def _plot(reproduced: Reproduced, arguments: ReproduceOptions) -> "dict[Path, Figure]":
    """The pictures asked for, by the file that each is to be."""
    figures: dict[Path, Figure] = {}
    if not (arguments.plot or arguments.via_plot):
        return figures
    from pilotfish import plots  # needs matplotlib

    model, motion, points = reproduced.adapted, reproduced.motion, reproduced.points
    if arguments.plot and [part.size > 1 for part in _position_parts(model.layout)][:1] == [True]:
        figures[arguments.plot] = plots.reproduction(model, motion, reproduced.frames, points=points)
    elif arguments.plot:  # no place to draw a plane of
        figures[arguments.plot] = plots.tracked_coordinates(model, reproduced.reproduction.states, motion)
    if arguments.via_plot:
        figures[arguments.via_plot] = plots.via_points(
            model.layout, motion, points, baseline=reproduced.without_via_points
        )
    return figures


def _write(reproduced: Reproduced, figures: "dict[Path, Figure]", arguments: ReproduceOptions) -> None:
    writes: list[Callable[[], None]] = [
        partial(save_figure, figure, path, overwrite=arguments.force) for path, figure in figures.items()
    ]
    if arguments.out:
        writes.append(partial(_write_motion, reproduced, arguments.out, arguments.force))
    if arguments.gains:
        writes.append(partial(_write_gains, reproduced, arguments.gains, arguments.force))
    write_all(*writes)


def _write_motion(reproduced: Reproduced, path: Path, force: bool) -> None:
    with atomic_file(path, overwrite=force) as part:
        write_motion(part, reproduced.motion, reproduced.adapted.layout)


def _write_gains(reproduced: Reproduced, path: Path, force: bool) -> None:
    feedback = reproduced.reproduction.feedback
    with atomic_file(path, overwrite=force) as part, part.open("wb") as file:
        np.savez(
            file,
            gains=feedback.gains,
            feedforwards=feedback.feedforwards,
            targets=reproduced.reproduction.reference.targets,
            weights=reproduced.reproduction.reference.weights,
            period=np.float64(reproduced.motion.period),
            columns=np.array(reproduced.reproduction.tangent_skill.layout.names),
            bases=reproduced.reproduction.tangent_chart.bases
            if reproduced.reproduction.tangent_chart
            else np.empty((0, 4)),
        )


def _position_parts(layout: Layout) -> list[Part]:
    """The parts that are positions."""
    return [part for part, _ in coordinate_parts(layout) if part.quantity is Quantity.POSITION]


def _notes(reproduced: Reproduced, arguments: ReproduceOptions, errors: Sequence[ViaPointError]) -> list[str]:
    model = reproduced.adapted
    notes = end_notes(model, reproduced.final_planned_state)
    notes += start_notes(model, reproduced.motion.x[0])
    notes += via_point_notes(errors, arguments.via_point)
    arms = [part.name for part in _position_parts(model.layout)]
    if arguments.plot and len(arms) > 1:
        others = ", ".join(arms[1:]) if len(arms) < 5 else f"the {len(arms) - 1} other positions"
        notes.append(f"the picture shows {arms[0]} alone, not {others}")
    return notes


def _to_result(reproduced: Reproduced, arguments: ReproduceOptions) -> CommandResult:
    motion, model = reproduced.motion, reproduced.adapted
    parts: dict[str, dict[str, Any]] = {
        part.name: _part_to_json(reproduced, here, flat)
        for (part, here), (_, flat) in zip(
            coordinate_parts(model.layout), coordinate_parts(model.layout.tangent), strict=True
        )
    }
    files = {
        name: str(path) for name in ("out", "gains", "plot", "via_plot") if (path := getattr(arguments, name))
    }
    errors = via_point_errors(reproduced.points, arguments.via_point, model.layout, motion)
    notes = _notes(reproduced, arguments, errors)
    facts = {
        "skill": str(arguments.skill),
        "steps": len(motion.x),
        "seconds": round_time(motion.period * (len(motion.x) - 1)),
        "final_state_reached": reaches_final_state(model, reproduced.final_planned_state),
        **{fact: {name: values[fact] for name, values in parts.items()} for fact in PART_KEYS},
        "via_points": [asdict(error) for error in errors],
        "notes": notes,
        "files": files,
    }
    rows = [("steps", f"{len(motion.x)}, {facts['seconds']:g} s")]
    for part, _ in coordinate_parts(model.layout):
        rows += _format_part(part, parts[part.name], model.layout)
    rows += [(error.label, f"missed by {error.error:.3g} {error.unit}") for error in errors]
    rows += [("note", note) for note in notes]
    return CommandResult(format_key_values([*rows, *(("written", path) for path in files.values())]), facts)


def _part_to_json(reproduced: Reproduced, here: slice, flat: slice) -> dict[str, Any]:
    """Of the columns of one part, and those of its deviations, what PART_FACTS name."""
    motion, layout = reproduced.motion, reproduced.adapted.layout
    gaps = distances(layout, here, motion.x, reproduced.reproduction.targets)
    return {
        "final": normalise_quaternions(motion.x[-1:], layout)[0, here].tolist(),
        "max_acceleration": float(np.linalg.norm(motion.u[:, flat], axis=1).max()),
        "start_to_first_target": float(gaps[0]),
        "distance_to_reference": {"mean": float(gaps.mean()), "last": float(gaps[-1])},
    }


def _format_part(part: Part, values: dict[str, Any], layout: Layout) -> list[tuple[str, str]]:
    distance, unit = values["distance_to_reference"], distance_unit(layout, layout.columns(part.name))
    acceleration_unit = (
        "rad" if part.quantity is Quantity.ORIENTATION else part.unit
    )  # a quaternion has the unit 1
    return [
        (f"final {part.name}", f"{' '.join(f'{v:.4f}' for v in values['final'])} [{part.unit}]"),
        ("  maximum acceleration", f"{values['max_acceleration']:.4g} {acceleration_unit}/s²"),
        ("  start to first target", f"{round(values['start_to_first_target'], 9):.4g} {unit}"),
        (
            "  distance to reference",
            f"{distance['mean']:.4g} {unit} on average, {distance['last']:.4g} at the end",
        ),
    ]
