"""Recordings of sessions: one MCAP file of timed bytes, skills and settings, which may be cut short.

docs/session-file.md specifies the format. `SessionWriter` writes to `PATH.part`, and renames it at the end.
Records are collected in chunks, each of which is written at once: a killed process loses the records of the
last chunk only. Sessions with equal content give equal bytes.

Invariant: what is in `.part` is a prefix of a session. After an error or an interrupt in the middle of a
write, nothing more is written.
"""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import IO, Any

from pilotfish.errors import InvalidInput, OutputExists, UnreadableFile
from pilotfish.io.paths import open_regular_file, path_exists, resolve_path
from pilotfish.io.renames import fsync_path, rename_exclusive
from pilotfish.io.session_records import (
    CHECKSUM_KEY,
    CHUNK_BYTES,
    CONTENT_TYPE,
    MAX_ATTACHMENT_BYTES,
    MAX_ATTACHMENTS,
    MAX_CHANNELS,
    MAX_METADATA_BYTES,
    MAX_RECORD_BYTES,
    MAX_TIME,
    METADATA_NAME,
    PROFILE,
    VERSION,
    SessionRecord,
    metadata_checksum,
    read_records,
    scan_session,
)
from pilotfish.validation import require_count, require_name, require_type, shorten_repr

FLUSH_EVERY = 500_000_000  # ns


@shorten_repr
@dataclass(frozen=True, slots=True)
class SessionFile:
    """Recording of a session that `read_session` has checked.

    Attributes:
        path: File.
        is_complete: Whether the recording was finished; otherwise the end of the session may be missing.
        metadata: Texts by name: settings, versions.
        attachments: Bytes by name: skills.
        channels: Names of the channels in the order of their first records.
        record_count: Number of records.
    """

    path: Path
    is_complete: bool
    metadata: dict[str, str]
    attachments: dict[str, bytes]
    channels: tuple[str, ...]
    record_count: int
    _chunks: tuple[int, ...] = field(repr=False)

    def records(self) -> Iterator[SessionRecord]:
        """Yield the records in their order; one chunk at a time is in memory.

        Raises:
            UnreadableFile: If the file was altered after it was checked.
            InvalidInput: If the file can no longer be read.
        """
        with _open_session(self.path) as file:
            yield from read_records(file, self._chunks)


def read_session(path: str | Path) -> SessionFile:
    """Return the content of a recording after a check of the whole file.

    The records themselves are read from the file when they are used. A recording that was cut short is read
    up to its last whole chunk.

    Args:
        path: File that `SessionWriter` wrote, or the `.part` of a recording that was killed.

    Raises:
        UnreadableFile: If the file is damaged, altered, of another kind or of another version.
        InvalidInput: If the file cannot be opened, or mcap is not installed.
    """
    _require_mcap()
    with _open_session(path) as file:
        content = scan_session(file)
    return SessionFile(
        path=Path(path),
        is_complete=content.is_complete,
        metadata=content.metadata or {},
        attachments=content.attachments,
        channels=tuple(content.channels.values()),
        record_count=content.record_count,
        _chunks=tuple(content.chunks),
    )


