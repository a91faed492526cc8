"""Autonomous control: continue from the filtered state and the time spent in it, and plan again."""

import assisted_task as task
import numpy as np
import pytest
from annotations import check_annotations

import pilotfish as pf
from pilotfish.assistance.autonomous import occupied_state, plan_motion, remaining_states
from pilotfish.assistance.coordinates import coordinate_frames, coordinate_skill
from pilotfish.geometry import angle
from pilotfish.models import MarkovChain, SemiMarkovChain
from pilotfish.models.durations import Gaussian


@pytest.fixture(autouse=True)
def unchecked():
    """Learn and plan without checks of annotations, which are slow here."""
    with check_annotations(False):
        yield


def left_right(K=5, mean=10.0, deviation=2.0) -> SemiMarkovChain:
    return SemiMarkovChain(np.eye(K)[0], np.eye(K, k=1), Gaussian(np.full(K, mean), np.full(K, deviation)))


@pytest.mark.parametrize("dynamics", ["semi-markov", "markov"])
@pytest.mark.parametrize("state", range(7))
def test_left_right_skill_goes_on_from_every_state(state, dynamics):
    chain = task.learn(dynamics=dynamics).dynamics
    assert chain.initial[0] > 0.99  # by its initial probabilities it would begin in the first state
    states = remaining_states(chain, state, 1)
    assert states[0] == state
    assert (np.diff(states) >= 0).all()
    assert states[-1] == 6


def test_time_already_spent_in_the_state_counts():
    chain = left_right()
    lengths = [np.sum(remaining_states(chain, 2, age) == 2) for age in (1, 4, 7, 10)]
    assert lengths == [10, 7, 4, 1]


def test_remaining_time_is_that_of_the_states_that_follow():
    chain = left_right()
    for state in range(5):
        assert len(remaining_states(chain, state, 1)) == 10 * (5 - state)


def test_final_state_of_any_age_is_kept():
    states = remaining_states(left_right(), 4, 500)
    assert (states == 4).all()


def test_markov_chain_takes_the_mean_time_of_its_states():
    stay = 0.9
    transitions = np.array([[stay, 1 - stay, 0.0], [0.0, stay, 1 - stay], [0.0, 0.0, 1.0]])
    states = remaining_states(MarkovChain(np.eye(3)[0], transitions), 1, 1)
    assert states[0] == 1
    assert states[-1] == 2


def test_occupied_state_is_the_most_probable_with_its_mean_age():
    belief = np.zeros((6, 3))
    belief[1, 1], belief[3, 1], belief[5, 2] = 0.3, 0.3, 0.4
    assert occupied_state(belief) == (1, 3)


@pytest.mark.parametrize("kind", ["flat", "sphere"])
def test_plan_from_rest_follows_the_demonstrations_in_a_new_scene(rng, kind):
    """Thirteen states: seven are so long that their mean lies up to 4 cm beside the cube."""
    skill = task.learn(kind, states=13)
    scene = task.random_scene(rng)
    demo, frames = task.demonstrate(rng, scene), coordinate_frames(task.scene_frames(scene), skill.layout)
    own = coordinate_skill(skill)
    states = remaining_states(own.dynamics, 0, 1)
    plan = plan_motion(pf.adapt(own, frames), states, demo.x[0], np.zeros(7), frames)
    assert np.allclose(plan.poses[0], demo.x[0], atol=1e-9)
    end = scene[1].position + np.array([0.0, 0.0, 0.2])  # that of a demonstration varies by 2 cm per axis
    assert np.linalg.norm(plan.poses[-1, :3] - end) < 0.05
    assert angle(plan.poses[-1, 3:7], demo.x[-1, 3:7]) < 0.1
    for point in (scene[0].position, scene[1].position):  # it passes the cube and the tray
        assert np.linalg.norm(plan.poses[:, :3] - point, axis=1).min() < 0.02


def test_plan_starts_with_the_velocity_of_the_target(rng):
    skill, own = task.learn(), coordinate_skill(task.learn())
    frames = coordinate_frames(task.scene_frames(task.random_scene(rng)), skill.layout)
    velocity = np.array([0.1, -0.05, 0.02, 0.1, 0.0, -0.2, 0.0])
    x = task.demonstrations()[0].x[20]
    plan = plan_motion(pf.adapt(own, frames), remaining_states(own.dynamics, 2, 1), x, velocity, frames)
    still = plan_motion(pf.adapt(own, frames), remaining_states(own.dynamics, 2, 1), x, np.zeros(7), frames)
    difference = (plan.poses[1] - still.poses[1])[:3] / own.period
    assert 0.2 < difference @ velocity[:3] / np.sum(velocity[:3] ** 2) <= 1.0
