"""Damaged files of other projects: every reader raises InvalidInput that names the file, and nothing else.

Damage is random with the seed of the test: a file is cut short, or bytes of it are replaced. A mutant may
still be readable, because not every byte matters; its recordings must then be whole.
"""

import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from laboratory_files import (
    random_episodes,
    robomimic_demo,
    write_bag,
    write_lerobot_v3,
    write_lerobot_v21,
    write_robomimic,
)
from random_demonstrations import DemonstrationMaker
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode

from pilotfish.demonstrations import Recording
from pilotfish.errors import InvalidInput
from pilotfish.io.demonstration_descriptions import KEY, restore_demonstration
from pilotfish.io.readers import lerobot, robomimic, ros_bags
from pilotfish.io.writers import lerobot_dataset, robomimic_file, ros_mcap

MUTANTS = 25
OPTIONAL_FILES = {"tasks.jsonl", "episodes.jsonl", "metadata.yaml"}  # the rest can be read without them
Rng = np.random.Generator
LZ4 = {"compression": (Writer1.CompressionFormat.LZ4,)}
ZSTD = {"compression": (CompressionMode.STORAGE, CompressionFormat.ZSTD)}
FORMATS: dict[str, tuple[ModuleType, Callable[[Path, Rng], None]]] = {
    "lerobot v2.1": (lerobot, lambda path, rng: write_lerobot_v21(path, random_episodes(rng, (3, 8)))),
    "lerobot v3": (lerobot, lambda path, rng: write_lerobot_v3(path, random_episodes(rng, (3, 8)))),
    "robomimic": (robomimic, lambda path, rng: write_robomimic(path, {"demo_0": robomimic_demo(rng, 9)})),
    "ros1": (ros_bags, lambda path, rng: write_bag(path, "ros1", rng.normal(size=(3, 7)))),
    "ros1 lz4": (ros_bags, lambda path, rng: write_bag(path, "ros1", rng.normal(size=(3, 7)), **LZ4)),
    "mcap": (ros_bags, lambda path, rng: write_bag(path, "mcap", rng.normal(size=(3, 7)))),
    "mcap zstd": (ros_bags, lambda path, rng: write_bag(path, "mcap", rng.normal(size=(3, 7)), **ZSTD)),
    "sqlite": (ros_bags, lambda path, rng: write_bag(path, "sqlite", rng.normal(size=(3, 7)))),
}


def damage(data: bytes, rng: Rng) -> bytes:
    """Return the data cut short, or with some of its bytes replaced."""
    if rng.random() < 0.2:
        return data[: int(rng.integers(len(data)))]
    changed = np.frombuffer(data, np.uint8).copy()
    changed[rng.integers(len(data), size=int(rng.integers(1, 9)))] = rng.integers(256)
    return changed.tobytes()


def require_whole(recording: Recording) -> None:
    for signal in recording.signals:
        assert signal.values.shape == (len(signal.values), len(signal.columns))
        assert len(signal.units) == len(signal.columns)
        assert signal.times is None or len(signal.times) == len(signal.values)
    assert all(len(labels) == len(recording.signals[0].values) for labels in recording.labels.values())


@pytest.mark.parametrize("name", FORMATS)
def test_read_damaged_file_raises_invalid_input_only(name: str, rng, tmp_path: Path):
    (reader, write), path = FORMATS[name], tmp_path / "a.bag"
    write(path, rng)
    files = sorted(file for file in [path, *path.rglob("*")] if file.is_file())
    messages = []
    for _ in range(MUTANTS):
        file = files[int(rng.integers(len(files)))]
        original = file.read_bytes()
        file.write_bytes(damage(original, rng))
        try:
            for recording in reader.read(path):
                require_whole(recording)
        except InvalidInput as error:
            messages.append(str(error))
        file.write_bytes(original)
    assert messages
    assert all(str(path) in message for message in messages)
    assert list(reader.read(path))


