"""pdc-dp-means' MiniBatchDPMeans, point by point and in batches of 100."""

from pathlib import Path
from typing import Any

from pdc_dp_means import MiniBatchDPMeans  # type: ignore[import-not-found]
from prepared import Prepared
from problems import Stream
from streaming import Peer, Setting, learn_in_batches, prepared


def remark() -> str:
    return "an extension of scikit-learn 1.2"


def single_points(folder: Path) -> Prepared:
    return _prepared(folder, 1)


def batches(folder: Path) -> Prepared:
    return _prepared(folder, 100)


def _prepared(folder: Path, step: int) -> Prepared:
    """Tune delta, the squared distance for a new cluster, relative to the squared radius."""
    problem = Stream.load(folder)
    grid = [{"delta": share * problem.radius**2} for share in (0.3, 0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0)]
    peer = Peer(_make, learn_in_batches(MiniBatchDPMeans.partial_fit, step), MiniBatchDPMeans.predict)
    return prepared(folder / f"dp_means_{step}.json", peer, problem.x, problem.labels, grid)


def _make(setting: Setting) -> Any:
    fixed = {"n_clusters": 1, "n_init": 1, "compute_labels": False, "random_state": 0}
    return MiniBatchDPMeans(**fixed, **setting)
