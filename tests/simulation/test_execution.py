"""A skill learned from recorded demonstrations performs the task in new situations."""

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
from pilotfish.planning import (
    CONTROL_COST,
    COVARIANCE_REGULARISATION,
    mean_demonstration_length,
    moving,
    moving_frame_reference,
    moving_frames,
)
from pilotfish.simulation.execution import SETTLING_TIME, perform
from pilotfish.simulation.recording import (
    RecordedDemonstration,
    situation_from_seed,
    task_layout,
)

VALVE, SCREWDRIVER = TASKS["valve"], TASKS["screwdriver"]
HOLD = quaternion_exp(
    np.array([0.2, -0.1, 0.3])
)  # orientation of a hand in the frame of the object that it holds


def learn_skill(
    recordings: tuple[RecordedDemonstration, ...], *, sphere: bool = False, states: int = 5
) -> Skill:
    demonstrations = [recorded.demonstration for recorded in recordings]
    converted = [to_sphere(demo) if sphere else demo for demo in demonstrations]
    return learn(
        [add_derivatives(demo) for demo in converted], states=states, rng=np.random.default_rng(0)
    ).skill


def unseen_situation(number: int, task: Any = VALVE) -> Any:
    return situation_from_seed(task, "test", 0, number)


def test_perform_new_situation_opens_valve(valve_skill: Skill, unchecked: None):
    result = perform(valve_skill, VALVE, unseen_situation(0))
    assert result.outcome.success, result.outcome.reason
    assert result.outcome.error < np.radians(5.0)
    assert 0.0 < result.peak_forces["tool"] < 60.0


@pytest.mark.parametrize("number", [1, 2])
def test_perform_skill_on_sphere_opens_valve(
    valve_recordings: tuple[RecordedDemonstration, ...], number: int, unchecked: None
):
    result = perform(learn_skill(valve_recordings, sphere=True), VALVE, unseen_situation(number))
    assert result.outcome.success, result.outcome.reason


def test_perform_result_has_row_per_period(valve_skill: Skill, unchecked: None):
    situation, watched = unseen_situation(0), []
    result = perform(
        valve_skill, VALVE, situation, on_period=lambda cell: watched.append((cell.time, cell.forces["tool"]))
    )
    rows = mean_demonstration_length(valve_skill) - 1 + round(SETTLING_TIME / valve_skill.period)
    assert len(result.commanded) == len(result.measured) == len(result.forces) == len(watched) == rows
    assert result.duration == pytest.approx(rows * valve_skill.period)
    assert [time for time, _ in watched] == pytest.approx(list(valve_skill.period * np.arange(1, rows + 1)))
    assert result.forces.tolist() == [force for _, force in watched]
    assert result.peak_forces["tool"] >= result.forces.max() > 0.0
    assert np.allclose(np.linalg.norm(result.commanded[:, 3:], axis=1), 1.0)
    assert np.linalg.norm(result.commanded[-1, :3] - result.measured[-1, :3]) < 0.01
    assert np.array_equal(result.commanded[-1], result.commanded[-10])  # held at the end
    start = Workcell(VALVE, situation).frames()
    assert all(np.array_equal(result.frames[name].position, start[name].position) for name in VALVE.frames)


def test_perform_skill_at_rest_fails(valve_skill: Skill, unchecked: None):
    cell = Workcell(VALVE, unseen_situation(0))
    for _ in range(mean_demonstration_length(valve_skill)):
        cell.step_impedance(cell.target, 0.0, 100)
    assert not cell.outcome().success


@pytest.mark.parametrize("name", ["valve", "screwdriver"])
def test_perform_repeated_is_bit_identical(
    name: str, valve_skill: Skill, alignment_recordings: tuple[RecordedDemonstration, ...], unchecked: None
):
    task = TASKS[name]
    skill = valve_skill if name == "valve" else learn_skill(alignment_recordings)
    one, again, other = (perform(skill, task, unseen_situation(number, task)) for number in (0, 0, 1))
    for rows in ("commanded", "measured", "forces"):
        assert getattr(one, rows).tobytes() == getattr(again, rows).tobytes()
    assert (one.outcome, one.peak_forces) == (again.outcome, again.peak_forces)
    assert not np.array_equal(one.measured, other.measured)


