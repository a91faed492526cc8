"""python-control: infinite-horizon LQR for each target; it has no finite-horizon tracker."""

from pathlib import Path

import control  # type: ignore[import-not-found]
import numpy as np
from prepared import Answer, Prepared
from problems import Tracking


def remark() -> str:
    return f"slycot: {'yes' if control.slycot_check() else 'no, its Riccati solver is SciPy'}"


def regulator(folder: Path) -> Prepared:
    """Prepare dlqr for each distinct weight, which it is given, and repeat the gain for each step."""
    problem = Tracking.load(folder)
    lasts = np.append(problem.begins[1:], len(problem.targets) - 1)
    spans = lasts - problem.begins

    def run() -> np.ndarray:
        weights = problem.weights[problem.begins]
        gains = [control.dlqr(problem.A, problem.B, weight, problem.control_cost)[0] for weight in weights]
        return np.repeat(np.stack(gains), spans, axis=0)

    def answer(gains: np.ndarray) -> Answer:
        constant = (gains @ problem.targets[:-1, :, None])[..., 0]
        return Answer(float(np.sqrt((gains**2).sum() + (constant**2).sum())))

    return Prepared(run, answer)
