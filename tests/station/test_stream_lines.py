"""Rows as they arrive: however they come, the same datapoints and the same refusals."""

import io
import json
import os
import threading
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import example, given, settings
from hypothesis import strategies as st

from pilotfish.demonstrations import position_layout
from pilotfish.errors import InvalidInput
from pilotfish.models import online
from pilotfish.station import stream_lines
from pilotfish.station.command_line import cli
from pilotfish.station.stream_lines import (
    LARGEST,
    Break,
    Columns,
    Piece,
    Quiet,
    Refusal,
    Rows,
    chunks,
    lines,
    one_by_one,
    pieces,
    row_of,
    rows_at_once,
)
from pilotfish.station.stream_pieces import cuts, first_rows, in_batches

WORDS = st.sampled_from(
    [
        "1",
        "-0.5",
        "1e3",
        ".25",
        "+7",
        "1_0",
        "nan",
        "inf",
        "-inf",
        "1e101",
        "1e999",
        "x",
        "",
        "#",
        "٣",
        "0x1",
        "\t2",
    ]
)
GAPS = st.sampled_from([",", ", ", " ,", " ", "  ", "\t", ",,"])
LINE = st.lists(st.tuples(WORDS, GAPS), max_size=4).map(lambda parts: "".join(w + g for w, g in parts))
GOOD = st.lists(st.sampled_from(["1,2", "3 4", "-5, 6e-3", " 7\t8 "]), min_size=1, max_size=40)
TEXT = st.lists(LINE | st.sampled_from(["1,2", "3 4", "", "# no"]), max_size=40).map("\n".join)


def never() -> int:
    return 0


def said(text: bytes, cut: list[int], width: int | None = None) -> list[Piece]:
    """The pieces of a text that comes in chunks cut there."""
    ends = sorted({n % (len(text) + 1) for n in cut} | {len(text)})
    arriving = (text[a:b] for a, b in zip([0, *ends], ends, strict=False))
    return list(pieces(lines(arriving, never), width))


def flat(told: list[Piece]) -> list[object]:
    """Rows one by one, everything else as it is, and no silences."""
    out: list[object] = []
    for piece in told:
        if isinstance(piece, Rows):
            out += [tuple(row) for row in piece.x.tolist()]
        elif not isinstance(piece, Quiet):
            out.append(piece)
    return out


@given(text=TEXT, cut=st.lists(st.integers(0, 400), max_size=6), width=st.sampled_from([None, 2]))
def test_it_makes_no_difference_how_lines_are_cut_into_chunks(text: str, cut: list[int], width: int | None):
    """In the middle of a number, of a letter, of a line's end: rows, breaks and refusals are the same."""
    expected = said(text.encode(), [], width)
    for data in (text.encode(), text.replace("\n", "\r\n").encode()):
        told = said(data, cut, width)
        for kinds in ((Rows, Break, Refusal), (Columns,)):
            assert flat([p for p in told if isinstance(p, kinds)]) == flat(
                [p for p in expected if isinstance(p, kinds)]
            )


@given(whole=st.lists(LINE, min_size=1, max_size=30) | GOOD)
def test_lines_read_at_once_are_those_read_one_by_one(whole: list[str]):
    """Two ways to read rows agree wherever the quick one answers; and it answers when all rows are plain."""
    data = [line.encode() for line in whole]
    for width in (1, 2, 3):
        x, told = rows_at_once(data, width), list(one_by_one(data, 0, width))
        if x is not None:
            assert flat([Rows(x)]) == flat(told)
            assert len(x) == len(data)
    plain = [
        ",".join(line.replace(",", " ").split())
        for line in whole
        if all(c in "0123456789,. e-" for c in line)
    ]
    plain = [
        line for line in plain if len(line.split(",")) == 2 and isinstance(row_of(line.encode(), 2), list)
    ]
    if plain:
        assert rows_at_once([line.encode() for line in plain], 2) is not None


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        (b"1,2", "it has 2 in place of 3 numbers"),
        (b"1,2,3,4", "it has 4 in place of 3 numbers"),
        (b"1,x,3", "column 2 is 'x', expected a number"),
        (b"1,,3", "column 2 is empty"),
        (b"1,2,", "column 3 is empty"),
        (b"1 nan 3", "column 2 is nan, expected a finite number"),
        (b"1,2,-inf", "column 3 is -inf"),
        (b"1,2,1e101", "column 3 is 1e+101, expected a finite number of at most 1e+100"),
        (b"1,2,1_0", "column 3 is '1_0'"),
        (b"1;2;3", "column 1 is '1;2;3'"),
        (b"1,2,\xff\xfe", "column 3 is '\\ufffd"),
    ],
)
def test_a_line_that_is_no_datapoint_is_refused_with_the_reason(line: bytes, reason: str):
    """Which column, what stands there, what was expected."""
    told = row_of(line, 3)
    assert isinstance(told, str)
    assert reason in told.replace("\ufffd", "\\ufffd")


