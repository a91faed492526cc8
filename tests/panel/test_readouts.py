"""Texts of the page: numbers, units and escaped names."""

from dataclasses import replace

import numpy as np
import pytest

from pilotfish.demonstrations import Demonstration
from pilotfish.geometry import Pose, angle, normalise
from pilotfish.models import Skill
from pilotfish.panel import compute_reproduction, readouts, reproduction_notes, view_content
from pilotfish.panel.frame_motions import frame_pose, move_frame

Demonstrations = tuple[Demonstration, ...]


def test_motion_has_numbers_with_units_at_the_time(reaches: Demonstrations, reach_skill: Skill):
    content = view_content(reaches, reach_skill)
    live = compute_reproduction(reach_skill, content.situations[0].frames)
    assert live.reproduction
    text = readouts.motion_html(content, live, 1.0)
    x = live.reproduction.motion.x[10]
    assert "10 of 23, 1.00 s" in text
    assert "position [m]" in text
    assert readouts.format_numbers(x[:3]) in text
    assert f">{live.reproduction.states[10]}</span>" in text
    assert readouts.format_numbers(live.reproduction.motion.x[-1, :3]) in readouts.computation_html(
        live, readouts.Cost(12.34, 5.6)
    )


def test_demonstration_is_described_without_a_skill(reaches: Demonstrations):
    content = view_content(reaches)
    assert readouts.format_numbers(reaches[0].x[5, :3]) in readouts.motion_html(content, None, 0.5)
    assert "Without a skill" in readouts.computation_html(None, readouts.Cost(0.0, 0.0))
    assert readouts.notes_html(None, None) == ""


def test_notes_and_problems_are_in_the_text(reaches: Demonstrations, reach_skill: Skill):
    content = view_content(reaches, reach_skill)
    pose = frame_pose(content.situations[0].frames[1], content.layout)
    far = move_frame(
        content.situations[0].frames[1], content.layout, Pose(pose.position + 9.0, pose.quaternion)
    )
    frames = (content.situations[0].frames[0], far)
    live = compute_reproduction(reach_skill, frames)
    notes = reproduction_notes(reach_skill, live, frames)
    assert "is 15." in readouts.notes_html(live, notes)  # 9 m along each axis
    assert "No notes" in readouts.notes_html(live, ())
    assert "..." in readouts.notes_html(live, None)
    assert "a &lt; b" in readouts.notes_html(replace(live, problem="a < b"), None)


@pytest.mark.parametrize("name", ["<b>{x}</b>", '"&'])
def test_names_are_escaped(name: str, reaches: Demonstrations, reach_skill: Skill):
    """Names come from files; viser inserts the text into the page."""
    skill = replace(reach_skill, frame_names=("home", name))
    demos = [replace(demo, frames=(demo.frames[0], replace(demo.frames[1], name=name))) for demo in reaches]
    text = readouts.summary_html(view_content(demos, skill), 0.05)
    assert name not in text
    assert "<b>" not in text
    assert "grid of 0.05 m" in text


def test_inputs_are_the_pose(rng: np.random.Generator):
    pose = Pose(rng.normal(size=3), normalise(rng.normal(size=4)))
    position, turn = readouts.pose_to_inputs(pose, 6)
    again = readouts.inputs_to_pose(position, turn)
    np.testing.assert_allclose(again.position, pose.position, atol=1e-6)
    assert angle(again.quaternion, pose.quaternion) < 2e-4  # two decimal places of a degree
    flat = readouts.inputs_to_pose((1.0, 2.0), (90.0,))
    np.testing.assert_allclose(flat.position, [1.0, 2.0, 0.0])
    np.testing.assert_allclose(flat.quaternion, [np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])
