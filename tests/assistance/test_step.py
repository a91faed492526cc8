"""One step of the assistance: modes, transfers, faults and refused arguments."""

from dataclasses import replace

import assisted_task as task
import numpy as np
import pytest
from annotations import check_annotations

import pilotfish as pf
from pilotfish import assistance
from pilotfish.assistance import Command, initial_state, step_assistance
from pilotfish.errors import InvalidInput
from pilotfish.geometry import angle, from_rotation_vector, multiply

SCENE = task.random_scene(np.random.default_rng(5))
FRAMES = task.scene_frames(SCENE)
UP = np.array([0.0, 0.0, 0.2])
ROWS = task.demonstrate(np.random.default_rng(6), SCENE).x


@pytest.fixture(autouse=True)
def unchecked():
    """Run the loops without checks of annotations, which the tests of the parts have."""
    with check_annotations(False):
        yield


def start(assistant, row=0):
    return initial_state(assistant, ROWS[row], FRAMES, FRAMES)


def run_rows(assistant, rows, mode, state=None, observed=FRAMES, actual=FRAMES):
    return task.run(assistant, rows, observed, actual, mode, state=state)


def test_direct_follows_the_hand_exactly():
    _, targets = run_rows(task.assistant(), ROWS, "direct")
    assert np.abs(targets[30].pose[:3] - ROWS[30, :3]).max() < 1e-6
    assert [t.authority for t in targets] == [0.0] * len(ROWS)


@pytest.mark.parametrize("kind", ["flat", "sphere", "derivatives"])
def test_carried_brings_the_hand_to_the_actual_objects(rng, kind):
    """Thirteen states: of seven, the mean of the one at the cube lies up to 4 cm beside it."""
    assistant = task.assistant(kind, states=13)
    actual = task.random_scene(rng.spawn(1)[0])  # SCENE is the scene of seed 5
    _, targets = run_rows(assistant, ROWS, "shared", actual=task.scene_frames(actual))
    poses = np.array([t.pose for t in targets])
    for n, point in enumerate((actual[0].position, actual[1].position)):
        closest = np.linalg.norm(poses[:, :3] - point, axis=1).min()
        of_hand = np.linalg.norm(ROWS[:, :3] - point, axis=1).min()
        assert closest < 0.02, f"object {n}: {closest:.3f} m, the hand {of_hand:.3f} m"
    assert np.linalg.norm(actual[0].position - SCENE[0].position) > 0.03


def test_carried_stays_near_the_hand_where_the_view_is_right():
    _, targets = run_rows(task.assistant(), ROWS, "shared")
    errors = np.array([np.linalg.norm(t.pose[:3] - x[:3]) for t, x in zip(targets, ROWS, strict=True)])
    assert np.median(errors) < 0.01  # the operator's standard deviation
    assert errors.max() < 0.04


def test_grip_follows_the_operator_in_direct_and_shared_control():
    for mode in ("direct", "shared"):
        _, targets = run_rows(task.assistant(), ROWS, mode)
        assert [t.pose[7] for t in targets] == ROWS[:, 7].tolist()


def test_literal_variant_corrects_towards_the_actual_object():
    """It is not always right, but nearer to the cube than the hand in each of four scenes."""
    for seed in range(4):
        actual = task.random_scene(np.random.default_rng(seed))
        _, targets = run_rows(task.assistant(literal=True), ROWS, "shared", actual=task.scene_frames(actual))
        poses = np.array([t.pose for t in targets])
        closest, of_hand = (
            np.linalg.norm(x[:, :3] - actual[0].position, axis=1).min() for x in (poses, ROWS)
        )
        assert closest < 0.9 * of_hand


@pytest.mark.parametrize("row", [3, 12, 22, 33, 45, 55])
def test_autonomous_control_finishes_from_any_row(row):
    assistant = task.assistant()
    state, _ = run_rows(assistant, ROWS[:row], "shared")
    before = state.memory.pose
    state, targets = run_rows(assistant, np.tile(ROWS[row], (70, 1)), "autonomous", state=state)
    assert targets[0].mode == "autonomous"
    assert np.linalg.norm(targets[0].pose[:3] - before[:3]) < 0.05  # it goes on, not back to the start
    assert np.linalg.norm(targets[-1].pose[:3] - ROWS[-1, :3]) < 0.04
    if row < 15:
        assert {t.pose[7] for t in targets} == {0.0, 1.0}  # the grip closes and opens


