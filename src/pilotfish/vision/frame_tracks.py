"""Tracks of frames over the images of a source, and their table frames.csv.

A frame that is not visible has empty cells, visible 0 and nothing repeated.
"""

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.io import atomic_file
from pilotfish.types import Array, Bool, Float
from pilotfish.validation import require_type, shorten_repr
from pilotfish.vision.frame_tracker import Observation, Rejection

AXES = ("x", "y", "z")
PARTS = ("qw", "qx", "qy", "qz")


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class FrameTrack:
    """Poses of one frame over the images; rows without a pose are NaN.

    Attributes:
        name: Name of the frame.
        times: Time of each image [s].
        positions: Positions [m].
        quaternions: Quaternions w x y z, with the sign nearest to the last one.
        errors: Reprojection error of each image, rejected poses included [pixels].
        visible: Images with a pose.
        rejections: Number of images without a pose, by reason.
        ambiguous: Number of poses of which another orientation was as plausible.
    """

    name: str
    times: Float[Array, " T"]
    positions: Float[Array, "T 3"]
    quaternions: Float[Array, "T 4"]
    errors: Float[Array, " T"]
    visible: Bool[Array, " T"]
    rejections: dict[str, int]
    ambiguous: int

    @property
    def gaps(self) -> list[tuple[float, float]]:
        """First and last time of each run of images without a pose [s]."""
        edges = np.flatnonzero(np.diff(np.concatenate([[True], self.visible, [True]]).astype(int)))
        return [
            (float(self.times[first]), float(self.times[last - 1]))
            for first, last in zip(edges[::2], edges[1::2], strict=True)
        ]


def frame_tracks(
    times: Sequence[float], observations: Sequence[dict[str, Observation]]
) -> tuple[FrameTrack, ...]:
    """Return the track of each frame from the observations of all images.

    Args:
        times: Time of each image [s].
        observations: Observations of each image, from `FrameTracker.observe`.

    Raises:
        InvalidInput: If they have different lengths, or are empty.
    """
    require_type(times, "times", Sequence, "give a list of times")
    require_type(observations, "observations", Sequence, "give a list of observations")
    if not observations or len(times) != len(observations):
        raise InvalidInput(
            f"{len(times)} times and {len(observations)} observations, expected as many of both, at least one"
        )
    for each in observations:
        require_type(each, "an observation", dict, "FrameTracker.observe(image, time) returns one")
    seconds = np.array(times, dtype=np.float64)
    return tuple(_track(name, seconds, [each[name] for each in observations]) for name in observations[0])


def _track(name: str, times: Float[Array, " T"], rows: Sequence[Observation]) -> FrameTrack:
    nowhere = np.full(3, np.nan), np.full(4, np.nan)
    poses = [(row.pose.position, row.pose.quaternion) if row.pose else nowhere for row in rows]
    reasons = [row.rejection.value for row in rows if row.rejection]
    return FrameTrack(
        name,
        times,
        np.array([position for position, _ in poses]),
        _continuous_signs(np.array([quaternion for _, quaternion in poses])),
        np.array([row.error for row in rows], dtype=np.float64),
        np.array([row.pose is not None for row in rows]),
        {reason.value: reasons.count(reason.value) for reason in Rejection if reason.value in reasons},
        sum(row.ambiguous for row in rows),
    )


def _continuous_signs(q: Float[Array, "T 4"]) -> Float[Array, "T 4"]:
    """Return quaternions with the sign nearest to the last one that is not NaN; the first has w >= 0."""
    signed, last = q.copy(), np.array([1.0, 0.0, 0.0, 0.0])
    for row in signed:
        if np.isfinite(row[0]):
            if row @ last < 0.0:
                row *= -1.0
            last = row
    return signed


def write_frames(path: Path, tracks: Sequence[FrameTrack], *, overwrite: bool = False) -> None:
    """Write the table of all tracks as CSV; cells of a frame that is not visible are empty.

    Args:
        path: File to write.
        tracks: Tracks with the same times.
        overwrite: Whether to replace an existing file.

    Raises:
        InvalidInput: If the file cannot be written, or the tracks have different times.
    """
    require_type(tracks, "tracks", Sequence, "frame_tracks(times, observations) returns them")
    for track in tracks:
        require_type(track, "a track", FrameTrack, "frame_tracks(times, observations) returns them")
    if not tracks or any(not np.array_equal(track.times, tracks[0].times) for track in tracks):
        raise InvalidInput("the tracks have different times or are missing, expected those of one recording")
    header = ["time [s]"]
    for track in tracks:
        header += [f"{track.name} {axis} [m]" for axis in AXES] + [f"{track.name} {part}" for part in PARTS]
        header += [f"{track.name} visible", f"{track.name} error [px]"]
    with (
        atomic_file(path, overwrite=overwrite) as temporary,
        temporary.open("w", encoding="utf-8", newline="") as file,
    ):
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        for t, seconds in enumerate(tracks[0].times.tolist()):
            writer.writerow([f"{seconds:.9g}", *(cell for track in tracks for cell in _cells(track, t))])


def _cells(track: FrameTrack, t: int) -> list[str]:
    values = [*track.positions[t].tolist(), *track.quaternions[t].tolist()]
    error = track.errors[t]
    return [
        *(f"{value:.9g}" if track.visible[t] else "" for value in values),
        str(int(track.visible[t])),
        f"{error:.4g}" if np.isfinite(error) else "",
    ]
