"""The study: conditions, pairing, the jitter for a loss, measures, and statistics by other methods."""

from dataclasses import replace
from math import inf, nan
from typing import Any

import numpy as np
import pytest
from scipy import stats

from pilotfish.demonstrations import demonstration, frame_from_pose, pose_layout
from pilotfish.environments import TASKS
from pilotfish.environments.human import Subtask
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, from_rotation_vector
from pilotfish.simulation import (
    NOISE_FREE,
    OPERATORS,
    Condition,
    ModeSummary,
    Ratio,
    StudyRun,
    learn_study_skills,
    paired_ratio,
    perform_study_run,
    preferred_mode,
    skill_name,
    study_conditions,
    study_measures,
    study_runs,
)
from pilotfish.simulation.mission import PROCESSING_TIME
from pilotfish.simulation.study import COMMAND_PERIOD, MEAN_BURST, allowed_silence, mission_settings
from pilotfish.simulation.study_measures import path_length, reach_goal
from pilotfish.simulation.study_skills import displace_frames
from pilotfish.teleop.delay_contract import agree, allows_mode, nanoseconds

IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])


# ---------------------------------------------------------------------------------------------- conditions


def test_study_conditions_are_those_of_the_protocol():
    conditions = study_conditions()
    assert len(conditions) == len(set(conditions)) == 112
    standard = [c for c in conditions if c.arm == "standard"]
    for task in ("valve", "stab"):
        for mode in ("direct", "shared", "autonomous", "fixture"):
            mine = [c for c in standard if (c.task, c.mode) == (task, mode)]
            without_loss = {(c.round_trip, c.view_off) for c in mine if not c.loss}
            assert without_loss == {(t, off) for t in (0.0, 0.25, 0.5, 1.0, 2.0) for off in (False, True)}
            assert {(c.loss, c.round_trip) for c in mine if c.loss} == {(0.05, 1.0), (0.3, 1.0)}


def test_study_runs_are_unique_and_paired_in_all_modes():
    runs = study_runs()
    assert len(runs) == len({run.key for run in runs}) == 1740
    operators: dict[int, str] = {}
    numbers: dict[Condition, set[int]] = {}
    for run in runs:
        if run.operator != NOISE_FREE:
            assert operators.setdefault(run.number, run.operator) == run.operator
            numbers.setdefault(run.condition, set()).add(run.number)
    assert all(found == set(range(15)) for found in numbers.values())
    assert {list(operators.values()).count(operator) for operator in OPERATORS} == {5}
    assert sum(run.operator == NOISE_FREE for run in runs) == 60


def test_study_runs_quick_is_part_of_the_study():
    quick = study_runs(quick=True)
    assert len(quick) == 60
    assert set(quick) <= set(study_runs())


def test_study_runs_first_fifth_has_every_condition():
    runs = study_runs()[: 1740 // 5]
    assert {run.condition for run in runs} == set(study_conditions())


@pytest.mark.parametrize("loss", [0.05, 0.3])
@pytest.mark.parametrize("period", [0.02, 0.05])
def test_allowed_silence_is_exceeded_less_than_once_a_minute(
    loss: float, period: float, rng: np.random.Generator
):
    """Lengths of bursts and of the gaps between them are geometric, with means 5 and 5 (1 - p) / p."""
    n = 200_000
    bursts = rng.geometric(1.0 / MEAN_BURST, n)
    gaps = rng.geometric(loss / (1.0 - loss) / MEAN_BURST, n)
    minutes = (bursts.sum() + gaps.sum()) * period / 60.0

    def alarms(silence: float) -> float:
        return float(np.sum((bursts + 1) * period > silence + 2.0 * period + 1e-9)) / minutes

    silence = allowed_silence(loss, period)
    assert alarms(silence) < 1.0 < alarms(silence - 0.25)
    assert allowed_silence(0.0, period) == 0.25


@pytest.mark.parametrize("condition", study_conditions(), ids=lambda c: f"{c.name}, {c.mode}")
def test_mission_settings_contract_allows_mode(condition: Condition):
    settings = mission_settings(StudyRun(condition, "ordinary", 0))
    period = nanoseconds(COMMAND_PERIOD)
    contract = agree(settings.contract, settings.agreed_budget, settings.jitter, period)
    assert contract is not None
    assert allows_mode(settings.contract, contract, condition.mode)
    assert settings.round_trip == condition.round_trip
    assert settings.agreed_budget == pytest.approx(condition.round_trip + PROCESSING_TIME)
    assert settings.jitter == {0.0: 0.25, 0.05: 0.5, 0.3: 0.5}[condition.loss]
    assert (settings.aside is not None) == (condition.arm == "aside")


def test_skill_name_wrong_skill_is_that_of_the_neighbour():
    assert skill_name(Condition("valve", "shared", arm="wrong skill")) == "valve-neighbour"
    assert skill_name(Condition("valve", "shared", arm="aside")) == "valve"


def test_perform_study_run_pairs_share_situation_and_seeds(monkeypatch: pytest.MonkeyPatch):
    calls: list[tuple[Any, float]] = []

    class Stop(Exception):
        pass

    def record(skill: bytes, task: Any, situation: Any, rng: np.random.Generator, *rest: Any, **more: Any):
        calls.append((situation.receptacle.position.tolist(), rng.random()))
        raise Stop

    monkeypatch.setattr(study_measures, "run_mission", record)
    runs = [run for run in study_runs() if run.condition.task == "stab" and run.number in (3, 8)]
    for run in runs:
        with pytest.raises(Stop):
            perform_study_run(run, b"", seed=7)
    by_number = {
        number: {str(call) for run, call in zip(runs, calls, strict=True) if run.number == number}
        for number in (3, 8)
    }
    assert [len(found) for found in by_number.values()] == [1, 1]
    assert by_number[3] != by_number[8]


def test_perform_study_run_bad_seed_is_refused():
    with pytest.raises(InvalidInput, match="seed is -1"):
        perform_study_run(study_runs()[0], b"", seed=-1)


# ------------------------------------------------------------------------------------------------ measures


def test_path_length_of_square_is_four():
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 0]], dtype=float)
    assert path_length(corners) == pytest.approx(4.0)


