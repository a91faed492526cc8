"""Finding a public file: in the folder that PILOTFISH_DATA names, in the cache, or at its address."""

import hashlib
import os
from collections.abc import Callable
from pathlib import Path, PurePosixPath

from pilotfish.errors import InvalidInput, SkillError
from pilotfish.io.datasets_registry import Dataset
from pilotfish.io.paths import is_file, is_folder, read_file
from pilotfish.validation import short_repr

DATA_FOLDER_VARIABLE = "PILOTFISH_DATA"
MAX_DATASET_BYTES = 2**28  # bytes
Retrieve = Callable[[Dataset], Path]


def dataset_path(dataset: Dataset) -> Path:
    """The file of a dataset on this machine, its sha256 as published; downloaded once when nowhere else.

    Raises: InvalidInput, when PILOTFISH_DATA names no folder or the file there is another;
    SkillError, when it is not there and cannot be downloaded, as extracts cannot.
    """
    if here := find_local_file(dataset, os.environ.get(DATA_FOLDER_VARIABLE, "")):
        return here
    reject_extract(dataset)
    return download(dataset, _fetch)


def reject_extract(dataset: Dataset) -> None:
    """Raises: SkillError, when the dataset's file is an extract, which nobody publishes."""
    if dataset.extract:
        raise SkillError(
            f"dataset {dataset.name!r} is an extract of {dataset.url} ({dataset.extract}) and is not "
            f"downloaded: put it at FOLDER/{dataset.file} and set {DATA_FOLDER_VARIABLE}=FOLDER"
        )


def find_local_file(dataset: Dataset, folder: str) -> Path | None:
    """The dataset's file in a folder of datasets; None when no folder is named or it is not in there.

    Raises: InvalidInput, when the folder is not there or the file has another sha256.
    """
    if not folder:
        return None
    if not is_folder(folder):
        raise InvalidInput(
            f"{DATA_FOLDER_VARIABLE} is {short_repr(folder, 200)}, expected a folder of datasets; correct it or unset it"
        )
    file = Path(folder) / dataset.file
    if not is_file(file):
        return None
    if (
        found := hashlib.sha256(read_file(file, "a data set", MAX_DATASET_BYTES)).hexdigest()
    ) != dataset.sha256:
        raise InvalidInput(
            f"{file} has sha256 {found}, expected {dataset.sha256} as published at {dataset.url}; "
            f"put the original there, or unset {DATA_FOLDER_VARIABLE} to download it"
        )
    return file


def download(dataset: Dataset, retrieve: Retrieve) -> Path:
    """The dataset's file as retrieve brings it.

    Raises: SkillError, naming the address and what to do, when it cannot.
    """
    try:
        return retrieve(dataset)
    except ImportError as error:
        reason = f"{error.name or error} is not installed: pip install 'pilotfish[data]'"
        raise SkillError(f"{_download_failure_message(dataset)} ({reason})") from error
    except (OSError, ValueError) as error:  # requests' errors are OSErrors; a wrong hash is a ValueError
        raise SkillError(f"{_download_failure_message(dataset)} ({str(error)[:120]})") from error


def _download_failure_message(dataset: Dataset) -> str:
    return (
        f"dataset {dataset.name!r} could not be downloaded from {dataset.url}. Put it by hand at "
        f"FOLDER/{dataset.file} and set {DATA_FOLDER_VARIABLE}=FOLDER; synthetic_valve(rng) needs no network"
    )


def _fetch(dataset: Dataset) -> Path:
    """The file in the user's cache, downloaded to it with a progress bar if it is not there yet."""
    import pooch  # an extra, and slow to import
    import tqdm  # noqa: F401 # pooch's progress bar; missing, it should be named here

    place = PurePosixPath(dataset.file)
    found = pooch.retrieve(
        dataset.url,
        known_hash=f"sha256:{dataset.sha256}",
        fname=place.name,
        path=Path(pooch.os_cache("pilotfish")) / place.parent,
        progressbar=True,
    )
    return Path(found)
