"""State of the page under events; the newest event wins."""

import threading
from dataclasses import replace

import numpy as np

from pilotfish.demonstrations import Demonstration
from pilotfish.geometry import Pose
from pilotfish.models import Skill
from pilotfish.panel import frame_pose, view_content
from pilotfish.panel.view_state import (
    LatestState,
    advance,
    choose_situation,
    drag_frame,
    first_state,
)

Demonstrations = tuple[Demonstration, ...]
UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])


def test_drag_moves_one_frame_and_reset_returns_it(reaches: Demonstrations, reach_skill: Skill):
    content = view_content(reaches, reach_skill)
    state = first_state(content)
    target = Pose(np.array([0.4, 0.1, 0.2]), UPRIGHT)
    dragged = drag_frame(state, content, 1, target, by_handle=True)
    np.testing.assert_allclose(frame_pose(dragged.frames[1], content.layout).position, target.position)
    assert dragged.frames[0] is state.frames[0]
    assert dragged.placements == state.placements  # the handle is there already
    assert drag_frame(state, content, 1, target, by_handle=False).placements == 1
    assert choose_situation(dragged, content, 0).frames is content.situations[0].frames
    assert choose_situation(dragged, content, 2).frames is content.situations[2].frames


def test_long_drag_adds_no_rounding(rng: np.random.Generator, reaches: Demonstrations, reach_skill: Skill):
    content = view_content(reaches, reach_skill)
    state = first_state(content)
    for _ in range(50):
        q = rng.normal(size=4)
        state = drag_frame(state, content, 1, Pose(rng.normal(size=3), q / np.linalg.norm(q)), by_handle=True)
    target = frame_pose(content.situations[0].frames[1], content.layout)
    state = drag_frame(state, content, 1, target, by_handle=True)
    np.testing.assert_allclose(state.frames[1].A, content.situations[0].frames[1].A, atol=1e-12)


def test_time_advances_while_playing_and_starts_again(reaches: Demonstrations):
    state = replace(first_state(view_content(reaches)), time=1.0)
    assert advance(state, 0.5, 2.0) is state
    playing = replace(state, is_playing=True)
    assert advance(playing, 0.5, 2.0).time == 1.5
    assert advance(playing, 1.5, 2.0).time == 0.0


def test_latest_state_drops_states_in_between(reaches: Demonstrations):
    """A reader that is busy while 100 states arrive reads the last one only."""
    state = first_state(view_content(reaches))
    latest = LatestState(state)
    assert latest.wait(state, 0.0) is state  # no change
    readings = []
    for n in range(1, 101):
        latest.update(lambda s, n=n: replace(s, time=float(n)))  # type: ignore[misc]
    readings.append(latest.wait(state, 10.0).time)
    assert latest.wait(latest.get(), 0.0).time == 100.0
    assert readings == [100.0]


def test_latest_state_wakes_a_waiting_reader(reaches: Demonstrations):
    state = first_state(view_content(reaches))
    latest, found = LatestState(state), []
    reader = threading.Thread(target=lambda: found.append(latest.wait(state, 60.0).time))
    reader.start()
    latest.update(lambda s: replace(s, time=2.0))
    reader.join(30.0)
    assert found == [2.0]
