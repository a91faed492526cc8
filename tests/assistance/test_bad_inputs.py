"""Bad inputs: refused by name before the loop; in the loop authority fades, and the target never steps."""

from dataclasses import replace

import assisted_task as task
import numpy as np
import pytest
from annotations import check_annotations

import pilotfish as pf
from pilotfish import assistance
from pilotfish.assistance import Command, initial_state, step_assistance
from pilotfish.errors import InvalidInput, NotPositiveDefinite
from pilotfish.gaussians.structures import DenseCovariances

SCENE = task.random_scene(np.random.default_rng(5))
FRAMES = task.scene_frames(SCENE)
ROWS = task.demonstrate(np.random.default_rng(6), SCENE).x
CUBE, TRAY = FRAMES
BAD_FRAMES = {
    "stale": None,
    "missing": [CUBE],
    "empty": [],
    "of another skill": [replace(f, name=f"other {f.name}") for f in FRAMES],
    "singular": [replace(CUBE, A=0.0 * CUBE.A), TRAY],
    "nearly singular": [replace(CUBE, A=1e-200 * CUBE.A), TRAY],
    "not finite": [replace(CUBE, b=np.full(8, np.nan)), TRAY],
    "infinite": [CUBE, replace(TRAY, A=np.inf * np.ones((8, 8)))],
    "of another width": [pf.Frame("cube", np.eye(5), np.zeros(5)), TRAY],
}
BAD_HANDS = {
    "zero quaternion": np.concatenate([ROWS[23, :3], np.zeros(4), ROWS[23, 7:]]),
    "not finite": np.full(8, np.nan),
    "infinite": np.full(8, np.inf),
    "far away": np.concatenate([[1e9, 0.0, 0.0], ROWS[23, 3:]]),
    "of another width": ROWS[23, :7],
    "empty": np.zeros(0),
    "text": np.array(["x"] * 8),
}
WITHOUT_LOOP = [name for name in BAD_FRAMES if name != "stale"]


@pytest.fixture(autouse=True)
def unchecked():
    """Run without checks of annotations, as a program does: the library itself has to refuse."""
    with check_annotations(False):
        yield


def with_covariances(change) -> pf.Skill:
    """Return the skill with a change to the covariances of its first frame."""
    skill = task.learn()
    changed = DenseCovariances(change(skill.covariances[0].dense.copy()))
    return replace(skill, covariances=(changed, *skill.covariances[1:]))


def set_first(value):
    def change(covariances):
        covariances[0] = value
        return covariances

    return change


@pytest.mark.parametrize(
    ("change", "error"),
    [
        (set_first(0.0), NotPositiveDefinite),
        (set_first(np.nan), InvalidInput),
        (set_first(np.inf), InvalidInput),
        (lambda c: -c, NotPositiveDefinite),
    ],
    ids=["singular", "NaN", "infinite", "negative"],
)
def test_skill_with_a_bad_covariance_is_refused(change, error):
    with pytest.raises(error, match="covariance"):
        assistance.assisted_skill(with_covariances(change))


@pytest.mark.parametrize("side", ["observed", "actual"])
@pytest.mark.parametrize("name", WITHOUT_LOOP)
def test_bad_frames_are_refused_before_the_loop(name, side):
    scenes = {"observed": FRAMES, "actual": FRAMES, side: BAD_FRAMES[name]}
    with pytest.raises((InvalidInput, NotPositiveDefinite), match=r"frame|covariance"):
        initial_state(task.assistant(), ROWS[0], scenes["observed"], scenes["actual"])


@pytest.mark.parametrize("name", BAD_HANDS)
def test_bad_pose_is_refused_before_the_loop(name):
    with pytest.raises(InvalidInput, match="expected 8 finite numbers with a unit quaternion"):
        initial_state(task.assistant(), BAD_HANDS[name], FRAMES, FRAMES)


def test_skill_of_other_columns_is_refused():
    layout = pf.demonstrations.Layout(task.LAYOUT.parts[2:])
    with pytest.raises(InvalidInput, match="expected a position of three axes"):
        pf.assistance.coordinates.coordinate_layout(layout)


def run(state, steps, dt=0.02, *, hand=ROWS[23], observed=FRAMES, actual=FRAMES, skill=0, assistant=None):
    """Return the state after some steps of shared control, whose targets never jump and are finite."""
    assistant = assistant or task.assistant()
    authority = []
    for _ in range(steps):
        before = state.memory.pose
        command = Command(hand, "shared", skill=skill)
        state, target = step_assistance(assistant, state, command, observed, actual, dt)
        for array in (target.pose, target.velocity, target.covariance, target.probabilities):
            assert np.isfinite(array).all()
        assert np.linalg.norm(target.pose[:3] - before[:3]) <= task.LIMITS.speed * dt + 1e-9
        authority.append(target.authority)
    assert np.abs(np.diff(authority)).max() <= 2.0 * dt + 1e-9
    return state, authority


def assisted_state():
    state, authority = run(initial_state(task.assistant(), ROWS[23], FRAMES, FRAMES), 60)
    assert authority[-1] > 0.9
    return state


@pytest.mark.parametrize("side", ["observed", "actual"])
@pytest.mark.parametrize("name", BAD_FRAMES)
def test_authority_fades_with_bad_frames_and_returns_with_good_ones(name, side):
    before = assisted_state()
    state, authority = run(before, 30, **{side: BAD_FRAMES[name]})
    assert np.isclose(authority[0], before.memory.authority - 2.0 * 0.02)  # it fades, and is not cut off
    assert authority[-1] == 0.0
    assert np.allclose(state.memory.pose[:3], ROWS[23, :3], atol=1e-3)  # direct control
    _, authority = run(state, 40)
    assert authority[-1] > 0.9


@pytest.mark.parametrize("name", BAD_HANDS)
def test_target_holds_with_a_bad_hand_and_blends_when_it_returns(name):
    state = assisted_state()
    held, _ = run(state, 30, hand=BAD_HANDS[name])
    assert np.allclose(held.memory.pose, state.memory.pose, atol=1e-3)
    returned, _ = run(held, 60, hand=ROWS[23])
    assert np.allclose(returned.memory.pose, state.memory.pose, atol=1e-3)


@pytest.mark.parametrize("skill", [1, 7], ids=["without its frames", "unknown"])
def test_change_to_an_unusable_skill_keeps_the_old_one(skill):
    other = replace(task.learn(), frame_names=("a", "b"))
    assistant = assistance.make_assistant(
        [*task.assistant().skills, assistance.assisted_skill(other)], limits=task.LIMITS
    )
    state, _ = run(assisted_state(), 30, skill=skill, assistant=assistant)
    assert state.skill == 0
    assert state.memory.authority == 0.0 or skill == 7  # an unknown number changes nothing
