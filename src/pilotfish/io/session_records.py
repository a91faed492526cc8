"""Records of a recorded session, as MCAP stores them: what a reader accepts, checked byte by byte.

docs/session-file.md specifies the format. The reader trusts nothing. It accepts what `SessionWriter` writes
and nothing else:

- chunks and attachments are checked by their own CRC-32, metadata by a CRC-32 among its entries;
- the records of a session have sequence numbers from 0, so none is missing, repeated or exchanged;
- in a complete file the CRC-32 of the data end covers all data, and that of the footer covers the summary;
- a decoded record that would be written with other bytes is refused.

A recording that was killed ends anywhere. A file without the mark at its end is read up to its last whole
chunk. A file with that mark must be complete. Memory is that of one chunk and of the attachments.
"""

import struct
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from io import SEEK_END, BytesIO
from typing import IO, Any, NamedTuple

from pilotfish.errors import InvalidInput, UnreadableFile
from pilotfish.io.container_format import canonical_json
from pilotfish.validation import require_name, short_repr, shorten_repr

MAGIC = b"\x89MCAP0\r\n"
PROFILE, VERSION = "pilotfish-session", "1"
METADATA_NAME, CHECKSUM_KEY = "pilotfish", "crc32"
CONTENT_TYPE = "application/octet-stream"  # of records and attachments
MAX_RECORD_BYTES = 2**24  # of one record or attachment
CHUNK_BYTES = 2**20  # after which a chunk ends
MAX_CHANNELS, MAX_ATTACHMENTS, MAX_ATTACHMENT_BYTES = 1000, 1000, 2**28
MAX_METADATA_BYTES = 2**20
MAX_TIME = 2**63 - 1  # ns

_MAX_FRAME = MAX_RECORD_BYTES + 2 * CHUNK_BYTES
_MAX_CHUNKS, _MAX_SUMMARY = 2**20, 2**28
_HEADER, _CHANNEL, _MESSAGE, _CHUNK, _ATTACHMENT, _METADATA, _DATA_END = 1, 4, 5, 6, 9, 12, 15
_FRAME, _MESSAGE_HEADER, _FOOTER = struct.Struct("<BQ"), struct.Struct("<HIQQ"), struct.Struct("<BQQQI")


@shorten_repr
class SessionRecord(NamedTuple):
    """One record of a session.

    Attributes:
        channel: Name of the channel.
        time_ns: Time [ns], which never decreases from one record to the next.
        data: Bytes of the record.
    """

    channel: str
    time_ns: int
    data: bytes


@dataclass(slots=True)
class SessionContent:
    """What was read of a file until now.

    Attributes:
        channels: Name of each channel by its number.
        record_count: Number of records.
        last_time: Time of the last record [ns].
        metadata: Texts by name; None before they were read.
        attachments: Bytes by name.
        chunks: Position of each chunk in the file.
        is_complete: Whether the file was read to its end, and nothing is missing there.
    """

    channels: dict[int, str] = field(default_factory=dict)
    record_count: int = 0
    last_time: int = 0
    metadata: dict[str, str] | None = None
    attachments: dict[str, bytes] = field(default_factory=dict)
    chunks: list[int] = field(default_factory=list)
    is_complete: bool = False


class _Frames:
    """Frames of the data section: an operation code, a length, and as many bytes."""

    def __init__(self, file: IO[bytes] | BytesIO, position: int = 0) -> None:
        self.file, self.crc, self.previous_crc = file, 0, 0
        size = file.seek(0, SEEK_END)
        file.seek(max(0, size - len(MAGIC)))
        self.has_end = size >= 2 * len(MAGIC) and file.read(len(MAGIC)) == MAGIC
        file.seek(position)

    def read(self) -> tuple[int, bytes] | None:
        """Return the next operation code and its content, or None if the file ends before its end."""
        head = self.file.read(_FRAME.size)
        if len(head) < _FRAME.size:
            return self._end()
        operation, length = _FRAME.unpack(head)
        if length > _MAX_FRAME:
            raise UnreadableFile(
                f"a record of kind {operation} states {length} bytes, expected at most {_MAX_FRAME}"
            )
        body = self.file.read(length)
        if len(body) < length:
            return self._end()
        self.previous_crc, self.crc = self.crc, zlib.crc32(body, zlib.crc32(head, self.crc))
        return operation, body

    def _end(self) -> tuple[int, bytes] | None:
        if self.has_end:
            raise _damaged("a length")
        return None


