"""Content of the page: what it refuses, and the situations it can begin with."""

from dataclasses import replace

import numpy as np
import pytest

from pilotfish.demonstrations import Demonstration, Layout, Part, Quantity, demonstration
from pilotfish.errors import InvalidInput
from pilotfish.models import Skill
from pilotfish.panel import compute_reproduction, view_content

Demonstrations = tuple[Demonstration, ...]


def test_situations_are_those_of_demonstrations(reaches: Demonstrations, reach_skill: Skill):
    content = view_content(reaches, reach_skill)
    assert [each.name for each in content.situations] == [f"{m}: reach {m}" for m in range(5)]
    np.testing.assert_array_equal(content.situations[3].frames[1].b, reaches[3].frames[1].b)


def test_given_frames_come_first(reaches: Demonstrations, reach_skill: Skill):
    given = [each.at(0) for each in reaches[2].frames]
    content = view_content((), reach_skill, given)
    assert [each.name for each in content.situations] == ["given frames"]
    assert len(view_content(reaches, reach_skill, given).situations) == 6


def test_skill_alone_begins_in_the_middle(reaches: Demonstrations, reach_skill: Skill):
    (situation,) = view_content((), reach_skill).situations
    offsets = np.array([demo.frames[1].b for demo in reaches])
    expected = 0.5 * (offsets.min(axis=0) + offsets.max(axis=0))
    np.testing.assert_allclose(situation.frames[1].b, expected)
    assert compute_reproduction(reach_skill, situation.frames).reproduction is not None


def test_skill_without_ranges_needs_frames(reach_skill: Skill):
    with pytest.raises(InvalidInput, match="does not state where its frames home, cup"):
        view_content((), replace(reach_skill, demonstrated=None))


def test_joints_only_are_refused():
    layout = Layout((Part("joint", Quantity.SCALAR, 7, "rad"),))
    demo = demonstration(np.zeros((5, 7)), 0.1, layout)
    with pytest.raises(InvalidInput, match="expected a position of at most three axes"):
        view_content([demo])


def test_bad_content_is_refused(reaches: Demonstrations, reach_skill: Skill, strokes: Demonstrations):
    with pytest.raises(InvalidInput, match="missing"):
        view_content()
    with pytest.raises(InvalidInput, match="display it on its own"):
        view_content(strokes, reach_skill)
    with pytest.raises(InvalidInput, match="expected those of the skill: home, cup"):
        view_content([replace(reaches[0], frames=reaches[0].frames[:1])], reach_skill)
    with pytest.raises(InvalidInput, match="expected at most 100"):
        view_content(reaches * 21)
    with pytest.raises(InvalidInput, match="expected each of home, cup once"):
        view_content((), reach_skill, [reaches[0].frames[0]])  # type: ignore[list-item]


def test_problem_is_reported_instead_of_raised(reaches: Demonstrations, reach_skill: Skill):
    """A skill that states no lengths has states, and the reason why it has no motion."""
    unknown = replace(reach_skill, provenance=replace(reach_skill.provenance, demonstrations=()))
    live = compute_reproduction(unknown, reaches[0].frames)  # type: ignore[arg-type]
    assert live.adapted is not None
    assert live.reproduction is None
    assert "length of its demonstrations" in live.problem
    unfit = compute_reproduction(reach_skill, reaches[0].frames[:1])  # type: ignore[arg-type]
    assert (unfit.adapted, unfit.reproduction) == (None, None)
    assert "expected each of ['home', 'cup'] once" in unfit.problem
