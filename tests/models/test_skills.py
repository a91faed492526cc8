"""Segments, adaptation, likelihood, parameter counts and provenance of skills."""

from dataclasses import replace

import numpy as np
import pytest
from published import published_options

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
from pilotfish.gaussians import Gaussian, log_density
from pilotfish.gaussians.structures import DenseCovariances, Full, SemiTied
from pilotfish.models import (
    DurationModel,
    HiddenModel,
    KMeans,
    MarkovChain,
    SemiMarkovChain,
    adapt,
    learn,
    log_emissions,
    log_likelihood,
    semi_markov_parameter_count,
    state_segments,
    viterbi,
)
from pilotfish.models.viterbi_durations import count_durations


def test_state_segments_repeat_to_the_sequence(rng):
    states = rng.integers(0, 3, size=40)
    segment_states, lengths = state_segments(states)
    np.testing.assert_array_equal(np.repeat(segment_states, lengths), states)
    assert (np.diff(segment_states) != 0).all()


def test_learn_counted_durations_do_not_join_demonstrations(rng, make_demonstrations):
    """The last segment of one demonstration is not joined to the first of the next."""
    demos = make_demonstrations(lengths=(40, 50, 45), stops=3)
    fit = learn(demos, states=3, rng=rng, **published_options())
    paths = [viterbi(fit.markov_skill, d) for d in demos]
    for k in range(3):
        lengths = np.concatenate([state_segments(p)[1][state_segments(p)[0] == k] for p in paths])
        np.testing.assert_allclose(fit.skill.dynamics.durations.means[k], lengths.mean())
        np.testing.assert_allclose(fit.skill.dynamics.durations.deviations[k], np.sqrt(lengths.var() + 1.0))


def test_learn_left_right_last_state_is_final(rng, make_demonstrations):
    chain = learn(make_demonstrations(stops=4), states=4, rng=rng).skill.dynamics
    np.testing.assert_allclose(chain.transitions.sum(axis=1), [1, 1, 1, 0])
    np.testing.assert_array_equal(np.diag(chain.transitions), 0.0)


def test_count_durations_alternating_segments_recovers_chain(rng):
    """Two places in turn for 8 and 20 steps."""
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
    """The skill does not depend on the world frame; the adapted skill moves with the frames."""
    demos = make_demonstrations(width=3)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    shift = rng.normal(size=3)

    def moved(frame):
        return Frame(frame.name, turn @ frame.A, turn @ frame.b + shift)

    moved_demos = [replace(d, x=d.x @ turn.T + shift, frames=tuple(map(moved, d.frames))) for d in demos]
    skill, same = (learn(ds, states=3, rng=rng).skill for ds in (demos, moved_demos))
    np.testing.assert_allclose(same.means, skill.means, atol=1e-8)
    adapted, moved_skill = adapt(skill, demos[0].frames), adapt(skill, moved_demos[0].frames)
    np.testing.assert_allclose(moved_skill.means, adapted.means @ turn.T + shift, atol=1e-8)
    np.testing.assert_allclose(moved_skill.covariances, turn @ adapted.covariances @ turn.T, atol=1e-9)


def test_adapted_gaussians_equal_product_of_frame_gaussians(rng, make_demonstrations):
    """Log N(x | adapted k) = sum over frames of log N(x | frame, k), up to a constant in x."""
    demos = make_demonstrations()
    skill = learn(demos, states=3, rng=rng).skill
    adapted, x = adapt(skill, demos[1].frames), rng.normal(size=(7, 2))
    local = np.stack([np.linalg.solve(f.A, (x - f.b).T).T for f in demos[1].frames])
    gap = log_emissions(skill, Views(local, np.array([7]))) - adapted.log_state_likelihoods(x)
    np.testing.assert_allclose(gap, np.broadcast_to(gap[0], gap.shape), atol=1e-8)


def test_adapt_world_frame_gives_skill_itself(rng, make_demonstrations):
    demos = [replace(d, frames=(Frame("world", np.eye(2), np.zeros(2)),)) for d in make_demonstrations()]
    skill = learn(demos, states=3, rng=rng).skill
    adapted = adapt(skill, demos[0].frames)
    np.testing.assert_allclose(adapted.means, skill.means[0])
    np.testing.assert_allclose(adapted.covariances, skill.covariances[0].dense)


def test_adapt_any_frame_order_and_invalid_frames_are_refused(rng, make_demonstrations):
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


def test_log_emissions_equal_sum_over_frames(rng, make_demonstrations):
    demos = make_demonstrations()
    skill = learn(demos, states=2, rng=rng, dynamics="mixture").skill
    data = views(demos[:1])
    for k in range(2):
        expected = sum(
            log_density(Gaussian(skill.means[p, k], skill.covariances[p].dense[k]), data.x[p])
            for p in range(2)
        )
        np.testing.assert_allclose(log_emissions(skill, data)[:, k], expected)


def test_count_durations_semi_markov_skill_is_refused(rng, make_demonstrations):
    """A semi-Markov skill has no self-transitions; the message names its Markov skill."""
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
def test_semi_markov_parameter_count_equals_table_5_1(structure, states, count):
    """Tanwani 2018, table 5.1: D = 14, means + covariances + K^2 + 2 K."""
    assert semi_markov_parameter_count(structure, states, 14) == count


