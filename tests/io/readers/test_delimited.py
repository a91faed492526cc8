"""Tables of text: separators, headers, units, comments, times and messages."""

import itertools
from pathlib import Path

import numpy as np
import pytest

from pilotfish.control import Motion
from pilotfish.demonstrations import (
    Recording,
    build_demonstration,
    pose_layout,
    suggest_settings,
)
from pilotfish.errors import InvalidInput
from pilotfish.io import write_motion
from pilotfish.io.readers import ReadOptions, read_recordings

VALUES = np.array([[0.0, 1.5, -2e-3], [0.1, 2.5, 4.0], [0.2, 3.5, 1e5]])


def read(tmp_path: Path, text: str | bytes, name: str = "demo.csv", **options: str) -> Recording:
    file = tmp_path / name
    file.write_bytes(text.encode() if isinstance(text, str) else text)
    (recording,) = read_recordings(file, options=ReadOptions(**options))
    return recording


def table(separator: str, end: str, header: str) -> str:
    lines = [header.replace(",", separator)] if header else []
    lines += [separator.join(repr(float(value)) for value in row) for row in VALUES]
    return end.join(lines) + end


@pytest.mark.parametrize(
    ("separator", "end", "header"),
    list(itertools.product((",", ";", "\t", " ", ", ", "   "), ("\n", "\r\n", ",\n"), ("time,x,y", ""))),
)
def test_separators_and_line_ends_give_equal_values(tmp_path: Path, separator: str, end: str, header: str):
    end = end.replace(",", separator.strip(" "))
    recording = read(tmp_path, table(separator, end, header))
    signal = recording.signals[0]
    if header:
        assert signal.columns == ("x", "y")
        assert np.array_equal(signal.times, VALUES[:, 0])
        assert np.array_equal(signal.values, VALUES[:, 1:])
    else:
        assert signal.columns == ("column 1", "column 2", "column 3")
        assert signal.times is None
        assert np.array_equal(signal.values, VALUES)
    assert recording.name == "demo"


@pytest.mark.parametrize(
    "text",
    [
        "\ufeffx,y\n1,2\n3,4\n",
        "# recorded on Monday\nx,y\n# pause\n1,2\n\n3,4\n\n\n",
        "% x,y\n1,2\n3,4",
        "# x y\n1 2\n3 4\n",
        "sep=;\nx;y\n1;2\n3;4\n",
        '"x","y"\n"1","2"\n"3","4"\n',
        "x,y\n mm , mm \n1,2\n3,4\n",
        "x [mm],y [mm]\n1,2\n3,4\n",
        "x_mm,y_mm\n1,2\n3,4\n",
        "x (mm);y (mm)\n1;2\n3;4\n",
        "\ufeffx\ty\n1\t2\n3\t4\n".encode("utf-16-le"),
    ],
)
def test_headers_comments_and_units_are_recognised(tmp_path: Path, text: str | bytes):
    signal = read(tmp_path, text).signals[0]
    assert signal.columns == ("x", "y")
    assert signal.values.tolist() == [[1, 2], [3, 4]]
    has_unit = "mm" in str(text)
    assert signal.units == (("mm", "mm") if has_unit else ("", ""))


@pytest.mark.parametrize(
    ("header", "scale", "start"),
    [
        ("time", 1.0, 0.0),
        ("t [ms]", 1e3, 0.0),
        ("timestamp_ns", 1e9, 0.0),
        ("stamp", 1e9, 1.7e18),
        ("time_s", 1.0, 0.0),
        ("t_s", 1.0, 1.7e9),
        ("time_seconds", 1.0, 0.0),
        ("secs", 1.0, 0.0),
        ("Seconds", 1.0, 0.0),
        ("Zeit", 1.0, 0.0),
        ("Zeit [ms]", 1e3, 0.0),
        ("temps", 1.0, 0.0),
        ("Time", 1e6, 1.7e15),
        ("timestamp", 1e3, 1.7e12),
        ("timestamp", 1.0, 1.7e9),
        ("%time", 1e9, 1.7e18),
        ("time", 1e3, 0.0),
        ("time", 1e6, 0.0),
        ("time", 1e9, 0.0),
    ],
)
def test_times_are_converted_to_seconds(tmp_path: Path, header: str, scale: float, start: float):
    """Units in the header, counts since 1970 and steps of 33 ms are recognised."""
    rows = "".join(f"{int(start) + round(n * 0.033 * scale, 6):.6f},{n}\n" for n in range(5))
    signal = read(tmp_path, f"{header},x\n{rows}").signals[0]
    assert signal.times is not None
    assert signal.columns == ("x",)
    assert np.allclose(np.diff(signal.times), 0.033, atol=1e-6)


