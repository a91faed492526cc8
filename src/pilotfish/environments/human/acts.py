"""What a person sets out to do: a script of acts, each with a goal for the tool among the objects seen."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import inf

from pilotfish.environments.human.offsets import offset_norms, pose_difference
from pilotfish.environments.human.person import HumanModel
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose
from pilotfish.validation import require_type


@dataclass(frozen=True, slots=True)
class Subtask:
    """One thing to do: bring the tool to a goal, change the grip, stay a while.

    goal                world_from_tool wanted, from the poses of the objects as they are seen
    position_tolerance  within which the goal counts as reached [m]
    angle_tolerance     likewise [rad]
    grip                what the hand asks of the gripper from then on, 0 to 1
    dwell               time to stay after that [s]
    tracking            the goal moves: once near, follow it continuously where the delay lets one
    speed               share of the person's peak speeds; little for careful contact
    passing             a goal on the way: when what is left of the movement is within the tolerances the next
                        act begins, and the two movements blend. Nothing is corrected; no dwell, no tracking
    """

    name: str
    goal: Callable[[Mapping[str, Pose]], Pose]
    position_tolerance: float
    angle_tolerance: float
    grip: float = 0.0
    dwell: float = 0.0
    tracking: bool = False
    speed: float = 1.0
    passing: bool = False

    def __post_init__(self) -> None:
        for name in ("position_tolerance", "angle_tolerance", "speed"):
            if not 0.0 < getattr(self, name) < inf:
                raise InvalidInput(
                    f"{name} of subtask {self.name!r} is {getattr(self, name)}, expected a positive number"
                )
        if not 0.0 <= self.grip <= 1.0:
            raise InvalidInput(
                f"grip of subtask {self.name!r} is {self.grip}, expected 0 (open) to 1 (closed)"
            )
        if not 0.0 <= self.dwell < inf:
            raise InvalidInput(f"dwell of subtask {self.name!r} is {self.dwell} s, expected 0 or more")
        if self.passing and (self.dwell > 0.0 or self.tracking):
            raise InvalidInput(
                f"subtask {self.name!r} is passing, expected no dwell and no tracking; set passing=False to stay"
            )


@dataclass(frozen=True, slots=True)
class DemonstrationPlan:
    """Who does what, and the time round_trip from moving the hand to seeing the tool move [s]."""

    human_model: HumanModel
    subtasks: tuple[Subtask, ...]
    round_trip: float = 0.0

    def __post_init__(self) -> None:
        require_type(self.human_model, "human_model", HumanModel, "give HumanModel()")
        require_type(self.subtasks, "subtasks", tuple, "give a tuple of subtasks")
        if not self.subtasks:
            raise InvalidInput("subtasks is empty, expected at least one Subtask")
        for subtask in self.subtasks:
            require_type(subtask, "a subtask", Subtask, "give Subtask(...)")
        if not 0.0 <= self.round_trip < inf:
            raise InvalidInput(f"round_trip is {self.round_trip} s, expected 0 or more")


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """The picture as it arrives: where the tool and the objects were when it was taken, all in the world."""

    tool: Pose
    frames: Mapping[str, Pose]


@dataclass(frozen=True, slots=True, eq=False)
class HandCommand:
    """What the hand asks: where the tool shall be, and how closed the gripper, 0 to 1.

    act is the index of the act in the script, done tells that all are over.
    """

    pose: Pose
    grip: float
    subtask: int
    done: bool


def within_tolerance(tool: Pose, goal: Pose, subtask: Subtask) -> bool:
    """Whether the tool is at the goal, to the act's tolerances."""
    distance, angle = offset_norms(pose_difference(tool, goal))
    return distance <= subtask.position_tolerance and angle <= subtask.angle_tolerance