def rows(*poses: tuple[float, float]) -> np.ndarray:
    """Return poses at distances along x [m], turned about x [rad]."""
    turns = [from_rotation_vector(np.array([angle, 0.0, 0.0])) for _, angle in poses]
    return np.array([[x, 0.0, 0.0, *turn] for (x, _), turn in zip(poses, turns, strict=True)])


@pytest.mark.parametrize(
    ("path", "name", "expected"),
    [
        (rows((0.2, 0.0), (0.009, 0.0)), None, (True, 0.009)),
        (rows((0.0, 0.0), (0.011, 0.0)), None, (False, 0.011)),  # it has left again
        (rows((0.0, 0.0), (0.011, 0.0)), "turn", (True, 0.0)),  # at any time
        (rows((0.0, 0.1), (0.008, 0.0)), "turn", (True, 0.008)),  # near, but turned by more than 5 degrees
        (rows((0.3, 0.0), (0.0, 0.1)), None, (False, 0.0)),
    ],
)
def test_reach_goal_needs_distance_and_angle(path: np.ndarray, name: str, expected: tuple[bool, float]):
    goal = Pose(np.zeros(3), IDENTITY)
    goals = [(Subtask(each, lambda f: goal, 0.01, 0.1), goal) for each in ("turn", "leave")]
    reached, distance = reach_goal(path, goals, name)
    assert (reached, distance) == (expected[0], pytest.approx(expected[1]))


def test_displace_frames_moves_the_goal_beside_the_object():
    """The robot was at the object; relative to the displaced frame it is beside it."""
    turned = Pose(np.array([0.8, 0.1, 0.0]), from_rotation_vector(np.array([0.0, 0.0, 0.5])))
    x = np.tile([0.8, 0.1, 0.0, 1.0, 0.0, 0.0, 0.0], (3, 1))
    layout = pose_layout()
    recorded = demonstration(x, 0.1, layout, [frame_from_pose("object", layout, turned)], "one")
    displaced = displace_frames(recorded, np.array([0.0, 0.06, 0.0]))
    local = displaced.frames[0].to_local(x)[-1, :3] if not displaced.frames[0].is_moving else None
    world = displaced.frames[0].at(0).A[:3, :3] @ local
    np.testing.assert_allclose(world, [0.0, 0.06, 0.0], atol=1e-12)
    np.testing.assert_array_equal(recorded.frames[0].at(0).b[:3], turned.position)


# ---------------------------------------------------------------------------------------------- statistics


def test_paired_ratio_interval_equals_binomial_quantiles(rng: np.random.Generator):
    """Values 1 and 2 over references of 1: the resampled sum less n is binomial."""
    n, twos = 15, 6
    values = {number: 2.0 if number < twos else 1.0 for number in range(n)}
    found = paired_ratio(values, dict.fromkeys(range(n), 1.0), rng, resamples=100_000)
    low, high = 1.0 + stats.binom.ppf([0.025, 0.975], n, twos / n) / n
    assert found.value == pytest.approx(1.0 + twos / n)
    assert found.low == pytest.approx(low, abs=1.0 / n + 1e-9)
    assert found.high == pytest.approx(high, abs=1.0 / n + 1e-9)
    assert found.pairs == n


