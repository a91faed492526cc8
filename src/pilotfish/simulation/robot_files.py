"""Robots by name or from a file in URDF or MJCF."""

import csv
from pathlib import Path

import numpy as np

from pilotfish.environments.robots import ROBOTS, JointTrajectory, Robot, robot_from_description
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose
from pilotfish.io import atomic_file, path_exists, read_file
from pilotfish.validation import require_type, short_repr

EXPECTED = "a robot in URDF or MJCF"
SUFFIXES = (".urdf", ".xml", ".mjcf")
MAX_BYTES = 4_000_000  # of one file; meshes are not read


def find_robot(name: str, *, end_effector: str | None = None) -> Robot:
    """Return a robot by its name, or read it from a file.

    Args:
        name: Key of `ROBOTS`, or a file in URDF or MJCF.
        end_effector: As `robot_from_file`.

    Raises:
        InvalidInput: If no robot has this name, the file cannot be used, or end_effector is given without
            a file.
    """
    if name in ROBOTS:
        if end_effector is not None:
            raise InvalidInput(
                f"end_effector is {short_repr(end_effector)}, but the robot {name} needs none; leave it out"
            )
        return ROBOTS[name]
    if Path(name).suffix.lower() not in SUFFIXES and not path_exists(Path(name)):
        raise InvalidInput(
            f"robot {short_repr(name)} is unknown, expected {', '.join(ROBOTS)} or a file "
            f"({', '.join(SUFFIXES)})"
        )
    return robot_from_file(name, end_effector=end_effector)


def robot_from_file(path: str | Path, *, end_effector: str | None = None, base: Pose | None = None) -> Robot:
    """Return the robot that a URDF or MJCF file describes: a serial arm of hinge joints.

    Kinematics, masses, inertias, limits and torque limits are those of the file. Shapes are capsules between
    the joints: meshes are neither needed nor read. What is attached beyond the end effector, such as a
    gripper, is left out, because each task mounts its own tool. Files that the file includes are read from
    its folder.

    Args:
        path: File in URDF (.urdf) or MJCF (.xml).
        end_effector: Link, body or site on which tools are mounted, pointing along its z axis; None for the
            only end of the chain.
        base: Pose of the file's world in torso axes; None for a place before the objects of the tasks.

    Raises:
        InvalidInput: If the file cannot be read, does not describe a serial arm, or lacks limits or masses.
    """
    file = Path(path)
    data = read_file(file, EXPECTED, MAX_BYTES)

    def read_included(name: str) -> bytes:
        included = (file.parent / name).resolve()
        if not included.is_relative_to(file.parent.resolve()):
            raise InvalidInput(
                f"{file} includes {short_repr(name)}, which is outside its folder; copy it into {file.parent}"
            )
        return read_file(included, EXPECTED, MAX_BYTES)

    return robot_from_description(
        data, name=str(file), end_effector=end_effector, base=base, read_included=read_included
    )


def write_joint_trajectory(trajectory: JointTrajectory, path: str | Path, *, overwrite: bool = False) -> None:
    """Write the motion of joints as a CSV file: a header, then time, positions and velocities of each sample.

    Args:
        trajectory: Motion, from `joint_trajectory`.
        path: File to write; it is complete or absent at every moment.
        overwrite: Whether an existing file may be replaced.

    Raises:
        InvalidInput: If the file exists and may not be replaced, or cannot be written.
    """
    require_type(trajectory, "trajectory", JointTrajectory, "joint_trajectory(...) returns one")
    names = trajectory.joint_names
    header = ["time [s]", *(f"{name} [rad]" for name in names), *(f"{name} [rad/s]" for name in names)]
    table = np.column_stack([trajectory.times, trajectory.q, trajectory.velocity])
    with (
        atomic_file(path, overwrite=overwrite) as file,
        file.open("w", encoding="utf-8", newline="") as stream,
    ):
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(header)
        writer.writerows([f"{value:.9g}" for value in row] for row in table.tolist())
