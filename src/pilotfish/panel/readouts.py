"""Texts of the page, as HTML: what is displayed, numbers at a time, and notes about the motion.

Names come from files of others. They are escaped here, and no text is written as Markdown, which viser would
evaluate as a program.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from pilotfish.demonstrations import Quantity
from pilotfish.geometry import Pose, from_rotation_vector, to_rotation_vector
from pilotfish.panel.colours import MOTION, STATE_COLOURS, demonstration_colour
from pilotfish.panel.content import ViewContent
from pilotfish.panel.live_reproduction import LiveReproduction
from pilotfish.panel.scene_values import step_at, tool_pose
from pilotfish.panel.spatial_columns import SPACE, orientation_part, position_part
from pilotfish.types import Array, Float
from pilotfish.validation import short_list

MAX_SCALARS = 8  # columns with a readout, such as a gripper
STYLE = "font-size: 0.8125rem; line-height: 1.45; padding: 0.1rem 0.75rem;"
Row = tuple[str, str]


@dataclass(frozen=True, slots=True)
class Cost:
    """Time that a computation took.

    Attributes:
        elapsed: Time on a clock [ms]; other programs that run lengthen it.
        processor: Time of the processor [ms].
    """

    elapsed: float
    processor: float


def summary_html(content: ViewContent, cell: float) -> str:
    """Return what is displayed, and what the lines and surfaces in the scene mean.

    Args:
        content: Content of the page.
        cell: Distance of two lines of the grid.
    """
    part, _ = position_part(content.layout)
    entries = []
    if content.skill:
        frames = short_list(content.skill.frame_names, 4)
        motion = f"motion of the skill ({content.skill.states} states), and tool as axes"
        entries.append(_entry(MOTION, "line", motion))
        entries.append(_entry(STATE_COLOURS[0], "disc", f"states, adapted to {frames}"))
    entries += _demonstration_entries(content)
    unit = f" {part.unit}" if part.unit != "1" else ""
    axes = "x red, y green, z blue" if part.size == SPACE else "x red, y green"
    entries.append(_entry("#bbbbbb", "line", f"grid of {cell:g}{unit}; axes {axes}"))
    return _block("".join(entries))


def _demonstration_entries(content: ViewContent) -> list[str]:
    """Return one entry for all demonstrations if they have one colour or are many, else one for each."""
    count = len(content.demonstrations)
    if not count:
        return []
    if content.skill or count > len(STATE_COLOURS):
        colour = demonstration_colour(0, beside_skill=content.skill is not None)
        return [_entry(colour, "line", f"demonstrations ({count})")]
    return [
        _entry(demonstration_colour(m, beside_skill=False), "line", demo.name or f"demonstration {m}")
        for m, demo in enumerate(content.demonstrations)
    ]


def motion_html(content: ViewContent, live: LiveReproduction | None, time: float) -> str:
    """Return the numbers of the motion at a time; without a motion, those of the first demonstration."""
    layout = content.layout
    if live and live.reproduction:
        x, period = live.reproduction.motion.x, live.reproduction.motion.period
        states = live.reproduction.states
    elif content.demonstrations:
        x, period, states = content.demonstrations[0].x, content.demonstrations[0].period, None
    else:
        return _block("No motion.")
    step, part = step_at(time, period, len(x)), position_part(layout)[0]
    pose = tool_pose(layout, x, step)
    rows = [("step", f"{step} of {len(x) - 1}, {step * period:.2f} s")]
    if states is None:
        rows.insert(0, ("demonstration", escape(content.demonstrations[0].name or "0")))
    else:
        rows.append(("state", f"{int(states[step])}"))
    rows.append((f"{part.name} [{part.unit}]", format_numbers(pose.position[: part.size])))
    if orientation_part(layout) is not None:
        rows.append(("orientation w x y z", format_numbers(pose.quaternion, 3)))
    rows += _scalar_rows(content, x[step])
    return _block(_table(rows))


def computation_html(live: LiveReproduction | None, cost: Cost) -> str:
    """Return how long the last computation took, and where the motion ends.

    Args:
        live: Computed motion; None without a skill.
        cost: Time that it took.
    """
    if live is None:
        return _block("Without a skill: demonstrations only.")
    rows = [("computed in", f"{cost.elapsed:.1f} ms"), ("processor time", f"{cost.processor:.1f} ms")]
    if live.reproduction:
        motion, layout = live.reproduction.motion, live.reproduction.adapted.layout
        part, columns = position_part(layout)
        rows.append(("duration", f"{(len(motion.x) - 1) * motion.period:.1f} s"))
        rows.append((f"ends at [{part.unit}]", format_numbers(motion.x[-1, columns])))
    return _block(_table(rows))


def notes_html(live: LiveReproduction | None, notes: Sequence[str] | None) -> str:
    """Return the notes about the motion, or why there is none.

    Args:
        live: Computed motion; None without a skill.
        notes: Notes of `reproduction_notes`; None while they are not computed yet.
    """
    if live is None:
        return ""
    if live.problem:
        return _block(f"<b>No motion:</b> {escape(live.problem)}")
    if notes is None:
        return _block("Notes: ...")
    if not notes:
        return _block("No notes: the motion is like the demonstrations.")
    return _block("".join(f"<p style='margin: 0 0 0.4rem 0'>{escape(note)}</p>" for note in notes))


def format_numbers(values: Iterable[float], digits: int = 4) -> str:
    """Return numbers with a sign only where one is negative, without a negative zero."""
    return "&nbsp; ".join(f"{round(float(value), digits) + 0.0:.{digits}f}" for value in values)


def pose_to_inputs(pose: Pose, digits: int) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return position and rotation vector [degrees] of a pose, rounded for a form.

    Args:
        pose: Pose of a frame.
        digits: Decimal places of the position.
    """
    position = np.round(pose.position, digits) + 0.0
    turn = np.round(np.degrees(to_rotation_vector(pose.quaternion)), 2) + 0.0
    return tuple(position.tolist()), tuple(turn.tolist())


