"""Faults that only compiled kernels can have: interpreter lock, subnormal numbers, array bounds, digits."""

import importlib
import importlib.util
import sys
import threading
import time
import warnings

import numpy as np
import pytest

import pilotfish.kernels
from pilotfish.kernels import (
    BACKEND,
    Emissions,
    SlowKernelsWarning,
    StreamParameters,
    StreamState,
    backend,
    reference,
)
from pilotfish.kernels.validation import KERNELS

ULP = np.finfo(float).eps


@pytest.fixture
def baseline(compiled):
    return importlib.import_module("pilotfish.kernels._baseline")


def test_backend_compiled_kernels_are_used(compiled):
    """BACKEND names the instruction set."""
    assert compiled.INSTRUCTION_SET == BACKEND
    assert BACKEND in {"x86-64-v3", "baseline"}
    assert all(getattr(pilotfish.kernels, name) is getattr(compiled, name) for name in KERNELS)


def test_backend_missing_compiled_kernels_warns_and_uses_reference(monkeypatch):
    """The warning states what is missing and the fix."""
    monkeypatch.setitem(sys.modules, "pilotfish.kernels.compiled", None)
    spec = importlib.util.spec_from_file_location("without_compiler", backend.__file__)
    without = importlib.util.module_from_spec(spec)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        spec.loader.exec_module(without)
    assert without.BACKEND == "numpy"
    assert all(getattr(without, name) is getattr(reference, name) for name in KERNELS)
    (warning,) = caught
    assert warning.category.__name__ == SlowKernelsWarning.__name__
    assert "install a C++17 compiler" in str(warning.message)


def test_native_both_instruction_sets_agree(baseline, case):
    """To rounding."""
    if not baseline.supports_v3():
        pytest.skip("this processor has no x86-64-v3, or the compiler did not know it")
    newer = importlib.import_module("pilotfish.kernels._v3")
    given = case(2, [70, 33], 9, 5)
    data, gaussians = (
        (given.x, given.lengths),
        (given.means, given.precision_cholesky[..., :8, :8].copy(), np.array([4]), 2),
    )
    logs = np.log(given.initial), np.log(given.transitions)
    markov = *data, logs[0], given.transitions, logs[1], *gaussians, np.zeros(5)
    semi_markov = *data, *logs, np.zeros((4, 30, 5)), np.zeros((2, 5)), *gaussians
    for name, arguments in [("e_step", markov), ("semi_markov_e_step", semi_markov)]:
        old_sums, new_sums = getattr(baseline, name)(*arguments), getattr(newer, name)(*arguments)
        for old, new in zip(old_sums, new_sums, strict=True):
            np.testing.assert_allclose(old, new, rtol=1e-10, atol=1e-10, err_msg=name)
    empty = StreamState.empty(2, 9)
    parameters = StreamParameters(40.0, 0.5, 0.1, 0.1, 90.0, 2.0, 0, 0.0, 0.0, 2, 8, 50, 1)
    stream = (
        np.ascontiguousarray(given.x.transpose(1, 0, 2)),
        empty.counters,
        empty.rows,
        empty.transition_counts,
        0,
    )
    old, new = (module.observe(*stream, parameters.packed) for module in (baseline, newer))
    for name, place in [("cluster_ids", 5), ("costs", 6), ("changes", 7), ("removed", 8)]:
        np.testing.assert_allclose(old[place], new[place], rtol=1e-9, atol=1e-9, err_msg=name)
    covariances = given.precision_cholesky[0] @ given.precision_cholesky[0].transpose(0, 2, 1)
    np.testing.assert_allclose(
        baseline.precision_cholesky(covariances)[1],
        newer.precision_cholesky(covariances)[1],
        rtol=1e-10,
        atol=1e-10,
    )


def test_e_step_releases_the_interpreter_lock(compiled, case):
    """Another thread reads the clock during one long call."""
    given = case(1, [40_000], 30, 20)
    call: list[float] = []

    def work():
        call.append(time.perf_counter())
        compiled.e_step(*given.arguments)
        call.append(time.perf_counter())

    worker, times = threading.Thread(target=work), []
    worker.start()
    while worker.is_alive():
        times.append(time.perf_counter())
    began, ended = call
    margin = 0.1 * (ended - began)
    assert any(began + margin < now < ended - margin for now in times)


