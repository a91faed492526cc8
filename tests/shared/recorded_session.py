"""Records of a session for tests, and the file that `SessionWriter` makes of them."""

from pathlib import Path
from typing import Any

import numpy as np

from pilotfish.io import SessionRecord, SessionWriter

PERIOD = 20_000_000  # ns
SKILL = b"skill" * 20
TEXTS = {"settings": '{"rtt":1.2}', "pilotfish": "0.1.0"}


def sample_records(rng: np.random.Generator, count: int = 60) -> list[SessionRecord]:
    """Return records of two channels, and of a third one that begins late."""
    names = ["operator", "robot", "pictures"]
    return [
        SessionRecord(
            names[n % (2 if n < count // 2 else 3)], n * PERIOD, rng.bytes(int(rng.integers(0, 200)))
        )
        for n in range(count)
    ]


def write_session(path: Path, records: list[SessionRecord], **options: Any) -> Path:
    """Write metadata, records, and an attachment before the tenth record; return the path."""
    with SessionWriter(path, **options) as writer:
        writer.describe(TEXTS)
        for n, record in enumerate(records):
            if n == 10:
                writer.attach("valve.skill", SKILL)
            writer.write(*record)
    return path
