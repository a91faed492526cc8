"""A recording is what a leader asked for, row by row, in the situation of its number, the same every time."""

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
    DEMONSTRATION_STREAM,
    MAX_ATTEMPTS,
    PERIOD,
    TEST_STREAM,
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
    """A hand that moves evenly [m/s] for some time, and grips from a time on."""
    begun: list[Pose] = []

    def lead(time: float, observation: human.Observation) -> human.HandCommand:
        begun.append(observation.tool)
        place = begun[0].position + time * np.array(velocity)
        return human.HandCommand(
            Pose(place, begun[0].quaternion), float(time >= grip_from), 0, time >= seconds
        )

    return lead


def same(a: RecordedDemonstration, b: RecordedDemonstration) -> bool:
    """To the last bit, frames too."""
    pairs = zip(a.demonstration.frames, b.demonstration.frames, strict=True)
    framed = all(
        one.A.tobytes() == two.A.tobytes() and one.b.tobytes() == two.b.tobytes() for one, two in pairs
    )
    rows = a.demonstration.x.tobytes() == b.demonstration.x.tobytes()
    return rows and framed and (a.outcome, a.peak_forces, a.seconds) == (b.outcome, b.peak_forces, b.seconds)


def test_the_same_seed_gives_the_same_recordings(alignment_task: Task[Any], tmp_path: Path):
    """Two showings of a simulated person are equal bit for bit, so are the files of their folders; those of
    another seed are others.
    """
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


def test_situations_are_functions_of_task_stream_seed_and_number():
    """The same four give the same place; any other number, seed or stream another: none shown is unseen."""
    chosen = [
        (stream, seed, m)
        for stream in (DEMONSTRATION_STREAM, TEST_STREAM)
        for seed in range(3)
        for m in range(5)
    ]
    places = [situation_from_seed(VALVE, *which).valve.position for which in chosen]
    assert all(
        np.array_equal(situation_from_seed(VALVE, *which).valve.position, place)
        for which, place in zip(chosen, places, strict=True)
    )
    assert len(np.unique(places, axis=0)) == len(chosen)


@pytest.mark.parametrize("seconds", [0.1, 0.5, 1.0])
def test_rows_are_a_tenth_of_a_second_apart(seconds: float):
    """There is one at the beginning and one for each tenth of the time that it took, to the end."""
    made = record(
        VALVE,
        situation_from_seed(VALVE, DEMONSTRATION_STREAM, 0, 0),
        constant_velocity_leader((0, 0, 0), seconds),
        "x",
    )
    rows = len(made.demonstration.x)
    assert made.demonstration.period == PERIOD == 0.1
    assert made.seconds == pytest.approx((rows - 1) * PERIOD)
    assert seconds <= made.seconds < seconds + 2 * PERIOD


def test_a_hand_that_moves_evenly_leaves_even_rows():
    """Once the springs have caught up, rows are a tenth of a second's way apart."""
    velocity = np.array([0.03, -0.02, 0.05])
    made = record(
        VALVE,
        situation_from_seed(VALVE, DEMONSTRATION_STREAM, 0, 0),
        constant_velocity_leader((0.03, -0.02, 0.05), 1.5),
        "x",
    )
    steps = np.diff(made.demonstration.x[:, :3], axis=0)
    np.testing.assert_allclose(steps[8:], np.tile(PERIOD * velocity, (len(steps[8:]), 1)), atol=5e-4)


def test_a_recording_begins_at_home():
    """Its first row is the tool where the task has the arm wait."""
    situation = situation_from_seed(VALVE, DEMONSTRATION_STREAM, 0, 3)
    made = record(VALVE, situation, constant_velocity_leader((0.1, 0.0, 0.0), 0.2), "x")
    start_pose = VALVE.start_pose(situation)
    assert np.linalg.norm(made.demonstration.x[0, :3] - start_pose.position) < 1e-3
    assert angle(made.demonstration.x[0, 3:7], start_pose.quaternion) < 0.01
    assert np.array_equal(made.demonstration.x[0, :3], Workcell(VALVE, situation, lead=True).target.position)


def test_what_is_kept_is_what_was_asked_for_not_what_was_reached():
    """Where the tool is held back by a panel, rows go on into it, as far as the hand pulls."""
    situation = situation_from_seed(VALVE, DEMONSTRATION_STREAM, 0, 0)
    way = situation.valve.position + np.array([0.12, 0.1, 0.0]) - VALVE.start_pose(situation).position
    push = constant_velocity_leader(tuple(way), 1.0)
    reached: list[Pose] = []

    def lead(time: float, observation: human.Observation) -> human.HandCommand:
        reached.append(observation.tool)
        return push(time, observation)

    made = record(VALVE, situation, lead, "x")
    assert made.peak_forces["tool"] > 10.0
    assert np.linalg.norm(made.demonstration.x[-1, :3] - reached[-1].position) > 0.01