def scan_session(file: IO[bytes] | BytesIO) -> SessionContent:
    """Check all of a file and return its content without the records.

    Args:
        file: File that can seek.

    Raises:
        UnreadableFile: If the file is damaged, altered, of another kind or of another version.
    """
    frames, content = _Frames(file), SessionContent()
    start = file.read(len(MAGIC))
    if start != MAGIC:
        raise UnreadableFile(f"not a session: begins with {short_repr(start)}, expected an MCAP file")
    frames.crc = zlib.crc32(start)
    if (frame := frames.read()) is None:
        raise UnreadableFile("not a session: ends in its header; record the session again")
    _check_header(*frame)
    position = file.tell()
    while (frame := frames.read()) is not None:
        operation, body = frame
        if operation == _DATA_END:
            content.is_complete = _check_end(frames, body)
            break
        if operation == _CHUNK:
            content.chunks.append(position)
            _decode_chunk(body, content)
        elif operation == _ATTACHMENT:
            _decode_attachment(body, content)
        elif operation == _METADATA:
            _decode_metadata(body, content)
        else:
            raise UnreadableFile(
                f"has a record of kind {operation}, expected chunks, attachments and metadata"
            )
        if len(content.chunks) > _MAX_CHUNKS:
            raise UnreadableFile(f"has more than {_MAX_CHUNKS} chunks; split the session")
        position = file.tell()
    return content


def read_records(file: IO[bytes] | BytesIO, chunks: Sequence[int]) -> Iterator[SessionRecord]:
    """Yield the records of chunks that `scan_session` found.

    Args:
        file: File that can seek.
        chunks: Position of each chunk.

    Raises:
        UnreadableFile: If the chunks were altered in the meantime.
    """
    content = SessionContent()
    for position in chunks:
        if (frame := _Frames(file, position).read()) is None or frame[0] != _CHUNK:
            raise UnreadableFile("was altered while it was read; read it again")
        yield from _decode_chunk(frame[1], content)


def metadata_checksum(texts: dict[str, str]) -> str:
    """Return the CRC-32 of metadata, without the entry of the checksum, as eight hexadecimal digits."""
    return f"{zlib.crc32(canonical_json(texts).encode()):08x}"


def _check_header(operation: int, body: bytes) -> None:
    from mcap.records import Header

    if operation != _HEADER:
        raise _damaged("the header")
    header = _decode(Header, body, "the header")
    if header.profile != PROFILE:
        raise UnreadableFile(f"its profile is {short_repr(header.profile)}, expected {PROFILE!r}: a session")
    if header.library != VERSION:
        raise UnreadableFile(
            f"its version is {short_repr(header.library)}, this one reads {VERSION}; upgrade pilotfish"
        )


def _check_end(frames: _Frames, body: bytes) -> bool:
    """Check the data end, the summary and the footer; return whether the file is complete."""
    if body != struct.pack("<I", frames.previous_crc):
        raise _damaged("the data section")
    if not frames.has_end:
        return False
    start = frames.file.tell()
    rest = frames.file.read(_MAX_SUMMARY + 1)
    footer = rest[-_FOOTER.size - len(MAGIC) : -len(MAGIC)]
    summary = rest[: -_FOOTER.size - len(MAGIC)]
    if len(rest) > _MAX_SUMMARY or len(footer) < _FOOTER.size:
        raise _damaged("the summary")
    operation, length, summary_start, _, crc = _FOOTER.unpack(footer)
    if (operation, length, summary_start) != (2, _FOOTER.size - _FRAME.size, start):
        raise _damaged("the footer")
    if crc != zlib.crc32(footer[:-4], zlib.crc32(summary)):
        raise _damaged("the summary")
    return True