def inputs_to_pose(position: Sequence[float], turn: Sequence[float]) -> Pose:
    """Return the pose of a position and a rotation vector [degrees]; in a plane, of two numbers and one."""
    if len(turn) == 1:
        position, turn = (*position, 0.0), (0.0, 0.0, *turn)
    return Pose(
        np.array(position, dtype=float), from_rotation_vector(np.radians(np.array(turn, dtype=float)))
    )


def _scalar_rows(content: ViewContent, x: Float[Array, " D"]) -> list[Row]:
    """Return the values of the first columns that are scalars, such as a gripper."""
    rows = []
    for part, columns in zip(content.layout.parts, content.layout.slices, strict=True):
        if part.quantity is Quantity.SCALAR and not part.derivative:
            names = content.layout.names[columns]
            rows += [
                (f"{name} [{part.unit}]", f"{round(float(v), 4) + 0.0:g}")
                for name, v in zip(names, x[columns], strict=True)
            ]
    return rows[:MAX_SCALARS]


def _entry(colour: str, kind: str, text: str) -> str:
    """Return a line of the legend: a sample and a text."""
    size = "width:1.4rem;height:3px" if kind == "line" else "width:0.8rem;height:0.8rem;border-radius:50%"
    sample = f"<span style='display:inline-block;{size};background:{colour}'></span>"
    box = f"<span style='display:inline-flex;width:1.6rem;flex:none;align-items:center'>{sample}</span>"
    return f"<div style='display:flex;align-items:center'>{box}<span>{escape(text)}</span></div>"


def _table(rows: Sequence[Row]) -> str:
    """Return rows of a name, which is escaped, and a value, which is not: it is formatted numbers."""
    return "".join(
        "<div style='display:flex;justify-content:space-between;gap:0.6rem'>"
        f"<span style='opacity:0.7'>{escape(name)}</span>"
        f"<span data-row='{escape(name)}' style='font-variant-numeric:tabular-nums;text-align:right'>"
        f"{value}</span></div>"
        for name, value in rows
    )


def _block(content: str) -> str:
    return f"<div style='{STYLE}'>{content}</div>"
