"""A recording holds the commands of a leader and depends on its seed alone."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pilotfish.demonstrations import Demonstration, Frame, MovingFrame, frame_from_pose
from pilotfish.environments import TASKS, Outcome, Task, Workcell, human
from pilotfish.environments.tasks.screwdriver import screw_pose
from pilotfish.errors import SkillError
from pilotfish.geometry import Pose, angle
from pilotfish.io.demonstration_folder import read_demonstrations, write_demonstrations
from pilotfish.simulation.recording import (
    MAX_ATTEMPTS,
    PERIOD,
    SPLITS,
    Leader,
    RecordedDemonstration,
    delay_observations,
    record,
    record_demonstrations,
    simulated_leader,
    situation_from_seed,
    task_layout,
)

pytestmark = pytest.mark.usefixtures("unchecked")

VALVE, SCREWDRIVER = TASKS["valve"], TASKS["screwdriver"]

UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])


def constant_velocity_leader(
    velocity: tuple[float, float, float], seconds: float, grip_from: float = np.inf
) -> Leader:
    """Return a leader with constant velocity [m/s] that grips from a time on [s]."""
    begun: list[Pose] = []

    def lead(time: float, observation: human.Observation) -> tuple[Pose, float, bool]:
        begun.append(observation.tool)
        place = begun[0].position + time * np.array(velocity)
        return Pose(place, begun[0].quaternion), float(time >= grip_from), time >= seconds

    return lead


def same(a: RecordedDemonstration, b: RecordedDemonstration) -> bool:
    """Return whether two recordings are bit-identical."""
    pairs = zip(a.demonstration.frames, b.demonstration.frames, strict=True)
    frames = all(f.A.tobytes() == g.A.tobytes() and f.b.tobytes() == g.b.tobytes() for f, g in pairs)
    rows = a.demonstration.x.tobytes() == b.demonstration.x.tobytes()
    return (
        rows and frames and (a.outcome, a.peak_forces, a.duration) == (b.outcome, b.peak_forces, b.duration)
    )


def test_record_demonstrations_same_seed_is_equal(alignment_task: Task[Any], tmp_path: Path):
    one, again = ([made for made, _ in record_demonstrations(alignment_task, 2, 7)] for _ in range(2))
    ((other, _),) = record_demonstrations(alignment_task, 1, 8)
    assert all(map(same, one, again))
    assert not same(one[0], one[1])
    assert not same(one[0], other)
    for name, made in (("one", one), ("again", again)):
        write_demonstrations([recording.demonstration for recording in made], tmp_path / name)
    files = sorted(path.name for path in (tmp_path / "one").iterdir())
    assert files == sorted(path.name for path in (tmp_path / "again").iterdir())
    for name in files:
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "again" / name).read_bytes()


def test_situation_from_seed_depends_on_all_arguments():
    chosen = [(split, seed, m) for split in SPLITS for seed in range(3) for m in range(5)]
    places = [situation_from_seed(VALVE, *which).valve.position for which in chosen]
    assert all(
        np.array_equal(situation_from_seed(VALVE, *which).valve.position, place)
        for which, place in zip(chosen, places, strict=True)
    )
    assert len(np.unique(places, axis=0)) == len(chosen)


@pytest.mark.parametrize("seconds", [0.1, 0.5, 1.0])
def test_record_rows_have_period(seconds: float):
    made = record(
        VALVE,
        situation_from_seed(VALVE, "demonstration", 0, 0),
        constant_velocity_leader((0, 0, 0), seconds),
        "x",
    )
    rows = len(made.demonstration.x)
    assert made.demonstration.period == PERIOD == 0.1
    assert made.duration == pytest.approx((rows - 1) * PERIOD)
    assert seconds <= made.duration < seconds + 2 * PERIOD


def test_record_constant_velocity_gives_equal_steps():
    velocity = np.array([0.03, -0.02, 0.05])
    made = record(
        VALVE,
        situation_from_seed(VALVE, "demonstration", 0, 0),
        constant_velocity_leader((0.03, -0.02, 0.05), 1.5),
        "x",
    )
    steps = np.diff(made.demonstration.x[:, :3], axis=0)
    np.testing.assert_allclose(steps[8:], np.tile(PERIOD * velocity, (len(steps[8:]), 1)), atol=5e-4)


def test_record_starts_at_start_pose():
    situation = situation_from_seed(VALVE, "demonstration", 0, 3)
    made = record(VALVE, situation, constant_velocity_leader((0.1, 0.0, 0.0), 0.2), "x")
    start_pose = VALVE.start_pose(situation)
    assert np.linalg.norm(made.demonstration.x[0, :3] - start_pose.position) < 1e-3
    assert angle(made.demonstration.x[0, 3:7], start_pose.quaternion) < 0.01
    assert np.array_equal(
        made.demonstration.x[0, :3], Workcell(VALVE, situation, guided=True).target.position
    )


def test_record_keeps_commanded_pose():
    situation = situation_from_seed(VALVE, "demonstration", 0, 0)
    way = situation.valve.position + np.array([0.12, 0.1, 0.0]) - VALVE.start_pose(situation).position
    push = constant_velocity_leader(tuple(way), 1.0)
    reached: list[Pose] = []

    def lead(time: float, observation: human.Observation) -> tuple[Pose, float, bool]:
        reached.append(observation.tool)
        return push(time, observation)

    made = record(VALVE, situation, lead, "x")
    assert made.peak_forces["tool"] > 10.0
    assert np.linalg.norm(made.demonstration.x[-1, :3] - reached[-1].position) > 0.01


@pytest.mark.parametrize("name", sorted(TASKS))
def test_record_grip_column_exists_with_gripper(name: str, checked: None):
    task = TASKS[name]
    made = record(
        task,
        situation_from_seed(task, "demonstration", 0, 0),
        constant_velocity_leader((0, 0, 0), 0.5, grip_from=0.3),
        "x",
    )
    layout = made.demonstration.layout
    assert layout == task_layout(task)
    assert ("grip" in layout.names) == task.has_gripper == (layout.width == 8)
    if task.has_gripper:
        assert (
            made.demonstration.x[:, 7].tolist()
            == [0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0][: len(made.demonstration.x)]
        )


@pytest.mark.parametrize("name", [name for name in sorted(TASKS) if TASKS[name].actuate_scene is None])
def test_record_frames_equal_objects(name: str):
    task = TASKS[name]
    situation = situation_from_seed(task, "demonstration", 0, 2)
    made = record(task, situation, constant_velocity_leader((0, 0, 0), 0.1), "x").demonstration
    observation = Workcell(task, situation).frames()
    assert [frame.name for frame in made.frames] == list(task.frames)
    for frame in made.frames:
        assert isinstance(frame, Frame)
        expected = frame_from_pose(frame.name, made.layout, observation[frame.name])
        assert np.array_equal(frame.b, expected.b)
        assert np.array_equal(frame.A, expected.A)


def test_record_moving_objects_give_moving_frames(tmp_path: Path):
    situation = situation_from_seed(SCREWDRIVER, "demonstration", 0, 1)
    made = record(SCREWDRIVER, situation, constant_velocity_leader((0, 0, 0), 1.5), "x").demonstration
    (frame,) = made.frames
    assert isinstance(frame, MovingFrame)
    assert len(frame.b) == len(made.x)
    expected = np.array([screw_pose(situation, t * PERIOD).position for t in range(len(made.x))])
    assert np.linalg.norm(frame.b[:, :3] - expected, axis=1).max() < 2e-3
    assert np.ptp(frame.b[:, :3], axis=0).max() > 5e-3
    write_demonstrations([made], tmp_path / "moving")
    (read,) = read_demonstrations(tmp_path / "moving")
    assert isinstance(read.frames[0], MovingFrame)
    assert np.array_equal(read.frames[0].b, frame.b)


def test_record_any_leader_is_accepted(valve_recordings: tuple[RecordedDemonstration, ...]):
    assert [made.outcome.success for made in valve_recordings] == [True] * 4
    assert [made.duration for made in valve_recordings] == pytest.approx([5.0] * 4)
    assert [made.demonstration.name for made in valve_recordings] == [f"opening {m}" for m in range(4)]
    places = np.array([made.demonstration.frames[0].b[:3] for made in valve_recordings])
    assert len(np.unique(places, axis=0)) == 4
    assert all(0.0 < made.peak_forces["tool"] < 60.0 for made in valve_recordings)


def test_record_leader_done_once_ends():
    for n in range(5):
        last_time = 0.2 + 0.02 * n

        def lead(
            time: float, observation: human.Observation, last_time: float = last_time
        ) -> tuple[Pose, float, bool]:
            return observation.tool, 0.0, abs(time - last_time) < 1e-6

        made = record(VALVE, situation_from_seed(VALVE, "demonstration", 0, 0), lead, "x")
        assert made.duration == pytest.approx(0.3)


def test_record_time_limit_ends():
    made = record(
        replace(VALVE, time_limit=0.6),
        situation_from_seed(VALVE, "demonstration", 0, 0),
        constant_velocity_leader((0, 0, 0), np.inf),
        "x",
    )
    assert made.duration == pytest.approx(0.6)
    assert not made.outcome.success


def task_failing(times: int) -> Task[Any]:
    """Return a task of 0.2 s that fails a number of times."""
    checks: list[None] = []

    def check_success(*_: object) -> Outcome:
        checks.append(None)
        return Outcome(len(checks) > times, 1.0, "" if len(checks) > times else "the tea is cold")

    return replace(VALVE, name="tea", time_limit=0.2, check_success=check_success)


@pytest.mark.parametrize("times", range(MAX_ATTEMPTS))
def test_record_demonstrations_failure_is_repeated(times: int):
    ((made, tries),) = record_demonstrations(task_failing(times), 1, 0)
    assert tries == times + 1
    assert made.outcome.success
    place = situation_from_seed(VALVE, "demonstration", 0, 0).valve.position
    assert np.array_equal(made.demonstration.frames[0].b[:3], place)


def test_record_demonstrations_repeated_failure_is_refused():
    with pytest.raises(
        SkillError, match=r"demonstration 0 of 'tea' failed 5 times.*tea is cold; choose another seed"
    ):
        list(record_demonstrations(task_failing(MAX_ATTEMPTS), 1, 0))


def test_record_demonstrations_attempts_differ(alignment_task: Task[Any]):
    situation = situation_from_seed(alignment_task, "demonstration", 0, 0)
    short = replace(alignment_task, time_limit=1.0)
    rows = []
    for attempt in range(2):
        leader = simulated_leader(
            short,
            situation,
            human.HumanModel(),
            np.random.default_rng([0, SPLITS["demonstration"], 0, attempt]),
        )
        rows.append(record(short, situation, leader, "x").demonstration.x)
    assert not np.array_equal(rows[0], rows[1])


@pytest.mark.slow(reason="two demonstrations in physics take seven CPU seconds")
def test_record_demonstrations_delay_takes_longer():
    ((made, tries),), ((late, _),) = (record_demonstrations(VALVE, 1, 0, delay=delay) for delay in (0.0, 0.5))
    assert late.duration > made.duration + 2 * 0.5  # at least four subtasks, each with a wait
    assert 1 <= tries <= MAX_ATTEMPTS
    assert made.outcome.success
    assert isinstance(made.demonstration, Demonstration)
    assert 5.0 < made.duration < VALVE.time_limit
    assert np.abs(np.diff(made.demonstration.x[:, :3], axis=0)).max() < 0.05


@pytest.mark.parametrize("delay", [0.0, 0.1, 0.5])
def test_delay_observations_delays_each_observation(delay: float):
    received = []

    def lead(time: float, observation: human.Observation) -> tuple[Pose, float, bool]:
        received.append((time, float(observation.tool.position[0])))  # the position of the tool is the time
        return observation.tool, 0.0, False

    leader = delay_observations(lead, delay)
    for n in range(60):
        time = 0.02 * n
        leader(time, human.Observation(Pose(np.array([time, 0.0, 0.0]), UPRIGHT), {}))
    for time, observed in received:
        assert observed == pytest.approx(max(time - delay, 0.0), abs=1e-9)