def test_plan_follows_an_object_that_moves(rng):
    assistant = task.assistant()
    state, _ = run_rows(assistant, ROWS[:12], "shared")
    moved = (SCENE[0], task.random_object(rng, [0.6, -0.25, 0.1]))
    state, _ = run_rows(assistant, np.tile(ROWS[12], (10, 1)), "autonomous", state=state)
    state, targets = run_rows(
        assistant, np.tile(ROWS[12], (70, 1)), "autonomous", state=state, actual=task.scene_frames(moved)
    )
    end = moved[1].position + UP
    assert np.linalg.norm(targets[-1].pose[:3] - end) < 0.04
    steps = np.diff([t.pose[:3] for t in targets], axis=0)
    assert np.linalg.norm(steps, axis=1).max() <= task.LIMITS.speed * task.PERIOD + 1e-9


def autonomous_path(assistant, state, noise, rng, dt, count):
    """Return the positions of autonomous control with normal noise [m] in the frames of each step."""
    path, command = [], Command(state.memory.command, "autonomous")
    for _ in range(count):
        frames = [replace(f, b=f.b + noise * rng.normal() * (np.arange(8) < 3)) for f in FRAMES]
        state, target = step_assistance(assistant, state, command, FRAMES, frames if noise else FRAMES, dt)
        path.append(target.pose[:3])
    return np.array(path)


@pytest.mark.parametrize("dt", [0.04, task.PERIOD])
def test_plan_keeps_its_pace_and_path_while_the_scene_always_changes(rng, dt):
    """Frames from a camera differ a little at every step; planning again must neither stop nor hurry it.

    A plan from the target, which a transition holds back, would add the rest of the transition twice:
    7.7 cm in the third step of .1 s.
    """
    assistant = task.assistant()
    state, _ = run_rows(assistant, ROWS[:12], "shared")
    still, noisy = (autonomous_path(assistant, state, noise, rng, dt, 15) for noise in (0.0, 1e-4))
    assert np.linalg.norm(np.diff(still, axis=0), axis=1).sum() > 0.05
    assert np.linalg.norm(still - noisy, axis=1).max() < 0.01


def test_plan_ends_at_the_object_while_the_scene_always_changes(rng):
    assistant = task.assistant()
    state, _ = run_rows(assistant, ROWS[:50], "shared")
    path = autonomous_path(assistant, state, 1e-4, rng, task.PERIOD, 20)
    assert np.linalg.norm(path[-1] - (SCENE[1].position + UP)) < 0.04


def test_grip_holds_when_the_operator_returns_and_yields_to_a_change():
    assistant = task.assistant()
    state, _ = run_rows(assistant, ROWS[:15], "shared")
    hand = ROWS[15].copy()  # with an open grip
    state, targets = run_rows(assistant, np.tile(hand, (15, 1)), "autonomous", state=state)
    assert targets[-1].pose[7] == 1.0
    state, targets = run_rows(assistant, np.tile(hand, (5, 1)), "shared", state=state)
    assert {t.pose[7] for t in targets} == {1.0}
    hand[7] = 1.0  # the operator agrees, and then opens
    state, _ = run_rows(assistant, hand[None], "shared", state=state)
    hand[7] = 0.0
    state, targets = run_rows(assistant, hand[None], "shared", state=state)
    assert targets[-1].pose[7] == 0.0


def test_plan_rests_at_its_end_and_follows_the_object_from_there(rng):
    """Planned again with one row left, it once overshot by centimetres at a change of a nanometre."""
    assistant = task.assistant()
    state, _ = run_rows(assistant, ROWS[:15], "shared")
    command, path = Command(ROWS[15], "autonomous"), []
    for _ in range(140):
        frames = [replace(f, b=f.b + 1e-9 * rng.normal() * (np.arange(8) < 3)) for f in FRAMES]
        state, target = step_assistance(assistant, state, command, FRAMES, frames, task.PERIOD)
        path.append(target.pose[:3])
    assert np.ptp(path[-40:], axis=0).max() < 1e-4
    assert not state.plan.is_moving
    moved = (SCENE[0], pf.geometry.Pose(SCENE[1].position + np.array([0.0, 0.05, 0.0]), SCENE[1].quaternion))
    state, targets = run_rows(
        assistant, np.tile(ROWS[15], (40, 1)), "autonomous", state=state, actual=task.scene_frames(moved)
    )
    assert np.allclose(targets[-1].pose[:3] - path[-1], [0.0, 0.05, 0.0], atol=0.01)


