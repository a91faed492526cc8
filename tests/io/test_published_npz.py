"""Published NPZ extracts: values, units, names and labels."""

from pathlib import Path

import numpy as np
import pytest

from pilotfish.errors import InvalidInput
from pilotfish.io.published_npz import (
    read_chicken_dance_npz,
    read_letters_npz,
    read_mocap6_labels_npz,
    read_mocap6_npz,
)

READERS = [read_chicken_dance_npz, read_mocap6_npz, read_mocap6_labels_npz, read_letters_npz]
DANCE, EXERCISES = "chicken_dance/cmu_18_15_chicken_dance.npz", "mocap6/mocap6_dev.npz"


def test_read_chicken_dance_npz_equals_file(data_folder: Path):
    (demo,) = read_chicken_dance_npz(data_folder / DANCE)
    with np.load(data_folder / DANCE) as held:
        np.testing.assert_array_equal(demo.x.reshape(-1, 28, 3), held["node_pos"])
        assert [part.name for part in demo.layout.parts] == held["node_names"].tolist()
        head = held["node_pos"][:, held["node_names"].tolist().index("Head")]
    np.testing.assert_array_equal(demo.x[:, demo.layout.columns("Head")], head)
    assert demo.period == pytest.approx(1 / 120)
    assert set(demo.layout.units) == {"m"}


def test_read_chicken_dance_npz_is_in_metres(data_folder: Path):
    """From toes to the top of the head the person is 1.4 to 1.9 m tall, and y points up."""
    (demo,) = read_chicken_dance_npz(data_folder / DANCE)
    tall = demo.x[:, demo.layout.columns("Head_end")] - demo.x[:, demo.layout.columns("LeftToeBase")]
    assert 1.4 < tall[0, 1] < 1.9
    assert np.abs(tall[0, [0, 2]]).max() < 0.4


def test_read_mocap6_npz_is_in_metres_and_radians(data_folder: Path):
    """The unit of length is an inch divided by 0.45, as CMU states: 0.056444 m."""
    demonstrations = read_mocap6_npz(data_folder / EXERCISES)
    with np.load(data_folder / EXERCISES) as held:
        for n, demo in zip((0, 1, 3, 4), demonstrations, strict=True):
            np.testing.assert_allclose(demo.x[:, 1:], np.radians(held[f"x{n}"][:, 1:]), rtol=1e-14)
            np.testing.assert_allclose(demo.x[:, 0], 0.056444 * held[f"x{n}"][:, 0], rtol=1e-4)
            assert 0.05 < np.ptp(demo.x[:, 0]) < 1.0  # m, a jump or a squat moves the hips no further
    assert demonstrations[0].layout.units == ("m", *["rad"] * 11)
    assert [demo.name[-5:] for demo in demonstrations] == ["13_29", "13_30", "14_06", "14_14"]
    assert {demo.period for demo in demonstrations} == {0.1}


def test_read_mocap6_labels_npz_has_label_for_every_step(data_folder: Path):
    """All sequences begin with jumping jacks, in which the hips rise."""
    demonstrations = read_mocap6_npz(data_folder / EXERCISES)
    labels = read_mocap6_labels_npz(data_folder / EXERCISES)
    assert [len(of) for of in labels] == [len(demo.x) for demo in demonstrations]
    assert set(np.concatenate(labels)) == {1, 2, 3, 4, 5, 6, 7, 8, 10, 11}
    for demo, of in zip(demonstrations, labels, strict=True):
        assert of[0] == 1
        highest = {action: demo.x[of == action, 0].max() for action in np.unique(of)}
        assert highest[1] >= sorted(highest.values())[-2]
        assert not of.flags.writeable


def test_read_letters_npz_is_velocity_and_force(data_folder: Path):
    """A letter ends where the pen is lifted, with velocities near zero."""
    file = data_folder / "letters" / "uci_letters_dev.npz"
    demonstrations = read_letters_npz(file)
    with np.load(file) as held:
        for demo, name in zip(demonstrations, held.files, strict=True):
            np.testing.assert_array_equal(demo.x, held[name])
    assert demonstrations[0].layout.names == ("position x'", "position y'", "force")
    assert [demo.name for demo in demonstrations[4:6]] == ["letter a 5", "letter b 1"]
    assert {demo.period for demo in demonstrations} == {0.005}
    assert max(np.abs(demo.x[-1, :2]).max() for demo in demonstrations) < 0.3


@pytest.mark.parametrize("read", READERS)
@pytest.mark.parametrize(
    "content",
    [None, b"", b"rubbish", b"PK\x03\x04" + bytes(60)],
    ids=["missing", "empty", "rubbish", "cut short"],
)
def test_npz_readers_damaged_file_raises(tmp_path: Path, read, content: bytes | None):
    file = tmp_path / "file.npz"
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(InvalidInput, match=r"file\.npz( cannot be read|: not an NPZ file)"):
        read(file)


@pytest.mark.parametrize(
    ("read", "held", "message"),
    [
        (read_chicken_dance_npz, {}, r"not this recording: 'node_pos' \(it has no arrays\)"),
        (read_chicken_dance_npz, {"node_pos": np.zeros((9, 2, 2)), "node_names": ["a", "b"]}, r"\(9, 2, 2\)"),
        (read_mocap6_npz, {"A_0": np.zeros((9, 3))}, "it has A_0, expected sequences x0"),
        (read_mocap6_npz, {"x0": np.zeros((9, 3))}, r"x0 has shape \(9, 3\), expected \(T, 12\)"),
        (read_mocap6_npz, {"x0": np.full((9, 12), np.nan)}, "file.npz: .*'hips up' is nan"),
        (read_mocap6_labels_npz, {"x0": np.zeros((9, 12))}, "not this recording: 'label0'"),
        (read_mocap6_labels_npz, {"x0": np.zeros((9, 12)), "label0": np.ones(8, dtype=int)}, "expected 9"),
        (
            read_mocap6_labels_npz,
            {"x0": np.zeros((9, 12)), "label0": np.ones(9)},
            "float64, expected 9 whole",
        ),
        (read_letters_npz, {"x0": np.zeros((9, 3))}, "it has x0, expected letters A_0"),
        (read_letters_npz, {"A_0": np.zeros((9, 2))}, "2 columns, but its layout has 3"),
    ],
)
def test_npz_readers_other_archive_raises(tmp_path: Path, read, held, message: str):
    np.savez(tmp_path / "file.npz", **held)
    with pytest.raises(InvalidInput, match=message):
        read(tmp_path / "file.npz")
