"""Four household tasks of a Franka arm as skills of poses: quaternions as four numbers against points of S^3.

    python reproductions/robotasks.py --json robotasks.json --out robotasks/

Protocol: of nine showings of each task, resampled to 200 rows, those of odd number train and those of even
number test. The recordings come without objects: frames at the first and the last pose of each showing are
ours, and the publishers made the last poses of a task equal. K = 7 states beginning with time bins, counted
durations, regularisation 1e-5, Q = (Sigma + slack I)^-1 with the slack and the effort R below, chosen once
for both treatments. The error is that of a replay from the showing's own first pose, step by step: root mean
square over steps, mean over showings, in metres and in degrees of the angle between orientations.

Source: the data of Auddy et al. 2023, Robotics and Autonomous Systems 165; the task-parameterised skill of
Tanwani 2018; Zeestraten et al. 2017 for orientations on S^3.
"""

import argparse
import json
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import pilotfish as pf
from pilotfish import plots
from pilotfish.demonstrations import frame_from_pose, resample
from pilotfish.geometry import Pose, angle, normalise, rotation_matrix

TASKS = ("openbox", "bottle2shelf", "platestandingtolying", "pouring")
TREATMENTS = {"four numbers": False, "on S^3": True}
AXES = ("#BB5566", "#117733", "#6699CC")
STATES, STEPS, COVARIANCE_REGULARISATION, CONTROL_COST = 7, 200, 1e-4, 1e-2
NOTES = (
    "the recordings name no objects: the frames at the first and last pose of each showing are ours",
    "their time is nominal (the publishers resampled every showing to 1000 rows), so speeds are too",
    "slack 1e-4 and effort 1e-2, the same for both treatments, are ours",
)


@dataclass(frozen=True, slots=True, eq=False)
class Reproduction:
    """The poses of a replay, a row a step, and how far they are from the showing."""

    poses: np.ndarray
    metres: float
    degrees: float


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", type=Path, help="file for the table's numbers")
    parser.add_argument("--out", type=Path, help="folder for the pictures")
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
        arguments.out.mkdir(parents=True, exist_ok=True)
        for task in TASKS:
            picture(task, demonstrations[task]).savefig(arguments.out / f"{task}.png", dpi=110)
        print(f"pictures in {arguments.out}")
    if arguments.json:
        arguments.json.parent.mkdir(parents=True, exist_ok=True)
        arguments.json.write_text(json.dumps({"rows": rows, "notes": NOTES}, indent=2) + "\n")


def load_demonstrations(task: str) -> list[pf.Demonstration]:
    """Every showing of the task, seen from its own first and its own last pose, with speeds."""
    return [pf.add_derivatives(with_end_frames(resample(d, STEPS))) for d in pf.datasets.robotasks(task)]


def with_end_frames(demonstration: pf.Demonstration) -> pf.Demonstration:
    ends = (("first pose", demonstration.x[0]), ("last pose", demonstration.x[-1]))
    frames = [frame_from_pose(name, demonstration.layout, Pose(x[:3], normalise(x[3:]))) for name, x in ends]
    return replace(demonstration, frames=tuple(frames))


def to_representation(demonstrations: Sequence[pf.Demonstration], sphere: bool) -> list[pf.Demonstration]:
    return (
        [pf.demonstrations.to_sphere(demonstration) for demonstration in demonstrations] if sphere else list(demonstrations)
    )


def learn_skill(demonstrations: Sequence[pf.Demonstration]) -> pf.models.Fit:
    return pf.learn(demonstrations, states=STATES, rng=np.random.default_rng(0))


def reproduce(skill: pf.Skill, demonstration: pf.Demonstration) -> Reproduction:
    """The skill between the showing's own ends, from where it began."""
    frames = [frame for frame in demonstration.frames if isinstance(frame, pf.Frame)]
    here, start = pf.adapt(skill, frames), demonstration.x[0]
    if here.layout.orientation_starts:
        flat = pf.planning.tangent_chart(here)
        x = flat.to_manifold(tracked(flat.skill, flat.to_tangent(start)))
    else:
        x = tracked(here, start)
    poses = np.hstack([x[:, :3], normalise(x[:, 3:7])])
    metres = np.linalg.norm(poses[:, :3] - demonstration.x[:, :3], axis=1)
    radians = angle(poses[:, 3:], demonstration.x[:, 3:7])
    return Reproduction(poses, root_mean_square(metres), float(np.degrees(root_mean_square(radians))))