def _decode_chunk(body: bytes, content: SessionContent) -> list[SessionRecord]:
    """Return the records of a chunk, and add its channels to the content."""
    from mcap.records import Chunk

    chunk = _decode(Chunk, body, "a chunk")
    data: bytes = chunk.data
    if (
        chunk.compression
        or chunk.uncompressed_size != len(data)
        or chunk.uncompressed_crc != zlib.crc32(data)
    ):
        raise _damaged("a chunk")
    records: list[SessionRecord] = []
    position = 0
    while position < len(data):
        start = position + _FRAME.size
        if start > len(data):
            raise _damaged("a chunk")
        operation, length = _FRAME.unpack_from(data, position)
        position = start + length
        if position > len(data):
            raise _damaged("a chunk")
        if operation == _MESSAGE and length >= _MESSAGE_HEADER.size:
            records.append(_decode_record(data, start, position, content))
        elif operation == _CHANNEL:
            _decode_channel(data[start:position], content)
        else:
            raise _damaged("a chunk")
    if not records or (records[0].time_ns, content.last_time) != (
        chunk.message_start_time,
        chunk.message_end_time,
    ):
        raise _damaged("the times of a chunk")
    return records


def _decode_record(data: bytes, start: int, end: int, content: SessionContent) -> SessionRecord:
    number, sequence, time, published = _MESSAGE_HEADER.unpack_from(data, start)
    start += _MESSAGE_HEADER.size
    if number not in content.channels or sequence != content.record_count % 2**32 or published != time:
        raise _damaged("the order of the records")
    if not content.last_time <= time <= MAX_TIME or end - start > MAX_RECORD_BYTES:
        raise _damaged("the time or the size of a record")
    content.record_count += 1
    content.last_time = time
    return SessionRecord(content.channels[number], time, data[start:end])


def _decode_channel(body: bytes, content: SessionContent) -> None:
    from mcap.records import Channel

    channel = _decode(Channel, body, "a channel")
    known = content.channels
    if (channel.id, channel.schema_id) != (len(known) + 1, 0) or channel.metadata:
        raise _damaged("a channel")
    if channel.message_encoding != CONTENT_TYPE:
        raise _damaged("a channel")
    if len(known) >= MAX_CHANNELS or channel.topic in known.values():
        raise _damaged("the list of channels")
    known[channel.id] = _checked_name(channel.topic, "a channel")


def _decode_attachment(body: bytes, content: SessionContent) -> None:
    from mcap.records import Attachment

    attachment = _decode(Attachment, body, "an attachment")
    size = sum(map(len, content.attachments.values())) + len(attachment.data)
    if len(content.attachments) >= MAX_ATTACHMENTS or size > MAX_ATTACHMENT_BYTES:
        raise UnreadableFile(
            f"has more than {MAX_ATTACHMENTS} attachments, or more than {MAX_ATTACHMENT_BYTES} bytes of them"
        )
    if attachment.media_type != CONTENT_TYPE or attachment.name in content.attachments:
        raise _damaged("an attachment")
    content.attachments[_checked_name(attachment.name, "an attachment")] = attachment.data


def _decode_metadata(body: bytes, content: SessionContent) -> None:
    from mcap.records import Metadata

    record = _decode(Metadata, body, "the metadata")
    texts: dict[str, str] = record.metadata
    checksum = texts.pop(CHECKSUM_KEY, None)
    if record.name != METADATA_NAME or content.metadata is not None or checksum != metadata_checksum(texts):
        raise _damaged("the metadata")
    content.metadata = {_checked_name(name, "metadata"): text for name, text in texts.items()}


def _decode(kind: Any, body: bytes, label: str) -> Any:
    """Return the record that the library makes of bytes, if it makes the same bytes of the record."""
    from mcap.data_stream import ReadDataStream, RecordBuilder
    from mcap.exceptions import McapError

    builder = RecordBuilder()
    try:
        record = kind.read(ReadDataStream(BytesIO(body)))
        record.write(builder)
    except (McapError, struct.error, ValueError, OverflowError) as error:
        raise _damaged(label) from error
    if builder.end()[_FRAME.size :] != body:  # type: ignore[no-untyped-call]
        raise _damaged(label)
    return record


def _checked_name(name: str, label: str) -> str:
    try:
        return require_name(name, f"the name of {label}")
    except InvalidInput as error:
        raise UnreadableFile(str(error)) from error


def _damaged(part: str) -> UnreadableFile:
    return UnreadableFile(f"the file was altered: {part} is damaged; copy or record the session again")
