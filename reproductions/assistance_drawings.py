"""Drawings of assistance_figures.py: demonstrations of a joint model, trials of operators, and fixtures.

Positions are drawn in a plane of the world or of a frame. Every panel has the same scale in both directions.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil

import numpy as np
from joint_models import POSE, Trial, augment
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

import pilotfish as pf
from pilotfish import plots
from pilotfish.demonstrations import Demonstration, views
from pilotfish.geometry import Pose, rotation_matrix
from pilotfish.types import Array, Float

Plane = tuple[int, int]
AXES = "xyz"
OPERATOR, ROBOT, AUTONOMOUS, PERSON = "#BB5566", "#004488", "#AA4499", "0.55"
ACTUAL, OBSERVED = "#117733", "#DDAA33"
STEP = 0.02  # s between rows of a trial
ROD, AXIS = 0.15, 0.05  # m: half of the length of a rod, and length of the axis of another object
LEGEND_ROW = 5


@dataclass(frozen=True, slots=True, eq=False)
class Paths:
    """Positions of an operator and of the robot in one situation [m].

    Attributes:
        operator: Positions that the operator commands.
        robot: Positions of the robot.
        actual: Poses of the objects at the robot.
        observed: Poses of the objects that the operator sees.
        switch: Row at which autonomous control begins; beyond the last one if it does not.
    """

    operator: Float[Array, "T 3"]
    robot: Float[Array, "T 3"]
    actual: Mapping[str, Pose]
    observed: Mapping[str, Pose]
    switch: int


def paths_of(trial: Trial) -> Paths:
    """Return the positions of a trial; the robot's are those of its tool."""
    rows = len(trial.result.hands)
    switch = rows if np.isinf(trial.switch) else round(trial.switch / STEP)
    hands, tool = trial.result.hands[:, :3], trial.result.measured[:, :3]
    return Paths(hands, tool, trial.actual, trial.observed, switch)


def draw_input(axes: Axes, joint: pf.Skill, demonstrations: Sequence[Demonstration], plane: Plane) -> None:
    """Draw the input part: demonstrations, their targets and the Gaussians, in the world."""
    for demonstration in demonstrations:
        draw_demonstration(axes, demonstration.x[:, :3], plane)
        for frame in demonstration.frames:
            axes.plot(*frame.b[..., list(plane)].T, "s", color=ACTUAL, markersize=5, zorder=4)
    draw_states(axes, joint, 0, 0, plane)
    finish(axes, plane, "input, in the world")


def draw_output(
    axes: Axes, joint: pf.Skill, demonstrations: Sequence[Demonstration], plane: Plane, p: int = 0
) -> None:
    """Draw the output part: demonstrations and Gaussians in the coordinates of frame p."""
    data = views([augment(demonstration) for demonstration in demonstrations])
    for path in np.split(data.x[p], np.cumsum(data.lengths)[:-1]):
        draw_demonstration(axes, path[:, POSE : POSE + 3], plane)
    axes.plot(0.0, 0.0, "s", color=ACTUAL, markersize=7, zorder=4)
    draw_states(axes, joint, p, POSE, plane)
    finish(axes, plane, f"output, in frame {joint.frame_names[p]!r}")


def draw_states(axes: Axes, joint: pf.Skill, p: int, start: int, plane: Plane) -> None:
    """Draw the Gaussians of one part of a joint model, which begins at a column."""
    part = slice(start, start + 3)
    plots.draw_ellipses(
        axes,
        joint.means[p, :, part],
        joint.covariances[p].dense[:, part, part],
        plane,
        f"{joint.frame_names[p]} {start}",
    )


def draw_demonstration(axes: Axes, positions: Float[Array, "T 3"], plane: Plane) -> None:
    path = positions[:, list(plane)]
    axes.plot(*path.T, color="0.7", linewidth=1.0, zorder=1)
    axes.plot(*path[0], "o", color="0.4", markersize=3.5, zorder=2)


def draw_paths(axes: Axes, paths: Paths, plane: Plane, title: str) -> None:
    """Draw operator, robot and objects in a plane of the world."""
    for pose in paths.observed.values():
        draw_object(axes, pose, plane, OBSERVED, fill="white")
    for pose in paths.actual.values():
        draw_object(axes, pose, plane, ACTUAL, fill=ACTUAL)
    columns = list(plane)
    axes.plot(*paths.operator[:, columns].T, color=OPERATOR, linewidth=3.2, alpha=0.75, zorder=5)
    axes.plot(*paths.robot[: paths.switch + 1, columns].T, color=ROBOT, linewidth=1.6, zorder=6)
    axes.plot(*paths.robot[0, columns], "o", color=ROBOT, markersize=5, zorder=7)
    if paths.switch < len(paths.robot):
        axes.plot(*paths.robot[paths.switch :, columns].T, color=AUTONOMOUS, linewidth=1.8, zorder=6)
        (mark,) = axes.plot(*paths.robot[paths.switch, columns], "x", color="black", zorder=8)
        mark.set(markersize=9.0, markeredgewidth=2.2)
    finish(axes, plane, title)


