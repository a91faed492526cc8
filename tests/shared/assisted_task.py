"""A small pick-and-place task with a grip, and skills and assistants for it."""

from functools import cache

import numpy as np

import pilotfish as pf
from pilotfish import assistance
from pilotfish.demonstrations import (
    Demonstration,
    Layout,
    Part,
    Quantity,
    demonstration,
    frame_from_pose,
    pose_layout,
    to_sphere,
)
from pilotfish.geometry import Pose, from_rotation_vector, minimum_jerk, multiply, rotation_matrix
from pilotfish.models import EMSettings, TimeBins

ROWS, PERIOD = 61, 0.1
HOME = Pose(np.array([0.4, 0.0, 0.4]), np.array([1.0, 0.0, 0.0, 0.0]))
LIMITS = assistance.Limits(speed=2.0, acceleration=50.0, angular_speed=10.0, angular_acceleration=300.0)
LAYOUT = Layout((*pose_layout().parts, Part("grip", Quantity.SCALAR, 1, "1")))


def random_object(rng: np.random.Generator, centre: list[float]) -> Pose:
    turn = from_rotation_vector(np.array([0.0, 0.0, rng.uniform(-0.6, 0.6)]))
    return Pose(np.array(centre) + np.append(rng.uniform(-0.12, 0.12, 2), 0.0), turn)


def random_scene(rng: np.random.Generator) -> tuple[Pose, Pose]:
    return random_object(rng, [0.6, 0.25, 0.1]), random_object(rng, [0.6, -0.25, 0.1])


def scene_frames(scene: tuple[Pose, Pose], layout: Layout = LAYOUT) -> list[pf.Frame]:
    return [frame_from_pose(n, layout, p) for n, p in zip(("cube", "tray"), scene, strict=True)]


def demonstrate(rng: np.random.Generator, scene: tuple[Pose, Pose] | None = None) -> Demonstration:
    """Return a movement from home to the cube, over to the tray and up; the grip is closed in between."""
    cube, tray = scene = random_scene(rng) if scene is None else scene
    noise = [rng.normal(0.0, s, 3) for s in (0.02, 0.003, 0.003, 0.02)]
    lift = np.array([0.0, 0.0, 0.2])
    points = [
        HOME.position + noise[0],
        cube.position + noise[1],
        tray.position + noise[2],
        tray.position + lift + noise[3],
    ]
    turns = [HOME.quaternion, cube.quaternion, tray.quaternion, tray.quaternion]
    x, t = np.zeros((ROWS, 8)), np.arange(ROWS)
    for n, start in enumerate((0, 20, 40)):
        s = minimum_jerk((t - start) / 18.0)[:, None]
        arc = np.sin(np.pi * s) ** 2 * (0.1 if n == 1 else 0.0) * np.array([0.0, 0.0, 1.0])
        moved = points[n] + s * (points[n + 1] - points[n]) + arc
        turn = (1.0 - s) * turns[n] + s * turns[n + 1]
        rows = t >= start
        x[rows, :3], x[rows, 3:7] = moved[rows], turn[rows]
    x[:, 3:7] /= np.linalg.norm(x[:, 3:7], axis=1, keepdims=True)
    x[:, 7] = (t > 19) & (t < 40)
    return demonstration(x, PERIOD, LAYOUT, scene_frames(scene), "pick and place")


@cache
def demonstrations(count: int = 6) -> tuple[Demonstration, ...]:
    rng = np.random.default_rng(0)
    return tuple(demonstrate(rng) for _ in range(count))


@cache
def learn(kind: str = "flat", dynamics: str = "semi-markov", states: int = 7) -> pf.Skill:
    """Return a skill; kinds are flat, sphere, derivatives (flat) and joint."""
    convert = {
        "flat": lambda demo: demo,
        "sphere": to_sphere,
        "derivatives": pf.add_derivatives,
        "joint": assistance.joint_demonstration,
    }[kind]
    demos = [convert(demo) for demo in demonstrations()]
    bins = TimeBins(complete=dynamics != "mixture")
    return pf.learn(
        demos,
        states=states,
        rng=np.random.default_rng(0),
        dynamics=dynamics,
        initialisation=bins,
        settings=EMSettings(min_gain=0.5),
    ).skill


@cache
def learn_fixture(kind: str = "flat") -> assistance.VirtualFixture:
    """Return a virtual fixture of the recordings of a kind."""
    demos = [to_sphere(demo) if kind == "sphere" else demo for demo in demonstrations()]
    return assistance.learn_virtual_fixture(demos, rng=np.random.default_rng(0))


@cache
def assistant(
    kind: str = "flat", dynamics: str = "semi-markov", literal: bool = False, states: int = 7
) -> assistance.Assistant:
    joint = learn("joint") if literal else None
    skill = assistance.assisted_skill(
        learn(kind, dynamics, states), joint_skill=joint, fixture=learn_fixture(kind)
    )
    return assistance.make_assistant([skill], limits=LIMITS)


def rigid_motion(rng: np.random.Generator) -> Pose:
    return Pose(rng.normal(size=3), from_rotation_vector(rng.normal(size=3)))


def move_row(motion: Pose, x: np.ndarray) -> np.ndarray:
    """Return a row of pose and grip moved in the world."""
    moved = x.copy()
    moved[:3] = motion.position + rotation_matrix(motion.quaternion) @ x[:3]
    moved[3:7] = multiply(motion.quaternion, x[3:7])
    return moved


def run(assistant, rows, observed, actual, mode, dt=PERIOD, state=None):
    """Return the state and the targets of a sequence of hands."""
    state = state or assistance.initial_state(assistant, rows[0], observed, actual)
    targets = []
    for row in rows:
        command = assistance.Command(row, mode=mode)
        state, target = assistance.step_assistance(assistant, state, command, observed, actual, dt)
        targets.append(target)
    return state, targets
