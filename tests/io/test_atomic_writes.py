"""A file is there whole or not at all."""

from pathlib import Path

import pytest

from pilotfish.errors import InvalidInput
from pilotfish.io.atomic_writes import atomic_file


def write_half(path: Path, trouble: type[BaseException]) -> None:
    with atomic_file(path) as temporary:
        temporary.write_text("half")
        raise trouble


def test_what_is_written_takes_the_name_at_the_end(tmp_path: Path):
    """Until then the name holds what it held."""
    path = tmp_path / "motion.csv"
    path.write_text("old")
    with atomic_file(path) as temporary:
        temporary.write_text("new")
        assert path.read_text() == "old"
    assert path.read_text() == "new"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("trouble", [KeyboardInterrupt, OSError, ZeroDivisionError])
def test_an_interrupt_leaves_everything_as_it_was(tmp_path: Path, trouble: type[BaseException]):
    """Ctrl-C, a full disk or a bug half way through: the old file stays, nothing lies beside it."""
    path = tmp_path / "motion.csv"
    path.write_text("old")
    with pytest.raises((trouble, InvalidInput)):
        write_half(path, trouble)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_writer_sees_the_ending_of_the_name(tmp_path: Path):
    """Some writers choose the format by it, some append one that is missing."""
    with atomic_file(tmp_path / "gains.npz") as temporary:
        assert temporary.suffix == ".npz"
        temporary.touch()
    with atomic_file(tmp_path / ("x" * 250)) as temporary:
        temporary.touch()
    assert len(list(tmp_path.iterdir())) == 2


def test_a_new_file_may_be_read_by_those_who_may_read_others(tmp_path: Path):
    """The mode is that of any file a program makes, not that of a secret."""
    (tmp_path / "plain").touch()
    with atomic_file(tmp_path / "skill") as temporary:
        temporary.write_bytes(b"x")
    assert (tmp_path / "skill").stat().st_mode == (tmp_path / "plain").stat().st_mode


@pytest.mark.parametrize("name", [".", "missing/file", "file/below"])
def test_places_that_cannot_be_written_are_refused(tmp_path: Path, name: str):
    """A folder, a file in no folder, a file below a file: each named."""
    (tmp_path / "file").touch()
    with (
        pytest.raises(InvalidInput, match=r"not a regular file|cannot be written"),
        atomic_file(tmp_path / name) as temporary,
    ):
        temporary.write_text("x")
    assert [file.name for file in tmp_path.iterdir()] == ["file"]


def test_a_device_is_never_replaced_by_a_file():
    """Writing to the null device as root must not remove it."""
    with pytest.raises(InvalidInput, match="not a regular file"), atomic_file("/dev/null") as temporary:
        temporary.write_text("x")
    assert Path("/dev/null").is_char_device()


def test_who_reads_the_old_file_reads_it_to_the_end(tmp_path: Path):
    """The new file takes the name of the old one at once; a reader never meets half of both."""
    path = tmp_path / "skill"
    path.write_text("the old skill")
    with path.open() as reader:
        assert reader.read(8) == "the old "
        with atomic_file(path) as temporary:
            temporary.write_text("THE NEW SKILL")
        assert reader.read() == "skill"
    assert path.read_text() == "THE NEW SKILL"
