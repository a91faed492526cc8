"""The tasks as Gymnasium environments keep that interface's promises, and those of the physics behind."""

from contextlib import suppress
from dataclasses import fields, replace
from typing import Any

import gymnasium
import numpy as np
import pytest
from annotations import check_annotations
from gymnasium.utils.env_checker import check_env

from pilotfish.environments import TASKS, TIMESTEP, Manipulation, RecordedValve, Workcell
from pilotfish.environments.tasks.carabiner import CarabinerSituation
from pilotfish.environments.tasks.plate import PlateSituation
from pilotfish.environments.tasks.screwdriver import ScrewdriverSituation
from pilotfish.environments.tasks.stab import StabSituation
from pilotfish.environments.tasks.valve import ValveSituation
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose

pytestmark = pytest.mark.usefixtures("unchecked")

ObservationArrays = dict[str, np.ndarray]
GYMNASIUM_S_ADVICE = (  # that a learner may want other scales is for its own wrapper: units are SI here
    "ignore:.*we recommend using a symmetric and .* space:UserWarning",
    "ignore:.*observation space m.* value is -?infinity:UserWarning",
)


def held(
    env: Manipulation, away: tuple[float, float, float] = (0.0, 0.0, 0.0), grip: float = 0.0
) -> np.ndarray:
    """The action that asks for a place so far [m] from where the tool is, turned as it is."""
    tool = env.cell.arm.tool
    return np.concatenate([tool.position + np.array(away), tool.quaternion, [grip]])


def episode(
    task: str, seed: int, steps: int = 12
) -> list[tuple[ObservationArrays, float, bool, bool, dict[str, Any]]]:
    """Some steps that ask for places around where the tool is."""
    env, rng = Manipulation(task), np.random.default_rng(5)
    observation, info = env.reset(seed=seed)
    history = [(observation, 0.0, False, False, info)]
    for _ in range(steps):
        asked = held(env, tuple(0.05 * rng.normal(size=3)), rng.uniform())
        history.append(env.step(asked))
    env.close()
    return history


@pytest.mark.filterwarnings(*GYMNASIUM_S_ADVICE)
@pytest.mark.parametrize("task", sorted(TASKS))
def test_gymnasium_finds_nothing_wrong(task: str):
    """Its own checker accepts every task: spaces, seeds, what reset and step give, for any action."""
    check_env(Manipulation(task), skip_render_check=True)


@pytest.mark.parametrize("task", sorted(TASKS))
def test_an_episode_is_a_function_of_seed_and_actions(task: str):
    """The same seed and the same actions give the same bits; another seed another situation."""
    one, again, other = episode(task, 3), episode(task, 3), episode(task, 4)
    for (a, *rest), (b, *others) in zip(one, again, strict=True):
        assert {name: value.tobytes() for name, value in a.items()} == {
            name: value.tobytes() for name, value in b.items()
        }
        assert rest == others
    assert not np.array_equal(one[0][0]["frames"], other[0][0]["frames"])


def test_situations_go_on_from_one_reset_to_the_next():
    """Without a seed chance goes on: situations differ, and the same first seed repeats them all."""

    def places(seed: int) -> np.ndarray:
        env = Manipulation("valve")
        return np.stack([env.reset(seed=seed if n == 0 else None)[0]["frames"][0, :3] for n in range(3)])

    assert np.array_equal(places(1), places(1))
    assert len(np.unique(places(1), axis=0)) == 3


@pytest.mark.parametrize("task", sorted(TASKS))
def test_what_is_observed_is_what_the_physics_holds(task: str):
    """Joints, tool, grip, force and frames are those of the workcell, and lie in the space."""
    env = Manipulation(task)
    env.reset(seed=0)
    observation = env.step(held(env, (0.0, 0.01, 0.02), 0.5))[0]
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


def test_what_was_observed_stays_as_it_was():
    """An observation is a copy: steps that follow do not change it."""
    env = Manipulation("valve")
    before = env.reset(seed=0)[0]
    kept = {name: value.copy() for name, value in before.items()}
    for _ in range(5):
        env.step(held(env, (0.1, 0.0, 0.0), 1.0))
    assert all(np.array_equal(before[name], kept[name]) for name in kept)


def test_an_array_of_actions_may_be_used_again():
    """The environment keeps no hold of an action: changing the array afterwards changes nothing."""
    ends = []
    for fresh in (True, False):
        env = Manipulation("valve")
        env.reset(seed=0)
        action = held(env)
        for _ in range(10):
            action[:3] += 0.003
            tool = env.step(action.copy() if fresh else action)[0]["tool"]
        ends.append(tool)
    assert np.array_equal(*ends)


