"""A skill learned from recordings in physics does in physics what was shown, where it was never shown."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pilotfish.demonstrations import (
    Demonstration,
    Layout,
    MovingFrame,
    Part,
    Quantity,
    add_derivatives,
    demonstration,
    frame_from_pose,
    moving_frame_from_poses,
    pose_layout,
    to_sphere,
)
from pilotfish.environments import TASKS, Workcell
from pilotfish.errors import InvalidInput
from pilotfish.geometry import (
    Pose,
    angle,
    conjugate,
    from_rotation_vector,
    multiply,
    normalise,
    quaternion_exp,
    rotation_matrix,
    to_rotation_vector,
)
from pilotfish.models import Skill, adapt, learn
from pilotfish.planning import moving_frame_reference
from pilotfish.planning.reproduction import mean_demonstration_length
from pilotfish.simulation import execution
from pilotfish.simulation.execution import (
    DEFAULT_SETTINGS,
    SETTLING_TIME,
    ExecutionResult,
    ExecutionSettings,
    execute,
    moving_frames,
)
from pilotfish.simulation.recording import (
    TEST_STREAM,
    RecordedDemonstration,
    situation_from_seed,
    task_layout,
)

VALVE, SCREWDRIVER = TASKS["valve"], TASKS["screwdriver"]
HOLD = quaternion_exp(np.array([0.2, -0.1, 0.3]))  # how a hand that holds an object is turned, seen from it


def learn_skill(shown: tuple[RecordedDemonstration, ...], *, sphere: bool = False, states: int = 5) -> Skill:
    recordings = [made.demonstration for made in shown]
    turned = [to_sphere(demo) if sphere else demo for demo in load_demonstrations]
    return learn(
        [add_derivatives(demo) for demo in turned], states=states, rng=np.random.default_rng(0)
    ).skill


def test_situation(number: int, task: Any = VALVE) -> Any:
    return situation_from_seed(task, TEST_STREAM, 0, number)


def test_a_skill_opens_a_valve_where_none_stood(valve_skill: Skill, unchecked: None):
    """Learned from four showings, it turns another valve to within the task's five degrees and leaves it."""
    made = execute(valve_skill, VALVE, test_situation(0))
    assert made.outcome.success, made.outcome.reason
    assert made.outcome.error < np.radians(5.0)
    assert 0.0 < made.peak_forces["tool"] < 60.0


@pytest.mark.parametrize("number", [1, 2])
def test_so_does_one_on_the_sphere(
    valve_recordings: tuple[RecordedDemonstration, ...], number: int, unchecked: None
):
    """Learned with orientations on S^3 it opens others too."""
    made = execute(learn_skill(valve_recordings, sphere=True), VALVE, test_situation(number))
    assert made.outcome.success, made.outcome.reason


def test_what_came_of_it_is_told_row_by_row(valve_skill: Skill, unchecked: None):
    """A row for each period of the plan and a second to settle: what was asked, what was made, the force."""
    situation, watched = test_situation(0), []
    made = execute(
        valve_skill, VALVE, situation, on_period=lambda cell: watched.append((cell.time, cell.forces["tool"]))
    )
    rows = mean_demonstration_length(valve_skill) - 1 + round(SETTLING_TIME / valve_skill.period)
    assert len(made.commanded) == len(made.measured) == len(made.forces) == len(watched) == rows
    assert made.seconds == pytest.approx(rows * valve_skill.period)
    assert [time for time, _ in watched] == pytest.approx(list(valve_skill.period * np.arange(1, rows + 1)))
    assert made.forces.tolist() == [force for _, force in watched]
    assert made.peak_forces["tool"] >= made.forces.max() > 0.0
    assert np.allclose(np.linalg.norm(made.commanded[:, 3:], axis=1), 1.0)
    assert np.linalg.norm(made.commanded[-1, :3] - made.measured[-1, :3]) < 0.01
    assert np.array_equal(made.commanded[-1], made.commanded[-10])  # held at the end
    began = Workcell(VALVE, situation).frames()
    assert all(np.array_equal(made.frames[name].position, began[name].position) for name in VALVE.frames)


