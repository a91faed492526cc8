"""People reach what they set out to reach, in the time that moving and waiting takes."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import ceil, inf, radians

import numpy as np
import pytest

from pilotfish.environments.human import (
    DemonstrationPlan,
    HandCommand,
    HumanModel,
    HumanState,
    Observation,
    Phase,
    Subtask,
    duration,
    initial_state,
    step_human,
    within_tolerance,
)
from pilotfish.environments.human.offsets import add_offset
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
    """An act whose goal is the frame of that name."""
    tolerances = {"position_tolerance": 0.005, "angle_tolerance": radians(3.0)}
    return Subtask(name, lambda frames: frames[name], **(tolerances | settings))


@dataclass
class RemoteTool:
    """An imaginary tool that goes where it is asked with a first-order lag, over a line with a delay."""

    tool: Pose
    delay: float
    lag: float = 0.0
    wall: float = inf
    commands: list[Pose] = field(default_factory=list)

    def follow(self, command: Pose) -> Pose:
        """The tool one tick on; it hears what was wished a delay ago, and cannot pass the wall in x."""
        self.commands.append(command)
        delayed = self.commands[max(0, len(self.commands) - 1 - round(self.delay / TIMESTEP))]
        share = 1.0 if self.lag == 0.0 else 1.0 - np.exp(-TIMESTEP / self.lag)
        position = self.tool.position + share * (delayed.position - self.tool.position)
        position[0] = min(position[0], self.wall)
        turned = self.tool.quaternion if share < 1.0 else delayed.quaternion
        turned = turned if turned @ delayed.quaternion >= 0 else -turned
        self.tool = Pose(position, normalise(turned + share * (delayed.quaternion - turned)))
        return self.tool


def run_until_done(
    plan: DemonstrationPlan,
    remote: RemoteTool,
    frames: Mapping[str, Pose],
    rng: np.random.Generator,
    longest: float = 300.0,
) -> tuple[list[HumanState], list[HandCommand], list[Pose]]:
    """All steps until the person is done."""
    state = initial_state(remote.tool, 0.0)
    history: tuple[list[HumanState], list[HandCommand], list[Pose]] = [], [], []
    for n in range(1, round(longest / TIMESTEP)):
        state, command = step_human(plan, state, n * TIMESTEP, Observation(remote.tool, frames), rng)
        for kept, value in zip(history, (state, command, remote.follow(command.pose)), strict=True):
            kept.append(value)
        if command.done:
            return history
    raise AssertionError(f"not done after {longest} s")


@pytest.mark.parametrize("delay", DELAYS)
@pytest.mark.parametrize("seed", range(6))
def test_people_reach_their_goals_whatever_the_delay(delay: float, seed: int):
    """At the end of each act the tool is within the act's tolerances of its goal, by its own lag or none."""
    rng = np.random.default_rng(seed)
    frames = {name: random_pose(rng) for name in ("near", "far")}
    subtasks = (reach_frame("near", dwell=0.2, grip=1.0), reach_frame("far", grip=0.3))
    remote = RemoteTool(random_pose(rng), delay, lag=0.1)
    states, commands, tools = run_until_done(
        DemonstrationPlan(HumanModel(), subtasks, delay), remote, frames, rng
    )
    assert states[-1].n_timeouts == 0
    left = next(n for n, command in enumerate(commands) if command.subtask == 1)
    assert within_tolerance(tools[left - 1], frames["near"], subtasks[0])
    assert within_tolerance(tools[-1], frames["far"], subtasks[1])
    assert commands[left].grip == 1.0
    assert commands[-1].grip == 0.3