def draw_object(axes: Axes, pose: Pose, plane: Plane, colour: str, *, fill: str) -> None:
    """Draw an object as a square, with its z axis."""
    columns = list(plane)
    ends = np.stack([pose.position, pose.position + AXIS * rotation_matrix(pose.quaternion)[:, 2]])
    axes.plot(*ends[:, columns].T, color=colour, linewidth=1.2, zorder=3)
    axes.plot(
        *pose.position[columns],
        "s",
        color=colour,
        markerfacecolor=fill,
        markersize=8,
        markeredgewidth=1.8,
        zorder=4,
    )


def draw_rods(axes: Axes, paths: Paths, plane: Plane) -> None:
    """Draw the rod of the carabiner task, along the x axis of its frame."""
    for poses, colour, dash in ((paths.observed, OBSERVED, "--"), (paths.actual, ACTUAL, "-")):
        direction = rotation_matrix(poses["rod"].quaternion)[:, 0]
        ends = poses["rod"].position + ROD * np.outer([-1.0, 1.0], direction)
        axes.plot(*ends[:, list(plane)].T, color=colour, linestyle=dash, linewidth=3.0, zorder=2)


def draw_springs(axes: Axes, paths: Paths, plane: Plane, number: int) -> None:
    """Connect operator and robot at some instants, by lines that stand for the spring and damper."""
    columns = list(plane)
    for row in np.linspace(0, len(paths.operator) - 1, number).round().astype(int):
        ends = np.stack([paths.operator[row, columns], paths.robot[row, columns]])
        axes.plot(*ends.T, color="0.35", linestyle=":", linewidth=1.2, zorder=7)
        axes.plot(*ends[0], "s", color=OPERATOR, markersize=5, zorder=8)
        axes.plot(*ends[1], "s", color=ROBOT, markersize=5, zorder=8)


def finish(axes: Axes, plane: Plane, title: str) -> None:
    """Label the axes, and use one scale in both directions."""
    axes.set(xlabel=f"{AXES[plane[0]]} [m]", ylabel=f"{AXES[plane[1]]} [m]")
    axes.set_title(title, fontsize="medium", loc="left")
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.08)
    axes.xaxis.set_major_locator(MaxNLocator(6))
    axes.yaxis.set_major_locator(MaxNLocator(7))
    axes.grid(True, color="0.92", linewidth=0.6)


def model_handles() -> list[Artist]:
    return [
        Line2D([], [], color="0.7", label="demonstrations"),
        Line2D([], [], color="0.4", marker="o", markersize=4, linestyle="", label="starts"),
    ]


def object_handle() -> Artist:
    return Line2D([], [], color=ACTUAL, marker="s", linestyle="", label="object (frame)")


def path_handles(*, autonomous: bool = True, springs: bool = False) -> list[Artist]:
    """Return the entries of the legend of `draw_paths`."""
    handles = [
        Line2D([], [], color=OPERATOR, linewidth=3.2, alpha=0.75, label="operator"),
        Line2D([], [], color=ROBOT, label="robot"),
        Line2D([], [], color=ACTUAL, marker="s", linestyle="", label="actual object"),
        Line2D(
            [],
            [],
            color=OBSERVED,
            marker="s",
            markerfacecolor="white",
            linestyle="",
            label="object as observed",
        ),
    ]
    if autonomous:
        handles += [
            Line2D([], [], color=AUTONOMOUS, label="robot, autonomous"),
            Line2D([], [], color="black", marker="x", linestyle="", markeredgewidth=2.0, label="switch"),
        ]
    if springs:
        handles.append(Line2D([], [], color="0.35", linestyle=":", label="spring and damper"))
    return list(handles)


def add_legend(figure: Figure, handles: Sequence[Artist]) -> None:
    columns = ceil(len(handles) / ceil(len(handles) / LEGEND_ROW))
    figure.legend(handles=list(handles), loc="outside lower center", ncols=columns, frameon=False)


def new_figure(width: float, height: float) -> Figure:
    return Figure(figsize=(width, height), layout="constrained")


def person_handle() -> Artist:
    return Line2D([], [], color=PERSON, linestyle="--", label="person in the actual scene")
