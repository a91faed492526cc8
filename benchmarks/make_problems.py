"""Write every problem into a folder, and print whether the valve data is real.

`python make_problems.py FOLDER valve=30 large=5 ... stream=5000 ...` takes the EM iterations of each size and
the datapoints of streams. It needs an environment with pilotfish.
"""

import os
import sys
from pathlib import Path

import numpy as np
from make_streams import make_streams
from problems import Floats, FrameProblem, Integers, Poses, SegmentProblem, Sequences, Tracking

from pilotfish.control import double_integrator
from pilotfish.geometry import Pose, conjugate, multiply, quaternion_exp, quaternion_log, unwrap_quaternions
from pilotfish.io import datasets

STATES, STEPS, PERIOD = 7, 200, 0.1  # s
REGULARISATION = 1e-5  # default of pf.learn
COVARIANCE_REGULARISATION, CONTROL_COST = 2e-3, 9.0  # as in the published experiments
MAX_DURATION = 100  # steps of a segment
SIZES = {  # demonstrations, steps, columns, states
    "large": (50, 500, 14, 10),
    "vast": (2000, 300, 14, 10),
    "wide": (2, 500, 94, 30),
    "semi_markov": (1, 500, 14, 10),
}


def main() -> None:
    folder = Path(sys.argv[1])
    sizes = {size: int(count) for size, _, count in (word.partition("=") for word in sys.argv[2:])}
    recording = os.environ.get("PILOTFISH_DATA")
    x, A, b = real_valve(Path(recording)) if recording else synthetic_valve(np.random.default_rng(1))
    valve = single_frame_problem(x, sizes["valve"])
    valve.save(folder / "valve")
    multi_frame_problem(x, A, b, sizes["valve"]).save(folder / "frames")
    valve_reference(x).save(folder / "tracking")
    to_segment_problem(valve, sizes["semi_markov"]).save(folder / "semi_markov_valve")
    for number, size in enumerate(("large", "vast", "wide")):
        sample_markov_problem(np.random.default_rng(2 + number), SIZES[size], sizes[size]).save(folder / size)
    one = sample_markov_problem(np.random.default_rng(5), SIZES["semi_markov"], sizes["semi_markov"])
    to_segment_problem(one, sizes["semi_markov"]).save(folder / "semi_markov")
    sample_tool_poses(np.random.default_rng(6)).save(folder / "poses")
    make_streams(folder, sizes)
    print("real" if recording else "synthetic")


def real_valve(data: Path) -> tuple[Floats, Floats, Floats]:
    demonstrations = datasets.read_valve_mat(data / "valve" / "BaxterValveDemos2.mat")[:4]
    A = np.stack([[frame.A for frame in demo.frames] for demo in demonstrations])
    b = np.stack([[frame.b for frame in demo.frames] for demo in demonstrations])
    return np.stack([demo.x for demo in demonstrations]), A, b


def synthetic_valve(rng: np.random.Generator) -> tuple[Floats, Floats, Floats]:
    """Return four movements of 7 coordinates with velocities between points of two frames."""
    s = np.linspace(0.0, 1.0, STEPS)[:, None]
    blend = 10 * s**3 - 15 * s**4 + 6 * s**5
    ends, x, A, b = rng.normal(size=(2, 7)), [], [], []
    for _ in range(4):
        rotations = [np.linalg.qr(rng.normal(size=(7, 7)))[0] for _ in ends]
        translations = rng.normal(size=(2, 7))
        begin, end = (R @ point + t for R, point, t in zip(rotations, ends, translations, strict=True))
        places = begin + blend * (end - begin) + 0.01 * rng.normal(size=(STEPS, 7))
        x.append(np.hstack([places, np.gradient(places, PERIOD, axis=0)]))
        A.append([np.kron(np.eye(2), R) for R in rotations])
        b.append([np.concatenate([t, np.zeros(7)]) for t in translations])
    return np.stack(x), np.array(A), np.array(b)


