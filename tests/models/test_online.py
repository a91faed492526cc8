"""Online learning: assignments, transitions, durations and skills of the four learners."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import pilotfish as pf
from pilotfish.demonstrations import Demonstration, pose_layout, position_layout
from pilotfish.errors import InvalidInput
from pilotfish.io.synthetic import synthetic_valve
from pilotfish.kernels import Assignments
from pilotfish.models import (
    MixtureWeights,
    SemiMarkovChain,
    normalised_mutual_information,
    online,
    state_segments,
)
from pilotfish.models.online import DPGMM, DPMPPCA, HDPHSMM, SOSC, Maintenance

PLAIN = position_layout(3)
SETTINGS = SOSC(cluster=25.0, dimension=0.3, noise=0.05, bandwidth=60.0, transition=0.05, new_transition=0.1)
ALL_SETTINGS = [
    DPGMM(cluster=25.0, noise=0.05),
    DPMPPCA(cluster=25.0, dimension=0.3, noise=0.05, bandwidth=60.0),
    HDPHSMM(cluster=25.0, noise=0.05, transition=0.05, new_transition=0.1),
    SETTINGS,
]


def empty_model(settings=SETTINGS, layout=PLAIN, frames=("world",)):
    return online.online_model(settings, layout, 0.1, frames)


def cycle(rng, N=1200, K=4, D=3, first=0):
    """Return datapoints of segments of 20 to 30 steps on K separated lines in turn, and the line of each."""
    centres = (
        12.0 * np.eye(K, D)
        if D >= K
        else 12.0 * np.stack([np.cos(np.arange(K)), np.sin(np.arange(K)), np.arange(K)], axis=1)
    )
    axes = rng.normal(size=(K, D))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    states = np.concatenate([np.full(rng.integers(20, 31), (first + v) % K) for v in range(N)])[:N]
    x = centres[states] + rng.normal(size=(N, 1)) * axes[states] + 0.1 * rng.normal(size=(N, D))
    return x, states


def model_bytes(model):
    state = model.state
    return [array.tobytes() for array in (state.counters, state.rows, state.transition_counts)]


@pytest.mark.parametrize("settings", ALL_SETTINGS, ids=lambda s: type(s).__name__)
def test_observe_stream_separated_clusters_finds_four(rng, settings):
    """Four lines give four clusters; learners with subspaces find dimension 1, spheres have 0."""
    x, states = cycle(rng)
    model, assignments = online.observe_stream(empty_model(settings), x)
    assert model.clusters == 4
    assert normalised_mutual_information(assignments.current_cluster_ids(), states) > 0.99
    line = isinstance(settings, DPMPPCA | SOSC)
    np.testing.assert_array_equal(model.dimensions, np.full((4, 1), int(line)))
    np.testing.assert_allclose(model.priors, np.bincount(states) / len(states), atol=0.02)


def test_observe_stream_special_case_equals_general_learner(rng):
    """A dimension penalty that no direction pays gives spheres; transition penalties of 0 a mixture."""
    x, _ = cycle(rng, N=400)
    costly = 1e6  # no dimension explains so much
    for special, general in [
        (DPGMM(25.0, 0.05), DPMPPCA(25.0, costly, 0.05, 60.0)),
        (DPMPPCA(25.0, 0.3, 0.05, 60.0), SOSC(25.0, 0.3, 0.05, 60.0)),
        (HDPHSMM(25.0, 0.05, 0.05, 0.1), SOSC(25.0, costly, 0.05, 60.0, 0.05, 0.1)),
    ]:
        one, assignments_one = online.observe_stream(empty_model(special), x)
        other, assignments_other = online.observe_stream(empty_model(general), x)
        np.testing.assert_array_equal(assignments_one.cluster_ids, assignments_other.cluster_ids)
        np.testing.assert_allclose(assignments_one.costs, assignments_other.costs, atol=1e-9)
        np.testing.assert_allclose(one.means, other.means, atol=1e-9)


def test_observe_repeated_equals_observe_stream(rng):
    """Models and assignments are equal to the last bit, and the argument is not modified."""
    x, _ = cycle(rng, N=150)
    whole, assignments = online.observe_stream(empty_model(), x)
    model, one_by_one = empty_model(), []
    before = model_bytes(model)
    for row in x:
        model, *assignment = online.observe(model, row)
        one_by_one.append(assignment)
    assert model_bytes(model) == model_bytes(whole)
    cluster_ids, costs, loss_changes = map(list, zip(*one_by_one, strict=True))
    assert cluster_ids == assignments.cluster_ids.tolist()
    assert costs == assignments.costs.tolist()
    assert loss_changes == assignments.loss_changes.tolist()
    assert model_bytes(empty_model()) == before


def test_observe_stream_same_state_and_data_gives_same_bytes(rng):
    """The state determines the result."""
    x, _ = cycle(rng, N=300)
    half, _ = online.observe_stream(empty_model(), x[:140])
    once, _ = online.observe_stream(half, x[140:])
    again, _ = online.observe_stream(half, x[140:])
    assert model_bytes(once) == model_bytes(again)


def test_observe_cost_equals_definition(rng):
    """Squared distance outside the subspace plus the penalty of the transition."""
    x, _ = cycle(rng, N=500)
    model, _ = online.observe_stream(empty_model(), x)
    point = x[0] + 0.1
    costs = []
    counts = model.transition_counts[model.current_cluster]
    for k in range(model.clusters):
        e = point - model.means[k, 0]
        U = model.state.bases[k, 0][:, : model.dimensions[k, 0]]
        rho = np.exp(-(e @ e) / SETTINGS.bandwidth)
        square = np.sum((e - rho * U @ U.T @ e) ** 2)
        surprise = (
            -np.log(counts[k] / counts.sum())
            if counts[k] > 0
            else np.log(counts.sum() + 1.0) + SETTINGS.new_transition / SETTINGS.transition
        )
        costs.append(square + SETTINGS.transition * surprise)
    _, cluster_id, cost, _ = online.observe(model, point)
    np.testing.assert_allclose(cost, min(costs), rtol=1e-9)
    assert cluster_id == model.cluster_ids[np.argmin(costs)]


def test_to_skill_transitions_and_durations_equal_enumeration(rng):
    """Counted from the assignments; the last segment of a demonstration is censored."""
    parts = [cycle(rng, N=n, first=first)[0] for n, first in ((330, 0), (410, 1), (250, 2))]
    model, sequences = empty_model(), []
    for part in parts:
        model, assignments = online.observe_stream(online.begin_demonstration(model), part)
        sequences.append(assignments.cluster_ids)
        assert not len(assignments.removed)
    K = model.clusters
    places = {cluster_id: k for k, cluster_id in enumerate(model.cluster_ids.tolist())}
    counts, lengths, starts = np.zeros((K, K)), {k: [] for k in range(K)}, np.zeros(K)
    for sequence in sequences:
        states = np.array([places[i] for i in sequence.tolist()])
        starts[states[0]] += 1
        np.add.at(counts, (states[:-1], states[1:]), 1.0)
        segment_states, steps = state_segments(states)
        for k, n in zip(segment_states[:-1], steps[:-1], strict=True):
            lengths[int(k)].append(int(n))
    np.testing.assert_array_equal(model.transition_counts, counts)
    assert model.demonstrations == 3
    chain = online.to_skill(model).dynamics
    assert isinstance(chain, SemiMarkovChain)
    np.testing.assert_allclose(chain.initial, starts / 3)
    np.testing.assert_allclose(chain.durations.means, [np.mean(lengths[k]) for k in range(K)])
    floor = [np.sqrt(np.var(lengths[k], ddof=1) + 1.0) for k in range(K)]
    np.testing.assert_allclose(chain.durations.deviations, floor)
    leaving_counts = counts * (1 - np.eye(K))
    np.testing.assert_allclose(chain.transitions, leaving_counts / leaving_counts.sum(axis=1, keepdims=True))


def test_observe_stream_immediate_merge_keeps_segment_whole(rng):
    """Durations are those of the labels after merging, and self-transitions are excluded."""
    durations = rng.integers(20, 31, size=40)
    states = np.repeat(np.arange(40) % 3, durations)
    x = 60.0 * np.eye(3)[states] + rng.normal(size=(len(states), 3))
    settings = SOSC(4.0, 0.3, 0.05, 60.0, maintenance=Maintenance(merge_distance=15.0))
    model, assignments = online.observe_stream(empty_model(settings), x)
    assert model.clusters == 3
    assert len(assignments.removed) > 3
    assert assignments.cluster_ids.max() > 5
    segment_states, steps = state_segments(assignments.current_cluster_ids())
    for k, cluster_id in enumerate(model.cluster_ids):
        lengths = steps[:-1][segment_states[:-1] == cluster_id]
        assert model.state.segments[k] == len(lengths)
        np.testing.assert_allclose(model.state.mean_durations[k], lengths.mean())
        np.testing.assert_allclose(model.state.squared_deviations[k], len(lengths) * lengths.var(), atol=1e-8)
    np.testing.assert_allclose(online.to_skill(model).dynamics.transitions.max(axis=1), 1.0)


def test_begin_demonstration_adds_no_transition(rng):
    """No count leads from the last state of one demonstration to the first of the next."""
    x, states = cycle(rng, N=25)
    assert len(np.unique(states[:20])) == 1
    model, _ = online.observe_stream(empty_model(), x[:20])
    model, _ = online.observe_stream(online.begin_demonstration(model), x[:20])
    assert model.transition_counts.sum() == 2 * 19
    assert model_bytes(online.begin_demonstration(empty_model())) == model_bytes(empty_model())


@pytest.mark.parametrize("settings", ALL_SETTINGS, ids=lambda s: type(s).__name__)
def test_to_skill_covariances_equal_definition(rng, settings):
    """Covariances are U diag U^T + sigma^2 I; a skill with dynamics can be adapted and planned."""
    x, _ = cycle(rng, N=600)
    model, _ = online.observe_stream(empty_model(settings), x)
    skill = online.to_skill(model)
    for k in range(model.clusters):
        d = model.dimensions[k, 0]
        U, v = model.state.bases[k, 0][:, :d], model.state.variances[k, 0][:d]
        np.testing.assert_allclose(
            skill.covariances[0].dense[k], U @ np.diag(v) @ U.T + 0.05 * np.eye(3), atol=1e-12
        )
    assert isinstance(
        skill.dynamics, MixtureWeights if isinstance(settings, DPGMM | DPMPPCA) else SemiMarkovChain
    )
    if isinstance(skill.dynamics, SemiMarkovChain):
        adapted = pf.adapt(skill, [pf.Frame("world", np.eye(3), np.zeros(3))])
        reference = pf.plan(adapted, x[0], horizon=60)
        assert np.isfinite(reference.targets).all()


def test_observe_stream_two_frames_have_separate_subspaces(rng):
    """The cost is the sum over frames; each frame has its own mean and dimension."""
    x, states = cycle(rng, N=800)
    views = np.stack([x, x[:, ::-1] * 0.0 + 0.05 * rng.normal(size=x.shape)], axis=1)
    model, assignments = online.observe_stream(empty_model(frames=("object", "hand")), views)
    assert normalised_mutual_information(assignments.current_cluster_ids(), states) > 0.99
    np.testing.assert_array_equal(model.dimensions, [[1, 0]] * 4)
    skill = online.to_skill(model)
    assert skill.means.shape == (2, 4, 3)
    frames = [pf.Frame(name, np.eye(3), np.zeros(3)) for name in ("object", "hand")]
    assert np.isfinite(pf.adapt(skill, frames).means).all()


def test_observe_stream_equal_frames_double_the_cost(rng):
    """Two equal views with twice the penalty give the same assignments."""
    x, _ = cycle(rng, N=300)
    single, one = online.observe_stream(empty_model(SOSC(25.0, 0.3, 0.05, 60.0)), x)
    double = SOSC(50.0, 0.3, 0.05, 60.0)
    _, two = online.observe_stream(empty_model(double, frames=("a", "b")), np.stack([x, x], axis=1))
    np.testing.assert_array_equal(one.cluster_ids, two.cluster_ids)
    np.testing.assert_allclose(2.0 * one.costs, two.costs)
    assert single.clusters == 4


def test_observe_stream_shuffled_batch_gives_same_clusters(rng):
    """Within a batch, the order of datapoints does not matter."""
    x, _ = cycle(rng, N=400)
    maintenance = Maintenance(batch=100, extra_directions=3)
    model, _ = online.observe_stream(empty_model(DPMPPCA(25.0, 0.3, 0.05, 60.0, maintenance)), x[:300])
    straight, assignments = online.observe_stream(model, x[300:])
    order = rng.permutation(100)
    shuffled, other = online.observe_stream(model, x[300:][order])
    np.testing.assert_array_equal(assignments.cluster_ids[order], other.cluster_ids)
    np.testing.assert_allclose(straight.means, shuffled.means, atol=1e-9)
    np.testing.assert_allclose(straight.state.variances, shuffled.state.variances, atol=1e-9)


def test_observe_stream_max_clusters_removes_lightest(rng):
    """Removed clusters are reported, and the stream continues."""
    x = rng.normal(scale=100.0, size=(200, 3))
    model, assignments = online.observe_stream(
        empty_model(replace(SETTINGS, maintenance=Maintenance(max_clusters=5))), x
    )
    assert model.clusters == 5
    assert (assignments.removed[:, 2] == -1).all()
    assert len(np.unique(assignments.cluster_ids)) == 5 + len(assignments.removed)


def test_observe_stream_decayed_weight_removes_cluster(rng):
    """A cluster is removed at the step at which its weight falls below the limit."""
    far = np.full((10, 3), 50.0) + 0.01 * rng.normal(size=(10, 3))
    near = 0.1 * rng.normal(size=(400, 3))
    settings = replace(SETTINGS, maintenance=Maintenance(discount=0.99, forget_below=0.3))
    model, _ = online.observe_stream(empty_model(settings), far)
    w = model.weights[0]
    left = int(np.ceil(np.log(0.3 / w) / np.log(0.99)))
    model, _ = online.observe_stream(model, near[: left - 1])
    assert model.clusters == 2
    model, assignments = online.observe_stream(model, near[left - 1 : left])
    assert model.clusters == 1
    assert assignments.removed.tolist() == [[0, 0, -1]]


def test_observe_stream_merged_clusters_keep_one_identifier(rng):
    """Labels follow merges."""
    first, second = rng.normal(size=(2, 60, 3)) * 0.05
    second[:, 0] += 5.5
    bridge = np.stack([np.linspace(5.5, 0.0, 4000)[:, None] * [1.0, 0.0, 0.0]], axis=0)[0]
    settings = DPGMM(25.0, 0.05, Maintenance(constant_weight=20.0, merge_distance=2.0))
    model, assignments = online.observe_stream(empty_model(settings), np.concatenate([first, second, bridge]))
    assert model.clusters == 1
    assert assignments.removed[:, 1:].tolist() in ([[1, 0]], [[0, 1]])
    assert set(assignments.current_cluster_ids().tolist()) == set(model.cluster_ids.tolist())


def test_current_cluster_ids_chained_merges_are_followed():
    """2 merges into 1 and then 1 into 0; a forgotten cluster keeps its identifier."""
    assignments = Assignments(
        np.array([0, 1, 2, 3]), np.zeros(4), np.zeros(4), np.array([[1, 2, 1], [2, 1, 0], [3, 3, -1]])
    )
    assert assignments.current_cluster_ids().tolist() == [0, 0, 0, 3]


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e101])
def test_observe_invalid_value_leaves_model_unchanged(rng, bad):
    """The message names the column and the frame."""
    model, _ = online.observe_stream(empty_model(), cycle(rng, N=50)[0])
    before = model_bytes(model)
    row = np.zeros(3)
    row[1] = bad
    with pytest.raises(InvalidInput, match=r"datapoint 0 .* 'position y' in frame 'world'"):
        online.observe(model, row)
    with pytest.raises(InvalidInput, match=r"datapoint 2 .* 'position y'"):
        online.observe_stream(model, np.stack([np.zeros(3), np.zeros(3), row]))
    assert model_bytes(model) == before


@pytest.mark.parametrize(
    ("x", "words"),
    [
        (np.zeros(2), r"shape \(2,\), expected \(3,\): position x, position y, position z"),
        (np.zeros((2, 3)), r"shape \(2, 3\)"),
    ],
)
def test_observe_wrong_shape_is_refused(x, words):
    with pytest.raises(InvalidInput, match=words):
        online.observe(empty_model(), x)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: SOSC(0.0, 1.0, 1.0, 1.0), "cluster is 0.0, expected more than 0"),
        (lambda: SOSC(1.0, 1.0, np.nan, 1.0), "noise is nan"),
        (lambda: SOSC(1.0, 1.0, 1.0, 1.0, transition=-1.0), "transition is -1.0, expected 0 or more"),
        (lambda: Maintenance(discount=1.0), "discount is 1.0"),
        (lambda: Maintenance(discount=0.9, forget_below=1.0), "forget_below"),
        (lambda: Maintenance(forget_below=0.3), "without a discount"),
        (lambda: Maintenance(discount=0.9, constant_weight=2.0), "expected at most one of them"),
        (lambda: Maintenance(constant_weight=0.0), "constant_weight is 0.0"),
        (lambda: Maintenance(batch=0), "batch is 0, expected a whole number from 1 to 100000"),
        (lambda: Maintenance(merge_distance=-1.0), "merge_distance is -1.0"),
        (lambda: online.online_model(SETTINGS, PLAIN, 0.0), "period is 0.0, expected"),
        (lambda: online.online_model(SETTINGS, PLAIN, 0.1, ("a", "a")), "no duplicates"),
        (lambda: online.to_skill(empty_model()), "no datapoint"),
    ],
)
def test_online_settings_invalid_value_is_refused(make, words):
    with pytest.raises(InvalidInput, match=words):
        make()


def test_online_model_orientations_on_s3_are_refused(rng):
    layout = pf.demonstrations.to_sphere(synthetic_valve(rng)[0]).layout
    with pytest.raises(InvalidInput, match="without on_sphere"):
        empty_model(layout=layout)


def test_observe_demonstration_negated_quaternions_give_same_means(rng):
    """Q and -q are the same orientation."""
    first, second, *_ = synthetic_valve(rng)
    layout = first.layout
    signs = np.ones(layout.width)
    for part, columns in zip(layout.parts, layout.slices, strict=True):
        if part.name == "orientation":
            signs[columns] = -1.0
    turned = replace(second, x=signs * second.x)
    settings = SOSC(0.3, 0.006, 0.001, 8.0)
    frames = tuple(frame.name for frame in first.frames)
    model = online.online_model(settings, layout, first.period, frames)
    model, _ = online.observe_demonstration(model, first)
    one, _ = online.observe_demonstration(model, second)
    other, _ = online.observe_demonstration(model, turned)
    np.testing.assert_allclose(one.means, other.means, atol=1e-12)


def test_observe_demonstration_incompatible_is_refused(rng):
    first, *_ = synthetic_valve(rng)
    model = online.online_model(SETTINGS, first.layout, first.period, ("valve before", "valve after"))
    for other, words in [
        (replace(first, period=0.2), "period"),
        (Demonstration(first.x[:, :7], 0.1, pose_layout(), first.frames, "short"), "layout"),
        (replace(first, frames=first.frames[:1]), "frames"),
    ]:
        with pytest.raises(InvalidInput, match=words):
            online.observe_demonstration(model, other)


@given(st.integers(0, 2**32 - 1), st.sampled_from(ALL_SETTINGS), st.floats(0.01, 100.0), st.integers(1, 6))
def test_observe_stream_any_data_loss_never_increases(seed, settings, scale, extra_directions):
    """No update increases the loss at its datapoint, beyond rounding."""
    rng = np.random.default_rng(seed)
    x = scale * np.cumsum(rng.normal(size=(120, 3)) * rng.choice([0.0, 0.1, 3.0], size=(120, 1)), axis=0)
    settings = replace(settings, maintenance=Maintenance(extra_directions=extra_directions))
    _, assignments = online.observe_stream(empty_model(settings), x)
    assert assignments.loss_changes.max() <= 1e-9 * max(1.0, float(np.abs(x).max()) ** 2)
