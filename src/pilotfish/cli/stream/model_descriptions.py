"""Descriptions of online models: clusters, settings, and counts of a stream."""

from dataclasses import asdict
from typing import Any

import numpy as np

from pilotfish.cli.output.skill_descriptions import (
    columns_to_json,
    duration_to_json,
    durations_in_seconds,
    format_columns,
)
from pilotfish.demonstrations import Layout
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
        "penalties": {name: float(getattr(settings, name)) for name in online.penalty_names(settings)},
        "maintenance": asdict(settings.maintenance),
        "scales": None if settings.scales is None else list(settings.scales),
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
        ("scales", format_scales(model.settings, model.layout)),
        ("learner", model.settings.label),
    ]


def format_settings(settings: online.OnlineSettings, layout: Layout) -> str:
    """Return scales and learner in one line.

    Args:
        settings: Settings of the learner.
        layout: Columns.
    """
    return f"scales {format_scales(settings, layout)}; learner {settings.label}"


def format_scales(settings: online.OnlineSettings, layout: Layout) -> str:
    """Return the scale of each part of a layout with its unit; of different scales the smallest and largest.

    Args:
        settings: Settings of the learner.
        layout: Columns.
    """
    if settings.scales is None:
        return "none"
    texts = []
    for part, columns in zip(layout.parts, layout.slices, strict=True):
        scales = settings.scales[columns]
        least, most = f"{min(scales):.3g}", f"{max(scales):.3g}"
        name = f"{part.name}{chr(39) * part.derivative}"
        texts.append(
            f"{name} {least if least == most else f'{least} to {most}'} {part.unit}".removesuffix(" 1")
        )
    rest = f", ... {len(texts)} in total" if len(texts) > MAX_NUMBERS else ""
    return ", ".join(texts[:MAX_NUMBERS]) + rest


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