@pytest.mark.parametrize("value", [LARGEST, np.nextafter(LARGEST, np.inf)])
def test_what_is_too_large_for_a_line_is_too_large_for_a_model(value: float):
    """One limit, kept in two places."""
    model = online.online_model(online.DPGMM(1.0, 1.0), position_layout(1), 0.1)
    learned = True
    try:
        online.observe(model, np.array([value]))
    except InvalidInput:
        learned = False
    assert isinstance(row_of(repr(float(value)).encode(), 1), list) == learned


def test_a_first_line_of_names_is_a_header():
    """Of names with commas or blanks; quotes, byte order marks, comments and blank lines are no matter."""
    assert flat(said(b"x\ry,z\n1,2\n", []))[1:] == [
        Refusal(1, "column 1 is 'x', expected a number such as 0.25"),
        (1.0, 2.0),
    ]
    for text in ("x,y\n1,2", "x y\n1 2", '"x", y\n1,2', "\ufeffx,y\n1,2", "# rows\n\nx,y\n1,2"):
        assert flat(said(text.encode(), [])) == [Columns(2, ("x", "y")), (1.0, 2.0)]
    reason = "column 2 is 'y', expected a number such as 0.25"
    assert flat(said(b"1,y\n1,2\n", [])) == [Columns(2), Refusal(1, reason), (1.0, 2.0)]
    assert flat(said(b"1,2\n5,y", [])) == [Columns(2), (1.0, 2.0), Refusal(2, reason)]
    assert flat(said("\ufeff1,2".encode(), [])) == [Columns(2), (1.0, 2.0)]


def test_a_blank_line_is_a_break_and_a_comment_is_nothing():
    """Lines are counted, whatever they hold; the last needs no end."""
    text = b"1,2\n\n# here\n3,4\n  \t\n5\n6,7"
    refusal = Refusal(6, "it has 1 in place of 2 numbers")
    expected = [Columns(2), (1.0, 2.0), Break(), (3.0, 4.0), Break(), refusal, (6.0, 7.0)]
    assert flat(said(text, [])) == expected


def test_many_lines_that_are_there_are_one_piece():
    """A pipe that is full costs a call for its chunk, not for each row; a bad line among them, a few more."""
    text = b"1,2\n" * 1000
    assert [type(piece) for piece in said(text, [], 2)] == [Rows]
    told = said(text + b"x\n" + text, [], 2)
    assert len(flat(told)) == 2001
    assert len(told) < 40


def test_a_line_without_end_is_refused_before_it_fills_the_memory(monkeypatch: pytest.MonkeyPatch):
    """What is no text of rows ends the stream."""
    monkeypatch.setattr(stream_lines, "LONGEST", 100)
    with pytest.raises(InvalidInput, match="more than 100 bytes"):
        list(lines([b"1" * 60, b"1" * 60], never))


def test_a_line_that_a_stop_cut_is_dropped():
    """1.25 of which only 1.2 came is not 1.2; at the end of a file it is a line."""
    assert list(lines([b"1\n1.2"], lambda: 2)) == [[b"1"]]
    assert list(lines([b"1\n1.2"], never)) == [[b"1"], [b"1.2"]]


def test_a_slow_pipe_is_read_line_by_line_and_a_quick_one_in_chunks(monkeypatch: pytest.MonkeyPatch):
    """Whoever waits gets what is there; silence is told, so that someone may look at the clock."""
    monkeypatch.setattr(stream_lines, "PATIENCE", 0.01)
    reading, writing = os.pipe()
    arriving = chunks(reading, never)
    for line in (b"1,2\n", b"3,"):
        os.write(writing, line)
        assert next(data for data in arriving if data) == line
    assert next(arriving) == b""
    os.write(writing, b"4\n" * 3)
    os.write(writing, b"5\n")
    assert next(data for data in arriving if data) == b"4\n4\n4\n5\n"
    os.close(writing)
    assert list(arriving) == []
    os.close(reading)


