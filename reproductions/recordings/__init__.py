"""Recordings of simulated people, made once and kept in build/recordings.

A recording is a function of the code and of its settings. It is kept under a hash of both, so that a change
of any file of pilotfish makes it anew.
"""

import hashlib
import importlib.metadata
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path

import pilotfish as pf
from pilotfish.demonstrations import Demonstration
from pilotfish.errors import InvalidInput
from pilotfish.io import read_demonstrations, write_demonstrations

FOLDER = Path(__file__).parents[2] / "build" / "recordings"


def cached_recording(
    script: str, settings: str, make: Callable[[], Sequence[Demonstration]]
) -> tuple[Demonstration, ...]:
    """Return the demonstrations that `make` returns, without calling it when they are kept.

    Several processes may ask at once: a folder appears whole, and the first one counts.

    Args:
        script: File of the code that makes them, outside pilotfish.
        settings: All that `make` depends on, in words.
        make: Returns the demonstrations; a function of its code and of the settings alone.
    """
    place = FOLDER / hashlib.sha256(f"{code_hash(Path(script))} {settings}".encode()).hexdigest()[:32]
    if not place.exists():
        demonstrations = make()
        FOLDER.mkdir(parents=True, exist_ok=True)
        try:
            write_demonstrations(demonstrations, place)
        except InvalidInput:
            if not place.exists():
                raise
    return tuple(read_demonstrations(place))


@cache
def code_hash(script: Path) -> str:
    """Return a hash of a script, of pilotfish, its kernels included, and of what it computes with."""
    found = hashlib.sha256(script.read_bytes())
    for name in ("numpy", "scipy", "mujoco-core"):
        found.update(importlib.metadata.version(name).encode())
    for folder in map(Path, pf.__path__):  # an editable install has its kernels in a folder of their own
        for file in sorted(folder.rglob("*")):
            if file.suffix in (".py", ".so"):
                found.update(file.read_bytes())
    return found.hexdigest()
