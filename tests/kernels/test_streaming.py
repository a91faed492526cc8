"""Online clustering: compiled kernel against the reference, and both against their derivation."""

from dataclasses import replace

import numpy as np
import pytest

from pilotfish.errors import InvalidInput
from pilotfish.kernels import (
    StreamParameters,
    StreamState,
    Weighting,
    reference,
    zero_arrays,
)
from pilotfish.kernels.stream_state import STATISTICS

PARAMETERS = StreamParameters(
    cluster=9.0,
    dimension=0.3,
    transition=0.05,
    new_transition=0.1,
    bandwidth=60.0,
    merge_distance=2.0,
    weighting=int(Weighting.COUNT),
    weight=0.0,
    forget_below=0.0,
    extra_directions=1,
    max_dimension=100,
    max_clusters=100,
    batch=1,
)
VARIANTS = {
    "counting": PARAMETERS,
    "spheres": replace(PARAMETERS, max_dimension=0, extra_directions=0),
    "traces": replace(PARAMETERS, weighting=int(Weighting.EXPONENTIAL_DECAY), weight=0.98),
    "forgetting": replace(
        PARAMETERS, weighting=int(Weighting.EXPONENTIAL_DECAY), weight=0.95, forget_below=0.3
    ),
    "constant": replace(PARAMETERS, weighting=int(Weighting.CONSTANT), weight=20.0),
    "untruncated": replace(PARAMETERS, extra_directions=100),
    "no spare": replace(PARAMETERS, extra_directions=0),
    "few clusters": replace(PARAMETERS, max_clusters=3, cluster=2.0, merge_distance=0.0),
    "batches": replace(PARAMETERS, batch=7),
    "batches, few clusters": replace(PARAMETERS, batch=50, max_clusters=2, cluster=2.0, merge_distance=0.5),
}


