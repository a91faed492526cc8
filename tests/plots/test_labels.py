"""Pictures stay readable where things coincide, where states are many, and where there is only one."""

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
    """Frames stand where two of the states are, and the motion begins at the first of them."""
    space, frames = slice(0, 3), []
    for frame, mean in zip(inputs.frames, inputs.adapted.means, strict=False):
        b = frame.b.copy()
        b[space] = mean[space]
        frames.append(replace(frame, b=b))
    x = inputs.motion.x.copy()
    x[0, space] = frames[0].b[space]
    return plots.reproduction(inputs.adapted, replace(inputs.motion, x=x), frames)


def test_labels_cover_neither_each_other_nor_leave_their_panel(inputs: Any):
    """States that coincide with frames, and frames at the rim, have labels that can all be read."""
    figure = overlapping_labels_figure(inputs)
    renderer = FigureCanvasAgg(figure).get_renderer()
    figure.draw(renderer)
    for panel in figure.axes[:2]:
        boxes = [text.get_window_extent(renderer) for text in panel.texts if isinstance(text, Annotation)]
        assert len(boxes) >= inputs.adapted.states + len(inputs.frames)
        for one, two in combinations(boxes, 2):
            width = min(one.x1, two.x1) - max(one.x0, two.x0)
            height = min(one.y1, two.y1) - max(one.y0, two.y0)
            assert min(width, height) <= 1.0  # pixel
        rim = panel.get_window_extent(renderer).padded(1.0)
        assert all(rim.containsx(x) and rim.containsy(y) for box in boxes for x, y in box.corners())


def test_the_beginning_lies_above_frames_and_states(inputs: Any):
    """No square of a frame hides the dot where the motion begins."""
    for panel in overlapping_labels_figure(inputs).axes:
        (dot,) = (line for line in panel.get_lines() if line.get_marker() == "o" and line.get_zorder() == 7)
        assert all(line is dot or line.get_zorder() < 7 for line in panel.get_lines())


@pytest.mark.parametrize("stretch", [1.0, 0.01, 30.0])
def test_space_has_one_scale(inputs: Any, stretch: float):
    """A metre is drawn equally long along x, y and z, be the motion long or flat."""
    x = inputs.motion.x.copy()
    x[:, 2] *= stretch
    panel = plots.reproduction(inputs.adapted, replace(inputs.motion, x=x), inputs.frames).axes[2]
    ranges = np.ptp([panel.get_xlim3d(), panel.get_ylim3d(), panel.get_zlim3d()], axis=1)
    shares = ranges / panel.get_box_aspect()
    np.testing.assert_allclose(shares, shares[0])


def test_a_skill_of_one_state_says_why_no_visit_ends(make_skill_of_size: Callable[..., Skill]):
    """The lower panel of the forward variable is not left empty without a word."""
    _, below = plots.forward_variable(make_skill_of_size(1, ("world",)), horizon=9).axes
    assert [text.get_text() for text in below.texts] == ["a final state: no visit ends"]
    assert not plots.forward_variable(make_skill_of_size(2, ("world",)), horizon=9).axes[1].texts


@pytest.mark.parametrize("count", [2, 10, 11, 24])
def test_a_graph_of_many_states_fits_a_page_and_keeps_every_arrow(
    make_skill_of_size: Callable[..., Skill], rng: np.random.Generator, count: int
):
    """Rows are added, not breadth; each transition, within a row or out of it, has one arrow."""
    skill = make_skill_of_size(count, ("world",))
    onward = np.triu(rng.uniform(size=(count, count)) * (rng.uniform(size=(count, count)) < 0.2), k=2)
    onward[np.arange(count - 1), np.arange(1, count)] = 1.0
    onward[count // 2, 0] = 0.5
    onward /= np.maximum(onward.sum(axis=1, keepdims=True), 1e-300)
    durations = skill.dynamics.durations
    figure = plots.state_graph(
        replace(skill, dynamics=SemiMarkovChain(np.eye(count)[0], onward, durations)), min_probability=0.0
    )
    arrows = [a for axes in figure.axes for a in axes.patches if isinstance(a, FancyArrowPatch)]
    assert figure.get_figwidth() <= MAX_WIDTH
    assert len(arrows) == np.count_nonzero(onward)


@pytest.mark.parametrize(("low", "high"), [(0.85, 0.97), (0.02, 0.05), (0.011, 0.4)])
def test_deviations_have_plain_numbers_at_narrow_scales(
    make_skill_of_size: Callable[..., Skill], low: float, high: float
):
    """Ticks are numbers such as 0.9, at least two of them, and not powers of ten."""
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
