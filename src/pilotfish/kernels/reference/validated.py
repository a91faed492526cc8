"""The NumPy references with the same validation of arguments as the compiled kernels."""

from collections.abc import Callable, Iterable
from functools import wraps
from typing import Any, ParamSpec, TypeVar

from pilotfish.kernels.reference import (
    assistance,
    cholesky,
    e_steps,
    emission,
    impedance,
    markov,
    riccati,
    riemannian,
    semi_markov,
    semi_tied,
    streaming,
)
from pilotfish.kernels.validation import KERNELS

MODULES = (
    *(assistance, cholesky, e_steps, emission, impedance, markov, riccati, riemannian),
    *(semi_markov, semi_tied, streaming),
)

Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


def _with_validation(
    pack: Callable[..., Iterable[Any]], kernel: Callable[Arguments, Result]
) -> Callable[Arguments, Result]:
    """Return the kernel, called with the packed arguments."""

    @wraps(kernel)
    def run(*arguments: Arguments.args, **keywords: Arguments.kwargs) -> Result:
        return kernel(*pack(*arguments, **keywords))  # type: ignore[call-arg]  # pack returns all arguments

    return run


_functions = {name: function for module in MODULES for name, function in vars(module).items()}
globals().update({name: _with_validation(pack, _functions[name]) for name, pack in KERNELS.items()})
__all__ = list(KERNELS)
