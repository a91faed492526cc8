"""Arms from URDF and MJCF equal MuJoCo's own kinematics; files that are no arm are refused with the fix."""

import mujoco
import numpy as np
import pytest
from arm_files import INERTIA, JOINTS, TORQUES, mjcf, urdf

from pilotfish.environments import TASKS, Workcell
from pilotfish.environments.robots import robot_from_description
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, rotation_matrix

BASE = Pose(np.array([0.1, -0.3, -0.2]), np.array([1.0, 0.0, 0.0, 0.0]))
TEXTS = {"urdf": urdf(), "mjcf": mjcf()}


@pytest.fixture(scope="module", params=sorted(TEXTS))
def described(request):
    return request.param, robot_from_description(TEXTS[request.param].encode(), base=BASE)


def robot(text: str, **options):
    return robot_from_description(text.encode(), base=BASE, **options)


def test_chain_equals_mujoco_in_the_file_itself(described, rng):
    kind, arm = described
    text = urdf().replace("<robot name", '<robot xmlns:x="x" name') if kind == "urdf" else mjcf()
    text = text.replace(
        '<link name="base_link"/>', '<mujoco><compiler fusestatic="false"/></mujoco><link name="base_link"/>'
    )
    text = text.replace('<geom class="visual" mesh="missing"/>', "").replace(
        '<mesh name="missing" file="missing.obj"/>', ""
    )
    text = text.replace(' xmlns:x="x"', "")
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    for _ in range(5):
        data.qpos[:] = q = rng.uniform(-3.0, 3.0, 6)
        mujoco.mj_kinematics(model, data)
        hand = BASE.inverse() @ arm.chain.forward_kinematics(q)
        np.testing.assert_allclose(hand.position, data.body("tool0").xpos, atol=1e-9)
        R = data.body("tool0").xmat.reshape(3, 3)
        np.testing.assert_allclose(rotation_matrix(hand.quaternion), R, atol=1e-9)


def test_limits_and_names_are_those_of_the_file(described):
    kind, arm = described
    assert arm.name == "arm"
    assert arm.joint_names == tuple(name for name, *_ in JOINTS)
    np.testing.assert_allclose(arm.limits.torque, TORQUES)
    np.testing.assert_allclose(arm.limits.upper, 6.2)
    np.testing.assert_allclose(arm.limits.velocity, 3.1 if kind == "urdf" else 0.5 * np.pi)


def test_masses_and_gravity_equal_the_file(described, rng):
    """The torque that holds the arm is that of its links' masses: computed by the potential's differences."""
    _, arm = described
    task = TASKS["stab"]
    cell = Workcell(task, task.sample_situation(rng), robot=arm)
    for joint, (_, _, _, mass, centre) in zip(arm.joints, JOINTS, strict=True):
        body = cell.model.body(f"{joint}_link")
        assert body.mass[0] == pytest.approx(mass)
        np.testing.assert_allclose(body.ipos, centre, atol=1e-12)
        np.testing.assert_allclose(body.inertia, INERTIA, atol=1e-12)


def test_arm_performs_a_short_motion(described, rng):
    _, arm = described
    task = TASKS["carabiner"]
    cell = Workcell(task, task.sample_situation(rng), robot=arm)
    target = Pose(cell.target.position + np.array([0.03, 0.0, 0.0]), cell.target.quaternion)
    cell.step_impedance(target, 0.0, 800)
    assert np.linalg.norm(cell.arm.tool.position - target.position) < 0.005


def test_fixed_links_are_lumped_and_beyond_the_end_effector_left_out():
    camera = (
        '<link name="tool0"/><link name="camera"><inertial><origin xyz="0 0 0.1"/><mass value="0.4"/>'
        '<inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        '<joint name="bolt" type="fixed"><parent link="{parent}"/><child link="camera"/></joint>'
    )
    on_link = robot(urdf(tip=camera.format(parent="wrist_3_link")), end_effector="tool0")
    beyond = robot(urdf(tip=camera.format(parent="tool0")), end_effector="tool0")

    def last_link(arm):
        task = TASKS["stab"]
        cell = Workcell(task, task.sample_situation(np.random.default_rng(0)), robot=arm)
        return cell.model.body("right_wrist_3_link")

    lumped = last_link(on_link)
    assert lumped.mass[0] == pytest.approx(0.8)
    np.testing.assert_allclose(lumped.ipos, [0, 0, (0.4 * -0.02 + 0.4 * 0.1) / 0.8], atol=1e-12)
    across = 0.03 + 2 * 0.4 * 0.06**2  # parallel axes, 6 cm from the common centre
    np.testing.assert_allclose(np.sort(lumped.inertia), [0.03, across, across], atol=1e-12)
    assert last_link(beyond).mass[0] == pytest.approx(0.4)


