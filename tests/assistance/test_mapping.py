"""Direct control: scale, offset and clutch."""

import assisted_task as task
import numpy as np
import pytest

from pilotfish.assistance.mapping import OperatorMapping, close_clutch, open_map
from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, angle, conjugate, from_rotation_vector, multiply, rotation_matrix
from pilotfish.kernels import is_valid_hand, map_hand


def random_hand(rng) -> np.ndarray:
    return np.concatenate([rng.normal(size=3), from_rotation_vector(rng.normal(size=3)), [rng.random()]])


def random_mapping(rng) -> OperatorMapping:
    return OperatorMapping(float(rng.uniform(0.2, 3.0)), task.rigid_motion(rng))


def test_default_mapping_is_one_to_one(rng):
    hand = random_hand(rng)
    assert np.allclose(map_hand(open_map(OperatorMapping()), hand, is_oriented=True), hand)


def test_displacement_is_scaled_and_rotated_by_the_offset(rng):
    mapping, hand, step = random_mapping(rng), random_hand(rng), rng.normal(size=3)
    clutch = close_clutch(mapping, random_hand(rng), random_hand(rng), is_oriented=True)
    moved = hand.copy()
    moved[:3] += step
    before, after = (map_hand(clutch, x, is_oriented=True) for x in (hand, moved))
    expected = mapping.scale * rotation_matrix(mapping.offset.quaternion) @ step
    assert np.allclose(after[:3] - before[:3], expected)


def test_rotation_about_an_axis_of_the_world_stays_one_after_the_clutch(rng):
    hand, turn = random_hand(rng), from_rotation_vector(rng.normal(size=3))
    clutch = close_clutch(OperatorMapping(), random_hand(rng), random_hand(rng), is_oriented=True)
    turned = hand.copy()
    turned[3:7] = multiply(turn, hand[3:7])
    before, after = (map_hand(clutch, x, is_oriented=True)[3:7] for x in (hand, turned))
    assert angle(multiply(after, conjugate(before)), turn) < 1e-9


def test_command_goes_on_where_it_was_when_the_clutch_closes(rng):
    mapping, hand, command = random_mapping(rng), random_hand(rng), random_hand(rng)
    hand_map = close_clutch(mapping, hand, command, is_oriented=True)
    x = map_hand(hand_map, hand, is_oriented=True)
    assert np.allclose(x[:3], command[:3])
    assert angle(x[3:7], command[3:7]) < 1e-9
    assert x[7] == hand[7]


@pytest.mark.parametrize(
    "change",
    [
        lambda hand: hand * np.nan,
        lambda hand: np.concatenate([[np.inf], hand[1:]]),
        lambda hand: np.concatenate([hand[:3], np.zeros(4), hand[7:]]),
        lambda hand: np.concatenate([[1e200], hand[1:]]),
    ],
)
def test_bad_hand_is_recognised(rng, change):
    hand = random_hand(rng)
    assert is_valid_hand(hand, is_oriented=True)
    assert not is_valid_hand(change(hand), is_oriented=True)


def test_mapping_refuses_a_scale_of_zero_and_an_offset_of_no_pose():
    with pytest.raises(InvalidInput, match="scale"):
        OperatorMapping(0.0)
    with pytest.raises(InvalidInput, match="norm 0"):
        OperatorMapping(1.0, Pose(np.zeros(3), np.zeros(4)))
