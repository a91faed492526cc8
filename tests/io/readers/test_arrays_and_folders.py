"""NumPy and MATLAB arrays, folders of files, and files in no known format."""

import io
import struct
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import savemat
from scipy.spatial.transform import Rotation

from pilotfish.demonstrations import Recording, build_demonstration, suggest_settings
from pilotfish.errors import InvalidInput
from pilotfish.io.readers import ReadOptions, read_recordings, reader_formats, recognition

NOISE = np.random.default_rng(0).bytes(500)


def read(path: Path, **options: str) -> list[Recording]:
    return list(read_recordings(path, options=ReadOptions(**options)))


def test_npy_matrix_and_stack_are_read_exactly(tmp_path: Path, rng: np.random.Generator):
    stack = rng.normal(size=(3, 20, 4))
    np.save(tmp_path / "one.npy", stack[0])
    np.save(tmp_path / "all.npy", stack.astype(np.float32))
    (one,) = read(tmp_path / "one.npy")
    assert (one.name, one.signals[0].columns[3]) == ("one", "column 4")
    assert np.array_equal(one.signals[0].values, stack[0])
    recordings = read(tmp_path / "all.npy")
    assert [recording.name for recording in recordings] == ["all 1", "all 2", "all 3"]
    assert np.array_equal(recordings[2].signals[0].values, stack[2].astype(np.float32))


def test_npy_named_fields_are_columns(tmp_path: Path):
    rows = np.array([(0.0, 1.0, 7), (0.1, 2.0, 8)], dtype=[("time", "f8"), ("x_mm", "f4"), ("count", "i4")])
    np.save(tmp_path / "fields.npy", rows)
    (recording,) = read(tmp_path / "fields.npy")
    assert [signal.name for signal in recording.signals] == ["x_mm", "count"]
    assert recording.signals[0].units == ("mm",)
    assert recording.signals[1].times is not None
    assert recording.signals[1].times.tolist() == [0.0, 0.1]


def test_npz_arrays_are_signals_with_times_labels_and_names(tmp_path: Path, rng: np.random.Generator):
    pose, wrench = rng.normal(size=(10, 3)), rng.normal(size=(50, 2))
    np.savez(
        tmp_path / "a.npz",
        wrench=wrench,
        wrench_time=np.arange(50) * 2,
        tool_pos=pose,
        time_ms=np.arange(10) * 10,
        labels=np.array(["reach"] * 4 + ["grasp"] * 6),
        columns=np.array(["x [mm]", "y [mm]", "z [mm]"]),
        fps=100,
    )
    (recording,) = read(tmp_path / "a.npz", time_unit="ms")
    first, second = recording.signals
    assert (first.name, second.name, recording.period) == ("tool_pos", "wrench", 0.01)
    assert (first.columns, first.units) == (("x", "y", "z"), ("mm",) * 3)
    assert first.times is not None
    assert second.times is not None
    assert np.allclose(first.times, np.arange(10) * 0.01)
    assert np.allclose(second.times, np.arange(50) * 0.002)
    assert np.array_equal(second.values, wrench)
    assert recording.labels["labels"][3:5] == ("reach", "grasp")


def test_notes_name_labels_and_arrays_left_out(tmp_path: Path):
    labels, objects = np.array(["reach"] * 3 + ["grasp"] * 2), np.array(["cube", "mug"])
    np.savez(tmp_path / "demo.npz", x=np.zeros((5, 2)), labels=labels, objects=objects)
    savemat(tmp_path / "demo.mat", {"log": {"x": np.zeros((5, 2)), "images": np.zeros((7, 8, 8))}})
    (recording,) = read(tmp_path / "demo.npz")
    assert recording.labels == {"labels": tuple(labels)}
    assert recording.notes == (
        "array 'labels' has labels (reach, grasp): kept as a label of each row",
        "array 'objects' of shape (2,) is left out: not a row per sample",
    )
    (recording,) = read(tmp_path / "demo.mat")
    assert recording.notes == ("array 'images' of shape (7, 8, 8) is left out: not a row per sample",)


