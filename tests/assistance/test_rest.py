"""At rest the target stays where it was put, and motion begins there by a blend."""

import numpy as np
import pytest

import pilotfish as pf
from pilotfish import assistance
from pilotfish.demonstrations import Layout, Part, Quantity, pose_layout, position_layout, world_frame
from pilotfish.errors import InvalidInput
from pilotfish.geometry import from_rotation_vector, multiply

DT = 0.02
GRIP = Part("grip", Quantity.SCALAR, 1, "1")


def shared_session(make, **options):
    demos = make(central=True, **options)
    skill = pf.learn(demos[:-1], states=6, rng=np.random.default_rng(0)).skill
    assistant = assistance.make_assistant([assistance.assisted_skill(skill)])
    frames = demos[-1].frames
    hand = demos[-1].x[0, : assistant.layout.width].copy()
    return assistant, assistance.initial_state(assistant, hand, frames, frames), frames, hand


def moved(hand: np.ndarray, offset: np.ndarray, turn: np.ndarray) -> np.ndarray:
    other = hand.copy()
    other[:3] += offset
    other[3:7] = multiply(hand[3:7], from_rotation_vector(turn))
    return other


def test_misalignment_after_rest_is_distance_and_angle_of_the_hand(make, rng):
    assistant, state, frames, hand = shared_session(make)
    offset, turn = 0.1 * rng.normal(size=3), 0.2 * rng.normal(size=3)
    state = assistance.rest_target(assistant, state, hand)
    command = assistance.Command(moved(hand, offset, turn), "direct")
    state, target = assistance.step_assistance(assistant, state, command, frames, frames, DT)
    distance, angle = assistance.misalignment(assistant, state)
    np.testing.assert_allclose([distance, angle], [np.linalg.norm(offset), np.linalg.norm(turn)], rtol=1e-6)
    np.testing.assert_allclose(target.pose[:3], hand[:3], atol=1e-6)


@pytest.mark.parametrize("mode", ["direct", "shared", "autonomous"])
def test_rest_target_in_every_mode_ends_plans_and_begins_again_without_a_jump(make, mode):
    assistant, state, frames, hand = shared_session(make, grip=True)
    command = assistance.Command(hand, mode)
    for _ in range(40):
        state, target = assistance.step_assistance(assistant, state, command, frames, frames, DT)
    rested = assistance.rest_target(assistant, state, target.pose)
    assert (rested.plan, rested.cart, rested.mode) == (None, None, "direct")
    again, after = assistance.step_assistance(assistant, rested, command, frames, frames, DT)
    assert np.linalg.norm(after.pose[:3] - target.pose[:3]) < 1e-3
    assert after.pose[7] == target.pose[7]
    assert again.mode == mode


def test_rest_target_after_a_plan_keeps_the_state_that_the_plan_reached(make):
    assistant, state, frames, hand = shared_session(make)
    for _ in range(60):
        command = assistance.Command(hand, "autonomous")
        state, target = assistance.step_assistance(assistant, state, command, frames, frames, DT)
    reached = int(target.probabilities.argmax())
    assert reached > 0
    rested = assistance.rest_target(assistant, state, target.pose)
    assert rested.memory.filter.belief.sum(axis=0).argmax() == reached


@pytest.mark.parametrize("layout", [pose_layout(), Layout((*pose_layout().parts, GRIP))])
def test_direct_skill_target_follows_the_hand_exactly(layout, rng):
    assistant = assistance.make_assistant([assistance.direct_skill(layout)])
    frames = (world_frame(assistant.layout.width),)
    pose = np.zeros(assistant.layout.width)
    pose[3] = 1.0
    state = assistance.initial_state(assistant, pose, frames, frames)
    hand = pose.copy()
    hand[:3] = 0.1 * rng.normal(size=3)
    for _ in range(200):
        state, target = assistance.step_assistance(
            assistant, state, assistance.Command(hand, "direct"), frames, frames, DT
        )
    np.testing.assert_allclose(target.pose, hand, atol=1e-9)


def test_direct_skill_without_an_orientation_is_refused():
    with pytest.raises(InvalidInput, match="expected a position and an orientation"):
        assistance.direct_skill(position_layout())


def test_rest_target_pose_that_is_not_finite_is_refused(make):
    assistant, state, _, hand = shared_session(make)
    hand[0] = np.nan
    with pytest.raises(InvalidInput, match="pose"):
        assistance.rest_target(assistant, state, hand)
