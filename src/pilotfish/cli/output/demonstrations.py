"""Demonstrations as a table and as JSON."""

from collections.abc import Sequence

from pilotfish.cli.output.skill_descriptions import format_columns
from pilotfish.cli.output.tables import Table
from pilotfish.demonstrations import Demonstration


def demonstration_blocks(demonstrations: Sequence[Demonstration]) -> list[str | Table]:
    """Return a table of demonstrations and their columns.

    Args:
        demonstrations: At least one; all have the columns of the first.
    """
    rows = [
        (str(m), demo.name, str(len(demo.x)), f"{len(demo.x) * demo.period:.4g}", _format_frames(demo))
        for m, demo in enumerate(demonstrations)
    ]
    table = Table(("number", "name", "steps", "duration [s]", "frames"), tuple(rows))
    return [table, f"columns: {format_columns(demonstrations[0].layout)}"]


def demonstration_to_json(demo: Demonstration) -> dict[str, object]:
    """Return a description of a demonstration as a JSON object.

    Args:
        demo: Demonstration.
    """
    return {
        "name": demo.name,
        "steps": len(demo.x),
        "period": demo.period,
        "columns": list(demo.layout.names),
        "units": list(demo.layout.units),
        "frames": [frame.name for frame in demo.frames],
    }


def _format_frames(demo: Demonstration) -> str:
    return ", ".join(f"{f.name} (moving)" if f.is_moving else f.name for f in demo.frames)
