"""The compiled kernels, for the newest instruction set that this processor has. Twins say what they compute.

Importing this module raises ImportError where they could not be built.
"""

from collections.abc import Callable, Iterable
from functools import wraps
from importlib import import_module
from typing import Any, ParamSpec, TypeVar

import numpy as np

from pilotfish.kernels import validation
from pilotfish.kernels.arguments import Emissions, SemiMarkovTables
from pilotfish.kernels.arm_types import ArmCommand, ArmLimits, ArmState, ImpedanceParameters, ToolTarget
from pilotfish.kernels.errors import (
    control_cost_error,
    covariance_error,
    datapoint_error,
    singular_transform_error,
    transform_row_error,
)
from pilotfish.kernels.reference.markov import log_probability_array
from pilotfish.kernels.results import (
    EStep,
    ForwardBackward,
    RiccatiSolution,
    SemiMarkovEStep,
    SemiMarkovForward,
    SemiMarkovForwardBackward,
    ViterbiPath,
)
from pilotfish.kernels.stream_state import StreamParameters, StreamState, StreamStep
from pilotfish.types import Array, Float, Int

_baseline: Any = import_module("pilotfish.kernels._baseline")
INSTRUCTION_SET: str = "x86-64-v3" if _baseline.supports_v3() else "baseline"
_native: Any = import_module("pilotfish.kernels._v3") if INSTRUCTION_SET == "x86-64-v3" else _baseline

KERNELS = (
    "e_step",
    "forward_backward",
    "impedance",
    "log_emissions",
    "observe",
    "observe_one",
    "riccati",
    "semi_markov",
    "semi_markov_e_step",
    "semi_markov_forward",
    "semi_markov_viterbi",
    "semi_tied_sweeps",
    "viterbi",
    "precision_cholesky",
)
if missing_kernels := sorted(set(KERNELS) - set(dir(_native))):
    raise ImportError(f"they were built from older sources and lack {', '.join(missing_kernels)}")


Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


