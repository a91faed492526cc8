"""The room's doors: arrays that a user gives are checked here once, and trusted from then on."""

import numpy as np

from pilotfish.errors import InvalidInput, NotPositiveDefinite
from pilotfish.types import Array, Float
from pilotfish.validation import finite_array, float_array, require_count, require_number, require_type

MAX_AXES = 1_000  # the matrices of a double integrator then take 64 MB
MIN_PERIOD, MAX_PERIOD = 1e-9, 1e9  # s, as of recordings
MIN_CONTROL_COST, MAX_ENTRY = 1e-50, 1e50  # products of prices, systems and weights do not overflow
RELATIVE_TOLERANCE = (
    1e-8  # what computing a weight may cost in symmetry or sign, as a share of its largest entry
)


def require_axes(axes: int) -> None:
    try:
        require_count(axes, "axes", MAX_AXES, minimum=1)
    except InvalidInput as error:
        raise InvalidInput(f"{error}: one for each position of the state, half of its entries") from error


def require_period(period: float) -> None:
    try:
        require_number(period, "period", MIN_PERIOD, MAX_PERIOD)
    except InvalidInput as error:
        raise InvalidInput(f"{error}: a positive time [s]") from error


def require_system(A: Array, B: Array, *, rank: int) -> None:
    """A is (n, n) and B (n, m), or one of each for every period: (S, n, n) and (S, n, m)."""
    _require_finite("A", A)
    _require_finite("B", B)
    if A.ndim != rank or A.shape[-1] != A.shape[-2] or A.size == 0:
        expected = "(n, n)" if rank == 2 else "(S, n, n), S periods"
        raise InvalidInput(
            f"A has shape {A.shape}, expected {expected}: VaryingSystem varies, the others do not"
        )
    if B.ndim != A.ndim or B.shape[:-1] != A.shape[:-1] or B.shape[-1] == 0:
        expected = ", ".join(map(str, A.shape[:-1]))
        raise InvalidInput(f"B has shape {B.shape}, expected ({expected}, m): a row for each state of A")


def require_same_period(planned: float | None, period: float) -> None:
    """A plan made for one time between targets is not followed at another pace."""
    if planned is not None:
        require_number(planned, "the reference's period", MIN_PERIOD, MAX_PERIOD)
    if planned is not None and abs(planned - period) > RELATIVE_TOLERANCE * period:
        raise InvalidInput(
            f"the reference has a target every {planned:g} s, the system moves every {period:g} s; give the "
            "system the period of the skill"
        )


def require_steps(A: Array, horizon: int) -> None:
    """A system that varies is given for exactly the periods between the targets."""
    if A.ndim == 3 and len(A) != horizon - 1:
        raise InvalidInput(
            f"the system varies over {len(A)} periods, expected {horizon - 1} between {horizon} targets"
        )


def require_reference(targets: Array, weights: Array, states: int) -> None:
    """At least two targets of the system's states, each with a symmetric positive semidefinite weight."""
    _require_finite("targets", targets)
    _require_finite("weights", weights)
    if targets.ndim != 2 or targets.shape[1] != states:
        raise InvalidInput(
            f"targets has shape {targets.shape}, expected (T, {states}) as the system has {states} states; a "
            "double integrator follows positions with their speeds (pf.with_derivatives adds these)"
        )
    if len(targets) < 2:
        raise InvalidInput(
            f"the horizon is {len(targets)}, expected 2 or more steps: there is nothing to move between"
        )
    if weights.shape != (*targets.shape, states):
        raise InvalidInput(
            f"weights has shape {weights.shape}, expected {(*targets.shape, states)}: one a target"
        )
    changes = np.flatnonzero((weights[1:] != weights[:-1]).any(axis=(1, 2))) + 1
    for t in (0, *changes):
        require_semidefinite(f"weights[{t}]", weights[t])


def require_semidefinite(name: str, weight: Array) -> None:
    _require_symmetric(name, weight)
    try:
        np.linalg.cholesky(weight)  # the fast way to say yes
    except np.linalg.LinAlgError:
        minimum = np.linalg.eigvalsh(weight)[0]
        if minimum < -RELATIVE_TOLERANCE * np.abs(weight).max():
            raise NotPositiveDefinite(
                f"{name} has the eigenvalue {minimum:.3g}, expected none below zero: a weight is the inverse"
                " of a covariance, which more regularisation keeps positive definite"
            ) from None


def control_cost_matrix(control_cost: float | Array, inputs: int) -> Float[Array, "m m"]:
    """R: effort times the identity, or effort itself if it is a symmetric positive definite matrix."""
    if not (isinstance(control_cost, np.ndarray) and control_cost.ndim) and not isinstance(
        control_cost, list | tuple
    ):
        try:
            price = require_number(control_cost, "control_cost", MIN_CONTROL_COST, MAX_ENTRY)
        except InvalidInput as error:
            raise InvalidInput(
                f"{error}: a positive price, a small one, say 1e-3, hardly costs; or R as an array"
            ) from error
        return price * np.eye(inputs)
    R = finite_array(control_cost, "control_cost", maximum=MAX_ENTRY)
    if R.shape != (inputs, inputs):
        raise InvalidInput(
            f"control_cost has shape {R.shape}, expected one number or {(inputs, inputs)} for {inputs} inputs; "
            "np.diag makes a matrix of a price for each"
        )
    _require_symmetric("control_cost", R)
    minimum = np.linalg.eigvalsh(R)[0]
    if not minimum >= MIN_CONTROL_COST:
        raise NotPositiveDefinite(
            f"control_cost has the eigenvalue {minimum:.3g}, expected all above zero: price every input"
        )
    return R


def require_terminal(terminal: Array, states: int) -> None:
    _require_finite("terminal", terminal)
    if terminal.shape != (states, states):
        raise InvalidInput(
            f"terminal has shape {terminal.shape}, expected {(states, states)}: the last state's weight"
        )
    require_semidefinite("terminal", terminal)


def require_start(start: Array, states: int) -> None:
    _require_finite("start", start)
    if start.shape != (states,):
        raise InvalidInput(f"start has shape {start.shape}, expected ({states},): one number for each state")


def position_count(gains: Array) -> int:
    """The number of positions in a second-order state, positions then velocities."""
    if gains.shape[-1] % 2:
        raise InvalidInput(
            f"the state has {gains.shape[-1]} entries, expected positions then as many velocities"
        )
    return int(gains.shape[-1] // 2)


def _require_symmetric(name: str, matrix: Array) -> None:
    skew = np.abs(matrix - matrix.T).max()
    if skew > RELATIVE_TOLERANCE * np.abs(matrix).max():
        raise InvalidInput(
            f"{name} differs from its transpose by {skew:.3g}, expected symmetry: give (W + W.T) / 2"
        )


def _require_finite(name: str, array: Array) -> None:
    require_type(array, name, np.ndarray, f"give np.array({name})")
    float_array(array, name, maximum=MAX_ENTRY)
