"""One step of direct, carried shared and autonomous control, from the operator's hand to the target."""

import numpy as np

from pilotfish.kernels.assistance_types import (
    AUTONOMOUS,
    SHARED,
    AssistanceInput,
    AssistanceMemory,
    AssistanceSettings,
    AssistanceStep,
    CarriedModel,
)
from pilotfish.kernels.hand_map import HandMap, is_valid_hand, map_hand
from pilotfish.kernels.occupancy import OccupancyTables, advance_filter
from pilotfish.kernels.reference.manifold import deviations
from pilotfish.kernels.reference.target_motion import (
    blend,
    blend_duration,
    deviation,
    displaced,
    follow_desired,
)
from pilotfish.types import Array, Float

MAX_RATE = 2.0  # of authority, per second
SCALAR_TOLERANCE = 0.1  # unit of the scalar: a smaller difference is agreement, a larger change a command


def assistance_step(
    hand_map: HandMap,
    model: CarriedModel,
    tables: OccupancyTables,
    settings: AssistanceSettings,
    memory: AssistanceMemory,
    given: AssistanceInput,
) -> AssistanceStep:
    """Return the next memory, the covariance of the desired pose and the probability of each state.

    The desired pose y is

        direct       the command x
        shared       x moved towards the corrected command by the authority
        autonomous   the pose of the plan

    and the target follows it after a blend, within its limits (`target_motion`). A bad hand holds the command
    and the filter. Scalars hold after a change until what they follow, hand or plan, changes or agrees.

    Args:
        hand_map: Map from the hand to the command.
        model: The skill in the scene observed and in the actual one.
        tables: Filter of its states.
        settings: Authority, limits and period.
        memory: Memory of the step before.
        given: Hand, mode and time.

    Source:
        Tanwani 2018, section 6.3, with the corrections of docs/assistance.md.
    """
    is_oriented = memory.command.shape != memory.offset.shape
    is_following = given.is_closed and is_valid_hand(given.hand, is_oriented)
    x = map_hand(hand_map, given.hand, is_oriented) if is_following else memory.command
    now = memory.filter
    if is_following and given.mode != AUTONOMOUS:
        now = advance_filter(tables, now, command_log_likelihoods(model, x), settings.period, given.dt)
    probabilities = now.probabilities(settings.period, given.dt)
    authority, has_left = _advance_authority(model, settings, memory, x, given)
    y, covariance, held = _desired(model, settings, memory, (x, probabilities, authority), given)
    offset, time, duration = memory.offset, memory.blend_time + given.dt, memory.blend_duration
    desired = memory.desired
    if given.has_changed or is_following != memory.is_following:
        desired = memory.pose  # from which the blend begins, however far the target was behind
        offset = deviation(y, memory.pose, is_oriented)
        offset[offset.size - held.size :] = 0.0
        time, duration = 0.0, blend_duration(offset)
    pose, velocity, desired = follow_desired(
        settings,
        (memory.pose, memory.velocity, desired),
        blend(y, offset, time, duration, is_oriented),
        given.dt,
    )
    after = AssistanceMemory(
        *(now, x, offset, pose, velocity, desired, held, memory.held_commands),
        *(authority, time, duration, is_following, has_left),
    )
    return AssistanceStep(after, covariance, probabilities)


def whitened_deviations(model: CarriedModel, x: Float[Array, " D"]) -> Float[Array, "K E"]:
    """Return the deviation of a command from each state of the scene observed, whitened.

    Args:
        model: The skill in the scene observed and in the actual one.
        x: Command.
    """
    return np.asarray(np.einsum("kij,kj->ki", np.tril(model.whitening), _deviations_observed(model, x)))


def command_log_likelihoods(model: CarriedModel, x: Float[Array, " D"]) -> Float[Array, " K"]:
    """Return the log-density of a command in each state, up to a common constant.

    Args:
        model: The skill in the scene observed and in the actual one.
        x: Command.
    """
    log_scales = np.log(np.diagonal(model.whitening, axis1=1, axis2=2)).sum(axis=1)
    return np.asarray(log_scales - 0.5 * np.sum(whitened_deviations(model, x) ** 2, axis=1))


def coverage_distance(model: CarriedModel, x: Float[Array, " D"], scalars: int) -> float:
    """Return the distance of a command from what the demonstrations covered: position or orientation.

    Args:
        model: The skill in the scene observed and in the actual one.
        x: Command.
        scalars: Number of scalar columns, which do not count.
    """
    is_oriented, width = x.size != model.offsets.shape[1], model.offsets.shape[1] - scalars
    squares = whitened_deviations(model, x)[:, :width] ** 2
    parts = np.split(squares, [width - 3], axis=1) if is_oriented else [squares]
    return float(np.sqrt(np.max([part.mean(axis=1) for part in parts], axis=0).min()))


def gate_authority(full: float, none: float, distance: float) -> float:
    """Return the authority at a distance; it never increases with the distance.

    Args:
        full: Largest distance with full authority.
        none: Smallest distance without authority.
        distance: Distance from `coverage_distance`; not a number counts as infinite.
    """
    if not distance < none:
        return 0.0
    s = min((none - distance) / (none - full), 1.0)
    return s * s * (3.0 - 2.0 * s)


