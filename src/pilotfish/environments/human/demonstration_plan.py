"""Plan of a demonstration: a sequence of subtasks, each with a goal pose relative to observed objects."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import inf

from pilotfish.environments.human.human_model import HumanModel
from pilotfish.environments.human.pose_offsets import offset_norms, pose_difference
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose
from pilotfish.validation import require_type, shorten_repr


@shorten_repr
@dataclass(frozen=True, slots=True)
class Subtask:
    """One step of a demonstration: bring the tool to a goal, set the grip, then wait.

    Attributes:
        name: Name for messages.
        goal: Function from the observed poses of the objects to the goal of the tool.
        position_tolerance: Distance within which the goal counts as reached [m].
        angle_tolerance: Angle within which the goal counts as reached [rad].
        grip: Grip that is commanded once the goal is reached, 0 to 1.
        dwell: Time to wait after that [s].
        tracking: The goal moves; once near it, track it continuously if the delay allows.
        speed_factor: Share of the person's peak speeds; small for careful contact.
        passing: The goal is a via-point. The next subtask begins when the rest of the movement is within the
            tolerances, so that the two movements blend. Errors are not corrected; no dwell, no tracking.
    """

    name: str
    goal: Callable[[Mapping[str, Pose]], Pose]
    position_tolerance: float
    angle_tolerance: float
    grip: float = 0.0
    dwell: float = 0.0
    tracking: bool = False
    speed_factor: float = 1.0
    passing: bool = False

    def __post_init__(self) -> None:
        """Check the ranges of the numbers."""
        for name in ("position_tolerance", "angle_tolerance", "speed_factor"):
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
                f"subtask {self.name!r} is passing, expected no dwell and no tracking; set passing=False"
            )


@shorten_repr
@dataclass(frozen=True, slots=True)
class DemonstrationPlan:
    """Person, subtasks and delay of a demonstration.

    Attributes:
        human_model: Parameters of the person.
        subtasks: Subtasks in their order.
        round_trip: Time from a movement of the hand until its effect on the tool is observed [s].
    """

    human_model: HumanModel
    subtasks: tuple[Subtask, ...]
    round_trip: float = 0.0

    def __post_init__(self) -> None:
        """Check types and ranges."""
        require_type(self.human_model, "human_model", HumanModel, "give HumanModel()")
        require_type(self.subtasks, "subtasks", tuple, "give a tuple of subtasks")
        if not self.subtasks:
            raise InvalidInput("subtasks is empty, expected at least one Subtask")
        for subtask in self.subtasks:
            require_type(subtask, "a subtask", Subtask, "give Subtask(...)")
        if not 0.0 <= self.round_trip < inf:
            raise InvalidInput(f"round_trip is {self.round_trip} s, expected 0 or more")


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """Poses of tool and objects that the human model sees, delayed by the link.

    Attributes:
        tool: Pose of the tool.
        frames: Poses of the objects by name.
    """

    tool: Pose
    frames: Mapping[str, Pose]


def within_tolerance(tool: Pose, goal: Pose, subtask: Subtask) -> bool:
    """Return whether the tool is at the goal within the tolerances of the subtask."""
    distance, angle = offset_norms(pose_difference(tool, goal))
    return distance <= subtask.position_tolerance and angle <= subtask.angle_tolerance
