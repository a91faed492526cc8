"""Gymnasium environments satisfy the interface and return the state of the physics."""

from contextlib import suppress
from dataclasses import fields, replace
from typing import Any

import gymnasium
import numpy as np
import pytest
from annotations import check_annotations
from gymnasium.utils.env_checker import check_env

from pilotfish.environments import TASKS, Manipulation, RecordedValve, Workcell
from pilotfish.environments.tasks.carabiner import CarabinerSituation
from pilotfish.environments.tasks.plate import PlateSituation
from pilotfish.environments.tasks.screwdriver import ScrewdriverSituation
from pilotfish.environments.tasks.stab import StabSituation
from pilotfish.environments.tasks.valve import ValveSituation
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose

pytestmark = pytest.mark.usefixtures("unchecked")

ObservationArrays = dict[str, np.ndarray]
GYMNASIUM_ADVICE = (  # units are SI; other scales are for a wrapper
    "ignore:.*we recommend using a symmetric and .* space:UserWarning",
    "ignore:.*observation space m.* value is -?infinity:UserWarning",
)


def displaced_action(
    env: Manipulation, displacement: tuple[float, float, float] = (0.0, 0.0, 0.0), grip: float = 0.0
) -> np.ndarray:
    """Return an action whose target is displaced from the tool [m]."""
    tool = env.cell.arm.tool
    return np.concatenate([tool.position + np.array(displacement), tool.quaternion, [grip]])


def run_episode(
    task: str, seed: int, steps: int = 12
) -> list[tuple[ObservationArrays, float, bool, bool, dict[str, Any]]]:
    """Return the results of some random steps."""
    env, rng = Manipulation(task), np.random.default_rng(5)
    observation, info = env.reset(seed=seed)
    history = [(observation, 0.0, False, False, info)]
    for _ in range(steps):
        asked = displaced_action(env, tuple(0.05 * rng.normal(size=3)), rng.uniform())
        history.append(env.step(asked))
    env.close()
    return history


@pytest.mark.filterwarnings(*GYMNASIUM_ADVICE)
@pytest.mark.parametrize("task", sorted(TASKS))
def test_environment_passes_gymnasium_checker(task: str):
    check_env(Manipulation(task), skip_render_check=True)


@pytest.mark.parametrize("task", sorted(TASKS))
def test_episode_same_seed_and_actions_are_equal(task: str):
    one, again, other = run_episode(task, 3), run_episode(task, 3), run_episode(task, 4)
    for (a, *rest), (b, *others) in zip(one, again, strict=True):
        assert {name: value.tobytes() for name, value in a.items()} == {
            name: value.tobytes() for name, value in b.items()
        }
        assert rest == others
    assert not np.array_equal(one[0][0]["frames"], other[0][0]["frames"])


def test_reset_without_seed_continues_generator():
    def places(seed: int) -> np.ndarray:
        env = Manipulation("valve")
        return np.stack([env.reset(seed=seed if n == 0 else None)[0]["frames"][0, :3] for n in range(3)])

    assert np.array_equal(places(1), places(1))
    assert len(np.unique(places(1), axis=0)) == 3


@pytest.mark.parametrize("task", sorted(TASKS))
def test_observation_equals_simulation_state(task: str):
    env = Manipulation(task)
    env.reset(seed=0)
    observation = env.step(displaced_action(env, (0.0, 0.01, 0.02), 0.5))[0]
    assert observation in env.observation_space
    cell, names = env.cell, TASKS[task].frames
    assert observation.keys() == env.observation_space.keys()
    assert observation["frames"].shape == (len(names), 7)
    for row, pose in zip(observation["frames"], map(cell.frames().__getitem__, names), strict=True):
        assert np.array_equal(row, np.append(pose.position, pose.quaternion))
    tool = cell.arm.tool
    assert np.array_equal(observation["tool"], np.append(tool.position, tool.quaternion))
    assert np.array_equal(observation["joints"], cell.arm.q)
    assert np.array_equal(observation["velocities"], cell.arm.velocity)
    assert np.allclose(observation["twist"], cell.arm.jacobian() @ cell.arm.velocity)
    assert observation["grip"] == [0.5]
    assert observation["force"] == [cell.forces["tool"]]