def test_grip_holds_when_the_skill_or_the_plan_takes_over():
    """The operator's hand is open, and the plan begins where the grip is open."""
    first = task.assistant()
    plain = assistance.assisted_skill(task.learn())
    assistant = assistance.make_assistant([first.skills[0], plain], limits=task.LIMITS)
    hands = ROWS.copy()
    hands[:, 7] = 0.0
    state, targets = run_rows(assistant, hands[:25], "fixture")
    assert targets[-1].pose[7] == 1.0
    for mode in ("shared", "fixture", "direct"):
        command = Command(hands[25], mode, skill=1)
        changed, target = step_assistance(assistant, state, command, FRAMES, FRAMES, task.PERIOD)
        assert changed.skill == 1
        assert target.pose[7] == 1.0
    closed = ROWS[3].copy()
    closed[7] = 1.0
    state, _ = run_rows(assistant, np.tile(closed, (5, 1)), "direct")
    _, targets = run_rows(assistant, closed[None], "autonomous", state=state)
    assert targets[-1].mode == "autonomous"
    assert targets[-1].pose[7] == 1.0


def test_frames_with_reused_arrays_and_changed_targets_change_nothing_else():
    """A caller may fill the same arrays at every step, and change a target that it received."""
    assistant = task.assistant()
    arrays = [(f.name, f.A.copy(), f.b.copy()) for f in FRAMES]
    state = start(assistant)
    moved = np.array([0.0, 0.1, 0.0])
    for n in range(60):
        if n == 30:
            for _, _, b in arrays:
                b[:3] += moved
        frames = [pf.Frame(*each) for each in arrays]
        state, target = step_assistance(assistant, state, Command(ROWS[20]), FRAMES, frames, task.PERIOD)
        if n == 29:
            before = target.pose[:3].copy()
        target.pose[:] = 0.0
    assert np.allclose(state.memory.pose[:3] - before, moved, atol=0.01)


def test_frames_of_other_types_are_refused():
    state, command = start(task.assistant()), Command(ROWS[0])
    with pytest.raises(InvalidInput, match="frames have no items, expected a list of frames"):
        step_assistance(task.assistant(), state, command, 5, FRAMES, 0.1)
    lists = [pf.Frame(f.name, f.A.tolist(), f.b) for f in FRAMES]
    with pytest.raises(InvalidInput, match="an array of frame 'cube' has type list"):
        initial_state(task.assistant(), ROWS[0], lists, FRAMES)


@pytest.mark.parametrize("before", assistance.MODES)
@pytest.mark.parametrize("after", assistance.MODES)
def test_target_at_rest_leaves_at_most_1_mm_at_the_change_and_blends_slowly(before, after):
    """The frames observed are 10 cm off, so that the modes disagree by centimetres.

    Plans move on their own, and authority brings the hand to a distant cart at twice the distance per second;
    `test_transfers.py` compares these with what their modes request.
    """
    assistant, dt = task.assistant(), 0.005
    off = (SCENE[0], pf.geometry.Pose(SCENE[1].position + np.array([0.1, 0.0, 0.0]), SCENE[1].quaternion))
    actual = task.scene_frames(off)
    state = initial_state(assistant, ROWS[0], FRAMES, actual)
    for row in ROWS[:30]:
        command = Command(row, mode="shared" if before == "autonomous" else before)
        state, target = step_assistance(assistant, state, command, FRAMES, actual, task.PERIOD)
    for _ in range(20):
        state, target = step_assistance(
            assistant, state, replace(command, mode=before), FRAMES, actual, task.PERIOD
        )
    rest = target.pose
    command = replace(command, mode=after)
    for n in range(60):
        state, target = step_assistance(assistant, state, command, FRAMES, actual, dt)
        step, turn = np.linalg.norm(target.pose[:3] - rest[:3]), angle(target.pose[3:7], rest[3:7])
        if n == 0:
            at_change = max(1e-3, np.linalg.norm(state.memory.velocity[:3]) * dt)
            assert step <= (1e-3 if before != "autonomous" else at_change)
            assert turn <= np.radians(0.1) or before == "autonomous"
        assert step <= 0.25 * dt * 1.05 or {"autonomous", "fixture"} & {before, after}
        rest = target.pose


