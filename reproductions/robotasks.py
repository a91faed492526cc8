"""Four household tasks of a Franka arm as pose skills: orientations as four numbers and on S^3.

    python reproductions/robotasks.py --json robotasks.json --out robotasks/

Protocol: nine demonstrations of each task are resampled to 200 rows; those with odd numbers train, the others
test. The recordings have no objects. Frames at the first and last pose of each demonstration are ours, and
the publishers made the last poses of a task equal. K = 7 states from time bins, counted durations,
regularisation 1e-5. Covariance regularisation and control cost, below, were chosen once for both
representations. A reproduction starts from the demonstration's own first pose. The error is the root mean
square over steps and the mean over demonstrations, in metres and in degrees of the angle between
orientations.

Source: the data of Auddy et al. 2023, Robotics and Autonomous Systems 165; the task-parameterised skill of
Tanwani 2018; Zeestraten et al. 2017 for orientations on S^3.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from matplotlib.figure import Figure
from protocol import PUBLISHED, argument_parser, write_figures, write_numbers

import pilotfish as pf
from pilotfish import plots
from pilotfish.demonstrations import frame_from_pose, resample
from pilotfish.geometry import Pose, angle, normalise, rotation_matrix

TASKS = ("openbox", "bottle2shelf", "platestandingtolying", "pouring")
TREATMENTS = {"four numbers": False, "on S^3": True}
AXES = ("#BB5566", "#117733", "#6699CC")
STATES, STEPS, COVARIANCE_REGULARISATION, CONTROL_COST = 7, 200, 1e-4, 1e-2
NOTES = (
    "the recordings have no objects: frames at the first and last pose of each demonstration are ours",
    "time is nominal (the publishers resampled every demonstration to 1000 rows), and so are velocities",
    "covariance regularisation 1e-4 and control cost 1e-2, the same for both treatments, are ours",
)


@dataclass(frozen=True, slots=True, eq=False)
class Reproduction:
    """Poses of a reproduction, and its errors [m, degrees]."""

    poses: np.ndarray
    metres: float
    degrees: float


def main() -> None:
    parser = argument_parser(__doc__)
    arguments = parser.parse_args()
    try:
        demonstrations = {task: load_demonstrations(task) for task in TASKS}
    except pf.SkillError as error:
        parser.exit(1, f"{error}\n")
    rows = [table_row(task, name, demonstrations[task]) for task in TASKS for name in TREATMENTS]
    print_table(rows)
    for note in NOTES:
        print(f"note: {note}")
    if arguments.out:
        write_figures(arguments.out, {task: draw_task(task, demonstrations[task]) for task in TASKS})
        print(f"pictures in {arguments.out}")
    if arguments.json:
        write_numbers(arguments.json, {"rows": rows, "notes": NOTES})


def load_demonstrations(task: str) -> list[pf.Demonstration]:
    """Return the demonstrations of a task with frames at their ends, and derivatives."""
    return [pf.add_derivatives(with_end_frames(resample(d, STEPS))) for d in pf.datasets.robotasks(task)]


def with_end_frames(demonstration: pf.Demonstration) -> pf.Demonstration:
    ends = (("first pose", demonstration.x[0]), ("last pose", demonstration.x[-1]))
    frames = [frame_from_pose(name, demonstration.layout, Pose(x[:3], normalise(x[3:]))) for name, x in ends]
    return replace(demonstration, frames=tuple(frames))


def to_representation(demonstrations: Sequence[pf.Demonstration], sphere: bool) -> list[pf.Demonstration]:
    return (
        [pf.demonstrations.to_sphere(demonstration) for demonstration in demonstrations]
        if sphere
        else list(demonstrations)
    )


def learn_skill(demonstrations: Sequence[pf.Demonstration]) -> pf.models.Fit:
    return pf.learn(
        demonstrations,
        states=STATES,
        rng=np.random.default_rng(0),
        **PUBLISHED,
    )


def reproduce(skill: pf.Skill, demonstration: pf.Demonstration) -> Reproduction:
    """Reproduce a skill with the frames and the start of a demonstration."""
    frames = [frame for frame in demonstration.frames if isinstance(frame, pf.Frame)]
    x = pf.reproduce(
        skill,
        frames,
        demonstration.x[0],
        horizon=STEPS,
        control_cost=CONTROL_COST,
        covariance_regularisation=COVARIANCE_REGULARISATION,
        stepwise=True,
    ).motion.x
    poses = np.hstack([x[:, :3], normalise(x[:, 3:7])])
    metres = np.linalg.norm(poses[:, :3] - demonstration.x[:, :3], axis=1)
    radians = angle(poses[:, 3:], demonstration.x[:, 3:7])
    return Reproduction(poses, root_mean_square(metres), float(np.degrees(root_mean_square(radians))))


def root_mean_square(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def table_row(task: str, treatment: str, demonstrations: Sequence[pf.Demonstration]) -> dict[str, object]:
    data = to_representation(demonstrations, TREATMENTS[treatment])
    begin = time.process_time()
    fit = learn_skill(data[::2])
    spent = time.process_time() - begin
    train, test = ([reproduce(fit.skill, d) for d in part] for part in (data[::2], data[1::2]))
    row: dict[str, object] = {"task": task, "treatment": treatment}
    for name, part in (("train", train), ("test", test)):
        row[f"{name} [m]"] = float(np.mean([r.metres for r in part]))
        row[f"{name} [deg]"] = float(np.mean([r.degrees for r in part]))
    return row | {"iterations": fit.convergence.iterations, "fit [CPU s]": spent}


def print_table(rows: Sequence[dict[str, object]]) -> None:
    print("reproduction error of training and test demonstrations: positions [m], orientations [deg]")
    print(f"{'task':<22}{'orientations':<14}{'train':>9}{'':>8}{'test':>12}{'':>8}{'fit [CPU s]':>14}")
    for row in rows:
        numbers = f"{row['train [m]']:>9.4f}{row['train [deg]']:>8.2f}"
        numbers += f"{row['test [m]']:>12.4f}{row['test [deg]']:>8.2f}{row['fit [CPU s]']:>14.3f}"
        print(f"{row['task']:<22}{row['treatment']:<14}{numbers}")


def draw_task(task: str, demonstrations: Sequence[pf.Demonstration]) -> Figure:
    """Draw the path of the tool with its axes, and its rotation over time."""
    figure = Figure(figsize=(13, 5.6), layout="constrained")
    space, rotation = figure.add_subplot(1, 2, 1, projection="3d"), figure.add_subplot(1, 2, 2)
    test = len(demonstrations) // 2 | 1
    human = demonstrations[test].x
    for n, demonstration in enumerate(demonstrations):
        label = "demonstrations" if n == 0 else None
        space.plot(*demonstration.x[:, :3].T, color="0.75", linewidth=0.8, label=label)
    seconds = demonstrations[test].period * np.arange(STEPS)
    lines = {"a test demonstration": (human[:, :7], "0.2")}
    for k, (name, sphere) in enumerate(TREATMENTS.items()):
        data = to_representation(demonstrations, sphere)
        lines[f"reproduction, {name}"] = (
            reproduce(learn_skill(data[::2]).skill, data[test]).poses,
            plots.state_colour(k),
        )
    for name, (poses, colour) in lines.items():
        space.plot(*poses[:, :3].T, color=colour, linewidth=1.8, label=name)
        rotation.plot(seconds, np.degrees(angle(human[:1, 3:7], poses[:, 3:])), color=colour, label=name)
    draw_axes(space, lines["reproduction, on S^3"][0])
    space.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]", title=f"{task}: path and axes of the tool")
    limits = np.array([space.get_xlim(), space.get_ylim(), space.get_zlim()])
    space.set_box_aspect(np.ptp(limits, axis=1), zoom=0.95)  # equal scales
    space.yaxis.labelpad = 14
    space.view_init(25, -20)
    space.locator_params(nbins=3)
    space.locator_params(axis="y", nbins=6)
    rotation.set(xlabel="time [s]", ylabel="angle from the first pose [deg]", title="rotation of the tool")
    rotation.legend(loc="lower right")
    space.legend(loc="upper left", fontsize=8)
    return figure


def draw_axes(axes, poses: np.ndarray) -> None:  # type: ignore[no-untyped-def]  # 3-D axes are untyped
    """Draw the axes of the tool at every twentieth step."""
    length = 0.12 * float(np.ptp(poses[:, :3], axis=0).max())
    for n, pose in enumerate(poses[::20]):
        for axis, direction, colour in zip("xyz", rotation_matrix(pose[3:]).T, AXES, strict=True):
            ends = np.stack([pose[:3], pose[:3] + length * direction], axis=1)
            label = f"{axis} of the reproduction on S^3" if n == 0 else None
            axes.plot(*ends, color=colour, linewidth=1.2, label=label)


if __name__ == "__main__":
    main()
