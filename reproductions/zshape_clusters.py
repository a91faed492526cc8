"""Online models of the Z-shaped movement for online_zshape.py: learning, distances and drawing."""

from collections.abc import Sequence

import numpy as np

from pilotfish import plots
from pilotfish.demonstrations import Demonstration
from pilotfish.models.online import (
    DPMPPCA,
    SOSC,
    OnlineModel,
    OnlineSettings,
    observe_demonstration,
    online_model,
    to_skill,
)


def learn_stream(settings: OnlineSettings, demonstrations: Sequence[Demonstration]) -> OnlineModel:
    """Learn the demonstrations in order."""
    model = empty_model(settings, demonstrations[0])
    for demonstration in demonstrations:
        model, _ = observe_demonstration(model, demonstration)
    return model


def empty_model(settings: OnlineSettings, first: Demonstration) -> OnlineModel:
    """Create a model with the columns and frames of a demonstration."""
    names = tuple(frame.name for frame in first.frames)
    return online_model(settings, first.layout, first.period, names)


def squared_distances(model: OnlineModel, x: np.ndarray, bandwidth: float = np.inf) -> np.ndarray:
    """Return the squared distance of every datapoint to every subspace (5.13), (N, K)."""
    columns = []
    for mean, basis, d in zip(
        model.means[:, 0], model.state.bases[:, 0], model.dimensions[:, 0].tolist(), strict=True
    ):
        errors = x - mean
        squares = np.sum(errors**2, axis=1)
        weights = 1.0 - np.expm1(-squares / bandwidth) ** 2  # 2 rho - rho^2
        columns.append(squares - weights * np.sum((errors @ basis[:, :d]) ** 2, axis=1))
    return np.asarray(np.maximum(np.stack(columns, axis=1), 0.0))


def bandwidth(model: OnlineModel) -> float:
    """Return b_m of a model, infinite for spheres."""
    return model.settings.bandwidth if isinstance(model.settings, DPMPPCA | SOSC) else np.inf


def draw_clusters(axes, model: OnlineModel, x: np.ndarray) -> None:  # type: ignore[no-untyped-def]  # 3-D axes are untyped in matplotlib
    """Draw datapoints in the colour of their cluster, means, and ellipsoids at one standard deviation."""
    labels = squared_distances(model, x[:, :3] if model.layout.width == 3 else x, bandwidth(model)).argmin(1)
    colours = np.array([plots.state_colour(k) for k in range(model.clusters)])
    axes.scatter(*x[:, :3].T, s=4.0, color=colours[labels], alpha=0.9, linewidths=0)
    around, along = np.meshgrid(np.linspace(0, 2 * np.pi, 25), np.linspace(0, np.pi, 13))
    ball = np.stack([np.cos(around) * np.sin(along), np.sin(around) * np.sin(along), np.cos(along)], axis=-1)
    skill = to_skill(model)
    opacity = 0.28 if model.clusters < 30 else 0.06
    for k, (mean, covariance) in enumerate(
        zip(skill.means[0][:, :3], skill.covariances[0].dense[:, :3, :3], strict=True)
    ):
        values, vectors = np.linalg.eigh(covariance)
        surface = mean + (ball * np.sqrt(values)) @ vectors.T
        axes.plot_surface(*np.moveaxis(surface, -1, 0), color=colours[k], alpha=opacity, linewidth=0)
    axes.scatter(*skill.means[0][:, :3].T, s=18, color="black", marker="x", linewidths=1.0)
    axes.set(xlabel="x [unit of the file]", ylabel="y [unit of the file]", zlabel="z [unit of the file]")
    axes.set(xlim=(-5, 50), ylim=(-60, 105), zlim=(-5, 95))
    axes.set(xticks=[0, 20, 40], yticks=[-50, 0, 50, 100], zticks=[0, 40, 80])
    axes.view_init(elev=22, azim=-55)
    axes.tick_params(labelsize=8)
    axes.set_box_aspect((0.9, 1.3, 1.0), zoom=0.92)  # leaves space for the label of z
