"""Skill of a mission at defaults, kept in the user's cache, and the envelope around a skill."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

import pilotfish
from pilotfish.assistance import calibrate_gate, learn_virtual_fixture
from pilotfish.demonstrations import Demonstration, frame_from_pose
from pilotfish.environments import Task
from pilotfish.errors import InvalidInput, SkillError
from pilotfish.geometry import Pose
from pilotfish.io import (
    atomic_file,
    decode_assisted_skill,
    encode_assisted_skill,
    make_folder,
    path_exists,
    read_file,
)
from pilotfish.models import Skill, adapt, learn
from pilotfish.simulation.meshes import cache_folder
from pilotfish.simulation.recording import record_demonstrations
from pilotfish.teleop import Envelope
from pilotfish.validation import shorten_repr

DEMONSTRATIONS, SEED = 6, 0
MAX_CACHE_BYTES = 2**24
MARGIN = 0.05  # m, of an envelope
DEVIATIONS = 2.0  # standard deviations of each state inside an envelope


@shorten_repr
@dataclass(frozen=True, slots=True)
class MissionSkill:
    """Skill prepared for a mission.

    Attributes:
        data: Bytes from `io.encode_assisted_skill`.
        file: File of the cache; None if it could not be written.
        is_new: Whether it was learned now.
        demonstrations: Number of demonstrations.
    """

    data: bytes
    file: Path | None
    is_new: bool
    demonstrations: int = DEMONSTRATIONS


def mission_skill(
    task: Task[Any], on_recording: Callable[[int, int], None] = lambda done, count: None
) -> MissionSkill:
    """Return the skill of a task at defaults: from the cache, or recorded and learned now.

    Args:
        task: Task.
        on_recording: Function that is called after each demonstration with their number and that of all.

    Raises:
        SkillError: If a demonstration fails repeatedly.
    """
    file = _cache_file(task)
    if file and (data := _read_cache(file)) is not None:
        return MissionSkill(data, file, is_new=False)
    data = learn_assisted_skill(task, on_recording)
    if file:
        try:
            make_folder(file.parent, "set XDG_CACHE_HOME to another folder")
            with atomic_file(file) as part:
                part.write_bytes(sha256(data).digest() + data)
        except SkillError:
            file = None
    return MissionSkill(data, file, is_new=True)


def learn_assisted_skill(task: Task[Any], on_recording: Callable[[int, int], None]) -> bytes:
    """Record six demonstrations, and learn a skill with its gate and its virtual fixture.

    Args:
        task: Task.
        on_recording: Function that is called after each demonstration with their number and that of all.

    Raises:
        SkillError: If a demonstration fails repeatedly.
    """
    recorded: list[Demonstration] = []
    for recording, _ in record_demonstrations(task, DEMONSTRATIONS, SEED):
        recorded.append(recording.demonstration)
        on_recording(len(recorded), DEMONSTRATIONS)
    gate = calibrate_gate(recorded, _learn)
    fixture = learn_virtual_fixture(recorded, rng=np.random.default_rng(SEED))
    return encode_assisted_skill(_learn(recorded), gate=gate, fixture=fixture)


def envelope_around_skill(
    data: bytes, poses: Mapping[str, Pose], duration: float, modes: tuple[str, ...]
) -> Envelope:
    """Return an envelope around the states of a skill where the objects are.

    The box contains two standard deviations of every state and 5 cm more. The distance from the
    demonstrations is that at which the assistance has no authority.

    Args:
        data: Bytes of the skill, from `io.encode_assisted_skill`.
        poses: Pose of each object.
        duration: Longest time without the operator [s].
        modes: Modes from which the robot may continue.

    Raises:
        InvalidInput: If the skill has other frames.
    """
    assisted = decode_assisted_skill(data)
    skill = assisted.skill
    if missing := [name for name in skill.frame_names if name not in poses]:
        raise InvalidInput(f"the skill has frame {missing[0]!r}, expected one of {', '.join(poses)}")
    frames = [frame_from_pose(name, skill.layout, poses[name]) for name in skill.frame_names]
    states = adapt(skill, frames)
    means = states.means[:, :3]
    spread = DEVIATIONS * np.sqrt(np.diagonal(states.covariances, axis1=1, axis2=2)[:, :3])
    lower, upper = (means - spread).min(axis=0) - MARGIN, (means + spread).max(axis=0) + MARGIN
    return Envelope(
        duration, tuple(map(float, lower)), tuple(map(float, upper)), float(assisted.gate.none), modes
    )


def _learn(demonstrations: list[Demonstration]) -> Skill:
    return learn(demonstrations, rng=np.random.default_rng(SEED)).skill


def _cache_file(task: Task[Any]) -> Path | None:
    version = sha256(pilotfish.__version__.encode()).hexdigest()[:8]
    try:
        return cache_folder() / f"{task.name.replace(' ', '-')}-{version}.assisted"
    except SkillError:  # no home folder
        return None


def _read_cache(file: Path) -> bytes | None:
    """Return the skill of a cached file; None if it is missing or damaged."""
    if not path_exists(file):
        return None
    try:
        content = read_file(file, "a skill", MAX_CACHE_BYTES)
        if sha256(content[32:]).digest() != content[:32]:
            return None
        decode_assisted_skill(content[32:])
    except SkillError:
        return None
    return content[32:]
