"""Paths and files from outside: InvalidInput is the only error, and no reader waits or reads without end."""

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
    """Return a symbolic link to itself."""
    link = tmp_path / "loop"
    link.symlink_to(link)
    return link


@pytest.mark.parametrize("check", CHECKS)
def test_path_checks_missing_path_return_false(check: Callable[[Path], object], tmp_path: Path) -> None:
    assert not check(tmp_path / "nothing")
    (tmp_path / "file").touch()
    assert not check(tmp_path / "file" / "below")


@pytest.mark.parametrize("check", CHECKS)
@pytest.mark.parametrize("name", ["n" * 300, "null\0byte", "lone\ud800surrogate"])
def test_path_checks_impossible_name_raises(
    check: Callable[[Path], object], name: str, tmp_path: Path
) -> None:
    with pytest.raises(InvalidInput, match="cannot be used: "):
        check(tmp_path / name)


@pytest.mark.parametrize("check", [*CHECKS, resolve_path])
def test_path_checks_link_to_itself_raises(check: Callable[[Path], object], loop: Path) -> None:
    with pytest.raises(InvalidInput, match="loop cannot be used"):
        check(loop)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may look into every folder")
@pytest.mark.parametrize("check", CHECKS)
def test_path_checks_folder_without_permission_raise(check: Callable[[Path], object], tmp_path: Path) -> None:
    locked = tmp_path / "locked"
    locked.mkdir(mode=0o000)
    with pytest.raises(InvalidInput, match="permission"):
        check(locked / "file")


def test_path_checks_distinguish_file_folder_and_link(tmp_path: Path) -> None:
    file, link = tmp_path / "file", tmp_path / "link"
    file.touch()
    link.symlink_to(file)
    assert [check(link) for check in CHECKS] == [True, True, False]
    assert [check(tmp_path) for check in CHECKS] == [True, False, True]
    assert resolve_path(link) == file.resolve()


def test_path_exists_link_without_target_is_false_unless_not_followed(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(tmp_path / "nothing")
    assert not path_exists(tmp_path / "link")


def test_read_file_larger_than_limit_raises(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_bytes(b"12345")
    assert read_file(file, EXPECTED, 5) == b"12345"
    with pytest.raises(InvalidInput, match="has more than 4 bytes; expected a skill file of at most that"):
        read_file(file, EXPECTED, 4)


def test_read_file_sparse_terabyte_raises_without_reading(tmp_path: Path) -> None:
    file = tmp_path / "file"
    with file.open("wb") as open_file:
        open_file.truncate(2**40)
    with pytest.raises(InvalidInput, match="has more than"):
        read_file(file, EXPECTED)


def test_read_file_small_file_takes_little_memory(tmp_path: Path) -> None:
    """`file.read(max_bytes)` would allocate that much before it reads."""
    (tmp_path / "small").write_bytes(b"few")
    tracemalloc.start()
    try:
        assert read_file(tmp_path / "small", EXPECTED) == b"few"
        assert tracemalloc.get_traced_memory()[1] < 4 * 2**20
    finally:
        tracemalloc.stop()


def test_read_file_of_stated_size_zero_reads_up_to_limit() -> None:
    """Files in /proc have the stated size 0."""
    with pytest.raises(InvalidInput, match="has more than 10 bytes"):
        read_file("/proc/self/maps", EXPECTED, 10)


def test_open_regular_file_fifo_without_writer_raises(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "fifo")
    with pytest.raises(InvalidInput, match="fifo is not a regular file; expected a skill file"):
        read_file(tmp_path / "fifo", EXPECTED)


def test_open_regular_file_socket_raises(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # the address of a socket is short
    with socket.socket(socket.AF_UNIX) as one:
        one.bind("socket")
        with pytest.raises(InvalidInput, match="expected a skill file"):
            read_file("socket", EXPECTED)


@pytest.mark.parametrize("device", ["/dev/zero", "/dev/null"])
def test_open_regular_file_device_raises(device: str, tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(device)
    for path in (device, tmp_path / "link"):
        with pytest.raises(InvalidInput, match="is not a regular file"):
            read_file(path, EXPECTED)


@pytest.mark.parametrize("name", ["nothing", "n" * 300, "null\0byte", "."])
def test_open_regular_file_unreadable_path_raises(name: str, tmp_path: Path) -> None:
    with pytest.raises(InvalidInput, match="expected a skill file"):
        read_file(tmp_path / name, EXPECTED)


def test_open_regular_file_refusal_closes_descriptor(tmp_path: Path) -> None:
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


def test_open_regular_file_closes_file_at_end(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"abc")
    with open_regular_file(tmp_path / "file", EXPECTED) as file:
        assert file.read(2) == b"ab"
    assert file.closed


def test_path_error_message_is_printable(tmp_path: Path) -> None:
    with pytest.raises(InvalidInput) as caught:
        read_file(tmp_path / "a\x1b[2J\nb", EXPECTED)
    assert "a\\x1b[2J\\nb" in str(caught.value)