def test_nothing_is_done_by_a_robot_that_waits(valve_skill: Skill, unchecked: None):
    """It is the motion that opens the valve: the arm that stays at home for as long does not."""
    cell = Workcell(VALVE, test_situation(0))
    for _ in range(mean_demonstration_length(valve_skill)):
        cell.step_impedance(cell.target, 0.0, 100)
    assert not cell.outcome().success


@pytest.mark.parametrize("name", ["valve", "screwdriver"])
def test_an_execution_repeats_bit_for_bit(
    name: str, valve_skill: Skill, settings: tuple[RecordedDemonstration, ...], unchecked: None
):
    """The same skill in the same situation gives the same rows and forces; in another one, others."""
    task = TASKS[name]
    skill = valve_skill if name == "valve" else learn_skill(settings)
    one, again, other = (execute(skill, task, test_situation(number, task)) for number in (0, 0, 1))
    for rows in ("commanded", "measured", "forces"):
        assert getattr(one, rows).tobytes() == getattr(again, rows).tobytes()
    assert (one.outcome, one.peak_forces) == (again.outcome, again.peak_forces)
    assert not np.array_equal(one.measured, other.measured)


@pytest.mark.parametrize("horizon", [2, 4])
@pytest.mark.parametrize("sphere", [False, True])
@pytest.mark.parametrize("name", ["valve", "screwdriver"])
def test_a_plan_is_as_long_as_it_is_asked_to_be(
    name: str,
    sphere: bool,
    horizon: int,
    valve_recordings: tuple[RecordedDemonstration, ...],
    settings: tuple[RecordedDemonstration, ...],
):
    """Of so many steps the first is where the arm is; the others follow, and a second to settle."""
    skill = learn_skill(valve_recordings if name == "valve" else settings, sphere=sphere)
    made = execute(
        skill, TASKS[name], test_situation(0, TASKS[name]), settings=ExecutionSettings(horizon=horizon)
    )
    assert len(made.commanded) == horizon - 1 + 10


def test_unless_told_otherwise_it_takes_as_long_as_showings_did(
    valve_recordings: tuple[RecordedDemonstration, ...],
):
    """Half of the rows in all from two of them; a skill of unknown origin has to be told."""
    rows = [len(opening.demonstration.x) for opening in valve_recordings]
    skill = learn_skill(valve_recordings)
    assert mean_demonstration_length(skill) == round(np.mean(rows))
    nothing = replace(skill.provenance, demonstrations=(), datapoints=0)
    with pytest.raises(InvalidInput, match="does not say how long its demonstrations were"):
        execute(replace(skill, provenance=nothing), VALVE, test_situation(0))
    with pytest.raises(InvalidInput, match="horizon"):
        execute(skill, VALVE, test_situation(0), settings=ExecutionSettings(horizon=0))


@pytest.mark.parametrize("sphere", [False, True])
def test_skills_with_other_columns_are_refused(
    valve_recordings: tuple[RecordedDemonstration, ...], sphere: bool
):
    """Without a grip, or with something else in its place, and without speeds: the fix is named."""
    shown = [opening.demonstration for opening in valve_recordings]
    if sphere:
        shown = [to_sphere(demo) for demo in shown]
    layout = shown[0].layout
    pushed = Layout((*layout.parts[:-1], Part("push", Quantity.SCALAR, 1, "N")))
    rng = np.random.default_rng(0)
    others = {
        "push": [add_derivatives(replace(demo, layout=pushed)) for demo in shown],
        "grip": shown,
        "orientation": [
            add_derivatives(
                demonstration(
                    demo.x[:, :7],
                    demo.period,
                    Layout(layout.parts[:-1]),
                    [replace(frame, A=frame.A[:7, :7], b=frame.b[:7]) for frame in demo.frames],
                )
            )
            for demo in shown
        ],
    }
    for column, load_demonstrations in others.items():
        skill = learn(load_demonstrations, states=2, rng=rng).skill
        with pytest.raises(InvalidInput, match=f"columns .*{column}.*learn it from pilotfish record valve"):
            execute(skill, VALVE, test_situation(0))


