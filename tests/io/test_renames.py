"""Renames in one step, with renameat2, with hard links only, and with neither."""

import os
from errno import EOPNOTSUPP, EPERM
from pathlib import Path
from typing import NoReturn

import pytest

from pilotfish.errors import InvalidInput, OutputExists
from pilotfish.io import renames
from pilotfish.io.atomic_writes import atomic_file, atomic_folder
from pilotfish.io.container_format import write_container
from pilotfish.io.renames import exchange_paths, make_folder, rename_exclusive


def unsupported(*_: object, **__: object) -> NoReturn:
    raise OSError(EPERM, "Operation not permitted")


@pytest.fixture(params=["renameat2", "links", "neither"])
def system(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Provide renameat2; hard links only; or neither."""
    if request.param != "renameat2":
        monkeypatch.setattr(renames, "_libc_renameat2", lambda: None)
    if request.param == "neither":
        monkeypatch.setattr(os, "link", unsupported)
    return str(request.param)


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def occupy(path: Path, kind: str) -> None:
    if kind == "file":
        path.write_text("mine")
    elif kind == "folder":
        path.mkdir()
    else:
        path.symlink_to("nowhere")


@pytest.mark.parametrize("kind", ["file", "folder", "link without a target"])
def test_rename_exclusive_taken_name_raises_and_keeps_both(tmp_path: Path, system: str, kind: str):
    occupy(tmp_path / "target", kind)
    (tmp_path / "source").write_text("new")
    with pytest.raises(FileExistsError):
        rename_exclusive(tmp_path / "source", tmp_path / "target")
    assert (tmp_path / "source").read_text() == "new"
    assert names(tmp_path) == ["source", "target"]
    assert kind != "file" or (tmp_path / "target").read_text() == "mine"


def test_rename_exclusive_free_name_moves_file(tmp_path: Path, system: str):
    (tmp_path / "source").write_text("new")
    rename_exclusive(tmp_path / "source", tmp_path / "target")
    assert (tmp_path / "target").read_text() == "new"
    assert names(tmp_path) == ["target"]


def test_exchange_paths_exchanges_folders_or_returns_false(tmp_path: Path):
    for name in ("one", "other"):
        (tmp_path / name / name).mkdir(parents=True)
    done = exchange_paths(tmp_path / "one", tmp_path / "other")
    assert names(tmp_path / "one") == (["other"] if done else ["one"])


@pytest.mark.parametrize("kind", ["file", "link without a target"])
def test_atomic_file_name_taken_meanwhile_keeps_both(tmp_path: Path, system: str, kind: str):
    (tmp_path / "motion-1.csv").write_text("another")

    def write() -> None:
        with atomic_file(tmp_path / "motion.csv", overwrite=False) as temporary:
            temporary.write_text("new")
            occupy(tmp_path / "motion.csv", kind)

    with pytest.raises(OutputExists, match=r"motion\.csv exists and is kept; .* in .*motion-2\.csv") as taken:
        write()
    assert taken.value.path == tmp_path / "motion-2.csv"
    assert taken.value.path.read_text() == "new"
    assert names(tmp_path) == ["motion-1.csv", "motion-2.csv", "motion.csv"]
    assert kind == "file" or (tmp_path / "motion.csv").is_symlink()


@pytest.mark.parametrize("kind", ["file", "link without a target"])
def test_write_container_existing_file_raises_and_keeps_result_if_asked(tmp_path: Path, kind: str):
    occupy(tmp_path / "motion.csv", kind)
    with pytest.raises(InvalidInput, match="exists; choose another name"):
        write_container(b"new", tmp_path / "motion.csv", overwrite=False, use_free_name=False)
    assert names(tmp_path) == ["motion.csv"]
    with pytest.raises(OutputExists, match=r"exists and is kept; this result is in .*motion-1\.csv"):
        write_container(b"new", tmp_path / "motion.csv", overwrite=False, use_free_name=True)
    assert (tmp_path / "motion-1.csv").read_bytes() == b"new"


def test_atomic_file_overwrite_follows_link(tmp_path: Path):
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "real").write_text("old")
    (tmp_path / "link").symlink_to("folder/real")
    with atomic_file(tmp_path / "link") as temporary:
        temporary.write_text("new")
    assert (tmp_path / "link").readlink() == Path("folder/real")
    assert (tmp_path / "folder" / "real").read_text() == "new"


def test_atomic_folder_name_taken_meanwhile_keeps_both(tmp_path: Path):

    def write(place: Path) -> None:
        with atomic_folder(place) as temporary_folder:
            (temporary_folder / "new").touch()
            if place.name == "folder":
                (place / "mine").mkdir(parents=True)
            else:
                place.touch()

    for name in ("folder", "file"):
        with pytest.raises(OutputExists) as taken:
            write(tmp_path / name)
        assert names(taken.value.path) == ["new"]
    assert names(tmp_path) == ["file", "file-1", "folder", "folder-1"]


def test_atomic_folder_file_added_meanwhile_is_kept(tmp_path: Path):
    """The old folder is checked again after the exchange, and is restored."""

    def require_replaceable(folder: Path) -> None:
        if (folder / "precious").exists():
            raise InvalidInput("it holds a precious file")

    (tmp_path / "set").mkdir()
    (tmp_path / "set" / "old").touch()

    def write() -> None:
        with atomic_folder(tmp_path / "set", require_replaceable) as temporary_folder:
            (temporary_folder / "new").touch()
            (tmp_path / "set" / "precious").touch()

    with pytest.raises(OutputExists, match=r"precious file; this result is in .*set-1") as taken:
        write()
    assert names(tmp_path / "set") == ["old", "precious"]
    assert names(taken.value.path) == ["new"]
    assert names(tmp_path) == ["set", "set-1"]


@pytest.mark.parametrize("name", ["x" * 300, "loop", "loop/below", "file/below", "a\0b", "\ud800"])
def test_atomic_writes_impossible_name_raises(tmp_path: Path, name: str):
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "file").touch()
    for overwrite in (True, False):
        with pytest.raises(InvalidInput), atomic_file(tmp_path / name, overwrite=overwrite) as temporary:
            temporary.touch()
    with pytest.raises(InvalidInput), atomic_folder(tmp_path / name):
        pass
    with pytest.raises(InvalidInput, match="cannot be made"):
        make_folder(tmp_path / name)
    assert names(tmp_path) == ["file", "loop"]


def test_atomic_file_fsync_of_folder_unsupported_succeeds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Some network file systems do not support it."""
    real = os.fsync

    def fsync(descriptor: int) -> None:
        if Path(f"/proc/self/fd/{descriptor}").resolve().is_dir():
            raise OSError(EOPNOTSUPP, "not supported")
        real(descriptor)

    monkeypatch.setattr(os, "fsync", fsync)
    with atomic_file(tmp_path / "motion.csv") as temporary:
        temporary.write_text("new")
    assert (tmp_path / "motion.csv").read_text() == "new"
