"""Public recordings: registry, local files and downloads."""

import hashlib
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pilotfish.errors import InvalidInput, SkillError
from pilotfish.io import datasets
from pilotfish.io.dataset_files import dataset_path, download, find_local_file
from pilotfish.io.dataset_registry import DATASETS

RECORDING = b"a recording"
COUNTS = {"valve": 8, "zshape": 5, "robotasks": 9, "helloworld": 8}
COUNTS |= {"chicken_dance": 1, "mocap6": 4, "letters": 30}
MADE = replace(datasets.info("valve"), sha256=hashlib.sha256(RECORDING).hexdigest())


EXTRACTS = [dataset.name for dataset in DATASETS if dataset.extract]


@pytest.mark.parametrize("name", datasets.names())
def test_info_every_dataset_has_origin_and_licence(name: str):
    dataset = datasets.info(name)
    assert re.fullmatch(r"[0-9a-f]{64}", dataset.sha256)
    assert re.fullmatch(r"https?://\S+", dataset.url)
    assert dataset.licence
    assert len(dataset.citation) > 80
    assert dataset.description


@pytest.mark.parametrize("name", [name for name in datasets.names() if name not in EXTRACTS])
def test_info_original_has_pinned_address(name: str):
    dataset = datasets.info(name)
    assert re.fullmatch(r"https://raw\.githubusercontent\.com/\w+/[\w-]+/[0-9a-f]{40}/\S+", dataset.url)
    assert dataset.url.rsplit("/", 1)[1] == dataset.file.rsplit("/", 1)[1]
    assert dataset.licence in {"BSD-3-Clause", "MIT"}
    assert "doi:10." in dataset.citation


def test_dataset_path_missing_extract_raises(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The message names the original, the extract and the place for the file."""
    assert EXTRACTS == ["chicken_dance", "mocap6", "letters"]
    monkeypatch.setenv("PILOTFISH_DATA", str(tmp_path))
    for name in EXTRACTS:
        dataset = datasets.info(name)
        with pytest.raises(SkillError, match=f"{name!r} is an extract of") as caught:
            dataset_path(dataset)
        for word in (dataset.url, dataset.extract, f"FOLDER/{dataset.file}", "PILOTFISH_DATA=FOLDER"):
            assert word in str(caught.value)


def test_registry_entries_are_different():
    for values in zip(*((d.name, d.file, d.sha256, d.url) for d in DATASETS), strict=True):
        assert len(set(values)) == len(DATASETS)


@pytest.mark.parametrize("name", datasets.names())
def test_dataset_functions_read_every_dataset(data_folder: Path, monkeypatch: pytest.MonkeyPatch, name: str):
    monkeypatch.setenv("PILOTFISH_DATA", str(data_folder))
    function, *argument = name.split()
    demonstrations = getattr(datasets, function)(*argument)
    assert len(demonstrations) == COUNTS[function]
    assert np.isfinite(demonstrations[-1].x).all()


def test_info_unknown_name_names_nearest(monkeypatch: pytest.MonkeyPatch):
    with pytest.raises(InvalidInput, match=r"no data set is named 'vale', there are valve, .*mean 'valve'\?"):
        datasets.info("vale")
    with pytest.raises(InvalidInput, match="mean 'robotasks openbox'"):
        datasets.robotasks("open box")
    with pytest.raises(InvalidInput, match="no data set is named 'helloworld x'"):
        datasets.helloworld("x")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    file = tmp_path / MADE.file
    file.parent.mkdir()
    file.write_bytes(RECORDING)
    return tmp_path


def test_find_local_file_with_published_hash_returns_path(folder: Path):
    assert find_local_file(MADE, str(folder)) == folder / MADE.file


def test_find_local_file_with_other_hash_raises(folder: Path):
    (folder / MADE.file).write_bytes(b"another")
    found = hashlib.sha256(b"another").hexdigest()
    with pytest.raises(InvalidInput, match=rf"Demos2\.mat has sha256 {found}, expected {MADE.sha256}"):
        find_local_file(MADE, str(folder))


def test_find_local_file_missing_returns_none(folder: Path):
    assert find_local_file(datasets.info("zshape"), str(folder)) is None
    assert find_local_file(MADE, "") is None
    with pytest.raises(InvalidInput, match=r"PILOTFISH_DATA is .*missing', expected a folder"):
        find_local_file(MADE, str(folder / "missing"))


@pytest.mark.parametrize(
    ("failure", "reason"),
    [
        (ConnectionError("no route"), "no route"),
        (ValueError("hash differs"), "hash differs"),
        (
            ModuleNotFoundError("No module named 'pooch'", name="pooch"),
            r"pooch is not installed: pip install",
        ),
        (PermissionError(13, "Permission denied"), "Permission denied"),
    ],
)
def test_download_failure_names_reason_and_fix(failure: Exception, reason: str):

    def retrieve(dataset: datasets.Dataset) -> Path:
        raise failure

    with pytest.raises(SkillError, match=reason) as caught:
        download(MADE, retrieve)
    for word in (MADE.url, f"FOLDER/{MADE.file}", "PILOTFISH_DATA=FOLDER", "synthetic_valve"):
        assert word in str(caught.value)


def test_download_returns_path_of_retrieve():
    assert download(MADE, lambda dataset: Path(dataset.file)) == Path(MADE.file)
