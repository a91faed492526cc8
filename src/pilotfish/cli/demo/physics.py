"""Simulation of the demo: the robot opens the recorded valve along each reproduced motion."""

from collections.abc import Sequence
from math import degrees

import numpy as np

from pilotfish.cli.demo.evaluation_tables import StructureEvaluation
from pilotfish.cli.demo.protocol import TRAINING_DEMONSTRATIONS
from pilotfish.cli.output.html_report import Image, Section, figure_image
from pilotfish.cli.output.tables import Table
from pilotfish.demonstrations import Demonstration, Frame
from pilotfish.environments import RECORDED_VALVE, Outcome, RecordedValve, Workcell
from pilotfish.geometry import Pose, normalise
from pilotfish.planning import Reproduction
from pilotfish.simulation import FilmRecorder, encode_film, film_strip

STEPS_PER_SECOND = 1000
INTRODUCTION = (
    "A simulated Baxter executed each reproduction on a valve with the dimensions of the recorded one. An "
    "impedance controller at 1 kHz tracks the planned pose; the lever turns only through contact. The "
    "recording does not contain the gripper. Here it closes where the plan is nearest to the handle "
    "before the turn. It opens where the plan is nearest to the handle after the turn. Friction and "
    "masses of the valve are assumed. The valve counts as open within 10 degrees of the angle at which the "
    "person left it. It must also be nearer to that angle than to its initial one."
)
HEADER = (
    "situation",
    "demonstrated",
    "open",
    "required turn [deg]",
    "remaining turn [deg]",
    "peak force [N]",
    "max. deviation [mm]",
)
# Outcome with the remaining angle of the valve [rad], angle by which it has to turn [rad], peak force on the
# tool [N], and largest distance between the tool and its commanded position [m].
ValveResult = tuple[Outcome, float, float, float]


def simulate_reproductions(evaluation: StructureEvaluation, *, with_images: bool) -> tuple[Section, Table]:
    """Execute the reproductions that start at the first point of each demonstration.

    Args:
        evaluation: Reproductions to execute.
        with_images: Whether to render a film of the first new situation.

    Returns:
        A section of the report, and the table in it.
    """
    filmed = TRAINING_DEMONSTRATIONS
    path = evaluation.from_first_point[filmed].motion.x[:, :3]
    camera = FilmRecorder(path=path) if with_images else None
    results = [
        simulate_reproduction(
            reproduction,
            demonstration,
            camera if m == filmed else None,
        )
        for m, (reproduction, demonstration) in enumerate(
            zip(evaluation.from_first_point, evaluation.demonstrations, strict=True)
        )
    ]
    table = result_table([demo.name for demo in evaluation.demonstrations], results)
    images = _film_images(camera, evaluation.demonstrations[filmed].name) if camera else ()
    return Section("Simulation", (INTRODUCTION, table, *images)), table


def simulate_reproduction(
    reproduction: Reproduction, demonstration: Demonstration, camera: FilmRecorder | None
) -> ValveResult:
    """Execute the motion of a reproduction on the valve of a demonstration.

    Args:
        reproduction: Motion to execute.
        demonstration: Demonstration whose frames give the valve before and after the turn.
        camera: Records a film; None records none.

    Returns:
        The outcome, the required turn, the peak force and the largest deviation.
    """
    poses = [Pose(row[:3].copy(), normalise(row[3:7])) for row in reproduction.motion.x]
    before, after = (_frame_pose(frame) for frame in demonstration.frames if isinstance(frame, Frame))
    valve = RecordedValve(before, after, poses[0])
    closing = _nearest(poses, before)
    opening = closing + _nearest(poses[closing:], after)
    cell, max_deviation = Workcell(RECORDED_VALVE, valve), 0.0
    ticks = round(demonstration.period * STEPS_PER_SECOND)
    for t, pose in enumerate(poses):
        cell.step_impedance(pose, float(closing <= t < opening), ticks)
        max_deviation = max(max_deviation, float(np.linalg.norm(cell.arm.tool.position - pose.position)))
        if camera:
            camera(cell)
    return cell.outcome(), valve.turn, cell.peak_forces["tool"], max_deviation


def result_table(names: Sequence[str], results: Sequence[ValveResult]) -> Table:
    """Return a table with a row for the result in the situation of each demonstration, by name."""
    rows = [
        (
            name,
            "yes" if m < TRAINING_DEMONSTRATIONS else "no",
            "yes" if outcome.success else "no",
            f"{degrees(turn):.0f}",
            f"{degrees(outcome.error):.1f}",
            f"{force:.0f}",
            f"{1000 * max_deviation:.0f}",
        )
        for m, (name, (outcome, turn, force, max_deviation)) in enumerate(zip(names, results, strict=True))
    ]
    return Table(HEADER, tuple(rows), "Reproductions executed in simulation", right_aligned=True)


def _film_images(camera: FilmRecorder, name: str) -> tuple[Image, ...]:
    camera.close()
    return (
        Image(
            encode_film(camera.images),
            "image/webp",
            f"{name}, a new situation, in simulation. The planned path of the tool is orange.",
            "Film: the robot's right arm reaches for the lever of a valve, closes its gripper and turns "
            "the lever to a green mark. Then it lets go and withdraws.",
        ),
        figure_image(
            film_strip(camera.images, camera.times),
            "Six frames of the film.",
            "Six images of the robot and the valve, with the time of each.",
        ),
    )


def _frame_pose(frame: Frame) -> Pose:
    """Return the pose of a frame whose columns are those of a pose."""
    return Pose(frame.b[:3].copy(), normalise(frame.A[3:7, 3]))


def _nearest(poses: Sequence[Pose], target: Pose) -> int:
    return int(np.argmin([np.linalg.norm(pose.position - target.position) for pose in poses]))
