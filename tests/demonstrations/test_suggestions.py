"""Settings that names, units and values suggest, and questions that they leave."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pilotfish.demonstrations import (
    FrameSource,
    PartSource,
    Quantity,
    Recording,
    Signal,
    build_demonstration,
    suggest_settings,
)
from pilotfish.errors import InvalidInput

TIMES = np.arange(40) / 20
TURN = Rotation.from_rotvec(np.column_stack([TIMES, 0.3 + TIMES, 0.1 * TIMES]))
POINTS = np.column_stack([np.sin(TIMES), TIMES, np.cos(TIMES)])


def recording(*signals: tuple[str, str, np.ndarray], units: str = "") -> Recording:
    """Return a recording of signals, each as name, columns separated by commas, and values."""
    made = []
    for name, names, values in signals:
        columns = tuple(names.split(","))
        made.append(
            Signal(name, values, columns, tuple(units.split(",")) if units else ("",) * len(columns), TIMES)
        )
    return Recording("a", tuple(made))


def pose(order: str = "xyzw") -> np.ndarray:
    return np.column_stack([POINTS, TURN.as_quat(scalar_first=order == "wxyz")])


@pytest.mark.parametrize(
    ("columns", "order"),
    [
        ("x,y,z,qx,qy,qz,qw", "xyzw"),
        ("x,y,z,qw,qx,qy,qz", "wxyz"),
        ("position x,position y,position z,orientation w,orientation x,orientation y,orientation z", "wxyz"),
        (
            (
                "pose.position.x,pose.position.y,pose.position.z,pose.orientation.x,pose.orientation.y,"
                "pose.orientation.z,pose.orientation.w"
            ),
            "xyzw",
        ),
        ("tcp_x,tcp_y,tcp_z,tcp_qx,tcp_qy,tcp_qz,tcp_qw", "xyzw"),
        ("eePosX,eePosY,eePosZ,eeQuatX,eeQuatY,eeQuatZ,eeQuatW", "xyzw"),
        ("px,py,pz,quat_w,quat_x,quat_y,quat_z", "wxyz"),
    ],
)
def test_named_pose_is_found_in_its_order(columns: str, order: str):
    """Names decide the order; the demonstration equals the pose without a question."""
    settings, questions = suggest_settings([recording(("", columns, pose(order)))])
    assert not questions
    assert [part.name for part in settings.parts] == ["position", "orientation"]
    assert settings.period == 1 / 20
    demo, _ = build_demonstration(recording(("", columns, pose(order))), settings)
    assert np.allclose(demo.x, pose("wxyz"), atol=1e-12)


def test_objects_are_frames_and_gripper_is_a_part():
    values = np.column_stack([pose(), TIMES > 1, pose(), 0.1 * POINTS])
    names = (
        "x,y,z,qx,qy,qz,qw,gripper,cube_x,cube_y,cube_z,cube_qx,cube_qy,cube_qz,cube_qw,bin1_x,bin1_y,bin1_z"
    )
    settings, questions = suggest_settings([recording(("", names, values))])
    assert not questions
    assert [part.name for part in settings.parts] == ["position", "orientation", "gripper"]
    assert settings.frames == (
        FrameSource("cube", ("cube_x", "cube_y", "cube_z"), ("cube_qw", "cube_qx", "cube_qy", "cube_qz")),
        FrameSource("bin1", ("bin1_x", "bin1_y", "bin1_z")),
    )


def test_signals_name_their_owner():
    names = "pose.position.x,pose.position.y,pose.position.z"
    given = recording(("/tool_pose", names, POINTS), ("/cup", names, POINTS))
    settings, questions = suggest_settings([given])
    assert not questions
    expected = tuple(f"/tool_pose:{name}" for name in names.split(","))
    assert settings.parts == (PartSource("position", Quantity.POSITION, expected),)
    assert [frame.name for frame in settings.frames] == ["cup"]


@pytest.mark.parametrize(
    "names", ["joint_1,joint_2,joint_3", "q1,q2,q3", "shoulder_joint,elbow_joint,wrist_joint"]
)
def test_joints_are_a_part_without_a_pose(names: str):
    settings, questions = suggest_settings([recording(("", names, POINTS))])
    assert settings.parts == (PartSource("joints", Quantity.SCALAR, tuple(names.split(",")), "rad"),)
    assert not questions
    degrees, questions = suggest_settings([recording(("", names, 100 * POINTS))])
    assert degrees.parts[0].unit == "deg"
    assert "in degrees?" in questions[0].text


def test_derivatives_and_commands_are_left_out():
    names = "x,y,z,linear_velocity_x,linear_velocity_y,linear_velocity_z,cmd_x,cmd_y,cmd_z,x',y',z'"
    settings, _ = suggest_settings([recording(("", names, np.tile(POINTS, 4)))])
    assert settings.parts == (PartSource("position", Quantity.POSITION, ("x", "y", "z")),)
    assert not settings.frames


def test_force_is_a_vector():
    values = np.column_stack([POINTS, POINTS])
    settings, _ = suggest_settings([recording(("", "x,y,z,fx,fy,fz", values))])
    assert settings.parts[1] == PartSource("force", Quantity.VECTOR, ("fx", "fy", "fz"), "N")


def test_positions_without_unit_in_the_hundreds_are_asked_for():
    for scale, unit in ((400, "mm"), (40, "cm")):
        settings, questions = suggest_settings([recording(("", "x,y,z", scale * POINTS))])
        assert settings.parts[0].unit == unit
        assert "in m, cm or mm?" in questions[0].text
    _, questions = suggest_settings([recording(("", "x,y,z", 400 * POINTS), units="mm,mm,mm")])
    assert not questions


def test_numbered_quaternion_is_asked_for_unless_a_table_reveals_its_order():
    """The norm and continuity are the same in each order; only an object that turns about z decides."""
    names = ",".join([f"eef_pos_{n}" for n in range(3)] + [f"eef_quat_{n}" for n in range(4)])
    settings, questions = suggest_settings([recording(("", names, pose()))])
    assert settings.parts[1].representation == "xyzw"
    assert "order w x y z or x y z w?" in questions[0].text
    upright = Rotation.from_rotvec(np.column_stack([0 * TIMES, 0 * TIMES, 0.3 + TIMES]))
    objects = ",".join([f"cube_pos_{n}" for n in range(3)] + [f"cube_quat_{n}" for n in range(4)])
    for order in ("wxyz", "xyzw"):
        cube = np.column_stack([POINTS, upright.as_quat(scalar_first=order == "wxyz")])
        given = recording(("", names, pose(order)), ("objects", objects, cube))
        settings, questions = suggest_settings([given])
        assert not questions
        assert settings.parts[1].representation == settings.frames[0].representation == order


@pytest.mark.parametrize(
    ("names", "values", "kind"),
    [
        ("roll,pitch,yaw", TURN.as_euler("xyz"), "rpy"),
        (
            ",".join(f"r{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3)),
            TURN.as_matrix().reshape(-1, 9),
            "matrix",
        ),
        ("rx,ry,rz", TURN.as_rotvec(), "rotation vector"),
    ],
)
def test_other_rotations_are_found(names: str, values: np.ndarray, kind: str):
    given = recording(("", f"x,y,z,{names}", np.column_stack([POINTS, values])))
    settings, questions = suggest_settings([given])
    assert settings.parts[1].representation == kind
    assert len(questions) == (kind == "rotation vector")
    demo, _ = build_demonstration(given, settings)
    assert np.allclose(np.abs(np.einsum("td,td->t", demo.x[:, 3:], pose("wxyz")[:, 3:])), 1.0)


def test_yaw_of_an_object_is_its_orientation():
    yaw = 0.2 + TIMES
    names = "x,y,z,cube_x,cube_y,cube_z,cube_yaw,Gripper Mean Marker Error"
    given = recording(("", names, np.column_stack([POINTS, POINTS, yaw, np.abs(POINTS[:, 0])])))
    settings, _ = suggest_settings([given])
    assert settings.frames[0].representation == "yaw"
    assert [part.name for part in settings.parts] == ["position"]  # an error of a tracker is not a gripper
    demo, _ = build_demonstration(given, settings)
    c, s = np.cos(yaw[0]), np.sin(yaw[0])
    np.testing.assert_allclose(demo.frames[0].A, [[c, -s, 0], [s, c, 0], [0, 0, 1]], atol=1e-12)


def test_unnamed_columns_are_asked_for():
    columns = ",".join(f"column {n + 1}" for n in range(8))
    settings, questions = suggest_settings([recording(("", columns, np.column_stack([pose(), TIMES])))])
    assert [part.name for part in settings.parts] == ["position", "orientation", "state"]
    assert len(questions) == 2
    settings, questions = suggest_settings([recording(("", "a,b,c,d", np.tile(TIMES[:, None], 4)))])
    assert settings.parts == (PartSource("state", Quantity.SCALAR, ("a", "b", "c", "d")),)
    assert "What are the columns" in questions[0].text


def test_rows_without_times_are_asked_for():
    signal = Signal("", POINTS, ("x", "y", "z"), ("",) * 3)
    settings, questions = suggest_settings([Recording("a", (signal,))])
    assert settings.period is None
    assert "time between two rows" in questions[0].text


@pytest.mark.usefixtures("unchecked")  # wrong types on purpose
def test_unusable_recordings_are_refused():
    with pytest.raises(InvalidInput, match="empty"):
        suggest_settings([])
    with pytest.raises(InvalidInput, match="expected Recording"):
        suggest_settings([1])  # type: ignore[list-item]
    with pytest.raises(InvalidInput, match="expected Iterable"):
        suggest_settings(None)  # type: ignore[arg-type]
    with pytest.raises(InvalidInput, match="no signals"):
        suggest_settings([Recording("a", ())])
    other = recording(("", "u,v,w", POINTS))
    with pytest.raises(InvalidInput, match="no column is named 'x'"):
        suggest_settings([recording(("", "x,y,z", POINTS)), other])


@pytest.mark.parametrize("first", [0, 1])
def test_numbered_q_has_the_scalar_first_and_is_asked_for(first: int):
    names = ",".join(["x,y,z", *(f"q{n + first}" for n in range(4))])
    settings, questions = suggest_settings([recording(("", names, pose("wxyz")))])
    assert settings.parts[1].representation == "wxyz"
    assert "proposed is w x y z" in questions[0].text


def test_matrix_of_libfranka_is_the_pose_and_torques_are_left_out():
    matrices = np.tile(np.eye(4), (len(TIMES), 1, 1))
    matrices[:, :3, :3], matrices[:, :3, 3] = TURN.as_matrix(), POINTS
    table = matrices.transpose(0, 2, 1).reshape(-1, 16)  # by columns
    names = [f"O_T_EE_{n}" for n in range(16)]
    given = recording(("", ",".join(names), table))
    settings, questions = suggest_settings([given])
    assert not questions
    demo, _ = build_demonstration(given, settings)
    np.testing.assert_allclose(demo.x[:, :3], POINTS)
    assert np.abs(np.einsum("td,td->t", demo.x[:, 3:], pose("wxyz")[:, 3:])) == pytest.approx(1.0)
    joints = ",".join(f"{name}_{n}" for name in ("q", "tau_J") for n in range(3))
    other = recording(
        ("", ",".join([*(f"pose_m_{n}" for n in range(16)), joints]), np.hstack([table, POINTS, POINTS]))
    )
    settings, questions = suggest_settings([other])
    assert [part.columns for part in settings.parts] == [("q_0", "q_1", "q_2")]
    assert "A pose may be in columns pose_m_0 to pose_m_15" in questions[0].text


def test_pose_of_rtde_comes_before_its_joints():
    names = ",".join(
        f"{name}_{n}" for name in ("actual_q", "target_TCP_pose", "actual_TCP_pose") for n in range(6)
    )
    values = np.column_stack([POINTS, POINTS, POINTS, POINTS, POINTS, TURN.as_rotvec()])
    given = recording(("", names, values))
    settings, _ = suggest_settings([given])
    assert [part.name for part in settings.parts] == ["position", "orientation"]
    demo, _ = build_demonstration(given, settings)
    assert np.abs(np.einsum("td,td->t", demo.x[:, 3:], pose("wxyz")[:, 3:])) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("names", "owner"),
    [
        ("x,y,z,yaw", "the tool"),
        ("x,y,z,a,b,c", "the tool"),
        ("x,y,z,cube_x,cube_y,cube_z,cube_a,cube_b,cube_c", "'cube'"),
    ],
)
def test_angles_that_make_no_orientation_are_asked_for(names: str, owner: str):
    values = np.tile(TIMES[:, None], names.count(",") + 1)
    _, questions = suggest_settings([recording(("", names, values))])
    assert any(f"The orientation of {owner} (" in question.text for question in questions)
    for other in ("x,y,z", "x,y,z,roll,pitch,yaw"):
        _, questions = suggest_settings([recording(("", other, values[:, [0] * (other.count(",") + 1)]))])
        assert not questions