def test_npz_numbered_arrays_are_recordings(tmp_path: Path, rng: np.random.Generator):
    demos = [rng.normal(size=(10 + n, 2)) for n in range(11)]
    np.savez(tmp_path / "set.npz", *demos, dt=0.05)
    recordings = read(tmp_path / "set.npz")
    assert [len(recording.signals[0].values) for recording in recordings] == [10 + n for n in range(11)]
    assert {recording.period for recording in recordings} == {0.05}


def test_npz_numbered_pairs_are_signals_and_labels(tmp_path: Path, rng: np.random.Generator):
    """Arrays with equal numbers belong together; other words and empty arrays are ignored."""
    x = [rng.normal(size=(4 + n, 2)) for n in range(3)]
    arrays = {f"x{n}": own for n, own in enumerate(x)}
    arrays |= {f"label{n}": np.arange(4 + n) for n in range(3)}
    np.savez(tmp_path / "s.npz", **arrays, sensors=np.array(["left"]), raw=np.zeros(0))
    recordings = read(tmp_path / "s.npz")
    assert [recording.name for recording in recordings] == ["x0", "x1", "x2"]
    for own, recording in zip(x, recordings, strict=True):
        assert np.array_equal(recording.signals[0].values, own)
        assert recording.labels == {"label": tuple(str(n) for n in range(len(own)))}
    np.savez(tmp_path / "letters.npz", A_0=x[0], A_1=x[1], B_0=x[2], B_1=x[0])
    assert [recording.name for recording in read(tmp_path / "letters.npz")] == ["A_0", "A_1", "B_0", "B_1"]
    np.savez(tmp_path / "hands.npz", left_0=x[0], right_0=x[0], left_1=x[1], right_1=x[1])
    first = read(tmp_path / "hands.npz")[0]
    assert [signal.name for signal in first.signals] == ["left", "right"]


def test_npz_points_beside_a_matrix_are_columns(tmp_path: Path, rng: np.random.Generator):
    """Points of several joints have time, and not recordings, on their first axis."""
    points = rng.normal(size=(9, 4, 3))
    np.savez(tmp_path / "p.npz", angles=rng.normal(size=(9, 5)), points=points)
    (recording,) = read(tmp_path / "p.npz")
    assert np.array_equal(recording.signals[1].values, points.reshape(9, 12))


@pytest.mark.parametrize("suffix", [".npz", ".mat"])
def test_homogeneous_matrices_are_poses(tmp_path: Path, rng: np.random.Generator, suffix: str):
    t = 0.1 * np.arange(30)
    poses = np.tile(np.eye(4), (30, 1, 1))
    poses[:, :3, :3] = Rotation.from_rotvec(np.outer(t, [0.1, 0.2, 0.3])).as_matrix()
    poses[:, :3, 3] = rng.normal(size=(30, 3))
    file = tmp_path / f"demo{suffix}"
    if suffix == ".npz":
        np.savez(file, t=t, tool=poses, gripper=np.zeros(30))
    else:
        savemat(file, {"t": t, "tool": np.moveaxis(poses, 0, 2), "gripper": np.zeros(30)})
    (recording,) = read(file)
    tool = next(signal for signal in recording.signals if signal.name == "tool")
    assert tool.columns[:4] == ("tool x", "tool y", "tool z", "tool r11")
    assert tool.times is not None
    settings, questions = suggest_settings([recording])
    assert not questions
    demo, _ = build_demonstration(recording, settings)
    w, *xyz = demo.x[-1, 3:7]
    assert np.allclose(demo.x[:, :3], poses[:, :3, 3])
    assert np.allclose(Rotation.from_quat([*xyz, w]).as_matrix(), poses[-1, :3, :3])


def test_npz_times_show_the_axis_of_time(tmp_path: Path, rng: np.random.Generator):
    points = rng.normal(size=(20, 5, 3))
    np.savez(tmp_path / "demo.npz", t=0.1 * np.arange(20), markers=points)
    (recording,) = read(tmp_path / "demo.npz")
    assert np.array_equal(recording.signals[0].values, points.reshape(20, 15))


