"""Pictures show what stands where, look as they did, and change nothing of the physics."""

import mujoco
import numpy as np
import pytest
from drawing import needs_renderer
from reference_images import TOLERANCE, image_difference, initial_workcell, load_reference, render_workcell

from pilotfish.environments import TASKS
from pilotfish.environments.baxter import empty_world
from pilotfish.environments.cameras import FRONT_RIGHT, CameraView, Overlay, SceneRenderer, camera_view
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, quaternion_exp

pytestmark = needs_renderer
NAMES = sorted(TASKS)
ABOVE = CameraView((0.5, 0.0, 0.0), 3.0, 90.0, -89.0)  # ahead of the robot is to the right
SHAPES = mujoco.mjtGeom


def box_at(place: tuple[float, float, float], rgba: tuple[float, float, float, float]) -> mujoco.MjModel:
    spec = empty_world(0.001)
    spec.worldbody.add_geom(type=SHAPES.mjGEOM_BOX, size=[0.05] * 3, pos=place, rgba=rgba)
    return spec.compile()


def at_rest(model: mujoco.MjModel) -> mujoco.MjData:
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return data


def middle(changed: np.ndarray) -> tuple[float, float]:
    """Row and column in the middle of what is true."""
    row, column = np.nonzero(changed)
    return float(row.mean()), float(column.mean())


@pytest.mark.parametrize("task", NAMES)
def test_a_task_looks_as_it_did(task: str):
    """The beginning of each task is the picture that was kept of it, as far as another Mesa draws it."""
    apart = image_difference(render_workcell(initial_workcell(task)), load_reference(task))
    assert apart <= TOLERANCE, f"{task}: {apart}; look at both, and make it anew if it is meant to look so"


@pytest.mark.parametrize("task", NAMES)
def test_an_arm_that_is_elsewhere_is_seen(task: str):
    """A shoulder or an elbow that is turned by 6 degrees is more than the tolerance."""
    for joint in (0, 1, 3):
        cell = initial_workcell(task)
        cell.arm.q[joint] += 0.1
        mujoco.mj_forward(cell.model, cell.data)
        assert not image_difference(render_workcell(cell), load_reference(task)) <= TOLERANCE, (
            f"joint {joint} moved and nobody saw it"
        )


@pytest.mark.parametrize("task", NAMES)
def test_a_thing_that_is_missing_is_seen(task: str):
    """Each body that the task brings, and what the hand holds, is more than the tolerance when it is gone."""
    cell = initial_workcell(task)
    for body in map(cell.model.body, range(1, cell.model.nbody)):
        shapes = np.flatnonzero(cell.model.geom_bodyid == body.id)
        of_the_robot = body.name.startswith(("left_", "right_")) and body.name != "right_held"
        if of_the_robot or not shapes.size:
            continue
        groups = cell.model.geom_group[shapes].copy()
        cell.model.geom_group[shapes] = 5  # which pictures leave out
        assert not image_difference(render_workcell(cell), load_reference(task)) <= TOLERANCE, (
            f"{body.name} is gone and nobody saw it"
        )
        cell.model.geom_group[shapes] = groups


@pytest.mark.parametrize("task", NAMES)
def test_another_mesa_would_pass(task: str):
    """Edges that lie half a pixel aside, and colours two steps brighter, are within the tolerance."""
    seen = load_reference(task).astype(float)
    aside = (seen + np.roll(seen, 1, axis=1)) / 2.0
    assert image_difference(np.minimum(aside + 2.0, 255.0), load_reference(task)) <= TOLERANCE


def test_directions_are_those_of_the_robot():
    """Seen from above with azimuth 90, what is ahead of the robot is to the right, and its left is up."""
    green = (0.0, 1.0, 0.0, 1.0)
    at = {}
    for name, place in (("here", (0.5, 0, 0)), ("ahead", (0.8, 0, 0)), ("left", (0.5, 0.3, 0))):
        with SceneRenderer(model := box_at(place, green), ABOVE) as renderer:
            taken = renderer.render(at_rest(model)).astype(int)
        at[name] = middle(taken[..., 1] - taken[..., 0] > 60)
    assert at["ahead"][1] > at["here"][1] + 50
    assert at["ahead"][0] == pytest.approx(at["here"][0], abs=3)
    assert at["left"][0] < at["here"][0] - 50
    assert at["left"][1] == pytest.approx(at["here"][1], abs=3)


