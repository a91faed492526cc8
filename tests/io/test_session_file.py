"""Sessions are read as they were written, and a recording that is refused or fails keeps what it has."""

import json
import re
import resource
import sys
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.records import Channel, Chunk, Header, Message, Metadata
from mcap.stream_reader import StreamReader
from recorded_session import PERIOD, SKILL, TEXTS, sample_records, write_session

from pilotfish.errors import InvalidInput, OutputExists
from pilotfish.io import SessionRecord, SessionWriter, read_session
from pilotfish.io.session_records import MAX_RECORD_BYTES


@pytest.fixture
def records(rng: np.random.Generator) -> list[SessionRecord]:
    return sample_records(rng)


# --------------------------------------------------------------------------------------------- content


def test_session_round_trip_is_exact(tmp_path, records):
    path = write_session(tmp_path / "a.mcap", records)
    read = read_session(path)
    assert list(read.records()) == records == list(read.records())
    assert (read.metadata, read.attachments) == (TEXTS, {"valve.skill": SKILL})
    assert (read.is_complete, read.record_count) == (True, len(records))
    assert read.channels == ("operator", "robot", "pictures")
    assert [file.name for file in tmp_path.iterdir()] == ["a.mcap"]
    assert len(repr(read)) <= 200


def test_empty_session_round_trip_has_nothing(tmp_path):
    with SessionWriter(tmp_path / "a.mcap"):
        pass
    read = read_session(tmp_path / "a.mcap")
    assert (read.metadata, read.attachments, read.record_count, read.is_complete) == ({}, {}, 0, True)
    assert list(read.records()) == []


def test_equal_sessions_give_equal_bytes(tmp_path, records):
    first, second = (write_session(tmp_path / name, records) for name in ("a.mcap", "b.mcap"))
    assert first.read_bytes() == second.read_bytes()
    with SessionWriter(tmp_path / "c.mcap") as writer:
        writer.describe(dict(reversed(TEXTS.items())))
    with SessionWriter(tmp_path / "d.mcap") as writer:
        writer.describe(TEXTS)
    assert (tmp_path / "c.mcap").read_bytes() == (tmp_path / "d.mcap").read_bytes()


def test_library_reader_reads_the_same_content(tmp_path, records):
    with write_session(tmp_path / "a.mcap", records).open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        messages = [(c.topic, m.log_time, m.data) for _, c, m in reader.iter_messages()]
        assert messages == records
        assert [(a.name, a.data) for a in reader.iter_attachments()] == [("valve.skill", SKILL)]
        (metadata,) = list(reader.iter_metadata())
        assert metadata.metadata.items() >= TEXTS.items()
        statistics = reader.get_summary().statistics
        assert (statistics.message_count, statistics.channel_count) == (len(records), 3)
        file.seek(0)
        assert sum(isinstance(r, Message) for r in StreamReader(file, validate_crcs=True).records) == len(
            records
        )


def test_large_records_give_chunks_of_bounded_size(tmp_path, rng):
    data = rng.bytes(400_000)
    path = write_session(tmp_path / "a.mcap", [SessionRecord("pictures", n, data) for n in range(12)])
    with path.open("rb") as file:
        chunks = [r for r in StreamReader(file, emit_chunks=True).records if isinstance(r, Chunk)]
    assert len(chunks) >= 4
    assert max(len(chunk.data) for chunk in chunks) < 2**20 + 500_000
    assert [record.data for record in read_session(path).records()] == [data] * 12


# --------------------------------------------------------------------------------------------- writing


def test_existing_file_is_kept_unless_overwrite(tmp_path, records):
    path = write_session(tmp_path / "a.mcap", records)
    before = path.read_bytes()
    with pytest.raises(InvalidInput, match="exists; choose another name, or pass overwrite=True"):
        SessionWriter(path)
    assert path.read_bytes() == before
    write_session(path, records[:5], overwrite=True)
    assert read_session(path).record_count == 5


