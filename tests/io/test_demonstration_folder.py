"""Folders of demonstrations: reading what was written, and atomic replacement."""

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
    add_derivatives,
    demonstration,
    frame,
    frame_from_pose,
    moving_frame,
    pose_layout,
    position_layout,
    views,
)
from pilotfish.errors import InvalidInput
from pilotfish.geometry import pose
from pilotfish.io.demonstration_folder import read_demonstrations, write_demonstrations

PLANE = position_layout(axes=2)


def same(one: Demonstration, other: Demonstration) -> bool:
    """Return whether demonstrations are equal number for number, frames included."""
    plain = (one.period, one.layout, one.name) == (other.period, other.layout, other.name)
    arrays = np.array_equal(one.x, other.x) and len(one.frames) == len(other.frames)
    frames = all(
        type(a) is type(b) and a.name == b.name and np.array_equal(a.A, b.A) and np.array_equal(a.b, b.b)
        for a, b in zip(one.frames, other.frames, strict=False)
    )
    return plain and arrays and frames


def test_read_demonstrations_manual_folder_has_its_values(manual_folder: Path):
    first, second = read_demonstrations(manual_folder)
    assert (first.name, second.name, first.period) == ("first", "", 0.5)
    np.testing.assert_array_equal(first.x, [[0, 1], [2, 3.5], [-0.004, 5]])
    np.testing.assert_array_equal(first.frames[0].A, np.diag([1.0, 2.0]))
    np.testing.assert_array_equal(first.frames[0].b, [0.5, 0.0])


def test_read_demonstrations_toml_equals_json(manual_folder: Path):
    by_toml, text = read_demonstrations(manual_folder), (manual_folder / "demonstrations.toml").read_text()
    (manual_folder / "demonstrations.toml").unlink()
    (manual_folder / "demonstrations.json").write_text(json.dumps(tomllib.loads(text)))
    assert all(map(same, read_demonstrations(str(manual_folder)), by_toml))


def test_read_demonstrations_frame_by_pose_equals_frame_from_pose(tmp_path: Path, make):
    layout = pose_layout()
    demo = demonstration(make.x(layout, 4), 0.1, layout)
    write_demonstrations([demo], tmp_path)
    manifest = json.loads((tmp_path / "demonstrations.json").read_text())
    del manifest["sha256"]
    manifest["demonstration"][0]["frames"] = [
        {"name": "cup", "position": [1, 2, 3], "quaternion": [0, 0.6, 0, 0.8]}
    ]
    (tmp_path / "demonstrations.json").write_text(json.dumps(manifest))
    expected = frame_from_pose("cup", layout, pose([1, 2, 3], [0, 0.6, 0, 0.8]))
    (read,) = read_demonstrations(tmp_path)
    np.testing.assert_array_equal(read.frames[0].A, expected.A)
    np.testing.assert_array_equal(read.frames[0].b, expected.b)


def test_read_demonstrations_of_written_folder_equals_written(tmp_path: Path, make):
    written = [
        make(steps, make.mixed, moving=m % 2 == 1, name=f"n° {m}") for m, steps in enumerate((2, 5, 12))
    ]
    write_demonstrations(written, tmp_path / "here")
    assert all(map(same, read_demonstrations(tmp_path / "here"), written))
    longer = [add_derivatives(demo) for demo in written]
    write_demonstrations(longer, tmp_path / "here", overwrite=True)
    assert all(map(same, read_demonstrations(tmp_path / "here"), longer))


numbers = st.floats(-1e100, 1e100)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60)
@given(
    x=hnp.arrays(
        np.float64, hnp.array_shapes(min_dims=2, max_dims=2, min_side=2, max_side=4), elements=numbers
    ),
    period=st.floats(1e-9, 1e9),
    name=st.text(max_size=8).filter(str.isprintable),
)
def test_read_demonstrations_of_any_numbers_equals_written(
    tmp_path: Path, x: np.ndarray, period: float, name: str
):
    """Subnormal and huge numbers, minus zero; quotes and other scripts in names."""
    demo = demonstration(x, period, position_layout(axes=x.shape[1]), name=name)
    write_demonstrations([demo], tmp_path / "any", overwrite=True)
    (read,) = read_demonstrations(tmp_path / "any")
    assert same(read, demo)
    np.testing.assert_array_equal(np.signbit(read.x), np.signbit(x))


