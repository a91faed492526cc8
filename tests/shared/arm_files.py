"""Texts of one arm in URDF and MJCF: six joints like those of a UR5e, with meshes that do not exist."""

from math import pi

# Position and roll of each joint in the frame before, mass and centre of mass of its link.
JOINTS = (
    ("pan", (0.0, 0.0, 0.1625), 0.0, 3.7, (0.0, 0.0, -0.02)),
    ("lift", (0.0, 0.0, 0.0), pi / 2, 8.1, (-0.21, 0.0, 0.11)),
    ("elbow", (-0.425, 0.0, 0.0), 0.0, 2.8, (-0.24, 0.0, 0.03)),
    ("wrist_1", (-0.3922, 0.0, 0.1333), 0.0, 1.4, (0.0, -0.02, 0.0)),
    ("wrist_2", (0.0, -0.0997, 0.0), pi / 2, 1.3, (0.0, 0.02, 0.0)),
    ("wrist_3", (0.0, 0.0996, 0.0), -pi / 2, 0.4, (0.0, 0.0, -0.02)),
)
TORQUES = (150.0, 150.0, 150.0, 28.0, 28.0, 28.0)
INERTIA = 0.02  # kg m^2 about each axis
MESH = '<visual><geometry><mesh filename="package://arm/missing.dae"/></geometry></visual>'


def urdf(*, tip: str = '<link name="tool0"/>') -> str:
    """Return the URDF; tip holds the link after the last one, which a fixed joint attaches 5 cm ahead."""
    links = ['<link name="base_link"/>']
    joints = []
    parent = "base_link"
    for (name, position, roll, mass, centre), torque in zip(JOINTS, TORQUES, strict=True):
        link = f"{name}_link"
        links.append(
            f'<link name="{link}">{MESH}<inertial><origin xyz="{_text(centre)}"/><mass value="{mass}"/>'
            f'<inertia ixx="{INERTIA}" iyy="{INERTIA}" izz="{INERTIA}" ixy="0" ixz="0" iyz="0"/></inertial>'
            "</link>"
        )
        joints.append(
            f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{link}"/>'
            f'<origin xyz="{_text(position)}" rpy="{roll!r} 0 0"/><axis xyz="0 0 1"/>'
            f'<limit lower="-6.2" upper="6.2" effort="{torque}" velocity="3.1"/></joint>'
        )
        parent = link
    joints.append(
        f'<joint name="flange" type="fixed"><parent link="{parent}"/><child link="tool0"/>'
        '<origin xyz="0 0 0.05" rpy="0 0 1.5"/></joint>'
    )
    return f'<?xml version="1.0"?>\n<robot name="arm">{"".join(links)}{tip}{"".join(joints)}</robot>'


def mjcf() -> str:
    """Return the MJCF of the same arm, with degrees, defaults, meshes and a site on the flange."""
    body, actuators = '<body name="tool0" pos="0 0 0.05" euler="0 0 85.94366926962348"/>', ""
    for (name, position, roll, mass, centre), torque in reversed(list(zip(JOINTS, TORQUES, strict=True))):
        body = (
            f'<body name="{name}_link" pos="{_text(position)}" euler="{roll * 180.0 / pi!r} 0 0">'
            f'<inertial mass="{mass}" pos="{_text(centre)}" diaginertia="{INERTIA} {INERTIA} {INERTIA}"/>'
            f'<joint name="{name}"/><geom class="visual" mesh="missing"/>{body}</body>'
        )
        actuators += f'<general joint="{name}" forcerange="-{torque} {torque}" ctrlrange="-1 1"/>'
    limit = 6.2 * 180.0 / pi
    return (
        '<mujoco model="arm"><compiler angle="degree" meshdir="assets" autolimits="true"/>'
        f'<default><joint axis="0 0 1" range="-{limit!r} {limit!r}"/><default class="visual">'
        '<geom type="mesh" material="white"/></default></default>'
        '<asset><mesh name="missing" file="missing.obj"/><material name="white"/></asset>'
        f'<worldbody><light pos="0 0 3"/>{body}</worldbody><actuator>{actuators}</actuator>'
        '<keyframe><key name="home" qpos="0 0 0 0 0 0"/></keyframe></mujoco>'
    )


def _text(values: tuple[float, ...]) -> str:
    return " ".join(map(repr, values))
