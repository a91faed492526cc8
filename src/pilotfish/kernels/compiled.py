"""The compiled kernels, for the newest instruction set that this processor has. Twins say what they compute.

Importing this module raises ImportError where they could not be built.
"""

from collections.abc import Callable, Iterable
from functools import wraps
from importlib import import_module
from typing import Any, ParamSpec, TypeVar

import numpy as np

from pilotfish.kernels import checks
from pilotfish.kernels.arguments import Emissions, SemiMarkovTables
from pilotfish.kernels.arms import ArmEffort, ArmLimits, ArmReading, Impedance, ToolTarget
from pilotfish.kernels.refusals import flat_row, free_push, no_factor, not_observable, singular_transform
from pilotfish.kernels.results import (
    EStep,
    ForwardBackward,
    Riccati,
    SemiMarkov,
    SemiMarkovEStep,
    SemiMarkovForward,
    Viterbi,
)
from pilotfish.kernels.streams import StreamRules, StreamState, StreamStep
from pilotfish.kernels.twins.chain import log_or_never
from pilotfish.types import Array, Float, Int

_baseline: Any = import_module("pilotfish.kernels._baseline")
LEVEL: str = "x86-64-v3" if _baseline.supports_v3() else "baseline"
_native: Any = import_module("pilotfish.kernels._v3") if LEVEL == "x86-64-v3" else _baseline

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
    "whiteners",
)
if missing := sorted(set(KERNELS) - set(dir(_native))):
    raise ImportError(f"they were built from older sources and lack {', '.join(missing)}")


Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