def test_ros_seconds_and_dates_are_times(tmp_path: Path):
    ros = read(tmp_path, "header.stamp.secs,header.stamp.nsecs,x\n10,500000000,1\n11,0,2\n").signals[0]
    assert ros.times is not None
    assert ros.times.tolist() == [10.5, 11.0]
    assert ros.columns == ("x",)
    dates = read(tmp_path, "time,x\n2026-05-01T12:00:00.25,1\n2026-05-01T12:00:01,2\n").signals[0]
    assert dates.times is not None
    assert np.diff(dates.times).tolist() == [0.75]


def test_text_columns_are_labels(tmp_path: Path):
    recording = read(tmp_path, "time,x,phase,closed\n0,1,reach out,true\n0.1,2,grasp,false\n")
    assert recording.labels == {"phase": ("reach out", "grasp")}
    assert recording.signals[0].values.tolist() == [[1, 1], [2, 0]]
    assert recording.notes == (
        "column 'phase' has text (reach out, grasp): kept as a label of each row, not as a number",
    )


def test_rows_of_names_in_motive_exports_are_joined(tmp_path: Path):
    text = (
        "Format Version,1.23,Rotation Type,Quaternion,Length Units,Millimeters\n\n"
        ",Type,Rigid Body,Rigid Body,Rigid Body\n,Name,Cube,Cube,Cube\n,ID,A,A,A\n"
        ",,Rotation,Position,Mean Marker Error\nFrame,Time (Seconds),X,X,\n"
        "0,0.00,1,300,0.1\n1,0.01,1,301,0.1\n"
    )
    (signal,) = read(tmp_path, text).signals
    assert signal.columns == ("Frame", "Cube Rotation X", "Cube Position X", "Cube Mean Marker Error")
    assert signal.units == ("", "", "mm", "")
    assert signal.times is not None
    assert signal.values.tolist() == [[0, 1, 300, 0.1], [1, 1, 301, 0.1]]


def test_empty_cells_are_nan_that_building_leaves_out(tmp_path: Path):
    recording = read(tmp_path, "time,x,y\n0,1,2\n0.1,,3\n0.2,nan,4\n")
    assert np.isnan(recording.signals[0].values[:, 0]).tolist() == [False, True, True]
    settings, _ = suggest_settings([recording])
    with pytest.raises(InvalidInput, match="one row, expected at least two"):
        build_demonstration(recording, settings)


