"""Parsing of rows: the result does not depend on how the lines arrive."""

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
from pilotfish.cli.stream import lines as stream_lines
from pilotfish.cli.stream.batches import batch_slices, regroup_batches, take_rows
from pilotfish.cli.stream.lines import (
    ColumnHeader,
    RejectedLine,
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
from pilotfish.kernels import MAX_VALUE
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
    """Return the events of a text that arrives in chunks cut at these bytes."""
    ends = sorted({n % (len(text) + 1) for n in cut} | {len(text)})
    chunks = (text[a:b] for a, b in zip([0, *ends], ends, strict=False))
    return list(parse_lines(split_lines(chunks, no_signal), width))


def flatten_events(events: list[StreamEvent]) -> list[object]:
    """Return rows one by one and all other events but "idle"."""
    out: list[object] = []
    for event in events:
        if isinstance(event, np.ndarray):
            out += [tuple(row) for row in event.tolist()]
        elif event != "idle":
            out.append(event)
    return out


@given(text=TEXT, cut=st.lists(st.integers(0, 400), max_size=6), width=st.sampled_from([None, 2]))
def test_parse_lines_independent_of_chunks(text: str, cut: list[int], width: int | None):
    expected = parse_events(text.encode(), [], width)
    for data in (text.encode(), text.replace("\n", "\r\n").encode()):
        events = parse_events(data, cut, width)
        for kinds in ((np.ndarray, str, RejectedLine), (ColumnHeader,)):
            assert flatten_events([p for p in events if isinstance(p, kinds)]) == flatten_events(
                [p for p in expected if isinstance(p, kinds)]
            )


@given(whole=st.lists(LINE, min_size=1, max_size=30) | GOOD)
def test_parse_rows_equals_parse_single_lines(whole: list[str]):
    data = [line.encode() for line in whole]
    for width in (1, 2, 3):
        x, events = parse_rows(data, width), list(parse_single_lines(data, 0, width))
        if x is not None:
            assert flatten_events([x]) == flatten_events(events)
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
        (b"1,2", "the row has 2 numbers, expected 3"),
        (b"1,2,3,4", "the row has 4 numbers, expected 3"),
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
def test_parse_row_invalid_gives_reason(line: bytes, reason: str):
    result = parse_row(line, 3)
    assert isinstance(result, str)
    assert reason in result.replace("\ufffd", "\\ufffd")


@pytest.mark.parametrize("value", [MAX_VALUE, np.nextafter(MAX_VALUE, np.inf)])
def test_parse_row_limit_equals_model_limit(value: float):
    model = online.online_model(online.DPGMM(1.0, 1.0), position_layout(1), 0.1)
    learned = True
    try:
        online.observe(model, np.array([value]))
    except InvalidInput:
        learned = False
    assert isinstance(parse_row(repr(float(value)).encode(), 1), list) == learned


def test_parse_lines_first_line_of_names_is_header():
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


def test_parse_lines_blank_lines_and_comments():
    text = b"1,2\n\n# comment\n3,4\n  \t\n5\n6,7"
    rejected = RejectedLine(6, "the row has 1 numbers, expected 2")
    expected = [
        ColumnHeader(2),
        (1.0, 2.0),
        "new demonstration",
        (3.0, 4.0),
        "new demonstration",
        rejected,
        (6.0, 7.0),
    ]
    assert flatten_events(parse_events(text, [])) == expected


def test_parse_lines_available_lines_are_one_event():
    text = b"1,2\n" * 1000
    assert [type(event) for event in parse_events(text, [], 2)] == [np.ndarray]
    events = parse_events(text + b"x\n" + text, [], 2)
    assert len(flatten_events(events)) == 2001
    assert len(events) < 40


def test_split_lines_endless_line_is_rejected(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(stream_lines, "MAX_LINE_BYTES", 100)
    with pytest.raises(InvalidInput, match="more than 100 bytes"):
        list(split_lines([b"1" * 60, b"1" * 60], no_signal))


def test_split_lines_incomplete_line_is_dropped_when_stopped():
    assert list(split_lines([b"1\n1.2"], lambda: 2)) == [[b"1"]]
    assert list(split_lines([b"1\n1.2"], no_signal)) == [[b"1"], [b"1.2"]]


def test_read_chunks_yields_available_bytes(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(stream_lines, "WAIT_INTERVAL", 0.01)
    reading, writing = os.pipe()
    chunks = read_chunks(reading, no_signal)
    for line in (b"1,2\n", b"3,"):
        os.write(writing, line)
        assert next(data for data in chunks if data) == line
    assert next(chunks) == b""
    os.write(writing, b"4\n" * 3)
    os.write(writing, b"5\n")
    assert next(data for data in chunks if data) == b"4\n4\n4\n5\n"
    os.close(writing)
    assert list(chunks) == []
    os.close(reading)


def test_read_chunks_ends_when_stopped(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(stream_lines, "WAIT_INTERVAL", 0.01)
    reading, writing = os.pipe()
    asked = threading.Event()
    threading.Timer(0.05, asked.set).start()
    assert set(read_chunks(reading, lambda: int(asked.is_set()))) <= {b""}
    os.close(reading)
    os.close(writing)


def rows_of(sizes: list[int]) -> Iterator[StreamEvent]:
    """Yield numbered rows in events of these sizes; -1 begins a demonstration."""
    n = 0
    for size in sizes:
        if size < 0:
            yield "new demonstration"
        else:
            yield np.arange(n, n + size, dtype=np.float64)[:, None]
            n += size


SIZES = st.lists(st.integers(-1, 12), max_size=12)


@given(sizes=SIZES, batch=st.integers(1, 5))
def test_regroup_batches_yields_full_batches(sizes: list[int], batch: int):
    events = list(regroup_batches(rows_of(sizes), batch))
    assert flatten_events(events) == flatten_events(list(rows_of(sizes)))
    for event, after in zip(events, [*events[1:], "new demonstration"], strict=False):
        if isinstance(event, np.ndarray) and not isinstance(after, str):
            assert len(event) % batch == 0


@given(sizes=SIZES, max_rows=st.integers(1, 20))
def test_take_rows_stops_at_limit(sizes: list[int], max_rows: int):
    events = flatten_events(list(take_rows(rows_of(sizes), max_rows)))
    everything = flatten_events(list(rows_of(sizes)))
    assert events == everything[: len(events)]
    rows = [event for event in events if event != "new demonstration"]
    assert len(rows) == min(max_rows, sum(size for size in sizes if size > 0))
    assert len(rows) < max_rows or events[-1] == rows[-1]


@given(
    rows=st.integers(0, 60),
    before=st.integers(0, 30),
    every=st.none() | st.integers(1, 20),
    batch=st.integers(1, 7),
)
def test_batch_slices_are_full_batches_and_end_at_multiples(
    rows: int, before: int, every: int | None, batch: int
):
    cut = list(batch_slices(rows, before, every, batch))
    assert [n for event in cut for n in range(event.start, event.stop)] == list(range(rows))
    assert all((event.stop - event.start) % batch == 0 for event in cut[:-1])
    for event in cut if every else []:
        passed = (before + event.stop) // every - (before + event.start) // every
        assert passed <= max(1, -(-batch // every))


def test_closed_standard_input_is_rejected(monkeypatch: pytest.MonkeyPatch):
    for closed in (None, io.StringIO("1,2")):
        monkeypatch.setattr("sys.stdin", closed)
        with pytest.raises(InvalidInput, match="standard input is closed"):
            stream_lines.standard_input_descriptor()


@pytest.mark.parametrize("source", ["none.csv", "dataset:vale"])
def test_stream_missing_source_is_named(run_failing: Callable[..., str], source: str):
    message = run_failing("stream", source, "--learner", "dp-gmm", "--cluster", "1", "--noise", "1")
    assert source.removeprefix("dataset:") in message


@given(data=st.binary(max_size=200) | st.text("0123456789.,- e\n#xna", max_size=200).map(str.encode))
@settings(max_examples=100)
@example(b"\x00\r,")
def test_stream_any_bytes_are_learned_or_rejected(tmp_path_factory: pytest.TempPathFactory, data: bytes):
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