def test_paired_ratio_interval_covers_the_true_ratio(rng: np.random.Generator):
    """Coverage of a percentile interval is a few points below 95 % with 30 pairs."""
    covered, trials, pairs = 0, 300, 30
    for _ in range(trials):
        person = rng.lognormal(2.0, 0.4, pairs)  # common to both: what pairing removes
        x, y = 0.7 * person * rng.lognormal(0.0, 0.2, pairs), person * rng.lognormal(0.0, 0.2, pairs)
        found = paired_ratio(dict(enumerate(x)), dict(enumerate(y)), rng, resamples=500)
        covered += found.low <= 0.7 <= found.high
    assert 0.88 < covered / trials < 0.99


def test_paired_ratio_proportional_pairs_have_no_width(rng: np.random.Generator):
    reference = dict(enumerate(rng.uniform(5.0, 50.0, 15)))
    found = paired_ratio({n: 0.6 * y for n, y in reference.items()}, reference, rng)
    assert (found.low, found.high) == (pytest.approx(0.6), pytest.approx(0.6))
    assert found.verdict == "lower"


def test_paired_ratio_takes_only_numbers_of_both(rng: np.random.Generator):
    found = paired_ratio({1: 3.0, 2: 4.0, 3: 100.0}, {1: 6.0, 2: 8.0, 4: 1e-3}, rng)
    assert (found.value, found.pairs) == (0.5, 2)


def test_paired_ratio_same_seed_gives_same_interval():
    values, reference = {n: 1.0 + n % 3 for n in range(9)}, {n: 2.0 + n % 2 for n in range(9)}
    first, second = (paired_ratio(values, reference, np.random.default_rng(4)) for _ in range(2))
    assert first == second


def test_paired_ratio_one_pair_has_no_interval(rng: np.random.Generator):
    assert paired_ratio({1: 2.0}, {1: 4.0}, rng).verdict == "too few pairs"
    assert paired_ratio({1: 2.0}, {2: 4.0}, rng).pairs == 0


@pytest.mark.parametrize("bad", [0.0, -1.0, nan, inf])
def test_paired_ratio_bad_reference_is_refused(rng: np.random.Generator, bad: float):
    with pytest.raises(InvalidInput, match="reference"):
        paired_ratio({1: 1.0}, {1: bad}, rng)


@pytest.mark.parametrize(
    ("low", "high", "verdict"),
    [
        (0.5, 0.99, "lower"),
        (0.5, 1.0, "no gain"),
        (0.9, 1.1, "no gain"),
        (1.0, 1.2, "no gain"),
        (1.01, 1.2, "higher"),
        (nan, nan, "too few pairs"),
    ],
)
def test_ratio_verdict_is_no_gain_where_one_is_inside(low: float, high: float, verdict: str):
    assert Ratio(1.0, low, high, 15).verdict == verdict


def test_preferred_mode_orders_success_time_effort():
    direct = ModeSummary("direct", 15, 20.0, 0.1)
    shared = ModeSummary("shared", 15, 10.2, 0.3)
    autonomous = ModeSummary("autonomous", 15, 10.0, 0.4)
    fixture = ModeSummary("fixture", 14, 5.0, 0.0)
    modes = [direct, shared, autonomous, fixture]
    assert preferred_mode(modes) == "shared"  # 2 % slower than autonomous, with less effort
    assert preferred_mode([direct, replace(shared, time=10.6), autonomous, fixture]) == "autonomous"
    assert preferred_mode([*modes[:3], replace(fixture, successes=15)]) == "fixture"
    with pytest.raises(InvalidInput, match="modes is empty"):
        preferred_mode([])


# ------------------------------------------------------------------------------------------------ one run


@pytest.mark.slow  # records and learns a skill and simulates two missions: 15 CPU seconds
def test_perform_study_run_stab_succeeds_sooner_with_shared_control(unchecked: None):
    skills = learn_study_skills("stab", neighbour=False)
    assert list(skills) == ["stab"]
    direct, shared = (
        perform_study_run(StudyRun(Condition("stab", mode), NOISE_FREE, 0), skills["stab"])
        for mode in ("direct", "shared")
    )
    assert direct["success"]
    assert shared["success"]
    assert shared["time"] < 0.8 * direct["time"]
    assert direct["disagreement"] < 0.005 < shared["disagreement"] + 0.005
    assert direct["path"] / direct["path_ratio"] == pytest.approx(
        shared["path"] / shared["path_ratio"], rel=0.05
    )
    assert direct["failure"] == shared["failure"] == ""
    assert TASKS["stab"].time_limit > shared["time"]