@pytest.mark.parametrize("name", sorted(TASKS))
def test_there_is_a_grip_where_there_is_something_to_grip_with(name: str, checked: None):
    """A pose has seven columns, a pose with a grip eight; the grip's own tells when it was asked for.

    Half a second of each task is recorded with every annotation checked.
    """
    task = TASKS[name]
    made = record(
        task,
        situation_from_seed(task, DEMONSTRATION_STREAM, 0, 0),
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
def test_frames_are_where_the_objects_stood(name: str):
    """Each frame of the task is that of the pose in which its object is seen, and stands."""
    task = TASKS[name]
    situation = situation_from_seed(task, DEMONSTRATION_STREAM, 0, 2)
    made = record(task, situation, constant_velocity_leader((0, 0, 0), 0.1), "x").demonstration
    observation = Workcell(task, situation).frames()
    assert [frame.name for frame in made.frames] == list(task.frames)
    for frame in made.frames:
        assert isinstance(frame, Frame)
        expected = frame_from_pose(frame.name, made.layout, observation[frame.name])
        assert np.array_equal(frame.b, expected.b)
        assert np.array_equal(frame.A, expected.A)


def test_frames_of_things_that_move_go_with_them(tmp_path: Path):
    """A row of the moving frame for each row of the recording: where the screw was then; files keep them."""
    situation = situation_from_seed(SCREWDRIVER, DEMONSTRATION_STREAM, 0, 1)
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


def test_anyone_can_lead(valve_recordings: tuple[RecordedDemonstration, ...]):
    """A function of the clock, no person, opened four valves: in five seconds, each in its own situation."""
    assert [made.outcome.success for made in valve_recordings] == [True] * 4
    assert [made.seconds for made in valve_recordings] == pytest.approx([5.0] * 4)
    assert [made.demonstration.name for made in valve_recordings] == [f"opening {m}" for m in range(4)]
    places = np.array([made.demonstration.frames[0].b[:3] for made in valve_recordings])
    assert len(np.unique(places, axis=0)) == 4
    assert all(0.0 < made.peak_forces["tool"] < 60.0 for made in valve_recordings)


def test_a_leader_who_says_once_that_it_is_done_is_done():
    """At whichever look it was said, the recording ends with the next row."""
    for look in range(5):
        said = 0.2 + 0.02 * look

        def lead(time: float, observation: human.Observation, said: float = said) -> human.HandCommand:
            return human.HandCommand(observation.tool, 0.0, 0, abs(time - said) < 1e-6)

        made = record(VALVE, situation_from_seed(VALVE, DEMONSTRATION_STREAM, 0, 0), lead, "x")
        assert made.seconds == pytest.approx(0.3)


def test_time_ends_a_showing():
    """A leader who is never done is cut off after the task's time, and judged then."""
    made = record(
        replace(VALVE, time_limit=0.6),
        situation_from_seed(VALVE, DEMONSTRATION_STREAM, 0, 0),
        constant_velocity_leader((0, 0, 0), np.inf),
        "x",
    )
    assert made.seconds == pytest.approx(0.6)
    assert not made.outcome.success


def task_failing(times: int) -> Task[Any]:
    """A task of a fifth of a second that is called done the time after so many."""
    asked: list[None] = []

    def check_success(*_: object) -> Outcome:
        asked.append(None)
        return Outcome(len(asked) > times, 1.0, "" if len(asked) > times else "the tea is cold")

    return replace(VALVE, name="tea", time_limit=0.2, check_success=check_success)


@pytest.mark.parametrize("times", range(MAX_ATTEMPTS))
def test_who_fails_shows_it_again(times: int):
    """As many tries are counted as it took, and it is the last that is kept, in the same situation."""
    ((made, tries),) = record_demonstrations(task_failing(times), 1, 0)
    assert tries == times + 1
    assert made.outcome.success
    place = situation_from_seed(VALVE, DEMONSTRATION_STREAM, 0, 0).valve.position
    assert np.array_equal(made.demonstration.frames[0].b[:3], place)


def test_who_fails_always_is_told_so():
    """After five tries the error says which showing of what, why, and what one may do."""
    with pytest.raises(
        SkillError, match=r"showing 0 of 'tea' failed 5 times.*tea is cold; choose another seed"
    ):
        list(record_demonstrations(task_failing(MAX_ATTEMPTS), 1, 0))


def test_another_try_is_another_showing(alignment_task: Task[Any]):
    """The person's noise differs from try to try: what failed once is not done again in the same way."""
    situation = situation_from_seed(alignment_task, DEMONSTRATION_STREAM, 0, 0)
    short = replace(alignment_task, time_limit=1.0)
    rows = []
    for attempt in range(2):
        leader = simulated_leader(
            short, situation, human.HumanModel(), np.random.default_rng([0, DEMONSTRATION_STREAM, 0, attempt])
        )
        rows.append(record(short, situation, leader, "x").demonstration.x)
    assert not np.array_equal(rows[0], rows[1])


def test_a_simulated_person_opens_a_valve_and_takes_longer_when_they_see_late():
    """Looking, moving and waiting, in the first try or a later one, to within the task's tolerance; with half
    a second of delay too, in longer than without.
    """
    ((made, tries),), ((late, _),) = (record_demonstrations(VALVE, 1, 0, delay=delay) for delay in (0.0, 0.5))
    assert late.seconds > made.seconds + 2 * 0.5  # at least four acts, each with a look at what came of it
    assert 1 <= tries <= MAX_ATTEMPTS
    assert made.outcome.success
    assert isinstance(made.demonstration, Demonstration)
    assert 5.0 < made.seconds < VALVE.time_limit
    assert np.abs(np.diff(made.demonstration.x[:, :3], axis=0)).max() < 0.05


@pytest.mark.parametrize("delay", [0.0, 0.1, 0.5])
def test_every_picture_comes_so_late(delay: float):
    """At each look the leader is given the picture of so many seconds ago, and the first one until then."""
    given = []

    def watch(time: float, observation: human.Observation) -> human.HandCommand:
        given.append((time, float(observation.tool.position[0])))  # a tool whose place tells the time
        return human.HandCommand(observation.tool, 0.0, 0, False)

    leader = delay_observations(watch, delay)
    for look in range(60):
        time = 0.02 * look
        leader(time, human.Observation(Pose(np.array([time, 0.0, 0.0]), UPRIGHT), {}))
    for time, pictured in given:
        assert pictured == pytest.approx(max(time - delay, 0.0), abs=1e-9)
