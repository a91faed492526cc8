"""Learn motions with peers: `python motion_peers.py TASKS.npz MOTIONS.npz` prints JSON.

It runs in the environment of peers-motions.txt. For every task, TASKS.npz has the training demonstrations
(M, T, D), resampled to the same number of rows, the start and the end of the motion (2, D), and whether the
columns are a pose (position, quaternion w x y z). MOTIONS.npz receives one motion (T, D) for each task and
method. The reply has versions, CPU seconds of learning, and the reason for each method that is missing.

- ProMP (movement_primitives): weights of each demonstration by ridge regression, their mean and the
  covariance of each column, then conditioned on start and end. Columns are scaled to variance 1. A pose has
  seven columns; quaternions are normalised afterwards. The library's own EM, and covariances between
  columns, have larger errors with few demonstrations.
- DMP (movement_primitives): learned from the mean of the demonstrations, with start and goal. Poses have a
  Cartesian DMP.
- GMR (gmr): mixture over time and columns, regression on time. The mixture does not take a start or an end.
"""

import json
import sys
from collections.abc import Callable
from importlib import import_module
from importlib.metadata import version
from time import process_time
from typing import Any

import numpy as np

WEIGHTS = 20  # basis functions of a ProMP
RIDGE = 1e-4
WEIGHT_VARIANCE = 0.1  # share of the mean variance of the weights that is added to their covariance
BASIS_FUNCTIONS = 50  # of a DMP
COMPONENTS = 20  # of a mixture
ITERATIONS = 100
SMALL = 1e-9  # of columns that are constant
Floats = np.ndarray
Learned = Callable[[Floats], Floats]  # ends -> motion


def main() -> None:
    """Learn every task with every method that can be imported."""
    tasks, file = np.load(sys.argv[1]), sys.argv[2]
    motions: dict[str, Floats] = {}
    seconds: dict[str, dict[str, float]] = {}
    missing: dict[str, str] = {}
    names = sorted({name.rsplit("/", 1)[0] for name in tasks.files})
    for method, (package, module, learn) in METHODS.items():
        try:
            library = import_module(module)
        except ImportError as error:
            missing[method] = f"{package} cannot be imported: {error}"
            continue
        seconds[method] = {}
        for name in names:
            training, ends, is_pose = (tasks[f"{name}/{field}"] for field in ("training", "ends", "pose"))
            before = process_time()
            learned = learn(library, training, bool(is_pose))
            seconds[method][name] = process_time() - before
            motions[f"{name}/{method}"] = unit_quaternions(learned(ends), bool(is_pose))
    np.savez(file, **motions)  # type: ignore[arg-type] # NumPy's stubs: a dict may hold allow_pickle
    packages = {package for method, (package, _, _) in METHODS.items() if method not in missing}
    versions = {package: version(package) for package in packages}
    print(json.dumps({"seconds": seconds, "missing": missing, "versions": versions}))


def learn_promp(library: Any, training: Floats, is_pose: bool) -> Learned:
    """Return a ProMP that is conditioned on start and end."""
    del is_pose
    _, T, D = training.shape
    times = np.linspace(0.0, 1.0, T)
    offset, scale = training.mean(axis=(0, 1)), training.std(axis=(0, 1)) + SMALL
    scaled = (training - offset) / scale
    single = library.ProMP(1, WEIGHTS)  # the regression of one column
    weights = np.array(
        [np.concatenate([single.weights(times, y[:, d : d + 1], RIDGE) for d in range(D)]) for y in scaled]
    )
    same_column = np.kron(np.eye(D), np.ones((WEIGHTS, WEIGHTS)))
    covariance = np.cov(weights.T, ddof=0) * same_column
    covariance += (WEIGHT_VARIANCE * np.trace(covariance) / len(covariance) + SMALL) * np.eye(len(covariance))
    promp = library.ProMP(D, WEIGHTS).from_weight_distribution(weights.mean(axis=0), covariance)

    def motion(ends: Floats) -> Floats:
        start, end = (ends - offset) / scale
        conditioned = promp.condition_position(start, t=0.0).condition_position(end, t=1.0)
        return np.array(conditioned.mean_trajectory(times) * scale + offset)

    return motion


def learn_dmp(library: Any, training: Floats, is_pose: bool) -> Learned:
    """Return a DMP of the mean demonstration."""
    _, T, D = training.shape
    mean = unit_quaternions(training.mean(axis=0), is_pose)
    arguments = {
        "execution_time": 1.0,
        "dt": 1.0 / (T - 1),
        "n_weights_per_dim": BASIS_FUNCTIONS,
        "smooth_scaling": True,
    }
    dmp = library.CartesianDMP(**arguments) if is_pose else library.DMP(n_dims=D, **arguments)
    dmp.imitate(np.linspace(0.0, 1.0, T), mean)

    def motion(ends: Floats) -> Floats:
        dmp.configure(start_y=ends[0], goal_y=ends[1])
        times, x = dmp.open_loop()
        wanted = np.linspace(0.0, 1.0, T)
        return np.stack([np.interp(wanted, times, column) for column in x.T], axis=1)

    return motion


def learn_gmr(library: Any, training: Floats, is_pose: bool) -> Learned:
    """Return the regression of a mixture on time."""
    del is_pose
    _, T, _ = training.shape
    times = np.linspace(0.0, 1.0, T)
    rows = np.concatenate([np.column_stack([times, y]) for y in training])
    scale = rows.std(axis=0) + SMALL
    mixture = library.GMM(n_components=COMPONENTS, random_state=0)
    mixture.from_samples(rows / scale, n_iter=ITERATIONS, init_params="kmeans++")

    def motion(ends: Floats) -> Floats:
        del ends
        return np.array(mixture.predict(np.array([0]), times[:, None] / scale[0]) * scale[1:])

    return motion


def unit_quaternions(x: Floats, is_pose: bool) -> Floats:
    """Normalise columns 3 to 6 of poses."""
    if not is_pose:
        return x
    return np.hstack([x[:, :3], x[:, 3:] / np.linalg.norm(x[:, 3:], axis=1, keepdims=True)])


METHODS = {
    "ProMP": ("movement-primitives", "movement_primitives.promp", learn_promp),
    "DMP": ("movement-primitives", "movement_primitives.dmp", learn_dmp),
    "GMR": ("gmr", "gmr", learn_gmr),
}

if __name__ == "__main__":
    main()
