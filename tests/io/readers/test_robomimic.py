"""robomimic reader: files that h5py writes in robomimic's structure."""

import json
from pathlib import Path

import h5py
import numpy as np
import pytest
from laboratory_files import robomimic_demo, write_robomimic

from pilotfish.errors import InvalidInput
from pilotfish.io.readers import hdf5_heaps, robomimic


@pytest.mark.parametrize("options", [{}, {"compression": "gzip", "chunks": True}])
def test_read_returns_every_number(options, rng, tmp_path: Path):
    path = tmp_path / "lift.hdf5"
    demos = {f"demo_{n}": robomimic_demo(rng, 4 + n) for n in (10, 2, 0)}
    write_robomimic(path, demos, **options)
    assert robomimic.recognises(path)
    recordings = list(robomimic.read(path))
    assert [recording.name for recording in recordings] == ["demo_0", "demo_2", "demo_10"]
    for recording in recordings:
        written = demos[recording.name]
        signals = {signal.name: signal for signal in recording.signals}
        assert set(signals) == set(written) - {"obs/agentview_image", "next_obs/robot0_eef_pos"}
        for name, signal in signals.items():
            np.testing.assert_array_equal(signal.values, written[name].reshape(len(signal.values), -1))
        assert recording.signals[0].name.startswith("obs/")
        assert signals["obs/robot0_eef_pos"].columns == ("x", "y", "z")
        assert signals["obs/robot0_eef_quat"].columns == ("x", "y", "z", "w")
        assert signals["datagen_info/eef_pose"].columns[6] == "1,2"
        assert recording.period == 1 / 20
        assert json.loads(recording.attributes["env_args"])["env_name"] == "Lift"
        assert ["agentview_image" in note for note in recording.notes] == [True]


def edit_shape(path: Path) -> None:
    with h5py.File(path, "a") as file:
        del file["data/demo_0/actions"]
        file.create_dataset("data/demo_0/actions", shape=(10**9, 1), chunks=(1000, 1), dtype="f4")


def edit_contiguous(path: Path) -> None:
    with h5py.File(path, "a") as file:
        del file["data/demo_0/actions"]
        file.create_dataset("data/demo_0/actions", shape=(10**7, 1), dtype="f4")


def edit_chunks(path: Path) -> None:
    with h5py.File(path, "a") as file:
        del file["data/demo_0/actions"]
        file.create_dataset(
            "data/demo_0/actions", (10**7, 1), chunks=(1000, 1), compression="gzip", dtype="f4"
        )[:9] = 1


def edit_external(path: Path) -> None:
    with h5py.File(path, "a") as file:
        del file["data/demo_0/actions"]
        external = [("/etc/hostname", 0, 8 * 10)]
        file["data/demo_0"].create_dataset("actions", (10, 1), "u8", external=external)


def edit_virtual(path: Path) -> None:
    with h5py.File(path, "a") as file:
        del file["data/demo_0/actions"]
        layout = h5py.VirtualLayout((10, 1), "f8")
        layout[:] = h5py.VirtualSource("other.hdf5", "x", (10, 1))
        file["data/demo_0"].create_virtual_dataset("actions", layout)


def edit_link(path: Path) -> None:
    with h5py.File(path, "a") as file:
        file["data/demo_0/other"] = h5py.ExternalLink("/etc/passwd", "/data")


def edit_loop(path: Path) -> None:
    with h5py.File(path, "a") as file:
        file["data/demo_0/loop"] = file["data/demo_0"]


def edit_length(path: Path) -> None:
    with h5py.File(path, "a") as file:
        file["data/demo_0/extra"] = np.zeros(3)


def edit_groups(path: Path) -> None:
    with h5py.File(path, "a") as file:
        del file["data/demo_0"]


def edit_group_to_numbers(path: Path) -> None:
    with h5py.File(path, "a") as file:
        del file["data/demo_0"]
        file["data/demo_0"] = np.zeros(3)


def edit_empty(path: Path) -> None:
    with h5py.File(path, "a") as file:
        del file["data/demo_0"]
        file["data"].create_group("demo_0/obs")


def edit_heap(path: Path) -> None:
    """Give free space in the heap of texts the size 0, at which the HDF5 library loops forever."""
    data = bytearray(path.read_bytes())
    position = data.find(b"GCOL") + 16
    while index := int.from_bytes(data[position : position + 2], "little"):
        size = int.from_bytes(data[position + 8 : position + 16], "little")
        position += 16 + size + -size % 8
    assert index == 0
    data[position + 8 : position + 16] = bytes(8)
    path.write_bytes(data)


def edit_type(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file["data"] = 3


@pytest.mark.parametrize(
    ("edit", "match"),
    [
        (edit_shape, "states 4000000000 bytes, expected at most"),
        (edit_contiguous, "states 40000000 bytes, but the file stores 0"),
        (edit_chunks, "states 40000000 bytes, but the file stores"),
        (edit_external, "'actions' is stored in another file"),
        (edit_virtual, "'actions' is stored in another file"),
        (edit_link, "'other' is a link to another place"),
        (edit_loop, "has groups in more than 3 levels"),
        (edit_length, "signals of different lengths"),
        (edit_groups, "expected groups demo_0"),
        (edit_group_to_numbers, "'demo_0' is not a group"),
        (edit_empty, "demo_0 has no data set of numbers"),
        (edit_heap, "the heap of texts at byte [0-9]+ is damaged"),
        (edit_type, "'data' is not a group"),
    ],
)
def test_read_hostile_file_names_file_and_fault(edit, match, rng, tmp_path: Path):
    path = tmp_path / "lift.hdf5"
    write_robomimic(path, {"demo_0": robomimic_demo(rng, 10)})
    edit(path)
    with pytest.raises(InvalidInput, match=rf"lift.hdf5: .*{match}"):
        list(robomimic.read(path))


def test_recognises_other_files_is_false(tmp_path: Path):
    assert not robomimic.recognises(tmp_path)
    assert not robomimic.recognises(tmp_path / "missing")
    (tmp_path / "a.hdf5").write_bytes(robomimic.MAGIC + bytes(100))
    assert not robomimic.recognises(tmp_path / "a.hdf5")
    with h5py.File(tmp_path / "b.hdf5", "w") as file:
        file["x"] = np.zeros(3)
    assert not robomimic.recognises(tmp_path / "b.hdf5")


@pytest.mark.parametrize("start", [0, 4093, 4096, 8191])
def test_damaged_heap_is_found_in_every_block(start: int, tmp_path: Path, monkeypatch):
    """A signature may begin in one block and end in the next."""
    monkeypatch.setattr(hdf5_heaps, "BLOCK", 4096)
    content = bytearray(3 * 4096)
    content[start : start + 8] = hdf5_heaps.SIGNATURE
    content[start + 8 : start + 16] = (2**40).to_bytes(8, "little")  # larger than the file
    file = tmp_path / "a.hdf5"
    file.write_bytes(content)
    with pytest.raises(InvalidInput, match=f"at byte {start} is damaged"):
        hdf5_heaps.require_sound_heaps(file)