def tracked(here: pf.models.AdaptedSkill, start: np.ndarray) -> np.ndarray:
    system = pf.control.double_integrator(len(start) // 2, period=here.period)
    reference = pf.plan(here, start, horizon=STEPS, covariance_regularisation=COVARIANCE_REGULARISATION)
    return pf.track(system, reference, control_cost=CONTROL_COST).rollout(start).x


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
    print("replay error of training and test showings: positions [m], orientations [deg]")
    print(f"{'task':<22}{'orientations':<14}{'train':>9}{'':>8}{'test':>12}{'':>8}{'fit [CPU s]':>14}")
    for row in rows:
        numbers = f"{row['train [m]']:>9.4f}{row['train [deg]']:>8.2f}"
        numbers += f"{row['test [m]']:>12.4f}{row['test [deg]']:>8.2f}{row['fit [CPU s]']:>14.3f}"
        print(f"{row['task']:<22}{row['treatment']:<14}{numbers}")


def picture(task: str, demonstrations: Sequence[pf.Demonstration]) -> Figure:
    """Left the way of the tool and where its axes point, right how far it has turned, over time."""
    figure = Figure(figsize=(13, 5.6), layout="constrained")
    space, turns = figure.add_subplot(1, 2, 1, projection="3d"), figure.add_subplot(1, 2, 2)
    test = len(demonstrations) // 2 | 1
    human = demonstrations[test].x
    for n, demonstration in enumerate(demonstrations):
        label = "showings" if n == 0 else None
        space.plot(*demonstration.x[:, :3].T, color="0.75", linewidth=0.8, label=label)
    seconds = demonstrations[test].period * np.arange(STEPS)
    lines = {"a test showing": (human[:, :7], "0.2")}
    for k, (name, sphere) in enumerate(TREATMENTS.items()):
        data = to_representation(demonstrations, sphere)
        lines[f"replay, {name}"] = (
            reproduce(learn_skill(data[::2]).skill, data[test]).poses,
            plots.state_colour(k),
        )
    for name, (poses, colour) in lines.items():
        space.plot(*poses[:, :3].T, color=colour, linewidth=1.8, label=name)
        turns.plot(seconds, np.degrees(angle(human[:1, 3:7], poses[:, 3:])), color=colour, label=name)
    draw_axes(space, lines["replay, on S^3"][0])
    space.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]", title=f"{task}: the tool's way and its axes")
    limits = np.array([space.get_xlim(), space.get_ylim(), space.get_zlim()])
    space.set_box_aspect(np.ptp(limits, axis=1), zoom=0.95)  # equal scales
    space.yaxis.labelpad = 14
    space.view_init(25, -20)
    space.locator_params(nbins=3)
    space.locator_params(axis="y", nbins=6)
    turns.set(
        xlabel="time [s]", ylabel="angle from the first pose [deg]", title="how far the tool has turned"
    )
    turns.legend(loc="lower right")
    space.legend(loc="upper left", fontsize=8)
    return figure


def draw_axes(axes, poses: np.ndarray) -> None:  # type: ignore[no-untyped-def]  # 3-D axes are untyped
    """The three axes of the tool, every twentieth step."""
    length = 0.12 * float(np.ptp(poses[:, :3], axis=0).max())
    for n, pose in enumerate(poses[::20]):
        for axis, direction, colour in zip("xyz", rotation_matrix(pose[3:]).T, AXES, strict=True):
            ends = np.stack([pose[:3], pose[:3] + length * direction], axis=1)
            label = f"{axis} of the replay's tool on S^3" if n == 0 else None
            axes.plot(*ends, color=colour, linewidth=1.2, label=label)


if __name__ == "__main__":
    main()