def test_skills_that_know_other_frames_are_refused(valve_recordings: tuple[RecordedDemonstration, ...]):
    """Frames of another name, or one of them alone: the message names both sides and the fix."""
    renamed = [
        replace(demo, frames=(demo.frames[0], replace(demo.frames[1], name="later")))
        for demo in (add_derivatives(opening.demonstration) for opening in valve_recordings)
    ]
    one = [replace(demo, frames=demo.frames[:1]) for demo in renamed]
    rng = np.random.default_rng(0)
    for load_demonstrations, names in ((renamed, r"\['before', 'later'\]"), (one, r"\['before'\]")):
        skill = learn(load_demonstrations, states=2, rng=rng).skill
        with pytest.raises(InvalidInput, match=rf"{names}, task 'valve' has \['before', 'after'\]; learn it"):
            execute(skill, VALVE, test_situation(0))


def test_the_order_of_frames_does_not_matter(
    valve_recordings: tuple[RecordedDemonstration, ...], unchecked: None
):
    """A skill that was learned with its frames in another order makes the same motion."""
    shown = [add_derivatives(opening.demonstration) for opening in valve_recordings]
    made = []
    for frames in (slice(None), slice(None, None, -1)):
        recordings = [replace(demo, frames=demo.frames[frames]) for demo in shown]
        skill = learn(load_demonstrations, states=5, rng=np.random.default_rng(0)).skill
        made.append(execute(skill, VALVE, test_situation(0)))
    np.testing.assert_allclose(made[0].commanded, made[1].commanded, atol=1e-6)


@pytest.mark.parametrize("sphere", [False, True])
def test_a_skill_follows_what_moves(
    settings: tuple[RecordedDemonstration, ...], sphere: bool, unchecked: None
):
    """The screwdriver is set into a recess that never moved so, and stays in it."""
    made = execute(learn_skill(settings, sphere=sphere), SCREWDRIVER, test_situation(0, SCREWDRIVER))
    assert made.outcome.success, made.outcome.reason
    assert made.outcome.error < 0.003


def test_the_next_plan_starts_from_what_was_asked_last(
    settings: tuple[RecordedDemonstration, ...], monkeypatch: pytest.MonkeyPatch, unchecked: None
):
    """While objects move, each plan starts where the one before was to be a period later, at its speed: from
    one period to the next nothing that is asked moves by more than the speed says.
    """
    starts: list[np.ndarray] = []
    ends: list[np.ndarray] = []
    track = execution.track

    class Noted:
        def __init__(self, *given: Any) -> None:
            self.feedback = track(*given)

        def rollout(self, start: np.ndarray) -> Any:
            motion = self.feedback.rollout(start)
            starts.append(start)
            ends.append(motion.x[1])
            return motion

    monkeypatch.setattr(execution, "track", Noted)
    skill = learn_skill(settings)
    made = execute(skill, SCREWDRIVER, test_situation(0, SCREWDRIVER))
    assert len(starts) == len(made.commanded)
    np.testing.assert_array_equal(starts[1:], ends[:-1])
    np.testing.assert_array_equal(made.commanded[:, :3], np.array(ends)[:, :3])
    places, speeds = np.array(starts)[:, :3], np.array(starts)[:, 7:10]
    even = skill.period * 0.5 * (speeds[1:] + speeds[:-1])  # what speeds that change evenly make of a period
    np.testing.assert_allclose(np.diff(places, axis=0), even, atol=1e-12)


@pytest.mark.parametrize("sphere", [False, True])
def test_what_is_asked_goes_on_smoothly(
    settings: tuple[RecordedDemonstration, ...], sphere: bool, unchecked: None
):
    """From period to period the step changes by no more than 2 m/s^2 and 3 rad/s^2 are worth."""
    skill = learn_skill(settings, sphere=sphere)
    asked = execute(skill, SCREWDRIVER, test_situation(1, SCREWDRIVER)).commanded
    h2 = skill.period**2
    assert np.linalg.norm(np.diff(asked[:, :3], n=2, axis=0), axis=1).max() < 2.0 * h2
    turns = angle(asked[:-1, 3:], asked[1:, 3:])
    assert np.abs(np.diff(turns)).max() < 3.0 * h2


