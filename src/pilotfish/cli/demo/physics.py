"""The skill of the demonstration in physics: the robot opens the valve that the recording was made on."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import degrees

import numpy as np

from pilotfish.cli.demo.demonstrations import StructureEvaluation
from pilotfish.cli.demo.protocol import TRAINING_DEMONSTRATIONS
from pilotfish.cli.output.report import Film, ReportFigure, Section, Table
from pilotfish.demonstrations import Demonstration, Frame
from pilotfish.environments import RECORDED_VALVE, Outcome, RecordedValve, Workcell
from pilotfish.geometry import Pose, normalise
from pilotfish.planning import Reproduction
from pilotfish.simulation import FilmRecorder, encode_film, film_strip

STEPS_PER_SECOND = 1000
ABOUT = (
    "Each reproduction was carried out by a simulated Baxter on a valve of the recording's dimensions: torques at "
    "1 kHz draw the tool to the planned pose as springs and dampers would, and the lever turns only if it is "
    "turned. The recording tells nothing of the gripper: here it shuts where the plan comes nearest to the "
    "handle before the turn, and opens where it comes nearest to it after. Friction and masses of the valve "
    "are chosen. It counts as open within 10 degrees of where the person left it, and nearer to that than to "
    "where it began."
)


@dataclass(frozen=True, slots=True, eq=False)
class ValveResult:
    """A reproduction carried out: how the valve stands in the end, and how it came to that.

    force is the largest on the tool [N], away the largest distance between the tool and where it was asked
    to be [m]; turn is how far the valve had to turn [rad].
    """

    name: str
    new: bool
    outcome: Outcome
    turn: float
    force: float
    max_deviation: float


def simulate_reproductions(evaluation: StructureEvaluation, *, pictures: bool) -> tuple[Section, Table]:
    """Every reproduction of a lesson carried out, those that begin where the person did: a section of the report,
    with a film of the first new one where pictures can be drawn, and its table.
    """
    filmed = evaluation.from_first_point[TRAINING_DEMONSTRATIONS].motion.x[:, :3]
    camera = FilmRecorder(path=filmed) if pictures else None
    done = [
        simulate_reproduction(
            reproduction,
            demonstrations,
            m >= TRAINING_DEMONSTRATIONS,
            camera if m == TRAINING_DEMONSTRATIONS else None,
        )
        for m, (reproduction, demonstrations) in enumerate(
            zip(evaluation.from_first_point, evaluation.demonstrations, strict=True)
        )
    ]
    measured = table(done)
    films = _films(camera, evaluation.demonstrations[TRAINING_DEMONSTRATIONS].name) if camera else ()
    return Section("In physics", (ABOUT, measured, *films)), measured


def _films(camera: FilmRecorder, name: str) -> tuple[Film | ReportFigure, ...]:
    camera.close()
    return (
        Film(
            encode_film(camera.images),
            f"{name}, new to the skill, as it was carried out; the planned path of the tool in orange.",
            "The robot's right arm reaches for the lever of a valve, shuts its gripper around it, turns it "
            "to a green mark, lets go and withdraws.",
        ),
        ReportFigure(
            film_strip(camera.images, camera.times),
            "The same at six moments.",
            "Six pictures of the robot and the valve, with the time of each.",
        ),
    )


def simulate_reproduction(
    reproduction: Reproduction, demonstrations: Demonstration, new: bool, camera: FilmRecorder | None
) -> ValveResult:
    """The motion of a reproduction, in the physics of the valve that was there."""
    poses = [Pose(row[:3].copy(), normalise(row[3:7])) for row in reproduction.motion.x]
    before, after = (_pose(frame) for frame in demonstrations.frames if isinstance(frame, Frame))
    valve = RecordedValve(before, after, poses[0])
    shut = _nearest(poses, before)
    open_again = shut + _nearest(poses[shut:], after)
    cell, max_deviation = Workcell(RECORDED_VALVE, valve), 0.0
    for t, pose in enumerate(poses):
        cell.step_impedance(
            pose, float(shut <= t < open_again), round(demonstrations.period * STEPS_PER_SECOND)
        )
        max_deviation = max(max_deviation, float(np.linalg.norm(cell.arm.tool.position - pose.position)))
        if camera:
            camera(cell)
    return ValveResult(
        demonstrations.name, new, cell.outcome(), valve.turn, cell.peak_forces["tool"], max_deviation
    )


def _pose(frame: Frame) -> Pose:
    """Where the object of a frame stood, for the columns of a pose."""
    return Pose(frame.b[:3].copy(), normalise(frame.A[3:7, 3]))


def _nearest(poses: Sequence[Pose], to: Pose) -> int:
    return int(np.argmin([np.linalg.norm(pose.position - to.position) for pose in poses]))


def table(done: Sequence[ValveResult]) -> Table:
    """How each went."""
    rows = [
        (
            result.name,
            "no" if result.new else "yes",
            "yes" if result.outcome.success else "no",
            f"{degrees(result.turn):.0f}",
            f"{degrees(result.outcome.error):.1f}",
            f"{result.force:.0f}",
            f"{1000 * result.max_deviation:.0f}",
        )
        for result in done
    ]
    header = (
        "situation",
        "was it shown",
        "open",
        "to turn [deg]",
        "left to turn [deg]",
        "force [N]",
        "off path [mm]",
    )
    return Table("The replays carried out in physics", header, tuple(rows))
