"""Selection by reproduction equals learning and reproducing by hand, whatever the units and the order."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pilotfish.control import Motion
from pilotfish.demonstrations import Demonstration, frame, position_layout, to_sphere
from pilotfish.demonstrations import demonstration as make_demonstration
from pilotfish.errors import InvalidInput
from pilotfish.gaussians.structures import Diagonal, Full, SemiTied
from pilotfish.geometry import angle, from_rotation_vector, multiply
from pilotfish.io.synthetic import synthetic_valve
from pilotfish.models import Candidate, adapt, learn, relevance, select
from pilotfish.planning import (
    DEFAULT_CANDIDATE,
    ReproductionScore,
    ReproductionSelection,
    default_candidates,
    default_control_cost,
    held_out_errors,
    reproduce,
    reproduce_adapted,
    select_by_reproduction,
    time_warped_distance,
)
from pilotfish.planning.selection import MAX_FOLDS, relative_errors

CANDIDATES = (Candidate(4, Diagonal()), Candidate(6, SemiTied()))


@cache
def valve(count: int = 4) -> tuple[Demonstration, ...]:
    return synthetic_valve(np.random.default_rng(0))[:count]


def reaches(unit: float, count: int = 4) -> list[Demonstration]:
    """Return reaches in the plane from a start to a goal, both with a frame; `unit` is in metres."""
    rng = np.random.default_rng(1)
    layout, s = position_layout(2).differentiate(), np.linspace(0.0, 1.0, 40)
    demonstrations = []
    for _ in range(count):
        start, goal = rng.normal(size=2), rng.normal(size=2) + np.array([3.0, 0.0])
        share = (s**2 * (3.0 - 2.0 * s))[:, None]
        bend = np.sin(np.pi * share * rng.uniform(0.8, 1.2)) * [0.0, 0.5]
        x = ((1.0 - share) * start + share * goal + bend) / unit
        rates = np.gradient(x, 0.1, axis=0)
        frames = tuple(
            frame(name, np.eye(4), np.append(b / unit, [0.0, 0.0])) for name, b in (("a", start), ("b", goal))
        )
        demonstrations.append(make_demonstration(np.hstack([x, rates]), 0.1, layout, frames))
    return demonstrations


def run(demonstrations, candidates, seed=3, **options) -> ReproductionSelection:
    rng = np.random.default_rng(seed)
    return select_by_reproduction(demonstrations, candidates, rng=rng, **options)


def values_by_label(selection: ReproductionSelection) -> dict[str, np.ndarray]:
    return {score.candidate.label: score.values for score in selection.scores}


def copy_motion(demonstration: Demonstration, **columns: np.ndarray) -> Motion:
    x = demonstration.x.copy()
    return Motion(x, np.zeros((len(x) - 1, 7)), demonstration.period)


def test_relative_errors_of_shifted_motion_equal_shift_over_scale():
    """A constant shift has mean distance and end error equal to it; warping can only shorten it."""
    demonstration = valve()[0]
    scales = np.repeat([0.5, 0.25, 1.0, 1.0], [3, 4, 3, 4])
    motion = copy_motion(demonstration)
    motion.x[:, 1] += 0.1
    mean, warped, end, mean_angle = relative_errors(motion, demonstration, scales)
    np.testing.assert_allclose(
        [mean, end], 0.1 / 0.5 / 2, rtol=1e-9
    )  # the mean of two parts, one of them exact
    expected = time_warped_distance(motion.x[:, :3], demonstration.x[:, :3]) / 0.5 / 2
    np.testing.assert_allclose(warped, expected, rtol=1e-9)
    assert 0.0 < warped < mean
    assert mean_angle < 1e-7


@pytest.mark.parametrize("sphere", [False, True])
def test_relative_errors_of_turned_motion_do_not_depend_on_signs(sphere: bool):
    """The distance of orientations is their angle; a chord in R^4, and its scale, are half of it."""
    demonstration = to_sphere(valve()[0]) if sphere else valve()[0]
    width = demonstration.layout.tangent.width
    motion = copy_motion(demonstration)
    turn = from_rotation_vector(np.array([0.02, 0.0, 0.0]))
    motion.x[:, 3:7] = -multiply(motion.x[:, 3:7], turn)
    mean, _, end, mean_angle = relative_errors(motion, demonstration, np.full(width, 0.5))
    np.testing.assert_allclose([mean, end], 0.02 / (0.5 if sphere else 1.0) / 2, rtol=1e-6)
    np.testing.assert_allclose(mean_angle, 0.02, rtol=1e-6)


def test_score_equals_learning_and_reproducing_by_hand():
    selection = run(valve(), CANDIDATES[:1])
    score = selection.scores[1]
    held_out, training = valve()[1], [d for n, d in enumerate(valve()) if n != 1]
    skill = learn(training, states=4, structure=Diagonal(), rng=np.random.default_rng(0)).skill
    found = reproduce(skill, held_out.frames, held_out.x[0], horizon=len(held_out.x)).motion
    errors = relative_errors(found, held_out, skill.demonstrated.scales)
    assert [float(v[1]) for v in score.measures.values()] == pytest.approx(
        [*errors[:3], np.degrees(errors[3])], rel=1e-9
    )
    assert score.values[1] == pytest.approx(errors[:3].sum(), rel=1e-9)
    degrees = np.degrees(angle(found.x[:, 3:7], held_out.x[:, 3:7])).mean()
    assert score.measures["angle [deg]"][1] == pytest.approx(degrees, rel=1e-9)


def test_relevance_and_control_cost_of_candidate_are_used():
    training, held_out = valve()[:3], valve()[3]
    skill = learn(training, states=4, rng=np.random.default_rng(0)).skill
    start, steps = held_out.x[0], len(held_out.x)
    weights = relevance(skill, training).values
    adapted = adapt(skill, held_out.frames, relevance=weights)
    R = 1e4 * default_control_cost(adapted)
    motion = reproduce_adapted(adapted, start, horizon=steps, control_cost=R).motion
    expected = relative_errors(motion, held_out, skill.demonstrated.scales)
    candidate = Candidate(4, frames="relevance", control_cost_factor=1e4)
    found = held_out_errors(candidate, training, [held_out], rng=np.random.default_rng(0))
    np.testing.assert_allclose(found[0], expected, rtol=1e-9)
    plain = held_out_errors(Candidate(4), training, [held_out], rng=np.random.default_rng(0))
    assert abs(plain[0, 0] - expected[0]) > 1e-3


def test_select_scores_do_not_depend_on_units():
    """Metres and inches: the same scores up to rounding."""
    metres, inches = (values_by_label(run(reaches(unit), CANDIDATES)) for unit in (1.0, 0.0254))
    assert metres.keys() == inches.keys()
    for label, values in metres.items():
        np.testing.assert_allclose(values, inches[label], rtol=1e-5)


def test_select_scores_do_not_depend_on_order_or_executor():
    forward = run(valve(3), CANDIDATES)
    with ThreadPoolExecutor(2) as executor:
        backward = run(valve(3), CANDIDATES[::-1], executor=executor)
    first, second = values_by_label(forward), values_by_label(backward)
    assert first.keys() == second.keys()
    for label, values in first.items():
        np.testing.assert_array_equal(values, second[label])
    assert forward.best.candidate == backward.best.candidate
    assert forward.fits == backward.fits == 9


def test_select_seven_demonstrations_holds_each_out_once_in_five_fits():
    finished = []
    demonstrations = valve(7)
    selection = run(demonstrations, [Candidate(3)], callback=finished.append)
    assert selection.fits == 2 * MAX_FOLDS
    assert finished == [DEFAULT_CANDIDATE] * MAX_FOLDS + [Candidate(3)] * MAX_FOLDS
    group = (1, 6)  # held out together
    training = [d for n, d in enumerate(demonstrations) if n not in group]
    held_out = [demonstrations[n] for n in group]
    errors = held_out_errors(Candidate(3), training, held_out, rng=np.random.default_rng(0))
    np.testing.assert_allclose(selection.scores[1].values[list(group)], errors[:, :3].sum(axis=1))


def test_select_failed_candidate_is_listed_with_reason():
    mixture, many = Candidate(3, dynamics="mixture"), Candidate(500)
    selection = run(valve(2), [mixture, many])
    assert [candidate for candidate, _ in selection.failures] == [mixture, many]
    assert "500 states" in selection.failures[1][1]
    assert selection.best is selection.default
    assert selection.edge is None


def test_select_too_little_data_is_refused(unchecked: None):
    with pytest.raises(InvalidInput, match="at least two"):
        run(valve(1), CANDIDATES)
    with pytest.raises(InvalidInput, match="candidates is empty"):
        run(valve(2), [])
    with pytest.raises(InvalidInput, match=r"pf\.models\.Candidate"):
        run(valve(2), [7])


def test_likelihood_refuses_candidates_that_only_reproduction_distinguishes(unchecked: None):
    selection = select(
        valve(2), [Candidate(3, frames="relevance"), Candidate(3)], rng=np.random.default_rng(0)
    )
    assert [score.candidate for score in selection.scores] == [Candidate(3)]
    assert "select by reproduction" in selection.failures[0][1]
    with pytest.raises(InvalidInput, match="frames is 'all'"):
        Candidate(frames="all")
    with pytest.raises(InvalidInput, match="control_cost_factor is 0"):
        Candidate(control_cost_factor=0.0)


def make_score(candidate: Candidate, *values: float) -> ReproductionScore:
    return ReproductionScore(candidate, candidate.states or 30, np.array(values), {})


def make_selection(*scores: ReproductionScore) -> ReproductionSelection:
    return ReproductionSelection(scores, (), 0)


DEFAULT_SCORE = make_score(DEFAULT_CANDIDATE, 1.0, 1.2, 0.8, 1.0)


def test_best_keeps_default_unless_gain_is_significant():
    """Gains are paired by demonstration: a steady small one counts, a larger one by chance does not."""
    steady = make_score(Candidate(10), 0.98, 1.18, 0.77, 0.98)
    lucky = make_score(Candidate(20), 1.3, 1.4, 0.7, 0.1)
    worse = make_score(Candidate(40), 1.1, 1.3, 0.9, 1.1)
    assert lucky.mean < steady.mean < DEFAULT_SCORE.mean
    assert make_selection(DEFAULT_SCORE, lucky, worse).best is DEFAULT_SCORE
    selection = make_selection(DEFAULT_SCORE, lucky, steady, worse)
    assert selection.best is steady
    gain, error = selection.gain(steady)
    differences = DEFAULT_SCORE.values - steady.values
    assert gain == pytest.approx(differences.mean())
    assert error == pytest.approx(differences.std(ddof=1) / 2.0)
    for threshold, others, expected in ((2.36, 0, True), (2.35, 0, False), (3.19, 1, True), (3.18, 1, False)):
        spread = np.array([1.0, -1.0, 1.0, -1.0])  # of standard error sqrt(1 / 3)
        near = make_score(Candidate(10), *(DEFAULT_SCORE.values - 1e-3 * (spread + threshold / np.sqrt(3.0))))
        selection = make_selection(DEFAULT_SCORE, near, *[worse] * others)  # 95 and 97.5 % of t: 2.353, 3.182
        assert (selection.best is near) == expected
        assert selection.lowest is near
    assert make_selection(lucky, worse).best is lucky  # the default failed
    with pytest.raises(InvalidInput, match="no candidate"):
        _ = ReproductionSelection((), ((Candidate(3), "too short"),), 0).best


@pytest.mark.parametrize(("states", "edge"), [(10, "smallest"), (20, None), (40, "largest")])
def test_edge_names_end_of_range_of_states(states: int, edge: str | None):
    values = {count: 0.5 if count == states else 2.0 for count in (10, 20, 40)}
    scores = [make_score(Candidate(count), *[value] * 4) for count, value in values.items()]
    assert make_selection(DEFAULT_SCORE, *scores).edge == edge
    failed = ReproductionSelection((DEFAULT_SCORE, *scores), ((Candidate(60), "too many states"),), 0)
    assert failed.edge == (edge if edge != "largest" else None)  # more were tried


def test_default_candidates_follow_from_rows_and_frames():
    """Full covariances need three rows per column and state: 4 x 200 rows, 14 columns, at most 19 states."""
    demonstrations = valve()
    rows = sum(len(d.x) for d in demonstrations)
    candidates = default_candidates(demonstrations)
    assert candidates[0] == DEFAULT_CANDIDATE
    full = [c.states for c in candidates if c.structure == Full()]
    assert full == [count for count in (15, 20) if rows >= 3 * 14 * count]
    assert full
    assert Candidate(frames="relevance") in candidates
    one_frame = [replace(d, frames=d.frames[:1]) for d in demonstrations]
    assert Candidate(frames="relevance") not in default_candidates(one_frame)
    short = [replace(d, x=d.x[:30]) for d in demonstrations]
    assert max(c.states or 0 for c in default_candidates(short)) == 15
