"""Cache of simulated recordings in build/recordings.

A recording depends on the code and its settings. It is stored under a hash of both, so that a change of any
file of pilotfish gives a new recording.
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
    """Return the cached demonstrations, or call `make` and cache its result.

    Several processes may call it at the same time: a folder is written atomically, and the first one is kept.

    Args:
        script: File of the code that records, outside pilotfish.
        settings: Everything that `make` depends on, in words.
        make: Function that returns the demonstrations; it depends on its code and the settings only.
    """
    folder = FOLDER / hashlib.sha256(f"{code_hash(Path(script))} {settings}".encode()).hexdigest()[:32]
    if not folder.exists():
        demonstrations = make()
        FOLDER.mkdir(parents=True, exist_ok=True)
        try:
            write_demonstrations(demonstrations, folder)
        except InvalidInput:
            if not folder.exists():
                raise
    return tuple(read_demonstrations(folder))


@cache
def code_hash(script: Path) -> str:
    """Return a hash of a script, of pilotfish with its kernels, and of the versions of its libraries."""
    digest = hashlib.sha256(script.read_bytes())
    for name in ("numpy", "scipy", "mujoco-core"):
        digest.update(importlib.metadata.version(name).encode())
    for folder in map(Path, pf.__path__):  # an editable install has its kernels in another folder
        for file in sorted(folder.rglob("*")):
            if file.suffix in (".py", ".so"):
                digest.update(file.read_bytes())
    return digest.hexdigest()
