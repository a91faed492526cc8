"""Parameters of a simulated person: precision, speeds, delays and limits."""

from dataclasses import dataclass
from math import inf, pi, radians

from pilotfish.errors import InvalidInput
from pilotfish.validation import require_type, shorten_repr

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


@shorten_repr
@dataclass(frozen=True, slots=True)
class HumanModel:
    """Parameters of a person who moves a hand; the defaults describe an ordinary person.

    Attributes:
        parallel_noise: Standard deviation of the end of a sub-movement along it, relative to its length.
        perpendicular_noise: Standard deviation in each of the two directions across it, relative to its
            length.
        min_noise: Smallest standard deviation of either [m].
        gain: Share of the observed error that a sub-movement aims to remove; most fall a little short.
        reaction_time: Time from an observation to the movement that responds to it [s].
        peak_speed: Speed of the hand in the middle of a long sub-movement [m/s].
        min_duration: Shortest duration of a sub-movement [s].
        peak_angular_speed: Angular speed of the hand in the middle of a long rotation [rad/s].
        angular_noise: Standard deviation of the end of a rotation about each of three axes, relative to its
            angle.
        min_angular_noise: Smallest such standard deviation [rad].
        tau_e: Effective delay of eye, nerve and muscle in tracking [s].
        phase_margin: Phase margin of the tracking loop [rad].
        max_tracking_delay: Largest round-trip time of tracking [s]; above it, people move and wait.
        feedforward_gain: Share of the goal's velocity that is added in tracking. With 0 the hand lags a goal
            of velocity u by u / w_c.
        max_lead: Largest distance by which the hand leads a tool that does not follow [m].
        max_angular_lead: Largest angle of such a lead [rad].
        timeout: Time after which a subtask whose goal is not reached is abandoned [s].

    Source:
        Flash & Hogan 1985, Ferrell 1965 and McRuer & Jex 1967 for parallel_noise to min_duration and tau_e to
        max_tracking_delay. The other values are chosen: rotations about as precise as reaches, and half a
        degree as the smallest angle that is visible in a picture.
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
        """Check types and ranges."""
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
                f"gain is {self.gain}, expected less than 2; corrections diverge from there on"
            )
        if not 0.0 < self.phase_margin < pi / 2:
            raise InvalidInput(
                f"phase_margin is {self.phase_margin} rad, expected between 0 and pi / 2; "
                "math.radians converts degrees"
            )
