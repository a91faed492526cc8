"""Readability of plots with coinciding marks, many states, or one state."""

from collections.abc import Callable
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch
from matplotlib.text import Annotation

from pilotfish import plots
from pilotfish.gaussians.structures import DenseCovariances
from pilotfish.models import SemiMarkovChain, Skill

MAX_WIDTH = 16.0  # inches


def overlapping_labels_figure(inputs: Any) -> Figure:
    """Plot frames at two states, and a motion that begins at the first of them."""
    space, frames = slice(0, 3), []
    for frame, mean in zip(inputs.frames, inputs.adapted.means, strict=False):
        b = frame.b.copy()
        b[space] = mean[space]
        frames.append(replace(frame, b=b))
    x = inputs.motion.x.copy()
    x[0, space] = frames[0].b[space]
    return plots.reproduction(inputs.adapted, replace(inputs.motion, x=x), frames)


def test_place_labels_coinciding_marks_do_not_overlap(inputs: Any):
    """Labels of states that coincide with frames do not overlap and stay in the panel."""
    figure = overlapping_labels_figure(inputs)
    renderer = FigureCanvasAgg(figure).get_renderer()
    figure.draw(renderer)
    for panel in figure.axes[:2]:
        boxes = [text.get_window_extent(renderer) for text in panel.texts if isinstance(text, Annotation)]
        assert len(boxes) >= inputs.adapted.states + len(inputs.frames)
        for a, b in combinations(boxes, 2):
            width = min(a.x1, b.x1) - max(a.x0, b.x0)
            height = min(a.y1, b.y1) - max(a.y0, b.y0)
            assert min(width, height) <= 1.0  # pixel
        border = panel.get_window_extent(renderer).padded(1.0)
        assert all(border.containsx(x) and border.containsy(y) for box in boxes for x, y in box.corners())


def test_reproduction_start_is_drawn_above_frames(inputs: Any):
    """No square of a frame hides the dot at the start of the motion."""
    for panel in overlapping_labels_figure(inputs).axes:
        (dot,) = (line for line in panel.get_lines() if line.get_marker() == "o" and line.get_zorder() == 7)
        assert all(line is dot or line.get_zorder() < 7 for line in panel.get_lines())


@pytest.mark.parametrize("scale", [1.0, 0.01, 30.0])
def test_reproduction_space_has_equal_scales(inputs: Any, scale: float):
    """One metre has the same length along x, y and z, for long and for flat motions."""
    x = inputs.motion.x.copy()
    x[:, 2] *= scale
    panel = plots.reproduction(inputs.adapted, replace(inputs.motion, x=x), inputs.frames).axes[2]
    ranges = np.ptp([panel.get_xlim3d(), panel.get_ylim3d(), panel.get_zlim3d()], axis=1)
    scales = ranges / panel.get_box_aspect()
    np.testing.assert_allclose(scales, scales[0])


def test_forward_variable_one_state_has_note(make_skill_of_size: Callable[..., Skill]):
    """The lower panel of the forward variable has a note instead of curves."""
    _, below = plots.forward_variable(make_skill_of_size(1, ("world",)), horizon=9).axes
    assert [text.get_text() for text in below.texts] == ["final state: no segment ends"]
    assert not plots.forward_variable(make_skill_of_size(2, ("world",)), horizon=9).axes[1].texts


@pytest.mark.parametrize("count", [2, 10, 11, 24])
def test_state_graph_many_states_fits_page_with_every_arrow(
    make_skill_of_size: Callable[..., Skill], rng: np.random.Generator, count: int
):
    """The figure grows in rows, and every transition has one arrow."""
    skill = make_skill_of_size(count, ("world",))
    transitions = np.triu(rng.uniform(size=(count, count)) * (rng.uniform(size=(count, count)) < 0.2), k=2)
    transitions[np.arange(count - 1), np.arange(1, count)] = 1.0
    transitions[count // 2, 0] = 0.5
    transitions /= np.maximum(transitions.sum(axis=1, keepdims=True), 1e-300)
    durations = skill.dynamics.durations
    figure = plots.state_graph(
        replace(skill, dynamics=SemiMarkovChain(np.eye(count)[0], transitions, durations)),
        min_probability=0.0,
    )
    arrows = [a for axes in figure.axes for a in axes.patches if isinstance(a, FancyArrowPatch)]
    assert figure.get_figwidth() <= MAX_WIDTH
    assert len(arrows) == np.count_nonzero(transitions)


@pytest.mark.parametrize(("low", "high"), [(0.85, 0.97), (0.02, 0.05), (0.011, 0.4)])
def test_state_deviations_narrow_scale_has_plain_ticks(
    make_skill_of_size: Callable[..., Skill], low: float, high: float
):
    """Tick labels are at least two numbers such as 0.9, and no powers of ten."""
    skill = make_skill_of_size(4, ("world",))
    dense = np.stack([np.eye(skill.width) * d**2 for d in np.geomspace(low, high, 4)])
    figure = plots.state_deviations(replace(skill, covariances=(DenseCovariances(dense),)))
    FigureCanvasAgg(figure).draw()
    for panel in figure.axes:
        bottom, top = panel.get_ylim()
        within = [t for t in panel.yaxis.get_major_ticks() if bottom <= t.get_loc() <= top]
        assert len(within) >= 2
        assert all(float(t.label1.get_text()) == pytest.approx(t.get_loc()) for t in within)
        assert not any(t.label1.get_text() for t in panel.yaxis.get_minor_ticks())
