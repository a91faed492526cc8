"""Guarded paths: no path gives another error than InvalidInput, and no reader waits or reads without end."""

import os
import socket
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import pytest

from pilotfish.errors import InvalidInput
from pilotfish.io.paths import (
    is_file,
    is_folder,
    open_regular_file,
    path_exists,
    read_file,
    resolve_path,
)

CHECKS: list[Callable[[Path], object]] = [path_exists, is_file, is_folder]
EXPECTED = "a skill file"


@pytest.fixture
def loop(tmp_path: Path) -> Path:
    """A symbolic link to itself."""
    link = tmp_path / "loop"
    link.symlink_to(link)
    return link


@pytest.mark.parametrize("check", CHECKS)
def test_missing_path_is_not_there(check: Callable[[Path], object], tmp_path: Path) -> None:
    assert not check(tmp_path / "nothing")
    (tmp_path / "file").touch()
    assert not check(tmp_path / "file" / "below")


@pytest.mark.parametrize("check", CHECKS)
@pytest.mark.parametrize("name", ["n" * 300, "null\0byte", "lone\ud800surrogate"])
def test_name_that_no_file_can_have_is_refused(
    check: Callable[[Path], object], name: str, tmp_path: Path
) -> None:
    with pytest.raises(InvalidInput, match="cannot be used: "):
        check(tmp_path / name)


@pytest.mark.parametrize("check", [*CHECKS, resolve_path])
def test_link_to_itself_is_refused(check: Callable[[Path], object], loop: Path) -> None:
    with pytest.raises(InvalidInput, match="loop cannot be used"):
        check(loop)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may look into every folder")
@pytest.mark.parametrize("check", CHECKS)
def test_folder_without_permission_is_refused(check: Callable[[Path], object], tmp_path: Path) -> None:
    locked = tmp_path / "locked"
    locked.mkdir(mode=0o000)
    with pytest.raises(InvalidInput, match="permission"):
        check(locked / "file")


def test_kinds_of_paths_are_told_apart(tmp_path: Path) -> None:
    file, link = tmp_path / "file", tmp_path / "link"
    file.touch()
    link.symlink_to(file)
    assert [check(link) for check in CHECKS] == [True, True, False]
    assert [check(tmp_path) for check in CHECKS] == [True, False, True]
    assert resolve_path(link) == file.resolve()


def test_link_without_a_target_does_not_exist(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(tmp_path / "nothing")
    assert not path_exists(tmp_path / "link")


def test_file_of_the_largest_size_is_read_and_a_larger_one_refused(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_bytes(b"12345")
    assert read_file(file, EXPECTED, 5) == b"12345"
    with pytest.raises(InvalidInput, match="has more than 4 bytes; expected a skill file of at most that"):
        read_file(file, EXPECTED, 4)


def test_sparse_file_of_a_terabyte_is_refused_without_being_read(tmp_path: Path) -> None:
    file = tmp_path / "file"
    with file.open("wb") as open_file:
        open_file.truncate(2**40)
    with pytest.raises(InvalidInput, match="has more than"):
        read_file(file, EXPECTED)


def test_small_file_is_read_without_memory_for_the_largest(tmp_path: Path) -> None:
    """`file.read(largest)` allocates as much as it may read before it reads."""
    (tmp_path / "small").write_bytes(b"few")
    tracemalloc.start()
    try:
        assert read_file(tmp_path / "small", EXPECTED) == b"few"
        assert tracemalloc.get_traced_memory()[1] < 4 * 2**20
    finally:
        tracemalloc.stop()


def test_file_that_says_it_is_empty_is_read_up_to_the_bound() -> None:
    """Files of the kernel report the size 0, whatever they hold."""
    with pytest.raises(InvalidInput, match="has more than 10 bytes"):
        read_file("/proc/self/maps", EXPECTED, 10)


def test_fifo_without_a_writer_is_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "fifo")
    with pytest.raises(InvalidInput, match="fifo is not a regular file; expected a skill file"):
        read_file(tmp_path / "fifo", EXPECTED)


def test_socket_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # the address of a socket is short
    with socket.socket(socket.AF_UNIX) as one:
        one.bind("socket")
        with pytest.raises(InvalidInput, match="expected a skill file"):
            read_file("socket", EXPECTED)


@pytest.mark.parametrize("device", ["/dev/zero", "/dev/null"])
def test_device_is_refused_also_behind_a_link(device: str, tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(device)
    for path in (device, tmp_path / "link"):
        with pytest.raises(InvalidInput, match="is not a regular file"):
            read_file(path, EXPECTED)


@pytest.mark.parametrize("name", ["nothing", "n" * 300, "null\0byte", "."])
def test_path_that_cannot_be_read_is_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(InvalidInput, match="expected a skill file"):
        read_file(tmp_path / name, EXPECTED)


def test_refused_files_leave_no_descriptor_open(tmp_path: Path) -> None:
    def held() -> int:
        return len(list(Path("/proc/self/fd").iterdir()))

    os.mkfifo(tmp_path / "fifo")
    before = held()
    for _ in range(10):
        with pytest.raises(InvalidInput):
            read_file(tmp_path / "fifo", EXPECTED)
        with pytest.raises(InvalidInput):
            read_file(tmp_path, EXPECTED)
    assert held() == before


def test_opened_file_is_closed_after_use(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"abc")
    with open_regular_file(tmp_path / "file", EXPECTED) as file:
        assert file.read(2) == b"ab"
    assert file.closed


def test_message_about_a_path_with_control_characters_is_printable(tmp_path: Path) -> None:
    with pytest.raises(InvalidInput) as caught:
        read_file(tmp_path / "a\x1b[2J\nb", EXPECTED)
    assert "a\\x1b[2J\\nb" in str(caught.value)
