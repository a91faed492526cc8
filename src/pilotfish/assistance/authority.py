"""Authority of the assistance: one inside what the demonstrations covered, zero outside, and never abrupt.

Distance. The command x is compared with every state of the skill adapted to the frames observed, so that
coverage is judged where the objects are. With the whitened deviations w_k = L_k^(-1) log_mu_k(x), where
L_k L_k^T = Sigma_k + S, in the n columns of the position (p) and the three of the orientation (o),

    distance(x) = min over k of max(|w_k,p| / sqrt(n), |w_k,o| / sqrt(3)).

Position and orientation are judged apart: the tool of a neighbouring object is turned as this one's, and an
average over all columns would hide that it is elsewhere. The orientation is judged given the position.

Gate. The authority is 1 up to the distance `full`, 0 from `none` on, and falls smoothly between (3 s^2 - 2
s^3). `calibrate_gate` leaves out each demonstration once, learns from the others, and takes the 75 % quantile
of the distances of the one left out for `full`; at 1.15 times the 90 % quantile the authority is one half.
Neither is less than 1 and 2: distances that any Gaussian exceeds often.

Hysteresis. An operator who had assistance and leaves what the skill covers, so that the authority comes to
zero, is not drawn back half-way. It stays at zero until the distance is at most `full`, or mode or skill
change.

Rate. Authority moves towards the gate by at most two per second. Missing frames have the gate 0.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from pilotfish.assistance.carried import carried_situation
from pilotfish.assistance.coordinates import coordinate_frames, coordinate_skill, pose_width
from pilotfish.assistance.operator_noise import DEFAULT_NOISE, OperatorNoise
from pilotfish.demonstrations import Demonstration
from pilotfish.errors import InvalidInput
from pilotfish.geometry import normalise
from pilotfish.kernels import coverage_distance, gate_authority
from pilotfish.models import Skill
from pilotfish.types import Array, Float
from pilotfish.validation import require_number, require_type

MIN_FULL, MIN_HALF = 1.0, 2.0
FULL_QUANTILE, HALF_QUANTILE, MARGIN = 0.75, 0.9, 1.15
MAX_DISTANCE = 1e6


@dataclass(frozen=True, slots=True)
class Gate:
    """Distances between which the authority falls from one to zero.

    Attributes:
        full: Largest distance with full authority.
        none: Smallest distance without authority.

    Raises:
        InvalidInput: If they are not finite, or full is not below none.
    """

    full: float = MIN_FULL
    none: float = 2.0 * MIN_HALF - MIN_FULL

    def __post_init__(self) -> None:
        require_number(self.full, "full", 0.0, MAX_DISTANCE)
        require_number(self.none, "none", 0.0, MAX_DISTANCE)
        if self.full >= self.none:
            raise InvalidInput(f"full is {self.full} and none {self.none}, expected full below none")

    def authority(self, distance: float) -> float:
        """Return the authority at a distance; it never increases with the distance.

        Args:
            distance: Distance from `coverage_distance`; not a number counts as infinite.
        """
        return gate_authority(self.full, self.none, distance)


def calibrate_gate(
    demonstrations: Sequence[Demonstration],
    learn_skill: Callable[[list[Demonstration]], Skill],
    noise: OperatorNoise = DEFAULT_NOISE,
) -> Gate:
    """Calibrate the gate by leaving out each demonstration once.

    Args:
        demonstrations: Demonstrations of the skill, at least three.
        learn_skill: Function that learns the skill from some of them, as it is learned from all.
        noise: Imprecision of the operator.

    Returns:
        The gate, as at the head of this file.

    Raises:
        InvalidInput: If there are fewer than three demonstrations, or they do not fit the skill.
    """
    require_type(demonstrations, "demonstrations", Sequence, "pass a list")
    require_type(noise, "noise", OperatorNoise, "OperatorNoise() makes one")
    if len(demonstrations) < 3:
        raise InvalidInput(
            f"demonstrations has {len(demonstrations)} recordings, expected at least 3, so that a skill can "
            "be learned without each; use Gate()"
        )
    distances = []
    for m, left_out in enumerate(demonstrations):
        others = [demo for n, demo in enumerate(demonstrations) if n != m]
        distances.append(coverage_distances(learn_skill(others), left_out, noise))
    full, half = np.quantile(np.concatenate(distances), [FULL_QUANTILE, HALF_QUANTILE])
    full = max(MIN_FULL, float(full))
    half = max(MIN_HALF, MARGIN * float(half), full + 0.5)
    return Gate(full, 2.0 * half - full)


def coverage_distances(
    skill: Skill, demonstration: Demonstration, noise: OperatorNoise = DEFAULT_NOISE
) -> Float[Array, " T"]:
    """Return the distance of every step of a demonstration from what a skill covers.

    Args:
        skill: Learned skill.
        demonstration: Recording of the same task, in its own situation.
        noise: Imprecision of the operator.

    Raises:
        InvalidInput: If the demonstration does not fit the skill.
    """
    require_type(demonstration, "demonstration", Demonstration, "pf.demonstration makes one")
    coordinates = coordinate_skill(skill)
    layout, deviations = coordinates.layout, noise.deviations(coordinates.layout)
    if demonstration.layout != skill.layout:
        raise InvalidInput("the demonstration has other columns than the skill, expected the same layout")
    x = demonstration.x[:, np.array(skill.layout.coordinates)]
    for columns in layout.unit_quaternions:
        x[:, columns] = normalise(x[:, columns])
    moving = any(frame.is_moving for frame in demonstration.frames)
    distances, scalars = np.empty(len(x)), layout.tangent.width - pose_width(layout)
    for t, row in enumerate(x):
        if t == 0 or moving:
            frames = coordinate_frames([frame.at(t) for frame in demonstration.frames], skill.layout)
            situation = carried_situation(coordinates, frames, frames, deviations)
        distances[t] = coverage_distance(situation, row, scalars)
    return distances
