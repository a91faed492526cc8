"""Durations, adaptation, likelihood and size of learned skills."""

from dataclasses import replace

import numpy as np
import pytest

from pilotfish.demonstrations import (
    Frame,
    Layout,
    MovingFrame,
    Part,
    Quantity,
    Views,
    demonstration,
    frame,
    position_layout,
    views,
)
from pilotfish.errors import InvalidInput
from pilotfish.gaussians import Gaussian, log_density, regress
from pilotfish.gaussians.structures import DenseCovariances, Full, SemiTied
from pilotfish.models import (
    DurationModel,
    HiddenModel,
    KMeans,
    MarkovChain,
    SemiMarkovChain,
    adapt,
    as_mixture,
    count_durations,
    learn,
    log_emissions,
    log_likelihood,
    log_state_likelihoods,
    semi_markov_parameter_count,
    state_segments,
    viterbi,
)


def test_state_segments_repeat_to_the_sequence(rng):
    states = rng.integers(0, 3, size=40)
    visited, lengths = state_segments(states)
    np.testing.assert_array_equal(np.repeat(visited, lengths), states)
    assert (np.diff(visited) != 0).all()


def test_durations_are_counted_within_each_demonstration(rng, make_demonstrations):
    """A visit that ends one demonstration is not joined to the first of the next (a fault of peers)."""
    demos = make_demonstrations(lengths=(40, 50, 45), stops=3)
    fit = learn(demos, states=3, rng=rng)
    paths = [viterbi(fit.markov_skill, d) for d in demos]
    for k in range(3):
        lengths = np.concatenate([state_segments(p)[1][state_segments(p)[0] == k] for p in paths])
        np.testing.assert_allclose(fit.skill.dynamics.durations.means[k], lengths.mean())
        np.testing.assert_allclose(fit.skill.dynamics.durations.deviations[k], np.sqrt(lengths.var() + 1.0))


def test_a_left_right_skill_ends_in_a_final_state_and_its_rows_sum_to_one(rng, make_demonstrations):
    chain = learn(make_demonstrations(stops=4), states=4, rng=rng).skill.dynamics
    np.testing.assert_allclose(chain.transitions.sum(axis=1), [1, 1, 1, 0])
    np.testing.assert_array_equal(np.diag(chain.transitions), 0.0)


def test_a_known_chain_is_recovered_from_its_own_samples(rng):
    """Two places visited in turn for 8 and 20 steps: durations and transitions come back."""
    x = np.concatenate([np.repeat([[0.0], [1.0]], [8, 20], axis=0) for _ in range(12)])
    demo = demonstration(
        x + 0.01 * rng.normal(size=x.shape),
        0.1,
        Layout((Part("place", Quantity.SCALAR, 1, "m"),)),
        (),
        "to and fro",
    )
    fit = learn([demo], states=2, rng=rng, initialisation=KMeans(), dynamics="markov")
    chain = count_durations(fit.markov_skill, views([demo]), 1e-6)
    order = np.argsort(fit.markov_skill.means[0, :, 0])
    np.testing.assert_allclose(chain.durations.means[order], [8.0, 20.0])
    np.testing.assert_allclose(chain.transitions, [[0, 1], [1, 0]], atol=1e-12)


def test_learn_is_invariant_to_world_origin(rng, make_demonstrations):
    """Learning is blind to where the world's origin lies; the adapted skill moves with the frames."""
    demos = make_demonstrations(width=3)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    shift = rng.normal(size=3)

    def moved(frame):
        return Frame(frame.name, turn @ frame.A, turn @ frame.b + shift)

    there = [replace(d, x=d.x @ turn.T + shift, frames=tuple(map(moved, d.frames))) for d in demos]
    skill, same = (learn(ds, states=3, rng=rng).skill for ds in (demos, there))
    np.testing.assert_allclose(same.means, skill.means, atol=1e-8)
    here, elsewhere = adapt(skill, demos[0].frames), adapt(skill, there[0].frames)
    np.testing.assert_allclose(elsewhere.means, here.means @ turn.T + shift, atol=1e-8)
    np.testing.assert_allclose(elsewhere.covariances, turn @ here.covariances @ turn.T, atol=1e-9)


def test_adapted_gaussians_equal_product_of_frame_gaussians(rng, make_demonstrations):
    """Log N(x | adapted k) = sum over frames of log N(x | frame, k), up to a constant in x."""
    demos = make_demonstrations()
    skill = learn(demos, states=3, rng=rng).skill
    here, x = adapt(skill, demos[1].frames), rng.normal(size=(7, 2))
    seen = np.stack([np.linalg.solve(f.A, (x - f.b).T).T for f in demos[1].frames])
    gap = log_emissions(skill, Views(seen, np.array([7]))) - log_state_likelihoods(here, x)
    np.testing.assert_allclose(gap, np.broadcast_to(gap[0], gap.shape), atol=1e-8)


