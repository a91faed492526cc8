"""Record demonstrations and execute skills in physics, with films of both."""

from pilotfish.simulation.execution import ExecutionResult, ExecutionSettings, execute
from pilotfish.simulation.films import FilmRecorder, encode_film, film_strip, require_pillow, write_film
from pilotfish.simulation.meshes import baxter_meshes
from pilotfish.simulation.recording import (
    DEMONSTRATION_STREAM,
    TEST_STREAM,
    RecordedDemonstration,
    record,
    record_demonstrations,
    situation_from_seed,
)
from pilotfish.simulation.rendering import require_mujoco, require_renderer

__all__ = [
    "DEMONSTRATION_STREAM",
    "TEST_STREAM",
    "ExecutionResult",
    "ExecutionSettings",
    "FilmRecorder",
    "RecordedDemonstration",
    "baxter_meshes",
    "encode_film",
    "execute",
    "film_strip",
    "record",
    "record_demonstrations",
    "require_mujoco",
    "require_pillow",
    "require_renderer",
    "situation_from_seed",
    "write_film",
]
