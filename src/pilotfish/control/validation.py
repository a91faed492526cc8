"""Checks of a user's systems, references and costs; solvers trust them afterwards."""

import numpy as np

from pilotfish.errors import InvalidInput, NotPositiveDefinite
from pilotfish.types import Array, Float
from pilotfish.validation import (
    finite_array,
    float_array,
    require_count,
    require_number,
    require_period,
    require_type,
)

MAX_AXES = 1_000  # the matrices of a double integrator then take 64 MB
MIN_CONTROL_COST, MAX_ENTRY = 1e-50, 1e50  # products of costs, systems and weights do not overflow
RELATIVE_TOLERANCE = 1e-8  # of the largest entry: rounding of a weight in symmetry and eigenvalues


def require_axes(axes: int) -> None:
    """Check the number of axes of a double integrator."""
    try:
        require_count(axes, "axes", MAX_AXES, minimum=1)
    except InvalidInput as error:
        raise InvalidInput(f"{error}: one for each position of the state, half of its entries") from error


def require_system(A: Array, B: Array, *, rank: int) -> None:
    """Check that A is (n, n) and B (n, m), or of rank 3 that A is (S, n, n) and B (S, n, m)."""
    _require_finite("A", A)
    _require_finite("B", B)
    if A.ndim != rank or A.shape[-1] != A.shape[-2] or A.size == 0:
        expected = "(n, n)" if rank == 2 else "(S, n, n), S periods"
        raise InvalidInput(
            f"A has shape {A.shape}, expected {expected}; only a TimeVaryingSystem has one A per period"
        )
    if B.ndim != A.ndim or B.shape[:-1] != A.shape[:-1] or B.shape[-1] == 0:
        expected = ", ".join(map(str, A.shape[:-1]))
        raise InvalidInput(f"B has shape {B.shape}, expected ({expected}, m): one row per row of A")


def require_same_period(reference_period: float | None, period: float) -> None:
    """Check that a reference, if it has a period, has that of the system."""
    if reference_period is None:
        return
    require_period(reference_period, "the reference's period")
    if abs(reference_period - period) > RELATIVE_TOLERANCE * period:
        raise InvalidInput(
            f"the reference has a target every {reference_period:g} s, but the period of the system is "
            f"{period:g} s; give the system the period of the skill"
        )


def require_steps(A: Array, horizon: int) -> None:
    """Check that a time-varying system has one period less than there are targets."""
    if A.ndim == 3 and len(A) != horizon - 1:
        raise InvalidInput(
            f"the system has {len(A)} periods, expected {horizon - 1} between {horizon} targets"
        )


def require_reference(targets: Array, weights: Array, states: int) -> None:
    """Check for two or more targets with symmetric positive semidefinite weights."""
    _require_finite("targets", targets)
    _require_finite("weights", weights)
    if targets.ndim != 2 or targets.shape[1] != states:
        raise InvalidInput(
            f"targets has shape {targets.shape}, expected (T, {states}) as the system has {states} states; a "
            "double integrator tracks positions and velocities (pf.add_derivatives adds velocities)"
        )
    if len(targets) < 2:
        raise InvalidInput(f"the horizon is {len(targets)}, expected 2 or more steps")
    if weights.shape != (*targets.shape, states):
        raise InvalidInput(
            f"weights has shape {weights.shape}, expected {(*targets.shape, states)}: one per target"
        )
    changes = np.flatnonzero((weights[1:] != weights[:-1]).any(axis=(1, 2))) + 1
    for t in (0, *changes):
        require_semidefinite(f"weights[{t}]", weights[t])


def require_semidefinite(name: str, weight: Array) -> None:
    """Check that a weight is symmetric and positive semidefinite, up to rounding."""
    _require_symmetric(name, weight)
    try:
        np.linalg.cholesky(weight)  # the fast test that usually succeeds
    except np.linalg.LinAlgError:
        minimum = np.linalg.eigvalsh(weight)[0]
        if minimum < -RELATIVE_TOLERANCE * np.abs(weight).max():
            raise NotPositiveDefinite(
                f"{name} has the eigenvalue {minimum:.3g}, expected none below zero; if it is the inverse "
                "of a covariance, use more regularisation"
            ) from None


def control_cost_matrix(control_cost: float | Array, inputs: int) -> Float[Array, "m m"]:
    """Return R: control_cost times the identity, or control_cost itself if it is a matrix."""
    if not (isinstance(control_cost, np.ndarray) and control_cost.ndim) and not isinstance(
        control_cost, list | tuple
    ):
        try:
            cost = require_number(control_cost, "control_cost", MIN_CONTROL_COST, MAX_ENTRY)
        except InvalidInput as error:
            raise InvalidInput(f"{error}: a positive cost such as 0.1, or R as an array") from error
        return cost * np.eye(inputs)
    R = finite_array(control_cost, "control_cost", maximum=MAX_ENTRY)
    if R.shape != (inputs, inputs):
        raise InvalidInput(
            f"control_cost has shape {R.shape}, expected one number or {(inputs, inputs)} for {inputs} "
            "inputs; np.diag makes a matrix of one cost per input"
        )
    _require_symmetric("control_cost", R)
    minimum = np.linalg.eigvalsh(R)[0]
    if not minimum >= MIN_CONTROL_COST:
        raise NotPositiveDefinite(
            f"control_cost has the eigenvalue {minimum:.3g}, expected all above zero: every input has a cost"
        )
    return R


def require_terminal(terminal: Array, states: int) -> None:
    """Check the weight of the last state."""
    _require_finite("terminal", terminal)
    if terminal.shape != (states, states):
        raise InvalidInput(
            f"terminal has shape {terminal.shape}, expected {(states, states)}: the weight of the last state"
        )
    require_semidefinite("terminal", terminal)


def require_start(start: Array, states: int) -> None:
    """Check that a start is a finite state of the system."""
    _require_finite("start", start)
    if start.shape != (states,):
        raise InvalidInput(f"start has shape {start.shape}, expected ({states},): one number per state")


def position_count(gains: Array) -> int:
    """Return the number of positions of a state that holds positions, then velocities."""
    if gains.shape[-1] % 2:
        raise InvalidInput(
            f"the state has {gains.shape[-1]} entries, expected positions, then as many velocities"
        )
    return int(gains.shape[-1] // 2)


def _require_symmetric(name: str, matrix: Array) -> None:
    skew = np.abs(matrix - matrix.T).max()
    if skew > RELATIVE_TOLERANCE * np.abs(matrix).max():
        raise InvalidInput(
            f"{name} differs from its transpose by {skew:.3g}, expected symmetry; pass (W + W.T) / 2"
        )


def _require_finite(name: str, array: Array) -> None:
    require_type(array, name, np.ndarray, f"pass np.array({name})")
    float_array(array, name, maximum=MAX_ENTRY)