def test_observation_is_a_copy():
    env = Manipulation("valve")
    before = env.reset(seed=0)[0]
    kept = {name: value.copy() for name, value in before.items()}
    for _ in range(5):
        env.step(displaced_action(env, (0.1, 0.0, 0.0), 1.0))
    assert all(np.array_equal(before[name], kept[name]) for name in kept)


def test_step_does_not_modify_action():
    ends = []
    for fresh in (True, False):
        env = Manipulation("valve")
        env.reset(seed=0)
        action = displaced_action(env)
        for _ in range(10):
            action[:3] += 0.003
            tool = env.step(action.copy() if fresh else action)[0]["tool"]
        ends.append(tool)
    assert np.array_equal(*ends)


def test_step_arm_reaches_target():
    env = Manipulation("valve")
    env.reset(seed=0)
    action = displaced_action(env, (0.05, -0.04, 0.06))
    for _ in range(50):
        observation = env.step(action)[0]
    assert np.linalg.norm(observation["tool"][:3] - action[:3]) < 0.01
    assert env.cell.time == pytest.approx(1.0)


@pytest.mark.parametrize("length", [0.01, 0.5, 2.0, 1e155, 1e308])
def test_step_quaternion_length_has_no_effect(length: float):
    states = []
    for factor in (1.0, length, -length):
        env = Manipulation("valve")
        env.reset(seed=0)
        action = displaced_action(env, (0.02, 0.0, 0.0))
        action[3:7] *= factor
        env.step(action)
        states.append(env.cell.data.qpos.copy())
    assert np.allclose(states[0], states[1], atol=1e-12)
    assert np.allclose(states[0], states[2], atol=1e-12)


def wrong_actions() -> dict[str, Any]:
    good = np.array([0.6, -0.3, 0.1, 1.0, 0.0, 0.0, 0.0, 0.0])
    return {
        "a hole": np.where(np.arange(8) == 1, np.nan, good),
        "no end": np.where(np.arange(8) == 7, np.inf, good),
        "too few": good[:7],
        "too many": np.append(good, 0.0),
        "a row": good[None],
        "no turn": np.where((np.arange(8) > 2) & (np.arange(8) < 7), 0.0, good),
        "words": np.array(["here"] * 8),
        "numbers in words": np.array(good, dtype=str),
        "masked": np.ma.masked_array(good, np.arange(8) == 2),
        "a masked number": [np.ma.masked, *good[1:]],
        "truth values": good > 0.5,
        "a huge integer": [10**400, *good[1:]],
        "a huge place": np.append(1e200, good[1:]),
        "nothing": None,
    }


WRONG = wrong_actions()


@pytest.mark.parametrize("name", sorted(WRONG))
def test_step_invalid_action_is_refused_without_motion(name: str):
    env = Manipulation("valve")
    env.reset(seed=0)
    env.step(displaced_action(env, (0.05, 0.0, 0.0)))
    before = env.cell.data.qpos.copy(), env.cell.data.qvel.copy(), env.cell.time
    with check_annotations(False), pytest.raises(InvalidInput, match="expected"):
        env.step(WRONG[name])
    assert np.array_equal(env.cell.data.qpos, before[0])
    assert np.array_equal(env.cell.data.qvel, before[1])
    assert env.cell.time == before[2]
    env.step(displaced_action(env))
    assert env.cell.time == pytest.approx(before[2] + 0.02)


