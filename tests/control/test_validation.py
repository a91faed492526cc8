"""Checks of systems, references and costs."""

from collections.abc import Callable

import numpy as np
import pytest
from jaxtyping import TypeCheckError

from pilotfish.control import (
    ContinuousSystem,
    Feedback,
    LinearSystem,
    Reference,
    TimeVaryingSystem,
    continuous_double_integrator,
    discretise,
    double_integrator,
    lqr,
    lqr_continuous,
    solve_batch,
    track,
    track_continuous,
)
from pilotfish.errors import InvalidInput, NotPositiveDefinite

SYSTEM, START = double_integrator(2, 0.1), np.zeros(4)
TARGETS, WEIGHTS = np.zeros((5, 4)), np.stack([np.eye(4)] * 5)


def replace_entry(array: np.ndarray, index: tuple[int, ...], value: float) -> np.ndarray:
    copy = array.copy()
    copy[index] = value
    return copy


def solvers(reference: Reference, control_cost: float | np.ndarray) -> list[Callable[[], object]]:
    continuous = continuous_double_integrator(2)
    return [
        lambda: track(SYSTEM, reference, control_cost),
        lambda: lqr(SYSTEM, reference, control_cost),
        lambda: solve_batch(SYSTEM, reference, control_cost, START),
        lambda: track_continuous(continuous, reference, control_cost, period=0.1),
        lambda: lqr_continuous(continuous, reference, control_cost, period=0.1),
    ]


NEGATIVE, ASYMMETRIC = np.diag([1.0, -0.25, 1.0, 1.0]), np.eye(4) + 0.5 * np.eye(4, k=1)
REFUSED = [
    (TARGETS[:, :3], WEIGHTS[:, :3, :3], InvalidInput, r"targets has shape \(5, 3\), expected \(T, 4\)"),
    (TARGETS[:1], WEIGHTS[:1], InvalidInput, "the horizon is 1, expected 2 or more"),
    (TARGETS[:0], WEIGHTS[:0], InvalidInput, "the horizon is 0, expected 2 or more"),
    (TARGETS, WEIGHTS[:, :, :2], InvalidInput, r"weights has shape \(5, 4, 2\), expected \(5, 4, 4\)"),
    (TARGETS, WEIGHTS[:4], InvalidInput, r"weights has shape \(4, 4, 4\), expected \(5, 4, 4\)"),
    (
        replace_entry(TARGETS, (3, 1), np.nan),
        WEIGHTS,
        InvalidInput,
        r"targets\[3, 1\] is nan, expected a finite",
    ),
    (
        TARGETS,
        replace_entry(WEIGHTS, (2, 0, 0), np.inf),
        InvalidInput,
        r"weights\[2, 0, 0\] is inf, expected a finite",
    ),
    (TARGETS, np.stack([*WEIGHTS[:3], NEGATIVE, NEGATIVE]), NotPositiveDefinite, r"weights\[3\] .* -0.25"),
    (TARGETS, np.stack([NEGATIVE] * 5), NotPositiveDefinite, r"weights\[0\] has the eigenvalue -0.25"),
    (
        TARGETS,
        np.stack([*WEIGHTS[:4], ASYMMETRIC]),
        InvalidInput,
        r"weights\[4\] .* transpose by 0.5, .* W.T",
    ),
]


@pytest.mark.parametrize(("targets", "weights", "error", "message"), REFUSED)
@pytest.mark.parametrize("solver", range(5), ids=["track", "lqr", "batch", "track_c", "lqr_c"])
def test_solvers_unusable_reference_is_refused(solver, targets, weights, error, message):
    """Every solver refuses it, and the message gives the step."""
    reference = unchecked(targets, weights)
    with pytest.raises(error, match=message):
        solvers(reference, 1.0)[solver]()


def unchecked(targets: np.ndarray, weights: np.ndarray) -> Reference:
    """Return a Reference whose shapes need not agree, as without annotation checks."""
    reference = object.__new__(Reference)
    object.__setattr__(reference, "targets", targets)
    object.__setattr__(reference, "weights", weights)
    object.__setattr__(reference, "period", None)
    return reference