@pytest.mark.parametrize("horizon", [2, 4])
@pytest.mark.parametrize("sphere", [False, True])
@pytest.mark.parametrize("name", ["valve", "screwdriver"])
def test_perform_horizon_sets_length(
    name: str,
    sphere: bool,
    horizon: int,
    valve_recordings: tuple[RecordedDemonstration, ...],
    alignment_recordings: tuple[RecordedDemonstration, ...],
):
    skill = learn_skill(valve_recordings if name == "valve" else alignment_recordings, sphere=sphere)
    result = perform(skill, TASKS[name], unseen_situation(0, TASKS[name]), horizon=horizon)
    assert len(result.commanded) == horizon - 1 + 10


def test_perform_default_horizon_is_mean_length(
    valve_recordings: tuple[RecordedDemonstration, ...],
):
    rows = [len(opening.demonstration.x) for opening in valve_recordings]
    skill = learn_skill(valve_recordings)
    assert mean_demonstration_length(skill) == round(np.mean(rows))
    nothing = replace(skill.provenance, demonstrations=(), datapoints=0)
    with pytest.raises(InvalidInput, match="does not say how long its demonstrations were"):
        perform(replace(skill, provenance=nothing), VALVE, unseen_situation(0))
    with pytest.raises(InvalidInput, match="horizon"):
        perform(skill, VALVE, unseen_situation(0), horizon=0)


@pytest.mark.parametrize("sphere", [False, True])
def test_perform_other_columns_are_refused(valve_recordings: tuple[RecordedDemonstration, ...], sphere: bool):
    recorded = [opening.demonstration for opening in valve_recordings]
    if sphere:
        recorded = [to_sphere(demo) for demo in recorded]
    layout = recorded[0].layout
    pushed = Layout((*layout.parts[:-1], Part("push", Quantity.SCALAR, 1, "N")))
    rng = np.random.default_rng(0)
    others = {
        "push": [add_derivatives(replace(demo, layout=pushed)) for demo in recorded],
        "grip": recorded,
        "orientation": [
            add_derivatives(
                demonstration(
                    demo.x[:, :7],
                    demo.period,
                    Layout(layout.parts[:-1]),
                    [replace(frame, A=frame.A[:7, :7], b=frame.b[:7]) for frame in demo.frames],
                )
            )
            for demo in recorded
        ],
    }
    for column, demonstrations in others.items():
        skill = learn(demonstrations, states=2, rng=rng).skill
        with pytest.raises(InvalidInput, match=f"columns .*{column}.*learn it from pilotfish record valve"):
            perform(skill, VALVE, unseen_situation(0))


def test_perform_other_frames_are_refused(valve_recordings: tuple[RecordedDemonstration, ...]):
    renamed = [
        replace(demo, frames=(demo.frames[0], replace(demo.frames[1], name="later")))
        for demo in (add_derivatives(opening.demonstration) for opening in valve_recordings)
    ]
    one = [replace(demo, frames=demo.frames[:1]) for demo in renamed]
    rng = np.random.default_rng(0)
    for demonstrations, names in ((renamed, r"\['before', 'later'\]"), (one, r"\['before'\]")):
        skill = learn(demonstrations, states=2, rng=rng).skill
        with pytest.raises(InvalidInput, match=rf"{names}, task 'valve' has \['before', 'after'\]; learn it"):
            perform(skill, VALVE, unseen_situation(0))


def test_perform_frame_order_has_no_effect(
    valve_recordings: tuple[RecordedDemonstration, ...], unchecked: None
):
    recorded = [add_derivatives(opening.demonstration) for opening in valve_recordings]
    results = []
    for frames in (slice(None), slice(None, None, -1)):
        demonstrations = [replace(demo, frames=demo.frames[frames]) for demo in recorded]
        skill = learn(demonstrations, states=5, rng=np.random.default_rng(0)).skill
        results.append(perform(skill, VALVE, unseen_situation(0)))
    np.testing.assert_allclose(results[0].commanded, results[1].commanded, atol=1e-6)


@pytest.mark.parametrize("sphere", [False, True])
def test_perform_follows_moving_objects(
    alignment_recordings: tuple[RecordedDemonstration, ...], sphere: bool, unchecked: None
):
    result = perform(
        learn_skill(alignment_recordings, sphere=sphere), SCREWDRIVER, unseen_situation(0, SCREWDRIVER)
    )
    assert result.outcome.success, result.outcome.reason
    assert result.outcome.error < 0.003


