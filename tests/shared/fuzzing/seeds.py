"""Valid values for every decoder, small so that many mutants can be run."""

from collections.abc import Iterator
from functools import cache

import numpy as np

from pilotfish import gaussians, models
from pilotfish.demonstrations import (
    Demonstration,
    Layout,
    Part,
    Quantity,
    add_derivatives,
    demonstration,
    frame_from_pose,
    pose_layout,
    position_layout,
    resample,
    to_sphere,
)
from pilotfish.geometry import pose, quaternion_exp
from pilotfish.io.synthetic import synthetic_valve
from pilotfish.models import DurationModel, EMSettings, Skill, online
from pilotfish.models.durations import DISTRIBUTIONS

FAST_SETTINGS = EMSettings(regularisation=1e-4, max_iterations=8)
STEPS = 14


@cache
def valve_demonstrations() -> tuple[Demonstration, ...]:
    """Return three short openings of a valve with quaternions and two frames."""
    demonstrations = synthetic_valve(np.random.default_rng(0))[:3]
    return tuple(_poses(resample(demo, STEPS)) for demo in demonstrations)


def _poses(demo: Demonstration) -> Demonstration:
    frames = [
        frame_from_pose(
            f"frame {n}", pose_layout(), pose(given.b[:3], quaternion_exp(np.array([0.1 * n, 0.2, 0.0])))
        )
        for n, given in enumerate(demo.frames)
    ]
    x = demo.x[:, :7].copy()
    x[:, 3:] /= np.linalg.norm(x[:, 3:], axis=1, keepdims=True)
    return demonstration(x, demo.period, pose_layout(), frames, demo.name)


@cache
def lines() -> tuple[Demonstration, ...]:
    """Return three short lines in a plane, in the world frame."""
    rng = np.random.default_rng(1)
    way = np.linspace(0.0, 1.0, STEPS)[:, None] * np.array([1.0, -0.5])
    return tuple(
        demonstration(way + 0.02 * rng.normal(size=way.shape), 0.1, position_layout(2), name=f"line {m}")
        for m in range(3)
    )


@cache
def gripper_demonstrations() -> tuple[Demonstration, ...]:
    """Return three short demonstrations of a position, a force and a gripper."""
    rng = np.random.default_rng(2)
    layout = Layout(
        (
            Part("position", Quantity.POSITION, 2, "m"),
            Part("force", Quantity.VECTOR, 2, "N"),
            Part("grip", Quantity.SCALAR, 1, "1"),
        )
    )
    x = np.linspace(0.0, 1.0, STEPS)[:, None] * np.array([1.0, 2.0, 0.3, -0.4, 1.0])
    return tuple(
        demonstration(x + 0.05 * rng.normal(size=x.shape), 0.05, layout, name=f"grip {m}") for m in range(3)
    )


@cache
def skills() -> tuple[Skill, ...]:
    """Return skills of every dynamics, duration distribution and covariance structure, some on S^3."""
    return tuple(_skills())


def _skills() -> Iterator[Skill]:
    flat = [add_derivatives(demo) for demo in lines()]
    turning = [add_derivatives(demo) for demo in valve_demonstrations()]
    curved = [add_derivatives(to_sphere(demo)) for demo in valve_demonstrations()]

    def fit(data, states=3, **options):  # type: ignore[no-untyped-def] # options of learn
        rng = np.random.default_rng(0)
        return models.learn(data, states=states, rng=rng, settings=FAST_SETTINGS, **options).skill

    yield fit(flat, dynamics="mixture")
    yield fit(turning, dynamics="markov")
    yield fit(turning)
    yield fit(curved, states=2)
    yield fit(gripper_demonstrations(), states=2)
    for name, distribution in DISTRIBUTIONS.items():
        options = {"pseudocount": 1.0} if name == "histogram" else {}
        yield fit(flat, durations=DurationModel(distribution, options=options))
    structures = (
        gaussians.structures.SemiTied(0.7),
        gaussians.structures.MFA(1),
        gaussians.structures.MPPCA(1),
        gaussians.structures.HDDC(1),
    )
    for structure in (
        *structures,
        gaussians.structures.EMLLT(5),
        gaussians.structures.MLT(2),
        gaussians.structures.Diagonal(),
    ):
        yield fit(flat, structure=structure)


@cache
def streams() -> tuple[online.OnlineModel, ...]:
    """Return models of every online learner and weighting after a few datapoints."""
    settings = (
        online.DPGMM(cluster=0.1, noise=1e-3),
        online.DPMPPCA(cluster=0.1, dimension=1e-4, noise=1e-3, bandwidth=0.1),
        online.HDPHSMM(
            cluster=0.1,
            noise=1e-3,
            transition=0.1,
            new_transition=0.1,
            maintenance=online.Maintenance(
                discount=0.9, forget_below=0.01, extra_directions=2, max_clusters=8
            ),
        ),
        online.SOSC(
            cluster=0.1,
            dimension=1e-4,
            noise=1e-3,
            bandwidth=0.1,
            maintenance=online.Maintenance(constant_weight=5.0, merge_distance=0.05, batch=4),
        ),
    )
    return tuple(_grow_stream(one, data) for one in settings for data in (lines(), valve_demonstrations()))


def _grow_stream(settings: online.OnlineSettings, data: tuple[Demonstration, ...]) -> online.OnlineModel:
    names = tuple(given.name for given in data[0].frames)
    model = online.online_model(settings, data[0].layout, data[0].period, names)
    for demo in data[:2]:
        model, _ = online.observe_demonstration(online.begin_demonstration(model), demo)
    return model
