"""Contents of the plots of model selection, frame relevance and online models."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from pilotfish import plots
from pilotfish.demonstrations import Layout, Part, Quantity, pose_layout
from pilotfish.errors import InvalidInput
from pilotfish.gaussians.structures import (
    Full,
    SemiTied,
)
from pilotfish.models import (
    Candidate,
    DurationModel,
    FrameRelevance,
    Selection,
    Skill,
    durations,
)

LAYOUT = pose_layout().differentiate()
NO_OBSERVATIONS = np.empty((0, 4))  # log p(x | state) of no observation, four states


def by_gid(figure: Figure, kind: type, text: str) -> list[Any]:
    return figure.findobj(lambda artist: isinstance(artist, kind) and text in (artist.get_gid() or ""))


def test_model_selection_points_equal_scores_and_ring_selection(inputs: Any):
    """A point is the score minus the highest; its bar is the error of the difference."""
    selection, top = inputs.selection, inputs.selection.highest_held_out
    left, right = plots.model_selection(selection).axes
    bars = {float(y): bar for c in left.containers for y, bar in _points_and_bars(c)}
    assert len(bars) == len(selection.scores)
    for score in selection.scores:
        gains = score.held_out - top.held_out
        error = gains.std(ddof=1) / np.sqrt(len(gains))
        heights = np.array(list(bars))
        nearest = bars[heights[np.abs(heights - gains.mean()).argmin()]]
        np.testing.assert_allclose(nearest, 2.0 * error, atol=1e-12)
    drawn = np.concatenate([line.get_ydata() for line in right.get_lines() if len(line.get_xdata()) > 1])
    np.testing.assert_array_equal(np.sort(drawn), np.sort([s.bic for s in selection.scores]))
    (ring,) = (line for line in right.get_lines() if len(line.get_xdata()) == 1)
    best = selection.best
    assert abs(float(ring.get_xdata()[0]) - best.candidate.states) <= 0.3
    assert float(ring.get_ydata()[0]) == best.bic


def test_model_selection_equal_scores_do_not_overlap(inputs: Any):
    """Markers of one structure do not overlap; each duration model has its own, as in the legend."""
    first = inputs.selection.scores[0]
    dynamics = {
        "viterbi": {},
        "gaussian": {"durations": DurationModel(durations.Gaussian)},
        "gamma": {"durations": DurationModel(durations.Gamma)},
        "poisson": {"durations": DurationModel(durations.Poisson)},
        "markov": {"dynamics": "markov"},
    }
    equal = tuple(
        replace(first, candidate=Candidate(states, structure, **choice))
        for structure in (Full(), SemiTied())
        for choice in dynamics.values()
        for states in range(3, 9)
    )
    figure = plots.model_selection(Selection(equal, ()))
    figure.draw_without_rendering()
    for panel in figure.axes:
        lines = [line for line in panel.get_lines() if len(line.get_xdata()) == 6]
        assert len(lines) == 10
        for colour in {line.get_color() for line in lines}:
            same = [line for line in lines if line.get_color() == colour]
            pixels = panel.transData.transform([line.get_xydata()[0] for line in same])
            assert np.diff(np.sort(pixels[:, 0])).min() > same[0].get_markersize() / 72.0 * figure.dpi
        assert len({line.get_marker() for line in lines}) == 5
    markers = {t.get_text(): h.get_marker() for t, h in _legend(figure)}
    assert {markers[name] for name in dynamics} == {line.get_marker() for line in lines}


def _legend(figure: Figure) -> list[tuple[Any, Any]]:
    (legend,) = figure.legends
    return list(zip(legend.get_texts(), legend.legend_handles, strict=True))


def _points_and_bars(container: Any) -> list[tuple[float, float]]:
    points, _, (bars,) = container.lines
    heights = [float(np.ptp(segment[:, 1])) for segment in bars.get_segments()]
    return list(zip(points.get_ydata(), heights, strict=True))


def test_model_selection_impossible_demonstration_is_triangle(inputs: Any):
    """A score of minus infinity is a triangle at the lower edge."""
    first, *others = inputs.selection.scores
    impossible = replace(first, held_out=np.array([1.0, 2.0, -np.inf, 3.0]))
    left = plots.model_selection(Selection((impossible, *others), ())).axes[0]
    marks = [line for line in left.get_lines() if line.get_marker() == "v" and len(line.get_xdata())]
    assert len(marks) == 1
    assert abs(float(marks[0].get_xdata()[0]) - first.candidate.states) < 0.5
    assert 0.0 < float(marks[0].get_ydata()[0]) < 0.1


def test_model_selection_too_many_structures_are_refused(inputs: Any):
    many = [
        replace(s, candidate=replace(s.candidate, structure=SemiTied(tying=n / 100.0)))
        for n, s in enumerate(inputs.selection.scores)
    ]
    with pytest.raises(InvalidInput, match="30 structures, expected at most 8"):
        plots.model_selection(Selection(tuple(many), ()))


def test_state_deviations_many_columns_have_short_legend(make_skill_of_size: Callable[..., Skill]):
    """Of 84 columns, the legend lists one per colour with the number of others."""
    body = Layout(tuple(Part(f"node {n}", Quantity.POSITION, 3, "m") for n in range(28)))
    figure = plots.state_deviations(make_skill_of_size(layout=body, frames=("world",)))
    assert len([line for line in figure.axes[0].get_lines() if len(line.get_xdata()) == 4]) == 84
    (legend,) = figure.legends
    labels = [text.get_text() for text in legend.get_texts()]
    assert labels == [*(f"node 0 {axis} and 27 more" for axis in "xyz"), "most precise state"]


def test_frame_relevance_cells_equal_values(inputs: Any, rng: np.random.Generator):
    """Numbers are the rounded values; an empty cell is zero; an infinite cost has its sign."""
    values, costs = inputs.frame_relevance.values.copy(), inputs.frame_relevance.costs.copy()
    values[1, 2], values[0, 1], costs[0, 0], costs[2, 3], costs[1, 1] = 1e-4, 1.0, np.inf, -1e-9, 3.14
    above, below = plots.frame_relevance(replace(inputs.frame_relevance, values=values, costs=costs)).axes[:2]
    for panel, numbers, close in ((above, values, 0.005), (below, costs, 0.5)):
        cells = {(round(t.get_position()[1]), round(t.get_position()[0])): t.get_text() for t in panel.texts}
        assert len(cells) == numbers.size
        for cell, number in np.ndenumerate(numbers):
            if cells[cell] not in ("<.01", "∞"):
                assert float(cells[cell] or 0.0) == pytest.approx(number, abs=close + 1e-12)
    assert (cells[0, 0], cells[2, 3], cells[1, 1]) == ("∞", "", "3.1")
    assert {t.get_text() for t in above.texts if t.get_position() == (2, 1)} == {"<.01"}


def test_frame_relevance_colours_are_ordered(inputs: Any):
    """The colour of a cell is the norm of its value, in the order of costs."""
    above, below = (axes.get_images()[0] for axes in plots.frame_relevance(inputs.frame_relevance).axes[:2])
    np.testing.assert_array_equal(above.norm(above.get_array()), inputs.frame_relevance.values)
    colours = np.asarray(below.norm(below.get_array()))
    np.testing.assert_array_equal(
        np.argsort(colours.ravel()), np.argsort(inputs.frame_relevance.costs.ravel())
    )
    assert colours.min() > 0.0
    assert colours.max() == pytest.approx(1.0)


def test_frame_relevance_distractor_has_grey_name(inputs: Any):
    for panel in plots.frame_relevance(inputs.frame_relevance).axes[:2]:
        grey = [tick.get_text() for tick in panel.get_yticklabels() if tick.get_color() != "black"]
        assert grey == ["distractor"]


def test_frame_relevance_many_states_have_no_numbers():
    """25 states have no numbers, 24 have."""
    for states, figures in ((24, 48), (25, 0)):
        frame_relevance = FrameRelevance(np.ones((2, states)), np.ones((2, states)), ("one", "other"))
        panels = plots.frame_relevance(frame_relevance).axes[:2]
        assert [len(panel.texts) for panel in panels] == [figures, figures]


def test_online_clusters_lines_equal_clusters_and_dimensions(inputs: Any):
    """Above is K at every time; below is each cluster's dimension while it exists."""
    figure, last = plots.online_clusters(inputs.online_models), inputs.online_models[-1]
    times = [model.datapoints for model in inputs.online_models]
    (line,) = figure.axes[0].get_lines()
    np.testing.assert_array_equal(line.get_xdata(), times)
    np.testing.assert_array_equal(line.get_ydata(), [model.clusters for model in inputs.online_models])
    clusters = {int(i) for model in inputs.online_models for i in model.cluster_ids}
    assert clusters > set(last.cluster_ids.tolist())  # one was deleted
    for p in range(2):
        for cluster_id in clusters:
            (drawn,) = by_gid(figure, Line2D, f"cluster {cluster_id} frame {p}")
            true = [
                dict(zip(m.cluster_ids.tolist(), m.dimensions[:, p].tolist(), strict=True)).get(cluster_id)
                for m in inputs.online_models
            ]
            expected = np.array([np.nan if d is None else d for d in true])
            offset = drawn.get_ydata() - expected
            assert np.isnan(expected).tolist() == np.isnan(offset).tolist()
            assert np.nanmax(np.abs(offset)) < 0.2


def test_reproduction_selection_points_equal_gains_and_ring_selection(inputs: Any):
    """A point is the gain over the default, and its bar the error of the difference on both sides."""
    selection = inputs.reproduction_selection
    (axes,) = plots.reproduction_selection(selection).axes
    drawn = sorted(pair for c in axes.containers for pair in _points_and_bars(c))
    gains = sorted(selection.gain(score) for score in selection.scores)
    np.testing.assert_allclose(drawn, [(gain, 2.0 * error) for gain, error in gains], atol=1e-12)
    (ring,) = by_gid(axes.figure, Line2D, "selected")
    assert float(ring.get_ydata()[0]) == selection.gain(selection.best)[0]
    assert abs(float(ring.get_xdata()[0]) - selection.best.states) < 0.31


def test_reproduction_selection_without_default_draws_mean_scores(inputs: Any):
    failed = replace(inputs.reproduction_selection, scores=inputs.reproduction_selection.scores[2:])
    (axes,) = plots.reproduction_selection(failed).axes
    drawn = sorted(y for c in axes.containers for y, _ in _points_and_bars(c))
    np.testing.assert_allclose(drawn, sorted(score.mean for score in failed.scores))
    assert "lower is better" in axes.get_title(loc="left")
