"""The NumPy references, their arguments checked and packed as those of the compiled kernels are."""

from collections.abc import Callable, Iterable
from functools import wraps
from typing import Any, ParamSpec, TypeVar

from pilotfish.kernels import checks
from pilotfish.kernels.arguments import Emissions
from pilotfish.kernels.streams import StreamRules, StreamState
from pilotfish.kernels.twins import (
    chain,
    emission,
    expectation,
    semi_tied,
    streaming,
    tracking,
    whitening,
)
from pilotfish.kernels.twins import impedance as arms
from pilotfish.kernels.twins import semi_markov as visits

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


def _checked(
    check: Callable[..., Iterable[Any]], kernel: Callable[Arguments, Result]
) -> Callable[Arguments, Result]:
    """Return the kernel, given the arguments that check returns, as the compiled kernels are."""

    @wraps(kernel)
    def run(*arguments: Arguments.args, **named: Arguments.kwargs) -> Result:
        return kernel(*check(*arguments, **named))  # type: ignore[call-arg]  # check returns them all

    return run


def _gaussians(x: object, emissions: Emissions) -> tuple[Any, ...]:
    return checks.gaussians(x, emissions, {})


def _stream(x: object, state: StreamState, rules: StreamRules) -> tuple[Any, ...]:
    return (*checks.stream(x, "NPD", state, rules), rules)


def _stream_of_one(x: object, state: StreamState, rules: StreamRules) -> tuple[Any, ...]:
    return (*checks.stream(x, "PD", state, rules), rules)


e_step = _checked(checks.e_step, expectation.e_step)
forward_backward = _checked(checks.markov, chain.forward_backward)
impedance = _checked(checks.arm, arms.impedance)
log_emissions = _checked(_gaussians, emission.log_emissions)
observe = _checked(_stream, streaming.observe)
observe_one = _checked(_stream_of_one, streaming.observe_one)
riccati = _checked(checks.riccati, tracking.riccati)
semi_markov = _checked(checks.semi_markov, visits.semi_markov)
semi_markov_e_step = _checked(checks.semi_markov_e_step, expectation.semi_markov_e_step)
semi_markov_forward = _checked(checks.semi_markov, visits.semi_markov_forward)
semi_markov_viterbi = _checked(checks.semi_markov, visits.semi_markov_viterbi)
semi_tied_sweeps = _checked(checks.semi_tied, semi_tied.semi_tied_sweeps)
viterbi = _checked(checks.markov, chain.viterbi)
whiteners = _checked(checks.covariances, whitening.whiteners)
