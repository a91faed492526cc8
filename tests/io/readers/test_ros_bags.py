"""Reader of ROS recordings that the writers of rosbags wrote: ROS 1, rosbag2 in SQLite and in MCAP."""

import sqlite3
from pathlib import Path

import numpy as np
import pytest
from laboratory_files import START, BagWriter, write_bag
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode

from pilotfish.errors import InvalidInput
from pilotfish.io.readers import ros_bags, ros_storage

KINDS = pytest.mark.parametrize("kind", ["ros1", "mcap", "sqlite"])
POSE, JOINT, TRANSFORMS = (
    "geometry_msgs/msg/PoseStamped",
    "sensor_msgs/msg/JointState",
    "tf2_msgs/msg/TFMessage",
)
POSE_COLUMNS = (
    *(f"position.{axis}" for axis in "xyz"),
    *(f"orientation.{axis}" for axis in "xyzw"),
)


def bag_path(folder: Path, kind: str) -> Path:
    return folder / ("take_1.bag" if kind == "ros1" else "take_1")


@KINDS
def test_read_every_number_and_time_is_equal(kind, rng, tmp_path: Path):
    x, path = rng.normal(size=(20, 7)), bag_path(tmp_path, kind)
    write_bag(path, kind, x)
    assert ros_bags.recognises(path)
    (recording,) = ros_bags.read(path)
    signals = {signal.name: signal for signal in recording.signals}
    assert set(signals) == {"/tool_pose", "/joint_states", "/tf/cube", "/tf/bin", "/gripper", "/closed"}
    np.testing.assert_array_equal(signals["/tool_pose"].values, x)
    assert signals["/tool_pose"].columns == POSE_COLUMNS
    assert signals["/tool_pose"].units == ("m", "m", "m", "1", "1", "1", "1")
    np.testing.assert_array_equal(signals["/joint_states"].values, x[:, :4])
    expected = ("position.elbow", "position.wrist", "velocity.elbow", "velocity.wrist")
    assert signals["/joint_states"].columns == expected
    np.testing.assert_array_equal(signals["/tf/cube"].values, x[:, ::-1])
    np.testing.assert_array_equal(signals["/closed"].values[:, 0], x[:, 0] > 0)
    steps = np.arange(20) * 33_333_333
    np.testing.assert_array_equal(signals["/tool_pose"].times, steps / 1e9)  # stamps
    np.testing.assert_array_equal(signals["/gripper"].times, (steps + 5_000_000) / 1e9)  # receipt
    assert recording.attributes == {"start_ns": str(START - 5_000_000)}
    assert recording.name == "take_1"
    assert "/note is left out: std_msgs/msg/String" in recording.notes
    assert "/tf/cube is relative to frame 'world'" in recording.notes


@pytest.mark.parametrize("compression", ["bz2", "lz4"])
def test_read_compressed_ros1_bag_is_equal(compression, rng, tmp_path: Path):
    x = rng.normal(size=(5, 7))
    form = Writer1.CompressionFormat[compression.upper()]
    write_bag(tmp_path / "a.bag", "ros1", x, compression=(form,))
    (recording,) = ros_bags.read(tmp_path / "a.bag", topics=["/tool_pose"])
    np.testing.assert_array_equal(recording.signals[0].values, x)


@pytest.mark.parametrize(
    ("kind", "mode"),
    [("mcap", "STORAGE"), ("mcap", "MESSAGE"), ("mcap", "FILE"), ("sqlite", "MESSAGE"), ("sqlite", "FILE")],
)
def test_read_compressed_ros2_bag_is_equal(kind, mode, rng, tmp_path: Path):
    x = rng.normal(size=(5, 7))
    write_bag(tmp_path / "a", kind, x, compression=(CompressionMode[mode], CompressionFormat.ZSTD))
    (recording,) = ros_bags.read(tmp_path / "a", topics=["/tool_pose"])
    np.testing.assert_array_equal(recording.signals[0].values, x)


@pytest.mark.parametrize("kind", ["mcap", "sqlite"])
def test_read_single_storage_file_is_equal(kind, rng, tmp_path: Path):
    x = rng.normal(size=(5, 7))
    write_bag(tmp_path / "a", kind, x)
    (file,) = (tmp_path / "a").glob("*.mcap" if kind == "mcap" else "*.db3")
    assert ros_bags.recognises(file)
    (recording,) = ros_bags.read(file)
    np.testing.assert_array_equal(recording.signals[0].values, x)


def test_read_folder_of_bags_in_natural_order(rng, tmp_path: Path):
    for number in (10, 2, 1):
        write_bag(tmp_path / f"take_{number}", "mcap", rng.normal(size=(number, 7)))
    recordings = list(ros_bags.read(tmp_path))
    assert [recording.name for recording in recordings] == ["take_1", "take_2", "take_10"]
    assert [len(recording.signals[0].values) for recording in recordings] == [1, 2, 10]


def test_read_topics_chooses_and_names_unknown_one(rng, tmp_path: Path):
    write_bag(tmp_path / "a", "mcap", rng.normal(size=(3, 7)))
    (recording,) = ros_bags.read(tmp_path / "a", topics=["/gripper", "/tf"])
    assert [signal.name for signal in recording.signals] == ["/tf/cube", "/tf/bin", "/gripper"]
    with pytest.raises(InvalidInput, match=r"no topic '/griper'.*did you mean '/gripper'\?"):
        list(ros_bags.read(tmp_path / "a", topics=["/griper"]))
    with pytest.raises(InvalidInput, match="no topic with numbers to read"):
        list(ros_bags.read(tmp_path / "a", topics=["/note"]))


