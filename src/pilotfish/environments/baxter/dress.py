"""Surfaces that Baxter wears over the simple shapes that it is simulated in: to be looked at only."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from pilotfish.environments.baxter.body import UPPER_BODY
from pilotfish.environments.baxter.facts import JOINTS
from pilotfish.errors import InvalidInput
from pilotfish.types import Array, Float, Int

SIDES = ("left", "right")
TRUNK = "torso"
PARTS = (TRUNK, *(joint.name for joint in JOINTS))
HIDDEN_GROUP = 3  # the group of shapes that pictures leave out


@dataclass(frozen=True, slots=True, eq=False)
class VisualMesh:
    """Triangles of one colour on a part, in its axes [m]: "torso", or what a joint turns, in either arm."""

    part: str
    vertices: Float[Array, "V 3"]
    faces: Int[Array, "F 3"]
    rgba: tuple[float, float, float, float]


def add_visual_meshes(spec: mujoco.MjSpec, visual_meshes: Sequence[VisualMesh]) -> None:
    """The robot wears the surfaces, and the shapes under them are not seen; it moves and touches as before.

    To be done before the spec is compiled, once, and after its arms are added.
    Raises: InvalidInput, when a surface is on no part of the robot, or its faces name vertices that it lacks.
    """
    for n, surface in enumerate(visual_meshes):
        _validate_mesh(surface)
        mesh = spec.add_mesh(name=f"surface_{n}")
        mesh.uservert, mesh.userface = surface.vertices.ravel(), surface.faces.ravel()
        mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL  # thinned surfaces may have holes
        for body in _bodies(spec, surface.part):
            _hide(body)
            geom = body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=mesh.name, rgba=surface.rgba)
            geom.contype, geom.conaffinity, geom.mass = 0, 0, 0.0


def _bodies(spec: mujoco.MjSpec, part: str) -> Iterator[mujoco.MjsBody]:
    if part == TRUNK:
        yield spec.worldbody
        return
    for side in SIDES:
        if body := spec.body(f"{side}_{part}_link"):
            yield body


def _hide(body: mujoco.MjsBody) -> None:
    """The plain shapes of a part of the robot are there, but not in pictures."""
    plain = {*UPPER_BODY, f"{body.name.removesuffix('_link')}_cover"}
    for geom in body.geoms:
        if geom.name in plain:
            geom.group = HIDDEN_GROUP


def _validate_mesh(surface: VisualMesh) -> None:
    if surface.part not in PARTS:
        raise InvalidInput(f"a surface is on {surface.part!r}, expected one of {', '.join(PARTS)}")
    V = len(surface.vertices)
    if not len(surface.faces) or surface.faces.min() < 0 or surface.faces.max() >= V:
        raise InvalidInput(f"the faces of a surface on {surface.part!r} are to name some of its {V} vertices")
    if not np.isfinite(surface.vertices).all():
        raise InvalidInput(f"a surface on {surface.part!r} has vertices that are not finite; leave them out")
