"""The mode "fixture": the hand pulls a cart along the path, and the robot follows the cart."""

from dataclasses import replace

import assisted_task as task
import numpy as np
import pytest

from pilotfish import assistance
from pilotfish.assistance import Command, step_assistance
from pilotfish.errors import InvalidInput

pytestmark = pytest.mark.usefixtures("unchecked")  # annotations cost several times the steps

SCENE = task.random_scene(np.random.default_rng(5))
FRAMES = task.scene_frames(SCENE)
ROWS = task.demonstrate(np.random.default_rng(6), SCENE).x


def run_rows(assistant, rows, mode, state=None, actual=FRAMES):
    return task.run(assistant, rows, FRAMES, actual, mode, state=state)


def test_fixture_leads_to_the_actual_objects_and_moves_the_grip():
    """The hand follows the scene observed; the grip is that of the phase, not of the hand."""
    assistant = task.assistant()
    actual = task.random_scene(np.random.default_rng(4))
    hands = ROWS.copy()
    hands[:, 7] = 0.0
    state, targets = run_rows(assistant, hands, "fixture", actual=task.scene_frames(actual))
    poses = np.array([t.pose for t in targets])
    assert {t.mode for t in targets} == {"fixture"}
    assert set(poses[:, 7]) == {0.0, 1.0}
    for pose, row in zip(actual, (19, 39), strict=True):  # the cube and the tray
        distances = np.linalg.norm(poses[:, :3] - pose.position, axis=1)
        assert distances.min() < 0.5 * np.linalg.norm(ROWS[row, :3] - pose.position)
    assert state.cart.phase > 0.95


def test_fixture_holds_the_grip_until_the_phase_changes_it():
    """A grip that the operator closed does not open because the cart begins where it is open."""
    assistant, hand = task.assistant(), ROWS[5].copy()
    hand[7] = 1.0
    state, _ = run_rows(assistant, np.tile(hand, (5, 1)), "direct")
    state, targets = run_rows(assistant, np.tile(hand, (10, 1)), "fixture", state=state)
    assert {t.pose[7] for t in targets} == {1.0}
    state, targets = run_rows(assistant, ROWS[6:], "fixture", state=state)
    assert targets[-1].pose[7] == 0.0  # closed and opened by the phase


def test_cart_stands_while_the_clutch_is_open():
    assistant = task.assistant()
    state, _ = run_rows(assistant, ROWS[:15], "fixture")
    phase = state.cart.phase
    for row in ROWS[15:30]:
        command = Command(row, "fixture", clutch=False)
        state, _ = step_assistance(assistant, state, command, FRAMES, FRAMES, task.PERIOD)
    assert state.cart.phase == pytest.approx(phase, abs=1e-3)


def test_fixture_without_one_and_of_another_task_is_refused():
    skill = task.assistant().skills[0].skill
    plain = assistance.make_assistant([assistance.assisted_skill(task.learn())])
    _, targets = run_rows(plain, ROWS[:3], "fixture")
    assert {t.mode for t in targets} == {"direct"}
    with pytest.raises(InvalidInput, match=r"fixture has the frames .*, expected those of the skill"):
        assistance.assisted_skill(replace(skill, frame_names=("a", "b")), fixture=task.learn_fixture())


def test_bad_grip_holds_the_target_on_a_fixture():
    assistant = task.assistant()
    state, targets = run_rows(assistant, ROWS[:15], "fixture")
    hand = ROWS[15].copy()
    hand[:3] += 0.3
    hand[7] = np.nan
    _, held = run_rows(assistant, np.tile(hand, (10, 1)), "fixture", state=state)
    assert np.abs(held[-1].pose[:3] - targets[-1].pose[:3]).max() < 0.02