def test_hand_that_moved_while_the_clutch_was_open_does_not_move_the_target():
    assistant = task.assistant()
    state, _ = run_rows(assistant, np.tile(ROWS[5], (30, 1)), "direct")
    rest, moved = state.memory.pose, ROWS[5].copy()
    moved[:3] += [0.3, 0.2, -0.1]
    moved[3:7] = multiply(from_rotation_vector(np.array([0.0, 0.5, 0.0])), moved[3:7])
    for clutch in (False, True):
        for _ in range(10):
            command = Command(moved, "direct", clutch)
            state, target = step_assistance(assistant, state, command, FRAMES, FRAMES, 0.1)
    assert np.allclose(target.pose[:3], rest[:3], atol=1e-9)
    assert angle(target.pose[3:7], rest[3:7]) < 1e-6


@pytest.mark.parametrize("lost", ["observed", "actual"])
def test_assistance_fades_when_frames_are_stale_and_returns(lost):
    assistant = task.assistant()
    state, targets = run_rows(assistant, ROWS[:24], "shared")
    assert targets[-1].authority > 0.9
    stale = {"observed": FRAMES, "actual": FRAMES, lost: None}
    state, targets = run_rows(assistant, np.tile(ROWS[23], (8, 1)), "shared", state, **stale)
    authority = [t.authority for t in targets]
    assert authority[-1] == 0.0
    assert np.abs(np.diff(authority)).max() <= 2.0 * task.PERIOD + 1e-9
    assert np.allclose(targets[-1].pose[:3], ROWS[23, :3], atol=1e-3)
    _, targets = run_rows(assistant, np.tile(ROWS[23], (8, 1)), "shared", state)
    assert targets[-1].authority > 0.9


def test_mixture_is_assisted_but_not_continued():
    assistant = task.assistant(dynamics="mixture")
    state, targets = run_rows(assistant, ROWS[:10], "shared")
    assert targets[-1].mode == "shared"
    _, targets = run_rows(assistant, ROWS[10:12], "autonomous", state=state)
    assert targets[-1].mode == "shared"


def test_filter_does_not_depend_on_the_rate_of_the_loop():
    assistant = task.assistant()
    slow, _ = run_rows(assistant, ROWS[:20], "shared")
    fast = start(assistant)
    for row in ROWS[:20]:
        for _ in range(5):
            fast, _ = step_assistance(assistant, fast, Command(row), FRAMES, FRAMES, task.PERIOD / 5)
    p, q = slow.memory.filter.now, fast.memory.filter.now
    assert p.argmax() == q.argmax()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda: assistance.make_assistant([]), "skills is empty"),
        (lambda: initial_state(task.assistant(), ROWS[0], FRAMES[:1], FRAMES), "'tray' is missing"),
        (lambda: initial_state(task.assistant(), ROWS[0, :7], FRAMES, FRAMES), "expected 8 finite numbers"),
        (lambda: initial_state(task.assistant(), 0.0 * ROWS[0], FRAMES, FRAMES), "a unit quaternion"),
        (lambda: initial_state(task.assistant(), ROWS[0], FRAMES, FRAMES, skill=1), "skill is 1"),
        (
            lambda: initial_state(
                task.assistant(), ROWS[0], FRAMES, [replace(f, name=f"other {f.name}") for f in FRAMES]
            ),
            "'cube' is missing",
        ),
        (
            lambda: initial_state(
                task.assistant(), ROWS[0], FRAMES, [replace(FRAMES[0], A=0.0 * FRAMES[0].A), FRAMES[1]]
            ),
            "singular",
        ),
        (
            lambda: step_assistance(
                task.assistant(), start(task.assistant()), Command(ROWS[0]), FRAMES, FRAMES, 0.0
            ),
            "dt is 0",
        ),
        (lambda: Command(ROWS[0], mode="automatic"), "mode is 'automatic'"),
    ],
)
def test_bad_arguments_are_refused_by_name(change, message):
    with pytest.raises(InvalidInput, match=message):
        change()


def test_skills_of_different_columns_are_refused():
    joint = task.learn("joint")
    without_grip = replace(
        joint,
        means=joint.means[:, :, 7:],
        covariances=tuple(
            pf.gaussians.structures.DenseCovariances(c.dense[:, 6:, 6:]) for c in joint.covariances
        ),
        layout=pf.demonstrations.Layout(joint.layout.parts[2:]),
        regularisation=None,
        demonstrated=None,
        endpoints=None,
    )
    with pytest.raises(InvalidInput, match=r"skills\[1\] has the columns"):
        assistance.make_assistant([*task.assistant().skills, assistance.assisted_skill(without_grip)])
