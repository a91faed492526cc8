"""pilotfish data import: demonstrations from the recordings of a laboratory."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from pilotfish.cli.output.demonstrations import demonstration_blocks, demonstration_to_json
from pilotfish.cli.output.imports import import_result, proposal, settings_table, stated_units
from pilotfish.cli.output.results import (
    CommandResult,
    example_epilog,
    print_result,
    require_finite_option,
    require_writable_file,
    require_writable_folder,
)
from pilotfish.cli.output.tables import Table
from pilotfish.cli.output.terminal import is_interactive, progress_bar
from pilotfish.demonstrations import (
    BuildSettings,
    Conversion,
    Demonstration,
    FrameSource,
    PartSource,
    Quantity,
    Question,
    Recording,
    build_demonstration,
    demonstration,
    frame,
    suggest_settings,
    world_frame,
)
from pilotfish.errors import InvalidInput
from pilotfish.io import (
    atomic_file,
    format_import_settings,
    read_import_settings,
    restore_demonstration,
    stated_import_settings,
    write_demonstrations,
)
from pilotfish.io.readers import ReadOptions, read_recordings

ORIENTATIONS = (Quantity.QUATERNION, Quantity.ORIENTATION)
OPTIONS = {  # that answer a question
    "order": "--order",
    "length": "--length-unit",
    "angle": "--angle-unit",
    "period": "--period",
}


@click.command(
    name="import",
    epilog=example_epilog(
        "pilotfish data import my-logs --out cube",
        "pilotfish data import my-logs --order xyzw --length-unit mm --period 0.05 --out cube-20-hz",
        "pilotfish data import my-logs --save-settings cube.toml",
        "pilotfish data import my-logs --settings cube.toml --out cube-edited",
    ),
)
@click.argument("source", type=click.Path(path_type=Path))
@click.option("--out", type=click.Path(path_type=Path), help="Folder of demonstrations to write.")
@click.option(
    "--settings",
    type=click.Path(path_type=Path),
    help="TOML file that names the columns of parts and frames.  [default: proposed from the recordings]",
)
@click.option(
    "--save-settings", type=click.Path(path_type=Path), help="TOML file to write, with the proposal, to edit."
)
@click.option("--accept", is_flag=True, help="Accept what is proposed where the recordings leave a question.")
@click.option(
    "--order",
    type=click.Choice(["wxyz", "xyzw"]),
    help="Order of quaternions.  [default: from the recordings]",
)
@click.option(
    "--length-unit", help="Unit of all positions for which the file states none, such as mm.  [default: m]"
)
@click.option(
    "--angle-unit", help="Unit of all angles for which the file states none: rad or deg.  [default: rad]"
)
@click.option(
    "--period",
    type=click.FloatRange(min=0.0, min_open=True),
    callback=require_finite_option,
    help="Time between two rows of a demonstration [s].  [default: that of the recordings]",
)
@click.option("--moving", multiple=True, metavar="FRAME", help="Object that moves during a demonstration.")
@click.option(
    "--base-frame",
    metavar="NAME",
    help="Name of an additional frame, the base of the robot, for motions that begin at places fixed to it.",
)
@click.option("--time-unit", type=click.Choice(["s", "ms", "us", "ns"]), help="Unit of the times.")
@click.option("--force", is_flag=True, help="Replace existing outputs.")
@print_result
def import_recordings(source: Path, **options: Any) -> CommandResult:
    """Convert the recordings in SOURCE, a file or folder, to demonstrations that `learn` reads.

    Columns become parts and frames by their names. All signals are resampled to one period, and units and
    orientations are converted. Every conversion is reported. What the recordings do not reveal, such as the
    order of a quaternion without names, is asked for.
    """
    out, saved = options["out"], options["save_settings"]
    _require_outputs(source, out, saved, options)
    recordings = list(read_recordings(source, options=ReadOptions(time_unit=options["time_unit"] or "")))
    if not recordings:
        raise InvalidInput(f"{source} has no recordings; check the name")
    if out is not None and (restored := _restore(recordings, options)):
        write_demonstrations(restored, out, overwrite=options["force"], use_free_name=True)
        return _restored_result(recordings, restored, out)
    questions: tuple[Question, ...] = ()
    if options["settings"]:
        settings = read_import_settings(options["settings"])
    else:
        settings, questions = suggest_settings(recordings)
        if stated := stated_import_settings(recordings[0]):  # a folder of demonstrations
            settings, questions = replace(stated, period=settings.period), ()
    settings = _with_options(recordings[0], settings, options)
    open_questions = [q for q in questions if not _is_answered(q, options)]
    if saved:
        with atomic_file(saved, overwrite=options["force"]) as part:
            texts = [question.text for question in open_questions]
            part.write_text(format_import_settings(settings, texts), encoding="utf-8")
    table = settings_table(recordings[0], settings, _chosen_units(settings, options))
    if out is None:
        return proposal(recordings, settings, table, open_questions, saved)
    _require_answers(table, open_questions, accept=options["accept"])
    built = list(_build(recordings, settings, options["base_frame"]))
    write_demonstrations([demo for demo, _ in built], out, overwrite=options["force"], use_free_name=True)
    return import_result(recordings, settings, table, built, out)


def _require_outputs(source: Path, out: Path | None, saved: Path | None, options: dict[str, Any]) -> None:
    if out is None and saved is None:
        raise click.UsageError("nothing to write; give --out FOLDER, or --save-settings FILE for a proposal")
    require_writable_file(saved, force=options["force"], inputs=(source, options["settings"]))
    if out is not None:
        require_writable_folder(out, force=options["force"])


def _restore(recordings: Sequence[Recording], options: dict[str, Any]) -> list[Demonstration]:
    """Return the demonstrations that pilotfish exported; none if it did not, or options change them."""
    changes = {"settings", "save_settings", "order", "length_unit", "angle_unit", "period", "moving"}
    if any(options[name] for name in changes | {"base_frame"}):
        return []
    restored = [restore_demonstration(recording) for recording in recordings]
    return [demo for demo in restored if demo is not None] if None not in restored else []


def _restored_result(
    recordings: Sequence[Recording], demonstrations: Sequence[Demonstration], out: Path
) -> CommandResult:
    text = f"exported by pilotfish, and restored number for number; written to {out}"
    data = {
        "folder": str(out),
        "format": recordings[0].format,
        "demonstrations": [demonstration_to_json(demo) for demo in demonstrations],
        "conversions": {},
    }
    return CommandResult([*demonstration_blocks(demonstrations), text], data)


def _with_options(recording: Recording, settings: BuildSettings, options: dict[str, Any]) -> BuildSettings:
    """Return the settings with what the options state."""
    if unknown := [name for name in options["moving"] if name not in [f.name for f in settings.frames]]:
        names = ", ".join(frame.name for frame in settings.frames) or "none"
        raise InvalidInput(f"--moving names {unknown[0]!r}, expected one of the frames: {names}")
    parts = [_part_with_options(recording, part, options) for part in settings.parts]
    frames = [_frame_with_options(recording, frame, options) for frame in settings.frames]
    period = options["period"] or settings.period
    return replace(settings, parts=tuple(parts), frames=tuple(frames), period=period)


def _chosen_units(settings: BuildSettings, options: dict[str, Any]) -> set[str]:
    """Return the units that the user stated, by options or in a file of settings."""
    chosen = {options["length_unit"], options["angle_unit"]} - {None}
    if options["settings"]:
        chosen |= {part.unit for part in settings.parts}
        chosen |= {source.unit for frame in settings.frames for source in frame.sources}
    return chosen - {""}


def _part_with_options(recording: Recording, part: PartSource, options: dict[str, Any]) -> PartSource:
    is_order = part.quantity in ORIENTATIONS and part.representation in ("wxyz", "xyzw")
    if is_order:
        return replace(part, representation=options["order"] or part.representation)
    if stated_units(recording, part):
        return part
    if part.quantity is Quantity.POSITION:
        return replace(part, unit=options["length_unit"] or part.unit)
    has_angles = part.quantity in ORIENTATIONS and part.representation != "matrix"
    if has_angles or part.unit in ("rad", "deg"):
        return replace(part, unit=options["angle_unit"] or part.unit)
    return part


def _frame_with_options(recording: Recording, frame: FrameSource, options: dict[str, Any]) -> FrameSource:
    position, *turns = [_part_with_options(recording, source, options) for source in frame.sources]
    turn = turns[0] if turns else None
    return replace(
        frame,
        representation=turn.representation if turn else frame.representation,
        unit=position.unit,
        angle_unit=turn.unit if turn else frame.angle_unit,
        moving=frame.moving or frame.name in options["moving"],
    )


def _is_answered(question: Question, options: dict[str, Any]) -> bool:
    option = OPTIONS.get(question.subject)
    return option is not None and options[option.lstrip("-").replace("-", "_")] is not None


def _require_answers(table: Table, questions: Sequence[Question], *, accept: bool) -> None:
    """Ask whether the proposal is accepted; without a terminal, name the options that answer."""
    if accept or not questions:
        return
    answers = list(dict.fromkeys(OPTIONS.get(question.subject, "--settings") for question in questions))
    if is_interactive():
        click.echo(table.to_text(), err=True)
        for question in questions:
            click.echo(f"\n{question.text}", err=True)
        if click.confirm("\nImport as proposed?", err=True):
            return
        raise click.UsageError(f"nothing was written; answer with {', '.join(answers)}")
    texts = " ".join(question.text for question in questions)
    raise InvalidInput(f"{texts} Answer with {', '.join(answers)}, or take what is proposed with --accept")


def _build(
    recordings: Sequence[Recording], settings: BuildSettings, base_frame: str | None
) -> Iterator[tuple[Demonstration, Conversion]]:
    with progress_bar(len(recordings), "recordings") as advance:
        for recording in recordings:
            demo, conversion = build_demonstration(recording, settings)
            yield _with_base_frame(demo, base_frame), conversion
            advance(recording.name)


def _with_base_frame(demo: Demonstration, name: str | None) -> Demonstration:
    """Return a demonstration with the frame in which its rows are, before those of the objects."""
    if name is None:
        return demo
    objects = [given for given in demo.frames if given.is_moving or not given.is_world]
    if any(given.name == name for given in objects):
        raise InvalidInput(f"--base-frame is {name!r}, the name of an object; choose another name")
    world = world_frame(demo.layout.width)
    frames = [frame(name, world.A, world.b), *objects]
    return demonstration(demo.x, demo.period, demo.layout, frames, demo.name)