def time_bins(demonstrations: int) -> Integers:
    """Return the state of each step when every demonstration is divided into equal times."""
    return np.tile(np.arange(STEPS) * STATES // STEPS, demonstrations).astype(np.int64)


def gaussians_by_label(x: Floats, labels: Integers, ridge: float) -> tuple[Floats, Floats]:
    """Return mean and covariance of the points of each label; ridge is added to the variances."""
    groups = [x[labels == k] for k in range(labels.max() + 1)]
    covariances = [np.cov(g.T, bias=True) + ridge * np.eye(x.shape[1]) for g in groups]
    return np.stack([g.mean(axis=0) for g in groups]), np.stack(covariances)


def sticky_transitions(states: int, stay: float) -> Floats:
    """Return transitions with a self-transition probability; the other states share the rest."""
    leave = (1.0 - stay) / (states - 1)
    return leave * np.ones((states, states)) + (stay - leave) * np.eye(states)


def single_frame_problem(x: Floats, iterations: int) -> Sequences:
    flat = x.reshape(-1, x.shape[-1])
    means, covariances = gaussians_by_label(flat, time_bins(len(x)), ridge=1e-4)
    uniform, lengths = np.full(STATES, 1 / STATES), np.full(len(x), STEPS)
    return Sequences(flat, lengths, uniform, sticky_transitions(STATES, 0.9), means, covariances, iterations)


def multi_frame_problem(x: Floats, A: Floats, b: Floats, iterations: int) -> FrameProblem:
    local = np.linalg.solve(A, (x[:, None] - b[:, :, None]).swapaxes(-1, -2)).swapaxes(-1, -2)  # (M, P, T, D)
    joint = np.ascontiguousarray(local.transpose(0, 2, 1, 3).reshape(-1, A.shape[1] * x.shape[-1]))
    labels = time_bins(len(x))
    means, covariances = gaussians_by_label(joint, labels, ridge=REGULARISATION)
    weights = np.bincount(labels) / len(labels)
    return FrameProblem(x, A, b, STATES, iterations, joint, weights, means, covariances)


def sample_markov_problem(
    rng: np.random.Generator, size: tuple[int, int, int, int], iterations: int
) -> Sequences:
    """Sample M sequences of T steps in D dimensions from K overlapping Gaussians of about 50 steps each."""
    M, T, D, K = size
    transitions, means = sticky_transitions(K, 0.98), rng.normal(size=(K, D))
    factors = rng.normal(size=(K, D, D)) / np.sqrt(D) + 0.3 * np.eye(D)
    states = np.empty((M, T), dtype=np.int64)
    states[:, 0] = rng.integers(K, size=M)
    for t in range(1, T):
        moves = rng.integers(1, K, size=M)  # to another state, with equal probability
        states[:, t] = np.where(rng.random(M) < 0.98, states[:, t - 1], (states[:, t - 1] + moves) % K)
    labels = states.ravel()
    x = rng.normal(size=(M * T, D))
    for k in range(K):
        x[labels == k] = means[k] + x[labels == k] @ factors[k].T
    initial_means = x[rng.choice(len(x), K, replace=False)]
    pooled = np.tile(np.cov(x.T), (K, 1, 1))
    return Sequences(x, np.full(M, T), np.full(K, 1 / K), transitions, initial_means, pooled, iterations)


def to_segment_problem(given: Sequences, iterations: int) -> SegmentProblem:
    """Return the semi-Markov problem of the same data, with uniform initial durations up to MAX_DURATION."""
    K = len(given.initial)
    leave = (np.ones((K, K)) - np.eye(K)) / (K - 1)
    durations = np.full((MAX_DURATION, K), 1 / MAX_DURATION)
    return SegmentProblem(
        given.x, given.lengths, given.initial, leave, given.means, given.covariances, iterations, durations
    )


def sample_tool_poses(rng: np.random.Generator) -> Poses:
    """Sample four movements of a tool between two objects with varying poses."""
    s = np.linspace(0.0, 1.0, STEPS)[:, None]
    blend = 10 * s**3 - 15 * s**4 + 6 * s**5
    # Pose of the tool relative to the object, at each end.
    grasps = [Pose(rng.normal(size=3), quaternion_exp(rng.normal(size=3))) for _ in range(2)]
    x, objects = [], []
    for _ in range(4):
        poses = [Pose(rng.normal(size=3), quaternion_exp(rng.normal(size=3))) for _ in grasps]
        begin, end = (world @ tool for world, tool in zip(poses, grasps, strict=True))
        turn = quaternion_log(multiply(conjugate(begin.quaternion), end.quaternion))
        q = multiply(np.tile(begin.quaternion, (STEPS, 1)), quaternion_exp(blend * turn))
        q = multiply(q, quaternion_exp(0.02 * rng.normal(size=(STEPS, 3))))
        places = begin.position + blend * (end.position - begin.position) + 0.01 * rng.normal(size=(STEPS, 3))
        x.append(np.hstack([places, unwrap_quaternions(q)]))
        objects.append([np.concatenate([pose.position, pose.quaternion]) for pose in poses])
    return Poses(np.stack(x), np.array(objects), STATES)


def valve_reference(x: Floats) -> Tracking:
    """Return a step-wise reference through the mean of each time bin, weighted by its precision."""
    system, labels = double_integrator(x.shape[-1] // 2, PERIOD), time_bins(1)
    means, covariances = gaussians_by_label(
        x.reshape(-1, x.shape[-1]), time_bins(len(x)), ridge=COVARIANCE_REGULARISATION
    )
    precisions = np.linalg.inv(covariances)
    precisions = 0.5 * (precisions + precisions.swapaxes(-1, -2))
    begins = np.searchsorted(labels, np.arange(STATES))
    control_cost = CONTROL_COST * np.eye(system.B.shape[1])
    return Tracking(system.A, system.B, precisions[labels], means[labels], control_cost, begins)


if __name__ == "__main__":
    main()
