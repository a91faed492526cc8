"""A skill in words and numbers: its states, what follows what, and which frame is precise where."""

from math import isfinite, isnan
from typing import Any

import numpy as np

from pilotfish.cli.output.answers import format_table
from pilotfish.demonstrations import Layout, Quantity
from pilotfish.models import FrameRelevance, Skill
from pilotfish.types import Array, Float

MAX_PARTS = 12  # on one line
MIN_TRANSITION_PROBABILITY = 0.005  # transitions less probable are not shown


def skill_to_json(skill: Skill) -> dict[str, Any]:
    """Everything about a skill but its means and covariances, for programs."""
    provenance = skill.provenance
    return {
        "states": _states_to_json(skill),
        "frames": list(skill.frame_names),
        "columns": [
            {"name": name, "unit": unit}
            for name, unit in zip(skill.layout.names, skill.layout.units, strict=True)
        ],
        "period": skill.period,
        "dynamics": skill.dynamics.name,
        "durations": duration_distribution_name(skill),
        "structure": provenance.structure,
        "demonstrations": list(provenance.demonstrations),
        "datapoints": provenance.datapoints,
        "data_hash": provenance.data,
        "regularisation": provenance.regularisation,
        "log_likelihood": None if isnan(provenance.log_likelihood) else provenance.log_likelihood,
        "iterations": provenance.iterations,
        "converged": provenance.converged,
        "library": provenance.library,
        "note": provenance.note,
    }