def test_perform_next_plan_starts_from_last_command(
    alignment_recordings: tuple[RecordedDemonstration, ...], monkeypatch: pytest.MonkeyPatch, unchecked: None
):
    starts: list[np.ndarray] = []
    ends: list[np.ndarray] = []
    track = moving.track

    class RecordingTracker:
        def __init__(self, *given: Any) -> None:
            self.feedback = track(*given)

        def rollout(self, start: np.ndarray) -> Any:
            motion = self.feedback.rollout(start)
            starts.append(start)
            ends.append(motion.x[1])
            return motion

    monkeypatch.setattr(moving, "track", RecordingTracker)
    skill = learn_skill(alignment_recordings)
    result = perform(skill, SCREWDRIVER, unseen_situation(0, SCREWDRIVER))
    assert len(starts) == len(result.commanded)
    np.testing.assert_array_equal(starts[1:], ends[:-1])
    np.testing.assert_array_equal(result.commanded[:, :3], np.array(ends)[:, :3])
    places, speeds = np.array(starts)[:, :3], np.array(starts)[:, 7:10]
    even = skill.period * 0.5 * (speeds[1:] + speeds[:-1])  # displacement at constant acceleration
    np.testing.assert_allclose(np.diff(places, axis=0), even, atol=1e-12)


@pytest.mark.parametrize("sphere", [False, True])
def test_perform_command_is_smooth(
    alignment_recordings: tuple[RecordedDemonstration, ...], sphere: bool, unchecked: None
):
    skill = learn_skill(alignment_recordings, sphere=sphere)
    commanded = perform(skill, SCREWDRIVER, unseen_situation(1, SCREWDRIVER)).commanded
    h2 = skill.period**2
    assert np.linalg.norm(np.diff(commanded[:, :3], n=2, axis=0), axis=1).max() < 2.0 * h2
    turns = angle(commanded[:-1, 3:], commanded[1:, 3:])
    assert np.abs(np.diff(turns)).max() < 3.0 * h2


@pytest.mark.parametrize("sphere", [False, True])
def test_perform_plans_ahead_to_end(
    alignment_recordings: tuple[RecordedDemonstration, ...],
    sphere: bool,
    monkeypatch: pytest.MonkeyPatch,
    unchecked: None,
):
    made: list[tuple[Any, Any, int]] = []

    def noted(now: Any, later: Any, states: np.ndarray, covariance_regularisation: float) -> Any:
        made.append((now, later, len(states)))
        return moving_frame_reference(now, later, states, covariance_regularisation)

    monkeypatch.setattr(moving, "moving_frame_reference", noted)
    situation, places = unseen_situation(2, SCREWDRIVER), []
    skill = learn_skill(alignment_recordings, sphere=sphere)
    start = Workcell(SCREWDRIVER, situation).frames()["target"].position
    perform(
        skill, SCREWDRIVER, situation, on_period=lambda cell: places.append(cell.frames()["target"].position)
    )
    positions = np.array([start, *places])
    first = 6 if sphere else 7  # column of velocities: a rotation vector has three numbers
    for t in range(1, len(made)):
        now, later, steps = made[t]
        displacement = positions[t] - positions[t - 1]
        expected = now.means[:, :3] + (steps - 1) * displacement
        np.testing.assert_allclose(later.means[:, :3], expected, atol=1e-9)
        np.testing.assert_allclose(later.means[:, first:], now.means[:, first:], atol=1e-6)
    drift = [np.ptp(now.means[0, first : first + 3]) for now, _, _ in made[1:]]
    assert max(drift) > 1e-3


def random_pose(rng: np.random.Generator) -> Pose:
    return Pose(rng.normal(size=3), normalise(rng.normal(size=4)))


def constant_velocity_motion(rng: np.random.Generator, steps: int) -> list[Pose]:
    """Return the poses of an object with constant velocity in the world."""
    begun, move, turn = random_pose(rng), 0.01 * rng.normal(size=3), 0.03 * rng.normal(size=3)
    return [
        Pose(begun.position + t * move, multiply(from_rotation_vector(t * turn), begun.quaternion))
        for t in range(steps)
    ]


