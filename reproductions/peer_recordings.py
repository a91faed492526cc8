"""Recordings of the comparison with peers, and what each method is given of a held-out demonstration."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from motion_measures import resample_rows

import pilotfish as pf
from pilotfish.demonstrations import Layout, Part, Quantity, frame, frame_from_pose, resample
from pilotfish.geometry import Pose, normalise

STEPS = 200  # rows of recordings that their publishers resampled to 1000
LETTERS = "abcdem"
HELLOWORLD = "helo"
ROBOTASKS = ("openbox", "bottle2shelf", "platestandingtolying", "pouring")
FIRST, LAST = "start", "end"


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """Demonstrations of one task.

    Attributes:
        name: Group and task, such as "letters a".
        demonstrations: With frames and derivatives.
        position: Number of position columns, which are the first ones.
        is_pose: Whether the position is followed by a quaternion.
        has_force: Whether the position is followed by a force.
        frame: Frame in whose coordinates the peers learn; None for the world. The end of a motion is then
            taken from the training demonstrations in that frame. Without a frame the end is given.
    """

    name: str
    demonstrations: tuple[pf.Demonstration, ...]
    position: int
    is_pose: bool = False
    has_force: bool = False
    frame: str | None = None

    @property
    def width(self) -> int:
        """Number of columns without derivatives."""
        return self.position + 4 * self.is_pose + self.has_force


@dataclass(frozen=True, slots=True, eq=False)
class Split:
    """One held-out demonstration and the others.

    Attributes:
        name: Recording and number of the held-out demonstration.
        recording: Recording.
        training: Demonstrations to learn from.
        test: Held-out demonstration.
        local_training: Training demonstrations in the coordinates of the peers, with the same number of rows.
        local_ends: Start and end of the motion in these coordinates.
    """

    name: str
    recording: Recording
    training: tuple[pf.Demonstration, ...]
    test: pf.Demonstration
    local_training: np.ndarray
    local_ends: np.ndarray

    @property
    def x(self) -> np.ndarray:
        """Held-out demonstration without derivatives."""
        return self.test.x[:, : self.recording.width]

    def unit_quaternions(self, x: np.ndarray) -> np.ndarray:
        """Normalise the quaternions of a motion of poses."""
        return unit_quaternions(x, self.recording)

    def to_world(self, local: np.ndarray) -> np.ndarray:
        """Return a motion of a peer in world coordinates, with the steps of the held-out demonstration."""
        recording = self.recording
        rows = resample_rows(local, len(self.test.x))
        if recording.frame:
            A, b = affine_map(self.test, recording)
            rows = rows @ A.T + b
        return unit_quaternions(rows, recording)


def load_recordings(wanted: Sequence[str]) -> list[Recording]:
    """Return recordings by name or group."""
    return [READERS[name](name) for name in select_names(wanted)]


def select_names(wanted: Sequence[str]) -> list[str]:
    """Return the names of recordings whose name or group is wanted; all if nothing is."""
    unknown = [word for word in wanted if word not in READERS and word not in GROUPS]
    if unknown:
        raise pf.InvalidInput(
            f"no recording is named {unknown[0]!r}, expected one of {', '.join(GROUPS)}, "
            "or one recording such as 'letters a'"
        )
    return [name for name in READERS if not wanted or name in wanted or name.split()[0] in wanted]


def splits(recording: Recording) -> list[Split]:
    """Return one split for each demonstration."""
    return [split(recording, m) for m in range(len(recording.demonstrations))]


def split(recording: Recording, held_out: int) -> Split:
    """Return the split that holds one demonstration out."""
    demonstrations = recording.demonstrations
    test = demonstrations[held_out]
    training = tuple(d for d in demonstrations if d is not test)
    locals_ = [to_local(d, recording) for d in training]
    if recording.is_pose:
        locals_ = [align_signs(x, locals_[0][0]) for x in locals_]
    steps = round(np.mean([len(x) for x in locals_]))
    local_training = np.stack([unit_quaternions(resample_rows(x, steps), recording) for x in locals_])
    x = to_local(test, recording)
    last = local_training[:, -1].mean(axis=0) if recording.frame else x[-1]
    ends = np.stack([x[0], last])
    if recording.is_pose:
        reference = local_training.mean(axis=0)[[0, -1]]
        ends = np.concatenate([align_signs(end[None], row) for end, row in zip(ends, reference, strict=True)])
    name = f"{recording.name} {held_out + 1}"
    return Split(name, recording, training, test, local_training, unit_quaternions(ends, recording))


def affine_map(demonstration: pf.Demonstration, recording: Recording) -> tuple[np.ndarray, np.ndarray]:
    """Return A and b of the peers' frame, without derivatives: world = A @ local + b."""
    found = next(f for f in demonstration.frames if f.name == recording.frame)
    return found.A[: recording.width, : recording.width], found.b[: recording.width]


