"""A robot from a description in URDF or MJCF: MuJoCo reads the text, and the serial chain is taken from it.

The chain runs from the world of the description to the end effector. Links without joints of their own belong
to the link that carries them. What lies beyond the end effector is left out, and so are other branches if the
end effector is named. The arm is then rebuilt from numbers, so that nothing else of the file is simulated.
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import mujoco
import numpy as np

from pilotfish.control import SerialChain, arm_limits
from pilotfish.environments.robots.description_xml import (
    ReadIncluded,
    continuous_joints,
    joint_limits_of_urdf,
    mimicking_joints,
    parse_description,
)
from pilotfish.environments.robots.placement import base_before_tasks, comfortable_posture
from pilotfish.environments.robots.robot import IDENTITY, Robot
from pilotfish.environments.robots.serial_arm import Capsule, SerialArm, serial_arm_robot
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, from_rotation_vector, multiply, rotation_matrix
from pilotfish.kernels import ArmLimits
from pilotfish.types import Array, Float
from pilotfish.validation import MAX_NAME_LENGTH, require_type, short_list, short_repr

MAX_JOINTS = 16
MAX_LENGTH, MAX_MASS, MAX_INERTIA = 100.0, 1e4, 1e4  # m, kg, kg m^2
FULL_TURN = 2.0 * np.pi  # rad, limit of a joint that turns without end
DEFAULT_VELOCITY = 0.5 * np.pi  # rad/s, where the file has no velocity limits: MJCF has none
DEFAULT_ROTOR = 0.05  # kg m^2, where the file has no armature
COVER_RADIUS, MIN_COVER = 0.045, 0.02  # m


@dataclass(frozen=True, slots=True, eq=False)
class _Description:
    """Compiled description, its XML and its name for messages."""

    model: mujoco.MjModel
    root: Element
    name: str


def robot_from_description(
    data: bytes,
    *,
    name: str = "the description",
    end_effector: str | None = None,
    base: Pose | None = None,
    read_included: ReadIncluded | None = None,
) -> Robot:
    """Return the robot that a text in URDF or MJCF describes: a serial arm of hinge joints.

    Args:
        data: Text of the description in UTF-8.
        name: Name of the file, for messages.
        end_effector: Link, body or site on which tools are mounted, pointing along its z axis; None for the
            only end of the chain.
        base: Pose of the description's world in torso axes; None for a place before the objects of the tasks.
        read_included: Function that reads files that the text includes; None to refuse them.

    Raises:
        InvalidInput: If the text is damaged, describes no serial arm, or lacks limits or masses.
    """
    require_type(data, "data", bytes, "read the file with Path(...).read_bytes()")
    require_type(name, "name", str, "give the name of the file")
    if end_effector is not None:
        require_type(end_effector, "end_effector", str, "give the name of a link, body or site")
    if base is not None:
        require_type(base, "base", Pose, "geometry.pose(position, quaternion) creates one")
    root = parse_description(data, name, read_included)
    described = _Description(_compile(root, name), root, name)
    last, last_from_hand = _find_end(described, end_effector)
    bodies = _joint_bodies(described, last)
    return serial_arm_robot(_serial_arm(described, bodies, (last, last_from_hand), base))


def _compile(root: Element, name: str) -> mujoco.MjModel:
    """Return the model of links and joints; links that are fixed to others stay links."""
    if root.tag == "robot":
        extension = ElementTree.SubElement(root, "mujoco")
        ElementTree.SubElement(extension, "compiler", fusestatic="false", discardvisual="true")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of MuJoCo: what matters here is checked below
            model = mujoco.MjSpec.from_string(ElementTree.tostring(root, encoding="unicode")).compile()
    except (ValueError, TypeError, RuntimeError) as error:
        reason = " ".join(str(error).split())
        fix = "correct the file"
        if "mjMINVAL" in reason:
            fix = "give each moving link <inertial> with mass and inertia; meshes are not read"
        raise InvalidInput(f"MuJoCo cannot compile {name}: {reason[:MAX_NAME_LENGTH]}; {fix}") from error
    _require_plausible(model, name)
    return model


def _require_plausible(model: mujoco.MjModel, name: str) -> None:
    """Raise InvalidInput if a length, mass or inertia is not finite or far too large for an arm."""
    for what, unit, numbers, limit in (
        ("position", "m", np.concatenate([model.body_pos, model.body_ipos]), MAX_LENGTH),
        ("joint position", "m", model.jnt_pos, MAX_LENGTH),
        ("mass", "kg", model.body_mass, MAX_MASS),
        ("inertia", "kg m^2", model.body_inertia, MAX_INERTIA),
        ("armature", "kg m^2", model.dof_armature, MAX_INERTIA),
    ):
        if not (abs(numbers) <= limit).all():
            raise InvalidInput(
                f"{name} has a {what} that is not finite or above {limit:g} {unit}; use SI units"
            )


def _find_end(described: _Description, end_effector: str | None) -> tuple[int, Pose]:
    """Return the body of the end effector, and the pose of the hand in it."""
    model, name = described.model, described.name
    if end_effector is not None:
        if (body := mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, end_effector)) > 0:
            return body, Pose(np.zeros(3), IDENTITY)
        if (site := mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, end_effector)) >= 0:
            return int(model.site_bodyid[site]), Pose(
                model.site_pos[site].copy(), model.site_quat[site].copy()
            )
        raise InvalidInput(
            f"{name} has no link, body or site {short_repr(end_effector)}, expected one of "
            f"{short_list(_body_names(model, range(1, model.nbody)))}"
        )
    if not model.njnt:
        raise InvalidInput(f"{name} has no hinge joint, expected an arm of 1 to {MAX_JOINTS}")
    parents = set(model.body_parentid[1:].tolist())
    ends = [b for b in range(1, model.nbody) if b not in parents and _moves(model, b)]
    if len(ends) > 1:
        raise InvalidInput(
            f"{name} has several ends: {short_list(_body_names(model, ends))}; name the end effector "
            "(--end-effector, or end_effector=)"
        )
    return ends[0], Pose(np.zeros(3), IDENTITY)


def _moves(model: mujoco.MjModel, body: int) -> bool:
    return bool(model.body_weldid[body])


def _body_names(model: mujoco.MjModel, bodies: Sequence[int]) -> list[str]:
    return [model.body(body).name or f"body {body}" for body in bodies]


def _joint_bodies(described: _Description, last: int) -> list[int]:
    """Return the bodies with a joint from the world to the end effector, after checks of these joints."""
    model, name = described.model, described.name
    bodies, body = [], last
    while body:
        if model.body_jntnum[body]:
            bodies.append(body)
        body = int(model.body_parentid[body])
    bodies.reverse()
    if not 1 <= len(bodies) <= MAX_JOINTS:
        raise InvalidInput(
            f"{name} has {len(bodies)} joints up to {_body_names(model, [last])[0]}, expected 1 to "
            f"{MAX_JOINTS}"
        )
    mimicking = mimicking_joints(described.root)
    for body in bodies:
        joint = int(model.body_jntadr[body])
        label = f"{name}: joint {short_repr(model.joint(joint).name)}"
        if model.body_jntnum[body] > 1:
            raise InvalidInput(f"{label} shares its body with another; give each joint a body of its own")
        if model.jnt_type[joint] != mujoco.mjtJoint.mjJNT_HINGE:
            kind = mujoco.mjtJoint(model.jnt_type[joint]).name.removeprefix("mjJNT_").lower()
            kind = "slide (prismatic)" if kind == "slide" else kind
            raise InvalidInput(
                f"{label} is of type {kind}, expected hinges only; name an end effector before it, or make "
                "the joint fixed"
            )
        if model.joint(joint).name in mimicking:
            raise InvalidInput(f"{label} mimics another joint, expected independent joints; remove <mimic>")
    return bodies


def _serial_arm(
    described: _Description, bodies: list[int], end: tuple[int, Pose], base: Pose | None
) -> SerialArm:
    model = described.model
    joints = [int(model.body_jntadr[body]) for body in bodies]
    names = [model.joint(joint).name or f"joint{n + 1}" for n, joint in enumerate(joints)]
    limits = _limits(described, joints, names)
    origin = Pose(np.zeros(3), IDENTITY)
    chain = _chain(model, bodies, end, origin)
    chain = _chain(model, bodies, end, base or base_before_tasks(chain))
    links = [_link_inertia(model, body, end[0]) for body in bodies]
    anchors = [model.jnt_pos[joint] for joint in joints]
    rotors = model.dof_armature[[int(model.jnt_dofadr[joint]) for joint in joints]]
    return SerialArm(
        name=model_name(described.root, described.name),
        joint_names=tuple(names),
        chain=chain,
        limits=limits,
        posture=comfortable_posture(chain, limits, described.name),
        masses=np.array([mass for mass, _, _ in links]),
        centres=np.stack([centre - anchor for (_, centre, _), anchor in zip(links, anchors, strict=True)]),
        inertias=np.stack([inertia for _, _, inertia in links]),
        rotors=np.where(rotors > 0.0, rotors, DEFAULT_ROTOR),
        covers=_covers(chain),
    )


def model_name(root: Element, name: str) -> str:
    """Return the name that a description gives its robot, or the name of the file without its folder."""
    given = root.get("name") or root.get("model") or name.replace("\\", "/").rpartition("/")[2]
    return "".join(c if c.isprintable() else " " for c in given)[:MAX_NAME_LENGTH].strip() or "robot"


def _chain(model: mujoco.MjModel, bodies: list[int], end: tuple[int, Pose], base: Pose) -> SerialChain:
    """Return the chain; the frame of a joint is its body's frame, moved to the joint's anchor, at q = 0."""
    positions, quaternions, axes = [], [], []
    before, before_anchor = 0, np.zeros(3)
    for body in bodies:
        joint = int(model.body_jntadr[body])
        axis, anchor = model.jnt_axis[joint].copy(), model.jnt_pos[joint].copy()
        pose = _relative_pose(model, before, body)
        reference = float(model.qpos0[model.jnt_qposadr[joint]])
        positions.append(pose.position + rotation_matrix(pose.quaternion) @ anchor - before_anchor)
        quaternions.append(multiply(pose.quaternion, from_rotation_vector(-reference * axis)))
        axes.append(axis)
        before, before_anchor = body, anchor
    hand = _relative_pose(model, before, end[0]) @ end[1]
    hand = Pose(hand.position - before_anchor, hand.quaternion)
    return SerialChain(base, np.stack(positions), np.stack(quaternions), np.stack(axes), hand)


def _relative_pose(model: mujoco.MjModel, ancestor: int, body: int) -> Pose:
    """Return the pose of a body in an ancestor, over fixed bodies in between."""
    pose = Pose(np.zeros(3), IDENTITY)
    while body != ancestor:
        pose = Pose(model.body_pos[body].copy(), model.body_quat[body].copy()) @ pose
        body = int(model.body_parentid[body])
    return pose


def _link_inertia(
    model: mujoco.MjModel, body: int, end: int
) -> tuple[float, Float[Array, " 3"], Float[Array, " 6"]]:
    """Return mass, centre of mass, and inertia about it, of a body and what is fixed to it, up to the end."""
    parts = []
    for b in range(body, model.nbody):
        if model.body_weldid[b] == body and not _is_beyond(model, b, end):
            pose = _relative_pose(model, body, b) @ Pose(
                model.body_ipos[b].copy(), model.body_iquat[b].copy()
            )
            R = rotation_matrix(pose.quaternion)
            parts.append((float(model.body_mass[b]), pose.position, R @ np.diag(model.body_inertia[b]) @ R.T))
    mass = sum(m for m, _, _ in parts)
    centre = sum((m * p for m, p, _ in parts), np.zeros(3)) / mass
    inertia = np.zeros((3, 3))
    for m, p, part in parts:
        r = p - centre
        inertia += part + m * (r @ r * np.eye(3) - np.outer(r, r))
    i, j = [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]
    return mass, centre, inertia[i, j]


def _is_beyond(model: mujoco.MjModel, body: int, end: int) -> bool:
    """Return whether a body hangs on the end effector."""
    while body:
        body = int(model.body_parentid[body])
        if body == end:
            return True
    return False


def _limits(described: _Description, joints: list[int], names: list[str]) -> ArmLimits:
    model, name = described.model, described.name
    from_urdf = joint_limits_of_urdf(described.root, name)
    endless = continuous_joints(described.root)
    rows = []
    for joint, label in zip(joints, names, strict=True):
        lower, upper = model.jnt_range[joint] if model.jnt_limited[joint] else (-FULL_TURN, FULL_TURN)
        if not model.jnt_limited[joint] and label not in endless:
            raise InvalidInput(
                f"{name}: joint {short_repr(label)} has no range; give it lower and upper limits"
            )
        torque, velocity = from_urdf.get(label, (_mjcf_torque(model, joint), DEFAULT_VELOCITY))
        if described.root.tag == "robot" and label not in from_urdf:
            raise InvalidInput(
                f"{name}: joint {short_repr(label)} has no <limit effort=... velocity=...>; add both"
            )
        if not torque > 0.0 or not velocity > 0.0:
            raise InvalidInput(
                f"{name}: joint {short_repr(label)} has torque limit {torque:g} N m and velocity limit "
                f"{velocity:g} rad/s, expected positive ones (URDF: effort and velocity of <limit>; MJCF: "
                "actuatorfrcrange of the joint, or forcerange of its actuator)"
            )
        rows.append((lower, upper, velocity, torque))
    return arm_limits(*np.array(rows).T)


def _mjcf_torque(model: mujoco.MjModel, joint: int) -> float:
    """Return the torque limit of a joint or its actuator; 0 without one."""
    if model.jnt_actfrclimited[joint]:
        return float(abs(model.jnt_actfrcrange[joint]).min())
    for n in range(model.nu):
        if model.actuator_trntype[n] != mujoco.mjtTrn.mjTRN_JOINT or model.actuator_trnid[n, 0] != joint:
            continue
        gear = abs(float(model.actuator_gear[n, 0]))
        if model.actuator_forcelimited[n]:
            return gear * float(abs(model.actuator_forcerange[n]).min())
        if model.actuator_ctrllimited[n] and model.actuator_biastype[n] == mujoco.mjtBias.mjBIAS_NONE:
            gain = abs(float(model.actuator_gainprm[n, 0]))
            return gear * gain * float(abs(model.actuator_ctrlrange[n]).min())
    return 0.0


def _covers(chain: SerialChain) -> tuple[Capsule | None, ...]:
    """Return a capsule from each joint to the next one, shorter than the link by its radius at the hand."""
    ends = [*chain.positions[1:], chain.last_from_tool.position]
    covers: list[Capsule | None] = []
    for n, end in enumerate(ends):
        length = float(np.linalg.norm(end))
        share = 1.0 if n < len(ends) - 1 else max(0.0, 1.0 - COVER_RADIUS / max(length, MIN_COVER))
        x, y, z = (share * float(value) for value in end)
        covers.append(((0.0, 0.0, 0.0), (x, y, z), COVER_RADIUS) if share * length > MIN_COVER else None)
    return tuple(covers)