def test_existing_part_is_kept_whatever_overwrite(tmp_path):
    (tmp_path / "a.mcap.part").write_bytes(b"rest")
    for overwrite in (False, True):
        with pytest.raises(InvalidInput, match=r"a\.mcap\.part exists: a session that was cut short"):
            SessionWriter(tmp_path / "a.mcap", overwrite=overwrite)
    assert (tmp_path / "a.mcap.part").read_bytes() == b"rest"


def test_part_that_appears_before_the_session_begins_is_kept(tmp_path):
    writer = SessionWriter(tmp_path / "a.mcap")
    (tmp_path / "a.mcap.part").write_bytes(b"other")
    with pytest.raises(InvalidInput, match=r"a\.mcap\.part exists"):
        writer.__enter__()
    assert (tmp_path / "a.mcap.part").read_bytes() == b"other"


def test_file_that_appears_during_the_session_is_kept(tmp_path, records):
    writer = SessionWriter(tmp_path / "a.mcap").__enter__()
    writer.write(*records[0])
    (tmp_path / "a.mcap").write_bytes(b"other")
    with pytest.raises(OutputExists) as caught:
        writer.__exit__(None, None, None)
    assert (tmp_path / "a.mcap").read_bytes() == b"other"
    assert caught.value.path == tmp_path / "a.mcap.part"
    assert read_session(caught.value.path).is_complete