@pytest.mark.parametrize("sphere", [False, True])
def test_a_plan_looks_ahead_as_far_as_it_goes(
    settings: tuple[RecordedDemonstration, ...],
    sphere: bool,
    monkeypatch: pytest.MonkeyPatch,
    unchecked: None,
):
    """The skill later is the skill now, moved on by what the object will have gone at the plan's last step if
    it goes on as in the last period; velocities are the object's in both.
    """
    made: list[tuple[Any, Any, int]] = []

    def noted(now: Any, later: Any, states: np.ndarray, covariance_regularisation: float) -> Any:
        made.append((now, later, len(states)))
        return moving_frame_reference(now, later, states, covariance_regularisation)

    monkeypatch.setattr(execution, "moving_frame_reference", noted)
    situation, places = test_situation(2, SCREWDRIVER), []
    skill = learn_skill(settings, sphere=sphere)
    began = Workcell(SCREWDRIVER, situation).frames()["target"].position
    execute(
        skill, SCREWDRIVER, situation, on_period=lambda cell: places.append(cell.frames()["target"].position)
    )
    seen = np.array([began, *places])
    first = 6 if sphere else 7  # column of velocities: a rotation vector has three numbers
    for t in range(1, len(made)):
        now, later, steps = made[t]
        gone = seen[t] - seen[t - 1]
        expected = now.means[:, :3] + (steps - 1) * gone
        np.testing.assert_allclose(later.means[:, :3], expected, atol=1e-9)
        np.testing.assert_allclose(later.means[:, first:], now.means[:, first:], atol=1e-6)
    drift = [np.ptp(now.means[0, first : first + 3]) for now, _, _ in made[1:]]
    assert max(drift) > 1e-3


def random_pose(rng: np.random.Generator) -> Pose:
    return Pose(rng.normal(size=3), normalise(rng.normal(size=4)))


def even_motion(rng: np.random.Generator, steps: int) -> list[Pose]:
    """An object that moves and turns by the same, in the world, each period."""
    begun, move, turn = random_pose(rng), 0.01 * rng.normal(size=3), 0.03 * rng.normal(size=3)
    return [
        Pose(begun.position + t * move, multiply(from_rotation_vector(t * turn), begun.quaternion))
        for t in range(steps)
    ]


def carried(rng: np.random.Generator, name: str) -> tuple[Demonstration, list[Pose]]:
    """A hand that wanders about near an object that moves evenly."""
    poses, layout, steps = even_motion(rng, 12), pose_layout(), 12
    near = [Pose(0.1 * rng.normal(size=3), quaternion_exp(0.05 * rng.normal(size=3))) for _ in range(steps)]
    hands = [pose @ close for pose, close in zip(poses, near, strict=True)]
    x = np.array([np.append(hand.position, hand.quaternion) for hand in hands])
    frames = [moving_frame_from_poses("cup", layout, poses)]
    return demonstration(x, 0.1, layout, frames, name), poses


@pytest.fixture
def carrying(rng: np.random.Generator) -> tuple[Skill, Demonstration, list[Pose]]:
    """A skill of one state, seen from one thing that moves; a recording of it, and how the thing moved."""
    made = [carried(rng, f"m{m}") for m in range(3)]
    skill = learn([add_derivatives(demo) for demo, _ in made], states=1, rng=rng).skill
    return skill, *made[0]


def test_going_frames_are_those_of_a_recording_of_the_same_motion(
    carrying: tuple[Skill, Demonstration, list[Pose]],
):
    """Of a thing that moves evenly, frames made of the last two pictures alone equal those that a recording
    of all of it has: places, turns, and what they add to speeds. Where the robot is does not matter.
    """
    skill, demo, poses = carrying
    (whole,) = add_derivatives(demo).frames
    assert isinstance(whole, MovingFrame)
    for t in range(1, len(poses) - 1):
        x = np.append(demo.x[t], np.zeros(7))
        (frame,) = moving_frames(skill, {"cup": poses[t - 1]}, {"cup": poses[t]}, x)
        sign = np.sign(whole.A[t, 3, 3] * frame.A[3, 3])  # of q and -q
        signs = np.concatenate([np.ones(3), np.full(4, sign)] * 2)
        np.testing.assert_allclose(frame.A, whole.A[t] * signs[:, None], atol=1e-9)
        np.testing.assert_allclose(frame.b, whole.b[t], atol=1e-9)


