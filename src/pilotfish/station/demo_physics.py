"""The skill of the demonstration in physics: the robot opens the valve that the recording was made on."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import degrees

import numpy as np

from pilotfish.demonstrations import Demonstration, Frame
from pilotfish.environments import RECORDED_VALVE, Execution, RecordedValve, Verdict, Workcell
from pilotfish.geometry import Pose, normalise
from pilotfish.station.evaluation import Replay
from pilotfish.station.films import Camera
from pilotfish.types import Array, Float

TICKS_A_SECOND = 1000


@dataclass(frozen=True, slots=True, eq=False)
class Opened:
    """A replay carried out: whether the valve is open, how it went, and frames of a film with their times [s]."""

    name: str
    new: bool
    verdict: Verdict
    force: float  # N, the largest on the tool
    distance: float  # m, the largest between what was asked of the tool and where it was
    frames: list[Float[Array, "H W 3"]]
    times: list[float]