def test_reference_and_anchor_of_a_joint_are_kept(rng):
    text = mjcf().replace('<joint name="elbow"/>', '<joint name="elbow" pos="0.02 -0.01 0.03" ref="20"/>')
    arm = robot(text)
    stripped = text.replace('<geom class="visual" mesh="missing"/>', "").replace(
        '<mesh name="missing" file="missing.obj"/>', ""
    )
    model = mujoco.MjModel.from_xml_string(stripped)
    data = mujoco.MjData(model)
    data.qpos[:] = q = rng.uniform(-3.0, 3.0, 6)
    mujoco.mj_kinematics(model, data)
    hand = BASE.inverse() @ arm.chain.forward_kinematics(q)
    np.testing.assert_allclose(hand.position, data.body("tool0").xpos, atol=1e-9)


BOMB = '<!DOCTYPE a [<!ENTITY b "ha"><!ENTITY c "&b;&b;&b;&b;">]>' + urdf()
LIMIT = '<limit lower="-6.2" upper="6.2" effort="28.0" velocity="3.1"/>'
LIFT = '<joint name="lift" type="revolute">'
BRANCH = (
    '<link name="tool0"/><link name="other"/><joint name="f" type="fixed"><parent link="elbow_link"/>'
    '<child link="other"/></joint>'
)
XACRO = '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"'
REFUSED = {
    "empty": ("", "not well-formed XML"),
    "text": ("a robot", "not well-formed XML"),
    "bomb": (BOMB, "remove <!DOCTYPE"),
    "other": ("<svg/>", "expected <robot> or <mujoco>"),
    "nothing": ('<robot name="r"><link name="a"/></robot>', "hinge joint"),
    "deep": ("<mujoco>" + "<body>" * 5000 + "</body>" * 5000 + "</mujoco>", "levels"),
    "long": ("<mujoco>" + "<a/>" * 60_000 + "</mujoco>", "more than 50000 elements"),
    "prismatic": (urdf().replace('"elbow" type="revolute"', '"elbow" type="prismatic"'), "of type slide"),
    "no limits": (urdf().replace(LIMIT, ""), "limit"),
    "no effort": (urdf().replace('effort="28.0"', ""), "add both"),
    "zero effort": (urdf().replace('effort="28.0"', 'effort="0"'), "expected positive"),
    "text effort": (urdf().replace('effort="28.0"', 'effort="lots"'), "bad format|number"),
    "nan effort": (urdf().replace('effort="28.0"', 'effort="nan"'), "expected positive"),
    "no mass": (urdf().replace('<mass value="2.8"/>', '<mass value="0"/>'), "inertial"),
    "infinite mass": (urdf().replace('value="2.8"', 'value="1e308"'), "mass that is not finite or above"),
    "millimetres": (urdf().replace("-0.425", "-425"), "position that is not finite or above 100 m"),
    "no range": (mjcf().replace('name="elbow"/>', 'name="elbow" limited="false"/>'), "no range"),
    "no torque": (mjcf().split("<actuator>")[0] + "</mujoco>", "torque limit 0"),
    "unknown link": (urdf().replace('parent link="pan_link"', 'parent link="x"'), "cannot compile"),
    "generated": (mjcf().replace("<light", '<replicate count="9"><body/></replicate><light'), "replicate"),
    "include": (mjcf().replace("<asset>", '<include file="../x.xml"/><asset>'), "includes other files"),
    "mimic": (urdf().replace(LIFT, LIFT + '<mimic joint="pan"/>'), "mimics"),
    "xacro": (urdf().replace("<robot", XACRO).replace("</robot>", "<xacro:arm/></robot>"), "xacro arm.urdf"),
    "branch": (urdf(tip=BRANCH), "several ends: .*name the end effector"),
}


@pytest.mark.parametrize("case", sorted(REFUSED))
def test_file_that_is_no_arm_is_refused_with_the_fix(case):
    text, message = REFUSED[case]
    with pytest.raises(InvalidInput, match=message):
        robot(text, name="arm.urdf")


def test_other_encoding_is_refused():
    with pytest.raises(InvalidInput, match="UTF-8"):
        robot_from_description(urdf().encode("utf-16"))


def test_unknown_end_effector_is_refused_with_the_names():
    with pytest.raises(InvalidInput, match=r"no link, body or site 'hand', expected one of .*tool0"):
        robot(urdf(), end_effector="hand")


def test_short_arm_that_does_not_reach_the_tasks_is_refused():
    short = urdf().replace("-0.425", "-0.05").replace("-0.3922", "-0.05")
    with pytest.raises(InvalidInput, match="does not reach"):
        robot(short)


def test_included_file_is_read_by_the_function():
    text = mjcf()
    start, end = text.index("<worldbody>"), text.index("</worldbody>") + len("</worldbody>")
    files = {"arm.xml": f"<mujoco>{text[start:end]}</mujoco>".encode()}
    arm = robot(text[:start] + '<include file="arm.xml"/>' + text[end:], read_included=files.__getitem__)
    assert arm.joint_names == robot(text).joint_names
    loop = {"arm.xml": b'<mujoco><include file="arm.xml"/><include file="arm.xml"/></mujoco>'}
    with pytest.raises(InvalidInput, match="more than 50"):
        robot('<mujoco><include file="arm.xml"/></mujoco>', read_included=loop.__getitem__)