def test_the_arm_goes_where_it_is_asked():
    """Asked for one place for a second, the tool is within a centimetre of it."""
    env = Manipulation("valve")
    env.reset(seed=0)
    action = held(env, (0.05, -0.04, 0.06))
    for _ in range(50):
        observation = env.step(action)[0]
    assert np.linalg.norm(observation["tool"][:3] - action[:3]) < 0.01
    assert env.cell.time == pytest.approx(1.0)


@pytest.mark.parametrize("length", [0.01, 0.5, 2.0, 1e155, 1e308])
def test_the_length_of_a_quaternion_does_not_matter(length: float):
    """Of any length, and of either sign, it asks for the same turn."""
    states = []
    for factor in (1.0, length, -length):
        env = Manipulation("valve")
        env.reset(seed=0)
        action = held(env, (0.02, 0.0, 0.0))
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
def test_an_action_that_means_nothing_is_refused_and_nothing_moves(name: str):
    """The physics is to the last bit where it was, its clock too, and the next good action works."""
    env = Manipulation("valve")
    env.reset(seed=0)
    env.step(held(env, (0.05, 0.0, 0.0)))
    before = env.cell.data.qpos.copy(), env.cell.data.qvel.copy(), env.cell.time
    with check_annotations(False), pytest.raises(InvalidInput, match="expected"):
        env.step(WRONG[name])
    assert np.array_equal(env.cell.data.qpos, before[0])
    assert np.array_equal(env.cell.data.qvel, before[1])
    assert env.cell.time == before[2]
    env.step(held(env))
    assert env.cell.time == pytest.approx(before[2] + 0.02)


HERE = Pose(np.array([0.8, -0.3, 0.1]), np.array([1.0, 0.0, 0.0, 0.0]))
HOLE = Pose(np.array([0.8, np.nan, 0.1]), HERE.quaternion)
FAR = Pose(np.array([1e155, 0.0, 0.0]), HERE.quaternion)
LONG = Pose(HERE.position, np.array([1e155, 0.0, 0.0, 0.0]))
LEVEL = np.array([1.0, 0.0, 0.0])
UNUSABLE_SITUATIONS: list[tuple[type, tuple[Any, ...], str]] = [
    (ValveSituation, (HOLE, 0.0, 1.0), r"the valve: position\[1\] is nan"),
    (ValveSituation, (FAR, 0.0, 1.0), "the valve: position.* is 1e"),
    (ValveSituation, (LONG, 0.0, 1.0), "the valve: quaternion"),
    (ValveSituation, (None, 0.0, 1.0), "the valve has type NoneType, expected Pose"),
    (ValveSituation, (HERE, np.nan, 1.0), "angle begin is nan, expected a number from -100 to 100"),
    (ValveSituation, (HERE, 0.0, "1"), "angle end is '1', expected a number"),
    (StabSituation, (HOLE,), "the receptacle: position"),
    (CarabinerSituation, (HOLE, 0.0), "the rod: position"),
    (CarabinerSituation, (HERE, 0.2), "the place along the rod is 0.2, expected a number from -0.15 to 0.15"),
    (PlateSituation, (HOLE, 0), "the plate: position"),
    (PlateSituation, (HERE, 21), "level of the obstacle is 21, expected a whole number from -3 to 20"),
    (PlateSituation, (HERE, True), "level of the obstacle is True"),
    (ScrewdriverSituation, (HOLE, LEVEL, 0.01, 0.5, 0.0), "the middle of the screw's way: position"),
    (ScrewdriverSituation, (HERE, 2 * LEVEL, 0.01, 0.5, 0.0), "expected a direction of length one"),
    (ScrewdriverSituation, (HERE, LEVEL, np.inf, 0.5, 0.0), "the sway is inf"),
    (ScrewdriverSituation, (HERE, LEVEL, 0.01, np.nan, 0.0), "the pace is nan"),
    (ScrewdriverSituation, (HERE, LEVEL, 0.01, 0.5, 10**400), "the phase is a whole number of 1329 bits"),
    (RecordedValve, (HERE, HOLE, HERE), "the pose 'after': position"),
]


@pytest.mark.parametrize(("kind", "values", "message"), UNUSABLE_SITUATIONS)
def test_situation_with_unusable_values_is_refused(kind: type, values: tuple[Any, ...], message: str):
    """Before the physics is built, so that it never computes with what is not a number."""
    with check_annotations(False), pytest.raises(InvalidInput, match=message):
        kind(*values)


