"""Descriptions of online models: clusters, settings, and counts of a stream."""

from dataclasses import asdict, fields
from typing import Any

import numpy as np

from pilotfish.cli.output.skill_descriptions import (
    columns_to_json,
    duration_to_json,
    durations_in_seconds,
    format_columns,
)
from pilotfish.models import Skill, online

MAX_NUMBERS = 16  # numbers of a list that are printed


def online_model_to_json(model: online.OnlineModel, skill: Skill) -> dict[str, Any]:
    """Return an online model as a JSON object.

    Args:
        model: Online model.
        skill: Skill that the model is converted to.
    """
    settings = model.settings
    return {
        "learner": settings.name,
        "penalties": {
            f.name: float(getattr(settings, f.name)) for f in fields(settings) if f.name != "maintenance"
        },
        "maintenance": asdict(settings.maintenance),
        "datapoints": model.datapoints,
        "demonstrations": model.demonstrations,
        "frames": list(model.frame_names),
        "columns": columns_to_json(model.layout),
        "period": model.period,
        "clusters": [_cluster_to_json(model, skill, k) for k in range(model.clusters)],
    }


def online_model_rows(model: online.OnlineModel) -> list[tuple[str, str]]:
    """Return keys and values of an online model, for people."""
    return [
        ("clusters", f"{model.clusters}, with ids {shorten_list(model.cluster_ids.tolist())}"),
        ("dimensions", shorten_list(model.dimensions.max(axis=1).tolist())),
        ("datapoints", f"{model.datapoints}, in clusters {shorten_list(_datapoints_per_cluster(model))}"),
        ("columns", f"{format_columns(model.layout)}, every {model.period:g} s"),
        ("learner", model.settings.label),
    ]


def shorten_list(numbers: list[int]) -> str:
    """Return numbers separated by commas; of many, the first MAX_NUMBERS and how many there are."""
    rest = f", ... {len(numbers)} in total" if len(numbers) > MAX_NUMBERS else ""
    return ", ".join(map(str, numbers[:MAX_NUMBERS])) + rest


def _cluster_to_json(model: online.OnlineModel, skill: Skill, k: int) -> dict[str, Any]:
    cluster: dict[str, Any] = {
        "cluster_id": int(model.cluster_ids[k]),
        "datapoints": _datapoints_per_cluster(model)[k],
        "weight": float(model.weights[k]),
        "dimensions": dict(zip(model.frame_names, model.dimensions[k].tolist(), strict=True)),
    }
    durations = durations_in_seconds(skill)
    if durations is not None:
        transitions = skill.dynamics.transitions[k]
        cluster["transitions"] = {
            str(model.cluster_ids[j]): float(transitions[j]) for j in np.flatnonzero(transitions)
        }
        cluster["duration"] = duration_to_json(durations[:, k])
    return cluster


def _datapoints_per_cluster(model: online.OnlineModel) -> list[int]:
    return [int(points) for points in model.state.points]
