"""The robot in physics does what control promises: hangs still, yields as its springs say, keeps limits."""

import mujoco
import numpy as np
import pytest

from pilotfish.control import forward_kinematics, jacobian
from pilotfish.environments import TASKS, Workcell
from pilotfish.environments.baxter import JOINTS, add_arm, arm_chain, baxter_limits, empty_world, mount_handle
from pilotfish.environments.steering import RelativeMapping, linear_path
from pilotfish.geometry import (
    Pose,
    angle,
    multiply,
    normalise,
    quaternion_exp,
    relative_rotation_vector,
    rotation_vector_in_world,
)
from pilotfish.kernels import ArmState

pytestmark = pytest.mark.usefixtures("unchecked")

VALVE = TASKS["valve"]
SIDES = ("left", "right")


def cell(seed: int = 0, *, lead: bool = False) -> Workcell:
    return Workcell(VALVE, VALVE.sample_situation(np.random.default_rng(seed)), lead=lead)


def some_joints(rng: np.random.Generator) -> np.ndarray:
    limits = baxter_limits()
    return rng.uniform(0.9 * limits.lower, 0.9 * limits.upper)


def both_arms() -> tuple[mujoco.MjModel, mujoco.MjData]:
    spec = empty_world(0.001)
    for side in SIDES:
        mount_handle(spec, add_arm(spec, side), side)
    model = spec.compile()
    return model, mujoco.MjData(model)


@pytest.mark.parametrize("side", SIDES)
def test_the_chain_and_the_physics_are_the_same_arm(rng, side):
    """Tool pose and Jacobian of the chain of published transforms equal those of the simulated bodies."""
    model, data = both_arms()
    q, chain = some_joints(rng), arm_chain(side, 0.06)
    first = int(model.joint(f"{side}_{JOINTS[0].name}").qposadr[0])
    data.qpos[first : first + 7] = q
    mujoco.mj_forward(model, data)
    site, pose = model.site(f"{side}_tool").id, forward_kinematics(chain, q)
    assert np.allclose(data.site_xpos[site], pose.position, atol=1e-12)
    assert angle(data.xquat[model.site_bodyid[site]], pose.quaternion) < 1e-7
    J = np.zeros((6, model.nv))
    mujoco.mj_jacSite(model, data, J[:3], J[3:], site)
    assert np.allclose(J[:, first : first + 7], jacobian(chain, q), atol=1e-12)


@pytest.mark.parametrize("side", SIDES)
def test_the_physics_jacobian_is_what_small_turns_of_joints_do(rng, side):
    """Each column is the tool's displacement and turn over a small turn of its joint, by differences."""
    model, data = both_arms()
    q, h = some_joints(rng), 1e-6
    first = int(model.joint(f"{side}_{JOINTS[0].name}").qposadr[0])
    site = model.site(f"{side}_tool").id

    def tool(joints: np.ndarray) -> Pose:
        data.qpos[first : first + 7] = joints
        mujoco.mj_forward(model, data)
        return Pose(data.site_xpos[site].copy(), data.xquat[model.site_bodyid[site]].copy())

    J = np.zeros((6, model.nv))
    tool(q)
    mujoco.mj_jacSite(model, data, J[:3], J[3:], site)
    for n, step in enumerate(h * np.eye(7)):
        back, ahead = tool(q - step), tool(q + step)
        moved = np.append(
            ahead.position - back.position, rotation_vector_in_world(back.quaternion, ahead.quaternion)
        )
        assert np.allclose(J[:, first + n], moved / (2 * h), atol=1e-7)


def test_an_arm_under_gravity_compensation_alone_hangs_still():
    """In ten seconds without any spring or brake of the controller the tool drifts less than a millimetre."""
    robot = cell()
    began = robot.arm.tool
    for _ in range(10_000):
        robot.arm.motors[:] = robot.arm.bias
        mujoco.mj_step(robot.model, robot.data)
    assert robot.time == pytest.approx(10.0)
    assert np.linalg.norm(robot.arm.tool.position - began.position) < 1e-3


def test_without_compensation_it_falls():
    """That was not because it cannot move: without torque it falls by centimetres in a second."""
    robot = cell()
    began = robot.arm.tool
    for _ in range(1000):
        robot.arm.motors[:] = 0.0
        mujoco.mj_step(robot.model, robot.data)
    assert np.linalg.norm(robot.arm.tool.position - began.position) > 0.05


@pytest.mark.parametrize("axis", range(6))
def test_a_pushed_arm_yields_as_its_springs_say(axis):
    """At rest under a force or moment F at the tool it is F / stiffness away along it, and nowhere else."""
    robot, push = cell(), np.zeros(6)
    began = robot.arm.tool
    push[axis] = 10.0 if axis < 3 else 1.0
    for _ in range(150):
        robot.arm.push[:] = robot.arm.jacobian().T @ push
        robot.step_impedance(robot.target, 0.0, 20)
    away = np.append(
        robot.arm.tool.position - began.position,
        rotation_vector_in_world(began.quaternion, robot.arm.tool.quaternion),
    )
    expected = push / robot.impedance.stiffness
    assert away[axis] == pytest.approx(expected[axis], rel=0.01)
    assert np.abs(away - expected).max() < 1e-3


