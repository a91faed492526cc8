"""LeRobot reader: versions 2.1 and 3, as pyarrow writes them, equal number for number."""

import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from laboratory_files import (
    STATE_NAMES,
    TASKS,
    episode_table,
    random_episodes,
    write_lerobot_v3,
    write_lerobot_v21,
)

from pilotfish.errors import InvalidInput
from pilotfish.io.readers import lerobot

WRITERS = pytest.mark.parametrize("write", [write_lerobot_v21, write_lerobot_v3])
LENGTHS = (5, 23, 2, 40, 1, 9, 3, 3, 3, 3, 30)


@WRITERS
def test_read_returns_every_episode_equal(write, rng, tmp_path: Path):
    episodes = random_episodes(rng, LENGTHS)
    write(tmp_path, episodes)
    assert lerobot.recognises(tmp_path)
    recordings = list(lerobot.read(tmp_path))
    assert [recording.name for recording in recordings] == [f"episode {n}" for n in range(len(LENGTHS))]
    for n, (recording, episode) in enumerate(zip(recordings, episodes, strict=True)):
        state, action, done = recording.signals
        np.testing.assert_array_equal(state.values, episode["observation.state"].astype(np.float64))
        np.testing.assert_array_equal(action.values, episode["action"].astype(np.float64))
        np.testing.assert_array_equal(done.values[:, 0], np.arange(LENGTHS[n]) == LENGTHS[n] - 1)
        assert (state.name, state.columns, action.columns) == (
            "observation.state",
            tuple(STATE_NAMES),
            ("0", "1"),
        )
        assert recording.labels["task"] == (TASKS[n % 2],) * LENGTHS[n]
        assert recording.attributes == {"task": TASKS[n % 2], "robot_type": "so100"}
        np.testing.assert_array_equal(state.times, (np.arange(LENGTHS[n]) / 30).astype(np.float32))
        assert recording.period == 1 / 30
        assert "observation.images.top is left out" in recording.notes[0]


@pytest.mark.parametrize("row_group", [1, 4, 1000])
@pytest.mark.parametrize("files", [1, 5])
def test_read_v3_any_row_groups_and_files_is_equal(row_group, files, rng, tmp_path: Path):
    episodes = random_episodes(rng, LENGTHS)
    write_lerobot_v3(tmp_path, episodes, row_group, files)
    for recording, episode in zip(lerobot.read(tmp_path), episodes, strict=True):
        np.testing.assert_array_equal(recording.signals[1].values, episode["action"])


def test_read_yields_first_episode_before_damage_in_last(rng, tmp_path: Path):
    """Reading is lazy: a file that is not reached yet is not opened."""
    write_lerobot_v21(tmp_path, random_episodes(rng, (4, 4)))
    (tmp_path / "data" / "chunk-000" / "episode_000001.parquet").write_bytes(b"PAR1 damaged PAR1")
    recordings = lerobot.read(tmp_path)
    assert len(next(recordings).signals[0].values) == 4
    with pytest.raises(InvalidInput, match=r"episode_000001.parquet: damaged"):
        next(recordings)


def test_read_texts_per_row_are_labels_and_nested_lists_columns(tmp_path: Path):
    feature = {"dtype": "string", "shape": [1], "names": None}
    matrix = {"dtype": "float64", "shape": [2, 2], "names": ["rows", "columns"]}
    info = {"codebase_version": "v3.0", "fps": 10, "features": {"phase": feature, "pose": matrix}}
    (tmp_path / "meta").mkdir()
    (tmp_path / "meta" / "info.json").write_text(json.dumps(info))
    (tmp_path / "data" / "chunk-000").mkdir(parents=True)
    table = pa.table(
        {
            "phase": ["reach", "grasp"],
            "pose": pa.array([[[1, 2], [3, 4]], [[5, 6], [7, 8]]], pa.list_(pa.list_(pa.float64()))),
            "episode_index": [3, 3],
        }
    )
    pq.write_table(table, tmp_path / "data" / "chunk-000" / "file-000.parquet")
    (recording,) = lerobot.read(tmp_path)
    np.testing.assert_array_equal(recording.signals[0].values, [[1, 2, 3, 4], [5, 6, 7, 8]])
    assert recording.labels == {"phase": ("reach", "grasp")}
    assert (recording.name, recording.signals[0].times) == ("episode 3", None)


