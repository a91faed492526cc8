"""HTML reports: one file that contains its figures, films and style, and needs no network and no script.

The page follows the reader's light or dark theme and prints on white. On a phone, wide figures and tables
scroll sideways by themselves. The template is report.html beside this file; it escapes all text.
"""

from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

from pilotfish.cli.output.tables import Table
from pilotfish.errors import InvalidInput
from pilotfish.io import atomic_file
from pilotfish.validation import shorten_repr

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DOTS_PER_INCH = 160
CSS_PIXELS_PER_INCH = 96


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Image:
    """Image or film with a caption and a text alternative.

    Attributes:
        data: Content of a PNG or WebP file.
        media_type: image/png or image/webp; browsers repeat an animated WebP.
        caption: Text below the image.
        alt: Description for readers who cannot see the image; not blank.
        size: Width and height [CSS pixels]; None takes those of the file.
    """

    data: bytes
    media_type: str
    caption: str
    alt: str
    size: tuple[int, int] | None = None

    def __post_init__(self) -> None:
        if not self.alt.strip():
            raise InvalidInput(f"image {self.caption!r} has no alt text; describe what it shows")

    def to_data_url(self) -> str:
        """Return the image as a data URL."""
        return f"data:{self.media_type};base64,{b64encode(self.data).decode('ascii')}"


@dataclass(frozen=True, slots=True)
class Section:
    """Section of a report.

    Attributes:
        heading: Heading of the section.
        parts: Paragraphs, tables and images.
        notice: Highlighted paragraph at the beginning; empty for none.
    """

    heading: str
    parts: tuple[str | Table | Image, ...]
    notice: str = ""


def figure_image(figure: "Figure", caption: str, alt: str) -> Image:
    """Render a matplotlib figure as an image; the bytes are the same in every run.

    Args:
        figure: Figure to render.
        caption: Text below the image.
        alt: Text alternative.

    Returns:
        A PNG image in the size of the figure.
    """
    buffer = BytesIO()
    figure.savefig(buffer, format="png", dpi=DOTS_PER_INCH, metadata={"Software": None})
    width, height = (round(CSS_PIXELS_PER_INCH * float(inches)) for inches in figure.get_size_inches())
    return Image(buffer.getvalue(), "image/png", caption, alt, (width, height))


def write_report(
    path: str | Path, title: str, sections: Sequence[Section], *, overwrite: bool = True
) -> None:
    """Write a report to an HTML file.

    Args:
        path: File to write.
        title: Title of the page.
        sections: Sections in order.
        overwrite: Whether an existing file is replaced.

    Raises:
        InvalidInput: If the file cannot be written, or exists and overwrite is False.
    """
    with atomic_file(path, overwrite=overwrite) as part:
        part.write_text(render_report(title, sections), encoding="utf-8")


def render_report(title: str, sections: Sequence[Section]) -> str:
    """Return a report as HTML."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=StrictUndefined,
        keep_trailing_newline=True,
    )
    return environment.get_template("report.html").render(title=title, sections=sections)