def blobs(rng, N, P, D, K=4, spread=6.0):
    """Return segments of about ten datapoints in K random subspaces, in P frames."""
    centres = spread * rng.normal(size=(K, P, D)) / np.sqrt(D)
    axes = rng.normal(size=(K, P, D, max(1, D // 2))) / np.sqrt(D)
    states = np.repeat(rng.integers(K, size=N // 10 + 1), 10)[:N]
    factors = rng.normal(size=(N, max(1, D // 2)))
    return (
        centres[states] + np.einsum("npdf,nf->npd", axes[states], factors) + 0.1 * rng.normal(size=(N, P, D))
    )


def covariances(state: StreamState):
    """Return the covariances (K, P, D, D)."""
    return np.einsum("kpdc,kpc,kpec->kpde", state.bases, state.variances, state.bases)


def drift(state: StreamState):
    """Return the deviation of the directions from orthonormality."""
    U, C = state.bases, state.capacity
    stored = np.arange(C) < state.ranks[..., None]
    return np.abs(np.einsum("kpdc,kpde->kpce", U, U) - stored[..., None] * np.eye(C)).max(initial=0.0)


def assert_same(first, second, atol=1e-9):
    (a, assignments), (b, expected_assignments) = first, second
    np.testing.assert_array_equal(assignments.cluster_ids, expected_assignments.cluster_ids)
    np.testing.assert_array_equal(assignments.removed, expected_assignments.removed)
    np.testing.assert_allclose(assignments.costs, expected_assignments.costs, rtol=1e-9, atol=atol)
    np.testing.assert_allclose(
        assignments.loss_changes, expected_assignments.loss_changes, rtol=1e-9, atol=atol
    )
    assert (a.frames, a.width, a.capacity) == (b.frames, b.width, b.capacity)
    np.testing.assert_allclose(a.counters, b.counters)
    np.testing.assert_allclose(a.transition_counts, b.transition_counts)
    for name in STATISTICS:
        np.testing.assert_allclose(getattr(a, name), getattr(b, name), rtol=1e-10, err_msg=name)
    np.testing.assert_array_equal(a.dimensions, b.dimensions)
    np.testing.assert_array_equal(a.ranks, b.ranks)
    np.testing.assert_allclose(a.means, b.means, atol=atol)
    np.testing.assert_allclose(covariances(a), covariances(b), atol=atol)
    np.testing.assert_allclose(a.distances, b.distances, atol=atol)


@pytest.mark.parametrize("shape", [(1, 1), (1, 3), (2, 5), (1, 14), (3, 2), (1, 30)], ids=str)
@pytest.mark.parametrize("variant", VARIANTS)
def test_observe_compiled_equals_reference(compiled, rng, variant, shape):
    """Assignments, merges and states, for every weighting, number of frames and width."""
    x = blobs(rng, 160, *shape)
    parameters, state = VARIANTS[variant], StreamState.empty(*shape)
    assert_same(compiled.observe(x, state, parameters), reference.observe(x, state, parameters))


def test_observe_state_of_other_implementation_continues(compiled, rng):
    x = blobs(rng, 200, 2, 5)
    for first, second in [(compiled, reference), (reference, compiled)]:
        state = first.observe(x[:120], StreamState.empty(2, 5), PARAMETERS)[0]
        assert_same(first.observe(x[120:], state, PARAMETERS), second.observe(x[120:], state, PARAMETERS))


@pytest.mark.parametrize("kernel", ["compiled", "reference"])
@pytest.mark.parametrize("variant", [name for name in VARIANTS if "batches" not in name])
def test_observe_stream_in_parts_gives_same_bits(request, rng, kernel, variant):
    """One by one, in parts or whole."""
    observe = request.getfixturevalue("compiled").observe if kernel == "compiled" else reference.observe
    x, parameters = blobs(rng, 90, 2, 4), VARIANTS[variant]
    whole, assignments = observe(x, StreamState.empty(2, 4), parameters)
    state = StreamState.empty(2, 4)
    cluster_ids = []
    for piece in [*np.split(x[:20], 20), *np.split(x[20:], np.sort(rng.integers(70, size=3)))]:
        state, step = observe(piece, state, parameters)
        cluster_ids += step.cluster_ids.tolist()
    assert cluster_ids == assignments.cluster_ids.tolist()
    for name in ("counters", "rows", "transition_counts"):
        assert getattr(state, name).tobytes() == getattr(whole, name).tobytes()


@pytest.mark.parametrize("D", [1, 2, 3, 7, 20])
def test_observe_without_truncation_equals_batch_moments(compiled, rng, D):
    """Mean and covariance to 1e-10, also far from the origin."""
    x = 100.0 + rng.normal(size=(400, 1, D)) @ rng.normal(size=(D, D))
    parameters = replace(PARAMETERS, cluster=1e9, extra_directions=D, merge_distance=0.0)
    for kernel in (compiled, reference):
        state = kernel.observe(x, StreamState.empty(1, D), parameters)[0]
        assert state.clusters == 1
        np.testing.assert_allclose(state.means[0, 0], x[:, 0].mean(axis=0), rtol=0, atol=1e-10)
        expected = np.cov(x[:, 0].T, bias=True).reshape(D, D)
        np.testing.assert_allclose(covariances(state)[0, 0], expected, rtol=0, atol=1e-10)


def test_observe_merged_clusters_have_pooled_moments(compiled, rng):
    """Mean, covariance and weight to 1e-10."""
    x = rng.normal(size=(60, 1, 4)) * 0.2
    x[:30] -= 1.0
    x[30:] += 1.0
    parameters = replace(
        PARAMETERS, cluster=4.5, extra_directions=4, merge_distance=0.0, transition=0.0, new_transition=0.0
    )
    bridge = np.zeros((1, 1, 4))
    for kernel in (compiled, reference):
        apart = kernel.observe(x, StreamState.empty(1, 4), parameters)[0]
        assert apart.clusters == 2
        merging = replace(parameters, merge_distance=100.0, cluster=1e9)
        merged, assignments = kernel.observe(bridge, apart, merging)
        every = np.concatenate([x, bridge])[:, 0]
        assert merged.weights.tolist() == merged.points.tolist() == [61.0]
        np.testing.assert_allclose(merged.means[0, 0], every.mean(axis=0), atol=1e-10)
        np.testing.assert_allclose(covariances(merged)[0, 0], np.cov(every.T, bias=True), atol=1e-10)
        assert assignments.removed.shape == (1, 3)


@pytest.mark.parametrize("variant", [name for name in VARIANTS if "batches" not in name])
def test_observe_loss_at_datapoint_never_rises(compiled, rng, variant):
    """Assignment, update and choice of the dimension (5.35)."""
    x = blobs(rng, 2000, 2, 6)
    loss_changes = compiled.observe(x, StreamState.empty(2, 6), VARIANTS[variant])[1].loss_changes
    assert loss_changes.max() <= 1e-12
    assert loss_changes.min() < -1e-3


def test_observe_million_updates_keep_directions_orthonormal(compiled):
    """Below 1e-8, of few directions and of all."""
    rng = np.random.default_rng(0)
    x = rng.normal(size=(1_000_000, 1, 6)) @ np.diag([3.0, 2.0, 1.0, 0.3, 1e-3, 1e-6])
    for extra_directions in (1, 6):
        parameters = replace(
            PARAMETERS, cluster=1e9, extra_directions=extra_directions, dimension=0.05, bandwidth=1e6
        )
        assert drift(compiled.observe(x, StreamState.empty(1, 6), parameters)[0]) < 1e-8


def test_observe_drifted_directions_become_orthonormal(compiled, rng):
    """Directions off by 1e-4 are orthonormal within 256 datapoints."""
    parameters = replace(PARAMETERS, cluster=1e9)
    state = reference.observe(blobs(rng, 300, 1, 5, K=1), StreamState.empty(1, 5), parameters)[0]
    bent = replace(state, rows=state.rows.copy())
    bent.bases[:] += 1e-4 * rng.normal(size=bent.bases.shape) * (bent.bases != 0.0)
    assert drift(bent) > 1e-5
    for kernel in (compiled, reference):
        assert drift(kernel.observe(blobs(rng, 300, 1, 5, K=1), bent, parameters)[0]) < 1e-8


@pytest.mark.parametrize(
    "x",
    [
        np.zeros((50, 1, 3)),
        np.full((50, 1, 3), 1e100),
        np.full((50, 1, 1), -7.0),
        np.concatenate([np.zeros((5, 1, 3)), np.full((1, 1, 3), 1e12), np.zeros((5, 1, 3))]),
        np.zeros((1, 1, 3)),
        np.repeat(np.arange(3.0), 4).reshape(-1, 1, 1),
        1e-200 * np.arange(30.0).reshape(10, 1, 3),
    ],
    ids=["zeros", "huge", "one column", "a jump", "one datapoint", "repeated", "tiny"],
)
def test_observe_degenerate_streams_give_finite_states(compiled, x):
    """Constant, huge, tiny, repeated and single datapoints."""
    for parameters in VARIANTS.values():
        state = StreamState.empty(*x.shape[1:])
        after, step = compiled.observe(x, state, parameters)
        for values in (after.rows, after.transition_counts, step.costs, step.loss_changes):
            assert np.isfinite(values).all()
        np.testing.assert_array_equal(
            step.cluster_ids, reference.observe(x, state, parameters)[1].cluster_ids
        )


def test_observe_jump_of_1e12_creates_a_cluster(compiled, rng):
    """Existing clusters do not change, and the stream continues in them."""
    x = blobs(rng, 100, 1, 3, K=2)
    before, assignments = compiled.observe(x, StreamState.empty(1, 3), PARAMETERS)
    after, _ = compiled.observe(np.full((1, 1, 3), 1e12), before, PARAMETERS)
    assert after.clusters == before.clusters + 1
    np.testing.assert_array_equal(after.means[:-1], before.means)
    _, last = compiled.observe(x[-1:], after, PARAMETERS)
    assert last.cluster_ids[0] == assignments.cluster_ids[-1]


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1.1e100])
def test_observe_not_finite_datapoint_raises_with_index(compiled, rng, bad):
    """Arguments are not changed."""
    x = blobs(rng, 20, 2, 3)
    state = compiled.observe(x, StreamState.empty(2, 3), PARAMETERS)[0]
    before = [array.tobytes() for array in (state.counters, state.rows, state.transition_counts)]
    x[7, 1, 2] = bad
    for kernel in (compiled, reference):
        with pytest.raises(InvalidInput, match="datapoint 7, frame 1, column 2"):
            kernel.observe(x, state, PARAMETERS)
    assert before == [array.tobytes() for array in (state.counters, state.rows, state.transition_counts)]


@pytest.mark.parametrize("cluster_id", [-1e300, 2.0**54, 0.5, np.nan])
def test_observe_impossible_cluster_id_raises(compiled, rng, cluster_id):
    """An identifier that no int64 holds would be cast to an arbitrary number."""
    x = blobs(rng, 20, 2, 3)
    state = compiled.observe(x, StreamState.empty(2, 3), PARAMETERS)[0]
    state.cluster_ids[0] = cluster_id
    for kernel in (compiled, reference):
        with pytest.raises(InvalidInput, match="identifier"):
            kernel.observe(x, state, PARAMETERS)


def test_observe_no_datapoints_returns_same_state(compiled):
    for kernel in (compiled, reference):
        state, assignments = kernel.observe(np.empty((0, 1, 3)), StreamState.empty(1, 3), PARAMETERS)
        assert len(assignments.cluster_ids) == state.clusters == 0


def test_observe_dimension_changes_only_if_loss_does_not_rise(compiled):
    """A weak direction stays while a datapoint is far along it."""
    parameters = replace(PARAMETERS, cluster=1e6, bandwidth=1e6)
    x = np.zeros((40, 1, 3))
    x[::2, 0, 0], x[1::2, 0, 0] = 3.0, -3.0
    state = reference.observe(x, StreamState.empty(1, 3), parameters)[0]
    state.dimensions[0, 0], state.ranks[0, 0] = 2, 2  # as if a second one had been worth it
    state.bases[0, 0, :, :2] = np.eye(3)[:, :2]
    state.variances[0, 0, :2] = [9.0, 0.01]
    state.distances[0, 0, :3] = [9.0, 0.01, 0.0]
    far, near = np.array([[[0.0, 2.0, 0.0]]]), np.array([[[0.0, 0.1, 0.0]]])
    for kernel in (compiled, reference):
        stays, goes = (kernel.observe(point, state, parameters) for point in (far, near))
        for (after, assignments), dimension in ((stays, 2), (goes, 1)):
            assert after.dimensions[0, 0] == dimension
            assert assignments.loss_changes[0] <= 0.0


def test_observe_one_update_equals_definition(compiled, rng):
    """The covariance becomes w / (w + 1) Sigma + w / (w + 1)^2 e e^T.

    Variances are equal, nearly equal, zero or 24 powers of ten apart; datapoints are in the subspace, beside
    it and at the mean. Directions stay orthonormal.
    """
    for _ in range(200):
        D = int(rng.integers(1, 25))
        r = int(rng.integers(0, D + 1))
        w = float(rng.choice([1.0, 5.0, 1e6]))
        near = rng.uniform(0.1, 2.0) * (1.0 + rng.choice([0.0, 1e-16, 1e-13, 1e-8]) * rng.normal(size=r))
        v = 10.0 ** rng.uniform(-16.0, 8.0, size=r) if rng.random() < 0.5 else near
        v[rng.integers(r + 1) :] *= rng.choice([0.0, 1.0])
        v = np.sort(v)[::-1]
        U = np.linalg.qr(rng.normal(size=(D, D)))[0][:, :r]
        e = U @ (np.sqrt(v) * rng.normal(size=r) * rng.choice([1.0, 0.0, 1e-8], size=r))
        e = e + rng.choice([0.0, 1e-9, 1.0, 1e4]) * rng.normal(size=D)
        arrays = zero_arrays(1, 1, D, r)
        arrays["weights"][0], arrays["points"][0], arrays["demonstration_starts"][0] = w, 5, 1
        arrays["transition_counts"][0, 0] = 4
        arrays["dimensions"][0, 0], arrays["ranks"][0, 0] = min(r, D - 1), r
        arrays["variances"][0, 0], arrays["bases"][0, 0] = v, U
        counters = StreamState.empty(1, D).to_counters()
        counters |= {"current_cluster": 0, "steps_in_cluster": 1, "next_cluster_id": 1, "datapoints": 5}
        state = StreamState.from_arrays(arrays, counters)
        parameters = replace(PARAMETERS, cluster=1e300, extra_directions=D, merge_distance=0.0)
        expected = w / (w + 1) * (U * v) @ U.T + w / (w + 1) ** 2 * np.outer(e, e)
        after = compiled.observe(e.reshape(1, 1, D), state, parameters)[0]
        close = 1e-13 * np.abs(expected).max()
        np.testing.assert_allclose(covariances(after)[0, 0], expected, rtol=0, atol=close)
        assert drift(after) < 1e-14
        assert (np.diff(after.variances[0, 0]) <= 0.0).all()
