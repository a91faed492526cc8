"""Folders read back what was written; whatever is wrong with one is told with its place."""

import contextlib
import json
import re
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from pilotfish.demonstrations import (
    Demonstration,
    Quantity,
    demonstration,
    frame,
    frame_from_pose,
    moving_frame,
    pose_layout,
    position_layout,
    read_folder,
    views,
    with_derivatives,
    write_folder,
)
from pilotfish.errors import InvalidInput
from pilotfish.geometry import pose

PLANE = position_layout(axes=2)
TOML = """
format = "pilotfish demonstrations"
version = 1
period = 0.5 # s

[[layout]]
name = "position"
quantity = "position"
size = 2
unit = "m"

[[demonstration]]
name = "first"
file = "first.csv"
frames = [{ name = "cup", A = [[1, 0], [0, 2]], b = [0.5, 0] }]

[[demonstration]]
file = "second.csv"
frames = [{ name = "cup", A = [[1, 0], [0, 2]], b = [0, 0] }]
"""
CSV = "position x,position y\n0,1\n2,3.5\n-4e-3,5\n"


def same(one: Demonstration, other: Demonstration) -> bool:
    """Equal number for number, frames included."""
    plain = (one.period, one.layout, one.name) == (other.period, other.layout, other.name)
    arrays = np.array_equal(one.x, other.x) and len(one.frames) == len(other.frames)
    frames = all(
        type(a) is type(b) and a.name == b.name and np.array_equal(a.A, b.A) and np.array_equal(a.b, b.b)
        for a, b in zip(one.frames, other.frames, strict=False)
    )
    return plain and arrays and frames


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder as a person would write it."""
    (tmp_path / "demonstrations.toml").write_text(TOML)
    for name in ("first", "second"):
        (tmp_path / f"{name}.csv").write_text(CSV)
    return tmp_path


def test_a_folder_written_by_hand_is_read(folder: Path):
    """Period, names, frames and numbers are those of the files."""
    first, second = read_folder(folder)
    assert (first.name, second.name, first.period) == ("first", "", 0.5)
    np.testing.assert_array_equal(first.x, [[0, 1], [2, 3.5], [-0.004, 5]])
    np.testing.assert_array_equal(first.frames[0].A, np.diag([1.0, 2.0]))
    np.testing.assert_array_equal(first.frames[0].b, [0.5, 0.0])


def test_toml_and_json_say_the_same(folder: Path):
    """The manifest may be either."""
    by_toml = read_folder(folder)
    (folder / "demonstrations.toml").unlink()
    (folder / "demonstrations.json").write_text(json.dumps(tomllib.loads(TOML)))
    assert all(map(same, read_folder(str(folder)), by_toml))


def test_a_frame_given_by_its_pose_is_the_frame_of_that_pose(tmp_path: Path, make):
    """position and quaternion in the manifest are those of frame_from_pose."""
    layout = pose_layout()
    demo = demonstration(make.x(layout, 4), 0.1, layout)
    write_folder([demo], tmp_path)
    manifest = json.loads((tmp_path / "demonstrations.json").read_text())
    del manifest["sha256"]
    manifest["demonstration"][0]["frames"] = [
        {"name": "cup", "position": [1, 2, 3], "quaternion": [0, 0.6, 0, 0.8]}
    ]
    (tmp_path / "demonstrations.json").write_text(json.dumps(manifest))
    expected = frame_from_pose("cup", layout, pose([1, 2, 3], [0, 0.6, 0, 0.8]))
    (read,) = read_folder(tmp_path)
    np.testing.assert_array_equal(read.frames[0].A, expected.A)
    np.testing.assert_array_equal(read.frames[0].b, expected.b)


def test_what_is_written_reads_back_equal(tmp_path: Path, make):
    """Every number, name and frame, moving frames too, in order."""
    written = [
        make(steps, make.mixed, moving=m % 2 == 1, name=f"n° {m}") for m, steps in enumerate((2, 5, 12))
    ]
    write_folder(written, tmp_path / "here")
    assert all(map(same, read_folder(tmp_path / "here"), written))
    longer = [with_derivatives(demo) for demo in written]
    write_folder(longer, tmp_path / "here", overwrite=True)
    assert all(map(same, read_folder(tmp_path / "here"), longer))


numbers = st.floats(allow_nan=False, allow_infinity=False)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60)
@given(
    x=hnp.arrays(
        np.float64, hnp.array_shapes(min_dims=2, max_dims=2, min_side=2, max_side=4), elements=numbers
    ),
    period=st.floats(min_value=0, exclude_min=True, allow_infinity=False),
    name=st.text(max_size=8),
)
def test_any_numbers_and_any_name_read_back_equal(tmp_path: Path, x: np.ndarray, period: float, name: str):
    """Subnormals, huge numbers, minus zero; line breaks, quotes, other scripts."""
    demo = demonstration(x, period, position_layout(axes=x.shape[1]), name=name)
    write_folder([demo], tmp_path / "any", overwrite=True)
    (read,) = read_folder(tmp_path / "any")
    assert same(read, demo)
    np.testing.assert_array_equal(np.signbit(read.x), np.signbit(x))


@pytest.fixture(params=[False, True], ids=["csv", "npz"])
def written(request: pytest.FixtureRequest, tmp_path: Path) -> tuple[Path, tuple[Demonstration, ...]]:
    """A small folder, of CSV or of NPZ files, and what is in it."""
    x = np.array([[0.25, -1.0], [1e-5, 2.0]])
    belt = moving_frame("belt", np.tile(np.eye(2), (2, 1, 1)), x)
    made = belt if request.param else frame("cup", 2 * np.eye(2), [0.5, 1.0])
    write_folder([demonstration(x, 0.1, PLANE, [made], "a")], tmp_path / "written")
    return tmp_path / "written", read_folder(tmp_path / "written")


def test_a_damaged_byte_is_noticed_or_harmless(written: tuple[Path, tuple[Demonstration, ...]]):
    """Whichever byte of a written folder changes, it reads equal or is refused; never anything else."""
    folder, expected = written
    for file in sorted(folder.iterdir()):
        whole = file.read_bytes()
        for n, byte in enumerate(whole):
            changed = byte ^ (1 << n % 8)
            file.write_bytes(whole[:n] + bytes([changed]) + whole[n + 1 :])
            assert reads_equal_or_is_refused(folder, expected), f"{file.name}, byte {n} as {changed:#x}"
        file.write_bytes(whole)


def reads_equal_or_is_refused(folder: Path, expected: tuple[Demonstration, ...]) -> bool:
    try:
        read = read_folder(folder)
    except InvalidInput:
        return True
    return len(read) == len(expected) and all(map(same, read, expected))


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=150)
@given(data=st.data())
def test_a_damaged_folder_without_checksums_raises_nothing_else(
    written: tuple[Path, tuple[Demonstration, ...]], data: st.DataObject
):
    """Cut, overwritten or extended anywhere, it is read or refused as invalid input."""
    folder, _ = written
    broken = folder.with_name("broken")
    shutil.rmtree(broken, ignore_errors=True)
    shutil.copytree(folder, broken)
    manifest = json.loads((broken / "demonstrations.json").read_text())
    del manifest["sha256"], manifest["demonstration"][0]["sha256"]
    (broken / "demonstrations.json").write_text(json.dumps(manifest))
    file = data.draw(st.sampled_from(sorted(broken.iterdir())))
    whole = file.read_bytes()
    start = data.draw(st.integers(0, len(whole)))
    end = data.draw(st.one_of(st.just(len(whole)), st.integers(start, min(start + 8, len(whole)))))
    file.write_bytes(whole[:start] + data.draw(st.binary(max_size=8)) + whole[end:])
    with contextlib.suppress(InvalidInput):
        read_folder(broken)


BAD_MANIFESTS = [
    ("format = ", "# ", "format is None, expected format = "),
    ("pilotfish demonstrations", "other", "format is 'other'"),
    ("version = 1", "version = 2", r"newer pilotfish \(version 2, this one reads 1\)"),
    ("version = 1", "version = 0", "version is 0, expected 1"),
    ("version = 1", "version = '1'", "version is '1', expected a whole number"),
    ("version = 1", "version = true", "version is True"),
    ("period", "perod", "unknown key 'perod'; did you mean 'period'"),
    ("period = 0.5", "", "key 'period' is missing"),
    ("period = 0.5", "period = nan", "period is nan, expected a finite number"),
    ("period = 0.5", "period = -1", "first.csv.*period is -1.0 s"),
    ("period = 0.5", "period = 'fast'", "period is 'fast'"),
    ("period = 0.5", "period = 1" + 400 * "0", "period is 1000.*, expected a finite number"),
    ("period = 0.5", "period = 1" + 5000 * "0", "not TOML that can be read|too long"),
    ("period = 0.5", "period = ", "not TOML that can be read: .*line 4"),
    ("[[layout]]", "[layout]", "layout is .*expected a list"),
    ('"position"\nsize', '"posture"\nsize', "layout 0: quantity is 'posture', expected one of position"),
    ("size = 2", "size = 3", "first.csv, line 1: the header .*2 columns, expected 3"),
    ("size = 2", "size = -2", "layout 0: part 'position' has size -2"),
    ("size = 2", "size = 2.0", "layout 0: size is 2.0, expected a whole number"),
    ('unit = "m"', "unit = 1", "layout 0: unit is 1, expected text"),
    ('"first.csv"', '"third.csv"', "third.csv cannot be read: No such file"),
    ('"first.csv"', '"second.csv"', "file 'second.csv' is named more than once"),
    ('"first.csv"', '"../first.csv"', "demonstration 0: file is '../first.csv', expected the name of"),
    ('"first.csv"', '"first.txt"', "expected the name of a .csv or .npz file"),
    ('"first.csv"', '"a\\u0000.csv"', "expected the name of"),
    ('file = "first.csv"', "", "demonstration 0: key 'file' is missing"),
    ('file = "first.csv"', 'files = "first.csv"', "unknown key 'files'; did you mean 'file'"),
    (", b = [0.5, 0]", "", "demonstration 0, frame 0: key 'b' is missing"),
    ("b = [0.5, 0]", "b = [0.5]", r"frame 0: frame 'cup': A has shape \(2, 2\) and b \(1,\)"),
    ("b = [0.5, 0]", "b = [0.5, inf]", r"frame 0: b\[1\] is inf"),
    ("b = [0.5, 0]", "b = [0.5, 'a']", "frame 0: b has .*no real numbers"),
    ("[[1, 0], [0, 2]]", "[[1, 0], [0]]", "frame 0: A has rows of different lengths"),
    ("[[1, 0], [0, 2]]", "[[0, 0], [0, 2]]", "frame 0: frame 'cup': A is singular"),
    (
        "A = [[1, 0], [0, 2]], b = [0.5, 0]",
        "A = 'A', b = 'b'",
        "no array 'A'.*moving frames need an NPZ file",
    ),
    ("A = [[1, 0], [0, 2]], b = [0.5, 0]", "position = [1, 2, 3]", "key 'quaternion' is missing"),
    (
        "A = [[1, 0], [0, 2]], b = [0.5, 0]",
        "position = [1, 2, 3], quaternion = [1, 1, 0, 0]",
        r"frame 0: quaternion .* has norm 1\.41421",
    ),
    ('name = "cup", A', 'name = "", A', "a frame is named ''"),
    ("[{ name", "[3, { name", "demonstration 0, frame 0 is 3, expected a table with name, A, b"),
]


@pytest.mark.parametrize(("old", "new", "message"), BAD_MANIFESTS, ids=range(len(BAD_MANIFESTS)))
def test_what_a_manifest_may_not_say(folder: Path, old: str, new: str, message: str):
    """The key is named, what it says, what was expected, and the nearest fix."""
    file = folder / "demonstrations.toml"
    assert old in TOML
    file.write_text(TOML.replace(old, new, 1))
    with pytest.raises(InvalidInput, match=message):
        read_folder(folder)


BAD_TABLES = [
    (
        "",
        r"first.csv, line 1: the header is not the layout's: 0 columns, expected 2; .*position x,position y",
    ),
    ("position y,position x\n0,1\n2,3\n", "line 1: .*column 1 is 'position y', expected 'position x'"),
    ("position x;position y\n0;1\n2;3\n", "separated by commas, not semicolons"),
    ("0,1\n2,3\n", "line 1: the header is not the layout's"),
    ("position x,position y\n", "first.csv .*shape \\(0, 2\\)"),
    ("position x,position y\n0,1\n", "first.csv .*shape \\(1, 2\\)"),
    ("position x,position y\n0,1\n2\n", "first.csv, line 3 has 1 values, expected 2"),
    ("position x,position y\n0,1\n\n2,3\n", "first.csv, line 3 has 0 values"),
    ("position x,position y\n0,1\n2,3,\n", "first.csv, line 3 has 3 values"),
    ("position x,position y\n0,1\n2,3 m\n", "first.csv, line 3, column 'position y' is '3 m'"),
    ("position x,position y\n0,1\n2,1_0\n", "line 3, column 'position y' is '1_0'"),
    ("position x,position y\n0,1\n,3\n", "line 3, column 'position x' is ''"),
    ("position x,position y\n0,1\nnan,3\n", r"\(row 0 is line 2\): .*row 1 .*column 'position x' is nan"),
    ("position x,position y\n0,1\n1e999,3\n", "row 1 .*column 'position x' is inf"),
    ('position x,position y\n0,1\n"2,3\n', "not CSV that can be read"),
    (b"position x,position y\n0,1\n2,\xff\n", "first.csv: byte 28 is no UTF-8 text"),
    (b"position x,position y\n0,1\n2,\x00\n", "first.csv, line 3"),
]


@pytest.mark.parametrize(("text", "message"), BAD_TABLES, ids=range(len(BAD_TABLES)))
def test_what_a_table_may_not_hold(folder: Path, text: str | bytes, message: str):
    """File, line and column are named."""
    (folder / "first.csv").write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InvalidInput, match=message):
        read_folder(folder)


def test_what_spreadsheets_do_to_a_table_is_harmless(folder: Path):
    """A byte-order mark, Windows line ends and quoted names read the same."""
    expected = read_folder(folder)
    other = CSV.replace("position x", '"position x"').replace("\n", "\r\n")
    (folder / "first.csv").write_bytes(b"\xef\xbb\xbf" + other.encode())
    assert all(map(same, read_folder(folder), expected))


ARRAYS = {"x": np.zeros((2, 2)), "A": np.tile(np.eye(2), (2, 1, 1)), "b": np.zeros((2, 2))}
BAD_ARRAYS = [
    ({**ARRAYS, "y": np.zeros(2)}, "first.npz has an array 'y' that no frame names"),
    ({"x": ARRAYS["x"], "A": ARRAYS["A"]}, r"first.npz has no array 'b', it has \['A', 'x'\]"),
    ({**ARRAYS, "x": np.zeros((3, 2))}, "first.npz: demonstration 'first': moving frame 'belt' has 2 steps"),
    ({**ARRAYS, "A": 0 * ARRAYS["A"]}, "first.npz: moving frame 'belt': A at step 0 .*singular"),
    ({**ARRAYS, "x": np.array([[None]])}, "first.npz: not an NPZ file of numbers"),
    ({**ARRAYS, "x": np.array([["a"]])}, "first.npz: array 'x' has .*no real numbers"),
]


@pytest.mark.parametrize(("arrays", "message"), BAD_ARRAYS, ids=range(len(BAD_ARRAYS)))
def test_what_an_archive_may_not_hold(folder: Path, arrays: dict[str, np.ndarray], message: str):
    """The array and the frame are named; pickled objects are never loaded."""
    keyed = TOML.replace("first.csv", "first.npz").replace(
        "A = [[1, 0], [0, 2]], b = [0.5, 0]", "A='A', b='b'", 1
    )
    (folder / "demonstrations.toml").write_text(keyed.replace('"cup"', '"belt"', 1))
    np.savez(folder / "first.npz", **ARRAYS)
    assert read_folder(folder)[0].frames[0].name == "belt"
    np.savez(folder / "first.npz", **arrays)
    with pytest.raises(InvalidInput, match=message):
        read_folder(folder)


def test_an_array_alone_is_no_archive(folder: Path):
    """A .npy file renamed to .npz, and rubbish."""
    (folder / "demonstrations.toml").write_text(TOML.replace("first.csv", "first.npz"))
    for write in (lambda f: np.save(f, np.zeros((2, 2))), lambda f: f.write(b"rubbish"), lambda f: None):
        with (folder / "first.npz").open("wb") as file:
            write(file)
        with pytest.raises(InvalidInput, match=r"first\.npz: not an NPZ file"):
            read_folder(folder)


def test_a_folder_needs_exactly_one_manifest(folder: Path):
    """None, two, no folder, a file instead of one."""
    with pytest.raises(InvalidInput, match="is no folder"):
        read_folder(folder / "missing")
    with pytest.raises(InvalidInput, match="is no folder"):
        read_folder(folder / "first.csv")
    (folder / "demonstrations.json").write_text("{}")
    with pytest.raises(InvalidInput, match="has both of"):
        read_folder(folder)
    (folder / "demonstrations.json").unlink()
    (folder / "demonstrations.toml").unlink()
    with pytest.raises(InvalidInput, match="has neither of"):
        read_folder(folder)


@pytest.mark.parametrize(
    "text", ["[1, 2]", "3", "", "{", '{"version": 1, "version": 1}', "[" * 100_000, "nul"]
)
def test_json_that_is_no_manifest(folder: Path, text: str):
    """Other values, cut ones, keys that stand twice, and depths beyond any use."""
    (folder / "demonstrations.toml").unlink()
    (folder / "demonstrations.json").write_text(text)
    with pytest.raises(InvalidInput, match=r"demonstrations\.json: "):
        read_folder(folder)


def test_an_edited_folder_is_noticed_and_the_named_fix_works(written: tuple[Path, tuple[Demonstration, ...]]):
    """A checksum refuses the edit, and deleting the checksums as told accepts it."""
    folder, _ = written
    file = folder / "demonstrations.json"
    manifest = json.loads(file.read_text())
    manifest["period"] = 0.2
    file.write_text(json.dumps(manifest))
    with pytest.raises(InvalidInput, match="delete the key sha256"):
        read_folder(folder)
    del manifest["sha256"]
    file.write_text(json.dumps(manifest))
    assert read_folder(folder)[0].period == 0.2


def test_nothing_is_overwritten_unless_asked_and_nothing_else_ever(folder: Path, make):
    """An existing folder stays; with overwrite, only a folder of demonstrations is replaced."""
    demo = make()
    with pytest.raises(InvalidInput, match="exists; choose another place, or say overwrite=True"):
        write_folder([demo], folder)
    (folder / "notes.txt").write_text("mine")
    with pytest.raises(InvalidInput, match=r"also holds 'notes\.txt'"):
        write_folder([demo], folder, overwrite=True)
    assert len(read_folder(folder)) == 2
    (folder / "notes.txt").unlink()
    write_folder([demo], folder, overwrite=True)
    assert same(*read_folder(folder), demo)
    other = folder / "other"
    other.mkdir()
    (other / "precious").write_text("mine")
    with pytest.raises(InvalidInput, match="has neither of"):
        write_folder([demo], other, overwrite=True)
    with pytest.raises(InvalidInput, match="is no folder"):
        write_folder([demo], other / "precious", overwrite=True)
    assert (other / "precious").read_text() == "mine"


def test_a_failed_write_leaves_nothing_behind(tmp_path: Path, make):
    """What cannot be written is told, and no half folder stays."""
    (tmp_path / "file").write_text("")
    with pytest.raises(InvalidInput, match="cannot be written: "):
        write_folder([make()], tmp_path / "file" / "folder")
    with pytest.raises(InvalidInput, match="cannot be written: "):
        write_folder([make()], tmp_path / "missing" / "folder")
    assert [file.name for file in tmp_path.iterdir()] == ["file"]


@pytest.mark.parametrize("moment", ["write_bytes", "first rename", "second rename"])
def test_a_disk_that_fills_up_costs_neither_the_old_nor_half_of_the_new(
    tmp_path: Path, make, monkeypatch: pytest.MonkeyPatch, moment: str
):
    """Wherever writing stops, the folder that was there is there, and nothing beside it."""
    old, new = make(), make()
    write_folder([old], tmp_path / "set")
    *nth, method = moment.split()
    real, calls = getattr(Path, method), []

    def fails_once(self: Path, argument: Path | bytes) -> Path | int:
        calls.append(self)
        if len(calls) == (2 if nth == ["second"] else 1):
            raise OSError(28, "No space left on device")
        return real(self, argument)

    monkeypatch.setattr(Path, method, fails_once)
    with pytest.raises(InvalidInput, match="No space left on device"):
        write_folder([new], tmp_path / "set", overwrite=True)
    monkeypatch.undo()
    assert [file.name for file in tmp_path.iterdir()] == ["set"]
    assert same(*read_folder(tmp_path / "set"), old)
    write_folder([new], tmp_path / "set", overwrite=True)
    assert [file.name for file in tmp_path.iterdir()] == ["set"]
    assert same(*read_folder(tmp_path / "set"), new)


def test_a_key_that_stands_twice_is_refused(written: tuple[Path, tuple[Demonstration, ...]]):
    """JSON readers would take the last without a word."""
    file = written[0] / "demonstrations.json"
    file.write_text(file.read_text().replace('"period": 0.1', '"period": 0.2, "period": 0.1'))
    with pytest.raises(InvalidInput, match="key 'period' stands more than once"):
        read_folder(written[0])


def test_a_folder_holds_one_layout_and_one_period(tmp_path: Path, make):
    """Others are refused before anything is written."""
    demo = make()
    slower = demonstration(demo.x, 1.0, demo.layout, name="slow")
    for other in (slower, make(layout=make.mixed)):
        with pytest.raises(InvalidInput, match=r"demonstration 1 .*differs from the first"):
            write_folder([demo, other], tmp_path / "set")
    with pytest.raises(InvalidInput, match="no demonstrations to write"):
        write_folder([], tmp_path / "set")
    assert not list(tmp_path.iterdir())


def test_the_worked_example_of_the_documentation_reads(tmp_path: Path):
    """The files that docs/folder-format.md shows make a folder, and its words about them are true."""
    page = (Path(__file__).parents[2] / "docs" / "folder-format.md").read_text(encoding="utf-8")
    for name, text in re.findall(r"^`([\w.]+)`:\n\n```\w+\n(.*?)^```", page, re.MULTILINE | re.DOTALL):
        (tmp_path / name).write_text(text)
    left, right = read_folder(tmp_path)
    assert (left.name, len(left.x), right.name, len(right.x)) == ("cup on the left", 3, "cup on the right", 4)
    assert left.layout == pose_layout()
    ends = [views([demo]).x[0, -1] for demo in (left, right)]
    assert all(np.linalg.norm(end[:3]) < 0.06 for end in ends)  # m; the hand ends at the cup
    np.testing.assert_allclose([end[3:] for end in ends], [[1, 0, 0, 0]] * 2, atol=1e-12)
    for quantity in Quantity:
        assert f"`{quantity.value}`:" in page
