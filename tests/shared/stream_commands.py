"""Options of `pilotfish stream` without scales, rows for it, and the models that it must write."""

from pathlib import Path

import numpy as np

from pilotfish.demonstrations import position_layout
from pilotfish.io.stream_file import encode_stream
from pilotfish.models import online

SOSC = [
    "--cluster",
    "0.3",
    "--dimension",
    "0.02",
    "--noise",
    "0.01",
    "--bandwidth",
    "2",
    "--transition",
    "0.01",
    "--no-scale",
]
PENALTIES = online.SOSC(0.3, 0.02, 0.01, 2.0, 0.01)
LAYOUT = position_layout(2).differentiate()


def walk(seed: int, n: int) -> np.ndarray:
    """Return noisy positions on a circle, with velocities."""
    t = np.arange(n) / 7.0
    x = np.stack([np.cos(t), np.sin(t), -np.sin(t), np.cos(t)], axis=1)
    return x + 0.03 * np.random.default_rng(seed).normal(size=(n, 4))


def text(x: np.ndarray, header: bool = True) -> str:
    lines = [",".join(LAYOUT.names)] if header else []
    return "\n".join([*lines, *(",".join(map(repr, row)) for row in x.tolist())]) + "\n"


def expected(x: np.ndarray, penalties: online.OnlineSettings = PENALTIES) -> online.OnlineModel:
    return online.observe_stream(online.online_model(penalties, LAYOUT, 0.01), x)[0]


def models_equal(path: Path, model: online.OnlineModel) -> bool:
    return path.read_bytes() == encode_stream(model)