def limit_authority(before: float, gate: float, dt: float) -> float:
    """Return the authority after a step: towards the gate, by at most two per second.

    Args:
        before: Authority before the step.
        gate: Authority of the gate.
        dt: Time of the step [s].
    """
    return before + min(max(gate - before, -MAX_RATE * dt), MAX_RATE * dt)


def correct_command(
    model: CarriedModel, x: Float[Array, " D"], probabilities: Float[Array, " K"]
) -> tuple[Float[Array, " D"], Float[Array, "E E"]]:
    """Return the mean and covariance of the carried and fused command.

    Args:
        model: The skill in the scene observed and in the actual one.
        x: Command.
        probabilities: Probability of each state.
    """
    is_oriented = x.size != model.offsets.shape[1]
    steps = model.offsets + np.einsum("kij,kj->ki", model.gains, _deviations_observed(model, x))
    corrected = np.array(
        [displaced(mean, v, is_oriented) for mean, v in zip(model.actual_means, steps, strict=True)]
    )
    mean, between = mix_points(corrected, probabilities, is_oriented)
    return mean, np.einsum("k,kij->ij", probabilities, model.fused_covariances) + between


def mix_points(
    points: Float[Array, "K D"], probabilities: Float[Array, " K"], is_oriented: bool
) -> tuple[Float[Array, " D"], Float[Array, "E E"]]:
    """Return the weighted mean of points and the covariance between them.

    The mean is that of the tangent space at the most probable point, after one more step; it is exact on R^n.

    Args:
        points: Points.
        probabilities: Weights, which sum to one.
        is_oriented: Whether a quaternion follows the position.
    """
    mean, starts = points[probabilities.argmax()], (3,) if is_oriented else ()
    for _ in range(2 if is_oriented else 1):
        mean = displaced(mean, probabilities @ deviations(points, mean, starts), is_oriented)
    v = deviations(points, mean, starts)
    return mean, np.asarray((probabilities[:, None] * v).T @ v)


def follow_scalars(
    values: Float[Array, " S"], commands: Float[Array, " S"], now: Float[Array, " S"]
) -> tuple[Float[Array, " S"], Float[Array, " S"]]:
    """Return the scalars that still hold, and those of the target.

    Args:
        values: Value of each scalar that holds; NaN for one that follows.
        commands: Scalars of the hand or the plan at the last change.
        now: Scalars of the hand or the plan.
    """
    released = (np.abs(now - values) <= SCALAR_TOLERANCE) | (np.abs(now - commands) > SCALAR_TOLERANCE)
    held = np.where(released, np.nan, values)
    return held, np.where(np.isnan(held), now, held)


def _deviations_observed(model: CarriedModel, x: Float[Array, " D"]) -> Float[Array, "K E"]:
    """Return log_mean(x) for the mean of each state in the scene observed: the negative of log_x(mean)."""
    return -deviations(model.observed_means, x, () if x.size == model.offsets.shape[1] else (3,))


def _advance_authority(
    model: CarriedModel,
    settings: AssistanceSettings,
    memory: AssistanceMemory,
    x: Float[Array, " D"],
    given: AssistanceInput,
) -> tuple[float, bool]:
    """Return the authority after the step, and whether the operator has left what the skill covers.

    Then it stays at zero down to the distance `full`, or until mode or skill change.
    """
    is_gated, before = given.mode == SHARED and given.is_current, memory.authority
    scalars = x.size - (7 if x.size != settings.variances.size else 3)
    distance = coverage_distance(model, x, scalars)
    has_left = memory.has_left and not given.has_changed and not (is_gated and distance <= settings.full)
    allowed = 0.0
    if is_gated and not has_left:
        allowed = gate_authority(settings.full, settings.none, distance)
    authority = limit_authority(before, allowed, given.dt)
    leaves = is_gated and not given.has_changed and before > 0.0 and authority <= 0.0
    return authority, has_left or leaves


def _desired(
    model: CarriedModel,
    settings: AssistanceSettings,
    memory: AssistanceMemory,
    recognised: tuple[Float[Array, " D"], Float[Array, " K"], float],
    given: AssistanceInput,
) -> tuple[Float[Array, " D"], Float[Array, "E E"], Float[Array, " S"]]:
    """Return the desired pose of the mode, its covariance and the scalars that still hold."""
    (x, probabilities, authority), held = recognised, memory.held_values
    elsewhere = None
    if given.given_pose is not None and given.given_covariance is not None:
        elsewhere = given.given_pose, given.given_covariance
    source, y, covariance = x, x.copy(), np.diag(settings.variances)
    if given.mode == AUTONOMOUS:
        assert elsewhere is not None
        source, covariance = elsewhere
        y = source.copy()
    elif given.mode == SHARED:
        corrected, spread = elsewhere or correct_command(model, x, probabilities)
        is_oriented = x.size != settings.variances.size
        y = displaced(x, authority * deviation(x, corrected, is_oriented), is_oriented)
        covariance = authority * spread + (1.0 - authority) * covariance
    columns = slice(x.size - held.size, None)
    held, y[columns] = follow_scalars(held, memory.held_commands, source[columns])
    return y, covariance, held
