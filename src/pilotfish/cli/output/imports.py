"""Results of `data import`: what columns become, what is left out, and what was converted."""

from collections.abc import Container, Sequence
from pathlib import Path
from textwrap import fill
from typing import Any

from pilotfish.cli.output.demonstrations import demonstration_blocks, demonstration_to_json
from pilotfish.cli.output.diagnostics import format_diagnostic
from pilotfish.cli.output.results import CommandResult
from pilotfish.cli.output.tables import Table
from pilotfish.demonstrations import (
    BuildSettings,
    Conversion,
    Demonstration,
    PartSource,
    Quantity,
    Question,
    Recording,
    column_names,
    diagnose,
    select_columns,
)

ORIENTATIONS = (Quantity.QUATERNION, Quantity.ORIENTATION)
WIDTH = 110  # characters of a line of names
NUMBER = "1"  # unit of plain numbers


def settings_table(recording: Recording, settings: BuildSettings, chosen: Container[str]) -> Table:
    """Return a table of what columns become.

    Args:
        recording: First recording.
        settings: Columns of parts and frames.
        chosen: Units that the user stated.
    """
    given = [(part.name, part.quantity.value, part) for part in settings.parts]
    for frame in settings.frames:
        kind = "moving frame" if frame.moving else "frame"
        given += [(frame.name, kind, source) for source in frame.sources]
    rows = [
        (name, kind, ", ".join(source.columns), _unit(recording, source, chosen), _form(source))
        for name, kind, source in given
    ]
    return Table(("name", "becomes", "columns", "unit", "form"), tuple(rows), "Columns")


def _unit(recording: Recording, source: PartSource, chosen: Container[str]) -> str:
    """Return the unit of columns, and whether nobody stated it."""
    if stated := stated_units(recording, source):
        return ", ".join(stated)
    unit = source.unit or source.expected_dimension
    is_known = unit in ("", NUMBER) or source.unit in chosen
    return (source.unit if unit == NUMBER else unit) if is_known else f"{unit} (assumed)"


def stated_units(recording: Recording, source: PartSource) -> list[str]:
    """Return the different units that a file states for columns; empty if it states none.

    Args:
        recording: Recording.
        source: Part or pose.
    """
    number, columns = select_columns(recording, source.columns, source.name)
    units = [recording.signals[number].units[column].strip() for column in columns]
    return list(dict.fromkeys(unit for unit in units if unit))


def _form(source: PartSource) -> str:
    return source.representation if source.quantity in ORIENTATIONS else ""


def _settings_to_json(settings: BuildSettings) -> dict[str, Any]:
    return {
        "period": settings.period,
        "parts": [
            {"name": p.name, "quantity": p.quantity.value, "columns": list(p.columns), "form": _form(p)}
            for p in settings.parts
        ],
        "frames": [{"name": frame.name, "moving": frame.moving} for frame in settings.frames],
    }


def proposal(
    recordings: Sequence[Recording],
    settings: BuildSettings,
    table: Table,
    questions: Sequence[Question],
    saved: Path | None,
) -> CommandResult:
    """Return what an import without an output folder proposes.

    Args:
        recordings: Recordings, at least one.
        settings: Proposed settings.
        table: Table of what columns become.
        questions: What the user must decide.
        saved: File of the settings.
    """
    lines = [f"question: {question.text}" for question in questions]
    left_out, notes = _left_out(recordings, settings), _notes(recordings)
    lines += [f"note: {note}" for note in notes]
    lines += _left_out_lines(left_out)
    lines.append(f"written to {saved}; edit it, then import with --settings {saved} --out FOLDER")
    data = {
        "recordings": [recording.name for recording in recordings],
        "format": recordings[0].format,
        **_settings_to_json(settings),
        "left_out": left_out,
        "notes": notes,
        "questions": [question.text for question in questions],
        "settings": str(saved),
    }
    return CommandResult([table, "\n".join(lines)], data)


def import_result(
    recordings: Sequence[Recording],
    settings: BuildSettings,
    table: Table,
    built: Sequence[tuple[Demonstration, Conversion]],
    out: Path,
) -> CommandResult:
    """Return what an import wrote.

    Args:
        recordings: Recordings, at least one.
        settings: Settings of the import.
        table: Table of what columns become.
        built: Demonstrations, and what was converted.
        out: Folder that was written.
    """
    demonstrations = tuple(demo for demo, _ in built)
    conversions = _shared_lines([(demo.name, conversion.lines) for demo, conversion in built])
    left_out, diagnostics = _left_out(recordings, settings), diagnose(demonstrations)
    notes = _notes(recordings)
    findings = [format_diagnostic(diagnostic, out) for diagnostic in diagnostics]
    blocks: list[str | Table] = [
        table,
        *demonstration_blocks(demonstrations),
        "\n".join(conversions) or "Nothing had to be converted.",
        *(["\n".join(f"note: {note}" for note in notes)] if notes else []),
        *_left_out_lines(left_out),
        *(["\n".join(findings)] if findings else []),
        f"written to {out}; next: pilotfish learn {out} --out {out.name}.skill",
    ]
    data = {
        "folder": str(out),
        "format": recordings[0].format,
        **_settings_to_json(settings),
        "demonstrations": [demonstration_to_json(demo) for demo in demonstrations],
        "left_out": left_out,
        "notes": notes,
        "conversions": {demo.name: list(conversion.lines) for demo, conversion in built},
        "labels": {demo.name: {k: list(v) for k, v in c.labels.items()} for demo, c in built},
        "diagnostics": findings,
    }
    return CommandResult(blocks, data)


def _notes(recordings: Sequence[Recording]) -> list[str]:
    """Return the notes of the readers, each once."""
    return list(dict.fromkeys(note for recording in recordings for note in recording.notes))


def _left_out_lines(names: Sequence[str]) -> list[str]:
    """Return all columns that are left out as wrapped text; none if all are used."""
    text = fill(f"columns left out: {', '.join(names)}", WIDTH, subsequent_indent="  ")
    return [text] if names else []


def _left_out(recordings: Sequence[Recording], settings: BuildSettings) -> list[str]:
    """Return the columns of the first recording that become neither a part nor a frame."""
    first, used = recordings[0], set()
    for source in [*settings.parts, *(source for frame in settings.frames for source in frame.sources)]:
        number, columns = select_columns(first, source.columns, source.name)
        used |= {(number, column) for column in columns}
    pairs = [(s, c) for s, signal in enumerate(first.signals) for c in range(len(signal.columns))]
    return [name for pair, name in zip(pairs, column_names(first), strict=True) if pair not in used]


def _shared_lines(lines: Sequence[tuple[str, Sequence[str]]]) -> list[str]:
    """Return each line once, with the recordings that it is about if these are not all."""
    names: dict[str, list[str]] = {}
    for name, given in lines:
        for line in given:
            names.setdefault(line, []).append(name)
    return [
        f"converted: {line}" if len(found) == len(lines) else f"converted, {_count(found)}: {line}"
        for line, found in names.items()
    ]


def _count(names: Sequence[str]) -> str:
    return ", ".join(names) if len(names) <= 3 else f"{', '.join(names[:3])} and {len(names) - 3} more"
