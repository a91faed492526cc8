"""Files of public recordings: in the folder PILOTFISH_DATA, in the cache, or downloaded."""

import hashlib
import os
from collections.abc import Callable
from pathlib import Path, PurePosixPath

from pilotfish.errors import InvalidInput, SkillError
from pilotfish.io.dataset_registry import Dataset
from pilotfish.io.paths import is_file, is_folder, read_file
from pilotfish.validation import short_repr

DATA_FOLDER_VARIABLE = "PILOTFISH_DATA"
MAX_DATASET_BYTES = 2**28
Retrieve = Callable[[Dataset], Path]


def dataset_path(dataset: Dataset) -> Path:
    """Return the path of a data set's file; download it once if it is not on this machine.

    Args:
        dataset: Entry of the registry.

    Raises:
        InvalidInput: If PILOTFISH_DATA is not a folder, or the file in it has another checksum.
        SkillError: If the file is missing and cannot be downloaded; extracts never are.
    """
    if file := find_local_file(dataset, os.environ.get(DATA_FOLDER_VARIABLE, "")):
        return file
    reject_extract(dataset)
    return download(dataset, _fetch)


def reject_extract(dataset: Dataset) -> None:
    """Raise SkillError if the file is an extract, which nobody publishes."""
    if dataset.extract:
        raise SkillError(
            f"data set {dataset.name!r} is an extract of {dataset.url} ({dataset.extract}) and is not "
            f"downloaded: put it at FOLDER/{dataset.file} and set {DATA_FOLDER_VARIABLE}=FOLDER"
        )


def find_local_file(dataset: Dataset, folder: str) -> Path | None:
    """Return the path of a data set's file in a folder; None if the folder does not have it.

    Args:
        dataset: Entry of the registry.
        folder: Folder of data sets; empty means none.

    Raises:
        InvalidInput: If folder is not a folder, or the file has another checksum.
    """
    if not folder:
        return None
    if not is_folder(folder):
        raise InvalidInput(
            f"{DATA_FOLDER_VARIABLE} is {short_repr(folder, 200)}, expected a folder of data sets; "
            "correct it or unset it"
        )
    file = Path(folder) / dataset.file
    if not is_file(file):
        return None
    actual = hashlib.sha256(read_file(file, "a data set", MAX_DATASET_BYTES)).hexdigest()
    if actual != dataset.sha256:
        raise InvalidInput(
            f"{file} has sha256 {actual}, expected {dataset.sha256} as published at {dataset.url}; "
            f"put the original there, or unset {DATA_FOLDER_VARIABLE} to download it"
        )
    return file


def download(dataset: Dataset, retrieve: Retrieve) -> Path:
    """Return the path of a data set's file after download.

    Args:
        dataset: Entry of the registry.
        retrieve: Function that downloads and verifies the file.

    Raises:
        SkillError: If the download fails; the message names the address and what to do.
    """
    try:
        return retrieve(dataset)
    except ImportError as error:
        reason = f"{error.name or error} is not installed: pip install '.[data]' in the clone"
        raise SkillError(f"{_download_failure_message(dataset)} ({reason})") from error
    except (OSError, ValueError) as error:  # of requests, and of a wrong hash
        raise SkillError(f"{_download_failure_message(dataset)} ({str(error)[:120]})") from error


def _download_failure_message(dataset: Dataset) -> str:
    return (
        f"data set {dataset.name!r} could not be downloaded from {dataset.url}. Put it by hand at "
        f"FOLDER/{dataset.file} and set {DATA_FOLDER_VARIABLE}=FOLDER; synthetic_valve(rng) needs no network"
    )


def _fetch(dataset: Dataset) -> Path:
    """Return the file in the user's cache; download it with a progress bar if it is missing."""
    import pooch  # an extra, and slow to import
    import tqdm  # noqa: F401 # for the progress bar; if it is missing, the error should name it

    file = PurePosixPath(dataset.file)
    path = pooch.retrieve(
        dataset.url,
        known_hash=f"sha256:{dataset.sha256}",
        fname=file.name,
        path=Path(pooch.os_cache("pilotfish")) / file.parent,
        progressbar=True,
    )
    return Path(path)
