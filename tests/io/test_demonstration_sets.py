"""Groups of a set are those of the whole set, for folders and for LeRobot data sets."""

import json
from pathlib import Path

import numpy as np
import pytest

from pilotfish.demonstrations import Demonstration, demonstration, frame, position_layout
from pilotfish.errors import InvalidInput
from pilotfish.io import (
    MAX_GROUP,
    GroupFiles,
    is_lerobot,
    list_groups,
    read_demonstrations,
    read_group,
    write_demonstrations,
)
from pilotfish.io.readers.lerobot_metadata import select_row_groups
from pilotfish.io.writers import lerobot_dataset

COUNT = 7
FORMATS = ("folder", "lerobot")


def random_demonstrations(rng: np.random.Generator) -> list[Demonstration]:
    layout = position_layout(2)
    return [
        demonstration(
            rng.normal(size=(rng.integers(2, 9), 2)),
            0.1,
            layout,
            (frame("object", np.eye(2), rng.normal(size=2)),),
            f"demonstration {m}",
        )
        for m in range(COUNT)
    ]


def write_set(demos: list[Demonstration], folder: Path, kind: str) -> Path:
    target = folder / kind
    (lerobot_dataset.write if kind == "lerobot" else write_demonstrations)(demos, target)
    return target


def assert_equal(found: list[Demonstration], expected: list[Demonstration]) -> None:
    assert [demo.name for demo in found] == [demo.name for demo in expected]
    for a, b in zip(found, expected, strict=True):
        np.testing.assert_array_equal(a.x, b.x)
        np.testing.assert_array_equal(a.frames[0].b, b.frames[0].b)


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize("size", [1, 3, 7, 100])
def test_read_group_groups_one_after_another_are_the_set(tmp_path, rng, kind, size):
    demos = random_demonstrations(rng)
    folder = write_set(demos, tmp_path, kind)
    groups = list_groups(folder, size)
    assert [group.start for group in groups] == list(range(0, COUNT, size))
    assert groups[-1].stop == COUNT
    assert_equal([demo for group in groups for demo in read_group(group)], demos)


def test_read_group_lerobot_reads_only_the_row_groups_of_its_episodes(tmp_path, rng):
    folder = write_set(random_demonstrations(rng), tmp_path, "lerobot")
    (file,) = folder.glob("data/*/*.parquet")
    assert select_row_groups(file, frozenset({2, 3})) == [2, 3]
    assert select_row_groups(file, frozenset({99})) == []
    assert select_row_groups(file, frozenset()) == []


@pytest.mark.usefixtures("unchecked")  # wrong types on purpose
def test_read_demonstrations_of_some_numbers(tmp_path, rng):
    demos = random_demonstrations(rng)
    folder = write_set(demos, tmp_path, "folder")
    assert_equal(list(read_demonstrations(folder, range(2, 4))), demos[2:4])
    assert read_demonstrations(folder, range(0)) == ()
    with pytest.raises(InvalidInput, match="numbers"):
        read_demonstrations(folder, [1])


def test_read_group_missing_folder_says_that_it_is_missing_here(tmp_path):
    group = GroupFiles(str(tmp_path / "elsewhere"), 0, 3)
    with pytest.raises(InvalidInput, match="does not exist here"):
        read_group(group)


def test_read_group_damaged_demonstration_is_named(tmp_path, rng):
    folder = write_set(random_demonstrations(rng), tmp_path, "folder")
    file = sorted(folder.glob("*.csv"))[4]
    file.write_text("x [m],y [m]\n1,nan\n")
    groups = list_groups(folder, 3)
    assert len(read_group(groups[0])) == 3
    with pytest.raises(InvalidInput, match=file.name):
        read_group(groups[1])


def test_read_group_episode_with_missing_rows_is_named(tmp_path, rng):
    folder = write_set(random_demonstrations(rng), tmp_path, "lerobot")
    group = list_groups(folder, 3)[1]
    longer = GroupFiles(group.path, 3, 6, tuple((number, rows + 1) for number, rows in group.episodes))
    with pytest.raises(InvalidInput, match="episode 3"):
        read_group(longer)


def test_read_group_lerobot_of_others_asks_for_settings(tmp_path, rng):
    folder = write_set(random_demonstrations(rng), tmp_path, "lerobot")
    (folder / "meta" / "pilotfish.jsonl").unlink()
    with pytest.raises(InvalidInput, match="episode 0 was not written by pilotfish"):
        read_group(list_groups(folder, 3)[0])


@pytest.mark.usefixtures("unchecked")  # wrong types on purpose
def test_list_groups_unusable_sets_are_refused(tmp_path, rng):
    with pytest.raises(InvalidInput, match="not a folder"):
        list_groups(tmp_path / "missing", 3)
    folder = write_set(random_demonstrations(rng), tmp_path, "lerobot")
    for size in (0, MAX_GROUP + 1, 1.5, None):
        with pytest.raises(InvalidInput, match="size"):
            list_groups(folder, size)  # type: ignore[arg-type]
    for file in (folder / "meta" / "episodes").glob("*/*"):
        file.write_bytes(b"PAR1")
    with pytest.raises(InvalidInput, match=r"file-000\.parquet"):
        list_groups(folder, 3)
    for file in (folder / "meta" / "episodes").glob("*/*"):
        file.unlink()
    with pytest.raises(InvalidInput, match="lists no demonstrations"):
        list_groups(folder, 3)


def test_is_lerobot_tells_formats_apart(tmp_path, rng):
    demos = random_demonstrations(rng)
    assert [is_lerobot(write_set(demos, tmp_path, kind)) for kind in FORMATS] == [False, True]
    info = tmp_path / "lerobot" / "meta" / "info.json"
    assert json.loads(info.read_text())["total_episodes"] == COUNT
