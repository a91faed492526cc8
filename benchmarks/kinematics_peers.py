"""Measure peers on the kinematics of a chain: `python kinematics_peers.py PROBLEM.npz` prints JSON.

It runs in the environment of peers-kinematics.txt. mink, on MuJoCo, solves inverse kinematics: steps of
dt = 1 by daqp within the joint limits, until position and angle reach the tolerance. Pinocchio computes
Jacobians. Both arms are built from the numbers in the file. Times are CPU microseconds of one call.
"""

import json
import sys
from collections.abc import Callable, Mapping
from importlib.metadata import version
from pathlib import Path
from time import process_time
from typing import Any

import mink  # type: ignore[import-not-found]
import mujoco
import numpy as np
import pinocchio  # type: ignore[import-not-found]

Problem = Mapping[str, np.ndarray]
DAMPING, STEPS = 1e-9, 200


def main() -> None:
    with np.load(Path(sys.argv[1])) as file:
        problem = dict(file)
    print(json.dumps({"mink": solve_with_mink(problem), "pin": solve_with_pinocchio(problem)}))


def microseconds(function: Callable[[], object], calls: int) -> float:
    """Return the CPU time of one call after a warm-up [us]."""
    function()
    before = process_time()
    function()
    return (process_time() - before) / calls * 1e6


def solve_with_mink(problem: Problem) -> dict[str, Any]:
    model = mujoco_arm(problem)
    configuration = mink.Configuration(model)
    task = mink.FrameTask("tool", "site", position_cost=1.0, orientation_cost=1.0)
    limits = [mink.ConfigurationLimit(model)]
    reached: list[bool] = []

    def reach(target: np.ndarray) -> bool:
        configuration.update(problem["start"])
        task.set_target(mink.SE3(np.concatenate([target[3:], target[:3]])))
        for _ in range(STEPS):
            error = task.compute_error(configuration).reshape(2, 3)
            if (np.linalg.norm(error, axis=1) < problem["exact"]).all():
                return True
            speed = mink.solve_ik(configuration, [task], 1.0, "daqp", damping=DAMPING, limits=limits)
            configuration.integrate_inplace(speed, 1.0)
        return False

    def all_targets() -> None:
        reached[:] = [reach(target) for target in problem["targets"]]

    taken = microseconds(all_targets, len(problem["targets"]))
    return {"microseconds": taken, "reached": sum(reached), "version": version("mink")}


def mujoco_arm(problem: Problem) -> mujoco.MjModel:
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    base = problem["base"]
    body = spec.worldbody.add_body(pos=base[:3], quat=base[3:])
    links = zip(problem["positions"], problem["quaternions"], problem["axes"], problem["limits"], strict=True)
    for pos, quat, axis, limits in links:
        body = body.add_body(pos=pos, quat=quat, mass=1.0, inertia=[0.01] * 3)
        body.add_joint(type=mujoco.mjtJoint.mjJNT_HINGE, axis=axis, range=limits, limited=True)
    body.add_site(name="tool", pos=problem["tool"][:3], quat=problem["tool"][3:])
    return spec.compile()


def solve_with_pinocchio(problem: Problem) -> dict[str, Any]:
    model, frame = pinocchio_arm(problem)
    data = model.createData()
    axes = pinocchio.LOCAL_WORLD_ALIGNED

    def jacobian(q: np.ndarray) -> np.ndarray:
        return np.asarray(pinocchio.computeFrameJacobian(model, data, q, frame, axes))

    def all_postures() -> None:
        for q in problem["postures"]:
            jacobian(q)

    taken = microseconds(all_postures, len(problem["postures"]))
    first = jacobian(problem["postures"][0]).ravel().tolist()
    return {"microseconds": taken, "first": first, "version": version("pin")}


def pinocchio_arm(problem: Problem) -> tuple[Any, int]:
    model, last = pinocchio.Model(), 0
    before = pose_matrix(problem["base"])
    links = zip(problem["positions"], problem["quaternions"], problem["axes"], strict=True)
    for n, (pos, quat, axis) in enumerate(links):
        placement = before * pose_matrix(np.concatenate([pos, quat]))
        last = model.addJoint(last, pinocchio.JointModelRevoluteUnaligned(axis), placement, f"joint_{n}")
        before = pinocchio.SE3.Identity()
    kind = pinocchio.FrameType.OP_FRAME
    return model, model.addFrame(pinocchio.Frame("tool", last, pose_matrix(problem["tool"]), kind))


def pose_matrix(pose: np.ndarray) -> Any:
    w, x, y, z = pose[3:]
    return pinocchio.SE3(pinocchio.Quaternion(w, x, y, z), pose[:3])


if __name__ == "__main__":
    main()
