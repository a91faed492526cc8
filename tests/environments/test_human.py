"""Simulated people reach their goals in the time of their movements and waits."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import ceil, inf, radians

import numpy as np
import pytest

from pilotfish.environments.human import (
    DemonstrationPlan,
    HumanModel,
    HumanState,
    Observation,
    Subtask,
    initial_state,
    step_human,
)
from pilotfish.environments.human.demonstration_plan import within_tolerance
from pilotfish.environments.human.human_state import Phase
from pilotfish.environments.human.pose_offsets import add_offset
from pilotfish.environments.human.submovements import submovement_duration
from pilotfish.geometry import Pose, angle, from_rotation_vector, normalise

TIMESTEP = 0.025  # of which all delays are multiples
DELAYS = [0.0, 0.25, 0.5, 1.0, 2.0]
EXACT = 1e-12
NOISELESS = HumanModel(
    parallel_noise=0.0,
    perpendicular_noise=0.0,
    min_noise=0.0,
    angular_noise=0.0,
    min_angular_noise=0.0,
    gain=1.0,
)
AT = Pose(np.array([0.6, -0.2, 0.3]), np.array([1.0, 0.0, 0.0, 0.0]))


def random_pose(rng: np.random.Generator, spread: float = 0.3) -> Pose:
    return Pose(rng.uniform(-spread, spread, 3), normalise(rng.normal(size=4)))


def reach_frame(name: str, **settings: object) -> Subtask:
    """Return a subtask whose goal is the frame of that name."""
    tolerances = {"position_tolerance": 0.005, "angle_tolerance": radians(3.0)}
    return Subtask(name, lambda frames: frames[name], **(tolerances | settings))


@dataclass
class RemoteTool:
    """Tool that follows delayed commands with a first-order lag."""

    tool: Pose
    delay: float
    lag: float = 0.0
    wall: float = inf
    commands: list[Pose] = field(default_factory=list)

    def follow(self, command: Pose) -> Pose:
        """Return the tool one step later; it cannot pass the wall in x."""
        self.commands.append(command)
        delayed = self.commands[max(0, len(self.commands) - 1 - round(self.delay / TIMESTEP))]
        share = 1.0 if self.lag == 0.0 else 1.0 - np.exp(-TIMESTEP / self.lag)
        position = self.tool.position + share * (delayed.position - self.tool.position)
        position[0] = min(position[0], self.wall)
        start = self.tool.quaternion if share < 1.0 else delayed.quaternion
        start = start if start @ delayed.quaternion >= 0 else -start
        self.tool = Pose(position, normalise(start + share * (delayed.quaternion - start)))
        return self.tool


def run_until_done(
    plan: DemonstrationPlan,
    remote: RemoteTool,
    frames: Mapping[str, Pose],
    rng: np.random.Generator,
    time_limit: float = 300.0,
) -> tuple[list[HumanState], list[Pose]]:
    """Return the states and the poses of the tool until the person is done."""
    state = initial_state(remote.tool, 0.0)
    states: list[HumanState] = []
    tools: list[Pose] = []
    for n in range(1, round(time_limit / TIMESTEP)):
        state = step_human(plan, state, n * TIMESTEP, Observation(remote.tool, frames), rng)
        states.append(state)
        tools.append(remote.follow(state.hand))
        if state.done:
            return states, tools
    raise AssertionError(f"not done after {time_limit} s")


@pytest.mark.parametrize("delay", DELAYS)
@pytest.mark.parametrize("seed", range(6))
def test_step_human_every_delay_reaches_goals(delay: float, seed: int):
    rng = np.random.default_rng(seed)
    frames = {name: random_pose(rng) for name in ("near", "far")}
    subtasks = (reach_frame("near", dwell=0.2, grip=1.0), reach_frame("far", grip=0.3))
    remote = RemoteTool(random_pose(rng), delay, lag=0.1)
    states, tools = run_until_done(DemonstrationPlan(HumanModel(), subtasks, delay), remote, frames, rng)
    assert states[-1].n_timeouts == 0
    left = next(n for n, state in enumerate(states) if state.subtask == 1)
    assert within_tolerance(tools[left - 1], frames["near"], subtasks[0])
    assert within_tolerance(tools[-1], frames["far"], subtasks[1])
    assert states[left].grip == 1.0
    assert states[-1].grip == 0.3


@pytest.mark.parametrize("delay", DELAYS)
def test_step_human_time_is_sum_of_movements_and_waits(delay: float, rng: np.random.Generator):
    human_model, subtask = HumanModel(), reach_frame("goal")
    frames = {"goal": random_pose(rng)}
    states, _ = run_until_done(
        DemonstrationPlan(human_model, (subtask,), delay), RemoteTool(random_pose(rng), delay), frames, rng
    )
    begun = [
        state
        for state, before in zip(states[1:], states, strict=False)
        if state.n_submovements > before.n_submovements
    ]
    submovements = [states[0].submovements[0], *(state.submovements[0] for state in begun)]
    assert len(submovements) == states[-1].n_submovements
    ticks = sum(
        ceil((move.duration + human_model.reaction_time + delay) / TIMESTEP - 1e-6) for move in submovements
    )
    reached = next(state.time for state in states if state.dwell_end < inf)
    assert reached == pytest.approx(TIMESTEP + ticks * TIMESTEP, abs=1e-9)


def test_step_human_time_grows_with_delay():
    frames, subtask = {"goal": AT}, reach_frame("goal")
    start = Pose(AT.position - 0.2, AT.quaternion)
    times = []
    for delay in DELAYS:
        plan = DemonstrationPlan(NOISELESS, (subtask,), delay)
        states, _ = run_until_done(plan, RemoteTool(start, delay), frames, np.random.default_rng(0))
        assert states[-1].n_submovements == 1
        times.append(states[-1].time)
    np.testing.assert_allclose(np.array(times) - times[0], DELAYS, atol=1e-9)


def test_step_human_without_noise_moves_straight(rng: np.random.Generator):
    start, goal = random_pose(rng), random_pose(rng)
    states, _ = run_until_done(
        DemonstrationPlan(NOISELESS, (reach_frame("goal"),)), RemoteTool(start, 0.0), {"goal": goal}, rng
    )
    assert states[-1].path_length == pytest.approx(np.linalg.norm(goal.position - start.position), rel=1e-9)
    steps = np.diff([state.hand.position for state in states], axis=0)
    assert np.linalg.norm(steps, axis=1).max() <= NOISELESS.peak_speed * TIMESTEP * (1 + 1e-9)


@pytest.mark.parametrize("speed", [1.0, 0.3])
def test_step_human_speed_factor_limits_speed(speed: float):
    start = Pose(AT.position - 0.3, AT.quaternion)
    plan = DemonstrationPlan(NOISELESS, (reach_frame("goal", speed_factor=speed),))
    states, _ = run_until_done(plan, RemoteTool(start, 0.0), {"goal": AT}, np.random.default_rng(0))
    steps = np.linalg.norm(np.diff([state.hand.position for state in states], axis=0), axis=1) / TIMESTEP
    assert steps.max() == pytest.approx(speed * NOISELESS.peak_speed, rel=1e-3)


def test_step_human_dwell_keeps_hand(rng: np.random.Generator):
    subtasks = (reach_frame("near", dwell=0.7, grip=0.8), reach_frame("far"))
    frames = {"near": random_pose(rng), "far": random_pose(rng)}
    states, _ = run_until_done(
        DemonstrationPlan(NOISELESS, subtasks), RemoteTool(random_pose(rng), 0.0), frames, rng
    )
    gripped = next(n for n, state in enumerate(states) if state.grip == 0.8)
    left = next(n for n, state in enumerate(states) if state.subtask == 1)
    assert (left - gripped) * TIMESTEP == pytest.approx(0.7)
    for state in states[gripped : left + 1]:
        np.testing.assert_array_equal(state.hand.position, states[gripped].hand.position)


@pytest.mark.parametrize("delay", [0.0, 0.5, 2.0])
def test_step_human_passing_goal_is_passed_without_stop(delay: float, rng: np.random.Generator):
    tolerance = 0.02
    start, end = (add_offset(AT, np.array([*way, 0.0, 0.0, 0.0])) for way in ((-0.2,) * 3, (0.2, -0.2, -0.1)))
    frames = {"over": AT, "end": end}
    subtasks = (reach_frame("over", passing=True, position_tolerance=tolerance, grip=0.5), reach_frame("end"))
    states, tools = run_until_done(
        DemonstrationPlan(NOISELESS, subtasks, delay), RemoteTool(start, delay), frames, rng
    )
    hands = np.array([state.hand.position for state in states])
    assert np.linalg.norm(hands - AT.position, axis=1).min() <= tolerance
    assert states[-1].grip == 0.0
    assert states[-1].n_submovements == 2
    assert within_tolerance(tools[-1], end, subtasks[1])
    turning = next(n for n, state in enumerate(states) if state.subtask == 1)
    assert states[turning].grip == 0.5
    moving = np.linalg.norm(np.diff(hands, axis=0), axis=1)[turning - 2 : turning + 8] / TIMESTEP
    assert moving.min() > 0.01
    assert np.abs(np.diff(moving)).max() < 0.04  # no jump: a minimum-jerk movement begins with no speed


def test_step_human_blocked_tool_lead_is_limited(rng: np.random.Generator):
    human_model = replace(HumanModel(), timeout=20.0, max_lead=0.03)
    start = Pose(AT.position - np.array([0.3, 0.1, 0.0]), AT.quaternion)
    remote = RemoteTool(start, 0.25, lag=0.05, wall=AT.position[0] - 0.05)
    plan = DemonstrationPlan(human_model, (reach_frame("goal", grip=1.0), reach_frame("start")), 0.25)
    states, tools = run_until_done(plan, remote, {"goal": AT, "start": start}, rng)
    pressed = [n for n, state in enumerate(states) if n * TIMESTEP > 4.0 and state.subtask == 0]
    ahead = [np.linalg.norm(states[n].hand.position - tools[n].position) for n in pressed]
    assert max(ahead) < human_model.max_lead + 0.05 + 5 * human_model.parallel_noise * 0.05
    assert max(ahead) > human_model.max_lead
    assert states[-1].n_timeouts == 1
    assert states[pressed[-1]].grip == 0.0
    assert pressed[-1] * TIMESTEP == pytest.approx(human_model.timeout, abs=1.0)
    assert within_tolerance(tools[-1], start, plan.subtasks[1])


def test_step_human_constant_offset_is_corrected(rng: np.random.Generator):
    droop = Pose(np.array([0.0, 0.0, -0.03]), from_rotation_vector(np.array([0.0, 0.1, 0.0])))
    plan, state, tool = DemonstrationPlan(HumanModel(), (reach_frame("goal"),)), initial_state(AT, 0.0), AT
    frames = {"goal": Pose(AT.position + 0.1, AT.quaternion)}
    for n in range(1, 3000):
        state = step_human(plan, state, n * TIMESTEP, Observation(tool, frames), rng)
        tool = Pose(state.hand.position + droop.position, (state.hand @ droop).quaternion)
        if state.done:
            break
    assert state.n_timeouts == 0
    assert within_tolerance(tool, frames["goal"], plan.subtasks[0])


@pytest.mark.parametrize("delay", [0.0, 1.0])
@pytest.mark.parametrize("tracking", [False, True])
def test_step_human_moved_world_moves_hand(delay: float, tracking: bool, rng: np.random.Generator):
    new_from_old, start, goal = (random_pose(rng) for _ in range(3))
    over = random_pose(rng)
    subtasks = (
        reach_frame("over", passing=True, position_tolerance=0.03),
        reach_frame("goal", tracking=tracking, dwell=0.5),
    )
    runs = []
    for moved in (Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])), new_from_old):
        frames = {"goal": moved @ goal, "over": moved @ over}
        noise = np.random.default_rng(7)
        states, _ = run_until_done(
            DemonstrationPlan(HumanModel(), subtasks, delay), RemoteTool(moved @ start, delay), frames, noise
        )
        runs.append(states)
    assert len(runs[0]) == len(runs[1])
    for old, new in zip(*runs, strict=True):
        np.testing.assert_allclose(new.hand.position, (new_from_old @ old.hand).position, atol=1e-9)
        assert angle(new.hand.quaternion, (new_from_old @ old.hand).quaternion) < 1e-7


def test_step_human_same_seed_is_bit_identical(rng: np.random.Generator):
    start, goal = random_pose(rng), random_pose(rng)
    runs = []
    for _ in range(2):
        plan, remote = (
            DemonstrationPlan(HumanModel(), (reach_frame("goal"),), 0.5),
            RemoteTool(start, 0.5, lag=0.1),
        )
        runs.append(run_until_done(plan, remote, {"goal": goal}, np.random.default_rng(3))[0])
    for first, second in zip(*runs, strict=True):
        assert first.hand.position.tobytes() == second.hand.position.tobytes()
        assert first.hand.quaternion.tobytes() == second.hand.quaternion.tobytes()


def test_step_human_input_state_is_unchanged(rng: np.random.Generator):
    plan, observation = (
        DemonstrationPlan(HumanModel(), (reach_frame("goal"),)),
        Observation(AT, {"goal": random_pose(rng)}),
    )
    first = step_human(plan, initial_state(AT, 0.0), TIMESTEP, observation, rng)
    once, again = (step_human(plan, first, 0.2, observation, rng) for _ in range(2))
    np.testing.assert_array_equal(once.hand.position, again.hand.position)
    assert first.time == TIMESTEP
    assert first.phase is Phase.MOVE_AND_WAIT


def test_step_human_quaternion_sign_has_no_effect(rng: np.random.Generator):
    goal = add_offset(AT, np.array([0.1, 0.0, 0.0, 0.5, 0.0, 0.0]))
    flipped = Pose(goal.position, -goal.quaternion)
    ends = []
    for target in (goal, flipped):
        states, _ = run_until_done(
            DemonstrationPlan(NOISELESS, (reach_frame("goal"),)),
            RemoteTool(AT, 0.0),
            {"goal": target},
            np.random.default_rng(0),
        )
        ends.append(states[-1])
    assert ends[0].time == ends[1].time
    assert submovement_duration(NOISELESS, np.array([0.1, 0, 0, 0.5, 0, 0]), 1.0) < 1.0
    np.testing.assert_allclose(ends[0].hand.quaternion, ends[1].hand.quaternion, atol=EXACT)