def test_e_step_restores_subnormal_numbers(compiled, case):
    tiny = np.finfo(float).tiny
    compiled.e_step(*case(1, [40], 3, 2).arguments)
    compiled.viterbi(np.zeros((3, 2)), np.ones(2), np.ones((2, 2)))
    assert np.array([tiny]) / 2.0 > 0.0


def test_e_step_worker_threads_flush_subnormal_numbers(compiled, rng):
    """The result does not depend on which thread processes a demonstration: here, offsets are zero in all.

    State probabilities of the second state are about 1e-115, and deviations 1e-200.
    """
    x = 1e-200 * rng.normal(size=(1, 40_000, 14))
    means = np.zeros((1, 2, 14))
    means[0, 1, 0] = 23.0
    emissions = Emissions(means, np.tile(np.eye(14), (1, 2, 1, 1)))
    arguments = x, np.full(40, 1000), np.full(2, 0.5), np.full((2, 2), 0.5), emissions
    alone = compiled.e_step(*arguments, threads=1)
    assert alone.counts[1] > 0.0
    assert not alone.deviation_sums[0, 1, 1:].any()
    for _ in range(5):
        np.testing.assert_array_equal(
            compiled.e_step(*arguments, threads=4).deviation_sums, alone.deviation_sums
        )


def test_exponential_is_exact_to_last_digits(compiled):
    """State probabilities at one step have the ratios of the exponentials of the emissions."""
    x = np.concatenate([np.linspace(-700.0, 0.0, 301), np.linspace(-3.0, 0.0, 300)])
    everywhere = np.ones(len(x))
    result = compiled.forward_backward(x[None], everywhere, np.diag(everywhere))
    np.testing.assert_allclose(
        result.smoothed_state_probs[0] / result.smoothed_state_probs[0, -1], np.exp(x), rtol=4 * ULP
    )


def test_logarithm_is_exact_to_last_digits(compiled):
    """One step from a certain state has the logarithm of the transition probability."""
    a = np.concatenate([np.geomspace(1e-279, 1.0, 300), np.linspace(0.4, 1.9, 301)])
    transitions = np.zeros((len(a), len(a)))
    transitions[0] = a
    result = compiled.forward_backward(np.zeros((2, len(a))), np.eye(len(a))[0], transitions)
    np.testing.assert_allclose(result.log_forward[1], np.log(a), rtol=2 * ULP, atol=1e-300)


def test_native_wrong_shapes_raise(baseline):
    """No kernel reads beyond the end of an array."""
    x, means, precision_cholesky = np.zeros((1, 5, 2)), np.zeros((1, 3, 2)), np.full((1, 3, 2, 2), np.eye(2))
    chain, no_turns = (np.zeros(3), np.zeros((3, 3)), np.zeros((3, 3))), np.array([], dtype=np.int64)
    for lengths in ([4], [6], [5, 0], [-1, 6], [2**62, 2**62]):
        with pytest.raises(ValueError, match="lengths"):
            baseline.e_step(x, np.array(lengths), *chain, means, precision_cholesky, no_turns, 1, np.zeros(3))
    with pytest.raises(ValueError, match="precision_cholesky has 2 entries along axis 1, expected 3"):
        baseline.log_emissions(x, means, precision_cholesky[:, :2], no_turns)
    for orientation_starts in ([0], [-1], [2**40]):
        with pytest.raises(ValueError, match="orientation_starts are not"):
            baseline.log_emissions(x, means, precision_cholesky, np.array(orientation_starts))
    with pytest.raises(ValueError, match="orientation_starts are not"):  # they overlap
        baseline.log_emissions(np.zeros((1, 5, 8)), np.zeros((1, 3, 8)), precision_cholesky, np.array([0, 3]))
    with pytest.raises(ValueError, match="threads is -1, expected"):
        baseline.e_step(x, np.array([5]), *chain, means, precision_cholesky, no_turns, -1, np.zeros(3))
    with pytest.raises(ValueError, match="log_segment_weights has 5 entries along axis 0, expected 4"):
        baseline.semi_markov_forward_backward(
            np.zeros((9, 3)), *chain[:2], np.zeros((5, 7, 3)), np.zeros((2, 3))
        )
    with pytest.raises(ValueError, match="second axis of log_segment_weights is empty"):
        baseline.semi_markov_viterbi(np.zeros((9, 3)), *chain[:2], np.zeros((4, 0, 3)), np.zeros((2, 3)))
    with pytest.raises(ValueError, match="transitions has 3 entries along axis 0, expected 4"):
        baseline.forward_backward(np.zeros((2, 4)), np.zeros(4), chain[1], np.zeros((4, 4)))
    with pytest.raises(ValueError, match="log_emissions is empty"):
        baseline.viterbi(np.zeros((0, 3)), np.zeros(3), chain[1])
    with pytest.raises(ValueError, match="A and B have neither"):
        baseline.riccati(
            np.zeros((2, 2, 2)), np.zeros((2, 2, 1)), np.zeros((9, 2, 2)), np.zeros((9, 2)), np.eye(1)
        )
    with pytest.raises(ValueError, match="counts has 4 entries"):
        baseline.semi_tied_sweeps(np.zeros((3, 2, 2)), np.zeros(4), np.eye(2), 1)
    with pytest.raises(ValueError, match="covariances has 4 entries along axis 2, expected 3"):
        baseline.precision_cholesky(np.zeros((2, 3, 4)))