def test_read_incomplete_data_set_names_what_is_missing(rng, tmp_path: Path):
    write_lerobot_v21(tmp_path, random_episodes(rng, (4, 6)))
    file = tmp_path / "data" / "chunk-000" / "episode_000001.parquet"
    whole = pq.read_table(file)
    pq.write_table(whole.slice(0, 3), file)
    with pytest.raises(InvalidInput, match="episode 1 has 3 rows, but its metadata states 6; fetch"):
        list(lerobot.read(tmp_path))
    file.unlink()
    with pytest.raises(InvalidInput, match="lacks episode 1"):
        list(lerobot.read(tmp_path))
    pq.write_table(whole.drop_columns("action"), file)
    with pytest.raises(InvalidInput, match=r"lacks column 'action', which info.json lists"):
        list(lerobot.read(tmp_path))


@pytest.mark.parametrize(
    ("column", "match"),
    [
        (pa.array([[1.0, 2.0], [3.0]]), "rows of different lengths"),
        (pa.array([[1.0, 2.0], None]), "rows of different lengths"),
        (pa.array([[1.0, None], [2.0, 3.0]]), "lacks a value in 1 places"),
        (pa.array([[1.0], [3.0]]), "2 items of double in 2 rows, not 2 each"),
        (pa.array([["a", "b"], ["c", "d"]]), "items of string"),
        (pa.array([1.0, 2.0]), "not 2 each"),
    ],
)
def test_read_column_of_wrong_content_names_it(column, match, rng, tmp_path: Path):
    write_lerobot_v21(tmp_path, random_episodes(rng, (2,)))
    file = tmp_path / "data" / "chunk-000" / "episode_000000.parquet"
    table = pq.read_table(file)
    pq.write_table(table.set_column(table.schema.get_field_index("action"), "action", column), file)
    with pytest.raises(InvalidInput, match=match):
        list(lerobot.read(tmp_path))


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"codebase_version": "v1.6"}, "'v1.6', expected one of v2.0, v2.1, v3.0"),
        ({"fps": 0}, "fps is 0"),
        ({"fps": None}, "fps is None"),
        ({"features": []}, "no table of features"),
        ({"features": {}}, "no numeric feature"),
        ({"features": {"action": {"dtype": "float32", "shape": [-1]}}}, "a size of feature 'action' is -1"),
        ({"features": {"action": 3}}, "expected dtype and shape"),
        ({"features": {"action": {"dtype": ["x"], "shape": [1]}}}, "no numeric feature|expected dtype"),
    ],
)
def test_read_info_of_wrong_content_names_it(change, match, rng, tmp_path: Path):
    write_lerobot_v21(tmp_path, random_episodes(rng, (2,)))
    file = tmp_path / "meta" / "info.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | change))
    with pytest.raises(InvalidInput, match=match):
        list(lerobot.read(tmp_path))


def test_read_claim_of_a_billion_rows_takes_little_memory(tmp_path: Path, rng):
    """Equal rows compress to nothing; the reader stops at its limit, not at the end of the memory."""
    write_lerobot_v3(tmp_path, random_episodes(rng, (2,)))
    file = tmp_path / "data" / "chunk-000" / "file-000.parquet"
    part = episode_table({name: np.zeros((4096, n)) for name, n in SIZES.items()} | {"task_index": ZEROS}, 0)
    with pq.ParquetWriter(file, part.schema) as writer:
        for _ in range(20):
            writer.write_table(part)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(lerobot, "MAX_ENTRIES", 100_000)
        with pytest.raises(InvalidInput, match="episode 0 has more than 100000 numbers; split it"):
            list(lerobot.read(tmp_path))


SIZES, ZEROS = {"observation.state": 4, "action": 2}, np.zeros(4096, np.int64)


def test_recognises_other_folders_is_false(tmp_path: Path):
    assert not lerobot.recognises(tmp_path)
    assert not lerobot.recognises(tmp_path / "missing")
    (tmp_path / "meta").mkdir()
    (tmp_path / "meta" / "info.json").write_text("{}")
    assert not lerobot.recognises(tmp_path)
