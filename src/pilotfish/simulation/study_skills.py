"""Skills of the study: recorded from simulated persons, learned at defaults, prepared for assistance.

The skill of a neighbouring object is learned from the same recordings, whose frames are displaced by 6 cm. It
leads the robot to a place 6 cm beside the goal, as a skill would that was learned for another valve.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pilotfish.assistance import calibrate_gate, learn_virtual_fixture
from pilotfish.demonstrations import Demonstration, Frame
from pilotfish.environments import TASKS
from pilotfish.errors import InvalidInput
from pilotfish.io import encode_assisted_skill
from pilotfish.models import Skill, learn
from pilotfish.simulation.recording import record_demonstrations
from pilotfish.simulation.study import MAIN_TASKS

DEMONSTRATIONS = 6
NEIGHBOUR = np.array([0.0, 0.06, 0.0])  # m: from the object to its neighbour


def learn_study_skills(task: str, seed: int = 0, *, neighbour: bool = True) -> dict[str, bytes]:
    """Record six demonstrations of a task and learn its skill, gate and virtual fixture.

    Args:
        task: Name of the task.
        seed: Seed of the recordings.
        neighbour: Whether to learn the skill of a neighbouring object too, for "valve" and "stab".

    Returns:
        Bytes of the skill by its name: that of the task, and that with "-neighbour".

    Raises:
        SkillError: If a recording fails repeatedly.
    """
    recorded = [made.demonstration for made, _ in record_demonstrations(TASKS[task], DEMONSTRATIONS, seed)]
    gate = calibrate_gate(recorded, _learn)
    fixture = learn_virtual_fixture(recorded, rng=np.random.default_rng(0))
    skills = {task: encode_assisted_skill(_learn(recorded), gate=gate, fixture=fixture)}
    if neighbour and task in MAIN_TASKS:
        displaced = [displace_frames(each, NEIGHBOUR) for each in recorded]
        skills[f"{task}-neighbour"] = encode_assisted_skill(
            _learn(displaced), gate=calibrate_gate(displaced, _learn)
        )
    return skills


def displace_frames(demonstration: Demonstration, displacement: np.ndarray) -> Demonstration:
    """Return a recording whose fixed frames are elsewhere, while the motion is the same.

    Args:
        demonstration: Recording.
        displacement: Displacement of every object [m].

    Raises:
        InvalidInput: If a frame moves.
    """
    frames = []
    for frame in demonstration.frames:
        if not isinstance(frame, Frame):
            raise InvalidInput(f"frame {frame.name!r} moves, expected fixed frames; choose another task")
        b = frame.b.copy()
        b[:3] -= displacement
        frames.append(replace(frame, b=b))
    return replace(demonstration, frames=tuple(frames))


def _learn(demonstrations: Sequence[Demonstration]) -> Skill:
    return learn(demonstrations, rng=np.random.default_rng(0)).skill
