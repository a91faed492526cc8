"""The cart of a virtual fixture: bounds, reversals, moving and observed frames, grip, refused input."""

from dataclasses import replace

import numpy as np
import pytest

import pilotfish as pf
from pilotfish.assistance import (
    FixtureState,
    PhaseSwitch,
    VirtualFixture,
    add_phase,
    learn_virtual_fixture,
    nearest_phase,
    start_fixture,
    step_fixture,
    virtual_fixture,
)
from pilotfish.assistance.phase import logistic_phase, path_phase
from pilotfish.assistance.phase_regression import regress_on_phase
from pilotfish.assistance.phase_switches import learn_switch
from pilotfish.demonstrations import Demonstration, Frame, frame_from_pose
from pilotfish.errors import InvalidInput, NotPositiveDefinite
from pilotfish.gaussians.structures import DenseCovariances, Spherical
from pilotfish.geometry import Pose, log_map, normalise

pytestmark = pytest.mark.usefixtures("unchecked")  # annotations cost several times the steps

STARTS = (3,)
IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])


def learned(demos, **choices) -> VirtualFixture:
    return learn_virtual_fixture(demos[:-1], rng=np.random.default_rng(0), **choices)


def velocities(x: np.ndarray, period: float) -> np.ndarray:
    steps = log_map(x[:-1], x[1:], STARTS) / period
    return np.vstack([steps[:1], steps])


def drive(fixture, demo: Demonstration, x=None, **observed) -> tuple[list[FixtureState], np.ndarray]:
    """Return the states and targets with rows x as input, those of the demonstration by default."""
    x = demo.x if x is None else x
    frames = [frame.at(0) for frame in demo.frames]
    state = start_fixture(fixture, observed.get("observed_frames", frames))
    states, targets = [state], []
    for pose, velocity in zip(x, velocities(x, demo.period), strict=True):
        state, target = step_fixture(fixture, state, pose, velocity, frames, demo.period, **observed)
        states.append(state)
        targets.append(target.mean)
    return states, np.array(targets)


@pytest.mark.parametrize("sphere", [False, True], ids=["flat", "sphere"])
@pytest.mark.parametrize("phase", ["path", "logistic"])
def test_held_out_demonstration_drives_the_cart_to_the_end(make, sphere, phase):
    demos = make(sphere=sphere, central=True)
    states, targets = drive(learned(demos, phase=phase), demos[-1])
    assert states[-1].phase > 0.9
    assert states[-1].reversals == 0
    direct = [distance(demo.x, demos[-1]) for demo in demos[:-1]]
    assert distance(targets, demos[-1]) < np.mean(direct)


def distance(x: np.ndarray, human: Demonstration) -> float:
    """Return the mean distance of the positions at the same share of the time."""
    rows = np.linspace(0, len(x) - 1, len(human.x)).round().astype(int)
    return float(np.linalg.norm((x[rows] - human.x)[:, :3], axis=1).mean())


def test_operators_of_other_scenes_are_nearer_than_with_direct_control(make):
    """The requirement: at most 1.0 of direct, with each recording as input in a scene between the others."""
    demos = make(5, central=True)
    fixture, there = learned(demos), demos[-1]
    fixtures, direct = [], []
    for operator in demos[:-1]:
        frames = list(operator.frames)
        states, targets = drive(fixture, replace_rows(there, operator), observed_frames=frames)
        assert states[-1].phase > 0.9
        assert states[-1].reversals <= 1
        fixtures.append(distance(targets, there))
        direct.append(distance(operator.x, there))
    assert np.mean(fixtures) <= np.mean(direct)