def test_one_frame_in_the_world_adapts_to_itself(rng, make_demonstrations):
    demos = [replace(d, frames=(Frame("world", np.eye(2), np.zeros(2)),)) for d in make_demonstrations()]
    skill = learn(demos, states=3, rng=rng).skill
    here = adapt(skill, demos[0].frames)
    np.testing.assert_allclose(here.means, skill.means[0])
    np.testing.assert_allclose(here.covariances, skill.covariances[0].dense)


def test_frames_may_come_in_any_order_but_must_be_the_right_ones(rng, make_demonstrations):
    demos = make_demonstrations()
    skill, (a, b) = learn(demos, states=2, rng=rng).skill, demos[0].frames
    np.testing.assert_array_equal(adapt(skill, [b, a]).means, adapt(skill, [a, b]).means)
    for wrong in ([a], [a, a], [a, b, b], [a, replace(b, name="cup")]):
        with pytest.raises(InvalidInput, match="object 1"):
            adapt(skill, wrong)
    with pytest.raises(InvalidInput, match="singular"):
        adapt(skill, [a, replace(b, A=np.zeros((2, 2)))])
    with pytest.raises(InvalidInput, match=r"b\[0\] is nan"):
        adapt(skill, [a, replace(b, b=np.array([np.nan, 0.0]))])
    with pytest.raises(InvalidInput, match=r"frame\.at"):
        adapt(skill, [a, MovingFrame(b.name, b.A[None], b.b[None])])
    with pytest.raises(InvalidInput, match="3 columns"):
        adapt(skill, [a, Frame(b.name, np.eye(3), np.zeros(3))])


def test_emissions_multiply_the_frames(rng, make_demonstrations):
    demos = make_demonstrations()
    skill = learn(demos, states=2, rng=rng, dynamics="mixture").skill
    data = views(demos[:1])
    for k in range(2):
        expected = sum(
            log_density(Gaussian(skill.means[p, k], skill.covariances[p].dense[k]), data.x[p])
            for p in range(2)
        )
        np.testing.assert_allclose(log_emissions(skill, data)[:, k], expected)


def test_counting_durations_needs_a_markov_skill(rng, make_demonstrations):
    """A semi-Markov skill has no steps from a state to itself; its Markov form is named."""
    demos = make_demonstrations()
    fit = learn(demos, states=2, rng=rng)
    assert isinstance(fit.skill.dynamics, SemiMarkovChain)
    assert isinstance(fit.markov_skill.dynamics, MarkovChain)
    with pytest.raises(InvalidInput, match=r"fit\.markov"):
        count_durations(fit.skill, views(demos), 1.0)


@pytest.mark.parametrize(
    ("structure", "states", "count"),
    [(Full(), 3, 372), (SemiTied(), 3, 295), (Full(), 4, 500), (SemiTied(), 4, 332)],
)
def test_whole_models_have_the_sizes_of_table_5_1(structure, states, count):
    """Tanwani 2018, table 5.1: D = 14, means + covariances + K^2 + 2 K."""
    assert semi_markov_parameter_count(structure, states, 14) == count


@pytest.mark.parametrize(("tying", "count"), [(0.0, 1470), (0.5, 1470), (1.0, 588)])
def test_valve_covariances_have_the_sizes_of_table_4_1(tying, count):
    assert 2 * SemiTied(tying).parameter_count(7, 14) == count


def test_provenance_says_what_was_learned_from(rng, make_demonstrations):
    demos = make_demonstrations()
    one, other = (learn(ds, states=2, rng=rng).skill.provenance for ds in (demos, demos[:2]))
    assert one.demonstrations == ("passage 0", "passage 1", "passage 2")
    assert one.datapoints == sum(len(d.x) for d in demos)
    assert one.data != other.data
    assert one.structure == "full"


def test_dense_and_structured_covariances_adapt_alike(rng, make_demonstrations):
    """Only .dense counts when a skill is adapted."""
    demos = make_demonstrations()
    skill = learn(demos, states=3, rng=rng, structure=SemiTied()).skill
    dense = replace(skill, covariances=tuple(DenseCovariances(c.dense) for c in skill.covariances))
    np.testing.assert_array_equal(adapt(dense, demos[0].frames).means, adapt(skill, demos[0].frames).means)


