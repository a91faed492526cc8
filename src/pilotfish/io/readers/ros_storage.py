"""Bounds of ROS bags that are checked before, or while, the library `rosbags` reads them.

Compressed chunks expand to what they hold, not to what the file states, and `rosbags` expands a chunk at
once. Chunks of MCAP files are therefore expanded to a bounded size first, and those of ROS 1 bags by a
bounded function. An SQLite file may define an endless view in the place of a table; only plain tables pass.
"""

import sqlite3
import struct
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import IO, Any

from pilotfish.errors import InvalidInput
from pilotfish.io.optional_libraries import require_library
from pilotfish.io.paths import open_regular_file
from pilotfish.io.read_errors import READ_ERRORS
from pilotfish.validation import short_repr

MAX_CHUNK_BYTES = 2**28  # of one chunk or message after expansion
MAX_FILE_EXPANSION = 2**36  # bytes of one compressed file after expansion
PURPOSE = "ROS recordings"
FIX = "record or fetch it again, or repair it (`rosbag reindex`, `ros2 bag reindex`, `mcap recover`)"
MCAP_MAGIC = b"\x89MCAP0\r\n"
_MCAP_CHUNK, _MCAP_RECORD, _MCAP_CHUNK_HEADER = 0x06, struct.Struct("<BQ"), struct.Struct("<QQQII")
_PIECE = 2**20


@contextmanager
def name_errors(path: Path) -> Iterator[None]:
    """Turn each error of reading a bag into InvalidInput that names it."""
    rosbag1, rosbag2 = (require_library(f"rosbags.rosbag{n}", PURPOSE) for n in (1, 2))
    libraries = (
        rosbag1.ReaderError,
        rosbag2.ReaderError,
        require_library("rosbags.serde", PURPOSE).SerdeError,
        require_library("rosbags.typesys", PURPOSE).TypesysError,
        require_library("apsw", PURPOSE).Error,
        _zstd().ZstdError,
        sqlite3.Error,
        struct.error,
    )
    try:
        yield
    except InvalidInput as error:
        prefix = "" if str(error).startswith(str(path)) else f"{path}: "
        raise InvalidInput(f"{prefix}{error}") from error
    except (*READ_ERRORS, *libraries, RecursionError, AssertionError) as error:
        reason = str(error) or type(error).__name__
        raise InvalidInput(f"{path}: damaged, or not a ROS recording: {reason}; {FIX}") from error


def expand(data: bytes, compression: str) -> bytes:
    """Return expanded data of bounded size.

    Args:
        data: Compressed data.
        compression: "bz2", "lz4" or "zstd".

    Raises:
        InvalidInput: If the data expands to more than `MAX_CHUNK_BYTES`, or is incomplete.
    """
    create: dict[str, Callable[[], Any]] = {
        "bz2": require_library("bz2", PURPOSE).BZ2Decompressor,
        "lz4": require_library("lz4.frame", PURPOSE).LZ4FrameDecompressor,
        "zstd": _zstd().ZstdDecompressor,
    }
    parts, size, limit = [], 0, MAX_CHUNK_BYTES
    while data:
        decompressor = create[compression]()
        part = decompressor.decompress(data, max_length=limit + 1 - size)
        parts.append(part)
        if (size := size + len(part)) > limit:
            raise InvalidInput(f"a chunk expands to more than {limit} bytes; record it with smaller chunks")
        if not decompressor.eof:
            raise InvalidInput(f"a chunk of {len(data)} bytes is incomplete; {FIX}")
        data = decompressor.unused_data or b""
    return b"".join(parts)


def bound_ros1_chunks(reader: Any) -> None:
    """Make a reader of ROS 1 bags expand chunks to a bounded size.

    Args:
        reader: Open `rosbags.rosbag1.Reader`.
    """
    module = require_library("rosbags.rosbag1.reader", PURPOSE)
    known = {module.decompressors[name]: name for name in ("bz2", "lz4")}
    for position, chunk in reader.chunks.items():
        if (compression := known.get(chunk.decompressor)) is not None:
            bounded = _bounded(compression)
            reader.chunks[position] = chunk._replace(decompressor=bounded)


def require_bounded_mcap(path: Path) -> None:
    """Check that each compressed chunk of an MCAP file expands to a bounded size.

    Args:
        path: MCAP file.

    Raises:
        InvalidInput: If a chunk expands to more than `MAX_CHUNK_BYTES`.
    """
    with name_errors(path), open_regular_file(path, "an MCAP file") as file:
        size = file.seek(0, 2)
        file.seek(len(MCAP_MAGIC))
        while len(head := file.read(_MCAP_RECORD.size)) == _MCAP_RECORD.size:
            kind, length = _MCAP_RECORD.unpack(head)
            if length > size - file.tell():
                return  # the end magic, or a file that was cut short, which the reader refuses
            end = file.tell() + length
            if kind == _MCAP_CHUNK:
                _require_bounded_chunk(file, length)
            file.seek(end)


def require_plain_tables(path: Path) -> None:
    """Check that `topics` and `messages` of an SQLite file are tables, not views.

    Args:
        path: SQLite file.

    Raises:
        InvalidInput: If they are something else, or the file is damaged.
    """
    query = "SELECT name, sql FROM sqlite_master WHERE name IN ('topics', 'messages') LIMIT 10"
    with name_errors(path):
        uri = f"{path.absolute().as_uri()}?mode=ro&immutable=1"
        with closing(sqlite3.connect(uri, uri=True)) as database:
            found = dict(database.execute(query).fetchall())
        for name in ("topics", "messages"):
            words = str(found.get(name, "")).upper().split()[:2]
            if words != ["CREATE", "TABLE"]:
                raise InvalidInput(f"{name!r} is {short_repr(found.get(name))}, expected a table of rosbag2")


def require_bounded_file(path: Path) -> None:
    """Check that a file that is compressed as a whole expands to a bounded size.

    Args:
        path: File compressed by zstd.

    Raises:
        InvalidInput: If it expands to more than `MAX_FILE_EXPANSION`.
    """
    with (
        name_errors(path),
        open_regular_file(path, "a compressed bag") as file,
        _zstd().open(file) as expanded,
    ):
        size = 0
        while part := expanded.read(_PIECE):
            if (size := size + len(part)) > MAX_FILE_EXPANSION:
                raise InvalidInput(f"it expands to more than {MAX_FILE_EXPANSION} bytes; expand it by hand")


def _require_bounded_chunk(file: IO[bytes], length: int) -> None:
    if length < _MCAP_CHUNK_HEADER.size + 8:
        raise InvalidInput(f"a chunk has {length} bytes, too few for its header; {FIX}")
    *_, name_length = _MCAP_CHUNK_HEADER.unpack(file.read(_MCAP_CHUNK_HEADER.size))
    if name_length > 16 or (content := length - _MCAP_CHUNK_HEADER.size - name_length - 8) < 0:
        raise InvalidInput(f"the header of a chunk is damaged; {FIX}")
    compression = file.read(name_length).decode()
    file.seek(8, 1)  # its stated size
    if compression and compression not in ("lz4", "zstd"):
        raise InvalidInput(f"a chunk is compressed by {short_repr(compression)}, expected lz4 or zstd")
    if compression:
        expand(file.read(content), compression)


def _bounded(compression: str) -> Callable[[bytes], bytes]:
    return lambda data: expand(data, compression)


def _zstd() -> Any:
    try:
        return require_library("compression.zstd", PURPOSE)  # Python 3.14
    except InvalidInput:
        return require_library("backports.zstd", PURPOSE)