def test_operator_at_rest_with_tremor_keeps_the_phase(make):
    """2 mm of tremor, also where the path turns: no reversal, and no way over the turn."""
    rng, demos = np.random.default_rng(7), make(central=True)
    fixture, frames = learned(demos), list(demos[-1].frames)
    for phase in (0.25, 0.5, 0.75):
        first = state = start_fixture(fixture, frames, phase)
        x = np.tile(first.mean, (60, 1))
        x[:, :3] += 0.002 * rng.normal(size=(60, 3))
        for pose, velocity in zip(x, velocities(x, 0.05), strict=True):
            state, _ = step_fixture(fixture, state, pose, velocity, frames, 0.05)
        assert abs(state.phase - phase) < 0.03
        assert state.reversals == 0


def test_turning_point_reverses_the_cart_without_the_guard_only(make):
    """A weak spring lets the cart lag, and the path goes back on the same way."""
    demos = make(central=True)
    lagging = learned(demos)
    lagging = replace(lagging, stiffness=0.0 * lagging.stiffness, max_rate=lagging.max_rate / 3.3)
    literal, _ = drive(replace(lagging, look_ahead=0.0), demos[-1])
    guarded, _ = drive(lagging, demos[-1])
    assert literal[-1].reversals > 0
    assert literal[-1].phase < 0.2
    assert guarded[-1].reversals == 0
    assert guarded[-1].phase > 0.8


