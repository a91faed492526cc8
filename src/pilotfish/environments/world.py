"""World of the simulation without a robot: floor, light and sky, and the contact types."""

import mujoco

from pilotfish.types import Array, Float

Triple = tuple[float, float, float]
PALE = (0.62, 0.64, 0.66, 1.0)
ROBOT, OBJECT = 1, 2  # contact types: the robot collides with objects, objects with each other too
FLOOR = -0.93  # m, height in torso axes
SKY = (0.9, 0.92, 0.94, 1.0), (0.62, 0.71, 0.8, 1.0)  # at the horizon and above


def empty_scene(name: str, timestep: float) -> mujoco.MjSpec:
    """Return a model of floor and light without a robot; the world axes are the torso axes.

    Args:
        name: Name of the model.
        timestep: Timestep of the physics [s].
    """
    spec = mujoco.MjSpec()
    spec.modelname, spec.compiler.degree = name, False
    spec.option.timestep = timestep
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.impratio = 10.0  # less slip of gripped objects
    _add_light(spec)
    add_fixed_geom(
        spec.worldbody, "floor", mujoco.mjtGeom.mjGEOM_PLANE, (0.0, 0.0, 0.1), (0.0, 0.0, FLOOR), PALE
    )
    spec.geom("floor").material = "dull"
    return spec


def add_fixed_geom(
    body: mujoco.MjsBody, name: str, kind: mujoco.mjtGeom, size: Triple, pos: Triple, rgba: tuple[float, ...]
) -> None:
    """Add a geom without contacts to a body; only the floor collides with robot and objects."""
    geom = body.add_geom(name=name, type=kind, size=size, pos=pos, rgba=rgba)
    geom.contype, geom.conaffinity = (OBJECT, ROBOT | OBJECT) if name == "floor" else (0, 0)


def add_cover(
    body: mujoco.MjsBody, name: str, ends: tuple[Triple, Triple], radius: float, rgba: tuple[float, ...]
) -> None:
    """Add a capsule without mass, which collides with objects, along a link."""
    geom = body.add_geom(
        name=name, type=mujoco.mjtGeom.mjGEOM_CAPSULE, fromto=[*ends[0], *ends[1]], rgba=rgba
    )
    geom.size[0] = radius
    geom.contype, geom.conaffinity, geom.mass = ROBOT, OBJECT, 0.0


def set_inertial(
    body: mujoco.MjsBody,
    mass: float,
    centre: Triple | Float[Array, " 3"],
    inertia: tuple[float, ...] | Float[Array, " 6"],
) -> None:
    """Set mass [kg], centre of mass [m], and inertia xx, yy, zz, xy, xz, yz about it [kg m^2]."""
    body.mass, body.ipos, body.fullinertia = mass, centre, inertia
    body.explicitinertial = True


def _add_light(spec: mujoco.MjSpec) -> None:
    """Add bright light and a pale sky, without shadows, so that images render fast."""
    spec.visual.quality.offsamples = 0
    spec.visual.map.znear, spec.visual.map.fogstart, spec.visual.map.fogend = 0.01, 3.0, 8.0
    spec.visual.rgba.fog = spec.visual.rgba.haze = SKY[0]
    spec.visual.headlight.ambient, spec.visual.headlight.diffuse = [0.35] * 3, [0.35] * 3
    spec.visual.headlight.specular = [0.1] * 3
    size = getattr(spec.visual, "global")
    size.offwidth, size.offheight = 960, 720  # largest image
    for aim, strength in (((-0.5, 0.4, -1.0), 0.4), ((0.3, 0.8, -0.6), 0.25)):
        lamp = spec.worldbody.add_light(
            dir=aim, diffuse=[strength] * 3, specular=[0.15] * 3, castshadow=False
        )
        lamp.type = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
    gradient = mujoco.mjtBuiltin.mjBUILTIN_GRADIENT
    sky = spec.add_texture(name="sky", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, builtin=gradient)
    sky.rgb1, sky.rgb2, sky.width, sky.height = SKY[1][:3], SKY[0][:3], 32, 192
    spec.add_material(name="dull", specular=0.0, shininess=0.0)
