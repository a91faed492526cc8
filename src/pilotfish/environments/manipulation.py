"""Tasks as Gymnasium environments: an action is a tool pose, and physics gives the next observation."""

from math import hypot, inf
from types import NoneType
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from pilotfish.environments.robots import ROBOTS, Robot
from pilotfish.environments.scene_renderer import SceneRenderer
from pilotfish.environments.tasks.registry import TASKS
from pilotfish.environments.tasks.task import Task
from pilotfish.environments.workcell import Workcell
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, normalise
from pilotfish.types import Array, Float
from pilotfish.validation import (
    MAX_FLOAT,
    finite_array,
    require_bounded,
    require_count,
    require_type,
    short_repr,
)

PERIOD = 0.02  # s between actions
REACH = 1.6  # m, beyond the reach of the arm
MIN_NORM = 1e-3  # of a quaternion, which is normalised
POSE = 7
MAX_SEED = 2**64 - 1
EXPECTED = "eight finite numbers: position [m], quaternion w x y z, grip"
ObservationArrays = dict[str, Array]
# Minimum, maximum and size of each entry of an observation.
OBSERVATION_BOUNDS: dict[str, tuple[float, float, int]] = {
    "tool": (-inf, inf, POSE),
    "twist": (-inf, inf, 6),
    "grip": (0.0, 1.0, 1),
    "force": (0.0, inf, 1),
}