@pytest.fixture(params=[False, True], ids=["csv", "npz"])
def written(request: pytest.FixtureRequest, tmp_path: Path) -> tuple[Path, tuple[Demonstration, ...]]:
    """Write a small folder of CSV or NPZ files; return it with its demonstrations."""
    x = np.array([[0.25, -1.0], [1e-5, 2.0]])
    belt = moving_frame("belt", np.tile(np.eye(2), (2, 1, 1)), x)
    made = belt if request.param else frame("cup", 2 * np.eye(2), [0.5, 1.0])
    write_demonstrations([demonstration(x, 0.1, PLANE, [made], "a")], tmp_path / "written")
    return tmp_path / "written", read_demonstrations(tmp_path / "written")


def test_read_demonstrations_changed_byte_equals_or_raises(written: tuple[Path, tuple[Demonstration, ...]]):
    folder, expected = written
    for file in sorted(folder.iterdir()):
        whole = file.read_bytes()
        for n, byte in enumerate(whole):
            changed = byte ^ (1 << n % 8)
            file.write_bytes(whole[:n] + bytes([changed]) + whole[n + 1 :])
            assert reads_equal_or_is_refused(folder, expected), f"{file.name}, byte {n} as {changed:#x}"
        file.write_bytes(whole)


def reads_equal_or_is_refused(manual_folder: Path, expected: tuple[Demonstration, ...]) -> bool:
    try:
        read = read_demonstrations(manual_folder)
    except InvalidInput:
        return True
    return len(read) == len(expected) and all(map(same, read, expected))


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=150)
@given(data=st.data())
def test_read_demonstrations_damaged_folder_raises_invalid_input_only(
    written: tuple[Path, tuple[Demonstration, ...]], data: st.DataObject
):
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
        read_demonstrations(broken)


def test_read_demonstrations_csv_of_spreadsheet_equals_original(manual_folder: Path):
    expected = read_demonstrations(manual_folder)
    other = (
        (manual_folder / "first.csv").read_text().replace("position x", '"position x"').replace("\n", "\r\n")
    )
    (manual_folder / "first.csv").write_bytes(b"\xef\xbb\xbf" + other.encode())
    assert all(map(same, read_demonstrations(manual_folder), expected))


def test_read_demonstrations_edited_manifest_raises_until_sha256_is_deleted(
    written: tuple[Path, tuple[Demonstration, ...]],
):
    folder, _ = written
    file = folder / "demonstrations.json"
    manifest = json.loads(file.read_text())
    manifest["period"] = 0.2
    file.write_text(json.dumps(manifest))
    with pytest.raises(InvalidInput, match="delete the key sha256"):
        read_demonstrations(folder)
    del manifest["sha256"]
    file.write_text(json.dumps(manifest))
    assert read_demonstrations(folder)[0].period == 0.2


def test_write_demonstrations_replaces_only_demonstrations_with_overwrite(manual_folder: Path, make):
    demo = make()
    with pytest.raises(InvalidInput, match="exists; choose another place, or pass overwrite=True"):
        write_demonstrations([demo], manual_folder)
    (manual_folder / "notes.txt").write_text("mine")
    with pytest.raises(InvalidInput, match=r"also holds 'notes\.txt'"):
        write_demonstrations([demo], manual_folder, overwrite=True)
    assert len(read_demonstrations(manual_folder)) == 2
    (manual_folder / "notes.txt").unlink()
    write_demonstrations([demo], manual_folder, overwrite=True)
    assert same(*read_demonstrations(manual_folder), demo)
    other = manual_folder / "other"
    other.mkdir()
    (other / "precious").write_text("mine")
    with pytest.raises(InvalidInput, match="has neither of"):
        write_demonstrations([demo], other, overwrite=True)
    with pytest.raises(InvalidInput, match="is not a folder"):
        write_demonstrations([demo], other / "precious", overwrite=True)
    assert (other / "precious").read_text() == "mine"


def test_write_demonstrations_unwritable_path_leaves_nothing(tmp_path: Path, make):
    (tmp_path / "file").write_text("")
    with pytest.raises(InvalidInput, match="cannot be written: "):
        write_demonstrations([make()], tmp_path / "file" / "folder")
    with pytest.raises(InvalidInput, match="cannot be written: "):
        write_demonstrations([make()], tmp_path / "missing" / "folder")
    assert [file.name for file in tmp_path.iterdir()] == ["file"]


EXCHANGE = ["write_bytes", "rename 1"]  # methods of Path, and which call of it fails
TWO_RENAMES = [*EXCHANGE, "rename 2", "rename 3"]  # where the system cannot exchange folders


