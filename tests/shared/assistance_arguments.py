"""Random arguments of the kernel of assistance."""

from typing import Any

import numpy as np

from pilotfish.kernels import (
    AssistanceInput,
    AssistanceMemory,
    AssistanceSettings,
    CarriedModel,
    HandMap,
    OccupancyTables,
    StateFilter,
)


def positive_definite(rng: np.random.Generator, *shape: int) -> np.ndarray:
    """Return covariances of deviations of centimetres."""
    A = rng.normal(size=(*shape, shape[-1]))
    return 1e-3 * (A @ A.swapaxes(-1, -2) + np.eye(shape[-1]))


def assistance_arguments(rng: np.random.Generator) -> list[Any]:
    """Return arguments of assistance_step: with or without orientation and scalars, in any mode."""
    K, L = int(rng.integers(1, 8)), int(rng.choice([1, 2, 20]))
    is_oriented, S = bool(rng.random() < 0.7), int(rng.integers(3))
    E = 3 + 3 * is_oriented + S
    D = E + is_oriented

    def poses(*shape: int) -> np.ndarray:
        x = 0.3 * rng.normal(size=(*shape, D))
        if is_oriented:
            x[..., 3:7] = rng.normal(size=(*shape, 4))
            x[..., 3:7] /= np.linalg.norm(x[..., 3:7], axis=-1, keepdims=True)
        return x

    def near(x: np.ndarray) -> np.ndarray:
        moved = x + 0.02 * rng.normal(size=x.shape)
        if is_oriented:
            moved[..., 3:7] /= np.linalg.norm(moved[..., 3:7], axis=-1, keepdims=True)
        return moved

    means = poses(K)
    model = CarriedModel(
        means,
        np.linalg.inv(np.linalg.cholesky(positive_definite(rng, K, E))),
        near(means),
        0.01 * rng.normal(size=(K, E)),
        0.3 * rng.normal(size=(K, E, E)),
        positive_definite(rng, K, E),
    )
    tables = OccupancyTables(
        rng.dirichlet(np.ones(K)), rng.dirichlet(np.ones(K), K), rng.uniform(0.0, 0.5, (L, K)), 1e-4
    )
    belief = rng.dirichlet(np.ones(L * K)).reshape(L, K)
    elapsed = float(rng.choice([np.inf, 0.0, 0.05, 0.99]))
    filter_ = StateFilter(belief, rng.dirichlet(np.ones(K)), belief.sum(axis=0), elapsed)
    pose = near(means[rng.integers(K)])
    held = np.where(rng.random(S) < 0.5, np.nan, rng.random(S))
    memory = AssistanceMemory(
        *(filter_, near(pose), 0.05 * rng.normal(size=E), pose, 0.1 * rng.normal(size=E), near(pose)),
        *(
            held,
            rng.random(S),
            float(rng.choice([0.0, 0.01, rng.random()])),
            float(rng.random()),
            float(rng.random()) + 0.3,
        ),
        is_following=bool(rng.random() < 0.8),
        has_left=bool(rng.random() < 0.3),
    )
    numbers = (0.5, 5.0, 2.0, 20.0, 0.1)
    corner = np.full(3, float(rng.choice([0.2, 10.0])))
    settings = AssistanceSettings(rng.uniform(1e-4, 1e-2, E), -corner, corner, 1.0, 9.0, *numbers)
    hand_map = HandMap(
        np.eye(3) + 0.1 * rng.normal(size=(3, 3)), 0.01 * rng.normal(size=3), *rng.normal(size=(2, 4))
    )
    for q in (hand_map.left, hand_map.right):
        q /= np.linalg.norm(q)
    mode = int(rng.integers(3))
    is_given = mode == 2 or bool(rng.random() < 0.2)
    given = AssistanceInput(
        near(pose) * (1.0 if rng.random() < 0.9 else np.nan),
        near(pose) if is_given else None,
        positive_definite(rng, E) if is_given else None,
        float(rng.choice([0.001, 0.02, 0.1, 0.35])),
        mode,
        *(bool(flag) for flag in rng.random(3) < (0.9, 0.9, 0.1)),
    )
    return [hand_map, model, tables, settings, memory, given]
