"""A skill in words and numbers: its states, what follows what, and which frame is precise where."""

from math import isfinite, isnan
from typing import Any

import numpy as np

from pilotfish.demonstrations import Layout, Quantity
from pilotfish.models import FrameRelevance, MarkovChain, SemiMarkovChain, Skill, Weights
from pilotfish.station.answers import table
from pilotfish.station.learners import LAW_NAMES
from pilotfish.types import Array, Float

MOST_PARTS = 12  # on one line
LEAST = 0.005  # transitions less probable are not shown


def skill_facts(skill: Skill) -> dict[str, Any]:
    """Everything about a skill but its means and covariances, for programs."""
    provenance = skill.provenance
    return {
        "states": _states_facts(skill),
        "frames": list(skill.frame_names),
        "columns": [
            {"name": name, "unit": unit}
            for name, unit in zip(skill.layout.names, skill.layout.units, strict=True)
        ],
        "period": skill.period,
        "dynamics": _dynamics_name(skill),
        "durations": durations_name(skill),
        "structure": provenance.structure,
        "demonstrations": list(provenance.demonstrations),
        "datapoints": provenance.datapoints,
        "data": provenance.data,
        "regularisation": provenance.regularisation,
        "log_likelihood": None if isnan(provenance.log_likelihood) else provenance.log_likelihood,
        "iterations": provenance.iterations,
        "converged": provenance.converged,
        "library": provenance.library,
        "note": provenance.note,
    }


def columns_text(layout: Layout) -> str:
    """The parts of a row with size and unit, a dash for each derivative; of many the first, and how many."""
    parts, more = layout.parts, ""
    if len(parts) > MOST_PARTS:
        parts, more = parts[: MOST_PARTS // 2], f", ... {len(parts)} parts of {layout.width} columns in all"
    named = (f"{part.name}{chr(39) * part.derivative} ({part.size}) [{part.unit}]" for part in parts)
    return ", ".join(named) + more


def states_table(skill: Skill) -> str:
    """A line for each state: how long, what next, and how far it spreads as each frame sees it."""
    unit = _spread_unit(skill.layout.tangent)
    timing = {"mixture": "share", "markov": "lasts [s]", "semi-markov": "lasts [s]"}[_dynamics_name(skill)]
    spreads = [f"{name} [{unit}]" for name in skill.frame_names]
    lasting = _lasting(skill)
    rows = [
        [str(k), _timing(skill, k, lasting), _next(skill, k), *_marked(row)]
        for k, row in enumerate(_spreads(skill))
    ]
    lines = [table(("state", timing, "next", *spreads), rows)]
    if len(spreads) > 1:
        lines.append("* the frame in which the state is most precise (geometric mean of its deviations)")
    return "\n".join(lines)


def _states_facts(skill: Skill) -> list[dict[str, Any]]:
    spreads, lasting = _spreads(skill), _lasting(skill)
    return [_state_facts(skill, k, spreads[k], lasting) for k in range(skill.states)]


def _lasting(skill: Skill) -> Float[Array, "2 K"] | None:
    """Mean and deviation of the durations [s]; None where states have none of their own."""
    if not isinstance(skill.dynamics, SemiMarkovChain):
        return None
    durations = skill.dynamics.durations
    return skill.period * np.stack([durations.means, durations.deviations])


def _state_facts(
    skill: Skill, k: int, spreads: Float[Array, " P"], lasting: Float[Array, "2 K"] | None
) -> dict[str, Any]:
    facts: dict[str, Any] = {"state": k}
    match skill.dynamics:
        case Weights(weights):
            facts["share"] = float(weights[k])
        case MarkovChain(initial, transitions) | SemiMarkovChain(initial, transitions, _):
            facts["initial"] = float(initial[k])
            facts["next"] = {str(j): float(p) for j, p in enumerate(transitions[k]) if p > 0.0}
    if lasting is not None:
        facts["duration"] = {"mean": float(lasting[0, k]), "deviation": float(lasting[1, k])}
    facts["spread"] = dict(zip(skill.frame_names, map(float, spreads), strict=True))
    facts["precise_frame"] = skill.frame_names[int(spreads.argmin())]
    return facts


def _dynamics_name(skill: Skill) -> str:
    match skill.dynamics:
        case Weights():
            return "mixture"
        case MarkovChain():
            return "markov"
        case SemiMarkovChain():
            return "semi-markov"


def durations_name(skill: Skill) -> str | None:
    """The law of the durations; None where states have none of their own."""
    if isinstance(skill.dynamics, SemiMarkovChain):
        return LAW_NAMES[type(skill.dynamics.durations)]
    return None


def time_text(skill: Skill) -> str:
    """How states follow one another, and how long they last."""
    law = durations_name(skill)
    return f"{_dynamics_name(skill)}, {law} durations" if law else _dynamics_name(skill)


def relevance_table(relevant: FrameRelevance) -> str:
    """A line for each state: the power of each frame, and what leaving it out would cost [nats]."""
    rows = []
    for k, (values, costs) in enumerate(zip(relevant.values.T, relevant.costs.T, strict=True)):
        rows.append(
            [
                str(k),
                *(f"{v:.2f} ({round(cost, 1) + 0.0:.1f})" for v, cost in zip(values, costs, strict=True)),
            ]
        )
    lines = [
        table(("state", *relevant.frame_names), rows),
        "relevance, from 0 (says nothing that others do not say better) to 1 (matters most there);",
        "in brackets what leaving the frame out costs demonstrations held out [nats]",
    ]
    if gone := relevant.distractors:
        names = ", ".join(gone)
        lines.append(f"of relevance 0 at every state: {names}; learn --drop-distractors does without")
    return "\n".join(lines)


def relevance_facts(relevant: FrameRelevance) -> dict[str, Any]:
    """The same for programs; a cost without end, of an only frame, is null."""
    costs = [[cost if isfinite(cost) else None for cost in row] for row in relevant.costs.tolist()]
    return {
        "relevance": dict(zip(relevant.frame_names, relevant.values.tolist(), strict=True)),
        "relevance_costs": dict(zip(relevant.frame_names, costs, strict=True)),
        "distractors": list(relevant.distractors),
    }


def _timing(skill: Skill, k: int, lasting: Float[Array, "2 K"] | None) -> str:
    if lasting is not None:
        return f"{lasting[0, k]:.2f} ± {lasting[1, k]:.2f}"
    if isinstance(skill.dynamics, Weights):
        return f"{skill.dynamics.weights[k]:.3f}"
    leaving = 1.0 - skill.dynamics.transitions[k, k]
    return f"{skill.period / leaving:.2f}" if leaving > 0.0 else "to the end"


def _next(skill: Skill, k: int) -> str:
    if isinstance(skill.dynamics, Weights):
        return "any"
    onward = skill.dynamics.transitions[k].copy()
    onward[k] = 0.0
    if not onward.any():
        return "final"
    onward /= onward.sum()
    likely = [j for j in np.argsort(-onward) if onward[j] >= LEAST]
    return ", ".join(str(j) if onward[j] > 1.0 - LEAST else f"{j} ({onward[j]:.2f})" for j in likely)


def _marked(spreads: Float[Array, " P"]) -> list[str]:
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
    still = [(part, here) for part, here in parts if part.derivative == 0] or parts
    places = [(part, here) for part, here in still if part.quantity is Quantity.POSITION] or still
    return [column for _, here in places for column in range(here.start, here.stop)]


def _spread_unit(layout: Layout) -> str:
    units = {layout.units[column] for column in _spread_columns(layout)}
    return units.pop() if len(units) == 1 else "mixed units"
