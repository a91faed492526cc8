"""Plot of the gains of a tracker over time."""

from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from pilotfish.control import Feedback
from pilotfish.demonstrations import Layout, Part
from pilotfish.errors import InvalidInput
from pilotfish.plots.style import FIGURE_WIDTH, column_colour, legend_below, new_figure, style_axes
from pilotfish.plots.validation import require_type, require_width
from pilotfish.types import Array, Float


def feedback_gains(feedback: Feedback, layout: Layout) -> Figure:
    """Plot stiffness K^P [1/s^2] and damping K^V [1/s] over time, a column of panels per part.

    Lines are the diagonal: the acceleration of a coordinate for a deviation of its own. The dashed line is
    the Frobenius norm of the block of the part, which includes couplings.

    Args:
        feedback: Feedback of a second-order system.
        layout: Columns of the state: coordinates, then their derivatives.

    Returns:
        The figure.

    Raises:
        InvalidInput: If the layout has other columns than these, or another width.
    """
    require_type("feedback", feedback, Feedback)
    require_type("layout", layout, Layout)
    require_width("the feedback", feedback.gains.shape[2], layout)
    parts = _parts(feedback, layout)
    figure = new_figure(max(5.5, 0.5 * FIGURE_WIDTH * len(parts)), 5.4)
    panels = figure.subplots(2, len(parts), squeeze=False, sharex=True)
    seconds = feedback.period * np.arange(len(feedback.gains))
    for (part, columns), (above, below) in zip(parts, panels.T, strict=True):
        names = layout.names[columns]
        _draw_block(above, seconds, feedback.stiffness[:, columns, columns], names)
        _draw_block(below, seconds, feedback.damping[:, columns, columns], names)
        style_axes(above, x="time [s]", y="stiffness [1/s²]", title=part.name).set_xlabel("")
        style_axes(below, x="time [s]", y="damping [1/s]")
    legend_below(figure, _handles(layout, parts))
    return figure


def _parts(feedback: Feedback, layout: Layout) -> list[tuple[Part, slice]]:
    """Return the parts of the first half, whose derivatives are the second."""
    half, inputs = layout.width // 2, feedback.gains.shape[1]
    pairs = list(zip(layout.parts, layout.slices, strict=True))
    first = [(part, columns) for part, columns in pairs if columns.stop <= half]
    derivatives = [replace(part, derivative=part.derivative + 1, unit="") for part, _ in first]
    second = [replace(part, unit="") for part, columns in pairs if columns.stop > half]
    if derivatives != second or inputs != half:
        raise InvalidInput(
            f"the layout is {', '.join(layout.names)} with {inputs} inputs, expected coordinates, then the "
            "derivative of each, and an input for each coordinate; see add_derivatives"
        )
    return first


def _draw_block(
    axes: Axes, seconds: Float[Array, " S"], blocks: Float[Array, "S d d"], names: tuple[str, ...]
) -> None:
    for i, name in enumerate(names):
        axes.plot(seconds, blocks[:, i, i], color=column_colour(name, i), linewidth=1.8)
    axes.plot(seconds, np.linalg.norm(blocks, axis=(1, 2)), color="black", linestyle="--", linewidth=1.2)
    axes.axhline(0.0, color="0.6", linewidth=0.8)


def _handles(layout: Layout, parts: list[tuple[Part, slice]]) -> list[Line2D]:
    lines = [
        Line2D([], [], color=column_colour(name, i), label=name)
        for _, columns in parts
        for i, name in enumerate(layout.names[columns])
    ]
    return [*lines, Line2D([], [], color="black", linestyle="--", label="norm of the block")]