@pytest.mark.parametrize(
    ("control_cost", "error", "message"),
    [
        (0.0, InvalidInput, "control_cost is 0.0, expected .* a positive cost"),
        (-2.0, InvalidInput, "control_cost is -2.0, expected .* a positive cost"),
        (np.nan, InvalidInput, "control_cost is nan, expected .* a positive cost"),
        (np.inf, InvalidInput, "control_cost is inf, expected .* a positive cost"),
        (np.eye(3), InvalidInput, r"control_cost has shape \(3, 3\), expected one number or \(2, 2\)"),
        (np.diag([1.0, np.nan]), InvalidInput, r"control_cost\[1, 1\] is nan"),
        (np.array([[1.0, 0.5], [0.0, 1.0]]), InvalidInput, "control_cost differs from its transpose by 0.5"),
        (
            np.diag([1.0, 0.0]),
            NotPositiveDefinite,
            "control_cost has the eigenvalue 0, expected all above zero",
        ),
        (np.diag([1.0, -3.0]), NotPositiveDefinite, "control_cost has the eigenvalue -3"),
    ],
)
@pytest.mark.parametrize("solver", range(5), ids=["track", "lqr", "batch", "track_c", "lqr_c"])
def test_solvers_unusable_control_cost_is_refused(solver, control_cost, error, message):
    """Every input has a cost; otherwise the optimum is not defined."""
    with pytest.raises(error, match=message):
        solvers(Reference(TARGETS, WEIGHTS), control_cost)[solver]()


def linear(A: np.ndarray, B: np.ndarray, period: float = 0.1) -> LinearSystem:
    system = object.__new__(LinearSystem)
    for name, value in (("A", A), ("B", B), ("period", period)):
        object.__setattr__(system, name, value)
    return system


@pytest.mark.parametrize(
    ("system", "message"),
    [
        (linear(np.eye(4)[:3], np.ones((4, 2))), r"A has shape \(3, 4\), expected \(n, n\)"),
        (linear(np.ones((4, 4, 4)), np.ones((4, 4, 2))), r"A has shape \(4, 4, 4\), expected \(n, n\)"),
        (linear(np.eye(4), np.ones((3, 2))), r"B has shape \(3, 2\), expected \(4, m\)"),
        (linear(np.eye(4), np.ones((4, 0))), r"B has shape \(4, 0\), expected \(4, m\)"),
        (linear(np.eye(4), replace_entry(np.ones((4, 2)), (1, 1), np.nan)), r"B\[1, 1\] is nan"),
        (linear(replace_entry(np.eye(4), (0, 1), -np.inf), np.ones((4, 2))), r"A\[0, 1\] is -inf"),
        (linear(np.eye(4), np.ones((4, 2)), period=0.0), "period is 0.0, expected .* a positive time"),
        (
            TimeVaryingSystem(np.ones((3, 4, 4)), np.ones((3, 4, 2)), 0.1),
            "has 3 periods, expected 4 between 5 targets",
        ),
    ],
)
def test_solvers_unusable_system_is_refused(system, message):
    """The message gives shapes, numbers and period; a time-varying system must fit the horizon."""
    for solve in (
        lambda: track(system, Reference(TARGETS, WEIGHTS), 1.0),
        lambda: solve_batch(system, Reference(TARGETS, WEIGHTS), 1.0, START),
    ):
        with pytest.raises(InvalidInput, match=message):
            solve()


def test_solvers_unusable_continuous_system_is_refused():
    """The checks are those of discrete systems."""
    broken = ContinuousSystem(np.full((4, 4), np.nan), np.ones((4, 2)))
    for use in (
        lambda: discretise(broken, 0.1),
        lambda: track_continuous(broken, Reference(TARGETS, WEIGHTS), 1.0, period=0.1),
        lambda: lqr_continuous(broken, Reference(TARGETS, WEIGHTS), 1.0, period=0.1),
    ):
        with pytest.raises(InvalidInput, match=r"A\[0, 0\] is nan, expected .* \(16 such values\)"):
            use()
    for control in (track_continuous, lqr_continuous):
        with pytest.raises(InvalidInput, match=r"period is -1\.0, expected .* a positive time"):
            control(continuous_double_integrator(2), Reference(TARGETS, WEIGHTS), 1.0, period=-1.0)


