"""Files of other projects, written with their own libraries and without pilotfish."""

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

Episode = dict[str, np.ndarray]
TASKS = ["pick the cube", "open the drawer"]
START = 1_700_000_000_000_000_000  # ns
STATE_NAMES = ["x", "y", "z", "gripper"]


def random_episodes(rng: np.random.Generator, lengths: tuple[int, ...]) -> list[Episode]:
    """Return states (T, 4) and actions (T, 2) as float32, and the task of each episode."""
    return [
        {
            "observation.state": rng.normal(size=(steps, 4)).astype(np.float32),
            "action": rng.normal(size=(steps, 2)).astype(np.float32),
            "task_index": np.full(steps, n % 2),
        }
        for n, steps in enumerate(lengths)
    ]


def lerobot_info(version: str, fps: int = 30) -> dict[str, Any]:
    """Return info.json with a video and an image, whose names are tables and lists as in published sets."""
    number = {"dtype": "int64", "shape": [1], "names": None}
    return {
        "codebase_version": version,
        "robot_type": "so100",
        "fps": fps,
        "data_path": "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet",
        "features": {
            "observation.state": {"dtype": "float32", "shape": [4], "names": {"motors": STATE_NAMES}},
            "action": {"dtype": "float32", "shape": [2], "names": None},
            "observation.images.top": {"dtype": "video", "shape": [480, 640, 3], "names": None},
            "next.done": {"dtype": "bool", "shape": [1], "names": None},
            "timestamp": {"dtype": "float32", "shape": [1], "names": None},
            **dict.fromkeys(("frame_index", "episode_index", "index", "task_index"), number),
        },
    }


def episode_table(episode: Episode, number: int, fps: int = 30) -> pa.Table:
    """Return the rows of an episode as LeRobot stores them."""
    steps = len(episode["action"])
    return pa.table(
        {
            "observation.state": pa.array(list(episode["observation.state"]), pa.list_(pa.float32(), 4)),
            "action": pa.array(list(episode["action"]), pa.list_(pa.float32())),
            "next.done": pa.array([False] * (steps - 1) + [True]),
            "timestamp": pa.array((np.arange(steps) / fps).astype(np.float32)),
            "frame_index": pa.array(np.arange(steps)),
            "episode_index": pa.array(np.full(steps, number)),
            "index": pa.array(np.arange(steps)),
            "task_index": pa.array(episode["task_index"]),
        }
    )


def write_lerobot_v21(folder: Path, episodes: list[Episode]) -> None:
    """Write a data set of version 2.1: JSON lines, and a Parquet file per episode."""
    (folder / "meta").mkdir(parents=True)
    (folder / "meta" / "info.json").write_text(json.dumps(lerobot_info("v2.1")))
    tasks = [json.dumps({"task_index": n, "task": task}) for n, task in enumerate(TASKS)]
    (folder / "meta" / "tasks.jsonl").write_text("\n".join(tasks) + "\n")
    lines = [
        json.dumps({"episode_index": n, "tasks": [TASKS[n % 2]], "length": len(episode["action"])})
        for n, episode in enumerate(episodes)
    ]
    (folder / "meta" / "episodes.jsonl").write_text("\n".join(lines) + "\n")
    for n, episode in enumerate(episodes):
        file = folder / "data" / f"chunk-{n // 1000:03d}" / f"episode_{n:06d}.parquet"
        file.parent.mkdir(parents=True, exist_ok=True)
        pq.write_table(episode_table(episode, n), file)


def write_lerobot_v3(folder: Path, episodes: list[Episode], row_group: int = 7, files: int = 2) -> None:
    """Write a data set of version 3, whose row groups and files do not end with episodes."""
    (folder / "meta" / "episodes" / "chunk-000").mkdir(parents=True)
    (folder / "data" / "chunk-000").mkdir(parents=True)
    (folder / "meta" / "info.json").write_text(json.dumps(lerobot_info("v3.0")))
    table = pa.concat_tables([episode_table(episode, n) for n, episode in enumerate(episodes)])
    bounds = np.linspace(0, len(table), files + 1).astype(int)
    for n, (start, end) in enumerate(pairwise(bounds)):
        file = folder / "data" / "chunk-000" / f"file-{n:03d}.parquet"
        pq.write_table(table.slice(start, end - start), file, row_group_size=row_group)
    lengths = [len(episode["action"]) for episode in episodes]
    meta = pa.table({"episode_index": list(range(len(episodes))), "length": lengths})
    pq.write_table(meta, folder / "meta" / "episodes" / "chunk-000" / "file-000.parquet")
    tasks = pa.table({"task_index": list(range(len(TASKS))), "__index_level_0__": TASKS})
    pq.write_table(tasks, folder / "meta" / "tasks.parquet")


