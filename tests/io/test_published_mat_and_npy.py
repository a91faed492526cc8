"""Published MATLAB and NumPy recordings: values, units and frames."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat, savemat

from pilotfish.demonstrations import (
    add_derivatives,
    demonstration,
    diagnose,
    frame_from_pose,
    pose_layout,
    views,
)
from pilotfish.errors import InvalidInput
from pilotfish.geometry import pose, quaternion_from_rotation_matrix
from pilotfish.io.published_matlab import read_valve_mat, read_zshape_mat
from pilotfish.io.published_npy import read_helloworld_npy, read_robotasks_npy


@pytest.fixture(scope="module")
def valve_file(data_folder: Path) -> Path:
    return data_folder / "valve" / "BaxterValveDemos2.mat"


def test_read_valve_mat_equals_published_values(valve_file: Path):
    demonstrations = read_valve_mat(valve_file)
    records = loadmat(valve_file)["s"][0]
    local = views(demonstrations).x.reshape(2, 8, 200, 14)
    for m, (demo, record) in enumerate(zip(demonstrations, records, strict=True)):
        np.testing.assert_array_equal(demo.x, np.vstack([record["Data0"][1:], record["dData0"]]).T)
        np.testing.assert_allclose(np.diff(record["Data0"][0]), demo.period, rtol=1e-12)
        for j, given in enumerate(demo.frames):
            A, b = record["p"][0, j]["A"], record["p"][0, j]["b"][:, 0]
            np.testing.assert_array_equal(given.A, A[1:, 1:])
            np.testing.assert_array_equal(given.b, b[1:])
            published = np.linalg.solve(A, record["Data1"] - b[:, None])[1:].T
            np.testing.assert_allclose(local[j, m], published, atol=1e-12)
    assert demonstrations[4].name == "valve 157.5 deg"
    assert [given.name for given in demonstrations[0].frames] == ["valve before", "valve after"]


def test_read_valve_mat_derivatives_are_forward_differences(valve_file: Path):
    """The last row differs from `add_derivatives`: the file uses a sample beyond its end."""
    for demo in read_valve_mat(valve_file):
        poses = demonstration(demo.x[:, :7], demo.period, pose_layout())
        np.testing.assert_allclose(add_derivatives(poses).x[:-1], demo.x[:-1], atol=1e-14)
        assert 1e-4 < np.abs(add_derivatives(poses).x[-1] - demo.x[-1]).max() < 0.02


def test_read_valve_mat_frames_equal_frames_from_poses(valve_file: Path):
    """R acts on positions, left multiplication on quaternions."""
    demo = read_valve_mat(valve_file)[0]
    for given in demo.frames:
        turn = quaternion_from_rotation_matrix(given.A[:3, :3])
        sign = np.sign(turn[0] * given.A[3, 3])  # the file's quaternion may be the negative
        ours = frame_from_pose(given.name, demo.layout, pose(given.b[:3], sign * turn))
        np.testing.assert_allclose(ours.A, given.A, atol=2e-6)  # the file has six digits
        np.testing.assert_array_equal(ours.b, given.b)


def test_read_valve_mat_frame_angle_equals_name(valve_file: Path):
    for demo in read_valve_mat(valve_file):
        before, after = (given.A[:3, :3] for given in demo.frames)
        turned = np.degrees(np.arccos((np.trace(before.T @ after) - 1) / 2))
        assert abs(turned - float(demo.name.split()[1])) < 20


def test_read_valve_mat_has_no_warnings(valve_file: Path):
    """The only diagnostic is the constant frame after."""
    demonstrations = read_valve_mat(valve_file)
    (only,) = diagnose(demonstrations)
    assert (only.severity, only.location) == ("note", "frame 'valve after'")
    for later in demonstrations[1:]:
        assert np.sum(later.x[:, 3:7] * demonstrations[0].x[:, 3:7]) > 0.0


def test_read_zshape_mat_equals_published_values(data_folder: Path):
    demonstrations = read_zshape_mat(data_folder / "zshape" / "Zshape3D.mat")
    data = loadmat(data_folder / "zshape" / "Zshape3D.mat")["Data"]
    assert len(demonstrations) == 5
    np.testing.assert_array_equal(np.vstack([demo.x for demo in demonstrations]), data[1:].T)
    np.testing.assert_array_equal(data[0].reshape(5, 300)[0], np.arange(1, 301))
    assert add_derivatives(demonstrations[0]).layout.width == 6


@pytest.mark.parametrize("task", ["openbox", "bottle2shelf", "platestandingtolying", "pouring"])
def test_read_robotasks_npy_is_in_metres(data_folder: Path, task: str):
    file = data_folder / "robotasks" / f"{task}.npy"
    demonstrations, raw = read_robotasks_npy(file), np.load(file)
    for demo, published in zip(demonstrations, raw, strict=True):
        np.testing.assert_allclose(demo.x[:, :3], published[:, :3] / 100, rtol=1e-15)
        np.testing.assert_array_equal(demo.x[:, 3:], published[:, 3:])
        assert np.abs(demo.x[:, :3]).max() < 1.0  # m, within reach of the arm
    for later in demonstrations[1:]:
        assert np.sum(later.x[:, 3:7] * demonstrations[0].x[:, 3:7]) > 0.0


@pytest.mark.parametrize("letter", ["h", "e", "l", "o"])
def test_read_helloworld_npy_is_in_metres(data_folder: Path, letter: str):
    file = data_folder / "helloworld" / f"{letter}.npy"
    demonstrations = read_helloworld_npy(file)
    np.testing.assert_allclose(np.stack([demo.x for demo in demonstrations]), np.load(file) / 100, rtol=1e-15)
    assert demonstrations[0].layout.names == ("position x", "position y")


READERS = [read_valve_mat, read_zshape_mat, read_robotasks_npy, read_helloworld_npy]


@pytest.mark.parametrize("read", READERS)
@pytest.mark.parametrize(
    "content", [b"", b"rubbish", b"MATLAB 5.0 MAT-file" + bytes(200), b"\x93NUMPY\x01\x00v\x00{"]
)
def test_published_readers_damaged_file_raises(tmp_path: Path, read, content: bytes):
    file = tmp_path / "file"
    with pytest.raises(InvalidInput, match="file"):
        read(file)
    file.write_bytes(content)
    with pytest.raises(InvalidInput, match="file"):
        read(file)


def test_published_readers_other_recording_raises(tmp_path: Path):
    savemat(tmp_path / "a.mat", {"Data": np.zeros((4, 300)), "s": np.zeros(3)})
    for read in (read_valve_mat, read_zshape_mat):
        with pytest.raises(InvalidInput, match=r"a\.mat"):
            read(tmp_path / "a.mat")
    savemat(tmp_path / "a.mat", {"q": np.zeros(3), "s": [{"Data0": np.zeros((8, 2))}] * 8})
    with pytest.raises(InvalidInput, match=r"variables q, s, expected 'Data'"):
        read_zshape_mat(tmp_path / "a.mat")
    with pytest.raises(InvalidInput, match="not of the valve recording: 'dData0'"):
        read_valve_mat(tmp_path / "a.mat")
    np.save(tmp_path / "a.npy", np.zeros((2, 5, 6)))
    for read, width in ((read_robotasks_npy, 7), (read_helloworld_npy, 2)):
        with pytest.raises(InvalidInput, match=rf"shape \(2, 5, 6\), expected \(M, T, {width}\)"):
            read(tmp_path / "a.npy")


@pytest.mark.parametrize(("read", "width"), [(read_robotasks_npy, 7), (read_helloworld_npy, 2)])
@pytest.mark.parametrize("bad", [np.inf, np.nan, np.uint64(0xFFF0000000000001).view(np.float64)])
def test_npy_readers_not_finite_number_raises(
    read: Callable[[Path], object], width: int, bad: float, tmp_path: Path
) -> None:
    """The third is a signalling NaN, which warns in any multiplication."""
    np.save(tmp_path / "x.npy", np.full((2, 5, width), bad))
    with pytest.raises(InvalidInput, match="finite"):
        read(tmp_path / "x.npy")