def carried(rng: np.random.Generator, name: str) -> tuple[Demonstration, list[Pose]]:
    """Return a hand near an object with constant velocity, and the object's poses."""
    poses, layout, steps = constant_velocity_motion(rng, 12), pose_layout(), 12
    near = [Pose(0.1 * rng.normal(size=3), quaternion_exp(0.05 * rng.normal(size=3))) for _ in range(steps)]
    hands = [pose @ close for pose, close in zip(poses, near, strict=True)]
    x = np.array([np.append(hand.position, hand.quaternion) for hand in hands])
    frames = [moving_frame_from_poses("cup", layout, poses)]
    return demonstration(x, 0.1, layout, frames, name), poses


@pytest.fixture
def carrying(rng: np.random.Generator) -> tuple[Skill, Demonstration, list[Pose]]:
    """Return a skill of one state with one moving frame, a demonstration, and the poses of the frame."""
    made = [carried(rng, f"m{m}") for m in range(3)]
    skill = learn([add_derivatives(demo) for demo, _ in made], states=1, rng=rng).skill
    return skill, *made[0]


def test_moving_frames_equal_recorded_motion(
    carrying: tuple[Skill, Demonstration, list[Pose]],
):
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


def test_moving_frames_means_move_with_objects(carrying: tuple[Skill, Demonstration, list[Pose]]):
    skill, demo, poses = carrying
    local_mean, h = skill.means[0, 0], skill.period
    for t in range(1, len(poses) - 1):
        frames = moving_frames(
            skill, {"cup": poses[t - 1]}, {"cup": poses[t]}, np.append(demo.x[t], np.zeros(7))
        )
        mean = adapt(skill, frames).means[0]
        now, later = (
            poses[s].position + rotation_matrix(poses[s].quaternion) @ local_mean[:3] for s in (t, t + 1)
        )
        own = (
            rotation_matrix(poses[t + 1].quaternion) @ local_mean[7:10]
        )  # the hand's velocity, local_mean from the object
        np.testing.assert_allclose(mean[:3], now, atol=1e-9)
        np.testing.assert_allclose(mean[7:10], (later - now) / h + own, atol=1e-9)


def test_moving_frames_on_sphere_means_rotate(carrying: tuple[Skill, Demonstration, list[Pose]]):
    _, demo, poses = carrying
    converted = to_sphere(demo)
    held = replace(
        converted,
        x=np.hstack([converted.x[:, :3], [(p @ Pose(np.zeros(3), HOLD)).quaternion for p in poses]]),
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


def test_moving_frames_fixed_objects_are_fixed(carrying: tuple[Skill, Demonstration, list[Pose]]):
    skill, demo, poses = carrying
    fixed = {"cup": poses[0]}
    (frame,) = moving_frames(skill, fixed, fixed, np.append(demo.x[0], np.zeros(7)))
    expected = frame_from_pose("cup", skill.layout, poses[0])
    np.testing.assert_allclose(frame.A, expected.A, atol=1e-12)
    np.testing.assert_allclose(frame.b, expected.b, atol=1e-12)


@pytest.mark.parametrize("length", [0.7, 0.98, 1.2])
def test_moving_frames_short_quaternion_is_accepted(
    carrying: tuple[Skill, Demonstration, list[Pose]], length: float
):
    skill, demo, poses = carrying
    x = np.append(demo.x[1], np.zeros(7))
    short = x.copy()
    short[3:7] *= length
    (a,), (b,) = (moving_frames(skill, {"cup": poses[0]}, {"cup": poses[1]}, given) for given in (x, short))
    np.testing.assert_allclose(a.A, b.A, atol=1e-12)
    np.testing.assert_allclose(a.b, b.b, atol=1e-12)


def test_perform_control_cost_reduces_acceleration(valve_skill: Skill, unchecked: None):
    assert (CONTROL_COST, COVARIANCE_REGULARISATION) == (0.1, 1e-5)
    pushes = []
    for control_cost in (0.01, 0.1, 10.0):
        result = perform(valve_skill, VALVE, unseen_situation(0), control_cost=control_cost, horizon=25)
        pushes.append(np.linalg.norm(np.diff(result.commanded[:24, :3], n=2, axis=0), axis=1).max())
    assert pushes[0] > pushes[1] > pushes[2]


def test_perform_columns_equal_recorded_columns(
    valve_recordings: tuple[RecordedDemonstration, ...],
):
    assert valve_recordings[0].demonstration.layout == task_layout(VALVE)
