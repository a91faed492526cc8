"""HTML reports are self-contained, escape all text, and are written completely or not at all."""

from base64 import b64decode
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure

from pilotfish.cli.output.html_report import Image, Section, figure_image, render_report, write_report
from pilotfish.cli.output.tables import Table
from pilotfish.errors import InvalidInput
from pilotfish.simulation.films import encode_film

VOID_TAGS = {"meta", "img", "br", "link", "input", "hr"}
EXTERNAL_TAGS = {"script", "link", "iframe", "object", "embed", "base", "form"}
TEXT_PIECES = ("<b>", "</p>", "<!--", "&lt;", "&", '"', "'", "{x}", "a", " ", "é", "✓")
TEXTS = st.lists(st.sampled_from(TEXT_PIECES), min_size=1, max_size=6).map("".join)


class ReportParser(HTMLParser):
    """Parse tags with attributes, the text in each, and the tags that are not closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.texts: dict[str, list[str]] = {}
        self.open: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        self.texts.setdefault(tag, []).append("")
        if tag not in VOID_TAGS:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open:
            self.texts[self.open[-1]][-1] += data


def line_image() -> Image:
    figure = Figure(figsize=(2.0, 1.0))
    figure.subplots().plot([0.0, 1.0])
    return figure_image(figure, "a line", "a line that rises")


def film_image() -> Image:
    frames = [np.full((4, 6, 3), grey, np.uint8) for grey in (0, 200)]
    return Image(encode_film(frames), "image/webp", 'a light, "twice"', "a light that <goes> on & off")


def test_report_is_well_formed_and_self_contained():
    parts = ("words", Table(("a", "b"), (("1", "2"),), "t"), line_image(), film_image())
    text = render_report("title", [Section("one", parts, "notice"), Section("two", (line_image(),))])
    reader = ReportParser(text)
    assert reader.open == []
    assert not EXTERNAL_TAGS & {tag for tag, _ in reader.tags}
    addresses = [
        value or "" for _, attrs in reader.tags for key, value in attrs.items() if key in {"src", "href"}
    ]
    assert addresses
    inside = "#", "data:image/png;base64,", "data:image/webp;base64,"
    assert all(address.startswith(inside) for address in addresses)
    assert "http:" not in text.replace("http-equiv", "")
    assert "https:" not in text
    assert "url(" not in text
    assert "@import" not in text


def test_figure_image_is_embedded_png():
    reader = ReportParser(render_report("title", [Section("one", (line_image(),))]))
    (image,) = (attrs for tag, attrs in reader.tags if tag == "img")
    data = b64decode((image["src"] or "").partition(",")[2], validate=True)
    assert data.startswith(b"\x89PNG")
    assert data.endswith(b"IEND\xaeB\x60\x82")
    assert (image["width"], image["height"]) == ("192", "96")  # CSS has 96 points to the inch
    assert image["alt"] == "a line that rises"
    assert reader.texts["figcaption"] == ["a line"]


def test_film_image_is_embedded_webp():
    reader = ReportParser(
        render_report("title", [Section("one", (line_image(), film_image(), film_image()))])
    )
    films = [attrs for tag, attrs in reader.tags if tag == "img" and "webp" in (attrs["src"] or "")]
    assert len(films) == 2
    for attrs in films:
        kind, _, data = (attrs["src"] or "").partition(",")
        assert kind == "data:image/webp;base64"
        assert b64decode(data, validate=True) == film_image().data
        assert attrs["alt"] == "a light that <goes> on & off"
    assert reader.texts["figcaption"] == ["a line", *['a light, "twice"'] * 2]
    assert reader.open == []


def test_report_content_security_policy_allows_images():
    (policy,) = (
        attrs["content"] or ""
        for tag, attrs in ReportParser(render_report("title", [Section("one", (film_image(),))])).tags
        if tag == "meta" and attrs.get("http-equiv") == "Content-Security-Policy"
    )
    assert "default-src 'none'" in policy
    assert "img-src data:;" in policy


def test_report_contents_link_to_sections():
    sections = [Section(heading, ("words",)) for heading in ("one", "two", "one")]
    reader = ReportParser(render_report("title", sections))
    links = [(attrs["href"] or "")[1:] for tag, attrs in reader.tags if tag == "a"]
    places = [attrs["id"] for tag, attrs in reader.tags if tag == "section"]
    assert links == places
    assert len(set(places)) == 3


@given(TEXTS, TEXTS, st.lists(st.tuples(TEXTS, TEXTS), min_size=1, max_size=4))
def test_report_escapes_any_text(title: str, words: str, cells: list[tuple[str, str]]):
    parts = (words, Table(("a", words), tuple(cells), words))
    reader = ReportParser(render_report(title, [Section(words, parts, words)]))
    assert reader.open == []
    assert reader.texts["h1"] == [title]
    assert reader.texts["h2"] == [words]
    assert reader.texts["p"] == [words, words]
    assert reader.texts["caption"] == [words]
    assert reader.texts["td"] == [second for _, second in cells]
    assert reader.texts["th"][2:] == [first for first, _ in cells]


def test_report_braces_are_text():
    reader = ReportParser(render_report("{title}", [Section("{0.body}", ("{",))]))
    assert (reader.texts["h1"], reader.texts["h2"], reader.texts["p"]) == (["{title}"], ["{0.body}"], ["{"])


def test_failing_report_keeps_previous_file(tmp_path: Path):

    class Broken(Image):
        def to_data_url(self) -> str:
            raise OSError("no space")

    path = tmp_path / "report.html"
    write_report(path, "first", [Section("one", ("words",))])
    before = path.read_bytes()
    with pytest.raises(InvalidInput, match="cannot be written"):
        write_report(path, "second", [Section("one", (Broken(b"", "image/png", "caption", "alt"),))])
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_report_twice_has_same_bytes(tmp_path: Path):
    for name in ("a.html", "b.html"):
        write_report(tmp_path / name, "title", [Section("one", (line_image(),))])
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()


def test_ragged_table_and_missing_alt_are_rejected():
    with pytest.raises(InvalidInput, match="row 1 of table 't' has 3 cells, expected 2"):
        Table(("a", "b"), (("1", "2"), ("1", "2", "3")), "t")
    for alt in ("  ", "\n"):
        with pytest.raises(InvalidInput, match="image 'a line' has no alt text; describe what it shows"):
            Image(line_image().data, "image/png", "a line", alt)
