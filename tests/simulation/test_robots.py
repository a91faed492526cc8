"""Robots by name and from files perform and record tasks; files of robots are checked."""

import csv
from pathlib import Path

import numpy as np
import pytest
from arm_files import mjcf, urdf

from pilotfish.environments import TASKS, Manipulation, Workcell
from pilotfish.environments.robots import ROBOTS, joint_trajectory
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose
from pilotfish.simulation import (
    find_robot,
    record,
    robot_from_file,
    situation_from_seed,
    write_joint_trajectory,
)
from pilotfish.simulation.recording import describe_unreached_goal


def test_find_robot_by_name_and_by_file(tmp_path: Path):
    assert find_robot("panda") is ROBOTS["panda"]
    (tmp_path / "arm.urdf").write_text(urdf())
    assert find_robot(str(tmp_path / "arm.urdf"), end_effector="tool0").name == "arm"


def test_find_robot_unknown_name_lists_the_robots():
    with pytest.raises(
        InvalidInput, match=r"robot 'kuka' is unknown, expected baxter, panda, ur5e or a file"
    ):
        find_robot("kuka")
    with pytest.raises(InvalidInput, match="needs none"):
        find_robot("panda", end_effector="tool0")


def test_file_that_cannot_be_read_is_refused(tmp_path: Path):
    with pytest.raises(InvalidInput, match="expected a robot in URDF or MJCF"):
        robot_from_file(tmp_path / "missing.urdf")
    with pytest.raises(InvalidInput, match="expected a robot in URDF or MJCF"):
        robot_from_file(tmp_path)
    (tmp_path / "huge.urdf").write_bytes(b" " * 4_000_001)
    with pytest.raises(InvalidInput, match="more than 4000000 bytes"):
        robot_from_file(tmp_path / "huge.urdf")


def test_included_file_is_read_inside_the_folder_only(tmp_path: Path):
    folder = tmp_path / "arm"
    folder.mkdir()
    text = mjcf()
    start, end = text.index("<worldbody>"), text.index("</worldbody>") + len("</worldbody>")
    part = f"<mujoco>{text[start:end]}</mujoco>"
    (folder / "part.xml").write_text(part)
    (tmp_path / "part.xml").write_text(part)
    for name in ("../part.xml", str(tmp_path / "part.xml")):
        (folder / "arm.xml").write_text(text[:start] + f'<include file="{name}"/>' + text[end:])
        with pytest.raises(InvalidInput, match="outside its folder; copy it into"):
            robot_from_file(folder / "arm.xml")
    (folder / "arm.xml").write_text(text[:start] + '<include file="part.xml"/>' + text[end:])
    assert len(robot_from_file(folder / "arm.xml").joint_names) == 6


def test_record_without_second_arm_holds_the_pose_of_the_hand():
    task = TASKS["stab"]
    situation = situation_from_seed(task, "demonstration", 0, 0)
    start = task.start_pose(situation)
    hand = Pose(start.position + np.array([0.02, 0.0, 0.0]), start.quaternion)
    recorded = record(task, situation, lambda t, _: (hand, 0.0, t > 0.3), "hand", robot=ROBOTS["ur5e"])
    x = recorded.demonstration.x
    np.testing.assert_allclose(x[0, :3], start.position, atol=1e-3)
    np.testing.assert_array_equal(x[1:, :3], np.tile(hand.position, (len(x) - 1, 1)))


def test_manipulation_has_the_joints_of_the_robot():
    environment = Manipulation("stab", robot="ur5e")
    observation, _ = environment.reset(seed=0)
    assert observation["joints"].shape == environment.observation_space["joints"].shape == (6,)
    assert observation in environment.observation_space
    environment.close()
    with pytest.raises(InvalidInput, match="robot is 'kuka', expected one of baxter, panda, ur5e"):
        Manipulation("stab", robot="kuka")


@pytest.mark.usefixtures("unchecked")  # wrong types on purpose
def test_meshes_of_baxter_on_another_robot_are_refused(rng):
    task = TASKS["stab"]
    situation = task.sample_situation(rng)
    with pytest.raises(InvalidInput, match="of Baxter, and the robot is panda"):
        Workcell(task, situation, robot=ROBOTS["panda"], visual_meshes=[object()])


def test_written_joint_trajectory_has_header_and_all_samples(tmp_path: Path):
    rows = np.tile([0.6, -0.3, 0.2, 0.0, 0.0, 1.0, 0.0], (3, 1))
    rows[:, 2] += [0.0, 0.01, 0.02]
    motion = joint_trajectory(ROBOTS["ur5e"], rows, 0.1)
    write_joint_trajectory(motion, tmp_path / "motion.csv")
    with (tmp_path / "motion.csv").open() as file:
        header, *table = csv.reader(file)
    assert header[:2] == ["time [s]", "shoulder_pan [rad]"]
    assert header[-1] == "wrist_3 [rad/s]"
    expected = np.column_stack([motion.times, motion.q, motion.velocity])
    np.testing.assert_allclose(np.array(table, dtype=float), expected, rtol=1e-8, atol=1e-12)
    with pytest.raises(InvalidInput):
        write_joint_trajectory(motion, tmp_path / "motion.csv")


def test_goal_out_of_reach_is_described():
    """The second valve of seed 0 is too low for the horizontal gripper of the Panda, the first is not."""
    task = TASKS["valve"]
    first, second = (situation_from_seed(task, "demonstration", 0, number) for number in (0, 1))
    assert describe_unreached_goal(task, first, ROBOTS["panda"]) == ""
    note = describe_unreached_goal(task, second, ROBOTS["panda"])
    assert "panda does not reach the goal of 'line up' at [0.768, -0.377, 0.076] m" in note
    assert describe_unreached_goal(task, second, ROBOTS["ur5e"]) == ""