def _checked(
    check: Callable[..., Iterable[Any]],
) -> Callable[[Callable[Arguments, Result]], Callable[Arguments, Result]]:
    """Return a decorator that runs a kernel again, with the arguments that check returns, where it refuses.

    A kernel itself accepts nothing but packed arrays of the right shapes and numbers; to check them in Python
    each time would take as long as a small problem does.
    """

    def decorate(kernel: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
        @wraps(kernel)
        def run(*arguments: Arguments.args, **named: Arguments.kwargs) -> Result:
            try:
                return kernel(*arguments, **named)
            except (TypeError, ValueError, OverflowError, IndexError):
                checked = check(*arguments, **named)
            return kernel(*checked)  # type: ignore[call-arg]  # check returns them all

        return run

    return decorate


def _gaussians(
    emissions: Emissions,
) -> tuple[Float[Array, "P K D"], Float[Array, "P K E E"], Int[Array, " turns"]]:
    return emissions.means, emissions.whiteners, np.array(emissions.turns, dtype=np.int64)


def _chain(
    tables: SemiMarkovTables,
) -> tuple[Float[Array, " K"], Float[Array, "K K"], Float[Array, "4 S K"], Float[Array, "2 K"]]:
    log_initial, log_transitions = log_or_never(tables.initial), log_or_never(tables.transitions)
    return log_initial, log_transitions, tables.log_visits, tables.log_beyond


@_checked(lambda x, emissions: checks.gaussians(x, emissions, {}))
def log_emissions(x: Float[Array, "P N D"], emissions: Emissions) -> Float[Array, "N K"]:
    log_densities: Float[Array, "N K"] = _native.log_emissions(x, *_gaussians(emissions))
    return log_densities


@_checked(checks.e_step)
def e_step(
    x: Float[Array, "P N D"],
    lengths: Int[Array, " M"],
    initial: Float[Array, " K"],
    transitions: Float[Array, "K K"],
    emissions: Emissions,
    threads: int = 1,
) -> EStep:
    logarithms = log_or_never(initial), transitions, log_or_never(transitions)
    return EStep(*_native.e_step(x, lengths, *logarithms, *_gaussians(emissions), threads))


@_checked(checks.semi_markov_e_step)
def semi_markov_e_step(
    x: Float[Array, "P N D"],
    lengths: Int[Array, " M"],
    tables: SemiMarkovTables,
    emissions: Emissions,
    threads: int = 1,
) -> SemiMarkovEStep:
    sums = _native.semi_markov_e_step(x, lengths, *_chain(tables), *_gaussians(emissions), threads)
    return SemiMarkovEStep(*sums)


@_checked(checks.markov)
def forward_backward(
    log_emissions: Float[Array, "T K"], initial: Float[Array, " K"], transitions: Float[Array, "K K"]
) -> ForwardBackward:
    logarithms = log_or_never(initial), transitions, log_or_never(transitions)
    return ForwardBackward(*_native.forward_backward(log_emissions, *logarithms))


def impedance(impedance: Impedance, limits: ArmLimits, reading: ArmReading, target: ToolTarget) -> ArmEffort:
    try:
        effort = _impedance(impedance, limits, reading, target)
    except (
        TypeError,
        ValueError,
    ):  # checked and packed only here: a control loop calls this each millisecond
        effort = _impedance(*checks.arm(impedance, limits, reading, target))
    return effort


def _impedance(impedance: Impedance, limits: ArmLimits, reading: ArmReading, target: ToolTarget) -> ArmEffort:
    torque, wrench, share = _native.impedance(
        impedance.stiffness,
        impedance.damping,
        impedance.posture,
        impedance.posture_stiffness,
        impedance.joint_damping,
        impedance.force_limit,
        impedance.moment_limit,
        impedance.singular_value,
        impedance.limit_margin,
        impedance.limit_stiffness,
        limits.lower,
        limits.upper,
        limits.torque,
        reading.q,
        reading.velocity,
        reading.position,
        reading.quaternion,
        reading.jacobian,
        reading.bias,
        target.position,
        target.quaternion,
        target.twist,
    )
    return ArmEffort(torque, wrench, share)


@_checked(checks.markov)
def viterbi(
    log_emissions: Float[Array, "T K"], initial: Float[Array, " K"], transitions: Float[Array, "K K"]
) -> Viterbi:
    states, log_probability = _native.viterbi(log_emissions, log_or_never(initial), log_or_never(transitions))
    return Viterbi(states.view(np.int64), log_probability)  # the same bits, by the name that NumPy knows them


@_checked(checks.semi_markov)
def semi_markov(log_emissions: Float[Array, "T K"], tables: SemiMarkovTables) -> SemiMarkov:
    return SemiMarkov(*_native.semi_markov(log_emissions, *_chain(tables)))


@_checked(checks.semi_markov)
def semi_markov_forward(log_emissions: Float[Array, "T K"], tables: SemiMarkovTables) -> SemiMarkovForward:
    return SemiMarkovForward(*_native.semi_markov_forward(log_emissions, *_chain(tables)))


@_checked(checks.semi_markov)
def semi_markov_viterbi(log_emissions: Float[Array, "T K"], tables: SemiMarkovTables) -> Viterbi:
    states, log_probability = _native.semi_markov_viterbi(log_emissions, *_chain(tables))
    return Viterbi(states.view(np.int64), log_probability)


def observe(x: Float[Array, "N P D"], state: StreamState, rules: StreamRules) -> StreamStep:
    try:
        found = _native.observe(x, state.head, state.clusters, state.counts, state.room, rules.numbers)
    except (TypeError, ValueError):  # checked and packed only here: a datapoint takes a few microseconds
        x, state = checks.stream(x, "NPD", state, rules)
        found = _native.observe(x, state.head, state.clusters, state.counts, state.room, rules.numbers)
    refused, head, clusters, counts, room, identities, costs, changes, gone = found
    if refused >= 0:
        raise not_observable(x, refused)
    now = StreamState(head, clusters, counts, state.frames, state.width, room)
    return StreamStep(now, identities.view(np.int64), costs, changes, gone.view(np.int64))


def observe_one(
    x: Float[Array, "P D"], state: StreamState, rules: StreamRules
) -> tuple[StreamState, int, float, float]:
    try:
        found = _native.observe_one(x, state.head, state.clusters, state.counts, state.room, rules.numbers)
    except (TypeError, ValueError):
        x, state = checks.stream(x, "PD", state, rules)
        found = _native.observe_one(x, state.head, state.clusters, state.counts, state.room, rules.numbers)
    refused, head, clusters, counts, room, identity, cost, change = found
    if refused >= 0:
        raise not_observable(x[None], refused)
    return StreamState(head, clusters, counts, state.frames, state.width, room), identity, cost, change


@_checked(checks.riccati)
def riccati(
    A: Float[Array, "S n n"],
    B: Float[Array, "S n m"],
    weights: Float[Array, "T n n"],
    targets: Float[Array, "T n"],
    effort: Float[Array, "m m"],
) -> Riccati:
    refused, *solution = _native.riccati(A, B, weights, targets, effort)
    if refused >= 0:
        raise free_push(refused)
    return Riccati(*solution)


def semi_tied_sweeps(
    scatters: Float[Array, "K D D"], mass: Float[Array, " K"], transform: Float[Array, "D D"], sweeps: int
) -> Float[Array, "D D"]:
    scatters, mass, transform, sweeps = checks.semi_tied(scatters, mass, transform, sweeps)
    present = mass > 0.0
    improved: Float[Array, "D D"]
    refused, improved = _native.semi_tied_sweeps(scatters[present], mass[present], transform, sweeps)
    if refused == len(transform):
        raise singular_transform()
    if refused >= 0:
        raise flat_row(refused)
    return improved


@_checked(checks.covariances)
def whiteners(covariances: Float[Array, "K D D"]) -> Float[Array, "K D D"]:
    inverses: Float[Array, "K D D"]
    refused, inverses = _native.whiteners(covariances)
    if refused >= 0:
        raise no_factor(refused)
    return inverses
