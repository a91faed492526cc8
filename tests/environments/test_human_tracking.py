"""Simulated people track moving goals by the crossover model, or move and wait if the delay is long."""

from collections.abc import Callable
from dataclasses import replace
from math import inf, pi

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
from pilotfish.environments.human.crossover_model import crossover_frequency
from pilotfish.environments.human.human_state import Phase
from pilotfish.geometry import Pose, from_rotation_vector

pytestmark = pytest.mark.usefixtures(
    "unchecked"
)  # thousands of observations; test_human.py checks the annotations

TIMESTEP = 0.005
STILL = np.array([1.0, 0.0, 0.0, 0.0])
AT = Pose(np.array([0.5, 0.1, 0.2]), STILL)
NOISELESS = HumanModel(
    parallel_noise=0.0,
    perpendicular_noise=0.0,
    min_noise=0.0,
    angular_noise=0.0,
    min_angular_noise=0.0,
    gain=1.0,
)


def follow(tolerance: float = 0.02, dwell: float = 0.0) -> Subtask:
    return Subtask("follow", lambda frames: frames["goal"], tolerance, 1.0, dwell=dwell, tracking=True)


def shifted(pose: Pose, x: float) -> Pose:
    return Pose(pose.position + np.array([x, 0.0, 0.0]), pose.quaternion)


def turned(pose: Pose, a: float) -> Pose:
    return Pose(pose.position, from_rotation_vector(np.array([0.0, 0.0, a])))


@pytest.mark.parametrize("moved", [shifted, turned])
@pytest.mark.parametrize("delay", [0.0, 0.1, 0.3])
def test_tracking_open_loop_has_unit_gain_and_phase_margin(
    delay: float, moved: Callable[[Pose, float], Pose]
):
    human_model = HumanModel(max_lead=10.0, max_angular_lead=3.0)
    w, size = crossover_frequency(human_model, delay), 0.005
    plan, state = DemonstrationPlan(human_model, (follow(1.0, dwell=1000.0),), delay), initial_state(AT, 0.0)
    periods = round(2 * pi / w / TIMESTEP)
    times = TIMESTEP * np.arange(1, 6 * periods + 1)
    hands = []
    for time in times:
        observation = Observation(moved(AT, size * np.sin(w * time)), {"goal": AT})
        state = step_human(plan, state, time, observation, np.random.default_rng(0))
        x = state.hand.position[0] - AT.position[0] if moved is shifted else 2.0 * state.hand.quaternion[3]
        hands.append(x)
    assert state.phase is Phase.TRACKING
    last = slice(-4 * periods, None)
    columns = np.column_stack([np.sin(w * times), np.cos(w * times), np.ones(len(times))])[last]
    fitted = np.linalg.lstsq(columns, np.array(hands)[last], rcond=None)[0]
    returned = (fitted[0] + 1j * fitted[1]) * np.exp(-1j * w * delay) / size
    assert abs(returned) == pytest.approx(1.0, abs=0.02)
    assert np.angle(-returned) == pytest.approx(-pi + human_model.phase_margin, abs=0.02)


def track_ramp(
    human_model: HumanModel, speed: float, delay: float, seconds: float, subtask: Subtask
) -> tuple[list[HumanState], np.ndarray]:
    """Return states and errors of the tool while a delayed person tracks a goal of constant speed."""
    plan, state, tools, errors, states = (
        DemonstrationPlan(human_model, (subtask,), delay),
        initial_state(AT, 0.0),
        [AT],
        [],
        [],
    )
    rng = np.random.default_rng(0)
    for n in range(1, round(seconds / TIMESTEP)):
        time = n * TIMESTEP
        tool = tools[max(0, len(tools) - 1 - round(delay / TIMESTEP))]
        observation = Observation(tool, {"goal": shifted(AT, 0.1 + speed * time)})
        state = step_human(plan, state, time, observation, rng)
        tools.append(state.hand)
        errors.append(observation.frames["goal"].position[0] - tool.position[0])
        states.append(state)
    return states, np.array(errors)


@pytest.mark.parametrize("delay", [0.0, 0.2, 0.4])
def test_tracking_ramp_lags_by_speed_over_crossover_frequency(delay: float):
    u = 0.02
    states, errors = track_ramp(NOISELESS, u, delay, 12.0, follow(dwell=100.0))
    assert states[-1].phase is Phase.TRACKING
    assert errors[-1] == pytest.approx(u / crossover_frequency(NOISELESS, delay), rel=0.02)


def test_tracking_full_feedforward_has_no_lag():
    _, errors = track_ramp(replace(NOISELESS, feedforward_gain=1.0), 0.02, 0.2, 15.0, follow(dwell=100.0))
    assert errors[-1] == pytest.approx(0.0, abs=1e-4)


def test_tracking_goal_is_reached_after_reaction_time():
    human_model, subtask = replace(NOISELESS, gain=0.8), follow(0.008, dwell=100.0)
    states, errors = track_ramp(human_model, 0.02, 0.0, 8.0, subtask)
    reached = next(n for n, state in enumerate(states) if state.dwell_end < inf)
    came = reached - round(human_model.reaction_time / TIMESTEP)
    assert states[came - 1].phase is Phase.TRACKING
    assert np.abs(errors[came : reached + 1]).max() <= subtask.position_tolerance
    assert abs(errors[came - 1]) > subtask.position_tolerance


def test_tracking_long_delay_moves_and_waits():
    states, errors = track_ramp(NOISELESS, 0.02, 1.0, 15.0, follow(0.003, dwell=100.0))
    assert not [state for state in states if state.phase is Phase.TRACKING]
    looks = [
        n
        for n, (state, before) in enumerate(zip(states[1:], states, strict=False), 1)
        if state.n_submovements > before.n_submovements
    ]
    assert len(looks) > 5
    assert np.abs(errors[looks[2:]]).max() < 0.003
    assert states[-1].dwell_end < inf
    assert states[-1].n_timeouts == 0


def test_tracking_changing_delay_stops_and_restarts():
    state, rng, phases = initial_state(AT, 0.0), np.random.default_rng(0), []
    for n in range(1, 2400):
        delay = 0.6 if 800 < n < 1600 else 0.1
        plan = DemonstrationPlan(HumanModel(), (follow(1.0, dwell=1000.0),), delay)
        state = step_human(plan, state, n * TIMESTEP, Observation(state.hand, {"goal": AT}), rng)
        phases.append(state.phase)
    assert phases[700] is Phase.TRACKING
    assert phases[1200] is Phase.MOVE_AND_WAIT
    assert phases[-1] is Phase.TRACKING


@pytest.mark.parametrize("delay", [0.0, 0.4])
def test_tracking_hand_keeps_speed_and_lead(delay: float):
    human_model, rng = HumanModel(), np.random.default_rng(0)
    plan, state, steps = (
        DemonstrationPlan(human_model, (follow(1.0, dwell=1000.0),), delay),
        initial_state(AT, 0.0),
        [],
    )
    for n in range(1, 1600):
        observation = Observation(AT, {"goal": shifted(AT, 0.3 * n * TIMESTEP)})
        before = state.hand
        state = step_human(plan, state, n * TIMESTEP, observation, rng)
        steps.append(float(np.linalg.norm(state.hand.position - before.position)))
    furthest = human_model.max_lead + human_model.peak_speed * (human_model.tau_e + delay)
    assert np.linalg.norm(state.hand.position - AT.position) == pytest.approx(furthest)
    assert max(steps) <= human_model.peak_speed * TIMESTEP * (1 + 1e-9)
