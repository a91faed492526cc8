"""Random skills of every dynamics and covariance structure, and exact comparison of values."""

import math
import string
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
from hypothesis import strategies as st

from pilotfish.demonstrations import Layout, Part, Quantity
from pilotfish.gaussians.structures import EMLLT, HDDC, MFA, MLT, DenseCovariances, SemiTied
from pilotfish.models import (
    DemonstrationStatistics,
    Endpoints,
    FrameRanges,
    MarkovChain,
    MixtureWeights,
    MotionRanges,
    Provenance,
    SemiMarkovChain,
    Skill,
    coordinate_parts,
)
from pilotfish.models import durations as distributions

DYNAMICS = ("mixture", "markov", "semi-markov")
STRUCTURES = ("dense", "semi-tied", "latent", "expanded", "multiple-transforms", "mixed")
SEEDS = st.integers(0, 2**32 - 1)

Header = dict[str, Any]
Arrays = dict[str, np.ndarray]


def random_dynamics(
    rng: np.random.Generator, kind: str, K: int
) -> MixtureWeights | MarkovChain | SemiMarkovChain:
    initial, transitions = rng.dirichlet(np.ones(K)), rng.dirichlet(np.ones(K), size=K)
    if kind == "mixture":
        return MixtureWeights(initial)
    if kind == "markov":
        return MarkovChain(initial, transitions)
    onward = transitions * (1.0 - np.eye(K))
    onward[-1] = 0.0  # a final state
    statistics = onward.sum(axis=1, keepdims=True)
    onward = np.divide(onward, statistics, out=np.zeros_like(onward), where=statistics > 0.0)
    return SemiMarkovChain(initial, onward, distributions.Gaussian(*rng.uniform(0.1, 30.0, size=(2, K))))


def random_layout(rng: np.random.Generator) -> Layout:
    choices = (
        Part("position", Quantity.POSITION, 3, "m"),
        Part("orientation", Quantity.QUATERNION, 4, "1"),
        Part("force", Quantity.VECTOR, 2, "N"),
        Part("gripper ∆", Quantity.SCALAR, 1, "m"),
    )
    chosen = tuple(part for part in choices if rng.random() < 0.4) or choices[-1:]
    layout = Layout(chosen)
    return layout.differentiate() if rng.random() < 0.5 else layout


def random_covariances(rng: np.random.Generator, kind: str, K: int, D: int) -> Any:
    factors = rng.normal(size=(K, D, D))
    samples = factors @ factors.transpose(0, 2, 1) + 0.1 * np.eye(D)
    counts = np.ones(K)
    match kind:
        case "dense":
            return DenseCovariances(samples)
        case "latent":
            factors = int(rng.integers(0, D))
            structure = MFA(factors) if rng.random() < 0.5 else HDDC((factors,) * (K - 1) + (0,))
            return structure.estimate(counts, samples, None)
        case "expanded":
            return EMLLT(int(rng.integers(D, D * (D + 1) // 2 + 1))).estimate(counts, samples, None)
        case "multiple-transforms":
            return MLT(int(rng.integers(1, K + 1))).estimate(counts, samples, None)
    return SemiTied(tying=float(rng.choice([0.3, 1.0])), sweeps=2).estimate(counts, samples, None)


def random_skill(rng: np.random.Generator, dynamics: str, structure: str) -> Skill:
    layout, P, K = random_layout(rng), int(rng.integers(1, 4)), int(rng.integers(1, 5))
    kinds = {"mixed": ("dense", "semi-tied")}.get(structure, (structure,))
    means = rng.normal(size=(P, K, layout.width)) * 10.0 ** rng.integers(-300, 99)
    covariances = [random_covariances(rng, kinds[p % len(kinds)], K, layout.width) for p in range(P)]
    words = tuple(
        "".join(rng.choice(list(string.ascii_letters + string.punctuation + " é∆"), size=5))
        for _ in range(rng.integers(0, 4))
    )
    log_likelihood = float(rng.choice([rng.normal() * 1e5, math.nan]))
    provenance = Provenance(
        words,
        int(rng.integers(1, 10**6)),
        "0" * 64,
        "full",
        log_likelihood,
        7,
        bool(rng.random() < 0.5),
        "x",
    )
    period, names = float(rng.uniform(1e-3, 1.0)), tuple(f"frame {p}" for p in range(P))
    chain = random_dynamics(rng, dynamics, K)
    optional = random_optional_fields(rng, layout, P)
    return Skill(chain, means, tuple(covariances), layout, period, names, provenance, **optional)


def random_optional_fields(rng: np.random.Generator, layout: Layout, P: int) -> dict[str, Any]:
    """Return some of the fields that a skill of a stream does not have, for a layout without S^3."""
    D = layout.width
    lowest = rng.normal(size=D)
    switches = tuple(name for name in layout.names if rng.random() < 0.3)
    fields = {
        "regularisation": rng.uniform(size=D),
        "demonstrated": DemonstrationStatistics(
            rng.uniform(0.1, 1.0, size=D),
            lowest,
            lowest + rng.uniform(size=D),
            switches,
            *random_ranges(rng, layout, P),
        ),
        "endpoints": Endpoints(rng.normal(size=(P, 2, D)), rng.uniform(0.1, 1.0, size=(P, 2, D))),
    }
    return {name: value for name, value in fields.items() if rng.random() < 0.7}


def random_ranges(rng: np.random.Generator, layout: Layout, P: int) -> tuple[MotionRanges, FrameRanges]:
    """Return ranges of motions and frames in the columns of a layout."""
    Q, D = len(list(coordinate_parts(layout))), layout.width
    sizes, start, distances = rng.uniform(size=(4, Q)), rng.normal(size=D), rng.uniform(size=Q)
    lowest = rng.normal(size=(P, D))
    return (
        MotionRanges(int(rng.integers(1, 9)), int(rng.integers(9, 99)), *sizes, start, distances),
        FrameRanges(lowest, lowest + 1.0, rng.normal(size=(P, D, D)), rng.uniform(size=P)),
    )


def equal(one: Any, other: Any) -> bool:
    """Return whether values have the same type and the same bits at every level."""
    if type(one) is not type(other):
        return False
    if is_dataclass(one):
        return all(equal(getattr(one, f.name), getattr(other, f.name)) for f in fields(one))
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(equal, one, other))
    if isinstance(one, np.ndarray):
        return (one.dtype, one.shape, one.tobytes()) == (other.dtype, other.shape, other.tobytes())
    return bool(one == other or (one != one and other != other))
