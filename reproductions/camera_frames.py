"""Frames from a simulated camera: accuracy of the poses of markers, and skills performed from these frames.

    python reproductions/camera_frames.py --skills skills/ --json camera_frames.json

The skills are made at the defaults: `pilotfish record valve --demonstrations 4 --seed 0 --out valve`, then
`pilotfish learn valve --out skills/valve.skill`, and so on for each task.

Accuracy: a marker of 50 mm, or a board of four, 0.95 to 1.05 m from a camera with 1100 pixels of focal length
and 1280 x 960 pixels, tilted by up to 60 degrees about any axis and rotated by any angle. The image is
rendered by MuJoCo without smoothing of edges. "clear" adds noise of 2 grey levels, "poor" blurs by 1 pixel
and adds noise of 8. "calibration" has noise of 2 and a focal length that is wrong by 0.5 %.

Tasks: each skill is performed in the same situations from the true frames and from those of the camera, whose
images have noise of 2 grey levels.

Source: Tanwani 2018, section 5.7.2, where the pose of a valve is tracked by a marker.
"""

import argparse
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import mujoco
import numpy as np
from protocol import argument_parser, write_numbers
from tqdm import tqdm

import pilotfish as pf
from pilotfish.environments import (
    TASKS,
    FixedCamera,
    FixedCameraRenderer,
    PrintedMarker,
    add_camera,
    add_markers,
)
from pilotfish.geometry import Pose, angle, from_rotation_vector, multiply
from pilotfish.simulation import (
    CameraSimulation,
    calibration,
    perform,
    perform_from_camera,
    situation_from_seed,
)
from pilotfish.types import Array, Float, UInt8
from pilotfish.vision import DEFAULT_DICTIONARY, Camera, Marker, detect_markers, estimate_pose, marker_bitmap

IDENTITY = Pose(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]))
CAMERA = FixedCamera(IDENTITY, 1100.0)
SIDE, SPACING = 0.05, 0.06  # m: side of a marker, half of the distance between two of the board
BOARDS = {"one marker": ((0.0, 0.0),), "board of four": ((-1.0, 1.0), (1.0, 1.0), (1.0, -1.0), (-1.0, -1.0))}
# Standard deviations of the noise [grey levels] and of the blur [pixels], and the factor of the focal length.
CONDITIONS = {"clear": (2.0, 0.0, 1.0), "poor": (8.0, 1.0, 1.0), "calibration": (2.0, 0.0, 1.005)}
MAX_TILT, DISTANCES = np.radians(60.0), (0.95, 1.05)
TASK_NAMES = ("valve", "plate", "stab", "screwdriver")


@dataclass(frozen=True, slots=True)
class AccuracyRow:
    """Errors of the pose of one frame under one condition."""

    markers: str
    condition: str
    poses: int
    found: int
    position_median: float
    position_95: float
    angle_median: float
    angle_95: float
    reprojection_median: float


@dataclass(frozen=True, slots=True)
class TaskRow:
    """Successes of one task with true frames and with those of the camera."""

    task: str
    situations: int
    true_frames: int
    camera_frames: int
    position_median: float
    position_largest: float
    angle_median: float
    angle_largest: float
    images: int
    failures: dict[int, str]


def main() -> None:
    parser = argument_parser(__doc__)
    parser.add_argument("--skills", type=Path, required=True, help="folder of TASK.skill files")
    parser.add_argument("--poses", type=int, default=200, help="number of random poses")
    parser.add_argument("--situations", type=int, default=20, help="number of situations of each task")
    parser.add_argument("--tasks", nargs="*", default=list(TASK_NAMES), help="names of tasks")
    arguments = parser.parse_args()
    accuracy = [row for markers in BOARDS for row in measure_accuracy(markers, arguments.poses)]
    print_accuracy(accuracy)
    tasks = list(measure_tasks(arguments))
    if arguments.json:
        numbers = {
            "accuracy": [row_to_json(row) for row in accuracy],
            "tasks": [row_to_json(row) for row in tasks],
        }
        write_numbers(arguments.json, numbers)


def row_to_json(row: AccuracyRow | TaskRow) -> dict[str, Any]:
    return {name: getattr(row, name) for name in row.__slots__}


def random_pose(rng: np.random.Generator) -> Pose:
    """Return the pose of a marker in camera axes, facing the camera within 60 degrees."""
    direction = np.array([rng.uniform(-0.35, 0.35), rng.uniform(-0.25, 0.25), 1.0])
    position = rng.uniform(*DISTANCES) * direction / np.linalg.norm(direction)
    axis = rng.uniform(-np.pi, np.pi)
    tilt = from_rotation_vector(rng.uniform(0.0, MAX_TILT) * np.array([np.cos(axis), np.sin(axis), 0.0]))
    turn = from_rotation_vector(np.array([0.0, 0.0, rng.uniform(-np.pi, np.pi)]))
    facing = np.array([0.0, 1.0, 0.0, 0.0])  # half a turn about x: z towards the camera
    return Pose(position, multiply(tilt, multiply(facing, turn)))


def board_model(places: tuple[tuple[float, float], ...]) -> tuple[mujoco.MjModel, tuple[Marker, ...]]:
    """Return a model with a movable board of markers, and what an estimator knows about it."""
    spec = mujoco.MjSpec()
    spec.visual.quality.offsamples, spec.visual.map.znear = 0, 0.01
    for aim in ((0.0, 0.3, 1.0), (0.3, -0.2, 1.0)):
        light = spec.worldbody.add_light(dir=aim, diffuse=[0.5] * 3, castshadow=False)
        light.type = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
    spec.worldbody.add_body(name="board", mocap=True)
    poses = [Pose(SPACING * np.array([x, y, 0.0]), IDENTITY.quaternion) for x, y in places]
    pictures = [
        np.pad(marker_bitmap(DEFAULT_DICTIONARY, n), 16, constant_values=255) for n in range(len(poses))
    ]
    add_markers(
        spec,
        [
            PrintedMarker(f"marker_{n}", "board", pose, 1.25 * SIDE, pictures[n])
            for n, pose in enumerate(poses)
        ],
    )
    add_camera(spec, CAMERA)
    return spec.compile(), tuple(Marker(n, SIDE, "board", pose.inverse()) for n, pose in enumerate(poses))


