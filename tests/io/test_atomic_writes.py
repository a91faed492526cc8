"""Atomic writes of files."""

from pathlib import Path

import pytest

from pilotfish.errors import InvalidInput
from pilotfish.io.atomic_writes import atomic_file


def write_half(path: Path, trouble: type[BaseException]) -> None:
    with atomic_file(path) as temporary:
        temporary.write_text("half")
        raise trouble


def test_atomic_file_target_changes_at_end_only(tmp_path: Path):
    path = tmp_path / "motion.csv"
    path.write_text("old")
    with atomic_file(path) as temporary:
        temporary.write_text("new")
        assert path.read_text() == "old"
    assert path.read_text() == "new"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("trouble", [KeyboardInterrupt, OSError, ZeroDivisionError])
def test_atomic_file_error_or_interrupt_keeps_old_file(tmp_path: Path, trouble: type[BaseException]):
    path = tmp_path / "motion.csv"
    path.write_text("old")
    with pytest.raises((trouble, InvalidInput)):
        write_half(path, trouble)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_atomic_file_temporary_path_has_suffix_of_target(tmp_path: Path):
    """Some writers choose the format by the suffix, and some append a missing one."""
    with atomic_file(tmp_path / "gains.npz") as temporary:
        assert temporary.suffix == ".npz"
        temporary.touch()
    with atomic_file(tmp_path / ("x" * 250)) as temporary:
        temporary.touch()
    assert len(list(tmp_path.iterdir())) == 2


def test_atomic_file_new_file_has_usual_mode(tmp_path: Path):
    (tmp_path / "plain").touch()
    with atomic_file(tmp_path / "skill") as temporary:
        temporary.write_bytes(b"x")
    assert (tmp_path / "skill").stat().st_mode == (tmp_path / "plain").stat().st_mode


@pytest.mark.parametrize("name", [".", "missing/file", "file/below"])
def test_atomic_file_unwritable_path_raises(tmp_path: Path, name: str):
    (tmp_path / "file").touch()
    with (
        pytest.raises(InvalidInput, match=r"not a regular file|cannot be written"),
        atomic_file(tmp_path / name) as temporary,
    ):
        temporary.write_text("x")
    assert [file.name for file in tmp_path.iterdir()] == ["file"]


def test_atomic_file_device_raises():
    """As root, replacing the null device would remove it."""
    with pytest.raises(InvalidInput, match="not a regular file"), atomic_file("/dev/null") as temporary:
        temporary.write_text("x")
    assert Path("/dev/null").is_char_device()


def test_atomic_file_open_reader_reads_old_content(tmp_path: Path):
    path = tmp_path / "skill"
    path.write_text("the old skill")
    with path.open() as reader:
        assert reader.read(8) == "the old "
        with atomic_file(path) as temporary:
            temporary.write_text("THE NEW SKILL")
        assert reader.read() == "skill"
    assert path.read_text() == "THE NEW SKILL"
