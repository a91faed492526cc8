"""Methods on Meta-World give the commands that were calculated by hand; the suite is not needed."""

from importlib import import_module
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture
def methods(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    return import_module("metaworld_methods")


@pytest.fixture
def program(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    return import_module("metaworld")


def straight_episode(methods: ModuleType, goal: list[float], steps: int, seed: int = 0):
    """Return an episode in a straight line from the origin, in which the gripper closes halfway."""
    target = np.array(goal)
    situation = methods.Situation(seed, np.zeros(3), target / 2.0, target)
    phase = np.arange(1, steps + 1)[:, None] / steps
    gripper = np.where(phase > 0.5, 1.0, -1.0)
    return methods.Episode(situation, np.hstack([phase * target, gripper]), True)


def test_commands_between_rows_are_interpolated_and_gripper_held(methods: ModuleType):
    path = np.array([[0.0, 0.0, 0.0, -1.0], [2.0, 0.0, 4.0, 1.0], [2.0, 6.0, 4.0, 0.5]])
    expected = [[1.0, 0.0, 2.0, -1.0], [2.0, 0.0, 4.0, 1.0], [2.0, 3.0, 4.0, 1.0], [2.0, 6.0, 4.0, 0.5]]
    np.testing.assert_allclose(methods.commands_of_path(path, 2), expected)


@pytest.mark.parametrize(("steps_per_row", "kept"), [(1, 11), (2, 10), (4, 8)])
def test_straight_episode_survives_sampling(methods: ModuleType, steps_per_row: int, kept: int):
    episode = straight_episode(methods, [1.1, 0.0, 2.2], 11)
    commands = methods.commands_of_path(methods.episode_path(episode, steps_per_row), steps_per_row)
    np.testing.assert_allclose(commands[:, :3], episode.commands[:kept, :3])
    if steps_per_row == 1:
        np.testing.assert_array_equal(commands, episode.commands)


def test_shift_is_exact_at_start_object_and_goal_and_linear_between(methods: ModuleType):
    path = np.column_stack([[0.0, 1.0, 2.0, 2.0, 3.0, 4.0], np.zeros((6, 2)), np.ones(6)])
    old = methods.Situation(0, path[0, :3], np.array([2.0, 0.0, -0.1]), path[-1, :3])
    y = np.array([0.0, 1.0, 0.0])
    new = methods.Situation(1, old.hand + y, old.object + 3.0 * y, old.goal - y)
    shifted = methods.shift_path(path, old, new)
    np.testing.assert_allclose(shifted[:, 1], [1.0, 2.0, 3.0, 3.0, 1.0, -1.0])
    np.testing.assert_array_equal(shifted[:, [0, 2, 3]], path[:, [0, 2, 3]])


def test_nearest_in_demonstrated_situation_repeats_that_demonstration(methods: ModuleType):
    episodes = [
        straight_episode(methods, goal, steps) for goal, steps in (([1.0, 0.0, 0.0], 8), ([0.0, 2.0, 0.0], 9))
    ]
    reproduce = methods.prepare_nearest(episodes, 1, 0)
    for episode in episodes:
        np.testing.assert_allclose(reproduce(episode.situation)[1:], episode.commands)


def test_mean_of_two_lines_begins_at_new_start_and_ends_at_new_goal(methods: ModuleType):
    episodes = [straight_episode(methods, [1.0, 0.0, 0.0], 4), straight_episode(methods, [3.0, 0.0, 0.0], 8)]
    path = methods.prepare_mean(episodes, 1, 0)(
        methods.Situation(2, np.array([0.0, 0.0, 0.5]), np.zeros(3), np.array([2.0, 1.0, 0.0]))
    )
    assert len(path) == 7  # the mean of 5 and 9 rows
    np.testing.assert_allclose(path[:, 0], np.linspace(0.0, 2.0, 7))
    np.testing.assert_allclose(path[:, 1], np.linspace(0.0, 1.0, 7))
    np.testing.assert_allclose(path[:, 2], np.linspace(0.5, 0.0, 7), atol=1e-15)


@pytest.mark.parametrize(("name", "tolerance"), [("promp", 2e-3), ("ours", 0.02)])
def test_straight_lines_are_generalised_to_new_goal(methods: ModuleType, name: str, tolerance: float):
    """Goals differ by up to .4 m; the tolerance [m] of ProMP is the ripple of its basis functions."""
    goals = [[0.3, y, z] for y, z in ((-0.2, 0.1), (-0.1, 0.3), (0.0, 0.2), (0.1, 0.1), (0.2, 0.25))]
    episodes = [straight_episode(methods, goal, 60, seed) for seed, goal in enumerate(goals)]
    new = straight_episode(methods, [0.3, 0.05, 0.22], 60)
    path = methods.METHODS[name][1](episodes, 1, 0)(new.situation)
    assert path.shape == (61, 4)
    assert np.linalg.norm(path[-1, :3] - new.situation.goal) < tolerance
    assert np.linalg.norm(path[30, :3] - new.situation.object) < tolerance
    assert path[5, 3] < -0.5
    assert path[55, 3] > 0.5


def test_basis_functions_sum_to_one(methods: ModuleType):
    np.testing.assert_allclose(methods.basis_functions(50).sum(axis=1), 1.0)


def test_even_and_odd_tasks_share_none(program: ModuleType):
    tasks = ["b-v3", "a-v3", "d-v3", "c-v3", "e-v3"]
    assert program.chosen_tasks(["even"], tasks) == ["a-v3", "c-v3", "e-v3"]
    assert program.chosen_tasks(["odd"], tasks) == ["b-v3", "d-v3"]
    assert program.chosen_tasks(["all"], tasks) == sorted(tasks)
    assert program.chosen_tasks(["d-v3", "even"], tasks) == ["a-v3", "c-v3", "d-v3", "e-v3"]
    with pytest.raises(SystemExit, match=r"no task is called f-v3, expected even, odd, all"):
        program.chosen_tasks(["f-v3"], tasks)


def test_options_of_page_leave_out_files(program: ModuleType):
    words = ["--draws", "0,1", "--data", "here", "--out=page.md", "--tasks", "even", "--json", "figures.json"]
    assert program.repeatable_options(words) == "--draws 0,1 --tasks even"


def test_table_averages_over_tasks_and_draws(program: ModuleType):
    def result(task: str, draw: int, *succeeded: bool):
        return program.Result(task, draw, "nearest", succeeded, 1.0)

    results = [
        result("a-v3", 0, True, True),
        result("a-v3", 1, True, True),
        result("b-v3", 0, True, False),
        result("b-v3", 1, False, False),
    ]
    row = program.summary(results)[-1]
    assert row == "| nearest demonstration, shifted | 62.5 | 75.0, 50.0 | 1 | 1 | 1.00 |"
    assert program.task_rows(results)[-2:] == ["| a | 100 |", "| b | 25 |"]
