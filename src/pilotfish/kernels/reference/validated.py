"""The NumPy references, their arguments checked and packed as those of the compiled kernels are."""

from collections.abc import Callable, Iterable
from functools import wraps
from typing import Any, ParamSpec, TypeVar

from pilotfish.kernels import validation
from pilotfish.kernels.arguments import Emissions
from pilotfish.kernels.reference import cholesky, e_steps, emission, markov, semi_tied, streaming
from pilotfish.kernels.reference import impedance as arms
from pilotfish.kernels.reference import riccati as riccati_reference
from pilotfish.kernels.reference import semi_markov as semi_markov_reference
from pilotfish.kernels.stream_state import StreamParameters, StreamState

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


def _with_validation(
    check: Callable[..., Iterable[Any]], kernel: Callable[Arguments, Result]
) -> Callable[Arguments, Result]:
    """Return the kernel, given the arguments that check returns, as the compiled kernels are."""

    @wraps(kernel)
    def run(*arguments: Arguments.args, **keywords: Arguments.kwargs) -> Result:
        return kernel(*check(*arguments, **keywords))  # type: ignore[call-arg]  # check returns them all

    return run


def _gaussians(x: object, emissions: Emissions) -> tuple[Any, ...]:
    return validation.pack_gaussians(x, emissions, {})


def _stream(x: object, state: StreamState, parameters: StreamParameters) -> tuple[Any, ...]:
    return (*validation.pack_stream(x, "NPD", state, parameters), parameters)


def _single_point_stream(x: object, state: StreamState, parameters: StreamParameters) -> tuple[Any, ...]:
    return (*validation.pack_stream(x, "PD", state, parameters), parameters)


e_step = _with_validation(validation.pack_e_step, e_steps.e_step)
forward_backward = _with_validation(validation.pack_markov, markov.forward_backward)
impedance = _with_validation(validation.pack_arm, arms.impedance)
log_emissions = _with_validation(_gaussians, emission.log_emissions)
observe = _with_validation(_stream, streaming.observe)
observe_one = _with_validation(_single_point_stream, streaming.observe_one)
riccati = _with_validation(validation.pack_riccati, riccati_reference.riccati)
semi_markov = _with_validation(validation.pack_semi_markov, semi_markov_reference.semi_markov)
semi_markov_e_step = _with_validation(validation.pack_semi_markov_e_step, e_steps.semi_markov_e_step)
semi_markov_forward = _with_validation(validation.pack_semi_markov, semi_markov_reference.semi_markov_forward)
semi_markov_viterbi = _with_validation(validation.pack_semi_markov, semi_markov_reference.semi_markov_viterbi)
semi_tied_sweeps = _with_validation(validation.pack_semi_tied, semi_tied.semi_tied_sweeps)
viterbi = _with_validation(validation.pack_markov, markov.viterbi)
precision_cholesky = _with_validation(validation.pack_covariances, cholesky.precision_cholesky)
