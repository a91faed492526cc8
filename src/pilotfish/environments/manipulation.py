"""The tasks as Gymnasium environments: an agent asks for poses of the tool, physics tells what follows."""

from math import hypot, inf
from types import NoneType
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from pilotfish.environments.cameras import SceneRenderer, camera_view
from pilotfish.environments.tasks import TASKS, Task
from pilotfish.environments.workcell import TIMESTEP, Workcell
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
REACH = 1.6  # m: nothing that the arm can do is further away
MIN_NORM = 1e-3  # of a quaternion: a shorter one is no direction
POSE = 7
MAX_SEED = 2**64 - 1
EXPECTED = "eight finite numbers: position [m], quaternion w x y z, grip"
ObservationArrays = dict[str, Array]
# Of each thing observed: the least and the most that it can be, and how many numbers it is.
OBSERVATION_BOUNDS: dict[str, tuple[float, float, int]] = {
    "joints": (-inf, inf, 7),
    "velocities": (-inf, inf, 7),
    "tool": (-inf, inf, POSE),
    "twist": (-inf, inf, 6),
    "grip": (0.0, 1.0, 1),
    "force": (0.0, inf, 1),
}


class Manipulation(gymnasium.Env[ObservationArrays, Array]):
    """A manipulation task in situations drawn from a seed, an action every 20 ms; see TASKS for the names.

    action        position [m] and quaternion w x y z, of any length, asked of the tool in the axes of the
                  robot's torso, and the grip, 0 open to 1 shut. Springs and dampers draw the arm there, at
                  1 kHz in between
    observation   joints [rad], their velocities [rad/s], the tool's pose and twist [m/s, rad/s], the grip,
                  the force on the tool [N], and the pose of each frame of the task, in the order of its names
    reward        1 once the work is done, 0 before; an episode ends then, or is cut after the task's time
    info          "success", "error" in the task's unit, "reason" it is not done, and "peak_forces", the largest forces
                  [N] so far
    reset takes options={"situation": one of the task's own} to set up one that is known; a grip beyond 0 or 1
    is taken for the nearer.
    Raises: InvalidInput, for an unknown task, or an action that is not eight finite numbers with a quaternion
    longer than .001: the arm stays where it was.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 50}  # noqa: RUF012 - Gymnasium's own form

    def __init__(self, task: str, *, render_mode: str | None = None) -> None:
        require_type(task, "task", str, f"name one of {', '.join(sorted(TASKS))}")
        if task not in TASKS:
            raise InvalidInput(f"task is {short_repr(task)}, expected one of {', '.join(sorted(TASKS))}")
        require_type(render_mode, "render_mode", (str, NoneType), "give 'rgb_array' or None")
        if render_mode not in (None, "rgb_array"):
            raise InvalidInput(f"render_mode is {short_repr(render_mode)}, expected None or 'rgb_array'")
        self.task: Task[Any] = TASKS[task]
        self.render_mode = render_mode
        low = np.array([-REACH] * 3 + [-1.0] * 4 + [0.0])
        self.action_space = spaces.Box(low, np.array([REACH] * 3 + [1.0] * 5), dtype=np.float64)
        self.observation_space = spaces.Dict(_observation_spaces(len(self.task.frames)))  # type: ignore[assignment] # of whatever values
        self._cell: Workcell[Any] | None = None
        self._renderer: SceneRenderer | None = None

    @property
    def cell(self) -> Workcell[Any]:
        """The physics behind.    Raises: InvalidInput, before the first reset."""
        if self._cell is None:
            raise InvalidInput("the environment has no situation yet; call reset first")
        return self._cell

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[ObservationArrays, dict[str, Any]]:
        """A new situation: of the seed, of the chance that went on before, or the one given in options."""
        if seed is not None:
            require_count(seed, "seed", MAX_SEED)
        _validate_options({} if options is None else options, self.task)
        super().reset(seed=seed)
        situation = options["situation"] if options else self.task.sample_situation(self.np_random)
        self._close_camera()
        self._cell = Workcell(self.task, situation)
        return self._observation(), self._info()

    def step(self, action: Array) -> tuple[ObservationArrays, float, bool, bool, dict[str, Any]]:
        """What came of 20 ms under the action."""
        pose, grip = _parse_action(action)
        self.cell.step_impedance(pose, grip, round(PERIOD / TIMESTEP))
        info = self._info()
        done = bool(info["success"])
        return self._observation(), float(done), done, self.cell.time >= self.task.time_limit - TIMESTEP, info

    def render(self) -> Array | None:
        """A picture of the scene, (480, 640, 3); None without a render mode."""
        if self.render_mode is None:
            return None
        if self._renderer is None:
            self._renderer = SceneRenderer(self.cell.model, camera_view(self.task.name))
        return self._renderer.render(self.cell.data)

    def close(self) -> None:
        """The physics and the renderer are let go."""
        self._close_camera()
        self._cell = None

    def _close_camera(self) -> None:
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


def _observation_spaces(frames: int) -> dict[str, spaces.Space[Any]]:
    """What can be observed, where the task has so many frames."""
    boxes: dict[str, spaces.Space[Any]] = {
        name: spaces.Box(low, high, (size,), np.float64)
        for name, (low, high, size) in OBSERVATION_BOUNDS.items()
    }
    return boxes | {"frames": spaces.Box(-inf, inf, (frames, POSE), np.float64)}


def _row(pose: Pose) -> Float[Array, " 7"]:
    return np.append(pose.position, pose.quaternion)


def _validate_options(options: dict[str, Any], task: Task[Any]) -> None:
    require_type(options, "options", dict, 'give {"situation": ...} or none')
    if unknown := [key for key in options if key != "situation"]:
        raise InvalidInput(f"reset has no option {short_repr(unknown[0])}, expected 'situation' or none")
    if options:
        kind = type(task.sample_situation(np.random.default_rng(0)))
        require_type(options["situation"], "the situation", kind, f"draw one: TASKS[{task.name!r}].draw(rng)")


def _parse_action(action: Array) -> tuple[Pose, float]:
    try:
        numbers = finite_array(action, "the action", (POSE + 1,), maximum=MAX_FLOAT)
        require_bounded(numbers[:3], "the action's position")
    except InvalidInput as error:
        raise InvalidInput(f"{error}; expected {EXPECTED}") from error
    if (norm := hypot(*numbers[3:POSE])) < MIN_NORM:
        raise InvalidInput(
            f"the action's quaternion {numbers[3:POSE].tolist()} has length {norm:.4g}, expected at least "
            f"{MIN_NORM:g}; 1, 0, 0, 0 asks for no turn"
        )
    return Pose(numbers[:3], normalise(numbers[3:POSE])), float(np.clip(numbers[POSE], 0.0, 1.0))