NEAR = Pose(np.array([0.8, -0.3, 0.1]), np.array([1.0, 0.0, 0.0, 0.0]))
NOT_FINITE = Pose(np.array([0.8, np.nan, 0.1]), NEAR.quaternion)
FAR = Pose(np.array([1e155, 0.0, 0.0]), NEAR.quaternion)
LONG = Pose(NEAR.position, np.array([1e155, 0.0, 0.0, 0.0]))
LEVEL = np.array([1.0, 0.0, 0.0])
UNUSABLE_SITUATIONS: list[tuple[type, tuple[Any, ...], str]] = [
    (ValveSituation, (NOT_FINITE, 0.0, 1.0), r"the valve: position\[1\] is nan"),
    (ValveSituation, (FAR, 0.0, 1.0), "the valve: position.* is 1e"),
    (ValveSituation, (LONG, 0.0, 1.0), "the valve: quaternion"),
    (ValveSituation, (None, 0.0, 1.0), "the valve has type NoneType, expected Pose"),
    (
        ValveSituation,
        (NEAR, np.nan, 1.0),
        "start_angle of the handle is nan, expected a number from -100 to 100",
    ),
    (ValveSituation, (NEAR, 0.0, "1"), "goal_angle of the handle is '1', expected a number"),
    (StabSituation, (NOT_FINITE,), "the receptacle: position"),
    (CarabinerSituation, (NOT_FINITE, 0.0), "the rod: position"),
    (CarabinerSituation, (NEAR, 0.2), "the hook_position is 0.2, expected a number from -0.15 to 0.15"),
    (PlateSituation, (NOT_FINITE, 0), "the plate: position"),
    (PlateSituation, (NEAR, 21), "level of the obstacle is 21, expected a whole number from -3 to 20"),
    (PlateSituation, (NEAR, True), "level of the obstacle is True"),
    (ScrewdriverSituation, (NOT_FINITE, LEVEL, 0.01, 0.5, 0.0), "the middle of the screw's path: position"),
    (ScrewdriverSituation, (NEAR, 2 * LEVEL, 0.01, 0.5, 0.0), "expected a unit vector"),
    (ScrewdriverSituation, (NEAR, LEVEL, np.inf, 0.5, 0.0), "the amplitude is inf"),
    (ScrewdriverSituation, (NEAR, LEVEL, 0.01, np.nan, 0.0), "the frequency is nan"),
    (ScrewdriverSituation, (NEAR, LEVEL, 0.01, 0.5, 10**400), "the phase is a whole number of 1329 bits"),
    (RecordedValve, (NEAR, NOT_FINITE, NEAR), "the pose 'after': position"),
]


@pytest.mark.parametrize(("kind", "values", "message"), UNUSABLE_SITUATIONS)
def test_situation_with_unusable_values_is_refused(kind: type, values: tuple[Any, ...], message: str):
    with check_annotations(False), pytest.raises(InvalidInput, match=message):
        kind(*values)


@pytest.mark.parametrize("height", [-0.93, -0.9, 2.9])
def test_situation_out_of_reach_or_under_the_floor_is_refused_by_reset(height: float):
    for task in sorted(TASKS):
        drawn = TASKS[task].sample_situation(np.random.default_rng(0))
        thing = next(field.name for field in fields(drawn) if isinstance(getattr(drawn, field.name), Pose))
        at = getattr(drawn, thing)
        env = Manipulation(task)
        with suppress(InvalidInput):
            moved = replace(drawn, **{thing: Pose(np.append(at.position[:2], height), at.quaternion)})
            observation, _ = env.reset(options={"situation": moved})
            assert all(np.isfinite(value).all() for value in observation.values())


@pytest.mark.parametrize("task", [[], None, 3, ["valve"], "", "valves"])
def test_unknown_task_is_refused(task: Any):
    with (
        check_annotations(False),
        pytest.raises(InvalidInput, match="carabiner, plate, screwdriver, stab, valve"),
    ):
        Manipulation(task)


@pytest.mark.parametrize(
    "arguments",
    [{"seed": -1}, {"seed": "3"}, {"seed": True}, {"seed": 2**64}, {"options": []}, {"options": {3: 4}}],
)
def test_unusable_reset_is_refused(arguments: dict[str, Any]):
    with check_annotations(False), pytest.raises(InvalidInput, match="expected"):
        Manipulation("valve").reset(**arguments)


def test_step_at_time_limit_is_truncated():
    env = Manipulation("valve")
    env.task = replace(env.task, time_limit=0.1)
    env.reset(seed=0)
    cut = [env.step(displaced_action(env))[3] for _ in range(5)]
    assert cut == [False, False, False, False, True]