def test_read_stamps_far_from_receipt_are_not_used(tmp_path: Path):
    """A simulation stamps with its own clock, from 0, and then topics without stamps would not fit."""
    with BagWriter(tmp_path / "a", "mcap") as bag:
        for step in range(3):
            header = bag.header((step + 1) * 10**9)
            bag.put("/p", POSE, START + step * 10**8, header=header, pose=bag.pose(np.eye(7)[6]))
    (recording,) = ros_bags.read(tmp_path / "a")
    np.testing.assert_array_equal(recording.signals[0].times, [0, 0.1, 0.2])
    assert "its stamps differ by up to 1.7e+09 s from the times of receipt" in recording.notes[0]


def test_read_different_joints_and_parents_are_different_signals(tmp_path: Path):
    """Arm and gripper publish on one topic; a frame that changes its parent is two signals."""
    with BagWriter(tmp_path / "a", "sqlite") as bag:
        for step in range(4):
            names, time = (["arm"], ["finger", "thumb"])[step % 2], START + step
            fields = dict.fromkeys(("velocity", "effort"), np.zeros(0))
            position = np.full(len(names), float(step))
            bag.put("/joints", JOINT, time, header=bag.header(time), name=names, position=position, **fields)
            moved = bag.transform("cube", time, np.ones(7), ("world", "hand")[step // 2])
            bag.put("/tf", TRANSFORMS, time, transforms=[moved])
    (recording,) = ros_bags.read(tmp_path / "a")
    found = {signal.name: signal.values.shape for signal in recording.signals}
    expected = {"/joints": (2, 1), "/joints (2)": (2, 2), "/tf/cube": (2, 7), "/tf/cube in hand": (2, 7)}
    assert found == expected


def test_read_view_in_place_of_table_is_refused(rng, tmp_path: Path):
    """An endless view would be read forever."""
    write_bag(tmp_path / "a", "sqlite", rng.normal(size=(3, 7)))
    (file,) = (tmp_path / "a").glob("*.db3")
    with sqlite3.connect(file) as database:
        database.execute("ALTER TABLE messages RENAME TO old")
        query = "WITH RECURSIVE r(n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM r)"
        database.execute(f"CREATE VIEW messages AS {query} SELECT n AS id, n AS topic_id FROM r")
    database.close()
    with pytest.raises(InvalidInput, match=r"'messages' is .*CREATE VIEW.*, expected a table"):
        list(ros_bags.read(tmp_path / "a"))


def test_read_chunk_that_expands_beyond_bound_is_refused(monkeypatch, tmp_path: Path):
    monkeypatch.setattr(ros_storage, "MAX_CHUNK_BYTES", 10_000)
    options = {"compression": (CompressionMode.STORAGE, CompressionFormat.ZSTD)}
    write_bag(tmp_path / "a", "mcap", np.ones((200, 7)), **options)
    with pytest.raises(InvalidInput, match="a chunk expands to more than 10000 bytes"):
        list(ros_bags.read(tmp_path / "a"))
    write_bag(tmp_path / "a.bag", "ros1", np.ones((200, 7)), compression=(Writer1.CompressionFormat.LZ4,))
    with pytest.raises(InvalidInput, match="a chunk expands to more than 10000 bytes"):
        list(ros_bags.read(tmp_path / "a.bag"))


def test_recognises_other_files_is_false(tmp_path: Path):
    for name in ("a.bag", "a.mcap", "a.db3"):
        (tmp_path / name).write_bytes(b"\x89MCAP0\r\n and no ROS")
        assert not ros_bags.recognises(tmp_path / name)
    assert not ros_bags.recognises(tmp_path)
    with pytest.raises(InvalidInput, match="not a ROS recording"):
        ros_bags.read(tmp_path)


@KINDS
def test_read_pose_of_camera_is_in_base_of_tool(kind, rng, tmp_path: Path):
    """The camera hangs 1 m above the base and looks down: its y and z axes are turned about x."""
    path, down = bag_path(tmp_path, kind), np.array([0.5, 0.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    with BagWriter(path, kind) as bag:
        bag.put("/tf_static", TRANSFORMS, START, transforms=[bag.transform("camera", START, down, "base")])
        for step in range(3):
            time = START + step * 10**8
            tool = {"header": bag.header(time), "pose": bag.pose(np.eye(7)[6])}
            seen = bag.pose(np.array([0.1, 0.2, 0.9, 0.0, 0.0, 0.0, 1.0]))
            bag.put("/tool", POSE, time, **tool)
            bag.put("/cube", POSE, time, header=bag.header(time, "camera"), pose=seen)
    (recording,) = ros_bags.read(path)
    signals = {signal.name: signal for signal in recording.signals}
    assert {name: signal.reference_frame for name, signal in signals.items()} == {
        "/tool": "base",
        "/cube": "base",
    }
    expected = np.tile([0.6, -0.2, 0.1, 1.0, 0.0, 0.0, 0.0], (3, 1))
    np.testing.assert_allclose(signals["/cube"].values, expected, atol=1e-12)
    assert "/cube: poses in frame 'camera' converted to frame 'base'" in recording.notes