def test_own_motion_file_is_read_exactly(tmp_path: Path, rng: np.random.Generator):
    """A written motion becomes the same demonstration, without a question."""
    q = rng.normal(size=4)
    x = np.column_stack([rng.normal(size=(20, 3)), np.tile(q / np.linalg.norm(q), (20, 1))])
    layout = pose_layout().differentiate()
    motion = Motion(np.hstack([x, np.zeros((20, 7))]), np.zeros((19, 7)), 0.1)
    write_motion(tmp_path / "motion.csv", motion, layout)
    (recording,) = read_recordings(tmp_path / "motion.csv")
    settings, questions = suggest_settings([recording])
    demo, _ = build_demonstration(recording, settings)
    assert not questions
    assert (demo.layout, demo.period) == (pose_layout(), 0.1)
    assert np.allclose(demo.x, x, atol=1e-15)
    assert np.array_equal(demo.x[:, :3], x[:, :3])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "no rows"),
        ("# only a comment\n", "no rows"),
        ("x,y\n", "a header but no rows"),
        ("x;y\n0,1;0,2\n", "line 2, column 'x' is '0,1', a number with a decimal comma"),
        ("0,1 0,2\n0,3 0,4\n", "decimal comma"),
        ("time;x;n\n0;300,0;0\n1;300,1;0\n", "column 'x' is '300,0', .* decimal comma.* export with points"),
        ("time\tx\n0,00\t3\n0,02\t4\n", "column 'time' is '0,00', .* decimal comma"),
        ("time;x;y\n0;n/a;1\n1;1.300,5;1\n", "line 3, column 'x' is '1.300,5', .* decimal comma"),
        ("x,y\n1,2\n3\n", "line 3 has 1 cells, expected 2"),
        ("x,y\n1,2\n3,4,5\n", "line 3 has 3 cells"),
        ("x,y\n1,2\n3,four\n", "line 3, column 'y' is 'four', expected a number"),
        ("x,y\n1,2\n1_0,4\n", "'1_0'"),
        ("time,x\n1,2\n2,3\n3,4\n", "ascends by 1 per row"),
        ("time [kg],x\n1,2\n2,3\n", "expected a unit of time"),
        ("time\n0.1\n0.2\n", "no columns of numbers besides the time"),
        ('x,y\n1,"2\n', "line 2: not a row that can be read"),
        (b"\x80\x81\xff\xfe binary", "byte 0 is not UTF-8"),
        (bytes(1000), "binary data"),
        (",".join("x" * 3 for _ in range(20_000)) + "\n", "20000 cells"),
        ("x" * 300_000 + ",y\n1,2\n", "larger than field limit"),
        ("x" * 3_000 + ",y\n1,2\n", "3000 characters"),
        ("x\x1b[2J,y\n1,2\n", "printable"),
    ],
)
def test_unusable_file_is_refused(tmp_path: Path, text: str | bytes, message: str):
    with pytest.raises(InvalidInput, match=message):
        read(tmp_path, text)


def test_stated_options_are_used(tmp_path: Path):
    signal = read(tmp_path, "clock,time,x\n0,5,1\n20,4,2\n", time_column="clock", time_unit="ms").signals[0]
    assert signal.times is not None
    assert signal.times.tolist() == [0.0, 0.02]
    assert signal.columns == ("time", "x")
    assert read(tmp_path, "a b,c\n1,2\n", separator="comma").signals[0].columns == ("a b", "c")
    with pytest.raises(InvalidInput, match="no column 'clock'"):
        read(tmp_path, "x,y\n1,2\n", time_column="clock")
    for option in ({"separator": "pipe"}, {"time_unit": "kg"}, {"time_unit": "fortnight"}):
        with pytest.raises(InvalidInput):
            ReadOptions(**option)


def test_large_file_is_refused_before_it_is_read(tmp_path: Path):
    """A sparse file of 2^30 bytes and a device do not fill the memory."""
    file = tmp_path / "large.csv"
    with file.open("wb") as stream:
        stream.truncate(2**30)
    with pytest.raises(InvalidInput, match="more than"):
        list(read_recordings(file))
    (tmp_path / "zero.csv").symlink_to("/dev/zero")
    with pytest.raises(InvalidInput, match="no known format"):
        list(read_recordings(tmp_path / "zero.csv"))
    with pytest.raises(InvalidInput, match=r"not a regular file|no known format"):
        list(read_recordings(tmp_path / "zero.csv", options=ReadOptions(format="delimited")))


WORDS = (
    "time", "x", "y", "qw", "w", "0", "-2.5", "1e400", "nan", "inf", "", '"', "#", "%", "'", "[mm]", "]", ";",
    ",", "\t", " ", "\n", "\n", "sep=;", "é", "\u202e", "1_0", "0,5", "2026-05-01", "true", "joint_1", "\x0b",
    "\r", "_mm",
)  # fmt: skip


def test_random_text_is_read_or_refused(tmp_path: Path, rng: np.random.Generator):
    """Text of pieces that tables have never raises anything but InvalidInput."""
    outcomes = set()
    for _ in range(400):
        text = "".join(rng.choice(WORDS, int(rng.integers(1, 30))))
        try:
            read(tmp_path, text)
            outcomes.add("read")
        except InvalidInput as error:
            outcomes.add("printable" if str(error).isprintable() else text)
    assert outcomes == {"read", "printable"}
