"""The skill of the demonstration in physics: the robot opens the valve that the recording was made on."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import degrees

import numpy as np

from pilotfish.demonstrations import Demonstration, Frame
from pilotfish.environments import RECORDED_VALVE, Marks, RecordedValve, Verdict, Workcell
from pilotfish.geometry import Pose, normalise
from pilotfish.station.evaluation import TRAINED, Replay
from pilotfish.station.films import Camera, film_bytes, strip
from pilotfish.station.lessons import Lesson
from pilotfish.station.report import Film, Picture, Section, Table

TICKS_A_SECOND = 1000
ABOUT = (
    "Each replay was carried out by a simulated Baxter on a valve of the recording's dimensions: torques at "
    "1 kHz draw the tool to the planned pose as springs and dampers would, and the lever turns only if it is "
    "turned. The recording tells nothing of the gripper: here it shuts where the plan comes nearest to the "
    "handle before the turn, and opens where it comes nearest to it after. Friction and masses of the valve "
    "are chosen. It counts as open within 10 degrees of where the person left it, and nearer to that than to "
    "where it began."
)


@dataclass(frozen=True, slots=True, eq=False)
class Opening:
    """A replay carried out: how the valve stands in the end, and how it came to that.

    force is the largest on the tool [N], away the largest distance between the tool and where it was asked
    to be [m]; turn is how far the valve had to turn [rad].
    """

    name: str
    new: bool
    verdict: Verdict
    turn: float
    force: float
    away: float


def opened(lesson: Lesson, *, pictures: bool) -> tuple[Section, Table]:
    """Every replay of a lesson carried out, those that begin where the person did: a section of the report,
    with a film of the first new one where pictures can be drawn, and its table.
    """
    filmed = lesson.own[TRAINED].motion.x[:, :3]
    camera = Camera(RECORDED_VALVE.name, marks=Marks(path=filmed)) if pictures else None
    done = [
        carried_out(replay, shown, m >= TRAINED, camera if m == TRAINED else None)
        for m, (replay, shown) in enumerate(zip(lesson.own, lesson.shown, strict=True))
    ]
    measured = table(done)
    films = _films(camera, lesson.shown[TRAINED].name) if camera else ()
    return Section("In physics", (ABOUT, measured, *films)), measured


def _films(camera: Camera, name: str) -> tuple[Film | Picture, ...]:
    camera.close()
    return (
        Film(
            film_bytes(camera.frames),
            f"{name}, new to the skill, as it was carried out; the planned path of the tool in orange.",
            "The robot's right arm reaches for the lever of a valve, shuts its gripper around it, turns it "
            "to a green mark, lets go and withdraws.",
        ),
        Picture(
            strip(camera.frames, camera.times),
            "The same at six moments.",
            "Six pictures of the robot and the valve, with the time of each.",
        ),
    )


def carried_out(replay: Replay, shown: Demonstration, new: bool, camera: Camera | None) -> Opening:
    """The motion of a replay, in the physics of the valve that was there."""
    poses = [Pose(row[:3].copy(), normalise(row[3:7])) for row in replay.motion.x]
    before, after = (_pose(frame) for frame in shown.frames if isinstance(frame, Frame))
    valve = RecordedValve(before, after, poses[0])
    shut = _nearest(poses, before)
    open_again = shut + _nearest(poses[shut:], after)
    cell, away = Workcell(RECORDED_VALVE, valve), 0.0
    for t, pose in enumerate(poses):
        cell.follow(pose, float(shut <= t < open_again), round(shown.period * TICKS_A_SECOND))
        away = max(away, float(np.linalg.norm(cell.arm.tool.position - pose.position)))
        if camera:
            camera(cell)
    return Opening(shown.name, new, cell.verdict(), valve.turn, cell.peaks["tool"], away)


def _pose(frame: Frame) -> Pose:
    """Where the object of a frame stood, for the columns of a pose."""
    return Pose(frame.b[:3].copy(), normalise(frame.A[3:7, 3]))


def _nearest(poses: Sequence[Pose], to: Pose) -> int:
    return int(np.argmin([np.linalg.norm(pose.position - to.position) for pose in poses]))


def table(done: Sequence[Opening]) -> Table:
    """How each went."""
    rows = [
        (
            opening.name,
            "no" if opening.new else "yes",
            "yes" if opening.verdict.success else "no",
            f"{degrees(opening.turn):.0f}",
            f"{degrees(opening.verdict.error):.1f}",
            f"{opening.force:.0f}",
            f"{1000 * opening.away:.0f}",
        )
        for opening in done
    ]
    head = (
        "situation",
        "was it shown",
        "open",
        "to turn [deg]",
        "left to turn [deg]",
        "force [N]",
        "off path [mm]",
    )
    return Table("The replays carried out in physics", head, tuple(rows))