@pytest.mark.parametrize(
    ("terminal", "error", "message"),
    [
        (np.eye(2), InvalidInput, r"terminal has shape \(2, 2\), expected \(4, 4\)"),
        (np.full((4, 4), np.nan), InvalidInput, r"terminal\[0, 0\] is nan"),
        (-np.eye(4), NotPositiveDefinite, "terminal has the eigenvalue -1"),
    ],
)
def test_track_continuous_unusable_terminal_weight_is_refused(terminal, error, message):
    with pytest.raises(error, match=message):
        track_continuous(
            continuous_double_integrator(2), Reference(TARGETS, WEIGHTS), 1.0, period=0.1, terminal=terminal
        )


@pytest.mark.parametrize(
    ("start", "message"),
    [
        (np.zeros(3), r"start has shape \(3,\), expected \(4,\)"),
        (np.array([0.0, np.nan, 0.0, 0.0]), r"start\[1\] is nan"),
    ],
)
def test_rollout_unusable_start_is_refused(start, message):
    """The start must be a state of the system."""
    reference = Reference(TARGETS, WEIGHTS)
    for begin in (
        lambda: track(SYSTEM, reference, 1.0).rollout(start),
        lambda: lqr_continuous(continuous_double_integrator(2), reference, 1.0, period=0.1).rollout(start),
        lambda: solve_batch(SYSTEM, reference, 1.0, start),
    ):
        with pytest.raises(InvalidInput, match=message):
            begin()


def test_stiffness_odd_state_is_refused():
    """Three entries are not positions and as many velocities."""
    feedback = Feedback(
        SYSTEM, Reference(np.zeros((2, 3)), np.zeros((2, 3, 3))), 0.1, np.ones((1, 1, 3)), np.ones((1, 1))
    )
    for gain in ("stiffness", "damping"):
        with pytest.raises(InvalidInput, match="the state has 3 entries"):
            getattr(feedback, gain)


def test_solvers_rounding_in_symmetry_is_accepted():
    """Inverses of covariances are symmetric up to rounding only; every solver accepts them."""
    weights, control_cost, skew = WEIGHTS.copy(), np.eye(2), 1e-9
    exact = [solve() for solve in solvers(Reference(TARGETS, weights), control_cost)]
    weights[:, 0, 3] += skew
    rounded = [
        solve() for solve in solvers(Reference(TARGETS, weights), control_cost + skew * np.eye(2, k=1))
    ]
    for first, second in zip(exact, rounded, strict=True):
        if not isinstance(first, tuple):
            np.testing.assert_allclose(second.gains, first.gains, atol=1e-7)


def test_track_weight_of_lower_rank_is_accepted(rng):
    """Positive semidefinite is enough, up to rounding."""
    root = rng.normal(size=(4, 2))
    track(SYSTEM, Reference(TARGETS, np.stack([1e3 * root @ root.T] * 5)), 1.0)
    track(SYSTEM, Reference(TARGETS, np.zeros((5, 4, 4))), 1.0)


def test_solvers_reference_of_other_period_is_refused():
    """The period of a reference must be that of the system."""
    targets, weights = np.zeros((5, 4)), np.tile(np.eye(4), (5, 1, 1))
    planned = Reference(targets, weights, period=0.1)
    assert track(double_integrator(2, 0.1), planned, 1.0).gains.shape == (4, 2, 4)
    for follow in (
        lambda: track(double_integrator(2, 1.0), planned, 1.0),
        lambda: track_continuous(continuous_double_integrator(2), planned, 1.0, period=1.0),
    ):
        with pytest.raises(InvalidInput, match=r"every 0\.1 s, but the period of the system is 1 s"):
            follow()


def test_track_overflowing_gains_are_refused():
    """An unstable mode that no input controls overflows float64 over a long horizon."""
    system = LinearSystem(np.diag([10.0, 1.0]), np.array([[0.0], [1.0]]), 0.1)
    reference = Reference(np.zeros((400, 2)), np.tile(np.eye(2), (400, 1, 1)))
    with pytest.raises(InvalidInput, match="not finite"), np.errstate(all="ignore"):
        track(system, reference, 1.0)


def test_lqr_time_varying_system_is_refused():
    system = TimeVaryingSystem(np.tile(np.eye(2), (4, 1, 1)), np.ones((4, 2, 1)), 0.1)
    reference = Reference(np.zeros((5, 2)), np.tile(np.eye(2), (5, 1, 1)))
    with pytest.raises((InvalidInput, TypeCheckError), match="LinearSystem"):
        lqr(system, reference, 1.0)  # type: ignore[arg-type]