def test_observe_inconsistent_state_raises(baseline, rng):
    """Rows, counts, counters, dimensions and parameters."""
    parameters = StreamParameters(40.0, 0.5, 0.1, 0.1, 90.0, 2.0, 0, 0.0, 0.0, 2, 4, 50, 1)
    x = np.ascontiguousarray(rng.normal(size=(30, 1, 5)))
    state = compiled_state(baseline, x, parameters)
    counters, rows, transition_counts, capacity = state

    def observe(
        counters=counters,
        rows=rows,
        transition_counts=transition_counts,
        capacity=capacity,
        numbers=parameters.packed,
    ):
        return baseline.observe(x, counters, rows, transition_counts, capacity, numbers)

    observe()
    for wrong, words in [
        ({"rows": rows[:, :-1].copy()}, "rows has"),
        ({"transition_counts": np.zeros((len(rows) + 1,) * 2)}, "transition_counts has"),
        ({"counters": np.array([float(len(rows)), 1, 9, 30, -1, 0])}, "counters name a cluster"),
        ({"counters": np.array([np.nan, 1, 9, 30, -1, 0])}, "counters name a cluster"),
        ({"counters": np.array([0.0, 1, 9, 30, len(rows), 1])}, "counters name a cluster"),
        ({"counters": np.zeros(3)}, "counters has 3 entries"),
        ({"capacity": 3}, "capacity is not a multiple of 4"),
        ({"capacity": -4}, "capacity is not a multiple of 4"),
        ({"capacity": 400}, "capacity is not a multiple of 4"),
        ({"numbers": parameters.packed[:-1].copy()}, "parameters has 12 entries"),
        ({"numbers": np.where(np.arange(13) == 12, 0.0, parameters.packed)}, "batch"),
    ]:
        with pytest.raises(ValueError, match=words):
            observe(**wrong)
    for place, value in [(9, 3.0), (9, -1.0), (9, np.nan), (10, 6.0), (10, np.nan)]:
        broken = rows.copy()
        broken[0, place] = value
        broken[0, 10] = 0.0 if place == 9 else broken[0, 10]
        with pytest.raises(ValueError, match="out of range"):
            observe(rows=broken)
    for cluster_id in (-1e300, 2.0**54, 0.5, np.nan):
        broken = rows.copy()
        broken[0, 0] = cluster_id
        with pytest.raises(ValueError, match="identifier of a cluster"):
            observe(rows=broken)


def compiled_state(module, x, parameters):
    """Return counters, rows, transition counts and capacity after the datapoints."""
    empty = StreamState.empty(*x.shape[1:])
    _, *state = module.observe(x, empty.counters, empty.rows, empty.transition_counts, 0, parameters.packed)
    return state[:4]
