"""Record and execute in Meta-World: read requests, one JSON object a line, and answer each with one line.

It runs in the suite's own environment (metaworld-constraints.txt), because the suite needs another MuJoCo,
and it does not import pilotfish. metaworld.py starts `python -P metaworld_suite.py`; -P keeps that file from
hiding the package of the same name. Requests:

    {"do": "list"}
    {"do": "record", "task": NAME, "draw": N, "demonstrations": N, "situations": N, "file": PATH}
    {"do": "execute", "task": NAME, "seeds": [...], "file": PATH}    file: commands_0, commands_1, ... [T, 4]

A command is the commanded position of the hand [m] and the command of the gripper, one row per step of the
suite (80 Hz). The suite's action is a change of position: at execution it is the difference between the
command and the commanded position so far, divided by the suite's scale and limited to [-1, 1].
"""

import json
import sys
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

STEPS_WITH_SUCCESS = 12  # consecutive steps, after which an episode of the expert ends
STEPS_AT_END = 40  # half a second, for which the last command is held
LAST_STEP = 500  # the suite's limit of an episode
EXPERT_ATTEMPTS = 10  # situations for each demonstration, before a task is given up
SEEDS_PER_DRAW = 10_000  # demonstrations have the first seeds of a draw, new situations the second half
OBJECT = slice(4, 7)  # columns of an observation


@dataclass(frozen=True)
class Episode:
    """An episode of the expert.

    Attributes:
        seed: Seed of the situation.
        commands: Commanded position of the hand and command of the gripper, per step.
        hand: Commanded position of the hand at the start.
        object: Position of the object at the start.
        goal: Position of the goal at the start.
        succeeded: Whether the suite reported success at any step.
    """

    seed: int
    commands: np.ndarray
    hand: np.ndarray
    object: np.ndarray
    goal: np.ndarray
    succeeded: bool


def main() -> None:
    """Answer requests until the input ends."""
    environments: dict[str, Any] = {}
    for line in sys.stdin:
        request = json.loads(line)
        if request["do"] == "list":
            answer: dict[str, Any] = {"tasks": list(import_module("metaworld.env_dict").ENV_CLS_MAP)}
        else:
            task = request["task"]
            if task not in environments:
                environments.clear()
                environments[task] = make_environment(task)
            answer = ANSWERS[request["do"]](environments[task], request)
        print(json.dumps(answer), flush=True)


def make_environment(task: str) -> Any:
    """Return the environment of a task, whose goal is observed and whose situation changes with the seed."""
    environment = import_module("metaworld.env_dict").ENV_CLS_MAP[task]()
    environment._partially_observable = False
    del environment.sawyer_observation_space  # cached for a hidden goal
    environment._freeze_rand_vec = False
    environment.seeded_rand_vec = True
    environment._set_task_called = True
    return environment


def reset(environment: Any, seed: int) -> np.ndarray:
    """Begin the situation of a seed and return the first observation."""
    environment.seed(seed)
    environment._did_see_sim_exception = False
    return np.array(environment.reset()[0])


def run_expert(environment: Any, task: str, seed: int) -> Episode:
    """Execute the scripted expert until success has held for a while."""
    policy = import_module("metaworld.policies").ENV_POLICY_MAP[task]()
    observation = reset(environment, seed)
    hand, goal = environment.data.mocap_pos[0].copy(), np.array(environment._target_pos, dtype=float)
    start, held, succeeded = observation[OBJECT].copy(), 0, False
    commands: list[list[float]] = []
    while held < STEPS_WITH_SUCCESS and len(commands) < LAST_STEP:
        action = policy.get_action(observation)
        observation, _, _, _, info = environment.step(action)
        commands.append([*environment.data.mocap_pos[0], action[3]])
        held = held + 1 if info["success"] else 0
        succeeded |= bool(info["success"])
    return Episode(seed, np.array(commands, dtype=float), hand, start, goal, succeeded)


def execute_commands(environment: Any, commands: np.ndarray, seed: int) -> bool:
    """Execute commands in the situation of a seed and return whether the suite reported success."""
    reset(environment, seed)
    held = np.repeat(commands[-1:], STEPS_AT_END, axis=0)
    for command in np.concatenate([commands, held])[:LAST_STEP]:
        change = (command[:3] - environment.data.mocap_pos[0]) / environment.action_scale
        action = np.append(np.clip(change, -1.0, 1.0), command[3])
        if environment.step(action)[4]["success"]:
            return True
    return False


def record(environment: Any, request: dict[str, Any]) -> dict[str, Any]:
    """Record demonstrations that succeed, and the expert in new situations, in a file."""
    task, first = request["task"], request["draw"] * SEEDS_PER_DRAW
    demonstrations: list[Episode] = []
    attempts = EXPERT_ATTEMPTS * request["demonstrations"]
    for seed in range(first, first + attempts):
        episode = run_expert(environment, task, seed)
        if episode.succeeded:
            demonstrations.append(episode)
        if len(demonstrations) == request["demonstrations"]:
            break
    else:
        return {"error": f"the expert of {task} succeeds in {len(demonstrations)} of {attempts} situations"}
    second = first + SEEDS_PER_DRAW // 2
    seeds = range(second, second + request["situations"])
    save_episodes(Path(request["file"]), demonstrations, [run_expert(environment, task, s) for s in seeds])
    return {"error": ""}


def save_episodes(file: Path, demonstrations: list[Episode], situations: list[Episode]) -> None:
    """Write episodes to an .npz file: one array per field, and one per sequence of commands."""
    arrays: dict[str, Any] = {}
    for name, episodes in (("demonstration", demonstrations), ("situation", situations)):
        for field in ("seed", "hand", "object", "goal", "succeeded"):
            arrays[f"{name}_{field}"] = np.array([getattr(episode, field) for episode in episodes])
        for number, episode in enumerate(episodes):
            arrays[f"{name}_commands_{number}"] = episode.commands
    file.parent.mkdir(parents=True, exist_ok=True)
    whole = file.with_suffix(".part.npz")
    np.savez_compressed(whole, **arrays)
    whole.replace(file)


def execute(environment: Any, request: dict[str, Any]) -> dict[str, Any]:
    """Execute commands from a file and return the successes."""
    with np.load(request["file"]) as file:
        commands = [file[f"commands_{number}"] for number in range(len(request["seeds"]))]
    pairs = zip(commands, request["seeds"], strict=True)
    return {"succeeded": [execute_commands(environment, rows, seed) for rows, seed in pairs]}


ANSWERS: dict[str, Callable[[Any, dict[str, Any]], dict[str, Any]]] = {"record": record, "execute": execute}

if __name__ == "__main__":
    main()
