"""A model that grows with a stream in words and numbers: its clusters, and what became of the stream."""

from dataclasses import asdict, fields
from typing import Any

import numpy as np

from pilotfish.kernels import StreamColumn
from pilotfish.models import SemiMarkovChain, Skill, online
from pilotfish.station.answers import plain_table
from pilotfish.station.descriptions import columns_text, states_table
from pilotfish.station.growing import Growth
from pilotfish.station.stream_settings import LEARNERS, WEIGHTINGS

MOST_NUMBERS = 16  # on one line


def model_facts(model: online.OnlineModel, skill: Skill) -> dict[str, Any]:
    """The model for programs; skill is what it reads out as."""
    return {
        "learner": next(name for name, kind in LEARNERS.items() if type(model.settings) is kind),
        "penalties": penalties(model.settings),
        "upkeep": upkeep_facts(model.settings.upkeep),
        "datapoints": model.datapoints,
        "demonstrations": model.demonstrations,
        "frames": list(model.frame_names),
        "columns": [
            {"name": name, "unit": unit}
            for name, unit in zip(model.layout.names, model.layout.units, strict=True)
        ],
        "period": model.period,
        "clusters": [cluster_facts(model, skill, k) for k in range(model.clusters)],
    }


def cluster_facts(model: online.OnlineModel, skill: Skill, k: int) -> dict[str, Any]:
    """One cluster; durations [s] and what comes next where there is an order in time."""
    facts: dict[str, Any] = {
        "identity": int(model.identities[k]),
        "points": points_of(model)[k],
        "weight": float(model.weights[k]),
        "dimensions": dict(zip(model.frame_names, model.dimensions[k].tolist(), strict=True)),
    }
    if isinstance(skill.dynamics, SemiMarkovChain):
        onward, durations = skill.dynamics.transitions[k], skill.dynamics.durations
        facts["next"] = {str(model.identities[j]): float(onward[j]) for j in np.flatnonzero(onward)}
        facts["duration"] = {
            "mean": float(skill.period * durations.means[k]),
            "deviation": float(skill.period * durations.deviations[k]),
        }
    return facts


def growth_facts(growth: Growth) -> dict[str, Any]:
    """What became of the stream, for programs."""
    return {
        "observed": growth.observed,
        "refused": growth.refused,
        "refusals": [asdict(refusal) for refusal in growth.refusals],
        "merged": growth.merged,
        "forgotten": growth.forgotten,
        "datapoints_per_second": growth.rate,
    }


def described(model: online.OnlineModel, skill: Skill, rows: list[tuple[str, str]]) -> str:
    """The clusters as states of a skill, and below them what is known of the model, and rows more."""
    known = [
        ("clusters", f"{model.clusters}, born as {shortened(model.identities.tolist())}"),
        ("dimensions", shortened(model.dimensions.max(axis=1).tolist())),
        ("datapoints", f"{model.datapoints}, in {shortened(points_of(model))}"),
        ("columns", f"{columns_text(model.layout)}, every {model.period:g} s"),
        ("learner", model.settings.label),
    ]
    return f"{states_table(skill)}\n\n{plain_table([*known, *rows])}"


def growth_rows(growth: Growth) -> list[tuple[str, str]]:
    """What became of the stream."""
    return [
        ("observed", f"{growth.observed} datapoints, {growth.rate:.0f} a second"),
        ("refused", f"{growth.refused} lines" if growth.refused else "no line"),
        ("merged", f"{growth.merged} clusters, {growth.forgotten} forgotten"),
    ]


def points_of(model: online.OnlineModel) -> list[int]:
    """How many datapoints each cluster took."""
    return [int(points) for points in model.state.clusters[:, StreamColumn.POINTS]]


def shortened(numbers: list[int]) -> str:
    """The numbers, of many the first."""
    more = f", ... {len(numbers)} in all" if len(numbers) > MOST_NUMBERS else ""
    return ", ".join(map(str, numbers[:MOST_NUMBERS])) + more


def penalties(settings: online.OnlineSettings) -> dict[str, float]:
    return {f.name: float(getattr(settings, f.name)) for f in fields(settings) if f.name != "upkeep"}


def upkeep_facts(upkeep: online.Upkeep) -> dict[str, Any]:
    kinds = dict(zip((online.Count, online.Trace, online.Constant), WEIGHTINGS, strict=True))
    facts = {f.name: getattr(upkeep, f.name) for f in fields(upkeep) if f.name != "weighting"}
    return facts | {"weights": kinds[type(upkeep.weighting)], **asdict(upkeep.weighting)}