def write_robomimic(path: Path, demos: dict[str, dict[str, np.ndarray]], **options: Any) -> None:
    """Write demonstrations of data sets by path, as robomimic does."""
    with h5py.File(path, "w") as file:
        data = file.create_group("data")
        data.attrs["env_args"] = json.dumps({"env_name": "Lift", "env_kwargs": {"control_freq": 20}})
        for name, datasets in demos.items():
            group = data.create_group(name)
            group.attrs["num_samples"] = len(datasets["actions"])
            group.attrs["model_file"] = "<mujoco/>"
            for place, values in datasets.items():
                group.create_dataset(place, data=values, **options)
        file.create_group("mask")["train"] = np.array([name.encode() for name in demos])


def robomimic_demo(rng: np.random.Generator, steps: int) -> dict[str, np.ndarray]:
    """Return the data sets of one demonstration, with images and matrices."""
    return {
        "actions": rng.normal(size=(steps, 7)),
        "obs/robot0_eef_pos": rng.normal(size=(steps, 3)),
        "obs/robot0_eef_quat": rng.normal(size=(steps, 4)),
        "obs/agentview_image": np.zeros((steps, 8, 8, 3), np.uint8),
        "next_obs/robot0_eef_pos": rng.normal(size=(steps, 3)),
        "datagen_info/eef_pose": rng.normal(size=(steps, 4, 4)),
        "rewards": rng.normal(size=steps),
        "dones": np.arange(steps) == steps - 1,
        "states": rng.normal(size=(steps, 5)).astype(np.float32),
    }


class BagWriter:
    """Writer of bags: `put` adds messages that `message` builds from nested dictionaries."""

    def __init__(self, path: Path, kind: str, **options: Any) -> None:
        self.is_ros1 = kind == "ros1"
        self.store = get_typestore(Stores.ROS1_NOETIC if self.is_ros1 else Stores.ROS2_HUMBLE)
        if self.is_ros1:
            definition = "geometry_msgs/TransformStamped[] transforms\n"
            self.store.register(get_types_from_msg(definition, "tf2_msgs/msg/TFMessage"))
            self.writer: Any = Writer1(path)
        else:
            plugin = {"mcap": StoragePlugin.MCAP, "sqlite": StoragePlugin.SQLITE3}[kind]
            self.writer = Writer2(path, version=9, storage_plugin=plugin)
        for compression in options.values():
            self.writer.set_compression(*compression)
        self.connections: dict[str, Any] = {}

    def __enter__(self) -> "BagWriter":
        self.writer.open()
        return self

    def __exit__(self, *error: object) -> None:
        self.writer.close()

    def put(self, topic: str, kind: str, time: int, **fields: Any) -> None:
        if topic not in self.connections:
            self.connections[topic] = self.writer.add_connection(topic, kind, typestore=self.store)
        serialise = self.store.serialize_ros1 if self.is_ros1 else self.store.serialize_cdr
        message = self.store.types[kind](**fields)
        self.writer.write(self.connections[topic], time, serialise(message, kind))

    def header(self, time: int, frame: str = "base") -> Any:
        stamp = self.store.types["builtin_interfaces/msg/Time"](*divmod(time, 10**9))
        fields = {"seq": 0} if self.is_ros1 else {}
        return self.store.types["std_msgs/msg/Header"](**fields, stamp=stamp, frame_id=frame)

    def pose(self, numbers: np.ndarray) -> Any:
        point = self.store.types["geometry_msgs/msg/Point"](*numbers[:3].tolist())
        return self.store.types["geometry_msgs/msg/Pose"](point, self.quaternion(numbers[3:]))

    def quaternion(self, numbers: np.ndarray) -> Any:
        return self.store.types["geometry_msgs/msg/Quaternion"](*numbers.tolist())

    def transform(self, child: str, time: int, numbers: np.ndarray, parent: str = "base") -> Any:
        translation = self.store.types["geometry_msgs/msg/Vector3"](*numbers[:3].tolist())
        rotation = self.quaternion(numbers[3:])
        inner = self.store.types["geometry_msgs/msg/Transform"](translation, rotation)
        header = self.header(time, parent)
        return self.store.types["geometry_msgs/msg/TransformStamped"](header, child, inner)


def write_bag(path: Path, kind: str, x: np.ndarray, **options: Any) -> None:
    """Write poses, joints, transforms of two frames, a gripper and an image topic; stamps lag by 5 ms."""
    with BagWriter(path, kind, **options) as bag:
        for step, row in enumerate(x):
            time = START + step * 33_333_333
            header = bag.header(time - 5_000_000)
            bag.put("/tool_pose", "geometry_msgs/msg/PoseStamped", time, header=header, pose=bag.pose(row))
            state = {"position": row[:2], "velocity": row[2:4], "effort": np.zeros(0)}
            bag.put(
                "/joint_states",
                "sensor_msgs/msg/JointState",
                time,
                header=header,
                name=["elbow", "wrist"],
                **state,
            )
            children = [bag.transform(name, time, row[::-1], "world") for name in ("cube", "bin")]
            bag.put("/tf", "tf2_msgs/msg/TFMessage", time, transforms=children)
            bag.put("/gripper", "std_msgs/msg/Float64", time, data=float(row[0]))
            bag.put("/closed", "std_msgs/msg/Bool", time, data=bool(row[0] > 0))
            bag.put("/note", "std_msgs/msg/String", time, data="a note")
