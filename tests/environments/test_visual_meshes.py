"""Visual meshes are visible and change neither masses, contacts nor motion."""

import mujoco
import numpy as np
import pytest
from drawing import needs_renderer

from pilotfish.environments import TASKS
from pilotfish.environments.baxter.body import OBJECT, ROBOT, add_arm, empty_world
from pilotfish.environments.baxter.visual_meshes import PARTS, VisualMesh, add_visual_meshes
from pilotfish.environments.scene_renderer import CameraView, SceneRenderer
from pilotfish.errors import InvalidInput

pytestmark = pytest.mark.usefixtures("unchecked")

GREEN = (0.0, 1.0, 0.0, 1.0)
CORNERS = np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.0, 0.3, 0.0], [0.0, 0.0, 0.3]])
SIDES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
WHOLE = CameraView((0.3, 0.0, 0.0), 3.0, 140.0, -15.0)


def tetrahedron(part: str, rgba: tuple[float, float, float, float] = GREEN) -> VisualMesh:
    return VisualMesh(part, CORNERS, SIDES, rgba)


def compile_scene(visual_meshes: list[VisualMesh]) -> mujoco.MjModel:
    """Return a model of the robot with a gripper, a valve within reach, and falling spheres."""
    spec, task = empty_world(0.001), TASKS["valve"]
    task.mount_tool(spec, add_arm(spec, "right"), "right")
    add_arm(spec, "left", posture=(-0.6, -0.9, -0.9, 2.1, 0.6, 0.6, 0.0))
    task.add_objects(spec, task.sample_situation(np.random.default_rng(0)))
    for n in range(60):
        place = [0.25 + 0.1 * (n % 6), -0.8 + 0.1 * (n // 6), 0.6 + 0.05 * (n % 4)]
        ball = spec.worldbody.add_body(name=f"ball_{n}", pos=place)
        ball.add_freejoint()
        shape = ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.03, 0, 0], mass=0.1)
        shape.contype, shape.conaffinity = OBJECT, ROBOT | OBJECT
    add_visual_meshes(spec, visual_meshes)
    return spec.compile()


def test_add_visual_meshes_physics_is_unchanged(rng: np.random.Generator):
    plain, meshed = compile_scene([]), compile_scene([tetrahedron(part) for part in PARTS])
    assert meshed.ngeom == plain.ngeom + 1 + 7 * 2
    torques, met = rng.normal(scale=20.0, size=(600, plain.nu)), 0
    runs = [mujoco.MjData(model) for model in (plain, meshed)]
    for torque in torques:
        for model, data in zip((plain, meshed), runs, strict=True):
            data.ctrl[:] = torque
            mujoco.mj_step(model, data)
        one, other = runs
        np.testing.assert_array_equal(one.qpos, other.qpos)
        np.testing.assert_array_equal(one.qvel, other.qvel)
        assert one.ncon == other.ncon
        met += one.ncon
    assert met > 0, "no contact occurred, so that the test shows nothing"


def test_add_visual_meshes_have_no_mass_and_contacts():
    plain, meshed = compile_scene([]), compile_scene([tetrahedron(part) for part in PARTS])
    np.testing.assert_array_equal(plain.body_mass, meshed.body_mass)
    np.testing.assert_array_equal(plain.body_inertia, meshed.body_inertia)
    visual_meshes = meshed.geom_type == mujoco.mjtGeom.mjGEOM_MESH
    assert visual_meshes.sum() == 15
    assert not meshed.geom_contype[visual_meshes].any()
    assert not meshed.geom_conaffinity[visual_meshes].any()


@needs_renderer
@pytest.mark.parametrize("part", PARTS)
def test_add_visual_meshes_replace_shapes_in_images(part: str):
    pictures = []
    for visual_meshes in (
        [],
        [tetrahedron(part)],
        [tetrahedron(part, (0.0, 1.0, 0.0, 0.0))],
    ):  # the last one is transparent
        model = compile_scene(visual_meshes)
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        with SceneRenderer(model, WHOLE, width=320, height=240) as renderer:
            pictures.append(renderer.render(data).astype(int))
    green = [int((taken[..., 1] - taken[..., 0] > 60).sum()) for taken in pictures]
    assert green[0] == green[2] == 0
    assert green[1] > 50
    assert (np.abs(pictures[0] - pictures[2]).max(axis=2) > 20).any(), (
        "the shapes below the mesh are still visible"
    )


def test_add_visual_meshes_vertices_are_in_part_axes():
    model = compile_scene([tetrahedron("w0")])
    data = mujoco.MjData(model)
    data.qpos[:7] = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7)
    mujoco.mj_forward(model, data)
    for side in ("left", "right"):
        body = model.body(f"{side}_w0_link").id
        geom = next(
            g for g in range(model.ngeom) if model.geom_bodyid[g] == body and model.geom_dataid[g] >= 0
        )
        corners = model.mesh_vert @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
        expected = CORNERS @ data.xmat[body].reshape(3, 3).T + data.xpos[body]
        found = corners[np.lexsort(corners.T.round(6))]
        np.testing.assert_allclose(
            found, expected[np.lexsort(expected.T.round(6))], atol=1e-6
        )  # single precision


def test_add_visual_meshes_single_arm_is_accepted():
    spec = empty_world(0.001)
    add_arm(spec, "right")
    add_visual_meshes(spec, [tetrahedron("s0")])
    assert spec.compile().nmesh == 1


@pytest.mark.parametrize(
    ("mesh", "words"),
    [
        (VisualMesh("elbow", CORNERS, SIDES, GREEN), "'elbow', expected one of torso, s0"),
        (VisualMesh("s0", CORNERS, SIDES[:0], GREEN), "expected one or more with indices from 0 to 3"),
        (VisualMesh("s0", CORNERS, SIDES + 1, GREEN), "expected one or more with indices from 0 to 3"),
        (VisualMesh("s0", CORNERS, SIDES - 1, GREEN), "expected one or more with indices from 0 to 3"),
        (VisualMesh("s0", CORNERS * np.nan, SIDES, GREEN), "not finite"),
    ],
)
def test_add_visual_meshes_invalid_mesh_is_refused(mesh: VisualMesh, words: str):
    with pytest.raises(InvalidInput, match=words):
        add_visual_meshes(empty_world(0.001), [mesh])