@pytest.mark.parametrize("height", [-0.93, -0.9, 2.9])
def test_situation_out_of_reach_or_under_the_floor_is_refused_by_reset(height: float):
    """The physics engine's own errors do not come through."""
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
    """Whatever it is."""
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
    """Seeds and options."""
    with check_annotations(False), pytest.raises(InvalidInput, match="expected"):
        Manipulation("valve").reset(**arguments)


def test_an_episode_is_cut_after_the_time_of_the_task():
    """Truncated with the step that fills the task's time, and not before."""
    env = Manipulation("valve")
    env.task = replace(env.task, seconds=0.1)
    env.reset(seed=0)
    cut = [env.step(held(env))[3] for _ in range(5)]
    assert cut == [False, False, False, False, True]


def test_a_step_is_twenty_milliseconds():
    """Fifty pictures a second are what the frames for a second say."""
    env = Manipulation("valve")
    env.reset(seed=0)
    env.step(held(env))
    assert env.cell.time == pytest.approx(1.0 / env.metadata["render_fps"], abs=0.1 * TIMESTEP)


def test_done_work_ends_the_episode_and_is_rewarded():
    """Terminated, rewarded and called a success together, when the task's own judge says so."""
    env = Manipulation("valve")
    env.reset(seed=0)
    reward, done, _, info = env.step(held(env))[1:]
    assert (reward, done, info["success"]) == (0.0, False, False)
    assert "degrees from where it was to be" in info["reason"]
    env.cell.data.joint("valve").qpos[:] = env.cell.situation.end
    reward, done, _, info = env.step(held(env))[1:]
    assert (reward, done, info["success"], info["reason"]) == (1.0, True, True, "")
    assert info["error"] < 0.09


def test_a_situation_that_is_known_can_be_set_up():
    """Options names it; the seed then is for what follows."""
    task = TASKS["valve"]
    where = task.sample_situation(np.random.default_rng(8))
    env = Manipulation("valve")
    observation = env.reset(seed=1, options={"situation": where})[0]
    assert env.cell.situation is where
    assert np.array_equal(observation["frames"][0, :3], where.valve.position)
    assert np.array_equal(observation["joints"], Workcell(task, where).arm.q)


def test_what_cannot_be_set_up_is_refused():
    """Another task's situation, an option that is none, and a name that is no task."""
    env = Manipulation("valve")
    stab = TASKS["stab"].sample_situation(np.random.default_rng(0))
    with pytest.raises(
        InvalidInput, match=r"StabSituation, expected ValveSituation; draw one: TASKS\['valve'\]"
    ):
        env.reset(options={"situation": stab})
    with pytest.raises(InvalidInput, match="no option 'place', expected 'situation'"):
        env.reset(options={"place": 1})
    with pytest.raises(InvalidInput, match="task is 'tea', expected one of carabiner, plate"):
        Manipulation("tea")
    with pytest.raises(InvalidInput, match="render_mode is 'human', expected None or 'rgb_array'"):
        Manipulation("valve", render_mode="human")


def test_before_the_first_reset_nothing_can_be_asked():
    """A step, a picture and the physics are refused with the remedy; so it is after closing."""
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


def test_pictures_show_what_is_there():
    """640 by 480, of more than one colour, another one when the arm has moved or the situation is another."""
    with_pictures = Manipulation("valve", render_mode="rgb_array")
    with_pictures.reset(seed=0)
    first = with_pictures.render()
    assert isinstance(first, np.ndarray)
    assert (first.shape, first.dtype) == ((480, 640, 3), np.uint8)
    assert len(np.unique(first.reshape(-1, 3), axis=0)) > 50
    for _ in range(10):
        with_pictures.step(held(with_pictures, (0.0, 0.1, 0.0)))
    moved = with_pictures.render()
    with_pictures.reset(seed=1)
    elsewhere = with_pictures.render()
    assert not np.array_equal(first, moved)
    assert not np.array_equal(first, elsewhere)
    with_pictures.close()


def test_without_a_render_mode_there_is_no_picture():
    """Render answers None, before and after reset, and needs no graphics."""
    env = Manipulation("valve")
    assert env.render() is None
    env.reset(seed=0)
    assert env.render() is None


def test_wrappers_of_gymnasium_go_around_it():
    """A limit of steps and a record of returns see what they expect."""
    env: gymnasium.Env[Any, Any] = gymnasium.wrappers.TimeLimit(Manipulation("valve"), max_episode_steps=2)
    env = gymnasium.wrappers.RecordEpisodeStatistics(env)
    env.reset(seed=0)
    action = np.array([0.62, -0.35, 0.15, 0.7071, 0.0, 0.7071, 0.0, 0.0])
    env.step(action)
    *_, truncated, info = env.step(action)
    assert truncated
    assert info["episode"]["l"] == 2
