"""Record demonstrations, perform skills and operate the robot in physics, with films."""

from pilotfish.simulation.captions import caption_images
from pilotfish.simulation.execution import ExecutionResult, perform, plan_in_situation
from pilotfish.simulation.films import FilmRecorder, encode_film, film_strip, require_pillow, write_film
from pilotfish.simulation.meshes import baxter_meshes
from pilotfish.simulation.mission import MissionResult, MissionSettings, run_mission
from pilotfish.simulation.recording import (
    RecordedDemonstration,
    delay_observations,
    record,
    record_demonstrations,
    simulated_leader,
    situation_from_seed,
)
from pilotfish.simulation.selection import select_by_success
from pilotfish.simulation.teleoperation import Link, TeleoperationResult, displace_view, teleoperate

__all__ = [
    "ExecutionResult",
    "FilmRecorder",
    "Link",
    "MissionResult",
    "MissionSettings",
    "RecordedDemonstration",
    "TeleoperationResult",
    "baxter_meshes",
    "caption_images",
    "delay_observations",
    "displace_view",
    "encode_film",
    "film_strip",
    "perform",
    "plan_in_situation",
    "record",
    "record_demonstrations",
    "require_pillow",
    "run_mission",
    "select_by_success",
    "simulated_leader",
    "situation_from_seed",
    "teleoperate",
    "write_film",
]
