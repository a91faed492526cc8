"""What cannot be drawn is refused in words that help, before a figure is begun."""

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


def test_more_states_than_can_be_told_apart_are_refused(
    make_skill_of_size: Callable[..., Skill], inputs: Any
):
    """Every picture that colours states names the number that it can tell apart."""
    many = make_skill_of_size(plots.MAX_STATES + 1)
    for draw in (
        lambda: plots.state_graph(many),
        lambda: plots.forward_variable(many, horizon=9),
        lambda: plots.state_deviations(many),
        lambda: plots.demonstrations_in_frames(many, inputs.demonstrations),
    ):
        with pytest.raises(InvalidInput, match=rf"{plots.MAX_STATES + 1} states, .*1 to {plots.MAX_STATES}"):
            draw()


def test_widths_that_disagree_are_refused(inputs: Any):
    """A motion, a frame, a feedback or a demonstration of other columns is named with both widths."""
    narrow = replace(inputs.motion, x=inputs.motion.x[:, :7])
    with pytest.raises(InvalidInput, match="the motion has 7 columns, expected the layout's 14"):
        plots.reproduction(inputs.adapted, narrow, inputs.frames)
    with pytest.raises(InvalidInput, match="frame 'world' has 3 columns"):
        plots.reproduction(inputs.adapted, inputs.motion, [world_frame(3)])
    with pytest.raises(InvalidInput, match="the feedback has 14 columns, expected the layout's 7"):
        plots.feedback_gains(inputs.feedback, pose_layout())
    other = replace(inputs.demonstrations[0], layout=pose_layout(), x=inputs.demonstrations[0].x[:, :7])
    with pytest.raises(InvalidInput, match="'showing 0' has the columns"):
        plots.tracked_coordinates(inputs.adapted, inputs.states, inputs.motion, demonstration=other)


def test_a_plan_of_another_length_or_of_unknown_states_is_refused(inputs: Any):
    """States are planned for every step of the motion, and are states of the skill."""
    with pytest.raises(InvalidInput, match="23 states were planned, expected 24"):
        plots.tracked_coordinates(inputs.adapted, inputs.states[1:], inputs.motion)
    with pytest.raises(InvalidInput, match="states run from 1 to 4, the skill has 0 to 3"):
        plots.tracked_coordinates(inputs.adapted, inputs.states + 1, inputs.motion)


def test_another_period_is_refused(inputs: Any):
    """Motions and demonstrations of another period would be stretched in time."""
    with pytest.raises(InvalidInput, match=r"the motion has a period of 0\.2 s, expected the skill's 0\.1 s"):
        plots.tracked_coordinates(inputs.adapted, inputs.states, replace(inputs.motion, period=0.2))


def test_points_that_have_no_place_in_the_motion_are_refused(inputs: Any):
    """A point after its end, none at all, or another motion of other steps beside it."""
    late = via_point("position", np.zeros(3), time=99.0, deviation=0.1)
    layout, motion = inputs.adapted.layout, inputs.motion
    with pytest.raises(InvalidInput, match="wished at 99 s"):
        plots.via_points(layout, motion, [late])
    with pytest.raises(InvalidInput, match="no points"):
        plots.via_points(layout, motion, [])
    with pytest.raises(InvalidInput, match=r"shape \(23, 14\), expected \(24, 14\)"):
        plots.via_points(layout, motion, [], baseline=replace(motion, x=motion.x[1:], u=motion.u[1:]))


def test_unknown_columns_are_refused_with_the_nearest(inputs: Any):
    """A misspelt column or plane is answered with the name that was probably meant."""
    with pytest.raises(InvalidInput, match="no column 'position w', the nearest is 'position"):
        plots.state_deviations(inputs.skill, columns=["position w"])
    with pytest.raises(InvalidInput, match="no column 'height of it'"):
        plots.demonstrations_in_frames(
            inputs.skill, inputs.demonstrations, planes=[("position x", "height of it")]
        )
    with pytest.raises(InvalidInput, match="no columns were asked for"):
        plots.tracked_coordinates(inputs.adapted, inputs.states, inputs.motion, columns=[])
    with pytest.raises(InvalidInput, match="no planes were asked for"):
        plots.reproduction(inputs.adapted, inputs.motion, inputs.frames, planes=[])


