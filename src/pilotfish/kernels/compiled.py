"""Compiled kernels, for the newest instruction set of this processor.

kernels.reference defines what they compute. Importing this module raises ImportError if they were not built.
"""

from collections.abc import Callable
from functools import wraps
from importlib import import_module
from typing import Any, ParamSpec, TypeVar

import numpy as np

from pilotfish.kernels import assistance_validation, stream_validation, validation
from pilotfish.kernels.arguments import Emissions, SemiMarkovTables
from pilotfish.kernels.arm_types import ArmCommand, ArmLimits, ArmState, ImpedanceParameters, ToolTarget
from pilotfish.kernels.assistance_types import (
    AssistanceInput,
    AssistanceMemory,
    AssistanceSettings,
    AssistanceStep,
    CarriedModel,
)
from pilotfish.kernels.errors import (
    control_cost_error,
    covariance_error,
    datapoint_error,
    singular_transform_error,
    transform_row_error,
)
from pilotfish.kernels.hand_map import HandMap
from pilotfish.kernels.occupancy import OccupancyTables, StateFilter
from pilotfish.kernels.reference.markov import log_probability_array
from pilotfish.kernels.results import (
    EStep,
    ForwardBackward,
    RiccatiSolution,
    RiemannianProduct,
    SemiMarkovForward,
    SemiMarkovForwardBackward,
    ViterbiPath,
)
from pilotfish.kernels.stream_state import Assignments, StreamParameters, StreamState
from pilotfish.types import Array, Float, Int

_baseline: Any = import_module("pilotfish.kernels._baseline")
INSTRUCTION_SET: str = "x86-64-v3" if _baseline.supports_v3() else "baseline"
_native: Any = import_module("pilotfish.kernels._v3") if INSTRUCTION_SET == "x86-64-v3" else _baseline

if missing_kernels := sorted(set(validation.KERNELS) - set(dir(_native))):
    raise ImportError(f"they were built from older sources and lack {', '.join(missing_kernels)}")


Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