class SessionWriter:
    """Recorder of a session, a context manager.

    It writes to `PATH.part`, which is renamed to PATH at the end. After an exception, a full disk or a killed
    process the `.part` remains; `read_session` reads what it has.

    Example:
        >>> with SessionWriter("valve.mcap") as writer:            # doctest: +SKIP
        ...     writer.describe({"settings": "{}"})
        ...     writer.attach("valve.skill", Path("valve.skill").read_bytes())
        ...     writer.write("operator", 0, b"command")
    """

    def __init__(
        self, path: str | Path, *, overwrite: bool = False, flush_every_ns: int = FLUSH_EVERY
    ) -> None:
        """Check the arguments; the file is made at the start of the `with` block.

        Args:
            path: File to write.
            overwrite: Whether an existing file may be replaced. An existing `.part` is always kept: it is the
                rest of a session, or another process writes to it.
            flush_every_ns: Longest time between the first and the last record of a chunk [ns], from 1 to 1e9:
                this much of a session is lost with a killed process.

        Raises:
            InvalidInput: If path exists and may not be replaced, `.part` exists, or mcap is not installed.
        """
        _require_mcap()
        self._flush_every = require_count(flush_every_ns, "flush_every_ns", 10**9, minimum=1)
        self._target = resolve_path(path) if overwrite else Path(path)
        self._overwrite = overwrite
        self._part = self._target.with_name(f"{self._target.name}.part")
        if not overwrite and path_exists(path, follow_links=False):
            raise InvalidInput(f"{path} exists; choose another name, or pass overwrite=True")
        if path_exists(self._part, follow_links=False):
            raise _part_exists(self._part)
        self._file: IO[bytes] | None = None
        self._writer: Any = None  # of mcap, which has types for some of its methods only
        self._channels: dict[str, int] = {}
        self._attachments: set[str] = set()
        self._attached_bytes = self._count = self._time = 0
        self._chunk_start: int | None = None
        self._is_described = False

    def __enter__(self) -> "SessionWriter":
        from mcap.writer import CompressionType, IndexType, Writer

        try:
            self._file = self._part.open("xb")
        except FileExistsError as error:
            raise _part_exists(self._part) from error
        except (OSError, ValueError) as error:
            reason = (error.strerror if isinstance(error, OSError) else None) or error
            raise InvalidInput(f"{self._part} cannot be written: {reason}; choose another folder") from error
        self._writer = Writer(
            self._file,
            chunk_size=CHUNK_BYTES,
            compression=CompressionType.NONE,  # equal bytes on every machine
            index_types=IndexType.CHUNK | IndexType.ATTACHMENT | IndexType.METADATA,
            enable_data_crcs=True,
        )
        with self._writing() as writer:
            writer.start(PROFILE, VERSION)
            writer.flush()
        return self

    def write(self, channel: str, time_ns: int, data: bytes) -> None:
        """Add a record.

        Args:
            channel: Name of the channel; a new one is added.
            time_ns: Time on the clock of the recorder [ns], not less than that of the record before.
            data: Bytes of the record, at most `MAX_RECORD_BYTES`.

        Raises:
            InvalidInput: If an argument breaks a condition above, or the file cannot be written.
        """
        if type(time_ns) is not int or not self._time <= time_ns <= MAX_TIME:
            time_ns = require_count(time_ns, "time_ns", MAX_TIME, self._time)
        _require_bytes(data, "data")
        if channel not in self._channels:
            self._require_channel(channel)
        with self._writing() as writer:
            if self._chunk_start is not None and time_ns - self._chunk_start > self._flush_every:
                writer.flush()
                self._chunk_start = None
            if self._chunk_start is None:
                self._chunk_start = time_ns
            if (number := self._channels.get(channel)) is None:
                self._channels[channel] = number = writer.register_channel(channel, CONTENT_TYPE, 0)
            writer.add_message(number, time_ns, data, time_ns, self._count % 2**32)
        self._count += 1
        self._time = time_ns

    def attach(self, name: str, data: bytes) -> None:
        """Add an attachment, such as a skill; it is in the file at once.

        Args:
            name: Name, which is not used yet.
            data: Its bytes, at most `MAX_RECORD_BYTES`.

        Raises:
            InvalidInput: If an argument breaks a condition above, or the file cannot be written.
        """
        require_name(name, "the name of an attachment")
        _require_bytes(data, "the attachment")
        if name in self._attachments:
            raise InvalidInput(f"{name!r} is attached already; choose another name")
        if (
            len(self._attachments) == MAX_ATTACHMENTS
            or self._attached_bytes + len(data) > MAX_ATTACHMENT_BYTES
        ):
            raise InvalidInput(
                f"a session has at most {MAX_ATTACHMENTS} attachments of {MAX_ATTACHMENT_BYTES} bytes in all"
            )
        with self._writing() as writer:
            writer.add_attachment(self._time, self._time, name, CONTENT_TYPE, data)
            writer.flush()
        self._chunk_start = None
        self._attachments.add(name)
        self._attached_bytes += len(data)

    def describe(self, texts: dict[str, str]) -> None:
        """Add the metadata, once: settings as JSON, versions of software.

        Args:
            texts: Texts by name.

        Raises:
            InvalidInput: If it was called before, a value is not text, or the file cannot be written.
        """
        require_type(texts, "texts", dict, "pass a dictionary of texts by name")
        if self._is_described:
            raise InvalidInput("the session is described already; call describe once")
        for name, text in texts.items():
            if require_name(name, "a name of the metadata") == CHECKSUM_KEY:
                raise InvalidInput(f"the name {name!r} is reserved for the checksum; choose another one")
            require_type(text, f"the text of {name!r}", str, "pass JSON or other text")
        texts = dict(sorted(texts.items()))
        try:
            size = sum(len(name.encode()) + len(text.encode()) for name, text in texts.items())
        except UnicodeEncodeError as error:
            raise InvalidInput(f"the metadata cannot be encoded: {error}; remove lone surrogates") from error
        if size > MAX_METADATA_BYTES:
            raise InvalidInput(
                f"the metadata has {size} bytes, expected at most {MAX_METADATA_BYTES}; attach it"
            )
        with self._writing() as writer:
            writer.add_metadata(METADATA_NAME, {**texts, CHECKSUM_KEY: metadata_checksum(texts)})
            writer.flush()
        self._chunk_start = None
        self._is_described = True

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        file, is_finished = self._file, False
        try:
            if self._writer is not None and file is not None:  # not after an error of the disk
                with self._writing() as writer:
                    if error is None:
                        writer.finish()
                        file.flush()
                        is_finished = True
                    else:
                        writer.flush()
        except InvalidInput:
            if error is None:
                raise
        finally:
            self._writer = self._file = None
            if file is not None:
                with suppress(OSError):  # a full disk again
                    file.close()
        if is_finished:
            self._rename()

    def _rename(self) -> None:
        try:
            fsync_path(self._part)
            if self._overwrite:
                self._part.replace(self._target)
            else:
                rename_exclusive(self._part, self._target)
            fsync_path(self._target.parent)
        except FileExistsError as error:
            message = f"{self._target} exists and is kept; this session is in {self._part}"
            raise OutputExists(message, self._part) from error
        except OSError as error:
            raise self._write_error(error) from error

    def _require_channel(self, channel: str) -> None:
        require_name(channel, "the name of a channel")
        if len(self._channels) == MAX_CHANNELS:
            raise InvalidInput(f"{channel!r} is one channel too many, expected at most {MAX_CHANNELS}")

    @contextmanager
    def _writing(self) -> Iterator[Any]:
        """Yield the writer; after an error or an interrupt nothing more is written."""
        if self._writer is None:
            raise InvalidInput("the session is not being written; use SessionWriter in a with block")
        try:
            yield self._writer
        except OSError as error:
            self._writer = None
            raise self._write_error(error) from error
        except BaseException:
            self._writer = None
            raise

    def _write_error(self, error: OSError) -> InvalidInput:
        reason = error.strerror or error
        return InvalidInput(
            f"{self._part} cannot be written: {reason}; free some space; read_session reads what it has"
        )


@contextmanager
def _open_session(path: str | Path) -> Iterator[IO[bytes]]:
    """Open a session for reading; messages about its content begin with its path."""
    with open_regular_file(path, "a session file") as file:
        try:
            yield file
        except UnreadableFile as error:
            raise UnreadableFile(f"{path}: {error}") from error
        except OSError as error:
            raise InvalidInput(f"{path} cannot be read: {error.strerror or error}") from error


def _require_bytes(data: bytes, label: str) -> None:
    require_type(data, label, bytes, "pass bytes")
    if len(data) > MAX_RECORD_BYTES:
        raise InvalidInput(f"{label} has {len(data)} bytes, expected at most {MAX_RECORD_BYTES}; split it")


def _part_exists(part: Path) -> InvalidInput:
    return InvalidInput(
        f"{part} exists: a session that was cut short or is being written; rename it, or choose another name"
    )


def _require_mcap() -> None:
    try:
        import mcap  # noqa: F401 - only whether it is installed
    except ImportError as error:
        raise InvalidInput("sessions need mcap: pip install '.[sessions]' in the clone") from error