def to_local(demonstration: pf.Demonstration, recording: Recording) -> np.ndarray:
    """Return a demonstration in the coordinates of the peers, without derivatives."""
    x = demonstration.x[:, : recording.width]
    if not recording.frame:
        return x
    A, b = affine_map(demonstration, recording)
    return np.linalg.solve(A, (x - b).T).T


def align_signs(x: np.ndarray, row: np.ndarray) -> np.ndarray:
    """Return poses whose first quaternion is nearer to that of a row than its negative."""
    if x[0, 3:] @ row[3:] >= 0.0:
        return x
    return np.hstack([x[:, :3], -x[:, 3:]])


def unit_quaternions(x: np.ndarray, recording: Recording) -> np.ndarray:
    """Normalise the quaternions of poses."""
    return np.hstack([x[:, :3], normalise(x[:, 3:7])]) if recording.is_pose else x


def read_letter(name: str) -> Recording:
    """Read a letter: the position is the integral of the velocity of the pen, which starts at the origin."""
    found = [d for d in pf.datasets.letters() if d.name.split()[1] == name.split()[1]]
    layout = Layout(
        (Part("position", Quantity.POSITION, 2, "1"), Part("force", Quantity.SCALAR, 1, "1")),
    )
    demonstrations = []
    for d in found:
        position = np.cumsum(d.x[:, :2], axis=0) * d.period
        x = np.hstack([position - position[0], d.x[:, 2:]])
        demonstrations.append(with_end_frames(pf.demonstration(x, d.period, layout, (), d.name)))
    return Recording(name, tuple(demonstrations), position=2, has_force=True)


def read_helloworld(name: str) -> Recording:
    """Read a letter that was written on a table."""
    found = pf.datasets.helloworld(name.split()[1])
    return Recording(name, tuple(with_end_frames(resample(d, STEPS)) for d in found), position=2)


def read_robotask(name: str) -> Recording:
    """Read a household task."""
    found = pf.datasets.robotasks(name.split()[1])
    return Recording(
        name, tuple(with_end_frames(resample(d, STEPS)) for d in found), position=3, is_pose=True
    )


def read_valve(name: str) -> Recording:
    """Read the valve, whose frames are those of the recording."""
    return Recording(name, pf.datasets.valve(), position=3, is_pose=True, frame="valve after")


def with_end_frames(demonstration: pf.Demonstration) -> pf.Demonstration:
    """Return a demonstration with derivatives, and frames at its start and its end."""
    x, layout = demonstration.x, demonstration.layout
    frames = []
    for name, row in ((FIRST, x[0]), (LAST, x[-1])):
        if layout.unit_quaternions:
            frames.append(frame_from_pose(name, layout, Pose(row[:3], normalise(row[3:]))))
        else:
            is_position = np.arange(layout.width) < 2
            frames.append(frame(name, np.eye(layout.width), np.where(is_position, row, 0.0)))
    return pf.add_derivatives(replace(demonstration, frames=tuple(frames)))


READERS: dict[str, Callable[[str], Recording]] = {
    **{f"robotasks {task}": read_robotask for task in ROBOTASKS},
    **{f"letters {letter}": read_letter for letter in LETTERS},
    **{f"helloworld {letter}": read_helloworld for letter in HELLOWORLD},
    "valve": read_valve,
}
GROUPS = tuple(dict.fromkeys(name.split()[0] for name in READERS))
