"""Descriptions of skills: states, transitions, durations, and the deviation of states in each frame."""

from math import isfinite, isnan
from typing import Any

import numpy as np

from pilotfish.cli.output.tables import Table
from pilotfish.demonstrations import Layout, Quantity
from pilotfish.models import FrameRelevance, Skill
from pilotfish.types import Array, Float
from pilotfish.validation import short_list

MAX_PARTS = 12  # parts of a layout that are listed in full
MIN_TRANSITION_PROBABILITY = 0.005  # less probable transitions are not printed


def skill_to_json(skill: Skill) -> dict[str, Any]:
    """Return everything about a skill but its means and covariances, as a JSON object."""
    provenance = skill.provenance
    return {
        "states": _states_to_json(skill),
        "frames": list(skill.frame_names),
        "columns": columns_to_json(skill.layout),
        "period": skill.period,
        "dynamics": skill.dynamics.name,
        "durations": duration_distribution_name(skill),
        "structure": provenance.structure,
        "demonstrations": list(provenance.demonstrations),
        "datapoints": provenance.datapoints,
        "data_hash": provenance.data,
        "regularisation": None if skill.regularisation is None else skill.regularisation.tolist(),
        "scales": None if skill.demonstrated is None else skill.demonstrated.scales.tolist(),
        "switches": [] if skill.demonstrated is None else list(skill.demonstrated.switches),
        "log_likelihood": None if isnan(provenance.log_likelihood) else provenance.log_likelihood,
        "iterations": provenance.iterations,
        "converged": provenance.converged,
        "library": provenance.library,
        "note": provenance.note,
    }


def columns_to_json(layout: Layout) -> list[dict[str, str]]:
    """Return the name and the unit of each column."""
    return [{"name": name, "unit": unit} for name, unit in zip(layout.names, layout.units, strict=True)]


