"""Virtual fixture: the operator pulls a cart along the learned path (6.12), and the robot follows the cart.

The pose mu(s) and its Jacobian J(s) on the path come from `phase_regression`. The operator is at xi with
the velocity v. With the deviation e = Log_mu(xi), a spring K and a damper B between operator and cart give

    ds/dt = (J' B J + eps)^-1 J' (K e + B (v - d)),        |ds/dt| <= max_rate,  0 <= s <= 1.

J, v and the velocity d of the path itself (its frames move) are expressed as rates of e, so that on S^3 e
decays as it does on R^n. eps keeps ds/dt finite where J vanishes.

Reversals. At a turning point of the path J changes its sign. A cart that lags behind then sees the operator
come back, and one that is early sees him go on: (6.12) drives either back to the start. Where the path bends
away, J' e vanishes and holds the cart. A cart that goes forward therefore stands while (6.12) would turn it
back and the operator is within 2 % of the path length: this is tremor, or the error of the path. Beyond, or
where J vanishes or the cart is off by 5 %, the guard looks within look_ahead for the phase that moves with
the operator and is nearest to him. The cart moves towards that phase unless the cart is nearer (by more than
5 % where it would go back). Otherwise the operator does go back, and so does the cart; from then on the guard
looks ahead only where the cart would go back farther than before. Backward motion is counted.

The operator acts in the scene that he sees. The phase is therefore that of the path adapted to the frames
observed, and the target is the pose at this phase on the path adapted to the actual frames.

Invariants. The phase changes by at most max_rate dt in a step, and the target is smooth in the phase and in
the frames: with constant frames it moves by at most max |J| max_rate dt.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pilotfish.assistance.phase import PHASE, coordinate_layout, sphere_layout
from pilotfish.assistance.phase_regression import (
    Guide,
    PhaseMixture,
    condition_on_phase,
    regress_on_phase,
)
from pilotfish.assistance.phase_switches import PhaseSwitch, validate_switches
from pilotfish.assistance.pose_frames import match_frames
from pilotfish.assistance.pose_validation import validate_pose
from pilotfish.demonstrations import Frame, Layout, MovingFrame, Quantity
from pilotfish.errors import InvalidInput
from pilotfish.geometry import log_map, log_map_jacobian, normalise
from pilotfish.models import Skill, part_scales
from pilotfish.types import Array, Float
from pilotfish.validation import (
    finite_array,
    require_number,
    require_period,
    require_type,
    short_list,
    shorten_repr,
)

STIFFNESS = 2.0  # 1/s, K relative to B: a cart that is off follows within half a second
MAX_RATE = 3.0  # of the mean phase rate of a demonstration
LOOK_AHEAD, LOOK_AHEAD_POINTS = 0.2, 20  # of the phase; points at which the guard evaluates the path
VANISHING = 0.05  # of the path length per phase: a shorter Jacobian counts as vanishing
REVERSAL = 0.01  # of the phase: by so much the cart goes back before it counts
TREMOR = 0.4  # of this length: the cart does not turn back while the operator is so near
GRIP_BACKLASH = 0.02  # of the phase: by so much the cart goes back before a switch is undone
MAX_DURATION = 1e6  # s


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class VirtualFixture:
    """Path of a skill over the phase, and the spring and damper that couple the operator to it.

    Deviations have three columns, rotation vectors [rad], for every quaternion.

    Attributes:
        skill: Skill whose last column is the phase.
        mixture: Its states as functions of the phase.
        recorded_layout: Columns of the recordings and of their frames, derivatives included.
        damping: Diagonal of B; zero for columns that the operator does not move.
        stiffness: Diagonal of K [1/s].
        max_rate: Largest phase rate [1/s].
        min_speed: Length of the Jacobian in the metric of B that counts as vanishing.
        look_ahead: Range of phase in which the guard looks for a way forward; 0 turns the guard off.
        switches: Columns that switch, such as the grip.
    """

    skill: Skill
    mixture: PhaseMixture
    recorded_layout: Layout
    damping: Float[Array, " E"]
    stiffness: Float[Array, " E"]
    max_rate: float
    min_speed: float
    look_ahead: float = LOOK_AHEAD
    switches: tuple[PhaseSwitch, ...] = ()

    @property
    def layout(self) -> Layout:
        """Columns of the pose."""
        return self.mixture.layout


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class FixtureState:
    """State of the cart.

    Attributes:
        phase: Phase s.
        rate: Phase rate over the last step [1/s].
        mean: Pose at the phase on the path in the observed frames.
        grip_phase: Phase at which switching columns are evaluated.
        turning_phase: Farthest phase in the present direction.
        forward: Whether the cart goes forward.
        reversals: How often it went back by more than 0.01.
    """

    phase: float
    rate: float
    mean: Float[Array, " D"]
    grip_phase: float
    turning_phase: float
    forward: bool = True
    reversals: int = 0


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class FixtureTarget:
    """Desired pose of the robot.

    Attributes:
        mean: Pose, with unit quaternions.
        covariance: Covariance of the deviations of the demonstrations from it.
        velocity: Its rate along the path, as a deviation per second; frames are taken as fixed.
    """

    mean: Float[Array, " D"]
    covariance: Float[Array, "E E"]
    velocity: Float[Array, " E"]


def virtual_fixture(
    skill: Skill,
    duration: float,
    *,
    recorded_layout: Layout | None = None,
    switches: Sequence[PhaseSwitch] = (),
) -> VirtualFixture:
    """Create a virtual fixture from a skill that has the phase as its last column.

    Args:
        skill: Skill of any dynamics and covariance structure, of a batch or of a stream.
        duration: Duration of a demonstration [s].
        recorded_layout: Columns of the frames, with derivatives; None if there are none.
        switches: Columns that switch; all others are regressed.

    Raises:
        InvalidInput: If the skill has no phase, has derivatives, or its frames transform the phase.
        NotPositiveDefinite: If the covariance of a state is singular.
    """
    require_type(skill, "skill", Skill, "a fit holds one: fit.skill")
    seconds = require_number(duration, "duration", 1e-6, MAX_DURATION)
    last = skill.layout.parts[-1]
    if (last.name, last.size) != (PHASE, 1) or len(skill.layout.parts) < 2:
        raise InvalidInput(
            f"the last part of the skill is {last.name!r}, expected {PHASE!r}: the skill was learned without "
            "one; use learn_virtual_fixture, or stream recordings to which add_phase was applied"
        )
    if derived := [part.name for part in skill.layout.parts if part.derivative]:
        raise InvalidInput(f"the skill has a derivative of {derived[0]!r}, expected none; learn without it")
    mixture = condition_on_phase(skill)
    recorded = mixture.layout if recorded_layout is None else recorded_layout
    _require_coordinates(recorded, mixture.layout)
    validate_switches(switches, mixture.layout)
    means = skill.means[0][np.argsort(skill.means[0][:, -1]), :-1]
    for columns in mixture.layout.unit_quaternions:
        means[:, columns] = normalise(means[:, columns])
    scales = part_scales(means, np.ones(len(means)), sphere_layout(mixture.layout), seconds)
    damping = np.where(_moves(mixture.layout, switches), scales**-2, 0.0)
    steps = log_map(means[:-1], means[1:], _quaternion_starts(mixture.layout)) * np.sqrt(damping)
    return VirtualFixture(
        skill,
        mixture,
        recorded,
        damping,
        STIFFNESS * damping,
        MAX_RATE / seconds,
        VANISHING * max(float(np.linalg.norm(steps, axis=1).sum()), 1.0),
        switches=tuple(switches),
    )


def start_fixture(
    fixture: VirtualFixture, frames: Sequence[Frame | MovingFrame], phase: float = 0.0
) -> FixtureState:
    """Return the state of a cart that stands on the path.

    Args:
        fixture: Virtual fixture.
        frames: Frames that the operator sees.
        phase: Phase at which the cart begins, such as that of `nearest_phase`.

    Raises:
        InvalidInput: If frames or phase do not fit.
    """
    _require_fixture(fixture)
    s = require_number(phase, "phase", 0.0, 1.0)
    mean = _guide(fixture, frames, np.array([s])).means[0]
    return FixtureState(s, 0.0, mean, s, s)


def nearest_phase(
    fixture: VirtualFixture, pose: Float[Array, " D"], frames: Sequence[Frame | MovingFrame]
) -> float:
    """Return the phase at which the path is nearest to a pose; the first of equals.

    Args:
        fixture: Virtual fixture.
        pose: Pose, in the columns of `fixture.layout`.
        frames: Frames that the operator sees.

    Raises:
        InvalidInput: If the pose or the frames do not fit.
    """
    _require_fixture(fixture)
    s = np.linspace(0.0, 1.0, 10 * LOOK_AHEAD_POINTS + 1)
    x = validate_pose(fixture.layout, pose)
    e = log_map(_guide(fixture, frames, s).means, x, _quaternion_starts(fixture.layout))
    return float(s[np.argmin(e**2 @ fixture.damping)])


def step_fixture(
    fixture: VirtualFixture,
    state: FixtureState,
    pose: Float[Array, " D"],
    velocity: Float[Array, " E"],
    frames: Sequence[Frame | MovingFrame],
    dt: float,
    *,
    observed_frames: Sequence[Frame | MovingFrame] | None = None,
) -> tuple[FixtureState, FixtureTarget]:
    """Move the cart by one step and return the target of the robot.

    Args:
        fixture: Virtual fixture.
        state: State after the last step.
        pose: Pose of the operator, in the columns of `fixture.layout`; switching columns are not used.
        velocity: Its rate, with the angular velocity in body axes [rad/s] for every quaternion.
        frames: Actual frames.
        dt: Time since the last step [s].
        observed_frames: Frames that the operator saw when he commanded the pose; None if he sees the
            actual ones.

    Returns:
        The next state and the target.

    Raises:
        InvalidInput: If pose, velocity, frames or dt do not fit. The state remains valid: go on with it.

    Source:
        Tanwani 2018, equation 6.12; Raiola et al. 2015. The frames' product, the velocity of the path, the
        observed frames and the guard are ours.
    """
    _require_fixture(fixture)
    _require_state(state, fixture.layout)
    x, v = validate_pose(fixture.layout, pose), finite_array(velocity, "velocity")
    if v.shape != fixture.damping.shape:
        raise InvalidInput(
            f"velocity has shape {v.shape}, expected {fixture.damping.shape}; see Layout.tangent"
        )
    seconds = require_period(dt, "dt")
    observed = frames if observed_frames is None else observed_frames
    rate = _phase_rate(fixture, state, (x, v), observed, seconds)
    s = min(1.0, max(0.0, state.phase + float(np.clip(rate, -fixture.max_rate, fixture.max_rate)) * seconds))
    guide = _guide(fixture, observed, np.array([s]))
    actual = guide if observed_frames is None else _guide(fixture, frames, np.array([s]))
    return _next_state(fixture, state, s, guide.means[0], seconds), _target(
        fixture, state, s, actual, seconds
    )


def _phase_rate(
    fixture: VirtualFixture,
    state: FixtureState,
    operator: tuple[Float[Array, " D"], Float[Array, " E"]],
    frames: Sequence[Frame | MovingFrame],
    dt: float,
) -> float:
    """Return the phase rate of (6.12), or that of the guard."""
    starts, (x, v) = _quaternion_starts(fixture.layout), operator
    guide = _guide(fixture, frames, np.array([state.phase]))
    e = log_map(guide.means[0], x, starts)
    by_operator, by_cart = log_map_jacobian(e, starts), log_map_jacobian(-e, starts)
    drift = log_map(state.mean, guide.means[0], starts) / dt
    J, relative = by_cart @ guide.jacobians[0], by_operator @ v - by_cart @ drift
    pull = fixture.stiffness * e + fixture.damping * relative
    squared_speed, distance = float(J @ (fixture.damping * J)), float(e**2 @ fixture.damping)
    tolerance = fixture.min_speed**2
    rate = float(J @ pull) / (squared_speed + tolerance)
    if fixture.look_ahead == 0.0:
        return rate
    if rate < 0.0 and state.forward and distance < TREMOR**2 * tolerance:
        return 0.0
    goes_back = rate < 0.0 and (state.forward or state.phase + rate * dt < state.turning_phase)
    if not (goes_back or squared_speed < tolerance or distance > tolerance):
        return rate
    nearer_than = distance + tolerance if goes_back else distance
    ahead = _phase_ahead(fixture, state.phase, nearer_than, (x, relative), frames)
    return rate if ahead is None else max(rate, (ahead - state.phase) / dt)


def _phase_ahead(
    fixture: VirtualFixture,
    s: float,
    nearer_than: float,
    operator: tuple[Float[Array, " D"], Float[Array, " E"]],
    frames: Sequence[Frame | MovingFrame],
) -> float | None:
    """Return the nearest phase ahead that moves with the operator; None if it is too far from him."""
    ahead = s + fixture.look_ahead * np.arange(1, LOOK_AHEAD_POINTS + 1) / LOOK_AHEAD_POINTS
    ahead = ahead[ahead <= 1.0]
    if not len(ahead):
        return None
    guide = _guide(fixture, frames, ahead)
    x, v = operator
    e = log_map(guide.means, x, _quaternion_starts(fixture.layout))
    distances = np.where(guide.jacobians @ (fixture.damping * v) >= 0.0, e**2 @ fixture.damping, np.inf)
    best = int(distances.argmin())
    return float(ahead[best]) if distances[best] < nearer_than else None


def _next_state(
    fixture: VirtualFixture, state: FixtureState, s: float, mean: Float[Array, " D"], dt: float
) -> FixtureState:
    """Return the state at a phase, with reversals counted."""
    forward, reversals = state.forward, state.reversals
    turning = max(state.turning_phase, s) if forward else min(state.turning_phase, s)
    if abs(s - turning) > REVERSAL:
        forward, turning, reversals = not forward, s, reversals + forward
    grip_phase = min(max(state.grip_phase, s), s + GRIP_BACKLASH)
    return FixtureState(s, (s - state.phase) / dt, mean, grip_phase, turning, forward, reversals)


def _target(fixture: VirtualFixture, state: FixtureState, s: float, guide: Guide, dt: float) -> FixtureTarget:
    """Return the target on the path, with the grip of its phase."""
    mean = guide.means[0].copy()
    grip_phase = min(max(state.grip_phase, s), s + GRIP_BACKLASH)
    for switch in fixture.switches:
        mean[switch.column] = switch.value_at(grip_phase)
    for columns in fixture.layout.unit_quaternions:
        if mean[columns] @ state.mean[columns] < 0.0:
            mean[columns] *= -1.0
    return FixtureTarget(mean, guide.covariances[0], guide.jacobians[0] * (s - state.phase) / dt)


def _guide(fixture: VirtualFixture, frames: Sequence[Frame | MovingFrame], s: Float[Array, " N"]) -> Guide:
    names = fixture.skill.frame_names
    matched = match_frames(frames, names, fixture.layout, fixture.recorded_layout)
    return regress_on_phase(fixture.mixture, matched, s)


def _require_coordinates(recorded: Layout, layout: Layout) -> None:
    require_type(recorded, "recorded_layout", Layout, "give the layout of a demonstration")
    if coordinate_layout(recorded) != layout:
        raise InvalidInput(
            f"recorded_layout has the columns {short_list(coordinate_layout(recorded).names)} without its "
            f"derivatives, expected those of the skill: {short_list(layout.names)}"
        )


def _require_fixture(fixture: VirtualFixture) -> None:
    require_type(fixture, "fixture", VirtualFixture, "create one with learn_virtual_fixture")


def _require_state(state: FixtureState, layout: Layout) -> None:
    require_type(state, "state", FixtureState, "begin with start_fixture")
    if state.mean.shape != (layout.width,):
        raise InvalidInput(
            f"state has a pose of {len(state.mean)} columns, expected {layout.width}: it belongs to another "
            "fixture; begin with start_fixture"
        )


def _quaternion_starts(layout: Layout) -> tuple[int, ...]:
    return tuple(columns.start for columns in layout.unit_quaternions)


def _moves(layout: Layout, switches: Sequence[PhaseSwitch]) -> Array:
    """Return which deviations the operator drives: positions and orientations, unless they switch."""
    switching = {switch.column for switch in switches}
    return np.array(
        [
            part.quantity is not Quantity.SCALAR or columns.start not in switching
            for part, columns, deviations in zip(
                layout.parts, layout.slices, sphere_layout(layout).tangent.slices, strict=True
            )
            for _ in range(deviations.stop - deviations.start)
        ]
    )
