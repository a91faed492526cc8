"""A report is one file that holds all it shows, says what it was given, and is there whole or not at all."""

from base64 import b64decode
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure

from pilotfish.cli.output.report import (
    Film,
    Notice,
    ReportFigure,
    Section,
    Table,
    render_report,
    write_report,
)
from pilotfish.errors import InvalidInput
from pilotfish.simulation.films import encode_film

VOID_TAGS = {"meta", "img", "br", "link", "input", "hr"}
EXTERNAL_TAGS = {"script", "link", "iframe", "object", "embed", "base", "form"}
TEXT_PIECES = ("<b>", "</p>", "<!--", "&lt;", "&", '"', "'", "{x}", "a", " ", "é", "✓")
TEXTS = st.lists(st.sampled_from(TEXT_PIECES), min_size=1, max_size=6).map("".join)


class ReportParser(HTMLParser):
    """What a browser would find: tags with attributes, the text in each, and whether all are closed."""

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


def picture() -> ReportFigure:
    figure = Figure(figsize=(2.0, 1.0))
    figure.subplots().plot([0.0, 1.0])
    return ReportFigure(figure, "a line", "a line that rises")


def film() -> Film:
    """Two frames."""
    frames = [np.full((4, 6, 3), grey, np.uint8) for grey in (0, 200)]
    return Film(encode_film(frames), 'a light, "twice"', "a light that <goes> on & off")


def test_every_tag_is_closed_and_nothing_is_fetched():
    """The page is well formed, has no script, and names no address; its pictures and films are inside."""
    parts = ("words", Notice("mind"), Table("t", ("a", "b"), (("1", "2"),)), picture(), film())
    text = render_report("title", [Section("one", parts), Section("two", (picture(),))])
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


def test_pictures_are_whole_and_described():
    """Each image is a PNG with a width, a height and the alternative text that was given."""
    reader = ReportParser(render_report("title", [Section("one", (picture(),))]))
    (image,) = (attrs for tag, attrs in reader.tags if tag == "img")
    data = b64decode((image["src"] or "").partition(",")[2], validate=True)
    assert data.startswith(b"\x89PNG")
    assert data.endswith(b"IEND\xaeB\x60\x82")
    assert (image["width"], image["height"]) == ("192", "96")  # CSS has 96 points to the inch
    assert image["alt"] == "a line that rises"
    assert reader.texts["figcaption"] == ["a line"]


def test_films_are_whole_and_described():
    """A film is an image that browsers play: the bytes that were given, the alternative text, the caption."""
    reader = ReportParser(render_report("title", [Section("one", (picture(), film(), film()))]))
    films = [attrs for tag, attrs in reader.tags if tag == "img" and "webp" in (attrs["src"] or "")]
    assert len(films) == 2
    for attrs in films:
        kind, _, data = (attrs["src"] or "").partition(",")
        assert kind == "data:image/webp;base64"
        assert b64decode(data, validate=True) == film().webp
        assert attrs["alt"] == "a light that <goes> on & off"
    assert reader.texts["figcaption"] == ["a line", *['a light, "twice"'] * 2]
    assert reader.open == []


def test_the_policy_of_the_page_lets_films_be_shown():
    """Images from data addresses are allowed, nothing else is fetched."""
    (policy,) = (
        attrs["content"] or ""
        for tag, attrs in ReportParser(render_report("title", [Section("one", (film(),))])).tags
        if tag == "meta" and attrs.get("http-equiv") == "Content-Security-Policy"
    )
    assert "default-src 'none'" in policy
    assert "img-src data:;" in policy


def test_the_contents_lead_to_every_section():
    """Each link of the contents names a section that is there, in order."""
    sections = [Section(heading, ("words",)) for heading in ("one", "two", "one")]
    reader = ReportParser(render_report("title", sections))
    links = [(attrs["href"] or "")[1:] for tag, attrs in reader.tags if tag == "a"]
    places = [attrs["id"] for tag, attrs in reader.tags if tag == "section"]
    assert links == places
    assert len(set(places)) == 3


@given(TEXTS, TEXTS, st.lists(st.tuples(TEXTS, TEXTS), min_size=1, max_size=4))
def test_any_text_is_shown_as_it_was_given(title: str, words: str, cells: list[tuple[str, str]]):
    """Angle brackets, quotes and ampersands are text, wherever they stand."""
    parts = (words, Notice(words), Table(words, ("a", words), tuple(cells)))
    reader = ReportParser(render_report(title, [Section(words, parts)]))
    assert reader.open == []
    assert reader.texts["h1"] == [title]
    assert reader.texts["h2"] == [words]
    assert reader.texts["p"] == [words, words]
    assert reader.texts["caption"] == [words]
    assert reader.texts["td"] == [second for _, second in cells]
    assert reader.texts["th"][2:] == [first for first, _ in cells]


def test_braces_are_text_too():
    """Text that looks like a format is not one."""
    reader = ReportParser(render_report("{title}", [Section("{0.body}", ("{",))]))
    assert (reader.texts["h1"], reader.texts["h2"], reader.texts["p"]) == (["{title}"], ["{0.body}"], ["{"])


def test_a_report_that_fails_leaves_the_one_before(tmp_path: Path):
    """When a picture cannot be made, what stood at the path stays and nothing lies beside it."""

    class Broken(Figure):
        def savefig(self, *_: object, **__: object) -> None:
            raise OSError("no ink")

    path = tmp_path / "report.html"
    write_report(path, "first", [Section("one", ("words",))])
    before = path.read_bytes()
    broken = ReportFigure(Broken(), "caption", "alt")
    with pytest.raises(InvalidInput, match="cannot be written"):
        write_report(path, "second", [Section("one", (broken,))])
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_the_same_report_has_the_same_bytes(tmp_path: Path):
    """No date and no random name is written into it."""
    for name in ("a.html", "b.html"):
        write_report(tmp_path / name, "title", [Section("one", (picture(),))])
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()


def test_ragged_tables_and_pictures_without_words_are_refused():
    """A row has a cell for each column; a picture and a film can be told in words."""
    with pytest.raises(InvalidInput, match="row 1 of table 't' has 3 cells, its head 2"):
        Table("t", ("a", "b"), (("1", "2"), ("1", "2", "3")))
    with pytest.raises(InvalidInput, match="'a line' has no alt text"):
        ReportFigure(picture().figure, "a line", "  ")
    with pytest.raises(InvalidInput, match="the film 'a light' has no alt text: say in words what it shows"):
        Film(film().webp, "a light", "\n")
