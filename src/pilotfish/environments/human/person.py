"""A person as numbers: how well they aim, how fast they move, when they wait."""

from dataclasses import dataclass
from math import inf, pi, radians

from pilotfish.errors import InvalidInput
from pilotfish.validation import require_type

NON_NEGATIVE = (
    "parallel_noise",
    "perpendicular_noise",
    "min_noise",
    "angular_noise",
    "min_angular_noise",
    "max_lead",
    "max_angular_lead",
    "feedforward_gain",
)
POSITIVE = ("gain", "peak_speed", "min_duration", "peak_angular_speed", "tau_e", "timeout")
DELAYS = ("reaction_time", "max_tracking_delay")


@dataclass(frozen=True, slots=True)
class HumanModel:
    """How a person moves a hand; the defaults stand for an ordinary one.

    along, across  deviation of a sub-movement's end in its own direction and in each of the two across it,
                   as shares of its length
    floor          neither deviation is less [m]
    gain           share of the error seen that a sub-movement sets out to remove: most fall a little short
    reaction       from what is seen to the movement that answers it [s]
    peak_speed     of the hand, at the middle of a long sub-movement [m/s]
    shortest       time that any sub-movement takes at least [s]
    peak_turn      of the hand, at the middle of a long turn [rad/s]
    turn_noise     deviation of a turn's end about each of three axes, as a share of its angle
    turn_floor     that deviation is not less [rad]
    tau_e          effective delay of eye, nerve and muscle in tracking [s]
    phase_margin   of the loop that a tracking person closes [rad]
    wait_above     with a longer round trip nobody tracks: they move and wait [s]
    pursuit        share of a tracked goal's own speed that the hand goes along with: 0 answers the error
                   alone, and trails a goal of speed u by u / w_c
    lean           the hand runs ahead of a tool that does not follow by this at most, and by what is still
                   to go [m]
    turn_lean      likewise [rad]
    patience       time after which an act whose goal is not reached is given up [s]
    Source: along to shortest and tau_e to wait_above are agreed on for the evaluation without people, after
    Flash & Hogan 1985, Ferrell 1965 and McRuer & Jex 1967. The others are chosen here: turns about as precise
    as reaches, and half a degree is about what a picture shows.
    """

    parallel_noise: float = 0.07
    perpendicular_noise: float = 0.035
    min_noise: float = 0.001
    gain: float = 0.95
    reaction_time: float = 0.25
    peak_speed: float = 0.25
    min_duration: float = 0.35
    peak_angular_speed: float = 1.5
    angular_noise: float = 0.05
    min_angular_noise: float = radians(0.5)
    tau_e: float = 0.2
    phase_margin: float = radians(35.0)
    max_tracking_delay: float = 0.4
    feedforward_gain: float = 0.0
    max_lead: float = 0.05
    max_angular_lead: float = radians(20.0)
    timeout: float = 30.0

    def __post_init__(self) -> None:
        for name in (*NON_NEGATIVE, *POSITIVE, *DELAYS, "phase_margin"):
            require_type(getattr(self, name), name, (float, int), "give a number")
        for name in POSITIVE:
            if not 0.0 < getattr(self, name) < inf:
                raise InvalidInput(f"{name} is {getattr(self, name)}, expected a positive number")
        for name in (*NON_NEGATIVE, *DELAYS):
            if not 0.0 <= getattr(self, name) < inf:
                raise InvalidInput(f"{name} is {getattr(self, name)}, expected 0 or more")
        if self.gain >= 2.0:
            raise InvalidInput(
                f"gain is {self.gain}, expected less than 2: from there on corrections diverge"
            )
        if not 0.0 < self.phase_margin < pi / 2:
            raise InvalidInput(
                f"phase_margin is {self.phase_margin} rad, expected between 0 and pi / 2; math.radians "
                "makes radians of degrees"
            )