def test_step_lasts_twenty_milliseconds():
    env = Manipulation("valve")
    env.reset(seed=0)
    env.step(displaced_action(env))
    assert env.cell.time == pytest.approx(1.0 / env.metadata["render_fps"], abs=0.1 * Workcell.timestep)


def test_step_success_terminates_with_reward():
    env = Manipulation("valve")
    env.reset(seed=0)
    reward, done, _, info = env.step(displaced_action(env))[1:]
    assert (reward, done, info["success"]) == (0.0, False, False)
    assert "degrees from its goal" in info["reason"]
    env.cell.data.joint("valve").qpos[:] = env.cell.situation.goal_angle
    reward, done, _, info = env.step(displaced_action(env))[1:]
    assert (reward, done, info["success"], info["reason"]) == (1.0, True, True, "")
    assert info["error"] < 0.09


def test_reset_known_situation_is_used():
    task = TASKS["valve"]
    situation = task.sample_situation(np.random.default_rng(8))
    env = Manipulation("valve")
    observation = env.reset(seed=1, options={"situation": situation})[0]
    assert env.cell.situation is situation
    assert np.array_equal(observation["frames"][0, :3], situation.valve.position)
    assert np.array_equal(observation["joints"], Workcell(task, situation).arm.q)


def test_reset_invalid_situation_is_refused():
    env = Manipulation("valve")
    stab = TASKS["stab"].sample_situation(np.random.default_rng(0))
    with pytest.raises(
        InvalidInput, match=r"StabSituation, expected ValveSituation; sample one: TASKS\['valve'\]"
    ):
        env.reset(options={"situation": stab})
    with pytest.raises(InvalidInput, match="no option 'place', expected 'situation' only"):
        env.reset(options={"place": 1})
    with pytest.raises(InvalidInput, match="task is 'tea', expected one of carabiner, plate"):
        Manipulation("tea")
    with pytest.raises(InvalidInput, match="render_mode is 'human', expected None or 'rgb_array'"):
        Manipulation("valve", render_mode="human")


def test_cell_before_reset_is_refused():
    env = Manipulation("valve", render_mode="rgb_array")
    action = np.array([0.6, -0.3, 0.1, 1.0, 0.0, 0.0, 0.0, 0.0])
    for ask in (lambda: env.step(action), env.render, lambda: env.cell):
        with pytest.raises(InvalidInput, match="call reset first"):
            ask()
    env.reset(seed=0)
    env.close()
    env.close()
    with pytest.raises(InvalidInput, match="call reset first"):
        env.step(action)


def test_render_shows_scene():
    with_pictures = Manipulation("valve", render_mode="rgb_array")
    with_pictures.reset(seed=0)
    first = with_pictures.render()
    assert isinstance(first, np.ndarray)
    assert (first.shape, first.dtype) == ((480, 640, 3), np.uint8)
    assert len(np.unique(first.reshape(-1, 3), axis=0)) > 50
    for _ in range(10):
        with_pictures.step(displaced_action(with_pictures, (0.0, 0.1, 0.0)))
    moved = with_pictures.render()
    with_pictures.reset(seed=1)
    elsewhere = with_pictures.render()
    assert not np.array_equal(first, moved)
    assert not np.array_equal(first, elsewhere)
    with_pictures.close()


def test_render_without_mode_is_none():
    env = Manipulation("valve")
    assert env.render() is None
    env.reset(seed=0)
    assert env.render() is None


def test_gymnasium_wrappers_accept_environment():
    env: gymnasium.Env[Any, Any] = gymnasium.wrappers.TimeLimit(Manipulation("valve"), max_episode_steps=2)
    env = gymnasium.wrappers.RecordEpisodeStatistics(env)
    env.reset(seed=0)
    action = np.array([0.62, -0.35, 0.15, 0.7071, 0.0, 0.7071, 0.0, 0.0])
    env.step(action)
    *_, truncated, info = env.step(action)
    assert truncated
    assert info["episode"]["l"] == 2
