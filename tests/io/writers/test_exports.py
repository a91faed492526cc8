"""Round trips: export and import give the demonstrations back bit by bit, in the structure of each format."""

import json
from pathlib import Path

import h5py
import numpy as np
import pyarrow.parquet as pq
import pytest
from random_demonstrations import DemonstrationMaker
from rosbags.highlevel import AnyReader

from pilotfish.demonstrations import Demonstration, demonstration, position_layout
from pilotfish.errors import InvalidInput
from pilotfish.io.demonstration_descriptions import restore_demonstration
from pilotfish.io.readers import lerobot, robomimic, ros_bags
from pilotfish.io.writers import lerobot_dataset, robomimic_file, ros_mcap

FORMATS = pytest.mark.parametrize(
    ("writer", "reader"),
    [(lerobot_dataset, lerobot), (robomimic_file, robomimic), (ros_mcap, ros_bags)],
    ids=["lerobot", "robomimic", "mcap"],
)


def require_equal(restored: Demonstration, demo: Demonstration) -> None:
    assert restored.x.tobytes() == demo.x.tobytes()
    assert (restored.period, restored.layout, restored.name) == (demo.period, demo.layout, demo.name)
    assert [frame.name for frame in restored.frames] == [frame.name for frame in demo.frames]
    for frame, expected in zip(restored.frames, demo.frames, strict=True):
        assert frame.A.tobytes() == expected.A.tobytes()
        assert frame.b.tobytes() == expected.b.tobytes()
        assert type(frame) is type(expected)


def restore(reader, path: Path) -> list[Demonstration]:
    assert reader.recognises(path)
    restored = [restore_demonstration(recording) for recording in reader.read(path)]
    assert all(demo is not None for demo in restored)
    return [demo for demo in restored if demo is not None]


@FORMATS
@pytest.mark.parametrize("moving", [False, True])
def test_export_and_import_is_exact(writer, reader, moving, rng, make: DemonstrationMaker, tmp_path: Path):
    demos = [make(int(rng.integers(2, 40)), make.mixed, moving=moving, name=f"take {n}") for n in range(12)]
    writer.write(demos, tmp_path / "out.hdf5")
    for demo, restored in zip(demos, restore(reader, tmp_path / "out.hdf5"), strict=True):
        require_equal(restored, demo)


@FORMATS
def test_export_of_extreme_numbers_and_odd_names_is_exact(writer, reader, tmp_path: Path):
    x = [[-0.0, 5e-324], [1e100, 1 / 3], [2.0**-1074, -1e100]]
    demo = demonstration(x, 1 / 29.97, position_layout(2), name="ü / \"quoted\" 'name'")
    writer.write([demo], tmp_path / "out.hdf5")
    require_equal(restore(reader, tmp_path / "out.hdf5")[0], demo)


@FORMATS
def test_export_of_generator_is_exact(writer, reader, make, tmp_path: Path):
    demos = [make(5, name=str(n)) for n in range(4)]
    writer.write(iter(demos), tmp_path / "out.hdf5")
    for demo, restored in zip(demos, restore(reader, tmp_path / "out.hdf5"), strict=True):
        require_equal(restored, demo)


@FORMATS
def test_export_refuses_existing_and_foreign_targets(writer, reader, make, tmp_path: Path):
    target = tmp_path / "out.hdf5"
    writer.write([make()], target)
    with pytest.raises(InvalidInput, match="exists"):
        writer.write([make()], target)
    writer.write([make(name="new")], target, overwrite=True)
    assert restore(reader, target)[0].name == "new"
    assert [path.name for path in tmp_path.iterdir()] == ["out.hdf5"]
    foreign = tmp_path / "thesis"
    foreign.mkdir()
    (foreign / "chapter.txt").write_text("text")
    with pytest.raises(InvalidInput):
        writer.write([make()], foreign, overwrite=True)
    assert (foreign / "chapter.txt").read_text() == "text"


@FORMATS
def test_export_that_fails_leaves_nothing(writer, reader, make, unchecked, tmp_path: Path):
    different = demonstration(make().x, 0.1, make().layout)
    for demos, match in (([], "no demonstrations"), ([make(), different], "differs"), ([3], "type int")):
        with pytest.raises(InvalidInput, match=match):
            writer.write(demos, tmp_path / "out.hdf5")
    assert not list(tmp_path.iterdir())


