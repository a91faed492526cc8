"""Target of recorded sessions: frames and chunks are edited, and most mutants have right checksums."""

import struct
import zlib
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from random import Random
from tempfile import mkdtemp
from typing import Any

from fuzzing.edits_of_text import edit_bytes
from fuzzing.soundness import InvariantViolation, require_sound_text
from fuzzing.target import Target
from fuzzing.targets_demonstrations import CorruptedBytes, corrupted, edit_or_corrupt
from pilotfish.io import SessionRecord, SessionWriter
from pilotfish.io.session_records import MAGIC, SessionContent, read_records, scan_session

CHUNK, METADATA, DATA_END = 6, 12, 15
CHUNK_HEADER = 8 + 8 + 8 + 4 + 4 + 8  # times, size, CRC-32, empty name of the compression, size
Frames = tuple[tuple[int, bytes], ...]


def _sessions() -> list[CorruptedBytes]:
    place, sessions = Path(mkdtemp(prefix="fuzz-")), []
    for n, interval in enumerate((1, 10**9)):
        with SessionWriter(place / f"{n}.mcap", flush_every_ns=interval) as writer:
            writer.describe({"settings": "{}", "pilotfish": "0.1"})
            for k in range(8):
                writer.write("operator" if k % 2 else "robot", k * 20_000_000, b"record %d" % k)
            writer.attach("valve.skill", b"skill")
        sessions.append((_split((place / f"{n}.mcap").read_bytes()), ()))
    return sessions


def _split(data: bytes) -> Frames:
    """Return the operation code and the content of each frame before the data end."""
    frames, position = [], len(MAGIC)
    while data[position] != DATA_END:
        end = position + 9 + int.from_bytes(data[position + 1 : position + 9], "little")
        frames.append((data[position], data[position + 9 : end]))
        position = end
    return tuple(frames)


def _edit(frames: Frames, rng: Random) -> tuple[Frames, str]:
    n, m = rng.randrange(len(frames)), rng.randrange(len(frames))
    if len(frames) > 1 and rng.random() < 0.15:
        return frames[:n] + frames[n + 1 :], f"frame {n} left out"
    if rng.random() < 0.1:
        return (*frames[:n], frames[m], *frames[n:]), f"frame {m} repeated at {n}"
    operation, body = frames[n]
    if rng.random() < 0.05:
        operation = rng.randrange(18)
    if operation == CHUNK and rng.random() < 0.8:
        inner, outgoing = edit_bytes(body[CHUNK_HEADER:], rng)
        body = body[:CHUNK_HEADER] + inner
    else:
        body, outgoing = edit_bytes(body, rng)
    return (*frames[:n], (operation, body), *frames[n + 1 :]), f"frame {n}: {outgoing}"


def _write(value: CorruptedBytes) -> bytes:
    frames, seeds = value
    data = MAGIC
    for operation, body in frames:
        if operation == CHUNK and len(body) >= CHUNK_HEADER:
            inner = body[CHUNK_HEADER:]
            size = struct.pack("<Q", len(inner))
            body = body[:16] + size + struct.pack("<II", zlib.crc32(inner), 0) + size + inner
        data += struct.pack("<BQ", operation, len(body)) + body
    data += struct.pack("<BQI", DATA_END, 4, zlib.crc32(data))
    footer = struct.pack("<BQQQ", 2, 20, len(data), 0)
    return corrupted(data + footer + struct.pack("<I", zlib.crc32(footer)) + MAGIC, seeds)


def _read(data: bytes) -> tuple[SessionContent, list[SessionRecord]]:
    content = scan_session(BytesIO(data))
    return content, list(read_records(BytesIO(data), content.chunks))


def _use(value: Any, thorough: bool) -> None:
    content, records = value
    times = [record.time_ns for record in records]
    if len(records) != content.record_count or times != sorted(times):
        raise InvariantViolation("records are missing, or their times decrease")
    for name in (*content.channels.values(), *content.attachments, *(content.metadata or ())):
        require_sound_text(name, "name")


def _session_target() -> Target:
    return Target(_sessions(), edit_or_corrupt(_edit), _write, _read, _use)


TARGETS: dict[str, tuple[Callable[[], Target], float]] = {"session": (_session_target, 2.0)}
