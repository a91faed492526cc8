"""A model that grows with a stream in words and numbers: its clusters, and what became of the stream."""

from dataclasses import asdict, fields
from typing import Any

import numpy as np

from pilotfish.cli.output.answers import format_key_values
from pilotfish.cli.output.descriptions import format_columns, format_states
from pilotfish.cli.stream.session import StreamSession
from pilotfish.models import Skill, online

MAX_NUMBERS_PRINTED = 16  # on one line


def online_model_facts(model: online.OnlineModel, skill: Skill) -> dict[str, Any]:
    """The model for programs; skill is what it reads out as."""
    return {
        "learner": model.settings.name,
        "penalties": penalties(model.settings),
        "maintenance": maintenance_facts(model.settings.maintenance),
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
        "cluster_id": int(model.cluster_ids[k]),
        "points": datapoints_per_cluster(model)[k],
        "weight": float(model.weights[k]),
        "dimensions": dict(zip(model.frame_names, model.dimensions[k].tolist(), strict=True)),
    }
    if (durations := skill.dynamics.durations) is not None:
        onward = skill.dynamics.transitions[k]
        facts["next"] = {str(model.cluster_ids[j]): float(onward[j]) for j in np.flatnonzero(onward)}
        facts["duration"] = {
            "mean": float(skill.period * durations.means[k]),
            "deviation": float(skill.period * durations.deviations[k]),
        }
    return facts


def session_facts(session: StreamSession) -> dict[str, Any]:
    """What became of the stream, for programs."""
    return {
        "observed": session.observed,
        "rejected": session.rejected,
        "rejected_lines": [asdict(rejected_line) for rejected_line in session.rejected_lines],
        "merged": session.merged,
        "forgotten": session.forgotten,
        "datapoints_per_second": session.rate,
    }


def described(model: online.OnlineModel, skill: Skill, rows: list[tuple[str, str]]) -> str:
    """The clusters as states of a skill, and below them what is known of the model, and rows more."""
    known = [
        ("clusters", f"{model.clusters}, born as {shorten_list(model.cluster_ids.tolist())}"),
        ("dimensions", shorten_list(model.dimensions.max(axis=1).tolist())),
        ("datapoints", f"{model.datapoints}, in {shorten_list(datapoints_per_cluster(model))}"),
        ("columns", f"{format_columns(model.layout)}, every {model.period:g} s"),
        ("learner", model.settings.label),
    ]
    return f"{format_states(skill)}\n\n{format_key_values([*known, *rows])}"


def session_rows(session: StreamSession) -> list[tuple[str, str]]:
    """What became of the stream."""
    return [
        ("observed", f"{session.observed} datapoints, {session.rate:.0f} a second"),
        ("refused", f"{session.rejected} lines" if session.rejected else "no line"),
        ("merged", f"{session.merged} clusters, {session.forgotten} forgotten"),
    ]


def datapoints_per_cluster(model: online.OnlineModel) -> list[int]:
    """How many datapoints each cluster took."""
    return [int(points) for points in model.state.points]


def shorten_list(numbers: list[int]) -> str:
    """The numbers, of many the first."""
    more = f", ... {len(numbers)} in all" if len(numbers) > MAX_NUMBERS_PRINTED else ""
    return ", ".join(map(str, numbers[:MAX_NUMBERS_PRINTED])) + more


def penalties(settings: online.OnlineSettings) -> dict[str, float]:
    return {f.name: float(getattr(settings, f.name)) for f in fields(settings) if f.name != "maintenance"}


def maintenance_facts(maintenance: online.Maintenance) -> dict[str, Any]:
    return asdict(maintenance)