def test_lerobot_export_has_what_lerobot_reads(make, tmp_path: Path):
    demos = [make(steps) for steps in (5, 9)]
    lerobot_dataset.write(demos, tmp_path / "set", task="fill the cup", robot="panda")
    meta = tmp_path / "set" / "meta"
    info = json.loads((meta / "info.json").read_text())
    assert (info["fps"], info["total_frames"], info["splits"]) == (20, 14, {"train": "0:2"})
    episodes = pq.read_table(meta / "episodes" / "chunk-000" / "file-000.parquet").to_pylist()
    assert [episode["dataset_to_index"] for episode in episodes] == [5, 14]
    rows = pq.read_table(tmp_path / "set" / info["data_path"].format(chunk_index=0, file_index=0))
    assert set(rows.column_names) == set(info["features"])
    x = np.concatenate([demo.x for demo in demos])
    np.testing.assert_array_equal(np.stack(rows["observation.state"].to_numpy()), x)
    actions = np.stack(rows["action"].to_numpy())
    np.testing.assert_array_equal(actions[:4], x[1:5])
    np.testing.assert_array_equal(actions[4], x[4])
    stats = json.loads((meta / "stats.json").read_text())["observation.state"]
    np.testing.assert_allclose(stats["mean"], x.mean(axis=0), rtol=0, atol=1e-13)
    np.testing.assert_allclose(stats["std"], x.std(axis=0), rtol=1e-12)
    tasks = pq.read_table(meta / "tasks.parquet")
    assert json.loads(tasks.schema.metadata[b"pandas"])["index_columns"] == ["task"]
    assert tasks.to_pylist() == [{"task_index": 0, "task": "fill the cup"}]


def test_lerobot_export_of_many_files_is_exact(make, monkeypatch, tmp_path: Path):
    monkeypatch.setattr(lerobot_dataset, "FILE_BYTES", 1000)
    monkeypatch.setattr(lerobot_dataset, "FILES_PER_CHUNK", 3)
    demos = [make(9, name=str(n)) for n in range(12)]
    lerobot_dataset.write(demos, tmp_path / "set")
    assert len(list((tmp_path / "set" / "data").glob("chunk-*/file-*.parquet"))) == 12
    for demo, restored in zip(demos, restore(lerobot, tmp_path / "set"), strict=True):
        require_equal(restored, demo)


def test_robomimic_export_has_what_robomimic_reads(make, tmp_path: Path):
    demo = make(6, make.mixed)
    robomimic_file.write([demo], tmp_path / "out.hdf5")
    with h5py.File(tmp_path / "out.hdf5") as file:
        group = file["data/demo_0"]
        assert json.loads(file["data"].attrs["env_args"])["env_kwargs"] == {"control_freq": 20}
        assert (file["data"].attrs["total"], group.attrs["num_samples"]) == (6, 6)
        assert set(group["obs"]) == {"time", "position", "orientation", "force", "joints"}
        np.testing.assert_array_equal(group["actions"][:-1], demo.x[1:])
        np.testing.assert_array_equal(group["dones"], [0, 0, 0, 0, 0, 1])
    (recording,) = robomimic.read(tmp_path / "out.hdf5")
    columns = {signal.name: (signal.columns, signal.units) for signal in recording.signals}
    assert columns["obs/orientation"] == (tuple(f"orientation {axis}" for axis in "wxyz"), ("1",) * 4)
    assert columns["obs/joints"][1] == ("rad", "rad")


def test_mcap_export_is_read_by_rosbags_as_poses_and_joints(make, tmp_path: Path):
    demo = make(6, make.mixed)
    ros_mcap.write([demo], tmp_path / "out")
    poses, times, joints = [], [], []
    with AnyReader([tmp_path / "out" / "demo_0"]) as bag:
        for connection, _, data in bag.messages():
            message = bag.deserialize(data, connection.msgtype)
            if connection.topic == "/pose":
                p, q = message.pose.position, message.pose.orientation
                poses.append([p.x, p.y, p.z, q.w, q.x, q.y, q.z])
                times.append(message.header.stamp.sec + message.header.stamp.nanosec * 1e-9)
            elif connection.topic == "/joint_states":
                joints.append(message.position)
                assert message.name == ["joints 1", "joints 2"]
    np.testing.assert_array_equal(poses, demo.x[:, 1:8])
    np.testing.assert_array_equal(joints, demo.x[:, 11:])
    np.testing.assert_allclose(times, np.arange(6) * demo.period, rtol=0, atol=1e-9)
