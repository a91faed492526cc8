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

from pilotfish.cli.main import cli
from pilotfish.cli.stream import split_lines as stream_lines
from pilotfish.cli.stream.batches import batch_slices, regroup_batches, take_rows
from pilotfish.cli.stream.lines import (
    MAX_MAGNITUDE,
    ColumnHeader,
    DemonstrationBreak,
    Idle,
    RejectedLine,
    Rows,
    StreamEvent,
    parse_lines,
    parse_row,
    parse_rows,
    parse_single_lines,
    read_chunks,
    split_lines,
)
from pilotfish.demonstrations import position_layout
from pilotfish.errors import InvalidInput
from pilotfish.models import online

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


def no_signal() -> int:
    return 0


def parse_events(text: bytes, cut: list[int], width: int | None = None) -> list[StreamEvent]:
    """The pieces of a text that comes in chunks cut there."""
    ends = sorted({n % (len(text) + 1) for n in cut} | {len(text)})
    arriving = (text[a:b] for a, b in zip([0, *ends], ends, strict=False))
    return list(parse_lines(split_lines(arriving, no_signal), width))


def flatten_events(told: list[StreamEvent]) -> list[object]:
    """Rows one by one, everything else as it is, and no silences."""
    out: list[object] = []
    for event in told:
        if isinstance(event, Rows):
            out += [tuple(row) for row in event.x.tolist()]
        elif not isinstance(event, Idle):
            out.append(event)
    return out


@given(text=TEXT, cut=st.lists(st.integers(0, 400), max_size=6), width=st.sampled_from([None, 2]))
def test_it_makes_no_difference_how_lines_are_cut_into_chunks(text: str, cut: list[int], width: int | None):
    """In the middle of a number, of a letter, of a line's end: rows, breaks and refusals are the same."""
    expected = parse_events(text.encode(), [], width)
    for data in (text.encode(), text.replace("\n", "\r\n").encode()):
        told = parse_events(data, cut, width)
        for kinds in ((Rows, DemonstrationBreak, RejectedLine), (ColumnHeader,)):
            assert flatten_events([p for p in told if isinstance(p, kinds)]) == flatten_events(
                [p for p in expected if isinstance(p, kinds)]
            )


@given(whole=st.lists(LINE, min_size=1, max_size=30) | GOOD)
def test_lines_read_at_once_are_those_read_one_by_one(whole: list[str]):
    """Two ways to read rows agree wherever the quick one answers; and it answers when all rows are plain."""
    data = [line.encode() for line in whole]
    for width in (1, 2, 3):
        x, told = parse_rows(data, width), list(parse_single_lines(data, 0, width))
        if x is not None:
            assert flatten_events([Rows(x)]) == flatten_events(told)
            assert len(x) == len(data)
    plain = [
        ",".join(line.replace(",", " ").split())
        for line in whole
        if all(c in "0123456789,. e-" for c in line)
    ]
    plain = [
        line for line in plain if len(line.split(",")) == 2 and isinstance(parse_row(line.encode(), 2), list)
    ]
    if plain:
        assert parse_rows([line.encode() for line in plain], 2) is not None


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
    told = parse_row(line, 3)
    assert isinstance(told, str)
    assert reason in told.replace("\ufffd", "\\ufffd")


@pytest.mark.parametrize("value", [MAX_MAGNITUDE, np.nextafter(MAX_MAGNITUDE, np.inf)])
def test_what_is_too_large_for_a_line_is_too_large_for_a_model(value: float):
    """One limit, kept in two places."""
    model = online.online_model(online.DPGMM(1.0, 1.0), position_layout(1), 0.1)
    learned = True
    try:
        online.observe(model, np.array([value]))
    except InvalidInput:
        learned = False
    assert isinstance(parse_row(repr(float(value)).encode(), 1), list) == learned


def test_a_first_line_of_names_is_a_header():
    """Of names with commas or blanks; quotes, byte order marks, comments and blank lines are no matter."""
    assert flatten_events(parse_events(b"x\ry,z\n1,2\n", []))[1:] == [
        RejectedLine(1, "column 1 is 'x', expected a number such as 0.25"),
        (1.0, 2.0),
    ]
    for text in ("x,y\n1,2", "x y\n1 2", '"x", y\n1,2', "\ufeffx,y\n1,2", "# rows\n\nx,y\n1,2"):
        assert flatten_events(parse_events(text.encode(), [])) == [ColumnHeader(2, ("x", "y")), (1.0, 2.0)]
    reason = "column 2 is 'y', expected a number such as 0.25"
    assert flatten_events(parse_events(b"1,y\n1,2\n", [])) == [
        ColumnHeader(2),
        RejectedLine(1, reason),
        (1.0, 2.0),
    ]
    assert flatten_events(parse_events(b"1,2\n5,y", [])) == [
        ColumnHeader(2),
        (1.0, 2.0),
        RejectedLine(2, reason),
    ]
    assert flatten_events(parse_events("\ufeff1,2".encode(), [])) == [ColumnHeader(2), (1.0, 2.0)]


