"""Tables of text cells: one value for pipes, terminals and HTML reports."""

from collections.abc import Sequence
from dataclasses import dataclass
from io import StringIO

from pilotfish.errors import InvalidInput, escape


@dataclass(frozen=True, slots=True)
class Table:
    """Table of text cells; the first column names the rows.

    Attributes:
        header: Name of each column; empty for a list of keys and values.
        rows: Cells of each row, as many as the header has.
        caption: Title of the table; empty if the context says what the table contains.
        right_aligned: Whether all columns but the first are aligned to the right, as numbers are.
    """

    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    caption: str = ""
    right_aligned: bool = False

    def __post_init__(self) -> None:
        for n, row in enumerate(self.rows):
            if self.header and len(row) != len(self.header):
                raise InvalidInput(
                    f"row {n} of table {self.caption!r} has {len(row)} cells, expected {len(self.header)} as "
                    "in the header"
                )

    def to_text(self, width: int | None = None) -> str:
        """Return the table as text.

        Args:
            width: Columns of a terminal: the header is then set in bold, and wide cells are wrapped.
                None returns plain text, one line per row.
        """
        if width is not None and self.header:
            return self._to_terminal_text(width)
        lines = [[escape(cell) for cell in row] for row in (self.header, *self.rows) if row]
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        text = ["  ".join(map(self._align, line, widths, range(len(widths)))).rstrip() for line in lines]
        return "\n".join([self.caption, *text] if self.caption else text)

    def _align(self, cell: str, width: int, column: int) -> str:
        return cell.rjust(width) if self.right_aligned and column else cell.ljust(width)

    def _to_terminal_text(self, width: int) -> str:
        from rich.console import Console
        from rich.table import Table as RichTable
        from rich.text import Text

        table = RichTable(box=None, pad_edge=False, padding=(0, 1), header_style="bold")
        for column, name in enumerate(self.header):
            table.add_column(Text(escape(name)), no_wrap=not column, overflow="fold")
            if self.right_aligned and column:
                table.columns[-1].justify = "right"
        for row in self.rows:
            table.add_row(*(Text(escape(cell)) for cell in row))
        console = Console(file=StringIO(), force_terminal=True, width=width)
        with console.capture() as capture:
            console.print(table)
        text = "\n".join(line.rstrip() for line in capture.get().splitlines())
        return f"{self.caption}\n{text}" if self.caption else text


def key_value_table(rows: Sequence[tuple[str, str]]) -> Table:
    """Return a table without a header: a key and a value in each row."""
    return Table((), tuple(rows))
