"""scikit-learn: GaussianMixture, on what all frames see side by side; on streams, k-means and Birch."""

from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from prepared import CommandResult, Prepared
from problems import FrameProblem, Sequences, Stream
from sklearn.cluster import Birch, MiniBatchKMeans  # type: ignore[import-not-found]
from sklearn.mixture import GaussianMixture  # type: ignore[import-not-found]
from streaming import Peer, Setting, learn_in_batches, prepared

REGULARISATION = 1e-5  # as pilotfish

KEPT = 0.1  # share of a stream that one who learns it may keep


def print_note() -> str:
    return ""


def fit_mixture(folder: Path) -> Prepared:
    problem = FrameProblem.load(folder)
    precisions = np.linalg.inv(problem.covariances)
    start = {"weights_init": problem.weights, "means_init": problem.means, "precisions_init": precisions}
    settings = {"max_iter": problem.iterations, "reg_covar": REGULARISATION}

    def run() -> GaussianMixture:
        return GaussianMixture(problem.states, **settings, **start).fit(problem.joint)

    def answer(mixture: GaussianMixture) -> CommandResult:
        log_likelihood = float(mixture.score(problem.joint)) * len(problem.joint)
        return CommandResult(log_likelihood, print_note=f"{mixture.n_iter_} iterations")

    return Prepared(run, answer)


def em_mixture(folder: Path) -> Prepared:
    """Exactly so many iterations: the tolerance is never met."""
    problem = Sequences.load(folder)
    K, (N, D), n = len(problem.initial), problem.x.shape, problem.iterations
    settings = {"max_iter": n, "tol": 0.0, "reg_covar": 0.0 if N >= 4 * K * D else REGULARISATION}
    precisions = np.linalg.inv(problem.covariances)
    start = {"weights_init": problem.initial, "means_init": problem.means, "precisions_init": precisions}

    def run() -> GaussianMixture:
        return GaussianMixture(K, **settings, **start).fit(problem.x)

    return Prepared(run, lambda mixture: CommandResult(float(mixture.lower_bounds_[-1]) * N, n))


def k_means_one_by_one(folder: Path) -> Prepared:
    return _k_means(folder, 1)


def k_means_in_batches(folder: Path) -> Prepared:
    return _k_means(folder, 100)


def _k_means(folder: Path, step: int) -> Prepared:
    """Centres begin at points of the whole stream: its first are of one cluster, and one alone is refused.

    How light a centre is when it is put elsewhere, and which points, is tuned.
    """
    problem = Stream.load(folder)
    grid = [{"reassignment_ratio": r, "seed": seed} for r, seed in product((0.0, 0.01, 0.1), (0, 1, 2, 3))]

    def make(setting: Setting) -> MiniBatchKMeans:
        drawn = np.random.default_rng(setting["seed"]).choice(len(problem.x), problem.clusters, replace=False)
        fixed = {"n_init": 1, "compute_labels": False, "random_state": setting["seed"]}
        ratio = setting["reassignment_ratio"]
        centres = problem.x[drawn]
        model = MiniBatchKMeans(problem.clusters, init=centres, reassignment_ratio=ratio, **fixed)
        return model.partial_fit(centres)

    peer = Peer(make, learn_in_batches(MiniBatchKMeans.partial_fit, step), MiniBatchKMeans.predict)
    return prepared(folder / f"k_means_{step}.json", peer, problem.x, problem.labels, grid)


def birch_one_by_one(folder: Path) -> Prepared:
    return _birch(folder, 1, KEPT)


def birch_in_batches(folder: Path) -> Prepared:
    return _birch(folder, 100, KEPT)


def birch_that_keeps(folder: Path) -> Prepared:
    """With small subclusters, of a datapoint or two each: the stream is kept, and clustered as a batch."""
    return _birch(folder, 100, 1.0)


def _birch(folder: Path, step: int, most: float) -> Prepared:
    """The radius of a subcluster by that of a cluster; subclusters are joined into clusters at the end.

    A setting under which these are more than that share of the datapoints is left out.
    """
    problem = Stream.load(folder)
    grid = [{"threshold": share * problem.radius} for share in (0.1, 0.15, 0.2, 0.25, 0.35, 0.5, 0.7, 1.0)]

    def make(setting: Setting) -> Birch:
        return Birch(n_clusters=None, compute_labels=False, **setting)

    def finish(model: Any) -> None:
        if (kept := len(model.subcluster_centers_)) > most * len(problem.x):
            raise ValueError(f"{kept} of {len(problem.x)} datapoints are kept")
        model.set_params(n_clusters=problem.clusters).partial_fit()
        model.set_params(n_clusters=None)

    def describe(model: Any) -> str:
        return f"keeps {len(model.subcluster_centers_)} subclusters"

    peer = Peer(make, learn_in_batches(Birch.partial_fit, step), Birch.predict, finish, describe)
    return prepared(folder / f"birch_{step}_{most}.json", peer, problem.x, problem.labels, grid)
