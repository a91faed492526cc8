"""pilotfish reproduce: adapt a skill to a new situation and compute its motion and controller."""

import re
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from pilotfish.cli.options.demonstrations import training_demonstrations
from pilotfish.cli.options.planning import planning_options
from pilotfish.cli.options.via_points import (
    SYNTAX,
    ViaPointType,
    to_via_points,
    via_point_errors,
    via_point_notes,
    via_point_rows,
)
from pilotfish.cli.output.figures import require_matplotlib, save_figure, validate_figure_path
from pilotfish.cli.output.motion_notes import end_notes, option_name, reaches_final_state
from pilotfish.cli.output.results import (
    CommandResult,
    example_epilog,
    print_result,
    require_finite_option,
    require_writable_file,
    write_all,
)
from pilotfish.cli.output.tables import key_value_table
from pilotfish.control import Motion
from pilotfish.demonstrations import (
    Frame,
    Layout,
    Part,
    Quantity,
    demonstration,
    resample_to_period,
    unwrap_orientations,
    world_frame,
)
from pilotfish.errors import InvalidInput
from pilotfish.io import (
    atomic_file,
    normalise_quaternions,
    open_skill,
    read_frames,
    read_start,
    write_motion,
)
from pilotfish.models import Skill, adapt, coordinate_parts, relevance
from pilotfish.planning import (
    Reproduction,
    ViaPoint,
    mean_demonstration_length,
    motion_notes,
    reproduce_adapted,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FILE = click.Path(path_type=Path)
PART_KEYS = ("final", "max_acceleration", "start_to_first_target", "distance_to_reference")
MAX_LISTED_PARTS = 5  # positions that a note names


@click.command(
    "reproduce", epilog=example_epilog("pilotfish reproduce valve.skill --frames now.json --out motion.csv")
)
@click.argument("skill", type=FILE)
@click.option(
    "--frames",
    type=FILE,
    help="JSON or TOML file with the pose of every frame; not needed if the only frame is the world.",
)
@click.option(
    "--start",
    type=FILE,
    help="JSON or TOML file with the start state of the robot.  [default: mean of the first state]",
)
@planning_options
@click.option(
    "--relevance",
    metavar="FOLDER",
    help="Demonstrations that the skill was learned from, to weight each frame by its relevance.",
)
@click.option(
    "--via-point",
    type=ViaPointType(),
    multiple=True,
    metavar="POINT",
    help=f"Point that the motion passes, {SYNTAX}: position=.4,.1,.3@4s+-.001, "
    "'position z=.3@4s+-.001', orientation=1,0,0,0@4s+-2deg. May be given several times.",
)
@click.option("--out", type=FILE, help="Motion to write, as a CSV file.")
@click.option(
    "--motion-period",
    type=click.FloatRange(min=0.0, min_open=True),
    callback=require_finite_option,
    help="Time between two rows of --out, such as that of a controller [s].  [default: that of the skill]",
)
@click.option("--gains", type=FILE, help="Controller to write, as an NPZ file.")
@click.option(
    "--plot",
    type=FILE,
    callback=validate_figure_path,
    help="Plot of the motion to write, as .png, .svg or .pdf.",
)
@click.option(
    "--via-plot",
    type=FILE,
    callback=validate_figure_path,
    help="Plot over time of the columns of --via-point to write, as .png, .svg or .pdf.",
)
@click.option("--force", is_flag=True, help="Replace existing files.")
@print_result
def reproduce_command(
    skill: Path, frames: Path | None, start: Path | None, force: bool, **options: Any
) -> CommandResult:
    """Adapt the skill in the file SKILL to new frames and compute the motion that reproduces it.

    The motion is that of a unit mass on each axis, under the tracking controller of the skill.
    """
    outputs = {name: options[name] for name in ("out", "gains", "plot", "via_plot") if options[name]}
    require_writable_file(*outputs.values(), force=force, inputs=(skill, frames, start))
    if options["via_plot"] and not options["via_point"]:
        raise click.UsageError(f"--via-plot plots via-points; give at least one: --via-point {SYNTAX}")
    if options["motion_period"] and not options["out"]:
        raise click.UsageError("--motion-period resamples the motion that is written; give --out FILE")
    if options["plot"] or options["via_plot"]:
        require_matplotlib()
    learned = open_skill(skill)
    points = to_via_points(options["via_point"], learned.layout)
    current_frames = _read_frames(learned, frames)
    reproduction, baseline = _reproduce(learned, current_frames, start, points, options)
    written = _resample_motion(reproduction, options["motion_period"])
    figures = _plot(reproduction, baseline, current_frames, points, options)  # a failure leaves no file
    _write(reproduction, written, figures, options, force)
    files = {name: str(path) for name, path in outputs.items()}
    compared = motion_notes(learned, reproduction, current_frames, name_argument=option_name)
    result = _to_result(skill, reproduction, points, options, files, compared)
    if options["motion_period"] is None:
        return result
    rows = {"rows": len(written.x), "period": written.period}
    text = f"{outputs['out']} has {len(written.x)} rows, every {written.period:g} s"
    return CommandResult([*result.blocks, text], result.data | {"motion": rows})


def _resample_motion(reproduction: Reproduction, period: float | None) -> Motion:
    """Return the motion at a period [s]; orientations by slerp, derivatives as differences."""
    motion, layout = reproduction.motion, reproduction.adapted.layout
    if period is None:
        return motion
    x = unwrap_orientations(normalise_quaternions(motion.x, layout), layout)
    try:
        resampled = resample_to_period(demonstration(x, motion.period, layout, (), "motion"), period)
    except InvalidInput as error:
        raise InvalidInput(f"--motion-period: {error}") from error
    if resampled.layout != layout:
        raise InvalidInput(
            "--motion-period needs a skill with velocities of all parts; learn it with --velocities"
        )
    inputs = (period / motion.period * np.arange(len(resampled.x) - 1) + 1e-9).astype(int)
    return Motion(resampled.x, motion.u[np.minimum(inputs, len(motion.u) - 1)], period)


def _reproduce(
    skill: Skill,
    frames: Sequence[Frame],
    start_file: Path | None,
    points: Sequence[ViaPoint],
    options: dict[str, Any],
) -> tuple[Reproduction, Reproduction]:
    """Return the reproduction, and the one without via-points."""
    start = read_start(start_file, adapt(skill, frames)) if start_file else None
    try:
        horizon = options["horizon"] or mean_demonstration_length(skill)
    except InvalidInput as error:
        raise InvalidInput(f"{error} with --horizon") from error
    weights = None
    if source := options["relevance"]:
        weights = relevance(skill, training_demonstrations(skill, source)).values
    run = partial(
        reproduce_adapted,
        adapt(skill, frames, relevance=weights),
        start,
        horizon=horizon,
        control_cost=options["control_cost"],
        covariance_regularisation=options["covariance_regularisation"],
    )
    baseline = run()
    return (run(via_points=points) if points else baseline), baseline


def _read_frames(skill: Skill, path: Path | None) -> tuple[Frame, ...]:
    if path:
        return read_frames(path, skill)
    if skill.frame_names == ("world",):
        return (world_frame(skill.width),)
    raise InvalidInput(
        f"the skill has the frames {list(skill.frame_names)}, expected the pose of each; give --frames FILE"
    )


def _plot(
    reproduction: Reproduction,
    baseline: Reproduction,
    frames: Sequence[Frame],
    points: Sequence[ViaPoint],
    options: dict[str, Any],
) -> "dict[Path, Figure]":
    """Return the requested figures by file."""
    figures: dict[Path, Figure] = {}
    if not (options["plot"] or options["via_plot"]):
        return figures
    from pilotfish import plots

    adapted, motion = reproduction.adapted, reproduction.motion
    positions = _position_parts(adapted.layout)
    if options["plot"] and positions and positions[0].size > 1:
        figures[options["plot"]] = plots.reproduction(adapted, motion, frames, points=points)
    elif options["plot"]:  # no plane to plot
        figures[options["plot"]] = plots.tracked_coordinates(adapted, reproduction.states, motion)
    if options["via_plot"]:
        figures[options["via_plot"]] = plots.via_points(
            adapted.layout, motion, points, baseline=baseline.motion
        )
    return figures


def _write(
    reproduction: Reproduction,
    motion: Motion,
    figures: "dict[Path, Figure]",
    options: dict[str, Any],
    force: bool,
) -> None:
    writes: list[Callable[[], None]] = [
        partial(save_figure, figure, path, overwrite=force) for path, figure in figures.items()
    ]
    if options["out"]:
        writes.append(partial(_write_motion, motion, reproduction.adapted.layout, options["out"], force))
    if options["gains"]:
        writes.append(partial(_write_gains, reproduction, options["gains"], force))
    write_all(*writes)


def _write_motion(motion: Motion, layout: Layout, path: Path, force: bool) -> None:
    with atomic_file(path, overwrite=force) as part:
        write_motion(part, motion, layout)


def _write_gains(reproduction: Reproduction, path: Path, force: bool) -> None:
    chart = reproduction.tangent_chart
    with atomic_file(path, overwrite=force) as part, part.open("wb") as file:
        np.savez(
            file,
            gains=reproduction.feedback.gains,
            feedforwards=reproduction.feedback.feedforwards,
            targets=reproduction.reference.targets,
            weights=reproduction.reference.weights,
            period=np.float64(reproduction.motion.period),
            columns=np.array(reproduction.tangent_skill.layout.names),
            bases=chart.base_quaternions if chart else np.empty((0, 4)),
        )


def _position_parts(layout: Layout) -> list[Part]:
    return [part for part, _ in coordinate_parts(layout) if part.quantity is Quantity.POSITION]


def _to_result(
    skill: Path,
    reproduction: Reproduction,
    points: Sequence[ViaPoint],
    options: dict[str, Any],
    files: dict[str, str],
    compared: Sequence[str],
) -> CommandResult:
    adapted, motion = reproduction.adapted, reproduction.motion
    typed: Sequence[re.Match[str]] = options["via_point"]
    parts = _parts_to_json(reproduction)
    errors = via_point_errors(points, typed, adapted.layout, motion)
    final_state = int(reproduction.states[-1])
    notes = end_notes(adapted, final_state) + list(compared)
    notes += via_point_notes(errors, typed) + (_plot_notes(adapted.layout) if options["plot"] else [])
    seconds = float(f"{motion.period * (len(motion.x) - 1):.12g}")
    data = {
        "skill": str(skill),
        "steps": len(motion.x),
        "seconds": seconds,
        "final_state_reached": reaches_final_state(adapted, final_state),
        **{key: {name: values[key] for name, values in parts.items()} for key in PART_KEYS},
        "via_points": errors,
        "notes": notes,
        "files": files,
    }
    rows = [("steps", f"{len(motion.x)}, {seconds:g} s")]
    for part, _ in coordinate_parts(adapted.layout):
        rows += _part_rows(part, parts[part.name], adapted.layout)
    rows += via_point_rows(errors, typed)
    rows += [*(("note", note) for note in notes), *(("written", path) for path in files.values())]
    return CommandResult([key_value_table(rows)], data)


def _plot_notes(layout: Layout) -> list[str]:
    first, *others = [part.name for part in _position_parts(layout)] or [""]
    if not others:
        return []
    names = ", ".join(others) if len(others) < MAX_LISTED_PARTS - 1 else f"the {len(others)} other positions"
    return [f"the plot shows only {first}, not {names}"]


def _parts_to_json(reproduction: Reproduction) -> dict[str, dict[str, Any]]:
    """Return the values of PART_KEYS for each part: in its unit, orientations in degrees."""
    motion, layout = reproduction.motion, reproduction.adapted.layout
    parts: dict[str, dict[str, Any]] = {}
    for (part, columns), (_, tangent_columns) in zip(
        coordinate_parts(layout), coordinate_parts(layout.tangent), strict=True
    ):
        gaps = layout.distances(columns, motion.x, reproduction.targets)
        parts[part.name] = {
            "final": normalise_quaternions(motion.x[-1:], layout)[0, columns].tolist(),
            "max_acceleration": float(np.linalg.norm(motion.u[:, tangent_columns], axis=1).max()),
            "start_to_first_target": float(gaps[0]),
            "distance_to_reference": {"mean": float(gaps.mean()), "last": float(gaps[-1])},
        }
    return parts


def _part_rows(part: Part, values: dict[str, Any], layout: Layout) -> list[tuple[str, str]]:
    distance, unit = values["distance_to_reference"], layout.distance_unit(layout.columns(part.name))
    turn_unit = "rad" if part.quantity is Quantity.ORIENTATION else part.unit
    return [
        (f"final {part.name}", f"{' '.join(f'{v:.4f}' for v in values['final'])} [{part.unit}]"),
        ("  maximum acceleration", f"{values['max_acceleration']:.4g} {turn_unit}/s²"),
        ("  start to first target", f"{round(values['start_to_first_target'], 9):.4g} {unit}"),
        ("  distance to reference", f"mean {distance['mean']:.4g} {unit}, at the end {distance['last']:.4g}"),
    ]