def test_without_a_position_planes_must_be_named(inputs: Any, make_skill_of_size: Callable[..., Skill]):
    """A layout of joints has no planes of its own; named ones are drawn."""
    joints = Layout((Part("joint", Quantity.SCALAR, 4, "rad"),))
    skill = make_skill_of_size(3, ("world",), joints)
    shown = replace(
        inputs.demonstrations[0],
        layout=joints,
        x=inputs.demonstrations[0].x[:, :4],
        frames=(world_frame(4),),
    )
    with pytest.raises(InvalidInput, match="no position of two or more axes but joint 1, joint 2"):
        plots.demonstrations_in_frames(skill, [shown])
    figure = plots.demonstrations_in_frames(skill, [shown], planes=[("joint 1", "joint 3")])
    assert figure.axes[0].get_ylabel() == "joint 3 [rad]"


def test_demonstrations_of_other_frames_are_refused(inputs: Any, make_skill_of_size: Callable[..., Skill]):
    """The skill and the demonstrations are seen from the same frames."""
    with pytest.raises(InvalidInput, match="demonstrations have the frames"):
        plots.demonstrations_in_frames(make_skill_of_size(2, ("world",)), inputs.demonstrations)


def test_only_semi_markov_skills_have_a_graph(inputs: Any):
    """A Markov chain has no durations to show."""
    markov = replace(inputs.skill, dynamics=MarkovChain(np.full(4, 0.25), np.full((4, 4), 0.25)))
    for draw in (plots.state_graph, lambda skill: plots.forward_variable(skill, horizon=5)):
        with pytest.raises(InvalidInput, match="has MarkovChain, expected a SemiMarkovChain"):
            draw(markov)
    with pytest.raises(InvalidInput, match=r"min_probability is 1\.5"):
        plots.state_graph(inputs.skill, min_probability=1.5)


def test_gains_need_coordinates_and_their_derivatives(inputs: Any):
    """Stiffness and damping have their units only where the second half is the derivative of the first."""
    parts = inputs.adapted.layout.parts
    mixed = Layout((parts[2], parts[3], parts[0], parts[1]))
    with pytest.raises(InvalidInput, match="expected coordinates, then the derivative of each"):
        plots.feedback_gains(inputs.feedback, mixed)


def test_only_semi_tied_skills_have_a_basis(inputs: Any):
    """Full covariances share nothing."""
    with pytest.raises(InvalidInput, match="covariances are full, expected semi-tied"):
        plots.basis_vectors(inputs.skill)


def test_skills_that_cannot_be_compared_are_refused(inputs: Any, make_skill_of_size: Callable[..., Skill]):
    """Correlations are shown frame by frame, so skills have the same frames; and there is at least one."""
    with pytest.raises(InvalidInput, match="skills differ in frames"):
        plots.covariance_correlations([inputs.skill, make_skill_of_size(4, ("world",))])
    with pytest.raises(InvalidInput, match="no skills"):
        plots.covariance_correlations([])
    with pytest.raises(InvalidInput, match="0 fits were given"):
        plots.likelihood_trace([])


def test_models_that_are_not_one_as_it_grew_are_refused(inputs: Any):
    """Growth is drawn of one model, earliest first, that has a cluster at last."""
    with pytest.raises(InvalidInput, match="earliest moment first"):
        plots.online_clusters(inputs.online_models[::-1])
    with pytest.raises(InvalidInput, match="earliest moment first"):
        plots.online_clusters(
            [replace(inputs.online_models[0], frame_names=("a", "b")), inputs.online_models[1]]
        )
    with pytest.raises(InvalidInput, match="no model has a cluster"):
        plots.online_clusters([])
