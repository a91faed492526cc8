"""A skill learned from recorded demonstrations performs the task in new situations."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from published import published_options

from pilotfish.demonstrations import (
    Layout,
    Part,
    Quantity,
    add_derivatives,
    demonstration,
    to_sphere,
)
from pilotfish.environments import TASKS, Workcell
from pilotfish.errors import InvalidInput
from pilotfish.geometry import (
    angle,
)
from pilotfish.models import Skill, learn
from pilotfish.planning import (
    mean_demonstration_length,
    moving,
)
from pilotfish.simulation.execution import SETTLING_TIME, perform
from pilotfish.simulation.recording import (
    RecordedDemonstration,
    situation_from_seed,
    task_layout,
)

VALVE, SCREWDRIVER = TASKS["valve"], TASKS["screwdriver"]


def learn_skill(
    recordings: tuple[RecordedDemonstration, ...],
    *,
    sphere: bool = False,
    states: int | None = 5,
    **options: Any,
) -> Skill:
    demonstrations = [recorded.demonstration for recorded in recordings]
    converted = [to_sphere(demo) if sphere else demo for demo in demonstrations]
    return learn(
        [add_derivatives(demo) for demo in converted], states=states, rng=np.random.default_rng(0), **options
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
    with pytest.raises(InvalidInput, match="does not state the length of its demonstrations"):
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
@pytest.mark.parametrize(
    "options", [{"states": None}, {"states": 5, **published_options()}], ids=["default", "published"]
)
def test_perform_command_is_smooth(
    alignment_recordings: tuple[RecordedDemonstration, ...],
    options: dict[str, Any],
    sphere: bool,
    unchecked: None,
):
    """Five states are cut as published: a first state of a few steps is a long way from the start."""
    skill = learn_skill(alignment_recordings, sphere=sphere, **options)
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

    plan_reference = moving.moving_frame_reference

    def noted(now: Any, later: Any, states: np.ndarray, covariance_regularisation: float) -> Any:
        made.append((now, later, len(states)))
        return plan_reference(now, later, states, covariance_regularisation)

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


def test_perform_control_cost_reduces_acceleration(valve_skill: Skill, unchecked: None):
    pushes = []
    for control_cost in (0.01, 0.1, 10.0):
        result = perform(valve_skill, VALVE, unseen_situation(0), control_cost=control_cost, horizon=25)
        pushes.append(np.linalg.norm(np.diff(result.commanded[:24, :3], n=2, axis=0), axis=1).max())
    assert pushes[0] > pushes[1] > pushes[2]


def test_perform_columns_equal_recorded_columns(
    valve_recordings: tuple[RecordedDemonstration, ...],
):
    assert valve_recordings[0].demonstration.layout == task_layout(VALVE)
