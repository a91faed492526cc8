"""Sessions that were cut or damaged: read up to the cut, and refused if a bit is wrong."""

import os
import struct
import subprocess
import sys
import zlib
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap._chunk_builder import ChunkBuilder
from recorded_session import PERIOD, SKILL, TEXTS, sample_records, write_session

from pilotfish.errors import InvalidInput, UnreadableFile
from pilotfish.io import SessionRecord, SessionWriter, read_session
from pilotfish.io.session_records import read_records, scan_session


def decode(data: bytes) -> tuple[Any, list[SessionRecord]]:
    content = scan_session(BytesIO(data))
    return content, list(read_records(BytesIO(data), content.chunks))


@pytest.fixture
def records(rng: np.random.Generator) -> list[SessionRecord]:
    return sample_records(rng)


@pytest.fixture
def session(tmp_path: Path, records: list[SessionRecord]) -> bytes:
    return write_session(tmp_path / "a.mcap", records, flush_every_ns=200_000_000).read_bytes()


# ------------------------------------------------------------------------------------------- cut files


def test_cut_session_is_read_up_to_its_last_whole_chunk(session, records):
    """At every 50th byte: a prefix of the records, which grows; at most 0.2 s is lost in the data section."""
    counts = []
    for size in [*range(60, len(session), 50), len(session) - 1]:
        content, found = decode(session[:size])
        assert not content.is_complete
        assert found == records[: len(found)]
        assert content.metadata in (None, TEXTS)
        counts.append(len(found))
    assert counts == sorted(counts)
    assert counts[0] == 0
    assert counts[-1] == len(records)
    assert len(set(counts)) >= 6


@pytest.mark.parametrize("size", [0, 1, 8, 30])
def test_session_cut_in_its_header_is_refused(session, size: int):
    with pytest.raises(UnreadableFile, match="not a session"):
        scan_session(BytesIO(session[:size]))


