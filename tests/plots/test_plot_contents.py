"""Contents of plots: contours, bands, arrows, densities, lines and colours equal their values."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyArrowPatch, Polygon

from pilotfish import plots
from pilotfish.demonstrations import pose_layout, views
from pilotfish.errors import InvalidInput
from pilotfish.gaussians.structures import (
    DenseCovariances,
    SemiTiedCovariances,
    component_correlation,
)
from pilotfish.models import (
    SemiMarkovChain,
    Skill,
    durations,
)
from pilotfish.planning import via_point
from pilotfish.plots.style import state_colour

LAYOUT = pose_layout().differentiate()
NO_OBSERVATIONS = np.empty((0, 4))  # log p(x | state) of no observation, four states


def by_gid(figure: Figure, kind: type, text: str) -> list[Any]:
    return figure.findobj(lambda artist: isinstance(artist, kind) and text in (artist.get_gid() or ""))


def chain(rng: np.random.Generator) -> SemiMarkovChain:
    """Return four states in a circle with forward and backward transitions; none is final."""
    transitions = rng.uniform(0.05, 1.0, (4, 4)) * (1.0 - np.eye(4))
    transitions /= transitions.sum(axis=1, keepdims=True)
    gaussian = durations.Gaussian(rng.uniform(3.0, 9.0, 4), rng.uniform(0.5, 2.0, 4))
    return SemiMarkovChain(np.eye(4)[0], transitions, gaussian)


def test_demonstrations_in_frames_ellipses_have_unit_distance(inputs: Any):
    """Every vertex of an ellipse has Mahalanobis distance one."""
    figure = plots.demonstrations_in_frames(inputs.skill, inputs.demonstrations)
    for p, name in enumerate(inputs.skill.frame_names):
        for k in range(inputs.skill.states):
            for plane, patch in zip(
                ((0, 1), (0, 2)), by_gid(figure, Polygon, f"{name} state {k}"), strict=True
            ):
                mean = inputs.skill.means[p, k][list(plane)]
                covariance = inputs.skill.covariances[p].dense[k][np.ix_(plane, plane)]
                offsets = patch.get_xy() - mean
                distances = np.einsum("ni,ij,nj->n", offsets, np.linalg.inv(covariance), offsets)
                np.testing.assert_allclose(distances, 1.0, rtol=1e-9)


def test_demonstrations_in_frames_one_ellipse_per_state_frame_and_plane(inputs: Any):
    """There is one ellipse per state, frame and plane."""
    planes = [("position y", "position z"), ("position x", "position x'"), ("position z", "position y")]
    figure = plots.demonstrations_in_frames(inputs.skill, inputs.demonstrations, planes=planes)
    count = len(by_gid(figure, Polygon, "state "))
    assert count == inputs.skill.states * len(inputs.skill.frame_names) * len(planes)


def test_demonstrations_in_frames_paths_equal_views(inputs: Any):
    """The paths in a row of panels are the views from its frame."""
    figure = plots.demonstrations_in_frames(inputs.skill, inputs.demonstrations)
    data, ends = views(inputs.demonstrations), np.cumsum([len(d.x) for d in inputs.demonstrations])
    for p in range(2):
        lines = [line for line in figure.axes[2 * p].get_lines() if len(line.get_xdata()) > 1]
        for line, path in zip(lines, np.split(data.x[p], ends[:-1]), strict=True):
            np.testing.assert_array_equal(line.get_xydata(), path[:, :2])


def test_plots_state_has_same_colour_everywhere(inputs: Any):
    """Ellipse, node and band of a state have the same colour."""
    ellipses = plots.demonstrations_in_frames(inputs.skill, inputs.demonstrations)
    graph = plots.state_graph(inputs.skill)
    tracked = plots.tracked_coordinates(inputs.adapted, inputs.states, inputs.motion)
    for k in range(inputs.skill.states):
        ellipse = by_gid(ellipses, Polygon, f"state {k}")[0].get_edgecolor()
        node = by_gid(graph, Circle, f"state {k}")[0].get_facecolor()
        band = by_gid(tracked, object, f"band of state {k}")[0].get_facecolor()[0]
        np.testing.assert_allclose(ellipse[:3], node[:3])
        np.testing.assert_allclose(ellipse[:3], band[:3])


@pytest.mark.parametrize("gap", [-0.03, 0.0, 0.001, 0.03, 0.5])
def test_reproduction_close_frames_have_distinct_names(inputs: Any, gap: float):
    """Names of two close origins do not overlap, in either order."""
    first, second = inputs.frames
    near = first.b.copy()
    near[:3] += gap
    figure = plots.reproduction(inputs.adapted, inputs.motion, (first, replace(second, b=near)))
    renderer = FigureCanvasAgg(figure).get_renderer()
    figure.draw(renderer)
    for panel in figure.axes[:2]:
        names = [text for text in panel.texts if text.get_text() in inputs.skill.frame_names]
        a, b = (text.get_window_extent(renderer) for text in names)
        assert not a.overlaps(b)


def test_tracked_coordinates_bands_equal_mean_and_deviation(inputs: Any):
    """A band covers mean minus to mean plus deviation over its segment."""
    figure = plots.tracked_coordinates(inputs.adapted, inputs.states, inputs.motion)
    for column, panel in enumerate(figure.axes):
        end = -0.05  # half a step before the first
        for k in range(inputs.skill.states):
            (band,) = (c for c in panel.collections if c.get_gid() == f"band of state {k}")
            (x0, low), (x1, high) = band.get_paths()[0].get_extents().get_points()
            mean = inputs.adapted.means[k, column]
            deviation = np.sqrt(inputs.adapted.covariances[k, column, column])
            np.testing.assert_allclose([low, high], [mean - deviation, mean + deviation])
            np.testing.assert_allclose([x0, x1], [end, end + 0.6])  # six steps of .1 s, no gap
            end = x1


def test_state_graph_min_probability_selects_arrows(inputs: Any, rng: np.random.Generator):
    """There is one arrow per transition of at least the smallest probability."""
    skill = replace(inputs.skill, dynamics=chain(rng))
    for min_probability in (0.0, 0.2, 0.5):
        figure = plots.state_graph(skill, min_probability=min_probability)
        arrows = [a for a in figure.axes[0].patches if isinstance(a, FancyArrowPatch)]
        expected = (skill.dynamics.transitions >= min_probability) & (skill.dynamics.transitions > 0.0)
        assert len(arrows) == expected.sum()


def test_state_graph_order_is_independent_of_labels(inputs: Any, rng: np.random.Generator):
    """A permutation of the states permutes the labels of the nodes only."""
    plain, shuffled = inputs.skill.dynamics, rng.permutation(4)
    relabelled = SemiMarkovChain(
        plain.initial[shuffled],
        plain.transitions[np.ix_(shuffled, shuffled)],
        durations.Gaussian(plain.durations.means[shuffled], plain.durations.deviations[shuffled]),
    )
    figure = plots.state_graph(replace(inputs.skill, dynamics=relabelled))
    positions = [by_gid(figure, Circle, f"state {k}")[0].get_center()[0] for k in range(4)]
    np.testing.assert_array_equal(positions, shuffled)


def test_state_graph_duration_densities_sum_to_one(inputs: Any):
    """The density times the period sums to one, up to the tail."""
    figure = plots.state_graph(inputs.skill)
    for axes in figure.axes[1:]:
        density = axes.get_lines()[0].get_ydata()
        assert float(np.sum(density)) * inputs.skill.period == pytest.approx(1.0, abs=1.001e-4)


def test_forward_variable_curves_equal_state_probabilities(inputs: Any, rng: np.random.Generator):
    """The upper curves are state probabilities; the rows of both panels sum to one."""
    skill = replace(inputs.skill, dynamics=chain(rng))
    above, below = plots.forward_variable(skill, horizon=25).axes
    probabilities = np.stack([line.get_ydata() for line in above.get_lines()], axis=1)
    np.testing.assert_allclose(probabilities, skill.dynamics.filtered_state_probs(NO_OBSERVATIONS, 25))
    ends = np.stack([line.get_ydata() for line in below.get_lines()], axis=1).sum(axis=1)
    np.testing.assert_allclose(ends[~np.isnan(ends)], 1.0)
    assert np.isfinite(ends[-1])


def test_feedback_gains_lines_equal_diagonal_and_norm(inputs: Any):
    """Lines are the diagonal of each part; the last is the norm of its block."""
    blocks = (inputs.feedback.stiffness, inputs.feedback.damping)
    figure = plots.feedback_gains(inputs.feedback, inputs.adapted.layout)
    for panel, (row, columns) in zip(
        figure.axes, ((row, columns) for row in blocks for columns in (slice(0, 3), slice(3, 7))), strict=True
    ):
        lines = [line.get_ydata() for line in panel.get_lines()]
        block = row[:, columns, columns]
        np.testing.assert_array_equal(np.transpose(lines[: block.shape[1]]), np.diagonal(block, 0, 1, 2))
        np.testing.assert_allclose(lines[block.shape[1]], np.sqrt((block**2).sum(axis=(1, 2))))


@pytest.mark.parametrize("precise", [0, 2, 3])
def test_state_deviations_most_precise_state_is_shaded(inputs: Any, precise: int):
    """A state whose covariance is a thousandth is shaded, in that frame."""
    dense = inputs.skill.covariances[1].dense.copy()
    dense[precise] *= 1e-3
    covariances = (inputs.skill.covariances[0], DenseCovariances(dense))
    figure = plots.state_deviations(replace(inputs.skill, covariances=covariances))
    for panel in figure.axes[2:]:
        (shade,) = (patch for patch in panel.patches if patch.get_gid() == "most precise")
        assert shade.get_x() + 0.5 * shade.get_width() == pytest.approx(precise)


def test_state_deviations_lines_equal_roots_of_variances(inputs: Any):
    """The line of a column is the root of the variances."""
    figure = plots.state_deviations(inputs.skill, columns=["position y", "orientation w"])
    for p, panel in enumerate(figure.axes[::2]):
        expected = np.sqrt(inputs.skill.covariances[p].dense[:, 1, 1])
        np.testing.assert_allclose(panel.get_lines()[0].get_ydata(), expected)


def test_basis_vectors_scaled_basis_is_unchanged(inputs: Any, rng: np.random.Generator):
    """Scaling the basis vectors does not change the heat map."""

    def scaled(c: SemiTiedCovariances) -> SemiTiedCovariances:
        return replace(c, basis=c.basis * rng.choice([-3.0, 0.1, 7.0], size=c.basis.shape[1]))

    other = replace(
        inputs.semi_tied_skill, covariances=tuple(map(scaled, inputs.semi_tied_skill.covariances))
    )
    for first, second in zip(
        plots.basis_vectors(inputs.semi_tied_skill).axes, plots.basis_vectors(other).axes, strict=True
    ):
        for a, b in zip(first.get_images(), second.get_images(), strict=True):
            np.testing.assert_allclose(a.get_array(), b.get_array())
            np.testing.assert_allclose(np.abs(a.get_array()).max(axis=0), 1.0)


def test_covariance_correlations_equal_component_correlation(
    inputs: Any, make_skill_of_size: Callable[..., Skill]
):
    """Rows of panels are frames, columns are skills; skills may differ in states."""
    both = [inputs.skill, make_skill_of_size(6)]
    panels = iter(plots.covariance_correlations(both).axes)
    for p in range(2):
        for skill in both:
            expected = component_correlation(skill.covariances[p].dense)
            np.testing.assert_array_equal(next(panels).get_images()[0].get_array(), expected)


def test_likelihood_trace_lines_equal_log_likelihoods(inputs: Any):
    """Every line has the log-likelihoods of its fit, and the label says whether it converged."""
    failed = replace(inputs.fit, convergence=replace(inputs.fit.convergence, converged=False))
    lines = plots.likelihood_trace([inputs.fit, failed]).axes[0].get_lines()
    for line in lines:
        np.testing.assert_array_equal(line.get_ydata(), inputs.fit.log_likelihoods)
    assert "not converged" in str(lines[1].get_label())
    assert "not converged" not in str(lines[0].get_label())


def test_via_points_markers_have_time_value_and_deviation(inputs: Any):
    """There is one panel per column; the bar is one deviation up and down."""
    points = [
        via_point("position", [0.1, 0.2, 0.3], time=0.5, deviation=[0.01, 0.02, 0.03]),
        via_point("position y", 0.4, time=1.1, deviation=0.05),
    ]
    figure = plots.via_points(LAYOUT, inputs.motion, points)
    panels = {axes.get_ylabel(): axes for axes in figure.axes}
    assert list(panels) == ["position x [m]", "position y [m]", "position z [m]"]
    (bar,), bars = (panels[f"position {axis} [m]"].containers for axis in "xy")
    assert len(bars) == 2
    mark, _, (column,) = bar.lines
    np.testing.assert_allclose(mark.get_xydata(), [[0.5, 0.1]])
    np.testing.assert_allclose(column.get_segments()[0], [[0.5, 0.09], [0.5, 0.11]])
    np.testing.assert_allclose(bars[1].lines[0].get_xydata(), [[1.1, 0.4]])
    line = panels["position z [m]"].get_lines()[0]
    np.testing.assert_allclose(line.get_ydata(), inputs.motion.x[:, 2])


def floor_lines(figure: Figure) -> list[float]:
    """Return the height of each line of the floor, panel by panel."""
    return [line.get_ydata()[0] for panel in figure.axes for line in panel.lines if line.get_gid() == "floor"]


def legend_labels(figure: Figure) -> list[str]:
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_state_deviations_floor_is_root_of_regularisation(inputs: Any):
    regularisation = np.full(inputs.skill.layout.tangent.width, 4e-4)
    figure = plots.state_deviations(replace(inputs.skill, regularisation=regularisation))
    assert floor_lines(figure) == pytest.approx([0.02] * len(figure.axes))
    assert "floor set by regularisation" in legend_labels(figure)
    figure = plots.state_deviations(replace(inputs.skill, regularisation=None))
    assert floor_lines(figure) == []
    assert "floor set by regularisation" not in legend_labels(figure)


def test_state_deviations_given_floor_is_drawn_per_column(inputs: Any):
    layout = inputs.skill.layout.tangent
    floor = 0.001 * np.arange(1, layout.width + 1)
    columns = layout.names[:2]
    figure = plots.state_deviations(inputs.skill, columns=columns, floor=floor)
    assert floor_lines(figure) == pytest.approx([0.001, 0.002] * len(inputs.skill.frame_names))
    with pytest.raises(InvalidInput, match="expected deviations of at least 0"):
        plots.state_deviations(inputs.skill, floor=-floor)
    with pytest.raises(InvalidInput, match="floor has shape"):
        plots.state_deviations(inputs.skill, floor=floor[:-1])


def test_state_deviations_legend_entries_are_distinct(inputs: Any):
    figure = plots.state_deviations(inputs.skill)
    styles = [
        (line.get_color(), line.get_linestyle(), line.get_marker()) for line in figure.legends[0].get_lines()
    ]
    assert len(set(styles)) == len(styles) > 4


def test_reproduction_numbers_every_state_in_every_panel(inputs: Any):
    figure = plots.reproduction(inputs.adapted, inputs.motion, inputs.frames)
    numbers = {str(k) for k in range(inputs.adapted.states)}
    for panel in figure.axes:
        boxed = [text for text in panel.texts if text.get_bbox_patch()]
        assert {text.get_text() for text in boxed} == numbers
        for text in boxed:
            edge = text.get_bbox_patch().get_edgecolor()
            assert edge == to_rgba(state_colour(int(text.get_text())))