@pytest.fixture
def small_disk() -> Iterator[None]:
    """Limit the size of files to 20,000 bytes: a write beyond it fails as on a full disk."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, limits[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, limits)


@pytest.mark.usefixtures("small_disk")
@pytest.mark.parametrize("flush_every_ns", [1, 200_000_000, 10**9])
def test_full_disk_is_reported_and_keeps_a_readable_part(tmp_path, rng, flush_every_ns: int):
    """Also if the session goes over the limit only when it ends, and if the caller writes on."""
    records = sample_records(rng, 300)
    with pytest.raises(
        InvalidInput, match=r"a\.mcap\.part cannot be written: File too large; free some space"
    ):
        write_session(tmp_path / "a.mcap", records, flush_every_ns=flush_every_ns)
    assert not (tmp_path / "a.mcap").exists()
    read = read_session(tmp_path / "a.mcap.part")
    found = list(read.records())
    assert found == records[: len(found)]
    assert not read.is_complete


@pytest.mark.usefixtures("small_disk")
def test_disk_full_at_the_end_of_the_session_is_reported(tmp_path):
    """The attachment fits, and the summary does not."""
    with (
        pytest.raises(InvalidInput, match="cannot be written: File too large"),
        SessionWriter(tmp_path / "a.mcap") as writer,
    ):
        writer.attach("large", bytes(19_800))
    assert not (tmp_path / "a.mcap").exists()
    read = read_session(tmp_path / "a.mcap.part")
    assert (len(read.attachments["large"]), read.is_complete) == (19_800, False)


@pytest.mark.usefixtures("small_disk")
def test_full_disk_further_writes_are_refused(tmp_path, rng):
    with SessionWriter(tmp_path / "a.mcap") as writer:
        with pytest.raises(InvalidInput, match="cannot be written"):
            writer.attach("large", bytes(50_000))
        with pytest.raises(InvalidInput, match="is not being written"):
            writer.write("robot", 0, b"x")
    assert read_session(tmp_path / "a.mcap.part").record_count == 0
    assert not (tmp_path / "a.mcap").exists()


def test_folder_that_does_not_exist_is_refused(tmp_path):
    with pytest.raises(InvalidInput, match="cannot be written: No such file or directory"):
        SessionWriter(tmp_path / "no" / "a.mcap").__enter__()


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda w: w.write("robot", 4, b""), "time_ns is 4, expected a whole number from 5"),
        (lambda w: w.write("robot", 5.0, b""), "time_ns is 5.0"),
        (lambda w: w.write("robot", 5, "text"), "data has type str"),
        (lambda w: w.write("", 5, b""), "the name of a channel is ''"),
        (lambda w: w.write("a\nb", 5, b""), "the name of a channel"),
        (lambda w: w.write("robot", 5, bytes(MAX_RECORD_BYTES + 1)), "data has 16777217 bytes"),
        (lambda w: w.attach("a", "text"), "the attachment has type str"),
        (lambda w: w.attach(" a", b""), "the name of an attachment"),
        (lambda w: (w.attach("a", b""), w.attach("a", b"")), "'a' is attached already"),
        (lambda w: w.describe({"a": 1}), "the text of 'a' has type int"),
        (lambda w: w.describe([]), "texts has type list"),
        (lambda w: w.describe({"crc32": "0"}), "'crc32' is reserved"),
        (lambda w: w.describe({"a": "\ud800"}), "cannot be encoded"),
        (lambda w: w.describe({"a": "x" * (2**20 + 1)}), "the metadata has 1048578 bytes"),
        (lambda w: (w.describe({}), w.describe({})), "described already"),
    ],
)
def test_invalid_argument_is_refused_and_the_session_continues(tmp_path, call: Any, message: str):
    with SessionWriter(tmp_path / "a.mcap") as writer:
        writer.write("robot", 5, b"first")
        with pytest.raises(InvalidInput, match=message):
            call(writer)
        writer.write("robot", 6, b"second")
    read = read_session(tmp_path / "a.mcap")
    assert [record.data for record in read.records()] == [b"first", b"second"]
    assert read.is_complete


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize("interval", [0, 10**9 + 1, 0.5])
def test_flush_interval_beyond_one_second_is_refused(tmp_path, interval: Any):
    with pytest.raises(InvalidInput, match="flush_every_ns is"):
        SessionWriter(tmp_path / "a.mcap", flush_every_ns=interval)


def test_write_outside_the_block_is_refused(tmp_path):
    writer = SessionWriter(tmp_path / "a.mcap")
    with pytest.raises(InvalidInput, match="use SessionWriter in a with block"):
        writer.write("robot", 0, b"")
    assert not list(tmp_path.iterdir())


def test_missing_library_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "mcap", None)
    for call in (SessionWriter, read_session):
        with pytest.raises(InvalidInput, match=r"pip install '.\[sessions\]' in the clone"):
            call(tmp_path / "a.mcap")


def test_too_many_channels_are_refused_by_writer(tmp_path):
    with SessionWriter(tmp_path / "a.mcap") as writer:
        for n in range(1000):
            writer.write(f"channel {n}", n, b"")
        with pytest.raises(InvalidInput, match="'another' is one channel too many"):
            writer.write("another", 1000, b"")
    assert len(read_session(tmp_path / "a.mcap").channels) == 1000


def test_documentation_program_reads_the_same_records_twice(tmp_path, monkeypatch):
    text = (Path(__file__).parents[2] / "docs" / "session-file.md").read_text(encoding="utf-8")
    names: dict[str, Any] = {}
    monkeypatch.chdir(tmp_path)
    exec("\n".join(re.findall(r"```python\n(.*?)```", text, re.DOTALL)), names)  # noqa: S102
    assert names["records"] == names["messages"]
    assert len(names["records"]) == 200
    assert names["session"].is_complete


def test_file_has_the_layout_and_the_size_of_its_documentation(tmp_path):
    """A minute of 50 records per second; 31 bytes for each record, 0.4 MB with 100 bytes of data."""
    path = write_session(
        tmp_path / "a.mcap", [SessionRecord("robot", n * PERIOD, bytes(100)) for n in range(3000)]
    )
    assert 3000 * 131 < path.stat().st_size < 3000 * 131 + 25_000
    with path.open("rb") as file:
        found = list(StreamReader(file, validate_crcs=True).records)
    header = next(record for record in found if isinstance(record, Header))
    messages = [record for record in found if isinstance(record, Message)]
    channel = next(record for record in found if isinstance(record, Channel))
    (metadata,) = (record for record in found if isinstance(record, Metadata))
    assert (header.profile, header.library) == ("pilotfish-session", "1")
    assert [message.sequence for message in messages] == list(range(3000))
    assert all(message.log_time == message.publish_time for message in messages)
    assert (channel.id, channel.schema_id, channel.message_encoding) == (1, 0, "application/octet-stream")
    texts = json.dumps(TEXTS, sort_keys=True, separators=(",", ":")).encode()
    assert metadata.metadata == {**TEXTS, "crc32": f"{zlib.crc32(texts):08x}"}