def _validate_on_failure(kernel: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
    """Return the kernel, which validates and packs its arguments only if the native function rejects them.

    The native functions accept only packed arrays of matching shapes and valid numbers. To validate in Python
    at every call would take as long as a small problem does.
    """
    pack = validation.KERNELS[kernel.__name__]

    @wraps(kernel)
    def run(*arguments: Arguments.args, **keywords: Arguments.kwargs) -> Result:
        try:
            return kernel(*arguments, **keywords)
        except (TypeError, ValueError, OverflowError, IndexError):
            packed = pack(*arguments, **keywords)
        return kernel(*packed)  # type: ignore[call-arg]  # pack returns all arguments

    return run


def _emission_arrays(
    emissions: Emissions,
) -> tuple[Float[Array, "P K D"], Float[Array, "P K E E"], Int[Array, " Q"]]:
    return (
        emissions.means,
        emissions.precision_cholesky,
        np.array(emissions.orientation_starts, dtype=np.int64),
    )


def _table_arrays(
    tables: SemiMarkovTables,
) -> tuple[Float[Array, " K"], Float[Array, "K K"], Float[Array, "4 S K"], Float[Array, "2 K"]]:
    log_initial, log_transitions = (
        log_probability_array(tables.initial),
        log_probability_array(tables.transitions),
    )
    return log_initial, log_transitions, tables.log_segment_weights, tables.log_tail_weights


@_validate_on_failure
def log_emissions(x: Float[Array, "P N D"], emissions: Emissions) -> Float[Array, "N K"]:
    log_densities: Float[Array, "N K"] = _native.log_emissions(x, *_emission_arrays(emissions))
    return log_densities


@_validate_on_failure
def e_step(
    x: Float[Array, "P N D"],
    lengths: Int[Array, " M"],
    initial: Float[Array, " K"],
    transitions: Float[Array, "K K"],
    emissions: Emissions,
    threads: int = 1,
    final: Float[Array, " K"] | None = None,
) -> EStep:
    logarithms = log_probability_array(initial), transitions, log_probability_array(transitions)
    log_final = np.zeros(len(initial)) if final is None else log_probability_array(final)
    sums = _native.e_step(x, lengths, *logarithms, *_emission_arrays(emissions), threads, log_final)
    no_segments, no_tails = np.zeros((4, 0, len(initial))), np.zeros((2, len(initial)))
    return EStep(*(*sums[:4], no_segments, no_tails, *sums[4:]))


@_validate_on_failure
def semi_markov_e_step(
    x: Float[Array, "P N D"],
    lengths: Int[Array, " M"],
    tables: SemiMarkovTables,
    emissions: Emissions,
    threads: int = 1,
) -> EStep:
    sums = _native.semi_markov_e_step(
        x, lengths, *_table_arrays(tables), *_emission_arrays(emissions), threads
    )
    return EStep(*sums)


@_validate_on_failure
def forward_backward(
    log_emissions: Float[Array, "T K"], initial: Float[Array, " K"], transitions: Float[Array, "K K"]
) -> ForwardBackward:
    logarithms = log_probability_array(initial), transitions, log_probability_array(transitions)
    return ForwardBackward(*_native.forward_backward(log_emissions, *logarithms))


def impedance_torque(
    parameters: ImpedanceParameters, limits: ArmLimits, state: ArmState, target: ToolTarget
) -> ArmCommand:
    try:  # without the decorator: a control loop calls this every millisecond
        return _impedance_torque(parameters, limits, state, target)
    except (TypeError, ValueError):
        return _impedance_torque(*validation.pack_arm(parameters, limits, state, target))


def _impedance_torque(
    parameters: ImpedanceParameters, limits: ArmLimits, state: ArmState, target: ToolTarget
) -> ArmCommand:
    torque, wrench, torque_fraction = _native.impedance_torque(
        parameters.stiffness,
        parameters.damping,
        parameters.posture,
        parameters.posture_stiffness,
        parameters.joint_damping,
        parameters.force_limit,
        parameters.moment_limit,
        parameters.min_singular_value,
        parameters.limit_margin,
        parameters.limit_stiffness,
        limits.lower,
        limits.upper,
        limits.torque,
        state.q,
        state.velocity,
        state.position,
        state.quaternion,
        state.jacobian,
        state.bias,
        target.position,
        target.quaternion,
        target.twist,
    )
    return ArmCommand(torque, wrench, torque_fraction)


NO_POSE, NO_COVARIANCE = np.empty(0), np.empty((0, 0))


def assistance_step(
    hand_map: HandMap,
    model: CarriedModel,
    tables: OccupancyTables,
    settings: AssistanceSettings,
    memory: AssistanceMemory,
    given: AssistanceInput,
) -> AssistanceStep:
    try:  # without the decorator: a control loop calls this every few milliseconds
        found = _native.assistance_step(
            *_model_arrays(hand_map, model, tables, settings), *_step_values(memory, given)
        )
    except (TypeError, ValueError):
        hand_map, model, tables, settings, memory, given = assistance_validation.pack_assistance(
            hand_map, model, tables, settings, memory, given
        )
        found = _native.assistance_step(
            *_model_arrays(hand_map, model, tables, settings), *_step_values(memory, given)
        )
    return _assistance_result(model, memory, found)


def _assistance_result(
    model: CarriedModel, memory: AssistanceMemory, found: tuple[Any, ...]
) -> AssistanceStep:
    """Return the result of the native step, whose arrays are slices of one."""
    belief, numbers, elapsed, authority, blend_time, blend_duration, is_following, has_left = found
    K, D, E = *model.observed_means.shape, len(memory.offset)
    command, offset, pose, velocity = 2 * K, 2 * K + D, 2 * K + D + E, 2 * K + 2 * D + E
    desired, held = velocity + E, velocity + E + D
    probabilities, covariance = len(numbers) - E * E - K, len(numbers) - E * E
    if belief is None:
        belief = memory.filter.belief
    after = AssistanceMemory(
        StateFilter(belief, numbers[:K], numbers[K:command], elapsed),
        numbers[command:offset],
        numbers[offset:pose],
        numbers[pose:velocity],
        numbers[velocity:desired],
        numbers[desired:held],
        numbers[held:probabilities],
        memory.held_commands,
        authority,
        blend_time,
        blend_duration,
        is_following,
        has_left,
    )
    return AssistanceStep(after, numbers[covariance:].reshape(E, E), numbers[probabilities:covariance])


def _model_arrays(
    hand_map: HandMap, model: CarriedModel, tables: OccupancyTables, settings: AssistanceSettings
) -> tuple[Array | float, ...]:
    return (
        *(hand_map.matrix, hand_map.shift, hand_map.left, hand_map.right),
        *(model.observed_means, model.whitening, model.actual_means),
        *(model.offsets, model.gains, model.fused_covariances),
        *(tables.transitions, tables.hazards, tables.reset),
        *(settings.variances, settings.lower, settings.upper, settings.full, settings.none),
        *(settings.speed, settings.acceleration),
        *(settings.angular_speed, settings.angular_acceleration, settings.period),
    )


def _step_values(memory: AssistanceMemory, given: AssistanceInput) -> tuple[Any, ...]:
    before = memory.filter
    return (
        *(before.belief, before.before, before.now, before.elapsed),
        *(memory.command, memory.offset, memory.pose, memory.velocity, memory.desired),
        *(memory.held_values, memory.held_commands),
        *(memory.authority, memory.blend_time, memory.blend_duration),
        *(memory.is_following, memory.has_left),
        given.hand,
        NO_POSE if given.given_pose is None else given.given_pose,
        NO_COVARIANCE if given.given_covariance is None else given.given_covariance,
        *(given.dt, given.mode, given.is_closed, given.is_current, given.has_changed),
    )


@_validate_on_failure
def viterbi(
    log_emissions: Float[Array, "T K"], initial: Float[Array, " K"], transitions: Float[Array, "K K"]
) -> ViterbiPath:
    states, log_probability = _native.viterbi(
        log_emissions, log_probability_array(initial), log_probability_array(transitions)
    )
    return states.view(np.int64), log_probability  # int64 under NumPy's own type


@_validate_on_failure
def semi_markov_forward_backward(
    log_emissions: Float[Array, "T K"], tables: SemiMarkovTables
) -> SemiMarkovForwardBackward:
    return SemiMarkovForwardBackward(
        *_native.semi_markov_forward_backward(log_emissions, *_table_arrays(tables))
    )


@_validate_on_failure
def semi_markov_forward(log_emissions: Float[Array, "T K"], tables: SemiMarkovTables) -> SemiMarkovForward:
    log_segment_ends, log_forward = _native.semi_markov_forward(log_emissions, *_table_arrays(tables))
    return log_segment_ends, log_forward


@_validate_on_failure
def semi_markov_viterbi(log_emissions: Float[Array, "T K"], tables: SemiMarkovTables) -> ViterbiPath:
    states, log_probability = _native.semi_markov_viterbi(log_emissions, *_table_arrays(tables))
    return states.view(np.int64), log_probability


def observe(
    x: Float[Array, "N P D"], state: StreamState, parameters: StreamParameters
) -> tuple[StreamState, Assignments]:
    try:
        found = _native.observe(
            x, state.counters, state.rows, state.transition_counts, state.capacity, parameters.packed
        )
    except (TypeError, ValueError):  # checked and packed only here: a datapoint takes a few microseconds
        x, state = stream_validation.pack_stream(x, "NPD", state, parameters)
        found = _native.observe(
            x, state.counters, state.rows, state.transition_counts, state.capacity, parameters.packed
        )
    failed_index, counters, rows, transition_counts, capacity, cluster_ids, costs, loss_changes, removed = (
        found
    )
    if failed_index >= 0:
        raise datapoint_error(x, failed_index)
    after = StreamState(counters, rows, transition_counts, state.frames, state.width, capacity)
    return after, Assignments(cluster_ids.view(np.int64), costs, loss_changes, removed.view(np.int64))


def observe_one(
    x: Float[Array, "P D"], state: StreamState, parameters: StreamParameters
) -> tuple[StreamState, int, float, float]:
    try:
        found = _native.observe_one(
            x, state.counters, state.rows, state.transition_counts, state.capacity, parameters.packed
        )
    except (TypeError, ValueError):
        x, state = stream_validation.pack_stream(x, "PD", state, parameters)
        found = _native.observe_one(
            x, state.counters, state.rows, state.transition_counts, state.capacity, parameters.packed
        )
    failed_index, counters, rows, transition_counts, capacity, cluster_id, cost, loss_change = found
    if failed_index >= 0:
        raise datapoint_error(x[None], failed_index)
    after = StreamState(counters, rows, transition_counts, state.frames, state.width, capacity)
    return after, cluster_id, cost, loss_change


@_validate_on_failure
def riccati(
    A: Float[Array, "S n n"],
    B: Float[Array, "S n m"],
    weights: Float[Array, "T n n"],
    targets: Float[Array, "T n"],
    control_cost: Float[Array, "m m"],
) -> RiccatiSolution:
    failed_index, gains, feedforwards, P, d = _native.riccati(A, B, weights, targets, control_cost)
    if failed_index >= 0:
        raise control_cost_error(failed_index)
    return gains, feedforwards, P, d


@_validate_on_failure
def riemannian_product(emissions: Emissions, covariances: Float[Array, "P K E E"]) -> RiemannianProduct:
    means, precision_cholesky, orientation_starts = _emission_arrays(emissions)
    return RiemannianProduct(
        *_native.riemannian_product(means, covariances, precision_cholesky, orientation_starts)
    )


def semi_tied_sweeps(
    scatter_matrices: Float[Array, "K D D"],
    counts: Float[Array, " K"],
    transform: Float[Array, "D D"],
    sweeps: int,
) -> Float[Array, "D D"]:
    scatter_matrices, counts, transform, sweeps = validation.pack_semi_tied(
        scatter_matrices, counts, transform, sweeps
    )
    present = counts > 0.0
    result: Float[Array, "D D"]
    failed_index, result = _native.semi_tied_sweeps(
        scatter_matrices[present], counts[present], transform, sweeps
    )
    if failed_index == len(transform):
        raise singular_transform_error()
    if failed_index >= 0:
        raise transform_row_error(failed_index)
    return result


@_validate_on_failure
def precision_cholesky(covariances: Float[Array, "K D D"]) -> Float[Array, "K D D"]:
    inverses: Float[Array, "K D D"]
    failed_index, inverses = _native.precision_cholesky(covariances)
    if failed_index >= 0:
        raise covariance_error(failed_index)
    return inverses
