"""Compute every kind of public result and print a line with its name and the hash of its bits.

Usage: python tests/shared/determinism_results.py OFFSET

OFFSET changes the memory addresses; results must not depend on it (tests/live/test_determinism.py).
"""

import sys
from hashlib import sha256

OFFSET = int(sys.argv[1]) if __name__ == "__main__" else 0
# Before NumPy and the kernels allocate memory: blocks of odd sizes, every second one freed.
PADDING = [bytes(16 * OFFSET + 24 * n + 1) for n in range(200)]
del PADDING[OFFSET % 2 :: 2]

from collections.abc import Callable, Iterator  # noqa: E402
from dataclasses import fields, is_dataclass, replace  # noqa: E402
from typing import Any  # noqa: E402

import numpy as np  # noqa: E402
from fuzzing.public_examples import examples, function_named  # noqa: E402
from fuzzing.seeds import FAST_SETTINGS, lines, valve_demonstrations  # noqa: E402

from pilotfish import gaussians, models  # noqa: E402
from pilotfish.demonstrations import add_derivatives, to_sphere  # noqa: E402
from pilotfish.models.durations import DISTRIBUTIONS  # noqa: E402

PACKAGES = (
    "geometry",
    "demonstrations",
    "gaussians",
    "models",
    "models.online",
    "control",
    "planning",
    "environments",
)
STRUCTURES = (
    *(gaussians.structures.Full(), gaussians.structures.Diagonal(), gaussians.structures.Spherical()),
    *(
        gaussians.structures.SemiTied(),
        gaussians.structures.SemiTied(tying=0.5),
        gaussians.structures.MFA(2),
        gaussians.structures.MPPCA(2),
    ),
    *(
        gaussians.structures.HDDC(2),
        gaussians.structures.HDDC(0.9),
        gaussians.structures.MLT(2),
        gaussians.structures.EMLLT(20),
    ),
)
DURATIONS = tuple(models.DurationModel(distribution) for distribution in DISTRIBUTIONS.values())
Compute = Callable[[], Any]


def array_bytes(value: Any) -> Iterator[bytes]:
    """Yield the bytes of every array, number and text in a value."""
    if isinstance(value, np.ndarray | np.generic):
        array = np.asarray(value)
        yield f"{array.dtype}{array.shape}".encode()
        yield array.tobytes() if array.dtype.kind != "O" else repr(array.tolist()).encode()
    elif is_dataclass(value) and not isinstance(value, type):
        for field in fields(value):
            yield field.name.encode()
            yield from array_bytes(getattr(value, field.name))
    elif isinstance(value, dict):
        for key in sorted(value, key=str):
            yield str(key).encode()
            yield from array_bytes(value[key])
    elif isinstance(value, list | tuple):
        for each in value:
            yield from array_bytes(each)
    elif isinstance(value, float):
        yield value.hex().encode()
    elif isinstance(value, int | str | bytes | None):
        yield repr(value).encode()


def learn_all_variants() -> Iterator[tuple[str, Compute]]:
    """Yield functions that learn with every structure, duration distribution and kind of dynamics."""
    given = [add_derivatives(demo) for demo in valve_demonstrations()]
    for structure in STRUCTURES:
        yield (
            f"learn with {structure.label}",
            lambda structure=structure: learn(models.learn, given, structure),
        )
    flat = [add_derivatives(demo) for demo in lines()]
    for durations in DURATIONS:
        yield (
            f"learn with {durations.distribution.name} durations {dict(durations.options)}",
            lambda durations=durations: models.learn(
                flat,
                states=3,
                rng=np.random.default_rng(0),
                durations=durations,
                settings=FAST_SETTINGS,
            ),
        )
    on_sphere = [add_derivatives(to_sphere(demo)) for demo in valve_demonstrations()]
    for threads in (1, 2):
        settings = replace(FAST_SETTINGS, threads=threads)
        yield (
            f"learn on the sphere with {threads} threads",
            lambda settings=settings: models.learn(
                on_sphere, states=3, rng=np.random.default_rng(0), settings=settings
            ),
        )
    yield (
        "learn from k-means",
        lambda: models.learn(
            given,
            states=3,
            rng=np.random.default_rng(0),
            initialisation=models.KMeans(),
            settings=FAST_SETTINGS,
        ),
    )


def learn(learner: Callable[..., Any], given: list[Any], structure: Any) -> Any:
    """Learn three states with a covariance structure."""
    return learner(given, states=3, rng=np.random.default_rng(0), structure=structure, settings=FAST_SETTINGS)


def results() -> Iterator[tuple[str, Compute]]:
    """Yield the name of every result and the function that computes it."""
    yield from learn_all_variants()
    for package in PACKAGES:
        for name, arguments in examples(package).items():
            yield name, lambda name=name, arguments=arguments: function_named(name)(**arguments)


def rollout() -> list[Any]:
    """Return the results of twenty steps of a task."""
    step = function_named("manipulation.step")
    action = examples("environments")["manipulation.step"]["action"]
    return [step(action) for _ in range(20)]


def main() -> None:
    """Print the name and the hash of every result."""
    kept = []  # so that later results have other addresses than in another process
    for name, compute in [*results(), ("a rollout of physics", rollout)]:
        kept.append(np.empty(1 + (7 * len(kept) + 2 * OFFSET) % 23))
        digest = sha256()
        for part in array_bytes(compute()):
            digest.update(part)
        sys.stdout.write(f"{name}\t{digest.hexdigest()}\n")


if __name__ == "__main__":
    main()
