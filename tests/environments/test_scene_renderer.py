"""Rendered images show the scene, equal the references, and do not change the physics."""

import mujoco
import numpy as np
import pytest
from drawing import needs_renderer
from reference_images import TOLERANCE, compare_images, initial_workcell, load_reference, render_workcell

from pilotfish.environments import TASKS
from pilotfish.environments.baxter.body import empty_world
from pilotfish.environments.scene_drawings import Ellipsoid, ToolCopy
from pilotfish.environments.scene_renderer import FRONT_RIGHT, CameraView, SceneRenderer
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, quaternion_exp, rotation_matrix

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
    """Return the mean row and column of the true pixels."""
    row, column = np.nonzero(changed)
    return float(row.mean()), float(column.mean())


@pytest.mark.parametrize("task", NAMES)
def test_render_task_equals_reference(task: str):
    difference = compare_images(render_workcell(initial_workcell(task)), load_reference(task))
    assert difference <= TOLERANCE, (
        f"{task}: {difference}; compare both, and write a new reference if the change is intended"
    )


@pytest.mark.parametrize("task", NAMES)
def test_render_moved_arm_differs(task: str):
    for joint in (0, 1, 3):
        cell = initial_workcell(task)
        cell.arm.q[joint] += 0.1
        mujoco.mj_forward(cell.model, cell.data)
        assert not compare_images(render_workcell(cell), load_reference(task)) <= TOLERANCE, (
            f"joint {joint} moved without a visible change"
        )


@pytest.mark.parametrize("task", NAMES)
def test_render_missing_object_differs(task: str):
    cell = initial_workcell(task)
    for body in map(cell.model.body, range(1, cell.model.nbody)):
        shapes = np.flatnonzero(cell.model.geom_bodyid == body.id)
        is_robot = body.name.startswith(("left_", "right_")) and body.name != "right_held"
        if is_robot or not shapes.size:
            continue
        groups = cell.model.geom_group[shapes].copy()
        cell.model.geom_group[shapes] = 5  # which the renderer leaves out
        assert not compare_images(render_workcell(cell), load_reference(task)) <= TOLERANCE, (
            f"{body.name} is hidden without a visible change"
        )
        cell.model.geom_group[shapes] = groups


@pytest.mark.parametrize("task", NAMES)
def test_render_small_differences_are_tolerated(task: str):
    reference = load_reference(task).astype(float)
    shifted = (reference + np.roll(reference, 1, axis=1)) / 2.0
    assert compare_images(np.minimum(shifted + 2.0, 255.0), load_reference(task)) <= TOLERANCE


def test_camera_view_directions_match_robot():
    green = (0.0, 1.0, 0.0, 1.0)
    at = {}
    for name, place in (("middle", (0.5, 0, 0)), ("ahead", (0.8, 0, 0)), ("left", (0.5, 0.3, 0))):
        with SceneRenderer(model := box_at(place, green), ABOVE) as renderer:
            taken = renderer.render(at_rest(model)).astype(int)
        at[name] = middle(taken[..., 1] - taken[..., 0] > 60)
    assert at["ahead"][1] > at["middle"][1] + 50
    assert at["ahead"][0] == pytest.approx(at["middle"][0], abs=3)
    assert at["left"][0] < at["middle"][0] - 50
    assert at["left"][1] == pytest.approx(at["middle"][1], abs=3)


def test_render_has_requested_size():
    model = empty_world(0.001).compile()
    with SceneRenderer(model, FRONT_RIGHT, width=64, height=48) as renderer:
        taken = renderer.render(at_rest(model))
    assert taken.shape == (48, 64, 3)
    assert taken.dtype == np.uint8
    assert taken[0].mean() > 150


@pytest.mark.parametrize(("width", "height"), [(0, 10), (10, 0), (961, 10), (10, 721)])
def test_renderer_invalid_size_is_refused(width: int, height: int):
    with pytest.raises(InvalidInput, match=r"expected 1 x 1 to 960 x 720"):
        SceneRenderer(empty_world(0.001).compile(), width=width, height=height)


def test_render_frames_and_path_are_drawn_in_place():
    model = box_at((0.5, 0.0, -5.0), (1.0, 0.0, 0.0, 1.0))  # below the floor
    pose = Pose(
        np.array([0.5, 0.0, 0.0]), quaternion_exp(np.array([0.0, 0.0, np.pi / 4]))
    )  # x to the left, y back
    with SceneRenderer(model, ABOVE) as renderer:
        plain = renderer.render(at_rest(model)).astype(int)
        marked = renderer.render(at_rest(model), frames={"it": pose}).astype(int)
        ends = np.array([[0.5, 0.0, 0.0], [0.8, 0.0, 0.0]])
        path = renderer.render(at_rest(model), path=ends).astype(int)
    change = marked - plain
    row, column = 240.0, 320.0  # the camera looks at the middle
    up, aside = middle(change[..., 1] - change[..., 0] < -40)  # red
    assert (up, aside) == (pytest.approx(row - 7, abs=6), pytest.approx(column, abs=4))
    across = middle(change[..., 1] - change[..., 0] > 40)  # green
    assert across == (pytest.approx(row, abs=4), pytest.approx(column - 7, abs=6))
    _, columns = np.nonzero(np.abs(path - plain).max(axis=2) > 40)
    assert columns.min() == pytest.approx(column, abs=4)
    assert columns.max() > column + 50