@pytest.mark.parametrize(("tying", "count"), [(0.0, 1470), (0.5, 1470), (1.0, 588)])
def test_parameter_count_semi_tied_equals_table_4_1(tying, count):
    assert 2 * SemiTied(tying).parameter_count(7, 14) == count


def test_provenance_names_demonstrations_and_structure(rng, make_demonstrations):
    demos = make_demonstrations()
    one, other = (learn(ds, states=2, rng=rng).skill.provenance for ds in (demos, demos[:2]))
    assert one.demonstrations == ("passage 0", "passage 1", "passage 2")
    assert one.datapoints == sum(len(d.x) for d in demos)
    assert one.data != other.data
    assert one.structure == "full"


def test_adapt_dense_covariances_equal_structured(rng, make_demonstrations):
    """Adaptation uses `.dense` only."""
    demos = make_demonstrations()
    skill = learn(demos, states=3, rng=rng, structure=SemiTied()).skill
    dense = replace(skill, covariances=tuple(DenseCovariances(c.dense) for c in skill.covariances))
    np.testing.assert_array_equal(adapt(dense, demos[0].frames).means, adapt(skill, demos[0].frames).means)


def test_regress_mixture_of_ramp_predicts_ramp_and_slope(rng):
    """A ramp of position over time is predicted with its slope as derivative."""
    t = np.linspace(0.0, 4.0, 200)
    x = np.stack([t, 3.0 * t + 0.01 * rng.normal(size=200)], axis=1)
    demo = demonstration(x, 0.02, Layout((Part("ramp", Quantity.SCALAR, 2, "1"),)))
    fit = learn([demo], states=4, rng=rng, dynamics="mixture")
    regression = adapt(fit.skill, demo.frames).as_mixture().regress(np.array([0]), np.array([[1.0], [2.5]]))
    np.testing.assert_allclose(regression.means[:, 0], [3.0, 7.5], atol=0.05)
    np.testing.assert_allclose(regression.jacobians[:, 0, 0], 3.0, atol=0.2)
    with pytest.raises(InvalidInput, match="mixture"):
        adapt(learn([demo], states=2, rng=rng).skill, demo.frames).as_mixture()


def test_count_durations_state_without_segments_uses_self_transition(rng, make_demonstrations):
    """A state that Viterbi skips has the duration of its self-transition, 1 / (1 - a)."""
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


def test_provenance_hash_depends_on_values_and_frames_not_names(rng, make_demonstrations):
    """Everything that changes the result changes the hash."""
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


def test_provenance_hash_depends_on_units(rng, make_demonstrations):
    """Columns that a short repr of the layout would not tell apart have different hashes."""
    demos = make_demonstrations()
    parts = tuple(replace(part, unit="mm") for part in demos[0].layout.parts)
    scaled = [replace(demo, layout=replace(demo.layout, parts=parts)) for demo in demos]
    hashes = {learn(each, states=2, rng=rng).skill.provenance.data for each in (demos, scaled)}
    assert len(hashes) == 2


def test_log_likelihood_incompatible_data_is_refused(rng, make_demonstrations):
    """Another width and invalid maximum durations are refused."""
    demos = make_demonstrations()
    fit = learn(demos, states=2, rng=rng)
    other = demonstration(rng.normal(size=(9, 3)), period=0.1, layout=position_layout())
    with pytest.raises(InvalidInput, match="1 frames of 3 columns, expected 2 of 2"):
        log_likelihood(fit.skill, [other])
    with pytest.raises(InvalidInput, match="expected 2 of 2"):
        viterbi(fit.skill, other)
    with pytest.raises(InvalidInput, match="max_duration is 0, expected"):
        log_likelihood(fit.skill, demos, max_duration=0)
    with pytest.raises(InvalidInput, match="max_duration is -1, expected"):
        DurationModel(max_duration=-1)


@pytest.mark.parametrize(
    ("A", "b"),
    [(1.0, 1e308), (1.0, 1e51), (1e308, 0.0), (1e21, 0.0), (1e-21, 0.0), (1e-200, 0.0), (np.nan, 0.0)],
)
def test_frame_overflowing_squares_is_refused_by_name(rng, make_demonstrations, A, b):
    """Both where it is created and where a skill is adapted to an unchecked one."""
    demos = make_demonstrations()
    skill, (one, other) = learn(demos, states=2, rng=rng).skill, demos[0].frames
    huge = Frame(other.name, A * np.eye(2), np.full(2, b))
    with pytest.raises(InvalidInput, match=r"^frame 'object 1': (the largest entry of )?[Ab]"):
        adapt(skill, [one, huge])
    with pytest.raises(InvalidInput, match=r"^frame 'object 1': (the largest entry of )?[Ab]"):
        frame(huge.name, huge.A, huge.b)


@pytest.mark.parametrize(("A", "b"), [(1e20, 1e49), (1e-19, 1e49), (1e10, 0.0)])
def test_adapt_extreme_frames_gives_finite_skill(rng, make_demonstrations, A, b):
    """Products of covariances over frames of very different size."""
    demos = make_demonstrations()
    skill, (one, other) = learn(demos, states=2, rng=rng).skill, demos[0].frames
    adapted = adapt(skill, [one, frame(other.name, A * np.eye(2), np.full(2, b))])
    assert np.isfinite(adapted.means).all()
    assert np.isfinite(adapted.covariances).all()