def test_a_reader_that_waits_hears_a_stop(monkeypatch: pytest.MonkeyPatch):
    """Within its patience."""
    monkeypatch.setattr(stream_lines, "PATIENCE", 0.01)
    reading, writing = os.pipe()
    asked = threading.Event()
    threading.Timer(0.05, asked.set).start()
    assert set(chunks(reading, lambda: int(asked.is_set()))) <= {b""}
    os.close(reading)
    os.close(writing)


def rows_of(sizes: list[int]) -> Iterator[Piece]:
    """Numbered rows in pieces of these sizes; a break for each -1."""
    n = 0
    for size in sizes:
        if size < 0:
            yield Break()
        else:
            yield Rows(np.arange(n, n + size, dtype=np.float64)[:, None])
            n += size


SIZES = st.lists(st.integers(-1, 12), max_size=12)


@given(sizes=SIZES, batch=st.integers(1, 5))
def test_rows_are_handed_on_in_whole_batches_however_they_came(sizes: list[int], batch: int):
    """Batches begin at breaks; none is lost, none waits when there is no more."""
    told = list(in_batches(rows_of(sizes), batch))
    assert flat(told) == flat(list(rows_of(sizes)))
    for piece, after in zip(told, [*told[1:], Break()], strict=False):
        if isinstance(piece, Rows) and not isinstance(after, Break):
            assert len(piece.x) % batch == 0


@given(sizes=SIZES, most=st.integers(1, 20))
def test_no_more_rows_come_than_were_wanted_and_nothing_after_them(sizes: list[int], most: int):
    """The first so many, and the breaks between."""
    told = flat(list(first_rows(rows_of(sizes), most)))
    everything = flat(list(rows_of(sizes)))
    assert told == everything[: len(told)]
    rows = [piece for piece in told if not isinstance(piece, Break)]
    assert len(rows) == min(most, sum(size for size in sizes if size > 0))
    assert len(rows) < most or told[-1] == rows[-1]


@given(
    rows=st.integers(0, 60),
    before=st.integers(0, 30),
    every=st.none() | st.integers(1, 20),
    batch=st.integers(1, 7),
)
def test_cuts_keep_batches_whole_and_end_where_a_line_is_due(
    rows: int, before: int, every: int | None, batch: int
):
    """Every cut but the last is of whole batches, and none goes on behind a multiple that is due."""
    cut = list(cuts(rows, before, every, batch))
    assert [n for piece in cut for n in range(piece.start, piece.stop)] == list(range(rows))
    assert all((piece.stop - piece.start) % batch == 0 for piece in cut[:-1])
    for piece in cut if every else []:
        passed = (before + piece.stop) // every - (before + piece.start) // every
        assert passed <= max(1, -(-batch // every))


def test_standard_input_that_is_closed_is_refused(monkeypatch: pytest.MonkeyPatch):
    """None at all, or one that is no file."""
    for closed in (None, io.StringIO("1,2")):
        monkeypatch.setattr("sys.stdin", closed)
        with pytest.raises(InvalidInput, match="standard input is closed"):
            stream_lines.standard_input()


@pytest.mark.parametrize("source", ["none.csv", "dataset:vale"])
def test_a_source_that_is_not_there_is_named(refusal: Callable[..., str], source: str):
    """With what would be one."""
    told = refusal("stream", source, "--learner", "dp-gmm", "--cluster", "1", "--noise", "1")
    assert source.removeprefix("dataset:") in told


@given(data=st.binary(max_size=200) | st.text("0123456789.,- e\n#xna", max_size=200).map(str.encode))
@settings(max_examples=100)
@example(b"\x00\r,")
def test_any_bytes_are_learned_or_refused(tmp_path_factory: pytest.TempPathFactory, data: bytes):
    """Whatever comes, the command ends with an answer or one line."""
    path = tmp_path_factory.mktemp("any") / "rows"
    path.write_bytes(data)
    result = CliRunner().invoke(
        cli, ["stream", str(path), "--learner", "dp-gmm", "--cluster", "1", "--noise", "1", "--json"]
    )
    assert result.exit_code in (0, 1)
    assert result.exception is None or isinstance(result.exception, SystemExit)
    if result.exit_code == 0:
        assert json.loads(result.stdout)["observed"] > 0
    else:
        assert result.stderr.startswith("Error: ")
        assert result.stderr.count("\n") == 1