def test_npz_stack_has_times_and_labels_of_each(tmp_path: Path, rng: np.random.Generator):
    x, phase = rng.normal(size=(2, 5, 3)), np.arange(10).reshape(2, 5)
    np.savez(tmp_path / "s.npz", x=x, phase=phase, t=np.arange(10.0).reshape(2, 5) / 50)
    second = read(tmp_path / "s.npz")[1]
    assert np.array_equal(second.signals[0].values, x[1])
    assert second.labels["phase"] == ("5", "6", "7", "8", "9")
    assert second.signals[0].times is not None
    assert second.signals[0].times[0] == 0.1


@pytest.mark.parametrize("compressed", [False, True])
def test_matlab_variables_are_read_exactly(tmp_path: Path, rng: np.random.Generator, compressed: bool):
    x, stack = rng.normal(size=(20, 3)), rng.normal(size=(2, 20, 3))
    contents: dict[str, Any] = {
        "matrix": {"x": x, "t": np.arange(20) * 0.02, "phase": np.arange(20) // 10},
        "wide": {"x": x.T, "t": np.arange(20) * 0.02},
        "stack": {"demos": stack, "dt": 0.02},
        "struct": {"demo": {"tool": {"pos": x}, "time": np.arange(20) * 0.02, "phase": ["a"] * 20}},
        "structs": {"demos": np.array([{"x": x}, {"x": x + 1}], dtype=object), "settings": {"gain": 3.0}},
        "pairs": {"demo": {"x0": x, "x1": x[:9]}},
    }
    for name, content in contents.items():
        savemat(tmp_path / f"{name}.mat", content, do_compression=compressed)
    for name in ("matrix", "wide", "struct"):
        (recording,) = read(tmp_path / f"{name}.mat")
        assert np.array_equal(recording.signals[0].values, x)
        assert recording.signals[0].times is not None
        assert recording.signals[0].times[-1] == pytest.approx(0.38)
        assert ("transposed" in recording.format) == (name == "wide")
        assert bool(recording.labels) == (name != "wide")
    assert np.array_equal(read(tmp_path / "stack.mat")[1].signals[0].values, stack[1])
    assert read(tmp_path / "stack.mat")[1].period == 0.02
    assert [signal.name for signal in read(tmp_path / "pairs.mat")[0].signals] == ["x0", "x1"]
    assert np.array_equal(read(tmp_path / "structs.mat")[1].signals[0].values, x + 1)


def test_folder_is_read_in_natural_order(tmp_path: Path):
    for n in (10, 2, 1):
        (tmp_path / f"demo{n}.csv").write_text(f"x,y\n{n},0\n{n},1\n")
    (tmp_path / "notes.md").write_text("# Notes")
    (tmp_path / ".hidden").write_text("?")
    assert [recording.name for recording in read(tmp_path)] == ["demo1", "demo2", "demo10"]


def write_pair(folder: Path, execution: str, columns: tuple[str, str]) -> None:
    (folder / f"{execution}_robot.csv").write_text(f"time,{columns[0]}\n0,1,2,3\n0.1,1,2,3\n0.2,1,2,3\n")
    (folder / f"{execution}_objects.csv").write_text(f"time,{columns[1]}\n0,4,5,6\n0.2,4,5,6\n")


def test_files_of_one_execution_are_signals(tmp_path: Path):
    for execution in ("demo1", "demo2"):
        write_pair(tmp_path, execution, ("x,y,z", "cube_x,cube_y,cube_z"))
    recordings = read(tmp_path)
    assert [recording.name for recording in recordings] == ["demo1", "demo2"]
    assert [signal.name for signal in recordings[0].signals] == ["objects", "robot"]
    settings, questions = suggest_settings(recordings)
    assert not questions
    demo, _ = build_demonstration(recordings[1], settings)
    assert [frame.name for frame in demo.frames] == ["cube"]
    assert demo.frames[0].b.tolist() == [4, 5, 6]
    assert demo.x.tolist() == [[1, 2, 3]] * 3


def test_sub_folders_are_executions(tmp_path: Path):
    for execution in ("demo10", "demo2"):
        (tmp_path / execution).mkdir()
        write_pair(tmp_path / execution, "log", ("x,y,z", "x,y,z"))
    (tmp_path / "README.txt").write_text("Recorded in May.\nObjects: cube\n")
    recordings = read(tmp_path)
    assert [recording.name for recording in recordings] == ["demo2", "demo10"]
    assert [signal.name for signal in recordings[1].signals] == ["log_objects", "log_robot"]
    assert recordings[1].signals[1].values[0].tolist() == [1, 2, 3]
    assert recordings[0].notes == (
        "files log_objects.csv and log_robot.csv are signals of one execution, by their folder",
    )
    (tmp_path / "demo2" / "log_objects.csv").unlink()
    with pytest.raises(InvalidInput, match="expected files of equal names in each"):
        read(tmp_path)


def test_sub_folders_of_numbered_files_are_refused(tmp_path: Path):
    for folder, n in (("anna", 1), ("anna", 2), ("bob", 1), ("bob", 2)):
        (tmp_path / folder).mkdir(exist_ok=True)
        (tmp_path / folder / f"demo{n}.csv").write_text("x,y\n1,2\n1,2\n")
    with pytest.raises(InvalidInput, match="import each sub-folder"):
        read(tmp_path)


@pytest.mark.parametrize("name", ["README.txt", "readme", "LICENSE", "Notes_may.txt"])
def test_documents_beside_recordings_are_ignored(tmp_path: Path, name: str):
    (tmp_path / "demo1.csv").write_text("x,y\n1,2\n1,2\n")
    (tmp_path / "notes.csv").write_text("x,y\n1,2\n1,2\n")
    (tmp_path / name).write_text("Recorded in May.\nObjects: cube\n")
    assert [recording.name for recording in read(tmp_path)] == ["demo1", "notes"]


def test_files_with_unequal_signals_are_recordings(tmp_path: Path):
    write_pair(tmp_path, "demo1", ("x,y,z", "x,y,z"))
    write_pair(tmp_path, "demo2", ("x,y,z", "a,b,c"))
    (tmp_path / "demo2_objects.csv").unlink()
    assert len(read(tmp_path)) == 3


@pytest.mark.parametrize(
    ("names", "executions"),
    [
        ("demo1_robot demo1_cube demo2_robot demo2_cube", ["demo1", "demo2"]),
        ("demo1_robot demo1_cube", ["demo1"]),
        ("reach_left reach_right place_left place_right", ["place", "reach"]),
        ("cube_demo1 cube_demo2 mug_demo1 mug_demo2", []),
        ("cube1_a cube1_b cube2_a cube2_b", []),
        ("pick_anna pick_bob", []),
        ("demo1_1 demo1_2 demo2_1 demo2_2", []),
    ],
)
def test_names_decide_about_files_with_equal_columns(tmp_path: Path, names: str, executions: list[str]):
    for name in names.split():
        (tmp_path / f"{name}.csv").write_text("time,x,y,z\n0,1,2,3\n0.1,1,2,3\n")
    recordings = read(tmp_path)
    assert [recording.name for recording in recordings] == (executions or sorted(names.split()))
    signals = sorted({name.split("_")[1] for name in names.split()})
    for recording in recordings if executions else []:
        files = " and ".join(f"{recording.name}_{signal}.csv" for signal in signals)
        assert [signal.name for signal in recording.signals] == signals
        assert recording.notes == (f"files {files} are signals of one execution, by their names",)


def huge_npy(shape: bytes) -> bytes:
    out = io.BytesIO()
    np.save(out, np.zeros((2, 2)))
    return out.getvalue().replace(b"(2, 2), ", shape + b", ")


def object_npy() -> bytes:
    out = io.BytesIO()
    np.save(out, np.array([[1.0], [1.0, 2.0]], dtype=object), allow_pickle=True)
    return out.getvalue()


def zip_bomb() -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("x.npy", bytes(2**26))
    data = bytearray(out.getvalue())
    start = data.rindex(b"PK\x01\x02")
    data[start + 24 : start + 28] = struct.pack("<I", 2**31)
    return bytes(data)


def npz(**arrays: np.ndarray) -> bytes:
    out = io.BytesIO()
    np.savez(out, **arrays)  # type: ignore[arg-type]
    return out.getvalue()


@pytest.mark.parametrize(
    ("name", "data", "message"),
    [
        ("a.npy", b"", "not an array"),
        ("a.npy", b"\x93NUMPY", "not an array"),
        ("a.npy", NOISE, "not an array"),
        ("a.npy", huge_npy(b"(99999999, 99)"), "only .* bytes follow"),
        ("a.npy", huge_npy(b"(99999, 99)"), "only .* bytes follow"),
        ("a.npy", object_npy(), "Python objects"),
        ("a.npz", npz(x=np.zeros((2, 2)))[:60], "not an NPZ"),
        ("a.npz", zip_bomb(), "expands to"),
        ("a.npz", npz(text=np.array(["a"])), "a matrix of numbers"),
        ("a.npz", npz(x=np.zeros((0, 3))), "at least one row"),
        ("a.npz", npz(x=np.zeros((3, 2)), labels=np.array(["a"] * 4)), "one entry per row"),
        ("a.npz", npz(x=np.zeros((3, 2, 2)), y=np.zeros((4, 2, 2))), "different lengths"),
        ("a.npz", npz(x=np.zeros((3, 2)), dt=np.array(0.0)), "dt is 0.0"),
        ("a.npz", npz(x=np.zeros((3, 2)), dt=np.array(np.nan)), "dt is nan"),
        ("a.npz", npz(x=np.zeros((3, 2), dtype=complex)), "a matrix of numbers"),
        ("a.npz", npz(x=np.zeros((3, 2)), A0=np.zeros((3, 2, 2)), b0=np.zeros((3, 2))), "read that folder"),
        ("a.mat", b"", "not a MATLAB file"),
        ("a.mat", b"MATLAB 7.3 MAT-file" + bytes(200), "version 7.3"),
        ("a.mat", bytes(512) + b"\x89HDF\r\n\x1a\n" + bytes(100), "'-v7'"),
        ("a.mat", b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + b"\xff" * 64, "a.mat"),
        ("a.bin", NOISE, "no known format"),
    ],
)
def test_damaged_file_is_refused(tmp_path: Path, name: str, data: bytes, message: str):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(InvalidInput, match=message):
        read(tmp_path / name)


@pytest.mark.parametrize("suffix", [".npy", ".npz", ".mat"])
def test_changed_bytes_raise_invalid_input_only(tmp_path: Path, rng: np.random.Generator, suffix: str):
    """A file with random bytes in its header is read or refused, and never raises another error."""
    x, file = rng.normal(size=(6, 3)), tmp_path / f"a{suffix}"
    writers: dict[str, Any] = {".npy": np.save, ".npz": np.savez, ".mat": lambda f, a: savemat(f, {"x": a})}
    writers[suffix](file, x)
    original, outcomes = file.read_bytes(), set()
    for _ in range(150):
        data = bytearray(original)
        if suffix == ".mat":  # SciPy's reader crashes on some damage of elements, hence the text only
            data[int(rng.integers(116))] = int(rng.integers(256))
        else:
            data[int(rng.integers(min(len(data), 128)))] = int(rng.integers(256))
        file.write_bytes(bytes(data))
        try:
            outcomes.add(len(read(file)))
        except InvalidInput as error:
            outcomes.add(str(error).isprintable())
    assert 1 in outcomes


def test_missing_paths_and_empty_folders_are_refused(tmp_path: Path):
    with pytest.raises(InvalidInput, match="missing"):
        read(tmp_path / "none.csv")
    with pytest.raises(InvalidInput, match="no files of recordings"):
        read(tmp_path)
    (tmp_path / "a.bin").write_bytes(b"\x00\x01")
    with pytest.raises(InvalidInput, match=r"a.bin is in no known format"):
        read(tmp_path)
    with pytest.raises(InvalidInput, match="did you mean 'matlab'"):
        read(tmp_path, format="matlb")


def test_missing_library_names_the_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "a.csv").write_text("x,y\n1,2\n3,4\n")

    def fail(*_: object) -> list[Recording]:
        raise ModuleNotFoundError("No module named 'tables'", name="tables")

    monkeypatch.setattr(recognition._import_reader("delimited"), "read", fail)
    with pytest.raises(InvalidInput, match=r"need tables: pip install '.\[io\]' in the clone"):
        read(tmp_path / "a.csv")


def test_formats_are_listed():
    assert len(reader_formats()) == len(recognition.READERS)
