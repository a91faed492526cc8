"""Frames in files: every form of a pose gives the same frame, and what is wrong is named."""

import numpy as np
import pytest

from pilotfish.demonstrations import Layout, Part, Quantity, pose_layout, position_layout
from pilotfish.errors import InvalidInput
from pilotfish.io.frame_tables import parse_frame

LAYOUT = pose_layout()
POSITION = [0.5, -0.2, 0.1]
ROLL, PITCH, YAW = 0.3, -0.4, 1.2


def rotation(axis: int, angle: float) -> np.ndarray:
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    R = np.eye(3)
    R[i, i] = R[j, j] = np.cos(angle)
    R[j, i], R[i, j] = np.sin(angle), -np.sin(angle)
    return R


EXPECTED = rotation(2, YAW) @ rotation(1, PITCH) @ rotation(0, ROLL)  # about fixed axes


@pytest.mark.parametrize(
    "turn", [{"rpy": [ROLL, PITCH, YAW]}, {"matrix": EXPECTED.tolist()}], ids=["rpy", "matrix"]
)
def test_every_form_of_an_orientation_rotates_positions_equally(turn):
    given = parse_frame({"name": "cup", "position": POSITION, **turn}, LAYOUT)
    np.testing.assert_allclose(given.A[:3, :3], EXPECTED, atol=1e-12)
    np.testing.assert_allclose(given.b[:3], POSITION)
    quaternion = given.A[3:7, 3].tolist()  # left multiplication of the identity
    again = parse_frame({"name": "cup", "position": POSITION, "quaternion": quaternion}, LAYOUT)
    np.testing.assert_allclose(again.A, given.A, atol=1e-12)


def test_planar_frame_moves_and_turns_positions_and_turns_forces():
    layout = Layout(
        (
            Part("position", Quantity.POSITION, 2, "m"),
            Part("force", Quantity.VECTOR, 2, "N"),
            Part("grip", Quantity.SCALAR, 1, "1"),
        )
    )
    given = parse_frame({"name": "cup", "position": [1.0, 2.0], "angle": np.pi / 2}, layout)
    local = np.array([1.0, 0.0, 0.0, 3.0, 0.5])
    np.testing.assert_allclose(given.A @ local + given.b, [1.0, 3.0, -3.0, 0.0, 0.5], atol=1e-12)


@pytest.mark.usefixtures("unchecked")  # wrong types on purpose
@pytest.mark.parametrize(
    ("table", "message"),
    [
        (
            {"position": POSITION, "orientation": [1, 0, 0, 0]},
            "'orientation'; give it as quaternion, rpy or matrix",
        ),
        ({"position": POSITION, "quaternoin": [1, 0, 0, 0]}, "did you mean 'quaternion'"),
        ({"position": POSITION}, "key 'quaternion' is missing"),
        (
            {"position": POSITION, "rpy": [0, 0, 0], "quaternion": [1, 0, 0, 0]},
            "quaternion and rpy, expected one",
        ),
        ({"position": [0, 0], "quaternion": [1, 0, 0, 0]}, r"shape \(2,\) beside quaternion"),
        ({"position": POSITION, "rpy": [0, 0]}, r"rpy has shape \(2,\)"),
        ({"position": POSITION, "rpy": [0, 0, 17.2]}, "rpy has 17.2, expected radians"),
        ({"position": [0, 0], "angle": -90}, "angle has 90, expected radians"),
        ({"position": POSITION, "matrix": [[2, 0, 0], [0, 2, 0], [0, 0, 2]]}, "matrix"),
        ({"position": [0, 0], "angle": 0.1}, "expected positions and vectors of two axes"),
        ({"position": POSITION, "angle": 0.1}, r"expected \(2,\)"),
        ({"A": [[1.0]], "b": [0.0], "position": POSITION}, "'position' does not belong to name, A, b"),
        ({"A": [[1.0]]}, "key 'b' is missing"),
    ],
)
def test_wrong_frames_are_refused_with_the_fix(table, message):
    with pytest.raises(InvalidInput, match=message):
        parse_frame({"name": "cup", **table}, LAYOUT)


def test_frame_without_name_is_refused():
    with pytest.raises(InvalidInput, match="key 'name' is missing"):
        parse_frame({"position": POSITION, "rpy": [0, 0, 0]}, position_layout(3))