def test_operator_who_goes_back_far_from_the_turning_point_takes_the_cart_back(make):
    demos = make(central=True)
    forward = demos[-1].x[: len(demos[-1].x) // 4]
    states, _ = drive(learned(demos), demos[-1], np.vstack([forward, forward[::-1]]))
    assert states[len(forward)].phase > 0.1
    assert states[-1].phase < 0.05
    assert states[-1].reversals == 1


def test_phase_and_rate_stay_in_bounds_and_targets_are_continuous(make):
    rng, demos = np.random.default_rng(4), make()
    fixture, frames = learned(demos), list(demos[-1].frames)
    period, state = demos[0].period, start_fixture(learned(demos), list(demos[-1].frames))
    fine = np.linspace(0.0, 1.0, 2001)
    longest = np.linalg.norm(regress_on_phase(fixture.mixture, frames, fine).jacobians, axis=1).max()
    previous = state.mean
    for _ in range(300):
        size = 10.0 ** rng.uniform(-6, 6)
        x = np.concatenate([size * rng.normal(size=3), normalise(rng.normal(size=4))])
        state, target = step_fixture(fixture, state, x, size * rng.normal(size=6), frames, period)
        assert 0.0 <= state.phase <= 1.0
        assert abs(state.rate) <= fixture.max_rate * (1 + 1e-9)
        assert np.isfinite(target.mean).all()
        assert np.linalg.eigvalsh(target.covariance)[0] > 0.0
        step = np.linalg.norm(log_map(previous, target.mean, STARTS))
        assert step <= 1.01 * longest * fixture.max_rate * period
        assert previous[3:] @ target.mean[3:] > 0.0
        previous = target.mean


def test_vanishing_jacobian_does_not_stop_the_cart(make):
    """Few spherical states make a staircase: between its steps the pose does not depend on the phase."""
    demos = make()
    fixture = learned(demos, structure=Spherical(), states=4)
    states, _ = drive(fixture, demos[-1])
    assert max(abs(state.rate) for state in states) <= fixture.max_rate * (1 + 1e-9)
    assert states[-1].phase > 0.8


def test_operator_who_moves_with_the_frames_leaves_the_phase(make):
    demos = make(sphere=True, moving=True)
    fixture = learned(demos)
    layout, velocity = fixture.layout, np.array([0.2, -0.1, 0.05])
    at = np.array([0.5, 0.1, 0.2])
    state, period = None, 0.02
    for n in range(12):
        frames = [
            frame_from_pose(name, layout, Pose(p + velocity * n * period, IDENTITY))
            for name, p in (("base", np.zeros(3)), ("object", at))
        ]
        if state is None:  # the cart starts one step before the operator's first velocity
            state = start_fixture(fixture, frames, 0.3)
            continue
        pose = start_fixture(fixture, frames, 0.3).mean
        state, _ = step_fixture(fixture, state, pose, np.append(velocity, np.zeros(3)), frames, period)
    assert state is not None
    assert abs(state.phase - 0.3) < 1e-3


def test_observed_frames_decide_the_phase_and_actual_frames_the_target(make):
    demos = make(7)
    fixture, observed, actual = learned(demos[:-1]), demos[-2], demos[-1]
    alone, _ = drive(fixture, observed)
    states, targets = drive(fixture, replace_rows(actual, observed), observed_frames=list(observed.frames))
    assert [s.phase for s in states] == pytest.approx([s.phase for s in alone])
    expected = start_fixture(fixture, list(actual.frames), states[-1].phase).mean
    np.testing.assert_allclose(log_map(expected, targets[-1], STARTS), 0.0, atol=1e-9)


def replace_rows(frames_of: Demonstration, rows_of: Demonstration) -> Demonstration:
    return replace(frames_of, x=rows_of.x)


def test_negated_operator_quaternion_changes_nothing(make):
    demos = make()
    fixture, signs = learned(demos), np.array([1.0, 1.0, 1.0, -1.0, -1.0, -1.0, -1.0])
    states, targets = drive(fixture, demos[-1])
    negated, targets_negated = drive(fixture, demos[-1], demos[-1].x * signs)
    assert [s.phase for s in negated] == pytest.approx([s.phase for s in states])
    np.testing.assert_allclose(targets_negated, targets)


def test_nearest_phase_finds_a_pose_of_the_path(make):
    demos = make()
    fixture, frames = learned(demos), list(demos[-1].frames)
    mean = start_fixture(fixture, frames, 0.25).mean
    assert nearest_phase(fixture, mean, frames) == pytest.approx(0.25, abs=0.03)


@pytest.mark.parametrize("sphere", [False, True], ids=["flat", "sphere"])
def test_grip_switches_once_near_the_phase_of_the_demonstrations(make, sphere):
    demos = make(sphere=sphere, grip=True)
    fixture = learned(demos)
    (switch,) = fixture.switches
    assert switch.column == 7
    assert switch.values.tolist() == [0.0, 1.0]
    assert 0.45 < switch.phases[0] < 0.6
    states, targets = drive_with_grip(fixture, demos[-1])
    grip = targets[:, 7]
    assert set(grip) == {0.0, 1.0}
    assert np.count_nonzero(np.diff(grip)) == 1
    changed = states[int(grip.argmax()) + 1].phase
    assert switch.phases[0] <= changed <= switch.phases[0] + fixture.max_rate * demos[-1].period


def drive_with_grip(fixture, demo):
    frames, v = list(demo.frames), velocities(demo.x, demo.period)
    state = start_fixture(fixture, frames)
    states, targets = [state], []
    for pose, velocity in zip(demo.x, v, strict=True):
        state, target = step_fixture(fixture, state, pose, velocity, frames, demo.period)
        states.append(state)
        targets.append(target.mean)
    return states, np.array(targets)


def test_tremor_at_a_switch_does_not_open_the_grip(make):
    demos = make(grip=True)
    fixture = learned(demos)
    frames, at = list(demos[-1].frames), float(fixture.switches[0].phases[0])
    state = start_fixture(fixture, frames, at + 0.001)
    grips = []
    for n in range(20):
        pose = start_fixture(fixture, frames, at + 0.005 * (-1) ** n).mean
        state, target = step_fixture(fixture, state, pose, np.zeros(7), frames, 0.5)
        grips.append(target.mean[7])
    assert set(grips) == {1.0}


def test_switch_is_the_vote_of_the_demonstrations():
    phases = [np.linspace(0.0, 1.0, 11)] * 3
    values = [(p >= at).astype(float) for p, at in zip(phases, (0.3, 0.5, 0.9), strict=True)]
    switch = learn_switch(2, values, phases)
    assert switch.phases.tolist() == pytest.approx([0.5])
    assert (switch.value_at(0.49), switch.value_at(0.51)) == (0.0, 1.0)


def test_logistic_phase_is_slow_at_both_ends():
    s = logistic_phase(101)
    assert (s[0], s[-1]) == (0.0, 1.0)
    rates = np.diff(s) * 100
    assert rates[0] == pytest.approx(rates[-1])
    assert rates[0] < 0.4 < 1.3 < rates[50]


def test_path_phase_has_constant_speed_and_no_pause():
    x = np.cumsum(np.repeat([[0.1], [0.0], [0.4]], 10, axis=0), axis=0)
    s = path_phase(x, np.ones(1), ())
    np.testing.assert_allclose(s, (x[:, 0] - x[0, 0]) / (x[-1, 0] - x[0, 0]))


def test_recorded_derivatives_are_left_out(make):
    demos = [pf.add_derivatives(demo) for demo in make()]
    fixture = learned(demos)
    assert fixture.layout.width == 7
    state = start_fixture(fixture, list(demos[-1].frames))
    x = demos[-1].x[3, :7]
    _, target = step_fixture(fixture, state, x, np.zeros(6), list(demos[-1].frames), 0.05)
    assert target.mean.shape == (7,)


def test_streamed_skill_needs_a_phase(make):
    demos = make()
    batch = pf.learn(demos[:2], states=4, rng=np.random.default_rng(0)).skill
    with pytest.raises(InvalidInput, match="expected 'phase': the skill was learned without one"):
        virtual_fixture(stream(batch, demos), 4.0)


def test_streamed_skill_with_phase_drives_to_the_end(make):
    demos = make()
    with_phase = [add_phase(demo, path_phase(demo.x, np.ones(6), STARTS)) for demo in demos]
    batch = pf.learn(with_phase[:2], states=10, rng=np.random.default_rng(0)).skill
    fixture = virtual_fixture(stream(batch, with_phase[:-1]), 4.0)
    states, _ = drive(fixture, demos[-1])
    assert states[-1].phase > 0.9


def stream(batch: pf.Skill, demos) -> pf.Skill:
    penalties = pf.online.estimate_penalties(batch, demos[:2], explained_variance=0.98, scales=False)
    model = pf.online.from_batch_fit(batch, demos[:2], penalties)
    for demo in demos[2:]:
        model, _ = pf.online.observe_demonstration(model, demo)
    return pf.online.to_skill(model)


def test_one_demonstration_is_refused(make):
    with pytest.raises(InvalidInput, match="1 demonstrations are given, expected at least 2"):
        learn_virtual_fixture(make(1), rng=np.random.default_rng(0))


def test_unknown_phase_and_standing_demonstration_are_refused(make):
    demos = make()
    with pytest.raises(InvalidInput, match="phase is 'time', expected one of 'path', 'logistic'"):
        learned(demos, phase="time")
    with pytest.raises(InvalidInput, match="does not move"):
        learned([replace(demo, x=np.tile(demo.x[:1], (80, 1))) for demo in demos])


def test_other_columns_are_refused(make):
    with pytest.raises(InvalidInput, match="has other columns than the first"):
        learn_virtual_fixture([*make(2), *make(1, grip=True)], rng=np.random.default_rng(0))


def test_singular_covariance_is_refused_before_the_loop(make):
    skill = learned(make()).skill
    dense = skill.covariances[1].dense.copy()
    dense[0, 2, :] = dense[0, :, 2] = 0.0
    singular = replace(skill, covariances=(skill.covariances[0], DenseCovariances(dense)))
    with pytest.raises(NotPositiveDefinite, match="pose in frame 'object', given the phase"):
        virtual_fixture(singular, 4.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"pose": np.zeros(7)}, "quaternion in columns 3 to 6 has norm 0"),
        ({"pose": np.full(7, np.nan)}, "pose"),
        ({"pose": np.ones(8)}, r"pose has shape \(8,\), expected \(7,\)"),
        ({"velocity": np.ones(7)}, r"velocity has shape \(7,\), expected \(6,\)"),
        ({"velocity": np.full(6, np.inf)}, "velocity"),
        ({"dt": 0.0}, "dt"),
        ({"frames": []}, "frames are missing, expected each of base, object once"),
        (
            {"frames": [Frame("base", np.eye(7), np.zeros(7)), Frame("cup", np.eye(7), np.zeros(7))]},
            "base, cup, expected",
        ),
        ({"frames": [Frame(n, np.eye(3), np.zeros(3)) for n in ("base", "object")]}, "has 3 columns"),
        ({"frames": [Frame(n, np.zeros((7, 7)), np.zeros(7)) for n in ("base", "object")]}, "singular"),
    ],
)
def test_wrong_input_of_a_step_is_refused(make, change, message):
    demos = make()
    fixture, frames = learned(demos), list(demos[-1].frames)
    arguments = {"pose": demos[-1].x[0], "velocity": np.zeros(6), "frames": frames, "dt": 0.05, **change}
    with pytest.raises(InvalidInput, match=message):
        step_fixture(fixture, start_fixture(fixture, frames), **arguments)