def test_a_blank_line_is_a_break_and_a_comment_is_nothing():
    """Lines are counted, whatever they hold; the last needs no end."""
    text = b"1,2\n\n# here\n3,4\n  \t\n5\n6,7"
    run_failing = RejectedLine(6, "it has 1 in place of 2 numbers")
    expected = [
        ColumnHeader(2),
        (1.0, 2.0),
        DemonstrationBreak(),
        (3.0, 4.0),
        DemonstrationBreak(),
        run_failing,
        (6.0, 7.0),
    ]
    assert flatten_events(parse_events(text, [])) == expected


def test_many_lines_that_are_there_are_one_piece():
    """A pipe that is full costs a call for its chunk, not for each row; a bad line among them, a few more."""
    text = b"1,2\n" * 1000
    assert [type(event) for event in parse_events(text, [], 2)] == [Rows]
    told = parse_events(text + b"x\n" + text, [], 2)
    assert len(flatten_events(told)) == 2001
    assert len(told) < 40


def test_a_line_without_end_is_refused_before_it_fills_the_memory(monkeypatch: pytest.MonkeyPatch):
    """What is no text of rows ends the stream."""
    monkeypatch.setattr(stream_lines, "LONGEST", 100)
    with pytest.raises(InvalidInput, match="more than 100 bytes"):
        list(split_lines([b"1" * 60, b"1" * 60], no_signal))


def test_a_line_that_a_stop_cut_is_dropped():
    """1.25 of which only 1.2 came is not 1.2; at the end of a file it is a line."""
    assert list(split_lines([b"1\n1.2"], lambda: 2)) == [[b"1"]]
    assert list(split_lines([b"1\n1.2"], no_signal)) == [[b"1"], [b"1.2"]]


def test_a_slow_pipe_is_read_line_by_line_and_a_quick_one_in_chunks(monkeypatch: pytest.MonkeyPatch):
    """Whoever waits gets what is there; silence is told, so that someone may look at the clock."""
    monkeypatch.setattr(stream_lines, "PATIENCE", 0.01)
    reading, writing = os.pipe()
    arriving = read_chunks(reading, no_signal)
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
    assert set(read_chunks(reading, lambda: int(asked.is_set()))) <= {b""}
    os.close(reading)
    os.close(writing)


def rows_of(sizes: list[int]) -> Iterator[StreamEvent]:
    """Numbered rows in pieces of these sizes; a break for each -1."""
    n = 0
    for size in sizes:
        if size < 0:
            yield DemonstrationBreak()
        else:
            yield Rows(np.arange(n, n + size, dtype=np.float64)[:, None])
            n += size


SIZES = st.lists(st.integers(-1, 12), max_size=12)


@given(sizes=SIZES, batch=st.integers(1, 5))
def test_rows_are_handed_on_in_whole_batches_however_they_came(sizes: list[int], batch: int):
    """Batches begin at breaks; none is lost, none waits when there is no more."""
    told = list(regroup_batches(rows_of(sizes), batch))
    assert flatten_events(told) == flatten_events(list(rows_of(sizes)))
    for event, after in zip(told, [*told[1:], DemonstrationBreak()], strict=False):
        if isinstance(event, Rows) and not isinstance(after, DemonstrationBreak):
            assert len(event.x) % batch == 0


@given(sizes=SIZES, most=st.integers(1, 20))
def test_no_more_rows_come_than_were_wanted_and_nothing_after_them(sizes: list[int], most: int):
    """The first so many, and the breaks between."""
    told = flatten_events(list(take_rows(rows_of(sizes), most)))
    everything = flatten_events(list(rows_of(sizes)))
    assert told == everything[: len(told)]
    rows = [event for event in told if not isinstance(event, DemonstrationBreak)]
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
    cut = list(batch_slices(rows, before, every, batch))
    assert [n for event in cut for n in range(event.start, event.stop)] == list(range(rows))
    assert all((event.stop - event.start) % batch == 0 for event in cut[:-1])
    for event in cut if every else []:
        passed = (before + event.stop) // every - (before + event.start) // every
        assert passed <= max(1, -(-batch // every))


def test_standard_input_that_is_closed_is_refused(monkeypatch: pytest.MonkeyPatch):
    """None at all, or one that is no file."""
    for closed in (None, io.StringIO("1,2")):
        monkeypatch.setattr("sys.stdin", closed)
        with pytest.raises(InvalidInput, match="standard input is closed"):
            stream_lines.standard_input_descriptor()


@pytest.mark.parametrize("source", ["none.csv", "dataset:vale"])
def test_a_source_that_is_not_there_is_named(run_failing: Callable[..., str], source: str):
    """With what would be one."""
    told = run_failing("stream", source, "--learner", "dp-gmm", "--cluster", "1", "--noise", "1")
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
