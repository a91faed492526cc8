"""Tracks and their table: empty cells, continuous signs, gaps."""

import csv

import numpy as np
import pytest

from pilotfish.errors import InvalidInput, SkillError
from pilotfish.geometry import Pose
from pilotfish.vision import Observation, Rejection, frame_tracks, write_frames

Q = np.array([0.6, 0.8, 0.0, 0.0])
LOST = Observation(None, rejection=Rejection.NOT_FOUND)


def found(x: float, sign: float = 1.0) -> Observation:
    return Observation(Pose(np.array([x, 0.0, 1.0]), sign * Q), 0.25)


def track(*rows: Observation):
    return frame_tracks([0.1 * n for n in range(len(rows))], [{"a": row} for row in rows])[0]


def test_signs_continue_over_a_gap():
    made = track(found(0.0, -1.0), LOST, found(0.1, -1.0), found(0.2))
    np.testing.assert_array_equal(made.quaternions[[0, 2, 3]], [Q, Q, Q])
    assert np.isnan(made.quaternions[1]).all()
    assert np.isnan(made.positions[1]).all()


def test_gaps_and_rejections_are_counted():
    jump = Observation(None, 0.3, Rejection.JUMP)
    made = track(LOST, found(0.0), LOST, jump, found(0.0), LOST)
    np.testing.assert_allclose(made.gaps, [(0.0, 0.0), (0.2, 0.3), (0.5, 0.5)])
    assert made.rejections == {"marker not found": 3, "jump": 1}
    assert track(found(0.0)).gaps == []


def test_table_has_empty_cells_where_a_frame_is_not_visible(tmp_path):
    tracks = frame_tracks([0.0, 0.5], [{"a": found(0.1), "b": LOST}, {"a": LOST, "b": found(-1 / 3)}])
    write_frames(tmp_path / "frames.csv", tracks)
    header, *rows = list(csv.reader((tmp_path / "frames.csv").read_text().splitlines()))
    names = [*("a x [m]", "a y [m]", "a z [m]"), *("a qw", "a qx", "a qy", "a qz")]
    assert header[:10] == ["time [s]", *names, "a visible", "a error [px]"]
    assert rows[0][:10] == ["0", "0.1", "0", "1", "0.6", "0.8", "0", "0", "1", "0.25"]
    assert rows[0][10:] == [""] * 7 + ["0", ""]
    assert rows[1][:10] == ["0.5", *[""] * 7, "0", ""]
    assert float(rows[1][10]) == pytest.approx(-1 / 3, rel=1e-8)
    with pytest.raises(SkillError, match="exists"):
        write_frames(tmp_path / "frames.csv", tracks)


@pytest.mark.usefixtures("unchecked")  # wrong types on purpose
def test_unusable_arguments_are_invalid_input(tmp_path):
    for times, rows in (([], []), ([0.0], []), ([0.0, 1.0], [{"a": LOST}]), ([0.0], [None])):
        with pytest.raises(InvalidInput):
            frame_tracks(times, rows)
    a, b = track(LOST), track(LOST, LOST)
    for tracks in ([], [a, b], [None]):
        with pytest.raises(InvalidInput):
            write_frames(tmp_path / "x.csv", tracks)
