"""Formats that `pilotfish data import` reads: each is written by the library of its project, and read back.

    python reproductions/formats.py                   # the table of docs/importing.md
    python reproductions/formats.py --large 2.0       # also sets of 2 GB, with the peak memory

A row states what was read, and whether every number equals the one that was written. The files are those of
the tests (tests/shared/laboratory_files.py). Memory is the peak of the resident set of a process that reads
the whole set, less that after its imports.
"""

import csv
import importlib
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io
from protocol import argument_parser, write_numbers

from pilotfish.demonstrations import Recording, suggest_settings
from pilotfish.io.readers import read_recordings
from pilotfish.types import Array, Float

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "shared"))
files: Any = importlib.import_module("laboratory_files")

STEPS, PERIOD = 60, 1 / 30
NAMES = ("x", "y", "z", "qx", "qy", "qz", "qw", "gripper", "cube_x", "cube_y", "cube_z")
UNITS = ("mm",) * 3 + ("",) * 5 + ("m",) * 3
EPISODE = 20_000  # rows of an episode of a large set
Written = Mapping[str, Float[Array, "T D"]]  # by name of the signal


@dataclass(frozen=True, slots=True)
class Format:
    """A format, the library that writes it, and the function that does and returns what it wrote."""

    name: str
    library: str
    write: Callable[[Path, np.random.Generator], tuple[Path, Written]]