class Manipulation(gymnasium.Env[ObservationArrays, Array]):
    """Manipulation task with an action every 20 ms, by any robot.

    An action holds the tool position [m], a quaternion w x y z of any length, both in torso axes, and the
    grip, 0 (open) to 1 (closed). Impedance control draws the tool there at 1 kHz.

    An observation is a dictionary: "joints" [rad], "velocities" [rad/s], "tool" pose, "twist" [m/s, rad/s],
    "grip", "force" on the tool [N], and "frames", the poses of the task's frames in their order.

    The reward is 1 when the task is done, and 0 before. An episode terminates then, and is truncated at the
    task's time limit. The info dictionary holds "success", "error" in the task's unit, "reason", the reason
    why the task is not done, and "peak_forces" [N].

    Attributes:
        task: Task of the environment.
        robot: Robot that performs it.
        render_mode: "rgb_array" or None.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 50}  # noqa: RUF012 - Gymnasium's own form

    def __init__(self, task: str, *, render_mode: str | None = None, robot: str | Robot = "baxter") -> None:
        """Choose a task; `reset` builds its physics.

        Args:
            task: Name of a task in `TASKS`.
            render_mode: "rgb_array" for images from `render`, or None.
            robot: Name of a robot in `ROBOTS`, or a robot, such as one from `robot_from_file`.

        Raises:
            InvalidInput: If the task, the render mode or the robot is unknown.
        """
        require_type(task, "task", str, f"give the name of a task: {', '.join(sorted(TASKS))}")
        if task not in TASKS:
            raise InvalidInput(f"task is {short_repr(task)}, expected one of {', '.join(sorted(TASKS))}")
        require_type(render_mode, "render_mode", (str, NoneType), "give 'rgb_array' or None")
        if render_mode not in (None, "rgb_array"):
            raise InvalidInput(f"render_mode is {short_repr(render_mode)}, expected None or 'rgb_array'")
        self.task: Task[Any] = TASKS[task]
        self.robot = _find_robot(robot)
        self.render_mode = render_mode
        low = np.array([-REACH] * 3 + [-1.0] * 4 + [0.0])
        self.action_space = spaces.Box(low, np.array([REACH] * 3 + [1.0] * 5), dtype=np.float64)
        self.observation_space = spaces.Dict(
            _observation_spaces(len(self.task.frames), len(self.robot.joint_names))
        )  # type: ignore[assignment] # the base class names no value type
        self._cell: Workcell[Any] | None = None
        self._renderer: SceneRenderer | None = None

    @property
    def cell(self) -> Workcell[Any]:
        """Return the simulation of this episode.

        Raises:
            InvalidInput: If `reset` was not called.
        """
        if self._cell is None:
            raise InvalidInput("the environment has no situation; call reset first")
        return self._cell

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[ObservationArrays, dict[str, Any]]:
        """Start an episode in a new situation.

        Args:
            seed: Seed of the situations; None continues with the generator of the last seed.
            options: {"situation": situation of the task} to choose one, or None to sample one.

        Returns:
            The first observation and the info dictionary.

        Raises:
            InvalidInput: If the seed or the options cannot be used.
        """
        if seed is not None:
            require_count(seed, "seed", MAX_SEED)
        _validate_options({} if options is None else options, self.task)
        super().reset(seed=seed)
        situation = options["situation"] if options else self.task.sample_situation(self.np_random)
        self._close_renderer()
        self._cell = Workcell(self.task, situation, robot=self.robot)
        return self._observation(), self._info()

    def step(self, action: Array) -> tuple[ObservationArrays, float, bool, bool, dict[str, Any]]:
        """Simulate 20 ms under an action.

        Args:
            action: Position [m], quaternion w x y z, grip; a grip outside 0 to 1 is clipped.

        Returns:
            Observation, reward, terminated, truncated and info dictionary.

        Raises:
            InvalidInput: If the action is not eight finite numbers with a quaternion of length .001 or more;
                the simulation is then unchanged.
        """
        pose, grip = _parse_action(action)
        self.cell.step_impedance(pose, grip, round(PERIOD / Workcell.timestep))
        info = self._info()
        done = bool(info["success"])
        truncated = self.cell.time >= self.task.time_limit - Workcell.timestep
        return self._observation(), float(done), done, truncated, info

    def render(self) -> Array | None:
        """Return an RGB image of the scene, 480 x 640 x 3; None without a render mode."""
        if self.render_mode is None:
            return None
        if self._renderer is None:
            self._renderer = SceneRenderer(self.cell.model, self.task.view)
        return self._renderer.render(self.cell.data)

    def close(self) -> None:
        """Release the simulation and the renderer."""
        self._close_renderer()
        self._cell = None

    def _close_renderer(self) -> None:
        if self._renderer is not None:
            self._renderer.close()
            self._renderer = None

    def _observation(self) -> ObservationArrays:
        cell = self.cell
        poses = cell.frames()
        return {
            "joints": cell.arm.q.copy(),
            "velocities": cell.arm.velocity.copy(),
            "tool": _row(cell.arm.tool),
            "twist": cell.arm.twist,
            "grip": np.array([cell.grip]),
            "force": np.array([cell.forces["tool"]]),
            "frames": np.stack([_row(poses[name]) for name in self.task.frames]),
        }

    def _info(self) -> dict[str, Any]:
        outcome = self.cell.outcome()
        return {
            "success": outcome.success,
            "error": outcome.error,
            "reason": outcome.reason,
            "peak_forces": dict(self.cell.peak_forces),
        }


def _find_robot(robot: str | Robot) -> Robot:
    require_type(robot, "robot", (str, Robot), f"give one of {', '.join(ROBOTS)}, or a Robot")
    if isinstance(robot, Robot):
        return robot
    if robot not in ROBOTS:
        raise InvalidInput(f"robot is {short_repr(robot)}, expected one of {', '.join(ROBOTS)}")
    return ROBOTS[robot]


def _observation_spaces(n_frames: int, n_joints: int) -> dict[str, spaces.Space[Any]]:
    boxes: dict[str, spaces.Space[Any]] = {
        name: spaces.Box(low, high, (size,), np.float64)
        for name, (low, high, size) in OBSERVATION_BOUNDS.items()
    }
    for name in ("joints", "velocities"):
        boxes[name] = spaces.Box(-inf, inf, (n_joints,), np.float64)
    return boxes | {"frames": spaces.Box(-inf, inf, (n_frames, POSE), np.float64)}


def _row(pose: Pose) -> Float[Array, " 7"]:
    return np.append(pose.position, pose.quaternion)


def _validate_options(options: dict[str, Any], task: Task[Any]) -> None:
    require_type(options, "options", dict, 'give {"situation": ...} or none')
    if unknown := [key for key in options if key != "situation"]:
        raise InvalidInput(f"reset has no option {short_repr(unknown[0])}, expected 'situation' only")
    if options:
        kind = type(task.sample_situation(np.random.default_rng(0)))
        require_type(
            options["situation"],
            "the situation",
            kind,
            f"sample one: TASKS[{task.name!r}].sample_situation(rng)",
        )


def _parse_action(action: Array) -> tuple[Pose, float]:
    try:
        numbers = finite_array(action, "the action", (POSE + 1,), maximum=MAX_FLOAT)
        require_bounded(numbers[:3], "the action's position")
    except InvalidInput as error:
        raise InvalidInput(f"{error}; expected {EXPECTED}") from error
    if (norm := hypot(*numbers[3:POSE])) < MIN_NORM:
        raise InvalidInput(
            f"the action's quaternion {numbers[3:POSE].tolist()} has length {norm:.4g}, expected at least "
            f"{MIN_NORM:g}; the identity is 1, 0, 0, 0"
        )
    return Pose(numbers[:3], normalise(numbers[3:POSE])), float(np.clip(numbers[POSE], 0.0, 1.0))