def test_pictures_have_the_size_asked_for():
    """Rows, columns, three colours; the background is not black."""
    model = empty_world(0.001).compile()
    with SceneRenderer(model, FRONT_RIGHT, width=64, height=48) as renderer:
        taken = renderer.render(at_rest(model))
    assert taken.shape == (48, 64, 3)
    assert taken.dtype == np.uint8
    assert taken[0].mean() > 150


@pytest.mark.parametrize(("width", "height"), [(0, 10), (10, 0), (961, 10), (10, 721)])
def test_pictures_of_another_size_are_refused(width: int, height: int):
    """The refusal tells which sizes there are."""
    with pytest.raises(InvalidInput, match=r"expected from 1 x 1 to 960 x 720"):
        SceneRenderer(empty_world(0.001).compile(), width=width, height=height)


def test_marks_stand_where_they_are_told():
    """The axes of a frame start where it stands, red along x, green along y; a path goes from end to end."""
    model = box_at((0.5, 0.0, -5.0), (1.0, 0.0, 0.0, 1.0))  # below the floor
    pose = Pose(
        np.array([0.5, 0.0, 0.0]), quaternion_exp(np.array([0.0, 0.0, np.pi / 4]))
    )  # x to the left, y back
    with SceneRenderer(model, ABOVE) as renderer:
        plain = renderer.render(at_rest(model)).astype(int)
        marked = renderer.render(at_rest(model), Overlay({"it": pose})).astype(int)
        ends = np.array([[0.5, 0.0, 0.0], [0.8, 0.0, 0.0]])
        path = renderer.render(at_rest(model), Overlay(path=ends)).astype(int)
    change = marked - plain
    row, column = 240.0, 320.0  # what is looked at is in the middle
    up, aside = middle(change[..., 1] - change[..., 0] < -40)  # red
    assert (up, aside) == (pytest.approx(row - 7, abs=6), pytest.approx(column, abs=4))
    across = middle(change[..., 1] - change[..., 0] > 40)  # green
    assert across == (pytest.approx(row, abs=4), pytest.approx(column - 7, abs=6))
    _, columns = np.nonzero(np.abs(path - plain).max(axis=2) > 40)
    assert columns.min() == pytest.approx(column, abs=4)
    assert columns.max() > column + 50


def test_marks_are_drawn_once(rng: np.random.Generator):
    """A picture without marks after one with them is what it was before; long paths and many frames fit."""
    model = empty_world(0.001).compile()
    path = rng.normal(size=(20_000, 3))
    frames = {str(n): Pose(rng.normal(size=3), np.array([1.0, 0.0, 0.0, 0.0])) for n in range(50)}
    with SceneRenderer(model) as renderer:
        before = renderer.render(at_rest(model))
        marked = renderer.render(at_rest(model), Overlay(frames, path))
        after = renderer.render(at_rest(model))
    np.testing.assert_array_equal(before, after)
    assert (before != marked).any()


@pytest.mark.parametrize("points", [0, 1])
def test_a_path_without_a_way_is_nothing(points: int):
    """A path of no or one point leaves the picture as it is."""
    model = empty_world(0.001).compile()
    with SceneRenderer(model) as renderer:
        plain = renderer.render(at_rest(model))
        marked = renderer.render(at_rest(model), Overlay(path=np.zeros((points, 3))))
    np.testing.assert_array_equal(plain, marked)


def test_pictures_change_nothing():
    """A workcell that is photographed at each step moves bit for bit as one that nobody looks at."""
    cells = [initial_workcell("valve") for _ in range(2)]
    with SceneRenderer(cells[0].model) as renderer:
        for _ in range(5):
            for cell in cells:
                target = Pose(cell.target.position + 0.01, cell.target.quaternion)
                cell.step_impedance(target, 1.0, 20)
            renderer.render(cells[0].data, Overlay(cells[0].frames()))
    np.testing.assert_array_equal(cells[0].data.qpos, cells[1].data.qpos)
    np.testing.assert_array_equal(cells[0].data.qvel, cells[1].data.qvel)


def test_what_was_closed_may_be_closed_again():
    """Closing twice, and leaving after closing, are no mistakes."""
    with SceneRenderer(empty_world(0.001).compile(), width=8, height=8) as renderer:
        renderer.close()
        renderer.close()


def test_a_task_that_has_no_view_is_seen_as_a_whole():
    """Any name has a view; those of the tasks are their own."""
    assert camera_view("something else") == FRONT_RIGHT
    assert len({camera_view(name) for name in NAMES}) == len(NAMES)