def _validate_on_failure(
    check: Callable[..., Iterable[Any]],
) -> Callable[[Callable[Arguments, Result]], Callable[Arguments, Result]]:
    """Return a decorator that runs a kernel again, with the arguments that check returns, where it refuses.

    A kernel itself accepts nothing but packed arrays of the right shapes and numbers; to check them in Python
    each time would take as long as a small problem does.
    """

    def decorate(kernel: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
        @wraps(kernel)
        def run(*arguments: Arguments.args, **keywords: Arguments.kwargs) -> Result:
            try:
                return kernel(*arguments, **keywords)
            except (TypeError, ValueError, OverflowError, IndexError):
                checked = check(*arguments, **keywords)
            return kernel(*checked)  # type: ignore[call-arg]  # check returns them all

        return run

    return decorate


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


@_validate_on_failure(lambda x, emissions: validation.pack_gaussians(x, emissions, {}))
def log_emissions(x: Float[Array, "P N D"], emissions: Emissions) -> Float[Array, "N K"]:
    log_densities: Float[Array, "N K"] = _native.log_emissions(x, *_emission_arrays(emissions))
    return log_densities


@_validate_on_failure(validation.pack_e_step)
def e_step(
    x: Float[Array, "P N D"],
    lengths: Int[Array, " M"],
    initial: Float[Array, " K"],
    transitions: Float[Array, "K K"],
    emissions: Emissions,
    threads: int = 1,
) -> EStep:
    logarithms = log_probability_array(initial), transitions, log_probability_array(transitions)
    return EStep(*_native.e_step(x, lengths, *logarithms, *_emission_arrays(emissions), threads))


@_validate_on_failure(validation.pack_semi_markov_e_step)
def semi_markov_e_step(
    x: Float[Array, "P N D"],
    lengths: Int[Array, " M"],
    tables: SemiMarkovTables,
    emissions: Emissions,
    threads: int = 1,
) -> SemiMarkovEStep:
    sums = _native.semi_markov_e_step(
        x, lengths, *_table_arrays(tables), *_emission_arrays(emissions), threads
    )
    return SemiMarkovEStep(*sums)


@_validate_on_failure(validation.pack_markov)
def forward_backward(
    log_emissions: Float[Array, "T K"], initial: Float[Array, " K"], transitions: Float[Array, "K K"]
) -> ForwardBackward:
    logarithms = log_probability_array(initial), transitions, log_probability_array(transitions)
    return ForwardBackward(*_native.forward_backward(log_emissions, *logarithms))


def impedance(
    impedance: ImpedanceParameters, limits: ArmLimits, state: ArmState, target: ToolTarget
) -> ArmCommand:
    try:
        control_cost = _call_native(impedance, limits, state, target)
    except (
        TypeError,
        ValueError,
    ):  # checked and packed only here: a control loop calls this each millisecond
        control_cost = _call_native(*validation.pack_arm(impedance, limits, state, target))
    return control_cost


def _call_native(
    impedance: ImpedanceParameters, limits: ArmLimits, state: ArmState, target: ToolTarget
) -> ArmCommand:
    torque, wrench, torque_fraction = _native.impedance(
        impedance.stiffness,
        impedance.damping,
        impedance.posture,
        impedance.posture_stiffness,
        impedance.joint_damping,
        impedance.force_limit,
        impedance.moment_limit,
        impedance.min_singular_value,
        impedance.limit_margin,
        impedance.limit_stiffness,
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


@_validate_on_failure(validation.pack_markov)
def viterbi(
    log_emissions: Float[Array, "T K"], initial: Float[Array, " K"], transitions: Float[Array, "K K"]
) -> ViterbiPath:
    states, log_probability = _native.viterbi(
        log_emissions, log_probability_array(initial), log_probability_array(transitions)
    )
    return ViterbiPath(
        states.view(np.int64), log_probability
    )  # the same bits, by the name that NumPy knows them


@_validate_on_failure(validation.pack_semi_markov)
def semi_markov(log_emissions: Float[Array, "T K"], tables: SemiMarkovTables) -> SemiMarkovForwardBackward:
    return SemiMarkovForwardBackward(*_native.semi_markov(log_emissions, *_table_arrays(tables)))


@_validate_on_failure(validation.pack_semi_markov)
def semi_markov_forward(log_emissions: Float[Array, "T K"], tables: SemiMarkovTables) -> SemiMarkovForward:
    return SemiMarkovForward(*_native.semi_markov_forward(log_emissions, *_table_arrays(tables)))


@_validate_on_failure(validation.pack_semi_markov)
def semi_markov_viterbi(log_emissions: Float[Array, "T K"], tables: SemiMarkovTables) -> ViterbiPath:
    states, log_probability = _native.semi_markov_viterbi(log_emissions, *_table_arrays(tables))
    return ViterbiPath(states.view(np.int64), log_probability)


def observe(x: Float[Array, "N P D"], state: StreamState, parameters: StreamParameters) -> StreamStep:
    try:
        found = _native.observe(
            x, state.head, state.clusters, state.transition_counts, state.capacity, parameters.numbers
        )
    except (TypeError, ValueError):  # checked and packed only here: a datapoint takes a few microseconds
        x, state = validation.pack_stream(x, "NPD", state, parameters)
        found = _native.observe(
            x, state.head, state.clusters, state.transition_counts, state.capacity, parameters.numbers
        )
    failed_index, head, clusters, transition_counts, capacity, cluster_ids, costs, loss_changes, removed = (
        found
    )
    if failed_index >= 0:
        raise datapoint_error(x, failed_index)
    now = StreamState(head, clusters, transition_counts, state.frames, state.width, capacity)
    return StreamStep(now, cluster_ids.view(np.int64), costs, loss_changes, removed.view(np.int64))


def observe_one(
    x: Float[Array, "P D"], state: StreamState, parameters: StreamParameters
) -> tuple[StreamState, int, float, float]:
    try:
        found = _native.observe_one(
            x, state.head, state.clusters, state.transition_counts, state.capacity, parameters.numbers
        )
    except (TypeError, ValueError):
        x, state = validation.pack_stream(x, "PD", state, parameters)
        found = _native.observe_one(
            x, state.head, state.clusters, state.transition_counts, state.capacity, parameters.numbers
        )
    failed_index, head, clusters, transition_counts, capacity, cluster_id, cost, loss_change = found
    if failed_index >= 0:
        raise datapoint_error(x[None], failed_index)
    return (
        StreamState(head, clusters, transition_counts, state.frames, state.width, capacity),
        cluster_id,
        cost,
        loss_change,
    )


@_validate_on_failure(validation.pack_riccati)
def riccati(
    A: Float[Array, "S n n"],
    B: Float[Array, "S n m"],
    weights: Float[Array, "T n n"],
    targets: Float[Array, "T n"],
    control_cost: Float[Array, "m m"],
) -> RiccatiSolution:
    failed_index, *solution = _native.riccati(A, B, weights, targets, control_cost)
    if failed_index >= 0:
        raise control_cost_error(failed_index)
    return RiccatiSolution(*solution)


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


@_validate_on_failure(validation.pack_covariances)
def precision_cholesky(covariances: Float[Array, "K D D"]) -> Float[Array, "K D D"]:
    inverses: Float[Array, "K D D"]
    failed_index, inverses = _native.precision_cholesky(covariances)
    if failed_index >= 0:
        raise covariance_error(failed_index)
    return inverses