def test_the_posture_does_not_lean_on_the_tool():
    """A posture far away turns the elbow and moves the tool by less than a tenth of a millimetre at rest."""
    from dataclasses import replace

    robot = cell()
    began, q = robot.arm.tool, robot.arm.q.copy()
    robot.impedance = replace(robot.impedance, posture=robot.impedance.posture + 0.3)
    for _ in range(250):
        robot.step_impedance(robot.target, 0.0, 20)
    assert np.abs(robot.arm.q - q).max() > 0.02
    assert np.linalg.norm(robot.arm.tool.position - began.position) < 1e-4


def test_position_mode_holds_joints():
    """Asked for joints instead of a pose, the arm goes there and stays."""
    robot = cell()
    wanted = robot.arm.q + np.array([0.1, -0.1, 0.1, 0.1, -0.2, 0.1, 0.2])
    for _ in range(150):
        robot.step_position(wanted, 0.0, 20)
    assert np.abs(robot.arm.q - wanted).max() < 2e-3


def test_motors_stay_within_their_limits_when_a_target_jumps_out_of_reach():
    """Asked for a pose three metres away and upside down, no motor is asked for more than it can do."""
    robot = cell()
    far = Pose(np.array([3.0, -2.0, 2.0]), np.array([0.0, 1.0, 0.0, 0.0]))
    limits = baxter_limits()
    for _ in range(40):
        robot.step_impedance(far, 0.0, 20)
        assert (np.abs(robot.arm.motors) <= limits.torque + 1e-9).all()
    assert np.isfinite(robot.arm.q).all()
    assert (robot.arm.q > limits.lower - 0.02).all()
    assert (robot.arm.q < limits.upper + 0.02).all()


def test_the_led_arm_takes_the_other_along():
    """A hand that moves the knob of the left arm by some way moves the right tool by about the same."""
    robot = cell(lead=True)
    began = robot.arm.tool
    target = Pose(
        began.position + np.array([0.03, -0.02, 0.04]),
        multiply(quaternion_exp(np.array([0.0, 0.0, 0.1])), began.quaternion),
    )
    for _ in range(150):
        robot.step_guidance(target, 0.0, 20)
    assert np.linalg.norm(robot.arm.tool.position - target.position) < 2e-3
    assert angle(robot.arm.tool.quaternion, target.quaternion) < 0.02


def test_a_run_repeats_bit_for_bit():
    """The same asked poses in the same situation give the same joints, to the last bit."""

    def run() -> np.ndarray:
        robot = cell(3, lead=True)
        for n in range(20):
            away = np.array([0.002 * n, 0.0, 0.001 * n])
            robot.step_guidance(Pose(robot.target.position + away, robot.target.quaternion), 1.0, 20)
        return robot.data.qpos.copy()

    assert np.array_equal(run(), run())


def test_a_straight_path_is_even_and_turns_the_shorter_way(rng):
    """Its last target is the end, its steps are equal, and its twist is what they are in a second."""
    a = Pose(rng.normal(size=3), normalise(rng.normal(size=4)))
    b = Pose(rng.normal(size=3), normalise(rng.normal(size=4)))
    path = linear_path(a, b, 50, 0.001)
    assert np.allclose(path.positions[-1], b.position)
    assert angle(path.quaternions[-1], b.quaternion) < 1e-7
    steps = np.diff(np.vstack([a.position, path.positions]), axis=0)
    assert np.allclose(steps, path.twist[:3] * 0.001)
    assert np.allclose(np.linalg.norm(path.twist[3:]) * 0.05, angle(a.quaternion, b.quaternion))
    assert np.linalg.norm(relative_rotation_vector(a.quaternion, b.quaternion)) <= np.pi + 1e-9


def test_a_clutch_undoes_itself(rng):
    """Where the follower is led to be, the leader had to be; both move and turn by as much."""
    poses = [Pose(rng.normal(size=3), normalise(rng.normal(size=4))) for _ in range(3)]
    mapping = RelativeMapping(poses[0], poses[1])
    there = mapping.follower_pose(poses[2])
    again = mapping.leader_pose(there)
    assert np.allclose(again.position, poses[2].position)
    assert angle(again.quaternion, poses[2].quaternion) < 1e-7
    assert np.allclose(there.position - poses[1].position, poses[2].position - poses[0].position)
    turn = rotation_vector_in_world(poses[0].quaternion, poses[2].quaternion)
    assert np.allclose(rotation_vector_in_world(poses[1].quaternion, there.quaternion), turn)


def test_readings_are_of_now():
    """After every period the reading is what a fresh computation from the joints gives."""
    robot = cell()
    goal = Pose(robot.target.position + np.array([0.05, 0.02, -0.03]), robot.target.quaternion)
    robot.step_impedance(goal, 0.0, 100)
    reading: ArmState = robot.arm.reading()
    fresh = mujoco.MjData(robot.model)
    fresh.qpos[:], fresh.qvel[:] = robot.data.qpos, robot.data.qvel
    mujoco.mj_forward(robot.model, fresh)
    assert np.allclose(reading.position, fresh.site_xpos[robot.model.site("right_tool").id], atol=1e-12)
    assert np.allclose(reading.bias, (fresh.qfrc_bias - fresh.qfrc_spring)[:7], atol=1e-9)
