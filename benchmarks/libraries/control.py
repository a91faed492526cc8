"""python-control: a regulator of infinite horizon for each target. It has no finite-horizon tracker."""

from pathlib import Path

import control  # type: ignore[import-not-found]
import numpy as np
from prepared import CommandResult, Prepared
from problems import Tracking


def print_note() -> str:
    return f"slycot: {'yes' if control.slycot_check() else 'no, its Riccati solver is SciPy'}"


def regulator(folder: Path) -> Prepared:
    """Dlqr for each distinct weight, which we name for it, and its gain at each step of that target."""
    problem = Tracking.load(folder)
    lasts = np.append(problem.begins[1:], len(problem.targets) - 1)
    spans = lasts - problem.begins

    def run() -> np.ndarray:
        weights = problem.weights[problem.begins]
        gains = [control.dlqr(problem.A, problem.B, weight, problem.control_cost)[0] for weight in weights]
        return np.repeat(np.stack(gains), spans, axis=0)

    def answer(gains: np.ndarray) -> CommandResult:
        constant = (gains @ problem.targets[:-1, :, None])[..., 0]
        return CommandResult(float(np.sqrt((gains**2).sum() + (constant**2).sum())))

    return Prepared(run, answer)