def test_render_overlay_is_drawn_once(rng: np.random.Generator):
    model = empty_world(0.001).compile()
    path = rng.normal(size=(20_000, 3))
    frames = {str(n): Pose(rng.normal(size=3), np.array([1.0, 0.0, 0.0, 0.0])) for n in range(50)}
    with SceneRenderer(model) as renderer:
        before = renderer.render(at_rest(model))
        marked = renderer.render(at_rest(model), frames=frames, path=path)
        after = renderer.render(at_rest(model))
    np.testing.assert_array_equal(before, after)
    assert (before != marked).any()


@pytest.mark.parametrize("points", [0, 1])
def test_render_path_of_one_point_is_not_drawn(points: int):
    model = empty_world(0.001).compile()
    with SceneRenderer(model) as renderer:
        plain = renderer.render(at_rest(model))
        marked = renderer.render(at_rest(model), path=np.zeros((points, 3)))
    np.testing.assert_array_equal(plain, marked)


def test_render_does_not_change_physics():
    cells = [initial_workcell("valve") for _ in range(2)]
    with SceneRenderer(cells[0].model) as renderer:
        for _ in range(5):
            for cell in cells:
                target = Pose(cell.target.position + 0.01, cell.target.quaternion)
                cell.step_impedance(target, 1.0, 20)
            renderer.render(cells[0].data, frames=cells[0].frames())
    np.testing.assert_array_equal(cells[0].data.qpos, cells[1].data.qpos)
    np.testing.assert_array_equal(cells[0].data.qvel, cells[1].data.qvel)


def test_close_twice_is_allowed():
    with SceneRenderer(empty_world(0.001).compile(), width=8, height=8) as renderer:
        renderer.close()
        renderer.close()


def test_task_views_are_distinct():
    assert len({TASKS[name].view for name in NAMES}) == len(NAMES)


def test_render_ellipsoid_has_size_and_direction_of_covariance():
    """The pixels that change have the spread of a filled ellipse: a quarter of its squared radii."""
    model = empty_world(0.001).compile()
    data, turn = at_rest(model), quaternion_exp(np.array([0.0, 0.0, 0.3]))
    axes = rotation_matrix(turn)
    covariance = axes @ np.diag([0.1, 0.03, 0.05]) ** 2 @ axes.T
    centre = np.array(ABOVE.look_at)
    with SceneRenderer(model, ABOVE) as renderer:
        bare = renderer.render(data).astype(int)
        image = renderer.render(data, ellipsoids=[Ellipsoid(centre, covariance, 2.0)]).astype(int)
    rows, columns = np.nonzero(np.abs(image - bare).sum(axis=2) > 10)
    spread = np.cov(np.stack([columns, -rows]))
    values = np.sqrt(np.linalg.eigvalsh(spread))
    assert values[1] / values[0] == pytest.approx(0.1 / 0.03, rel=0.1)
    expected = covariance[:2, :2]  # x is to the right, y upwards
    cosine = (expected.ravel() @ spread.ravel()) / np.linalg.norm(expected) / np.linalg.norm(spread)
    assert cosine == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("task", ["carabiner", "stab"])
def test_render_tool_copy_is_drawn_where_it_is_posed(task: str):
    """From one copy to another, which is 10 cm higher, the image moves as that of axes does."""
    cell = initial_workcell(task)
    point, tool, places = cell.mounted_tool.point, cell.arm.tool, []
    for offset in ((0.12, -0.15, 0.0), (0.12, -0.15, 0.1)):
        pose = Pose(tool.position + np.array(offset), tool.quaternion)
        with SceneRenderer(cell.model, cell.task.view) as renderer:
            bare = renderer.render(cell.data).astype(int)
            copied = renderer.render(cell.data, tool_copies=[ToolCopy(point, pose)]).astype(int)
            marked = renderer.render(cell.data, frames={"copy": pose}).astype(int)
        copy, axes = (np.abs(image - bare).sum(axis=2) > 20 for image in (copied, marked))
        assert copy.sum() > 300
        places.append((middle(copy), middle(axes)))
    moved = np.diff(np.array(places), axis=0)[0]
    assert np.linalg.norm(moved[1]) > 20.0
    np.testing.assert_allclose(moved[0], moved[1], atol=0.2 * np.linalg.norm(moved[1]))
