"""scikit-learn: GaussianMixture on the coordinates in all frames; k-means and Birch on streams."""

from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from prepared import Answer, Prepared
from problems import FrameProblem, Sequences, Stream
from sklearn.cluster import Birch, MiniBatchKMeans  # type: ignore[import-not-found]
from sklearn.mixture import GaussianMixture  # type: ignore[import-not-found]
from streaming import Peer, Setting, learn_in_batches, prepared

REGULARISATION = 1e-5  # as pilotfish

KEPT = 0.1  # share of a stream that a stream learner may store


def remark() -> str:
    return ""


def fit_mixture(folder: Path) -> Prepared:
    problem = FrameProblem.load(folder)
    precisions = np.linalg.inv(problem.covariances)
    start = {"weights_init": problem.weights, "means_init": problem.means, "precisions_init": precisions}
    settings = {"max_iter": problem.iterations, "reg_covar": REGULARISATION}

    def run() -> GaussianMixture:
        return GaussianMixture(problem.states, **settings, **start).fit(problem.joint)

    def answer(mixture: GaussianMixture) -> Answer:
        log_likelihood = float(mixture.score(problem.joint)) * len(problem.joint)
        return Answer(log_likelihood, remark=f"{mixture.n_iter_} iterations")

    return Prepared(run, answer)


def em_mixture(folder: Path) -> Prepared:
    """Prepare a fixed number of iterations, with a tolerance that is never met."""
    problem = Sequences.load(folder)
    K, (N, D), n = len(problem.initial), problem.x.shape, problem.iterations
    settings = {"max_iter": n, "tol": 0.0, "reg_covar": 0.0 if N >= 4 * K * D else REGULARISATION}
    precisions = np.linalg.inv(problem.covariances)
    start = {"weights_init": problem.initial, "means_init": problem.means, "precisions_init": precisions}

    def run() -> GaussianMixture:
        return GaussianMixture(K, **settings, **start).fit(problem.x)

    return Prepared(run, lambda mixture: Answer(float(mixture.lower_bounds_[-1]) * N, n))


def k_means_single_points(folder: Path) -> Prepared:
    return _k_means(folder, 1)


def k_means_batches(folder: Path) -> Prepared:
    return _k_means(folder, 100)


def _k_means(folder: Path, step: int) -> Prepared:
    """Tune the reassignment ratio and the seed of the initial centres.

    Initial centres come from the whole stream, since its first points belong to one cluster.
    """
    problem = Stream.load(folder)
    grid = [{"reassignment_ratio": r, "seed": seed} for r, seed in product((0.0, 0.01, 0.1), (0, 1, 2, 3))]

    def make(setting: Setting) -> MiniBatchKMeans:
        chosen = np.random.default_rng(setting["seed"]).choice(
            len(problem.x), problem.clusters, replace=False
        )
        fixed = {"n_init": 1, "compute_labels": False, "random_state": setting["seed"]}
        ratio = setting["reassignment_ratio"]
        centres = problem.x[chosen]
        model = MiniBatchKMeans(problem.clusters, init=centres, reassignment_ratio=ratio, **fixed)
        return model.partial_fit(centres)

    peer = Peer(make, learn_in_batches(MiniBatchKMeans.partial_fit, step), MiniBatchKMeans.predict)
    return prepared(folder / f"k_means_{step}.json", peer, problem.x, problem.labels, grid)


def birch_single_points(folder: Path) -> Prepared:
    return _birch(folder, 1, KEPT)


def birch_batches(folder: Path) -> Prepared:
    return _birch(folder, 100, KEPT)


def birch_unlimited(folder: Path) -> Prepared:
    """Prepare Birch with small subclusters: it stores the stream and clusters it as a batch."""
    return _birch(folder, 100, 1.0)


def _birch(folder: Path, step: int, max_share: float) -> Prepared:
    """Tune the radius of a subcluster; subclusters are joined into clusters at the end.

    Settings with more subclusters than a share of the datapoints are omitted.
    """
    problem = Stream.load(folder)
    grid = [{"threshold": share * problem.radius} for share in (0.1, 0.15, 0.2, 0.25, 0.35, 0.5, 0.7, 1.0)]

    def make(setting: Setting) -> Birch:
        return Birch(n_clusters=None, compute_labels=False, **setting)

    def finish(model: Any) -> None:
        if (kept := len(model.subcluster_centers_)) > max_share * len(problem.x):
            raise ValueError(f"{kept} of {len(problem.x)} datapoints are stored")
        model.set_params(n_clusters=problem.clusters).partial_fit()
        model.set_params(n_clusters=None)

    def describe(model: Any) -> str:
        return f"stores {len(model.subcluster_centers_)} subclusters"

    peer = Peer(make, learn_in_batches(Birch.partial_fit, step), Birch.predict, finish, describe)
    return prepared(folder / f"birch_{step}_{max_share}.json", peer, problem.x, problem.labels, grid)