def test_means_go_along_with_what_moves(carrying: tuple[Skill, Demonstration, list[Pose]]):
    """A state's mean is carried by the object: its place is where the object has it now, its velocity is the
    way from there to where the object has it a period later.
    """
    skill, demo, poses = carrying
    seen, h = skill.means[0, 0], skill.period
    for t in range(1, len(poses) - 1):
        frames = moving_frames(
            skill, {"cup": poses[t - 1]}, {"cup": poses[t]}, np.append(demo.x[t], np.zeros(7))
        )
        mean = adapt(skill, frames).means[0]
        now, later = (poses[s].position + rotation_matrix(poses[s].quaternion) @ seen[:3] for s in (t, t + 1))
        own = (
            rotation_matrix(poses[t + 1].quaternion) @ seen[7:10]
        )  # the hand's velocity, seen from the object
        np.testing.assert_allclose(mean[:3], now, atol=1e-9)
        np.testing.assert_allclose(mean[7:10], (later - now) / h + own, atol=1e-9)


def test_on_the_sphere_means_turn_with_what_turns(carrying: tuple[Skill, Demonstration, list[Pose]]):
    """There a hand that holds on to a turning object has its angular velocity, in the hand's own axes."""
    _, demo, poses = carrying
    shown = to_sphere(demo)
    held = replace(
        shown, x=np.hstack([shown.x[:, :3], [(p @ Pose(np.zeros(3), HOLD)).quaternion for p in poses]])
    )
    skill = learn([add_derivatives(held)], states=1, rng=np.random.default_rng(0)).skill
    for t in range(1, len(poses) - 1):
        x = np.append(held.x[t], np.zeros(6))
        frames = moving_frames(skill, {"cup": poses[t - 1]}, {"cup": poses[t]}, x)
        mean = adapt(skill, frames).means[0]
        expected = multiply(poses[t].quaternion, HOLD)
        assert angle(mean[3:7], expected) < 1e-6
        after = multiply(poses[t + 1].quaternion, HOLD)
        speed = to_rotation_vector(multiply(conjugate(expected), after)) / skill.period
        np.testing.assert_allclose(mean[10:13], speed, atol=1e-6)


def test_what_stands_has_frames_that_stand(carrying: tuple[Skill, Demonstration, list[Pose]]):
    """Seen twice in the same place, an object adds nothing to speeds: the frame is that of its pose."""
    skill, demo, poses = carrying
    here = {"cup": poses[0]}
    (frame,) = moving_frames(skill, here, here, np.append(demo.x[0], np.zeros(7)))
    expected = frame_from_pose("cup", skill.layout, poses[0])
    np.testing.assert_allclose(frame.A, expected.A, atol=1e-12)
    np.testing.assert_allclose(frame.b, expected.b, atol=1e-12)


@pytest.mark.parametrize("length", [0.7, 0.98, 1.2])
def test_a_quaternion_on_its_way_may_be_shorter_than_one(
    carrying: tuple[Skill, Demonstration, list[Pose]], length: float
):
    """Steered as four numbers it leaves unit length between two orientations; frames are the same."""
    skill, demo, poses = carrying
    x = np.append(demo.x[1], np.zeros(7))
    short = x.copy()
    short[3:7] *= length
    (a,), (b,) = (moving_frames(skill, {"cup": poses[0]}, {"cup": poses[1]}, given) for given in (x, short))
    np.testing.assert_allclose(a.A, b.A, atol=1e-12)
    np.testing.assert_allclose(a.b, b.b, atol=1e-12)


def test_a_pursuit_has_its_price(valve_skill: Skill, unchecked: None):
    """Dearer acceleration gives a softer motion; the default is what is documented."""
    assert (DEFAULT_SETTINGS.control_cost, DEFAULT_SETTINGS.covariance_regularisation) == (0.1, 1e-5)
    pushes = []
    for control_cost in (0.01, 0.1, 10.0):
        made: ExecutionResult = execute(
            valve_skill, VALVE, test_situation(0), settings=ExecutionSettings(control_cost, 1e-5, 25)
        )
        pushes.append(np.linalg.norm(np.diff(made.commanded[:24, :3], n=2, axis=0), axis=1).max())
    assert pushes[0] > pushes[1] > pushes[2]


def test_the_columns_of_a_task_are_those_of_its_recordings(
    valve_recordings: tuple[RecordedDemonstration, ...],
):
    """What execute expects is what record writes."""
    assert valve_recordings[0].demonstration.layout == task_layout(VALVE)