def test_a_mixture_skill_regresses_time_to_place(rng):
    """Time -> place learned from a ramp comes out as the ramp, with its slope as derivative."""
    t = np.linspace(0.0, 4.0, 200)
    x = np.stack([t, 3.0 * t + 0.01 * rng.normal(size=200)], axis=1)
    demo = demonstration(x, 0.02, Layout((Part("ramp", Quantity.SCALAR, 2, "1"),)))
    fit = learn([demo], states=4, rng=rng, dynamics="mixture")
    regression = regress(as_mixture(adapt(fit.skill, demo.frames)), np.array([0]), np.array([[1.0], [2.5]]))
    np.testing.assert_allclose(regression.means[:, 0], [3.0, 7.5], atol=0.05)
    np.testing.assert_allclose(regression.jacobians[:, 0, 0], 3.0, atol=0.2)
    with pytest.raises(InvalidInput, match='dynamics="mixture"'):
        as_mixture(adapt(learn([demo], states=2, rng=rng).skill, demo.frames))


def test_a_state_that_is_never_visited_lasts_as_long_as_it_would_stay(rng, make_demonstrations):
    """Viterbi may pass a state by; its duration is then that of its self-transition, 1 / (1 - a)."""
    demos = make_demonstrations(stops=2)
    model = learn(demos, states=2, rng=rng, dynamics="markov").markov_skill
    third = HiddenModel(
        MarkovChain(np.array([0.5, 0.5, 0.0]), np.array([[0.9, 0.1, 0], [0.1, 0.9, 0], [0.1, 0.1, 0.8]])),
        np.concatenate([model.means, model.means[:, :1] + 1e3], axis=1),
        tuple(DenseCovariances(np.concatenate([c.dense, np.eye(2)[None]])) for c in model.covariances),
    )
    durations = count_durations(third, views(demos), 1.0).durations
    np.testing.assert_allclose(durations.means[2], 5.0)
    np.testing.assert_allclose(durations.deviations[2], np.sqrt(5.0**2 + 1.0))


def test_the_fingerprint_is_that_of_values_frames_and_period(rng, make_demonstrations):
    """Anything that changes what is learned changes it; names do not."""
    demos = make_demonstrations()
    frame = demos[0].frames[0]

    def data(first):
        provenance = learn([first, *demos[1:]], states=2, rng=rng).skill.provenance
        return provenance.data

    moved = replace(demos[0], frames=(replace(frame, b=frame.b + 1.0), *demos[0].frames[1:]))
    assert len(data(demos[0])) == 64
    assert data(replace(demos[0], name="other")) == data(demos[0])
    assert data(moved) != data(demos[0])
    assert data(replace(demos[0], x=demos[0].x + 1e-12)) != data(demos[0])


def test_likelihood_and_paths_refuse_what_is_not_the_models(rng, make_demonstrations):
    """Another width, a fit instead of its skill, and lengths that are none are told, not met inside."""
    demos = make_demonstrations()
    fit = learn(demos, states=2, rng=rng)
    other = demonstration(rng.normal(size=(9, 3)), period=0.1, layout=position_layout())
    with pytest.raises(InvalidInput, match="1 frames of 3 columns, the model knows 2 of 2"):
        log_likelihood(fit.skill, [other])
    with pytest.raises(InvalidInput, match="the model knows 2 of 2"):
        viterbi(fit.skill, other)
    with pytest.raises(InvalidInput, match="longest is 0, expected"):
        log_likelihood(fit.skill, demos, max_duration=0)
    with pytest.raises(InvalidInput, match="longest is -1, expected"):
        DurationModel(max_duration=-1)


@pytest.mark.parametrize(
    ("A", "b"),
    [(1.0, 1e308), (1.0, 1e51), (1e308, 0.0), (1e21, 0.0), (1e-21, 0.0), (1e-200, 0.0), (np.nan, 0.0)],
)
def test_frame_whose_squares_overflow_is_refused_by_its_name(rng, make_demonstrations, A, b):
    """Where it is made, and where a skill is adapted to one that was made without check."""
    demos = make_demonstrations()
    skill, (one, other) = learn(demos, states=2, rng=rng).skill, demos[0].frames
    huge = Frame(other.name, A * np.eye(2), np.full(2, b))
    with pytest.raises(InvalidInput, match=r"^frame 'object 1': [Ab]"):
        adapt(skill, [one, huge])
    with pytest.raises(InvalidInput, match=r"^frame 'object 1': [Ab]"):
        frame(huge.name, huge.A, huge.b)


@pytest.mark.parametrize(("A", "b"), [(1e20, 1e49), (1e-19, 1e49), (1e10, 0.0)])
def test_skill_is_finite_in_the_largest_and_smallest_frames(rng, make_demonstrations, A, b):
    """Products of covariances over frames of very different size too."""
    demos = make_demonstrations()
    skill, (one, other) = learn(demos, states=2, rng=rng).skill, demos[0].frames
    adapted = adapt(skill, [one, frame(other.name, A * np.eye(2), np.full(2, b))])
    assert np.isfinite(adapted.means).all()
    assert np.isfinite(adapted.covariances).all()