def pose_rows(rng: np.random.Generator) -> Float[Array, "T 11"]:
    """Return a pose x y z [mm], quaternion x y z w, gripper, and the position of a cube [m]."""
    angles = np.linspace(0.2, 1.1, STEPS)
    zero = np.zeros(STEPS)
    x = 500.0 + np.cumsum(rng.normal(size=(STEPS, 3)), axis=0)
    quaternions = np.stack([np.sin(angles), zero, zero, np.cos(angles)], axis=1)
    cube = np.tile(rng.normal(size=3), (STEPS, 1))
    return np.column_stack([x, quaternions, np.arange(STEPS) > STEPS // 2, cube])


def header() -> list[str]:
    """Return names of columns with their units in brackets."""
    return [f"{name} [{unit}]" if unit else name for name, unit in zip(NAMES, UNITS, strict=True)]


def text(separator: str, suffix: str) -> Callable[[Path, np.random.Generator], tuple[Path, Written]]:
    """Return the function that writes a table of text with times and labels."""

    def write(folder: Path, rng: np.random.Generator) -> tuple[Path, Written]:
        x = pose_rows(rng)
        with (folder / f"demo{suffix}").open("w", newline="") as file:
            writer = csv.writer(file, delimiter=separator)
            writer.writerow(["time [s]", *header(), "phase"])
            for n, row in enumerate(x.tolist()):
                writer.writerow([n * PERIOD, *row, "reach" if n < STEPS // 2 else "place"])
        return folder / f"demo{suffix}", {"": x}

    return write


def npy(folder: Path, rng: np.random.Generator) -> tuple[Path, Written]:
    """Write a stack of two recordings without names."""
    x = pose_rows(rng)
    np.save(folder / "demos.npy", np.stack([x, x]))
    return folder / "demos.npy", {"": x}


def npz(folder: Path, rng: np.random.Generator) -> tuple[Path, Written]:
    """Write named arrays with times and labels."""
    x = pose_rows(rng)
    labels = np.array(["reach"] * (STEPS // 2) + ["place"] * (STEPS // 2))
    times = np.arange(STEPS) * PERIOD
    np.savez(folder / "demo.npz", x=x, time=times, phase=labels, columns=np.array(header()))
    return folder / "demo.npz", {"x": x}


def matlab(folder: Path, rng: np.random.Generator) -> tuple[Path, Written]:
    """Write arrays of a .mat file of version 5."""
    x = pose_rows(rng)
    content = {"tool_pos": x[:, :3], "tool_quat": x[:, 3:7], "gripper": x[:, 7:8], "cube_pos": x[:, 8:]}
    scipy.io.savemat(folder / "demo.mat", {**content, "time": np.arange(STEPS)[:, None] * PERIOD})
    return folder / "demo.mat", content


def lerobot(version: str) -> Callable[[Path, np.random.Generator], tuple[Path, Written]]:
    """Return the function that writes a LeRobot set of a version."""

    def write(folder: Path, rng: np.random.Generator) -> tuple[Path, Written]:
        episodes = files.random_episodes(rng, (STEPS, STEPS))
        (files.write_lerobot_v21 if version == "v2.1" else files.write_lerobot_v3)(folder / "set", episodes)
        keys = ("observation.state", "action")
        return folder / "set", {key: episodes[0][key].astype(float) for key in keys}

    return write


def robomimic(folder: Path, rng: np.random.Generator) -> tuple[Path, Written]:
    """Write a file of two demonstrations."""
    demos = {f"demo_{n}": files.robomimic_demo(rng, STEPS) for n in range(2)}
    files.write_robomimic(folder / "set.hdf5", demos)
    keys = ("obs/robot0_eef_pos", "obs/robot0_eef_quat", "actions")
    return folder / "set.hdf5", {key: demos["demo_0"][key] for key in keys}


def bag(kind: str) -> Callable[[Path, np.random.Generator], tuple[Path, Written]]:
    """Return the function that writes a ROS recording."""

    def write(folder: Path, rng: np.random.Generator) -> tuple[Path, Written]:
        x, path = pose_rows(rng)[:, :7], folder / ("demo.bag" if kind == "ros1" else "demo")
        files.write_bag(path, kind, x)
        return path, {"/tool_pose": x, "/tf/cube": x[:, ::-1], "/joint_states": x[:, :4]}

    return write


FORMATS = (
    Format("CSV", "csv (Python)", text(",", ".csv")),
    Format("TSV", "csv (Python)", text("\t", ".tsv")),
    Format("NPY", "NumPy", npy),
    Format("NPZ", "NumPy", npz),
    Format("MATLAB .mat", "SciPy", matlab),
    Format("LeRobot v2.1", "pyarrow", lerobot("v2.1")),
    Format("LeRobot v3", "pyarrow", lerobot("v3")),
    Format("robomimic", "h5py", robomimic),
    Format("ROS 1 bag", "rosbags", bag("ros1")),
    Format("rosbag2 SQLite", "rosbags", bag("sqlite")),
    Format("rosbag2 MCAP", "rosbags", bag("mcap")),
)


def read_format(given: Format, seed: int) -> dict[str, Any]:
    """Write and read one format, and return a row of the table."""
    with tempfile.TemporaryDirectory() as folder:
        path, written = given.write(Path(folder), np.random.default_rng(seed))
        recordings = list(read_recordings(path))
    first = recordings[0]
    signals = {signal.name: signal for signal in first.signals}
    only = first.signals[0]  # of a file with one array
    is_exact = all(np.array_equal(signals.get(name, only).values, values) for name, values in written.items())
    frames, converted = describe_import(recordings)
    return {
        "format": given.name,
        "written by": given.library,
        "recordings": len(recordings),
        "rows": len(first.signals[0].values),
        "columns": sum(len(signal.columns) for signal in first.signals),
        "frames": ", ".join(frames) or "-",
        "labels": ", ".join(first.labels) or "-",
        "converted": "; ".join(converted) or "-",
        "exact": "yes" if is_exact else "NO",
    }


def describe_import(recordings: Sequence[Recording]) -> tuple[list[str], list[str]]:
    """Return the frames of the proposed import, and what it converts."""
    settings, questions = suggest_settings(recordings)
    frames = [frame.name for frame in settings.frames]
    asked = [f"asks: {question.subject}" for question in questions]
    parts = [p.representation for p in settings.parts if p.quantity.value == "quaternion"]
    lines = [f"{form} to w x y z" for form in parts if form != "wxyz"]
    units = {unit for signal in recordings[0].signals for unit in signal.units}
    lines += [f"{unit} to m" for unit in sorted(units & {"mm", "cm"})]
    return frames, lines + asked


def markdown(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return a table."""
    names = list(rows[0])
    lines = [names, ["---"] * len(names), *([str(row[name]) for name in names] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def write_large(kind: str, path: Path, size: float) -> None:
    """Write a set of a number of GB."""
    rng = np.random.default_rng(0)
    if kind == "LeRobot v3":
        count = max(1, round(size * 1e9 / (EPISODE * 54)))
        files.write_lerobot_v3(
            path, files.random_episodes(rng, (EPISODE,) * count), row_group=EPISODE, files=20
        )
        return
    demo = files.robomimic_demo(rng, EPISODE)
    count = max(1, round(size * 1e9 / sum(values.nbytes for values in demo.values())))
    files.write_robomimic(path, {f"demo_{n}": demo for n in range(count)})


def read_large(path: Path) -> dict[str, float]:
    """Read a set, and return seconds, rows and the growth of the peak memory of this process [MB]."""
    before, start, rows = peak_memory(), time.perf_counter(), 0
    for recording in read_recordings(path):
        rows += len(recording.signals[0].values)
    return {"seconds": time.perf_counter() - start, "rows": rows, "peak": peak_memory() - before}


def peak_memory() -> float:
    """Return the largest resident set of this process so far [MB]; getrusage would return the parent's."""
    status = Path("/proc/self/status").read_text()
    return int(next(line for line in status.splitlines() if line.startswith("VmHWM")).split()[1]) / 1024


def large_rows(size: float) -> list[dict[str, Any]]:
    """Write large sets, read each in a process of its own, and return rows of a table."""
    rows = []
    for kind, name in (("LeRobot v3", "set"), ("robomimic", "set.hdf5")):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / name
            write_large(kind, path, size)
            total = sum(file.stat().st_size for file in [path, *path.rglob("*")] if file.is_file())
            command = [sys.executable, __file__, "--read", str(path)]
            result = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
        rows.append(
            {
                "set": kind,
                "size [GB]": f"{total / 1e9:.2f}",
                "rows": result["rows"],
                "seconds": f"{result['seconds']:.1f}",
                "peak memory [MB]": f"{result['peak']:.0f}",
            }
        )
    return rows


def main() -> None:
    """Print the table of formats, and that of large sets."""
    parser = argument_parser(__doc__)
    parser.add_argument("--large", type=float, help="size of large sets that are read too [GB]")
    parser.add_argument("--read", type=Path, help="set to read; prints seconds, rows and peak memory")
    arguments = parser.parse_args()
    if arguments.read:
        sys.stdout.write(json.dumps(read_large(arguments.read)))
        return
    rows = [read_format(given, 0) for given in FORMATS]
    sys.stdout.write(markdown(rows) + "\n")
    large = large_rows(arguments.large) if arguments.large else []
    if large:
        sys.stdout.write("\n" + markdown(large) + "\n")
    if arguments.json:
        write_numbers(arguments.json, {"formats": rows, "large": large})


if __name__ == "__main__":
    main()
