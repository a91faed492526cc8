"""Visual meshes that replace Baxter's simple shapes in images; they have no mass and no contacts."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from pilotfish.environments.baxter.body import UPPER_BODY
from pilotfish.environments.baxter.parameters import JOINT_NAMES
from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Float, Int
from pilotfish.validation import shorten_repr

SIDES = ("left", "right")
TRUNK = "torso"
PARTS = (TRUNK, *JOINT_NAMES)
HIDDEN_GROUP = 3  # geom group that the renderer leaves out


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class VisualMesh:
    """Triangle mesh of one colour on a part of the robot.

    Attributes:
        part: "torso", or the name of the joint that moves the link, for both arms.
        vertices: Vertices in the frame of the part [m].
        faces: Indices of the vertices of each triangle.
        rgba: Colour, 0 to 1.
    """

    part: str
    vertices: Float[Array, "V 3"]
    faces: Int[Array, "F 3"]
    rgba: tuple[float, float, float, float]


def add_visual_meshes(spec: mujoco.MjSpec, visual_meshes: Sequence[VisualMesh]) -> None:
    """Add meshes to a model and hide the shapes below them; masses and contacts stay the same.

    Call it once, after the arms are added and before the model is compiled.

    Args:
        spec: Model that is extended.
        visual_meshes: Meshes on parts of the robot.

    Raises:
        InvalidInput: If a part is unknown, a vertex is not finite, or a face has no such vertex.
    """
    for n, visual in enumerate(visual_meshes):
        _validate_mesh(visual)
        mesh = spec.add_mesh(name=f"visual_{n}")
        mesh.uservert, mesh.userface = visual.vertices.ravel(), visual.faces.ravel()
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL  # simplified meshes may have holes
        for body in _find_bodies(spec, visual.part):
            _hide_shapes(body)
            geom = body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=mesh.name, rgba=visual.rgba)
            geom.contype, geom.conaffinity, geom.mass = 0, 0, 0.0


def _find_bodies(spec: mujoco.MjSpec, part: str) -> Iterator[mujoco.MjsBody]:
    if part == TRUNK:
        yield spec.worldbody
        return
    for side in SIDES:
        if body := spec.body(f"{side}_{part}_link"):
            yield body


def _hide_shapes(body: mujoco.MjsBody) -> None:
    simple = {*UPPER_BODY, f"{body.name.removesuffix('_link')}_cover"}
    for geom in body.geoms:
        if geom.name in simple:
            geom.group = HIDDEN_GROUP


def _validate_mesh(mesh: VisualMesh) -> None:
    if mesh.part not in PARTS:
        raise InvalidInput(f"a visual mesh has the part {mesh.part!r}, expected one of {', '.join(PARTS)}")
    V = len(mesh.vertices)
    if not len(mesh.faces) or mesh.faces.min() < 0 or mesh.faces.max() >= V:
        raise InvalidInput(
            f"the visual mesh of {mesh.part!r} has {len(mesh.faces)} faces, expected one or more with "
            f"indices from 0 to {V - 1}"
        )
    if not np.isfinite(mesh.vertices).all():
        raise InvalidInput(f"the visual mesh of {mesh.part!r} has vertices that are not finite; remove them")