def format_columns(layout: Layout) -> str:
    """Return the parts of a layout with size and unit; an apostrophe marks each time derivative.

    Of more than MAX_PARTS parts, the first half of MAX_PARTS and the total number are given.
    """
    parts, rest = layout.parts, ""
    if len(parts) > MAX_PARTS:
        parts, rest = (
            parts[: MAX_PARTS // 2],
            f", ... {len(parts)} parts with {layout.width} columns in total",
        )
    names = (f"{part.name}{chr(39) * part.derivative} ({part.size}) [{part.unit}]" for part in parts)
    return ", ".join(names) + rest


def state_blocks(skill: Skill) -> list[str | Table]:
    """Return a table with a row for each state: duration, next states, and deviation in each frame."""
    unit = _deviation_unit(skill.layout.tangent)
    duration_header = "duration [s]" if skill.dynamics.has_time_order else "weight"
    durations = durations_in_seconds(skill)
    rows = [
        (
            str(k),
            _format_duration(skill, k, durations),
            _format_next_states(skill, k),
            *_format_deviations(row),
        )
        for k, row in enumerate(mean_deviations(skill))
    ]
    header = ("state", duration_header, "next state", *(f"{name} [{unit}]" for name in skill.frame_names))
    blocks: list[str | Table] = [Table(header, tuple(rows))]
    if len(skill.frame_names) > 1:
        blocks.append(
            "Frame columns: geometric mean of the standard deviations of the state; * marks the smallest."
        )
    return blocks


def durations_in_seconds(skill: Skill) -> Float[Array, "2 K"] | None:
    """Return mean and standard deviation of the durations [s]; None without a duration distribution."""
    if (durations := skill.dynamics.durations) is None:
        return None
    return skill.period * np.stack([durations.means, durations.deviations])


def duration_distribution_name(skill: Skill) -> str | None:
    """Return the name of the duration distribution; None if states have none."""
    durations = skill.dynamics.durations
    return None if durations is None else durations.name


def format_dynamics(skill: Skill) -> str:
    """Return the dynamics and the duration distribution of a skill."""
    distribution = duration_distribution_name(skill)
    name = skill.dynamics.name
    return f"{name}, {distribution} durations" if distribution else name


def format_scales(skill: Skill) -> str:
    """Return the scale of each part: the extent of its coordinates, or the size of its derivatives."""
    return "" if skill.demonstrated is None else _format_parts(skill, skill.demonstrated.scales)


def format_regularisation(skill: Skill) -> str:
    """Return the standard deviation that regularisation adds to each part, as a length or an angle."""
    return "" if skill.regularisation is None else _format_parts(skill, np.sqrt(skill.regularisation))


def _format_parts(skill: Skill, values: Float[Array, " E"]) -> str:
    layout = skill.layout.tangent
    names = [
        f"{part.name}{chr(39) * part.derivative} {values[columns.start]:.3g} {part.unit}"
        for part, columns in zip(layout.parts, layout.slices, strict=True)
    ]
    return short_list(names)


def relevance_blocks(frame_relevance: FrameRelevance) -> list[str | Table]:
    """Return a table with the relevance of each frame in each state, and its ablation cost [nats]."""
    rows = [
        (
            str(k),
            *(f"{v:.2f} ({round(cost, 1) + 0.0:.1f})" for v, cost in zip(values, costs, strict=True)),
        )
        for k, (values, costs) in enumerate(
            zip(frame_relevance.values.T, frame_relevance.costs.T, strict=True)
        )
    ]
    text = (
        "Relevance: from 0 (the other frames predict the motion as well) to 1 (the most relevant frame).\n"
        "In brackets: loss of log-likelihood of held-out demonstrations without the frame [nats]."
    )
    blocks: list[str | Table] = [Table(("state", *frame_relevance.frame_names), tuple(rows)), text]
    if distractors := frame_relevance.distractors:
        names = ", ".join(distractors)
        blocks.append(f"Relevance 0 in every state: {names}. `learn --drop-distractors` leaves them out.")
    return blocks


def relevance_to_json(frame_relevance: FrameRelevance) -> dict[str, Any]:
    """Return the relevance as a JSON object; an infinite cost, of a single frame, is null."""
    costs = [[cost if isfinite(cost) else None for cost in row] for row in frame_relevance.costs.tolist()]
    return {
        "relevance": dict(zip(frame_relevance.frame_names, frame_relevance.values.tolist(), strict=True)),
        "relevance_costs": dict(zip(frame_relevance.frame_names, costs, strict=True)),
        "distractors": list(frame_relevance.distractors),
    }


def mean_deviations(skill: Skill) -> Float[Array, "K P"]:
    """Return the geometric mean of the standard deviations of each state along its principal axes, per frame.

    It covers the position columns if there are any; a rotation of the frame does not change it.
    """
    columns = _deviation_columns(skill.layout.tangent)
    dense = np.stack([c.dense[:, columns][..., columns] for c in skill.covariances])  # (P, K, d, d)
    return np.asarray(np.exp(np.linalg.slogdet(dense)[1] / (2 * len(columns)))).T


def _states_to_json(skill: Skill) -> list[dict[str, Any]]:
    deviations, durations = mean_deviations(skill), durations_in_seconds(skill)
    return [_state_to_json(skill, k, deviations[k], durations) for k in range(skill.states)]


def _state_to_json(
    skill: Skill, k: int, deviations: Float[Array, " P"], durations: Float[Array, "2 K"] | None
) -> dict[str, Any]:
    state: dict[str, Any] = {"state": k}
    probability = float(skill.dynamics.initial[k])
    if skill.dynamics.has_time_order:
        transitions = enumerate(skill.dynamics.transitions[k])
        state |= {
            "initial": probability,
            "transitions": {str(j): float(p) for j, p in transitions if p > 0.0},
        }
    else:
        state["weight"] = probability
    if durations is not None:
        state["duration"] = duration_to_json(durations[:, k])
    state["mean_deviation"] = dict(zip(skill.frame_names, map(float, deviations), strict=True))
    state["most_precise_frame"] = skill.frame_names[int(deviations.argmin())]
    return state


def duration_to_json(duration: Float[Array, " 2"]) -> dict[str, float]:
    """Return mean and standard deviation of a duration [s] as a JSON object."""
    return {"mean": float(duration[0]), "standard_deviation": float(duration[1])}


def _format_duration(skill: Skill, k: int, durations: Float[Array, "2 K"] | None) -> str:
    if durations is not None:
        return f"{durations[0, k]:.2f} ± {durations[1, k]:.2f}"
    if not skill.dynamics.has_time_order:
        return f"{skill.dynamics.initial[k]:.3f}"
    exit_probability = 1.0 - skill.dynamics.transitions[k, k]
    return f"{skill.period / exit_probability:.2f}" if exit_probability > 0.0 else "unlimited"


def _format_next_states(skill: Skill, k: int) -> str:
    if not skill.dynamics.has_time_order:
        return "any"
    transitions = skill.dynamics.transitions[k].copy()
    transitions[k] = 0.0
    if not transitions.any():
        return "final"
    transitions /= transitions.sum()
    probable = [j for j in np.argsort(-transitions) if transitions[j] >= MIN_TRANSITION_PROBABILITY]
    return ", ".join(
        str(j) if transitions[j] > 1.0 - MIN_TRANSITION_PROBABILITY else f"{j} ({transitions[j]:.2f})"
        for j in probable
    )


def _format_deviations(deviations: Float[Array, " P"]) -> list[str]:
    smallest = int(deviations.argmin()) if len(deviations) > 1 else -1
    return [f"{deviation:.4f}{' *' if p == smallest else ''}" for p, deviation in enumerate(deviations)]


def _deviation_columns(layout: Layout) -> list[int]:
    parts = list(zip(layout.parts, layout.slices, strict=True))
    coordinates = [(part, columns) for part, columns in parts if part.derivative == 0] or parts
    positions = [(p, columns) for p, columns in coordinates if p.quantity is Quantity.POSITION] or coordinates
    return [column for _, columns in positions for column in range(columns.start, columns.stop)]


def _deviation_unit(layout: Layout) -> str:
    units = {layout.units[column] for column in _deviation_columns(layout)}
    return units.pop() if len(units) == 1 else "mixed units"