@pytest.mark.parametrize("delay", DELAYS)
def test_reaching_takes_its_movements_and_a_wait_after_each(delay: float, rng: np.random.Generator):
    """The time is that of n sub-movements and n times reaction + round trip, on whole ticks."""
    human_model, subtask = HumanModel(), reach_frame("goal")
    frames = {"goal": random_pose(rng)}
    states, _, _ = run_until_done(
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


def test_time_grows_with_the_delay():
    """With the same aim one movement is made, and every second of delay adds a second."""
    frames, subtask = {"goal": AT}, reach_frame("goal")
    start = Pose(AT.position - 0.2, AT.quaternion)
    times = []
    for delay in DELAYS:
        plan = DemonstrationPlan(NOISELESS, (subtask,), delay)
        states, _, _ = run_until_done(plan, RemoteTool(start, delay), frames, np.random.default_rng(0))
        assert states[-1].n_submovements == 1
        times.append(states[-1].time)
    np.testing.assert_allclose(np.array(times) - times[0], DELAYS, atol=1e-9)


def test_a_precise_hand_goes_straight(rng: np.random.Generator):
    """Without noise and delay the path is the distance, and the speed never above the peak."""
    start, goal = random_pose(rng), random_pose(rng)
    states, commands, _ = run_until_done(
        DemonstrationPlan(NOISELESS, (reach_frame("goal"),)), RemoteTool(start, 0.0), {"goal": goal}, rng
    )
    assert states[-1].path_length == pytest.approx(np.linalg.norm(goal.position - start.position), rel=1e-9)
    steps = np.diff([command.pose.position for command in commands], axis=0)
    assert np.linalg.norm(steps, axis=1).max() <= NOISELESS.peak_speed * TIMESTEP * (1 + 1e-9)


@pytest.mark.parametrize("speed", [1.0, 0.3])
def test_careful_acts_are_slower(speed: float):
    """The peak speed is the act's share of the person's."""
    start = Pose(AT.position - 0.3, AT.quaternion)
    plan = DemonstrationPlan(NOISELESS, (reach_frame("goal", speed=speed),))
    _, commands, _ = run_until_done(plan, RemoteTool(start, 0.0), {"goal": AT}, np.random.default_rng(0))
    steps = (
        np.linalg.norm(np.diff([command.pose.position for command in commands], axis=0), axis=1) / TIMESTEP
    )
    assert steps.max() == pytest.approx(speed * NOISELESS.peak_speed, rel=1e-3)


def test_a_dwell_is_stayed(rng: np.random.Generator):
    """After the grip has changed the hand stays for the dwell, then goes on."""
    subtasks = (reach_frame("near", dwell=0.7, grip=0.8), reach_frame("far"))
    frames = {"near": random_pose(rng), "far": random_pose(rng)}
    _, commands, _ = run_until_done(
        DemonstrationPlan(NOISELESS, subtasks), RemoteTool(random_pose(rng), 0.0), frames, rng
    )
    gripped = next(n for n, command in enumerate(commands) if command.grip == 0.8)
    left = next(n for n, command in enumerate(commands) if command.subtask == 1)
    assert (left - gripped) * TIMESTEP == pytest.approx(0.7)
    for command in commands[gripped : left + 1]:
        np.testing.assert_array_equal(command.pose.position, commands[gripped].pose.position)


@pytest.mark.parametrize("delay", [0.0, 0.5, 2.0])
def test_passed_goals_are_passed_within_tolerance_and_without_stopping(
    delay: float, rng: np.random.Generator
):
    """A precise hand comes as near to a goal on the way as its tolerance, at speed, and ends at the last."""
    tolerance = 0.02
    start, end = (add_offset(AT, np.array([*way, 0.0, 0.0, 0.0])) for way in ((-0.2,) * 3, (0.2, -0.2, -0.1)))
    frames = {"over": AT, "end": end}
    subtasks = (reach_frame("over", passing=True, position_tolerance=tolerance, grip=0.5), reach_frame("end"))
    states, commands, tools = run_until_done(
        DemonstrationPlan(NOISELESS, subtasks, delay), RemoteTool(start, delay), frames, rng
    )
    hands = np.array([command.pose.position for command in commands])
    assert np.linalg.norm(hands - AT.position, axis=1).min() <= tolerance
    assert commands[-1].grip == 0.0
    assert states[-1].n_submovements == 2
    assert within_tolerance(tools[-1], end, subtasks[1])
    turning = next(n for n, command in enumerate(commands) if command.subtask == 1)
    assert commands[turning].grip == 0.5
    moving = np.linalg.norm(np.diff(hands, axis=0), axis=1)[turning - 2 : turning + 8] / TIMESTEP
    assert moving.min() > 0.01
    assert np.abs(np.diff(moving)).max() < 0.04  # no jump: a minimum-jerk movement begins with no speed


def test_a_hand_does_not_wind_up_against_a_wall(rng: np.random.Generator):
    """Where the tool cannot go on, the hand stays ahead of it by the lean and what is still to go at most,
    and the act is given up when patience ends.
    """
    human_model = replace(HumanModel(), timeout=20.0, max_lead=0.03)
    start = Pose(AT.position - np.array([0.3, 0.1, 0.0]), AT.quaternion)
    remote = RemoteTool(start, 0.25, lag=0.05, wall=AT.position[0] - 0.05)
    plan = DemonstrationPlan(human_model, (reach_frame("goal", grip=1.0), reach_frame("start")), 0.25)
    states, commands, tools = run_until_done(plan, remote, {"goal": AT, "start": start}, rng)
    pressed = [n for n, command in enumerate(commands) if n * TIMESTEP > 4.0 and command.subtask == 0]
    ahead = [np.linalg.norm(commands[n].pose.position - tools[n].position) for n in pressed]
    assert max(ahead) < human_model.max_lead + 0.05 + 5 * human_model.parallel_noise * 0.05
    assert max(ahead) > human_model.max_lead
    assert states[-1].n_timeouts == 1
    assert commands[pressed[-1]].grip == 0.0
    assert pressed[-1] * TIMESTEP == pytest.approx(human_model.timeout, abs=1.0)
    assert within_tolerance(tools[-1], start, plan.subtasks[1])


def test_a_tool_that_hangs_is_brought_to_its_goal(rng: np.random.Generator):
    """What comes of a wish may differ from it by less than the lean: the error seen is corrected still."""
    droop = Pose(np.array([0.0, 0.0, -0.03]), from_rotation_vector(np.array([0.0, 0.1, 0.0])))
    plan, state, tool = DemonstrationPlan(HumanModel(), (reach_frame("goal"),)), initial_state(AT, 0.0), AT
    frames = {"goal": Pose(AT.position + 0.1, AT.quaternion)}
    for n in range(1, 3000):
        state, command = step_human(plan, state, n * TIMESTEP, Observation(tool, frames), rng)
        tool = Pose(command.pose.position + droop.position, (command.pose @ droop).quaternion)
        if command.done:
            break
    assert state.n_timeouts == 0
    assert within_tolerance(tool, frames["goal"], plan.subtasks[0])


@pytest.mark.parametrize("delay", [0.0, 1.0])
@pytest.mark.parametrize("tracking", [False, True])
def test_moving_the_world_moves_the_wish(delay: float, tracking: bool, rng: np.random.Generator):
    """With tool and objects moved by a pose, and the same noise, the hand is moved by it at all times."""
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
        _, commands, _ = run_until_done(
            DemonstrationPlan(HumanModel(), subtasks, delay), RemoteTool(moved @ start, delay), frames, noise
        )
        runs.append(commands)
    assert len(runs[0]) == len(runs[1])
    for old, new in zip(*runs, strict=True):
        np.testing.assert_allclose(new.pose.position, (new_from_old @ old.pose).position, atol=1e-9)
        assert angle(new.pose.quaternion, (new_from_old @ old.pose).quaternion) < 1e-7


def test_the_same_seed_gives_the_same_bits(rng: np.random.Generator):
    """A person is a function: repeated with the same noise, every wish is the same to the last bit."""
    start, goal = random_pose(rng), random_pose(rng)
    runs = []
    for _ in range(2):
        plan, remote = (
            DemonstrationPlan(HumanModel(), (reach_frame("goal"),), 0.5),
            RemoteTool(start, 0.5, lag=0.1),
        )
        runs.append(run_until_done(plan, remote, {"goal": goal}, np.random.default_rng(3))[1])
    for one, other in zip(*runs, strict=True):
        assert one.pose.position.tobytes() == other.pose.position.tobytes()
        assert one.pose.quaternion.tobytes() == other.pose.quaternion.tobytes()


def test_a_step_changes_no_value_it_was_given(rng: np.random.Generator):
    """A step from an earlier value again gives what it gave before: nothing was kept elsewhere."""
    plan, observation = (
        DemonstrationPlan(HumanModel(), (reach_frame("goal"),)),
        Observation(AT, {"goal": random_pose(rng)}),
    )
    first, _ = step_human(plan, initial_state(AT, 0.0), TIMESTEP, observation, rng)
    once, again = (step_human(plan, first, 0.2, observation, rng)[1] for _ in range(2))
    np.testing.assert_array_equal(once.pose.position, again.pose.position)
    assert first.time == TIMESTEP
    assert first.phase is Phase.MOVE_AND_WAIT


def test_quaternion_signs_do_not_matter(rng: np.random.Generator):
    """Q and -q are one orientation: the hand goes the short way whichever is given."""
    goal = add_offset(AT, np.array([0.1, 0.0, 0.0, 0.5, 0.0, 0.0]))
    flipped = Pose(goal.position, -goal.quaternion)
    ends = []
    for target in (goal, flipped):
        states, _, _ = run_until_done(
            DemonstrationPlan(NOISELESS, (reach_frame("goal"),)),
            RemoteTool(AT, 0.0),
            {"goal": target},
            np.random.default_rng(0),
        )
        ends.append(states[-1])
    assert ends[0].time == ends[1].time
    assert duration(NOISELESS, np.array([0.1, 0, 0, 0.5, 0, 0]), 1.0) < 1.0
    np.testing.assert_allclose(ends[0].hand.quaternion, ends[1].hand.quaternion, atol=EXACT)
