"""Properties of every plot: no warning, labels with units, nothing cut off or covered."""

import os
import re
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from pilotfish import plots
from pilotfish.models import FrameRelevance, Skill
from pilotfish.planning import via_point

DRAW: dict[str, Callable[[Any], Figure]] = {
    "demonstrations_in_frames": lambda t: plots.demonstrations_in_frames(t.skill, t.demonstrations),
    "state_graph": lambda t: plots.state_graph(t.skill),
    "forward_variable": lambda t: plots.forward_variable(t.skill, horizon=40),
    "reproduction": lambda t: plots.reproduction(
        t.adapted, t.motion, t.frames, demonstration=t.demonstrations[0]
    ),
    "tracked_coordinates": lambda t: plots.tracked_coordinates(
        t.adapted, t.states, t.motion, demonstration=t.demonstrations[0]
    ),
    "feedback_gains": lambda t: plots.feedback_gains(t.feedback, t.adapted.layout),
    "via_points": lambda t: plots.via_points(
        t.adapted.layout,
        t.motion,
        [
            via_point("position", np.ones(3), time=1.0, deviation=0.1),
            via_point("orientation", np.eye(4)[0], time=1.2, deviation=0.1),
        ],
        baseline=t.motion,
    ),
    "state_deviations": lambda t: plots.state_deviations(t.skill),
    "basis_vectors": lambda t: plots.basis_vectors(t.semi_tied_skill),
    "covariance_correlations": lambda t: plots.covariance_correlations([t.skill, t.semi_tied_skill]),
    "model_selection": lambda t: plots.model_selection(t.selection),
    "reproduction_selection": lambda t: plots.reproduction_selection(t.reproduction_selection),
    "frame_relevance": lambda t: plots.frame_relevance(t.frame_relevance),
    "online_clusters": lambda t: plots.online_clusters(t.online_models),
    "likelihood_trace": lambda t: plots.likelihood_trace([t.fit, t.fit]),
}
WITH_UNIT = re.compile(r"\[.+\]$")
COUNTS = {"state", "states", "iteration", "basis vector (first is 0)", "frame"}  # axes that have no unit


@pytest.fixture(scope="module", params=DRAW)
def picture(request: pytest.FixtureRequest, fixed_inputs: Any) -> Figure:
    """Draw each plot, and check that matplotlib's settings are unchanged."""
    before = dict(mpl.rcParams)
    figure = DRAW[request.param](fixed_inputs)
    FigureCanvasAgg(figure).draw()
    assert dict(mpl.rcParams) == before
    return figure


def assert_texts_inside_figure(figure: Figure) -> None:
    """Check that all artists lie inside the figure, within 1.5 pixels."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    box = figure.get_tightbbox(canvas.get_renderer())  # inches
    margin = 1.5 / figure.dpi
    assert box.x0 >= -margin
    assert box.y0 >= -margin
    assert box.x1 <= figure.get_figwidth() + margin
    assert box.y1 <= figure.get_figheight() + margin


def test_plots_all_functions_are_covered():
    """The tests below cover every function that creates a figure."""
    assert set(DRAW) == set(plots.__all__) - {"draw_ellipses", "state_colour"}


def test_plot_is_inside_figure(picture: Figure):
    """Every text and line lies inside the figure."""
    assert_texts_inside_figure(picture)


def test_plot_axes_have_labels_with_units(picture: Figure):
    """Each visible axis has a label with its unit, unless it counts."""
    for axes in picture.axes:
        for label, ticks in (
            (axes.get_xlabel(), axes.get_xticklabels()),
            (axes.get_ylabel(), axes.get_yticklabels()),
        ):
            texts = [tick.get_text() for tick in ticks if tick.get_visible() and tick.get_text()]
            rows = bool(texts) and all(WITH_UNIT.search(text) for text in texts)  # of a heat map
            hidden = not axes.axison or not texts
            assert hidden or rows or label in COUNTS or WITH_UNIT.search(label), (label, texts)


def test_plot_legend_is_outside_panels(picture: Figure):
    """The legend lies outside all panels, and no panel has its own."""
    renderer = FigureCanvasAgg(picture).get_renderer()
    for legend in picture.legends:
        box = legend.get_window_extent(renderer)
        assert not any(box.overlaps(axes.get_window_extent(renderer)) for axes in picture.axes)
    assert not any(axes.get_legend() for axes in picture.axes)


def test_plots_import_does_not_load_pyplot():
    """Pyplot is not imported: it keeps figures alive and selects a window system."""
    program = "import sys, pilotfish.plots; sys.exit('matplotlib.pyplot' in sys.modules)"
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    subprocess.run([sys.executable, "-W", "ignore", "-c", program], check=True, env=environment)


@pytest.mark.parametrize("count", [1, 20])
def test_plots_few_and_many_states_are_inside_figure(count: int, make_fixed_skill: Callable[..., Skill]):
    """Plots of one state and of twenty keep everything inside."""
    skill = make_fixed_skill(count, ("world",))
    assert_texts_inside_figure(plots.state_graph(skill))
    assert_texts_inside_figure(plots.forward_variable(skill, horizon=30))
    assert_texts_inside_figure(plots.state_deviations(skill))
    assert_texts_inside_figure(plots.covariance_correlations([skill]))
    values = np.full((5, count), 0.987)
    names = tuple(f"a frame with a long name {p}" for p in range(5))
    assert_texts_inside_figure(plots.frame_relevance(FrameRelevance(values, 12345.0 * values, names)))
