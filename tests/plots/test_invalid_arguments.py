"""Unusable arguments are refused before a figure is created."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pilotfish import plots
from pilotfish.demonstrations import Layout, Part, Quantity, pose_layout, world_frame
from pilotfish.errors import InvalidInput
from pilotfish.models import MarkovChain, Skill
from pilotfish.planning import via_point
from pilotfish.plots.style import MAX_STATES


def test_plots_too_many_states_are_refused(make_skill_of_size: Callable[..., Skill], inputs: Any):
    """Every plot with coloured states gives the number that it can distinguish."""
    many = make_skill_of_size(MAX_STATES + 1)
    for draw in (
        lambda: plots.state_graph(many),
        lambda: plots.forward_variable(many, horizon=9),
        lambda: plots.state_deviations(many),
        lambda: plots.demonstrations_in_frames(many, inputs.demonstrations),
    ):
        with pytest.raises(InvalidInput, match=rf"{MAX_STATES + 1} states, .*1 to {MAX_STATES}"):
            draw()


def test_plots_other_columns_are_refused(inputs: Any):
    """The message gives both numbers of columns."""
    narrow = replace(inputs.motion, x=inputs.motion.x[:, :7])
    with pytest.raises(InvalidInput, match="the motion has 7 columns, expected the layout's 14"):
        plots.reproduction(inputs.adapted, narrow, inputs.frames)
    with pytest.raises(InvalidInput, match="frame 'world' has 3 columns"):
        plots.reproduction(inputs.adapted, inputs.motion, [world_frame(3)])
    with pytest.raises(InvalidInput, match="the feedback has 14 columns, expected the layout's 7"):
        plots.feedback_gains(inputs.feedback, pose_layout())
    other = replace(inputs.demonstrations[0], layout=pose_layout(), x=inputs.demonstrations[0].x[:, :7])
    with pytest.raises(InvalidInput, match="'demonstration 0' has the columns"):
        plots.tracked_coordinates(inputs.adapted, inputs.states, inputs.motion, demonstration=other)


def test_tracked_coordinates_unusable_states_are_refused(inputs: Any):
    """There is one state per step of the motion, and it is a state of the skill."""
    with pytest.raises(InvalidInput, match="states has 23 entries, expected 24"):
        plots.tracked_coordinates(inputs.adapted, inputs.states[1:], inputs.motion)
    with pytest.raises(InvalidInput, match="states has entries from 1 to 4, expected 0 to 3"):
        plots.tracked_coordinates(inputs.adapted, inputs.states + 1, inputs.motion)


def test_tracked_coordinates_other_period_is_refused(inputs: Any):
    """Motions of another period would be scaled in time."""
    with pytest.raises(InvalidInput, match=r"the motion has a period of 0\.2 s, expected the skill's 0\.1 s"):
        plots.tracked_coordinates(inputs.adapted, inputs.states, replace(inputs.motion, period=0.2))


def test_via_points_unusable_points_are_refused(inputs: Any):
    """A point after the end, no points, and a baseline of other steps are refused."""
    point = via_point("position", np.zeros(3), time=99.0, deviation=0.1)
    layout, motion = inputs.adapted.layout, inputs.motion
    with pytest.raises(InvalidInput, match="the time of 'position' is 99 s"):
        plots.via_points(layout, motion, [point])
    with pytest.raises(InvalidInput, match="points is empty"):
        plots.via_points(layout, motion, [])
    with pytest.raises(InvalidInput, match=r"shape \(23, 14\), expected \(24, 14\)"):
        plots.via_points(layout, motion, [], baseline=replace(motion, x=motion.x[1:], u=motion.u[1:]))


def test_plots_unknown_column_names_nearest(inputs: Any):
    """The message gives the nearest name."""
    with pytest.raises(InvalidInput, match="no column 'position w', the nearest is 'position"):
        plots.state_deviations(inputs.skill, columns=["position w"])
    with pytest.raises(InvalidInput, match="no column 'height of it'"):
        plots.demonstrations_in_frames(
            inputs.skill, inputs.demonstrations, planes=[("position x", "height of it")]
        )
    with pytest.raises(InvalidInput, match="columns is empty"):
        plots.tracked_coordinates(inputs.adapted, inputs.states, inputs.motion, columns=[])
    with pytest.raises(InvalidInput, match="planes is empty"):
        plots.reproduction(inputs.adapted, inputs.motion, inputs.frames, planes=[])


def test_demonstrations_in_frames_without_position_needs_planes(
    inputs: Any, make_skill_of_size: Callable[..., Skill]
):
    """A layout of joints needs named planes."""
    joints = Layout((Part("joint", Quantity.SCALAR, 4, "rad"),))
    skill = make_skill_of_size(3, ("world",), joints)
    demo = replace(
        inputs.demonstrations[0],
        layout=joints,
        x=inputs.demonstrations[0].x[:, :4],
        frames=(world_frame(4),),
    )
    with pytest.raises(InvalidInput, match="no position of two or more axes, only joint 1, joint 2"):
        plots.demonstrations_in_frames(skill, [demo])
    figure = plots.demonstrations_in_frames(skill, [demo], planes=[("joint 1", "joint 3")])
    assert figure.axes[0].get_ylabel() == "joint 3 [rad]"


def test_demonstrations_in_frames_other_frames_are_refused(
    inputs: Any, make_skill_of_size: Callable[..., Skill]
):
    """Skill and demonstrations have the same frames."""
    with pytest.raises(InvalidInput, match="demonstrations have the frames"):
        plots.demonstrations_in_frames(make_skill_of_size(2, ("world",)), inputs.demonstrations)


def test_state_graph_markov_chain_is_refused(inputs: Any):
    """A Markov chain has no durations."""
    markov = replace(inputs.skill, dynamics=MarkovChain(np.full(4, 0.25), np.full((4, 4), 0.25)))
    for draw in (plots.state_graph, lambda skill: plots.forward_variable(skill, horizon=5)):
        with pytest.raises(InvalidInput, match="has MarkovChain, expected a SemiMarkovChain"):
            draw(markov)
    with pytest.raises(InvalidInput, match=r"min_probability is 1\.5"):
        plots.state_graph(inputs.skill, min_probability=1.5)


def test_feedback_gains_other_layout_is_refused(inputs: Any):
    """The second half of the state must be the derivative of the first."""
    parts = inputs.adapted.layout.parts
    mixed = Layout((parts[2], parts[3], parts[0], parts[1]))
    with pytest.raises(InvalidInput, match="expected coordinates, then the derivative of each"):
        plots.feedback_gains(inputs.feedback, mixed)


def test_basis_vectors_full_covariances_are_refused(inputs: Any):
    """Full covariances share no basis."""
    with pytest.raises(InvalidInput, match="covariances are full, expected semi-tied"):
        plots.basis_vectors(inputs.skill)


def test_covariance_correlations_unusable_skills_are_refused(
    inputs: Any, make_skill_of_size: Callable[..., Skill]
):
    """Skills have the same frames, and there is at least one."""
    with pytest.raises(InvalidInput, match="skills differ in frames"):
        plots.covariance_correlations([inputs.skill, make_skill_of_size(4, ("world",))])
    with pytest.raises(InvalidInput, match="skills is empty"):
        plots.covariance_correlations([])
    with pytest.raises(InvalidInput, match="fits has 0 entries"):
        plots.likelihood_trace([])


def test_online_clusters_unusable_models_are_refused(inputs: Any):
    """The models are one model in order of time that has a cluster at the end."""
    with pytest.raises(InvalidInput, match="expected the earliest first"):
        plots.online_clusters(inputs.online_models[::-1])
    with pytest.raises(InvalidInput, match="expected the earliest first"):
        plots.online_clusters(
            [replace(inputs.online_models[0], frame_names=("a", "b")), inputs.online_models[1]]
        )
    with pytest.raises(InvalidInput, match="models has no model with a cluster"):
        plots.online_clusters([])
