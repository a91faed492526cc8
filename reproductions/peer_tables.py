"""Tables of the comparison with peers: plain text, and Markdown between two marks of a page."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pilotfish as pf

BEGIN, END = "<!-- tables of reproductions/peers.py -->", "<!-- end of the tables -->"
Row = Mapping[str, Any]  # recording, method, unit, and the fields of Measures


def print_table(rows: Sequence[Row]) -> None:
    """Print rows, with the smallest distances of each recording marked by a star."""
    print(
        f"{'recording':<32}{'method':<16}{'mean':>10}{'DTW':>10}{'end':>9}{'unit':>6}"
        f"{'angle [deg]':>13}{'size [%]':>10}{'force [%]':>11}{'fit [CPU s]':>13}"
    )
    for row in rows:
        stars = ["*" if is_best(row, name, rows) else " " for name in ("mean", "warped")]
        cells = (
            f"{row['recording']:<32}{row['method']:<16}",
            f"{row['mean']:>9.2f}{stars[0]}{row['warped']:>9.2f}{stars[1]}{row['end']:>9.2f}{row['unit']:>6}",
            f"{format_number(row['degrees']):>13}{row['size']:>10.1f}{format_number(row['force']):>11}",
            f"{row['seconds']:>13.4f}",
        )
        print("".join(cells))


def format_number(value: float | None) -> str:
    """Return two digits after the point; nothing for a missing value."""
    return "" if value is None else f"{value:.2f}"


def is_best(row: Row, name: str, rows: Sequence[Row]) -> bool:
    """Return whether no method has a smaller value for the same recording."""
    return bool(row[name] == min(other[name] for other in rows if other["recording"] == row["recording"]))


def markdown_tables(rows: Sequence[Row]) -> str:
    """Return one table for each pair of measures, with one line per recording and one column per method."""

    def distances(row: Row) -> str:
        cells = (
            f"**{row[n]:.2f}**" if is_best(row, n, rows) else f"{row[n]:.2f}" for n in ("mean", "warped")
        )
        return " / ".join(cells)

    def end_and_size(row: Row) -> str:
        return f"{row['end']:.2f} / {row['size']:.0f}"

    def angle_or_force(row: Row) -> str:
        return format_number(row["force"] if row["degrees"] is None else row["degrees"])

    def seconds(row: Row) -> str:
        return f"{row['seconds'] * 1e3:.1f}"

    def distance_unit(row: Row) -> str:
        return str(row["unit"])

    def angle_or_force_unit(row: Row) -> str:
        return "deg" if row["force"] is None else "%"

    others = [row for row in rows if angle_or_force(row)]
    parts = [
        ("Mean distance / distance after dynamic time warping", rows, distances, distance_unit),
        ("Distance of the end points / size [%]", rows, end_and_size, distance_unit),
        ("Angle between orientations, force error of letters", others, angle_or_force, angle_or_force_unit),
        ("Time of learning", rows, seconds, lambda _: "CPU ms"),
    ]
    return "\n\n".join(
        f"### {title}\n\n{markdown_table(chosen, cell, unit)}"
        for title, chosen, cell, unit in parts
        if chosen
    )


def markdown_table(rows: Sequence[Row], cell: Callable[[Row], str], unit: Callable[[Row], str]) -> str:
    """Return a table with one line per recording and one column per method."""
    methods = list(dict.fromkeys(row["method"] for row in rows))
    lines = [
        f"| recording | {' | '.join(methods)} |",
        f"| --- |{' ---: |' * len(methods)}",
    ]
    for recording in dict.fromkeys(row["recording"] for row in rows):
        cells = {row["method"]: cell(row) for row in rows if row["recording"] == recording}
        first = next(row for row in rows if row["recording"] == recording)
        lines.append(f"| {recording} [{unit(first)}] | {' | '.join(cells[method] for method in methods)} |")
    return "\n".join(lines)


def replace_tables(page: Path, tables: str) -> None:
    """Replace what is between the two marks of a page.

    Raises:
        InvalidInput: If the page does not have the marks in this order.
    """
    text = page.read_text(encoding="utf-8")
    head, begin, rest = text.partition(BEGIN)
    _, end, tail = rest.partition(END)
    if not (begin and end):
        raise pf.InvalidInput(f"{page} has no tables to replace, expected lines {BEGIN!r} and {END!r}")
    page.write_text(f"{head}{BEGIN}\n\n{tables}\n\n{END}{tail}", encoding="utf-8")
