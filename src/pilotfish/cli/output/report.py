"""Reports: one HTML file that holds everything it shows, and needs no network to be read."""

from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from io import BytesIO
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from pilotfish.errors import InvalidInput
from pilotfish.io import atomic_file

DOTS_PER_INCH = 160


@runtime_checkable
class SavableFigure(Protocol):
    """What a report needs of a matplotlib figure."""

    def savefig(self, fname: Any, **options: Any) -> None: ...

    def get_size_inches(self) -> Any: ...


@dataclass(frozen=True, slots=True, eq=False)
class ReportFigure:
    """A figure with a caption, and the words that stand for it where it cannot be seen."""

    figure: SavableFigure
    caption: str
    alt: str

    def __post_init__(self) -> None:
        if not self.alt.strip():
            raise InvalidInput(f"the picture {self.caption!r} has no alt text: say in words what it shows")


@dataclass(frozen=True, slots=True, eq=False)
class Film:
    """A WebP film that plays over and over, with a caption, and the words that stand for it."""

    webp: bytes
    caption: str
    alt: str

    def __post_init__(self) -> None:
        if not self.alt.strip():
            raise InvalidInput(f"the film {self.caption!r} has no alt text: say in words what it shows")


@dataclass(frozen=True, slots=True)
class Table:
    """Cells as text. The first column names the rows."""

    caption: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    def __post_init__(self) -> None:
        for n, row in enumerate(self.rows):
            if len(row) != len(self.header):
                raise InvalidInput(
                    f"row {n} of table {self.caption!r} has {len(row)} cells, its head {len(self.header)}"
                )


@dataclass(frozen=True, slots=True)
class Notice:
    """A sentence that must not be overlooked."""

    text: str


@dataclass(frozen=True, slots=True)
class Section:
    """A heading and what stands under it; plain text is a paragraph."""

    heading: str
    parts: tuple[str | Notice | Table | ReportFigure | Film, ...]


def write_report(
    path: str | Path, title: str, sections: Sequence[Section], *, overwrite: bool = True
) -> None:
    """Writes one HTML file, whole or not at all: pictures and style inside, nothing fetched, no script.

    All text is escaped. It follows the reader's choice of light or dark and prints on white; on a phone,
    wide pictures and tables are moved sideways on their own.
    Raises: InvalidInput, when path cannot be written, or exists and overwrite is False.
    """
    with atomic_file(path, overwrite=overwrite) as part:
        part.write_text(render_report(title, sections), encoding="utf-8")


def render_report(title: str, sections: Sequence[Section]) -> str:
    """The report as text."""
    links = "".join(f'<li><a href="#s{n}">{escape(s.heading)}</a></li>' for n, s in enumerate(sections))
    body = "\n".join(_render_section(n, section) for n, section in enumerate(sections))
    return PAGE_TEMPLATE.format(title=escape(title), style=STYLE, links=links, body=body)


def _render_section(number: int, section: Section) -> str:
    parts = "\n".join(map(_render_part, section.parts))
    return f'<section id="s{number}">\n<h2>{escape(section.heading)}</h2>\n{parts}\n</section>'


def _render_part(part: str | Notice | Table | ReportFigure | Film) -> str:
    match part:
        case str():
            return f"<p>{escape(part)}</p>"
        case Notice():
            return f'<p class="notice" role="note">{escape(part.text)}</p>'
        case Table():
            return _render_table(part)
        case ReportFigure():
            return _render_figure(part)
        case Film():
            return _render_film(part)


def _render_table(table: Table) -> str:
    header = "".join(f'<th scope="col">{escape(cell)}</th>' for cell in table.header)
    rows = "\n".join(
        f'<tr><th scope="row">{escape(first)}</th>{"".join(f"<td>{escape(cell)}</td>" for cell in rest)}</tr>'
        for first, *rest in table.rows
    )
    caption = escape(table.caption)
    return (
        f'<div class="wide" tabindex="0" role="region" aria-label="{caption}"><table>\n'
        f"<caption>{caption}</caption>\n<thead><tr>{header}</tr></thead>\n<tbody>\n{rows}\n</tbody></table></div>"
    )