@pytest.mark.parametrize(
    ("exchanges", "moment"), [*((True, m) for m in EXCHANGE), *((False, m) for m in TWO_RENAMES)]
)
def test_write_demonstrations_full_disk_keeps_old_folder(
    tmp_path: Path, make, monkeypatch: pytest.MonkeyPatch, moment: str, exchanges: bool
):
    if not exchanges:
        monkeypatch.setattr("pilotfish.io.atomic_writes.exchange_paths", lambda *_: False)
    old, new = make(), make()
    write_demonstrations([old], tmp_path / "set")
    method, *nth = moment.split()
    real, calls = getattr(Path, method), []

    def fails_once(self: Path, argument: Path | bytes) -> Path | int:
        calls.append(self)
        if len(calls) == int(*nth or "1"):
            raise OSError(28, "No space left on device")
        return real(self, argument)

    monkeypatch.setattr(Path, method, fails_once)
    with pytest.raises(InvalidInput, match="No space left on device"):
        write_demonstrations([new], tmp_path / "set", overwrite=True)
    monkeypatch.undo()
    assert [file.name for file in tmp_path.iterdir()] == ["set"]
    assert same(*read_demonstrations(tmp_path / "set"), old)
    write_demonstrations([new], tmp_path / "set", overwrite=True)
    assert [file.name for file in tmp_path.iterdir()] == ["set"]
    assert same(*read_demonstrations(tmp_path / "set"), new)


@pytest.mark.parametrize("call", [2, 3])
@pytest.mark.parametrize("before", [True, False])
def test_write_demonstrations_interrupted_rename_keeps_old_or_new_folder(
    make, tmp_path, monkeypatch, call, before
):
    """Without an exchange of folders, Ctrl-C may come before or after each of two renames."""
    monkeypatch.setattr("pilotfish.io.atomic_writes.exchange_paths", lambda *_: False)
    old, real, calls = make(), Path.rename, []
    write_demonstrations([old], tmp_path / "set")

    def interrupted(self: Path, target: Path) -> Path:
        calls.append(self)
        if len(calls) != call:
            return real(self, target)
        if not before:
            real(self, target)
        raise KeyboardInterrupt

    new = make()
    monkeypatch.setattr(Path, "rename", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_demonstrations([new], tmp_path / "set", overwrite=True)
    monkeypatch.undo()
    assert [file.name for file in tmp_path.iterdir()] == ["set"]
    assert same(*read_demonstrations(tmp_path / "set"), new if (call, before) == (3, False) else old)


def test_read_demonstrations_duplicate_key_raises(written: tuple[Path, tuple[Demonstration, ...]]):
    """JSON readers take the last value without a message."""
    file = written[0] / "demonstrations.json"
    file.write_text(file.read_text().replace('"period": 0.1', '"period": 0.2, "period": 0.1'))
    with pytest.raises(InvalidInput, match="key 'period' is given more than once"):
        read_demonstrations(written[0])


def test_write_demonstrations_different_layouts_or_periods_raise(tmp_path: Path, make):
    demo = make()
    slower = demonstration(demo.x, 1.0, demo.layout, name="slow")
    for other in (slower, make(layout=make.mixed)):
        with pytest.raises(InvalidInput, match=r"demonstration 1 .*differs from the first"):
            write_demonstrations([demo, other], tmp_path / "set")
    with pytest.raises(InvalidInput, match="no demonstrations to write"):
        write_demonstrations([], tmp_path / "set")
    assert not list(tmp_path.iterdir())


def test_read_demonstrations_example_of_documentation(tmp_path: Path):
    page = (Path(__file__).parents[2] / "docs" / "folder-format.md").read_text(encoding="utf-8")
    for name, text in re.findall(r"^`([\w.]+)`:\n\n```\w+\n(.*?)^```", page, re.MULTILINE | re.DOTALL):
        (tmp_path / name).write_text(text)
    left, right = read_demonstrations(tmp_path)
    assert (left.name, len(left.x), right.name, len(right.x)) == ("cup on the left", 3, "cup on the right", 4)
    assert left.layout == pose_layout()
    ends = [views([demo]).x[0, -1] for demo in (left, right)]
    assert all(np.linalg.norm(end[:3]) < 0.06 for end in ends)  # m; the hand ends at the cup
    np.testing.assert_allclose([end[3:] for end in ends], [[1, 0, 0, 0]] * 2, atol=1e-12)
    for quantity in Quantity:
        assert f"`{quantity.value}`:" in page