@pytest.mark.parametrize(
    ("switches", "message"),
    [
        (3, "switches has type int"),
        ([3], "a switch has type int"),
        ([PhaseSwitch(8, np.array([0.5]), np.zeros(2))], "column of a switch is 8"),
        ([PhaseSwitch(0, np.array([1.5]), np.zeros(2))], "numbers from 0 to 1"),
        ([PhaseSwitch(0, np.array([0.5, 0.4]), np.zeros(3))], "decrease"),
        (
            [PhaseSwitch(0, np.array([0.5]), np.zeros(3))],
            r"values of a switch has shape \(3,\), expected \(2,\)",
        ),
        ([PhaseSwitch(0, np.array([0.5]), np.array([0.0, np.nan]))], "values of a switch"),
        ([PhaseSwitch(0, np.array([0.5]), np.zeros(2))] * 2, "expected each once"),
        ([PhaseSwitch(4, np.array([0.5]), np.zeros(2))], "column 4 belongs to a quaternion"),
    ],
)
def test_wrong_switch_is_refused(make, switches, message):
    skill = learned(make(3)).skill
    with pytest.raises(InvalidInput, match=message):
        virtual_fixture(skill, 4.0, switches=switches)


def test_wrong_layout_and_state_are_refused(make):
    demos, other = make(3), make(3, grip=True)
    fixture, with_grip = learned(demos), learned(other)
    with pytest.raises(InvalidInput, match=r"recorded_layout has the columns .*grip.* expected those of the"):
        virtual_fixture(fixture.skill, 4.0, recorded_layout=other[0].layout)
    state, frames = start_fixture(with_grip, list(other[0].frames)), list(demos[0].frames)
    with pytest.raises(InvalidInput, match="pose of 8 columns, expected 7: it belongs to another fixture"):
        step_fixture(fixture, state, demos[0].x[0], np.zeros(6), frames, 0.05)
    with pytest.raises(InvalidInput, match="fixture has type Skill"):
        start_fixture(fixture.skill, frames)


def test_phase_of_another_length_or_of_derivatives_is_refused(make):
    demo = make(1)[0]
    with pytest.raises(InvalidInput, match=r"phase has shape \(3,\), expected \(80,\)"):
        add_phase(demo, np.zeros(3))
    with pytest.raises(InvalidInput, match="demo has a derivative of 'position'"):
        add_phase(pf.add_derivatives(demo), np.zeros(80))
    with pytest.raises(InvalidInput, match="demo has a part 'phase' already"):
        add_phase(add_phase(demo, np.zeros(80)), np.zeros(80))


def test_phase_switch_holds_its_first_value_before_the_first_change():
    switch = PhaseSwitch(0, np.array([0.2, 0.8]), np.array([0.0, 1.0, 0.0]))
    assert [switch.value_at(s) for s in (0.0, 0.2, 0.5, 0.8, 1.0)] == [0.0, 1.0, 1.0, 0.0, 0.0]