def format_columns(layout: Layout) -> str:
    """The parts of a row with size and unit, a dash for each derivative; of many the first, and how many."""
    parts, more = layout.parts, ""
    if len(parts) > MAX_PARTS:
        parts, more = parts[: MAX_PARTS // 2], f", ... {len(parts)} parts of {layout.width} columns in all"
    named = (f"{part.name}{chr(39) * part.derivative} ({part.size}) [{part.unit}]" for part in parts)
    return ", ".join(named) + more


def format_states(skill: Skill) -> str:
    """A line for each state: how long, what next, and how far it spreads as each frame sees it."""
    unit = _spread_unit(skill.layout.tangent)
    duration_header = {"mixture": "share", "markov": "lasts [s]", "semi-markov": "lasts [s]"}[
        skill.dynamics.name
    ]
    spreads = [f"{name} [{unit}]" for name in skill.frame_names]
    durations = _durations_in_seconds(skill)
    rows = [
        [str(k), _format_duration(skill, k, durations), _format_next_states(skill, k), *_format_spreads(row)]
        for k, row in enumerate(_spreads(skill))
    ]
    lines = [format_table(("state", duration_header, "next", *spreads), rows)]
    if len(spreads) > 1:
        lines.append("* the frame in which the state is most precise (geometric mean of its deviations)")
    return "\n".join(lines)


def _states_to_json(skill: Skill) -> list[dict[str, Any]]:
    spreads, durations = _spreads(skill), _durations_in_seconds(skill)
    return [_state_to_json(skill, k, spreads[k], durations) for k in range(skill.states)]


def _durations_in_seconds(skill: Skill) -> Float[Array, "2 K"] | None:
    """Mean and deviation of the durations [s]; None where states have none of their own."""
    if (durations := skill.dynamics.durations) is None:
        return None
    return skill.period * np.stack([durations.means, durations.deviations])


def _state_to_json(
    skill: Skill, k: int, spreads: Float[Array, " P"], durations: Float[Array, "2 K"] | None
) -> dict[str, Any]:
    facts: dict[str, Any] = {"state": k}
    probability = float(skill.dynamics.initial[k])
    if skill.dynamics.has_time_order:
        next_probs = enumerate(skill.dynamics.transitions[k])
        facts |= {"initial": probability, "next": {str(j): float(p) for j, p in next_probs if p > 0.0}}
    else:
        facts["share"] = probability
    if durations is not None:
        facts["duration"] = {"mean": float(durations[0, k]), "deviation": float(durations[1, k])}
    facts["spread"] = dict(zip(skill.frame_names, map(float, spreads), strict=True))
    facts["most_precise_frame"] = skill.frame_names[int(spreads.argmin())]
    return facts


def duration_distribution_name(skill: Skill) -> str | None:
    """The law of the durations; None where states have none of their own."""
    return skill.dynamics.durations.name if skill.dynamics.durations is not None else None


def format_dynamics(skill: Skill) -> str:
    """How states follow one another, and how long they last."""
    distribution = duration_distribution_name(skill)
    return f"{skill.dynamics.name}, {distribution} durations" if distribution else skill.dynamics.name


def format_relevance(frame_relevance: FrameRelevance) -> str:
    """A line for each state: the power of each frame, and what leaving it out would cost [nats]."""
    rows = []
    for k, (values, costs) in enumerate(zip(frame_relevance.values.T, frame_relevance.costs.T, strict=True)):
        rows.append(
            [
                str(k),
                *(f"{v:.2f} ({round(cost, 1) + 0.0:.1f})" for v, cost in zip(values, costs, strict=True)),
            ]
        )
    lines = [
        format_table(("state", *frame_relevance.frame_names), rows),
        "relevance, from 0 (says nothing that others do not say better) to 1 (matters most there);",
        "in brackets what leaving the frame out costs demonstrations held out [nats]",
    ]
    if distractors := frame_relevance.distractors:
        names = ", ".join(distractors)
        lines.append(f"of relevance 0 at every state: {names}; learn --drop-distractors does without")
    return "\n".join(lines)


def relevance_to_json(frame_relevance: FrameRelevance) -> dict[str, Any]:
    """The same for programs; a cost without end, of an only frame, is null."""
    costs = [[cost if isfinite(cost) else None for cost in row] for row in frame_relevance.costs.tolist()]
    return {
        "relevance": dict(zip(frame_relevance.frame_names, frame_relevance.values.tolist(), strict=True)),
        "relevance_costs": dict(zip(frame_relevance.frame_names, costs, strict=True)),
        "distractors": list(frame_relevance.distractors),
    }


def _format_duration(skill: Skill, k: int, durations: Float[Array, "2 K"] | None) -> str:
    if durations is not None:
        return f"{durations[0, k]:.2f} ± {durations[1, k]:.2f}"
    if not skill.dynamics.has_time_order:
        return f"{skill.dynamics.initial[k]:.3f}"
    exit_probability = 1.0 - skill.dynamics.transitions[k, k]
    return f"{skill.period / exit_probability:.2f}" if exit_probability > 0.0 else "to the end"


def _format_next_states(skill: Skill, k: int) -> str:
    if not skill.dynamics.has_time_order:
        return "any"
    transitions = skill.dynamics.transitions[k].copy()
    transitions[k] = 0.0
    if not transitions.any():
        return "final"
    transitions /= transitions.sum()
    shown_states = [j for j in np.argsort(-transitions) if transitions[j] >= MIN_TRANSITION_PROBABILITY]
    return ", ".join(
        str(j) if transitions[j] > 1.0 - MIN_TRANSITION_PROBABILITY else f"{j} ({transitions[j]:.2f})"
        for j in shown_states
    )


def _format_spreads(spreads: Float[Array, " P"]) -> list[str]:
    best = int(spreads.argmin()) if len(spreads) > 1 else -1
    return [f"{spread:.4f}{' *' if p == best else ''}" for p, spread in enumerate(spreads)]


def _spreads(skill: Skill) -> Float[Array, "K P"]:
    """Geometric mean of the deviations of each state along the axes of its ellipsoid, as each frame sees it.

    Of the positions when there are some; a rotation of the frame does not change it.
    """
    columns = _spread_columns(skill.layout.tangent)
    dense = np.stack([c.dense[:, columns][..., columns] for c in skill.covariances])  # (P, K, d, d)
    return np.asarray(np.exp(np.linalg.slogdet(dense)[1] / (2 * len(columns)))).T


def _spread_columns(layout: Layout) -> list[int]:
    parts = list(zip(layout.parts, layout.slices, strict=True))
    coordinates = [(part, here) for part, here in parts if part.derivative == 0] or parts
    places = [(part, here) for part, here in coordinates if part.quantity is Quantity.POSITION] or coordinates
    return [column for _, here in places for column in range(here.start, here.stop)]


def _spread_unit(layout: Layout) -> str:
    units = {layout.units[column] for column in _spread_columns(layout)}
    return units.pop() if len(units) == 1 else "mixed units"
