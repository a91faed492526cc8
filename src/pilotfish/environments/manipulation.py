"""The tasks as Gymnasium environments: an agent asks for poses of the tool, physics tells what comes of them."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from pilotfish.environments.cameras import Photographer, view_of
from pilotfish.environments.tasks import TASKS, Task
from pilotfish.environments.workcell import TICK, Workcell
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose
from pilotfish.types import Array, Float

PERIOD = 0.02  # s between actions
REACH = 1.6  # m: nothing that the arm can do is further away
NORM_TOLERANCE = 1e-3
POSE = 7
Observation = dict[str, Array]
SHAPES: dict[str, tuple[int, ...]] = {
    "joints": (7,),
    "velocities": (7,),
    "tool": (POSE,),
    "twist": (6,),
    "grip": (1,),
    "force": (1,),
}


class Manipulation(gymnasium.Env[Observation, Array]):
    """A manipulation task in situations drawn from a seed, an action every 20 ms; see TASKS for the names.

    action        position [m] and quaternion w x y z asked of the tool, in the axes of the robot's torso, and
                  the grip, 0 open to 1 shut. Springs and dampers draw the arm there, at 1 kHz in between
    observation   joints [rad], their velocities [rad/s], the tool's pose and twist [m/s, rad/s], the grip,
                  the force on the tool [N], and the pose of each frame of the task, in the order of its names
    reward        1 once the work is done, 0 before; an episode ends then, or is cut after the task's time
    info          "success", "error" in the task's unit, "why" it is not done, and the largest force "peaks" [N]
    reset takes options={"situation": one of the task's own} to set up one that is known.
    Raises: InvalidInput, for an unknown task, or an action that is not eight finite numbers with a unit
    quaternion (within .001): the arm stays where it was.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 50}  # noqa: RUF012 - Gymnasium's own form

    def __init__(self, task: str, *, render_mode: str | None = None) -> None:
        if task not in TASKS:
            raise InvalidInput(f"task is {task!r}, expected one of {', '.join(sorted(TASKS))}")
        if render_mode not in (None, "rgb_array"):
            raise InvalidInput(f"render_mode is {render_mode!r}, expected None or 'rgb_array'")
        self.task: Task[Any] = TASKS[task]
        self.render_mode = render_mode
        low = np.array([-REACH] * 3 + [-1.0] * 4 + [0.0])
        self.action_space = spaces.Box(low, np.array([REACH] * 3 + [1.0] * 5), dtype=np.float64)
        shapes = SHAPES | {"frames": (len(self.task.frames), POSE)}
        self.observation_space = spaces.Dict(  # type: ignore[assignment] # whatever its values are
            {name: spaces.Box(-np.inf, np.inf, shape, np.float64) for name, shape in shapes.items()}
        )
        self._cell: Workcell[Any] | None = None
        self._photographer: Photographer | None = None

    @property
    def cell(self) -> Workcell[Any]:
        """The physics behind.    Raises: InvalidInput, before the first reset."""
        if self._cell is None:
            raise InvalidInput("the environment has no situation yet; call reset first")
        return self._cell

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """A new situation: of the seed, of the chance that went on before, or the one given in options."""
        super().reset(seed=seed)
        given = (options or {}).get("situation")
        self._forget_pictures()
        self._cell = Workcell(self.task, self.task.draw(self.np_random) if given is None else given)
        return self._observation(), self._info()

    def step(self, action: Array) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """What came of 20 ms under the action."""
        pose, grip = _asked(action)
        self.cell.follow(pose, grip, round(PERIOD / TICK))
        info = self._info()
        done = bool(info["success"])
        return self._observation(), float(done), done, self.cell.time >= self.task.seconds - TICK, info

    def render(self) -> Array | None:
        """A picture of the scene, (480, 640, 3); None without a render mode."""
        if self.render_mode is None:
            return None
        if self._photographer is None:
            self._photographer = Photographer(self.cell.model, view_of(self.task.name))
        return self._photographer.photograph(self.cell.data)

    def close(self) -> None:
        """The physics and the renderer are let go."""
        self._forget_pictures()
        self._cell = None

    def _forget_pictures(self) -> None:
        if self._photographer is not None:
            self._photographer.close()
            self._photographer = None

    def _observation(self) -> Observation:
        cell = self.cell
        seen = cell.frames()
        return {
            "joints": cell.arm.q.copy(),
            "velocities": cell.arm.velocity.copy(),
            "tool": _row(cell.arm.tool),
            "twist": cell.arm.twist,
            "grip": np.array([cell.grip]),
            "force": np.array([cell.forces["tool"]]),
            "frames": np.stack([_row(seen[name]) for name in self.task.frames]),
        }

    def _info(self) -> dict[str, Any]:
        verdict = self.cell.verdict()
        return {
            "success": verdict.success,
            "error": verdict.error,
            "why": verdict.why,
            "peaks": dict(self.cell.peaks),
        }


def _row(pose: Pose) -> Float[Array, " 7"]:
    return np.append(pose.position, pose.quaternion)


def _asked(action: Array) -> tuple[Pose, float]:
    numbers = np.asarray(action, dtype=np.float64)
    if numbers.shape != (POSE + 1,) or not np.isfinite(numbers).all():
        raise InvalidInput(
            f"the action is {numbers.tolist()}, expected eight finite numbers: position [m], quaternion w x y "
            "z, grip"
        )
    norm = float(np.linalg.norm(numbers[3:POSE]))
    if abs(norm - 1.0) > NORM_TOLERANCE:
        raise InvalidInput(
            f"the action's quaternion {numbers[3:POSE].tolist()} has norm {norm:.4g}, expected 1 within "
            f"{NORM_TOLERANCE:g}; divide it by its norm"
        )
    return Pose(numbers[:3], numbers[3:POSE] / norm), float(np.clip(numbers[POSE], 0.0, 1.0))