def measure_accuracy(markers: str, n_poses: int) -> Iterator[AccuracyRow]:
    """Yield the errors under each condition, in the same poses."""
    model, known = board_model(BOARDS[markers])
    data, rng = mujoco.MjData(model), np.random.default_rng(0)
    errors: dict[str, list[tuple[float, float, float]]] = {name: [] for name in CONDITIONS}
    with FixedCameraRenderer(model, CAMERA) as renderer:
        for _ in tqdm(range(n_poses), markers, leave=False, disable=not sys.stderr.isatty()):
            true = random_pose(rng)
            data.mocap_pos[0], data.mocap_quat[0] = true.position, true.quaternion
            mujoco.mj_forward(model, data)
            image = renderer.render(data)[:, :, ::-1]
            for name, (noise, blur, factor) in CONDITIONS.items():
                camera = scaled_camera(factor)
                detected = detect_markers(degrade(image, noise, blur, rng), DEFAULT_DICTIONARY)
                if found := estimate_pose(camera, known, detected.corners):
                    errors[name].append((*pose_errors(found[0].camera_from_frame, true), found[0].error))
    for name, rows in errors.items():
        yield AccuracyRow(markers, name, n_poses, len(rows), *summarise_errors(np.array(rows)))


def summarise_errors(rows: Float[Array, "N 3"]) -> tuple[float, float, float, float, float]:
    """Return median and 95 % quantile of position [mm] and angle [degrees], and the median in pixels."""
    median, most = np.quantile(rows, [0.5, 0.95], axis=0)
    return float(median[0]), float(most[0]), float(median[1]), float(most[1]), float(median[2])


def scaled_camera(factor: float) -> Camera:
    """Return the calibration with a focal length that is wrong by a factor."""
    exact = calibration(CAMERA)
    f = factor * exact.fx
    return Camera(exact.width, exact.height, f, f, exact.cx, exact.cy)


def degrade(
    image: UInt8[Array, "H W 3"], noise: float, blur: float, rng: np.random.Generator
) -> UInt8[Array, "H W 3"]:
    """Return a blurred image with noise."""
    blurred = cv2.GaussianBlur(image, (0, 0), blur) if blur else image
    return np.clip(blurred + rng.normal(0.0, noise, image.shape), 0.0, 255.0).astype(np.uint8)


def pose_errors(estimate: Pose, true: Pose) -> tuple[float, float]:
    """Return the errors of position [mm] and orientation [degrees]."""
    distance = 1e3 * float(np.linalg.norm(estimate.position - true.position))
    return distance, float(np.degrees(angle(estimate.quaternion, true.quaternion)))


def print_accuracy(rows: list[AccuracyRow]) -> None:
    print("markers        condition    found     position [mm]    orientation [deg]  reprojection [px]")
    print("                                      median    95 %    median    95 %     median")
    for row in rows:
        print(
            f"{row.markers:<14} {row.condition:<11} {row.found:>4}/{row.poses:<4} "
            f"{row.position_median:8.2f} {row.position_95:8.2f}  {row.angle_median:8.3f} {row.angle_95:8.3f}"
            f"  {row.reprojection_median:8.3f}",
            flush=True,
        )


def measure_tasks(arguments: argparse.Namespace) -> Iterator[TaskRow]:
    """Yield and print the successes of each task."""
    print("task         true frames  camera   position [mm], largest   orientation [deg], largest")
    for name in arguments.tasks:
        row = measure_task(name, pf.open_skill(arguments.skills / f"{name}.skill"), arguments.situations)
        print(
            f"{name:<12} {row.true_frames:>5} of {row.situations:<3} {row.camera_frames:>5} of "
            f"{row.situations:<3} {row.position_median:8.2f} {row.position_largest:8.2f} "
            f"{row.angle_median:10.3f} {row.angle_largest:8.3f}",
            *(f"\n  situation {number}: {reason}" for number, reason in row.failures.items()),
            flush=True,
        )
        yield row


def measure_task(name: str, skill: pf.Skill, situations: int) -> TaskRow:
    """Perform a skill from true frames and from those of the camera."""
    task = TASKS[name]
    errors: list[tuple[float, float]] = []
    by_truth = by_camera = images = 0
    failures: dict[int, str] = {}
    for number in tqdm(range(situations), name, leave=False, disable=not sys.stderr.isatty()):
        situation = situation_from_seed(task, "test", 0, number)
        by_truth += perform(skill, task, situation).outcome.success
        result = perform_from_camera(skill, task, situation, simulation=CameraSimulation(seed=number))
        execution = result.execution
        by_camera += execution.outcome.success
        images += result.images
        errors += [pose_errors(execution.frames[n], true) for n, true in result.true_frames.items()]
        if not execution.outcome.success:
            failures[number] = execution.failure.detail if execution.failure else execution.outcome.reason
    median, largest = np.median(errors, axis=0), np.max(errors, axis=0)
    return TaskRow(
        name,
        situations,
        by_truth,
        by_camera,
        float(median[0]),
        float(largest[0]),
        float(median[1]),
        float(largest[1]),
        images,
        failures,
    )


if __name__ == "__main__":
    main()