@pytest.mark.parametrize("name", FORMATS)
def test_read_empty_file_raises_invalid_input(name: str, rng, tmp_path: Path):
    (reader, write), path = FORMATS[name], tmp_path / "a.bag"
    write(path, rng)
    for file in sorted(file for file in [path, *path.rglob("*")] if file.is_file()):
        original = file.read_bytes()
        file.write_bytes(b"")
        if file.name not in OPTIONAL_FILES:
            with pytest.raises(InvalidInput, match=r"a\.bag"):
                list(reader.read(path))
        file.write_bytes(original)


@pytest.mark.parametrize("name", FORMATS)
def test_read_missing_path_raises_invalid_input(name: str, tmp_path: Path):
    reader, _ = FORMATS[name]
    assert not reader.recognises(tmp_path / "missing")
    with pytest.raises(InvalidInput, match="missing"):
        list(reader.read(tmp_path / "missing"))


@pytest.mark.parametrize(
    ("change", "match"),
    [
        (lambda text: text[:-1], "cannot be used"),
        (lambda text: "[" * 100_000, "cannot be used"),
        (lambda text: text.replace('"version":1', '"version":2'), "its version is 2, expected 1"),
        (lambda text: text.replace('"period":0.05', '"period":"x"'), "period"),
        (lambda text: text.replace('"steps":6', '"steps":5'), "a frame of 5 steps has"),
        (lambda text: text.replace('"steps":6', '"steps":1000000000'), "the steps of a frame"),
        (lambda text: text.replace('"numbers":"', '"numbers":"!'), "not base64"),
        (lambda text: text.replace('["observation.state",3]', '["observation.state",7]'), "a column of"),
        (lambda text: text.replace('["observation.state",3]', '["other",3]'), "names signal 'other'"),
        (lambda text: text.replace('["observation.state",3],', ""), "names 6 columns, expected 7"),
        (lambda text: text.replace('"name":"a"', '"name":3'), "the name"),
        (lambda text: text.replace('"name":"a"', '"other":1,"name":"a"'), "unknown fields"),
    ],
)
def test_restore_damaged_description_names_fault(change, match, rng, tmp_path: Path):
    lerobot_dataset.write([DemonstrationMaker(rng)(6, moving=True)], tmp_path / "set")
    (recording,) = lerobot.read(tmp_path / "set")
    text = recording.attributes[KEY]
    assert change(text) != text
    damaged = Recording(recording.name, recording.signals, attributes={KEY: change(text)})
    with pytest.raises(InvalidInput, match=match):
        restore_demonstration(damaged)


def test_restore_of_other_file_is_none(rng, tmp_path: Path):
    write_robomimic(tmp_path / "a.hdf5", {"demo_0": robomimic_demo(rng, 9)})
    (recording,) = robomimic.read(tmp_path / "a.hdf5")
    assert restore_demonstration(recording) is None


@pytest.mark.parametrize(
    ("module", "needs"), [(lerobot, "pyarrow"), (robomimic, "h5py"), (ros_bags, "rosbags")]
)
def test_read_without_library_names_extra(module, needs, rng, monkeypatch, tmp_path: Path):
    write = {"pyarrow": "lerobot v3", "h5py": "robomimic", "rosbags": "ros1"}[needs]
    FORMATS[write][1](tmp_path / "a.bag", rng)
    for name in (needs, f"{needs}.parquet", "rosbags.rosbag1"):
        monkeypatch.setitem(sys.modules, name, None)
    assert module.recognises(tmp_path / "a.bag")
    with pytest.raises(InvalidInput, match=rf"need {needs}: pip install '.\[io\]' in the clone"):
        list(module.read(tmp_path / "a.bag"))
    writer = {"pyarrow": lerobot_dataset, "h5py": robomimic_file, "rosbags": ros_mcap}[needs]
    with pytest.raises(InvalidInput, match=rf"need {needs}: pip install '.\[io\]' in the clone"):
        writer.write([DemonstrationMaker(rng)()], tmp_path / "out")