def _render_figure(picture: ReportFigure) -> str:
    buffer = BytesIO()
    picture.figure.savefig(buffer, format="png", dpi=DOTS_PER_INCH, metadata={"Software": None})
    data = b64encode(buffer.getvalue()).decode("ascii")
    width, height = (round(96 * inches) for inches in picture.figure.get_size_inches())  # CSS: 96 to the inch
    alt, caption = escape(picture.alt), escape(picture.caption)
    return (
        f'<figure><div class="wide" tabindex="0" role="region" aria-label="picture: {caption}">'
        f'<img src="data:image/png;base64,{data}" alt="{alt}" width="{width}" height="{height}"></div>'
        f"<figcaption>{caption}</figcaption></figure>"
    )


def _render_film(film: Film) -> str:
    data = b64encode(film.webp).decode("ascii")
    alt, caption = escape(film.alt), escape(film.caption)
    return (
        f'<figure><div class="wide" tabindex="0" role="region" aria-label="film: {caption}">'
        f'<img src="data:image/webp;base64,{data}" alt="{alt}"></div>'
        f"<figcaption>{caption}</figcaption></figure>"
    )


PAGE_TEMPLATE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<meta http-equiv="Content-Security-Policy"
      content="default-src 'none'; img-src data:; style-src 'unsafe-inline'">
<title>{title}</title>
<style>{style}</style>
</head>
<body>
<main>
<h1>{title}</h1>
<nav aria-label="contents"><ol>{links}</ol></nav>
{body}
</main>
</body>
</html>
"""

STYLE = """
:root { --ink: #1b1f24; --soft: #57606a; --paper: #fdfdfc; --line: #d0d7de;
        --notice: #fff3cd; --link: #0b5cad; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e6e8eb; --soft: #9aa4af; --paper: #15181c; --line: #3a424c;
          --notice: #4d3b00; --link: #7db8f5; }
}
* { box-sizing: border-box; }
body { margin: 0; background: var(--paper); color: var(--ink);
       font: 1rem/1.55 system-ui, -apple-system, "Segoe UI", Roboto, "DejaVu Sans", sans-serif; }
main { max-width: 72rem; margin: 0 auto; padding: 1rem clamp(.8rem, 3vw, 2.5rem) 4rem; }
h1 { font-size: 1.7rem; line-height: 1.25; margin: 1rem 0; }
h2 { font-size: 1.25rem; margin: 2.5rem 0 .6rem; border-top: 1px solid var(--line); padding-top: 1.2rem; }
p { max-width: 46rem; }
a { color: var(--link); }
nav ol { columns: 18rem; column-gap: 2.5rem; padding-left: 1.4rem; margin: 0; }
.notice { background: var(--notice); border-left: .35rem solid #d29922; padding: .7rem 1rem;
          font-weight: 600; overflow-wrap: anywhere; }
.wide { overflow-x: auto; }
figure { margin: 1.2rem 0 1.8rem; }
figure .wide { background: #fff; border: 1px solid var(--line); border-radius: .4rem; padding: .4rem; }
img { display: block; margin: 0 auto; max-width: 100%; height: auto; }
figcaption { color: var(--soft); font-size: .92rem; max-width: 52rem; margin-top: .4rem; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; margin: 1rem 0; }
caption { text-align: left; font-weight: 600; padding-bottom: .4rem; }
th, td { padding: .25rem .8rem; border-bottom: 1px solid var(--line); text-align: right;
         white-space: nowrap; }
thead th { color: var(--soft); font-weight: 600; vertical-align: bottom; white-space: normal; }
th:first-child { text-align: left; padding-left: 0; }
tbody th { font-weight: 400; }
@media screen and (max-width: 46rem) { img { max-width: none; width: 46rem; } }
@media print {
  :root { --ink: #000; --soft: #333; --paper: #fff; --line: #bbb; --notice: #fff3cd; }
  nav { display: none; }
  figure, table { break-inside: avoid; }
  h2 { break-after: avoid; }
  .wide { overflow: visible; }
}
"""
