"""Inverse kinematics and Jacobians of Baxter's right arm: pilotfish and peers on the same problem."""

import json
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from time import process_time
from typing import Any

import numpy as np
from peer_environment import environment_folder, execute, peer_environment
from problems import Floats
from workers import timed_environment

from pilotfish.control import SerialChain, inverse_kinematics
from pilotfish.environments.baxter import arm_chain, baxter_limits, solve_posture
from pilotfish.geometry import Pose
from pilotfish.kernels import ArmLimits

SCRIPT = Path(__file__).parent / "kinematics_peers.py"
EXACT = (1e-6, 1e-5)  # m, rad: convergence in pilotfish.control
TOOL_LENGTH = 0.1  # m
TARGET_DISTANCE = 0.5  # rad, largest difference of each joint from the start
START_POSE = Pose(np.array([0.62, -0.3, 0.1]), np.array([0.0, 0.0, 1.0, 0.0]))


@dataclass(frozen=True, slots=True)
class Peer:
    """CPU time of one call of pilotfish and of a peer [us]."""

    task: str
    ours: float
    name: str
    theirs: float
    remark: str


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    chain: SerialChain
    limits: ArmLimits
    start: Floats
    postures: Floats
    targets: Floats


def compare_with_peers(rounds: int, number: int) -> list[Peer]:
    """Compare on the same targets; return nothing if the peers cannot be installed."""
    python, failures = peer_environment(*environment_folder("peers-kinematics"), execute)
    if failures:
        print(failures, file=sys.stderr)
        return []
    problem = sample_problem(number)
    solving, differentiating, peers = [], [], []
    for _ in range(rounds):
        solving.append(seconds(lambda: count_converged(problem)) / number * 1e6)
        differentiating.append(seconds(lambda: jacobians(problem)) / number * 1e6)
        peers.append(run_peer(python, problem))
    mink, pin = ([turn[name] for turn in peers] for name in ("mink", "pin"))
    difference = np.abs(np.array(pin[0]["first"]) - jacobians(problem)[0].ravel()).max()
    done = f"converged of {number}: pilotfish {count_converged(problem)}, mink {mink[0]['reached']}"
    agree = f"agreement within {difference:.0e}; the controller uses MuJoCo's, in the table above"
    names = f"mink {mink[0]['version']}", f"Pinocchio {pin[0]['version']}"
    return [
        Peer("inverse kinematics", median(solving), names[0], _median(mink), done),
        Peer("Jacobian of a chain", median(differentiating), names[1], _median(pin), agree),
    ]


def _median(turns: list[dict[str, Any]]) -> float:
    return median(float(turn["microseconds"]) for turn in turns)


def seconds(function: Callable[[], object]) -> float:
    before = process_time()
    function()
    return process_time() - before


def sample_problem(number: int) -> Problem:
    chain, limits, start = (
        arm_chain("right", TOOL_LENGTH),
        baxter_limits(),
        solve_posture(START_POSE, TOOL_LENGTH),
    )
    offsets = np.random.default_rng(0).uniform(-TARGET_DISTANCE, TARGET_DISTANCE, (number, len(start)))
    postures = np.clip(start + offsets, limits.lower, limits.upper)
    return Problem(chain, limits, start, postures, chain.tool_poses(postures))


def count_converged(problem: Problem) -> int:
    poses = [Pose(row[:3], row[3:]) for row in problem.targets]
    return sum(inverse_kinematics(problem.chain, p, problem.start, problem.limits)[3] for p in poses)


def jacobians(problem: Problem) -> list[Floats]:
    return [problem.chain.jacobian(q) for q in problem.postures]


def run_peer(python: Path, problem: Problem) -> dict[str, Any]:
    chain, limits = problem.chain, problem.limits
    numbers = {
        "base": _pose_row(chain.world_from_base),
        "positions": chain.positions,
        "quaternions": chain.quaternions,
        "axes": chain.axes,
        "tool": _pose_row(chain.last_from_tool),
        "limits": np.stack([limits.lower, limits.upper], axis=1),
        "start": problem.start,
        "targets": problem.targets,
        "postures": problem.postures,
        "exact": np.array(EXACT),
    }
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "problem.npz"
        np.savez(file, **numbers)  # type: ignore[arg-type] # NumPy's stubs: a dict may hold allow_pickle
        command = [str(python), "-W", "ignore", str(SCRIPT), str(file)]
        done = subprocess.run(command, stdout=subprocess.PIPE, text=True, env=timed_environment(), check=True)
    reply: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return reply


def _pose_row(pose: Pose) -> Floats:
    return np.append(pose.position, pose.quaternion)