def test_killed_recording_loses_the_last_chunk_only(tmp_path):
    """The process kills itself after 2.99 s of the session; chunks have 0.5 s."""
    program = (
        "import os, sys\nfrom pilotfish.io import SessionWriter\n"
        "writer = SessionWriter(sys.argv[1]).__enter__()\nwriter.describe({'a': 'b'})\n"
        "for n in range(300):\n    writer.write('robot', n * 10_000_000, b'%d' % n)\n"
        "os.kill(os.getpid(), 9)\n"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    result = subprocess.run(
        [sys.executable, "-c", program, str(tmp_path / "a.mcap")], env=environment, check=False
    )
    assert result.returncode == -9
    assert not (tmp_path / "a.mcap").exists()
    read = read_session(tmp_path / "a.mcap.part")
    found = [int(record.data) for record in read.records()]
    assert found == list(range(len(found)))
    assert 300 - len(found) <= 50
    assert (read.is_complete, read.metadata) == (False, {"a": "b"})


def test_flush_interval_bounds_the_time_of_unwritten_records(tmp_path):
    """After each record, all but the last 0.1 s can be read."""
    with SessionWriter(tmp_path / "a.mcap", flush_every_ns=100_000_000) as writer:
        for n in range(40):
            writer.write("robot", n * PERIOD, b"x")
            written = read_session(tmp_path / "a.mcap.part").record_count
            assert (n - written) * PERIOD <= 100_000_000


def test_exception_in_the_block_keeps_the_part_with_every_record(tmp_path, records):
    def record_session() -> None:
        with SessionWriter(tmp_path / "a.mcap") as writer:
            for record in records:
                writer.write(*record)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        record_session()
    read = read_session(tmp_path / "a.mcap.part")
    assert list(read.records()) == records
    assert not read.is_complete
    assert not (tmp_path / "a.mcap").exists()


def test_interrupt_within_a_write_leaves_a_readable_part(tmp_path, records, monkeypatch):
    """The library has written a chunk, and is interrupted before it forgets its records."""

    def interrupted(builder: ChunkBuilder) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(ChunkBuilder, "reset", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_session(tmp_path / "a.mcap", records)
    found = list(read_session(tmp_path / "a.mcap.part").records())
    assert 0 < len(found) < len(records)
    assert found == records[: len(found)]


# --------------------------------------------------------------------------------------- damaged files


def test_flipped_bit_of_a_whole_session_is_refused_or_leaves_a_prefix(session, records, rng):
    """Only the mark at the end may be damaged: then the session is read as one that was cut short."""
    for at in rng.integers(0, len(session), 400).tolist():
        damaged = bytearray(session)
        damaged[at] ^= 1 << int(rng.integers(8))
        try:
            content, found = decode(bytes(damaged))
        except UnreadableFile:
            continue
        assert at >= len(session) - 8
        assert not content.is_complete
        assert found == records


def test_flipped_bit_of_a_cut_session_is_refused_or_leaves_a_prefix(session, records, rng):
    cut = session[: len(session) * 2 // 3]
    whole = len(decode(cut)[1])
    refused = 0
    for at in rng.integers(0, len(cut), 400).tolist():
        damaged = bytearray(cut)
        damaged[at] ^= 1 << int(rng.integers(8))
        try:
            content, found = decode(bytes(damaged))
        except UnreadableFile:
            refused += 1
            continue
        assert found == records[: len(found)]
        assert len(found) <= whole
        assert content.metadata in (None, TEXTS)
        assert content.attachments in ({}, {"valve.skill": SKILL})
    assert refused > 250


def chunk_frames(session: bytes) -> list[tuple[int, int]]:
    """Return the start and the end of each chunk."""
    starts = scan_session(BytesIO(session)).chunks
    return [(at, at + 9 + int.from_bytes(session[at + 1 : at + 9], "little")) for at in starts]


def test_every_bit_of_chunk_header_and_data_end_is_checked(session):
    """Of a cut session the times, sizes and checksum of a chunk; of a whole one the checksum of all data."""
    (start, end), *_ = chunk_frames(session)
    data_end = chunk_frames(session)[-1][1]
    assert session[data_end] == 15
    places = [(at, session[:end]) for at in range(start + 9, start + 49)]
    places += [(at, session) for at in range(data_end, data_end + 13)]
    for at, data in places:
        for bit in range(8):
            damaged = bytearray(data)
            damaged[at] ^= 1 << bit
            with pytest.raises(UnreadableFile):
                decode(bytes(damaged))


def test_summary_elsewhere_is_refused_even_with_a_right_checksum(session):
    """The footer says where the summary starts."""
    data_end = chunk_frames(session)[-1][1] + 13
    for summary, start in (
        (session[data_end:-37], data_end + 1),
        (b"x" + session[data_end:-37], data_end + 1),
    ):
        footer = struct.pack("<BQQQ", 2, 20, start, 0)
        crc = zlib.crc32(footer, zlib.crc32(summary))
        with pytest.raises(UnreadableFile, match="the footer is damaged"):
            decode(session[:data_end] + summary + footer + struct.pack("<I", crc) + session[-8:])


@pytest.mark.parametrize("edit", ["missing", "repeated", "exchanged"])
def test_cut_session_with_chunks_missing_or_exchanged_is_refused(session, edit: str):
    (a, b), (c, d) = chunk_frames(session)[2:4]
    assert b == c
    first, second = session[a:b], session[c:d]
    between = {"missing": second, "repeated": first + first, "exchanged": second + first}[edit]
    with pytest.raises(UnreadableFile, match="order of the records"):
        decode(session[:a] + between)


def test_record_of_huge_length_is_refused_without_reading_it(session):
    (start, _), *_ = chunk_frames(session)
    damaged = session[: start + 1] + (2**62).to_bytes(8, "little") + session[start + 9 :]
    with pytest.raises(UnreadableFile, match=r"states \d+ bytes, expected at most"):
        decode(damaged)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "not a session: begins with b''"),
        (b"\x89PNG\r\n\x1a\n" * 10, "not a session: begins with"),
        (b"\x89MCAP0\r\n" * 2, "damaged|states"),
        (b"time,x\n0,1\n", "not a session"),
    ],
)
def test_other_files_are_refused_by_name(tmp_path, data: bytes, message: str):
    (tmp_path / "other.mcap").write_bytes(data)
    with pytest.raises(UnreadableFile, match=rf"other.mcap: .*({message})"):
        read_session(tmp_path / "other.mcap")


def other_mcap(profile: str, library: str) -> bytes:
    from mcap.writer import Writer

    buffer = BytesIO()
    writer = Writer(buffer)
    writer.start(profile, library)
    writer.finish()
    return buffer.getvalue()


@pytest.mark.parametrize(
    ("profile", "library", "message"),
    [
        ("ros2", "x", "its profile is 'ros2'"),
        ("pilotfish-session", "2", "its version is '2', this one reads 1; upgrade"),
    ],
)
def test_mcap_of_another_profile_or_version_is_refused(profile: str, library: str, message: str):
    with pytest.raises(UnreadableFile, match=message):
        scan_session(BytesIO(other_mcap(profile, library)))


def test_folder_missing_file_and_fifo_are_refused(tmp_path):
    os.mkfifo(tmp_path / "fifo")
    for name, message in (
        ("", "not a regular file"),
        ("no", "cannot be read"),
        ("fifo", "not a regular file"),
    ):
        with pytest.raises(InvalidInput, match=f"{message}.*expected a session file"):
            read_session(tmp_path / name)


def test_file_altered_after_it_was_checked_is_refused(tmp_path, records):
    path = write_session(tmp_path / "a.mcap", records)
    read = read_session(path)
    damaged = bytearray(path.read_bytes())
    damaged[len(damaged) // 2] ^= 1
    path.write_bytes(damaged)
    with pytest.raises(UnreadableFile, match=r"a\.mcap: "):
        list(read.records())
