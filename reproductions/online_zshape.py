"""The Z-shaped movement as a stream: figures 5.1, 5.3 and 5.4 of the thesis, from its own recording.

    python reproductions/online_zshape.py --json zshape.json --out zshape/

Five demonstrations of 300 points in three dimensions, one after the other. Figure 5.3 is drawn twice. The
thesis' equations compare lambda with a squared distance; with its lambda (35 and 14) there are then dozens of
clusters, for the Z is 145 units wide. If lambda is taken for a length, and squared, there are a handful.
Which of the two the figure shows cannot be told from the text. Clusters are not merged there: that is part
of algorithm 5.

Figure 5.1 is of SOSC, which tracking reads velocities from, so they are columns too. The printed lambda is
far too small then (speeds are 60 units a second): penalties come from a batch fit of the first demonstration.
R is 1e-4 where zshape.py has 1e-2, for sigma^2 weighs speeds less than a full covariance does. Along x, where
demonstrations begin 10 apart, no motion can be right for all (zshape.py tells more of that): the stream's
moves to the middle, a batch fit's stays where it begins. Along y and z the batch fit is the better.

Figure 5.4 says that order matters. How much is measured over shuffles: of the five demonstrations, of the
datapoints within each, and of everything. Labels are those of the model at the end, so that every datapoint
has one; loss is (lambda K + lambda_1 sum d + sum of squared distances) / N, which is (5.12) a datapoint.

Source: Tanwani 2018, sections 5.4 and 5.6; the measurements of order are ours.
"""

import argparse
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

import pilotfish as pf
from pilotfish import plots
from pilotfish.control import Motion
from pilotfish.demonstrations import Demonstration, add_derivatives, demonstration
from pilotfish.models import SemiMarkovChain, normalised_mutual_information
from pilotfish.models.online import (
    DPGMM,
    DPMPPCA,
    SOSC,
    Maintenance,
    OnlineModel,
    OnlineSettings,
    estimate_penalties,
    from_batch_fit,
    observe_demonstration,
    observe_stream,
    online_model,
    to_skill,
)

CONTROL_COST, HORIZON, SHUFFLES = 1e-4, 300, 100
APART = Maintenance(merge_distance=0.0)
GMM = DPGMM(cluster=35.0, noise=100.0, maintenance=APART)
MPPCA = DPMPPCA(cluster=14.0, dimension=2.0, noise=1.0, bandwidth=1e4, maintenance=APART)
ENCODINGS: dict[str, DPGMM | DPMPPCA] = {
    "DP-GMM, lambda = 35 a square": GMM,
    "DP-GMM, lambda = 35 a length": replace(GMM, cluster=35.0**2),
    "DP-MPPCA, lambda = 14 a square": MPPCA,
    "DP-MPPCA, lambda = 14 a length": replace(MPPCA, cluster=14.0**2),
}
LENGTH = replace(MPPCA, cluster=14.0**2, maintenance=Maintenance())
NOTES = (
    "the thesis prints no number of these figures; subspaces fit better with fewer clusters, as it says",
    "with d = 2 of 3 nearly all the time the clusters of the second reading are planes, one or two a showing",
)


@dataclass(frozen=True, slots=True)
class OrderExperiment:
    """A way to learn from a stream whose order is chance."""

    settings: DPMPPCA
    passes: int = 1
    initial_batch: bool = False


ORDER_EXPERIMENTS = {
    "lambda a square": OrderExperiment(replace(MPPCA, maintenance=Maintenance())),
    "lambda a length": OrderExperiment(LENGTH),
    "no merging": OrderExperiment(replace(LENGTH, maintenance=APART)),
    "merging below 28": OrderExperiment(replace(LENGTH, maintenance=Maintenance(merge_distance=28.0))),
    "batches of 50": OrderExperiment(replace(LENGTH, maintenance=Maintenance(batch=50))),
    "batches of 300": OrderExperiment(replace(LENGTH, maintenance=Maintenance(batch=300))),
    "two passes": OrderExperiment(LENGTH, passes=2),
    "five passes": OrderExperiment(LENGTH, passes=5),
    "begun from a batch fit": OrderExperiment(LENGTH, initial_batch=True),
    "begun, two passes": OrderExperiment(LENGTH, passes=2, initial_batch=True),
}
KINDS = ("demonstrations", "within each", "everything")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", type=Path, help="file for the numbers")
    parser.add_argument("--out", type=Path, help="folder for the pictures")
    parser.add_argument("--shuffles", type=int, default=SHUFFLES, help="of every kind")
    arguments = parser.parse_args()
    try:
        shown = pf.datasets.zshape()
    except pf.SkillError as error:
        parser.exit(1, f"{error}\n")
    encoded = {name: streamed(settings, shown) for name, settings in ENCODINGS.items()}
    rows = [encoding(name, model, shown) for name, model in encoded.items()]
    sequence, pictures = sosc(shown)
    orders = [
        row
        for name, experiment in ORDER_EXPERIMENTS.items()
        for row in evaluate_shuffles(name, experiment, shown, arguments.shuffles)
    ]
    print_encodings(rows)
    print_sequence(sequence)
    print_orders(orders, arguments.shuffles)
    for note in NOTES:
        print(f"note: {note}")
    if arguments.out:
        arguments.out.mkdir(parents=True, exist_ok=True)
        pictures |= {
            "figure-5.3-encodings": draw_encodings(encoded, shown),
            "figure-5.4-orders": draw_orders(shown),
        }
        for name, figure in pictures.items():
            figure.savefig(arguments.out / f"{name}.png", dpi=110)
        print(f"{len(pictures)} pictures in {arguments.out}")
    if arguments.json:
        arguments.json.parent.mkdir(parents=True, exist_ok=True)
        numbers = {"rows": rows, "sequence": sequence, "orders": orders, "notes": NOTES}
        arguments.json.write_text(json.dumps(numbers, indent=2) + "\n")


# ------------------------------------------------------------------------------------------------- figure 5.3


def streamed(settings: OnlineSettings, shown: Sequence[Demonstration]) -> OnlineModel:
    model = empty(settings, shown[0])
    for one in shown:
        model, _ = observe_demonstration(model, one)
    return model


def empty(settings: OnlineSettings, like: Demonstration) -> OnlineModel:
    return online_model(settings, like.layout, like.period, tuple(frame.name for frame in like.frames))


def squared_distances(model: OnlineModel, x: np.ndarray, bandwidth: float = np.inf) -> np.ndarray:
    """From every datapoint to every cluster's subspace (5.13), (N, K)."""
    columns = []
    for mean, basis, d in zip(
        model.means[:, 0], model.state.bases[:, 0], model.dimensions[:, 0].tolist(), strict=True
    ):
        errors = x - mean
        squares = np.sum(errors**2, axis=1)
        near = 1.0 - np.expm1(-squares / bandwidth) ** 2  # 2 rho - rho^2
        columns.append(squares - near * np.sum((errors @ basis[:, :d]) ** 2, axis=1))
    return np.asarray(np.maximum(np.stack(columns, axis=1), 0.0))


def bandwidth_of(model: OnlineModel) -> float:
    return model.settings.bandwidth if isinstance(model.settings, DPMPPCA | SOSC) else np.inf


def encoding(name: str, model: OnlineModel, shown: Sequence[Demonstration]) -> dict[str, object]:
    x = np.vstack([one.x for one in shown])
    apart = squared_distances(model, x, bandwidth_of(model))
    d = model.dimensions[:, 0]
    return {
        "encoding": name,
        "clusters": model.clusters,
        "dimensions": {str(n): int(np.sum(d == n)) for n in range(3) if np.any(d == n)},
        "mean squared distance": float(apart.min(axis=1).mean()),
        "numbers": int(model.clusters * 3 + 3 * d.sum()),
    }


def print_encodings(rows: Sequence[dict[str, object]]) -> None:
    print("figure 5.3: clusters, their subspaces, mean squared distance to these [squared unit of the file]")
    print(f"  {'':<34}{'K':>4}  {'d (how many clusters have it)':<32}{'distance':>9}{'numbers':>9}")
    for row in rows:
        d = row["dimensions"]
        assert isinstance(d, dict)
        told = ", ".join(f"{n} ({count})" for n, count in d.items())
        print(
            f"  {row['encoding']:<34}{row['clusters']:>4}  {told:<32}"
            f"{row['mean squared distance']:>9.2f}{row['numbers']:>9}"
        )
    print("  thesis: a drawing; numbers are those of means and bases\n")


def draw_encodings(encoded: dict[str, OnlineModel], shown: Sequence[Demonstration]) -> Figure:
    figure = Figure(figsize=(11, 9), layout="constrained")
    x = np.vstack([one.x for one in shown])
    for n, (name, model) in enumerate(encoded.items()):
        axes = figure.add_subplot(2, 2, n + 1, projection="3d")
        draw_clusters(axes, model, x)
        title = name.replace("lambda", "λ").replace("a square", "a squared distance")
        axes.set_title(f"{title}: K = {model.clusters}", fontsize=11, y=0.95)
    return figure


def draw_clusters(axes, model: OnlineModel, x: np.ndarray) -> None:  # type: ignore[no-untyped-def]  # 3-D axes are untyped in matplotlib
    """Datapoints in their cluster's colour, means, and the ellipsoids at one deviation."""
    labels = squared_distances(model, x[:, :3] if model.layout.width == 3 else x, bandwidth_of(model)).argmin(
        1
    )
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
    axes.set_box_aspect((0.9, 1.3, 1.0), zoom=0.92)  # leaves room for the label of z


# ------------------------------------------------------------------------------------------------- figure 5.1


def sosc(shown: Sequence[Demonstration]) -> tuple[dict[str, object], dict[str, Figure]]:
    """States, order and durations from the stream of positions and velocities, and a motion of these."""
    moving = [add_derivatives(one) for one in shown]
    fit = pf.learn(moving[:1], states=3, rng=np.random.default_rng(0))
    settings = estimate_penalties(fit.skill, moving[:1])
    model = streamed(settings, moving)
    skill = to_skill(model)
    batch = pf.learn(moving, states=model.clusters, rng=np.random.default_rng(0)).skill
    printed = SOSC(cluster=14.0, dimension=2.0, noise=1.0, bandwidth=1e4)
    chain = skill.dynamics
    assert isinstance(chain, SemiMarkovChain)
    seconds = skill.period * np.stack([chain.durations.means, chain.durations.deviations])
    penalties = {
        "lambda": settings.cluster,
        "lambda_1": settings.dimension,
        "lambda_2": settings.transition,
        "sigma^2": settings.noise,
        "b_m": settings.bandwidth,
    }
    row: dict[str, object] = {
        "penalties": penalties,
        "K after each demonstration": [
            streamed(settings, moving[: n + 1]).clusters for n in range(len(moving))
        ],
        "dimensions [1]": model.dimensions[:, 0].tolist(),
        "durations [s]": seconds[0].round(2).tolist(),
        "deviations of durations [s]": seconds[1].round(3).tolist(),
        "squared error along x, y, z": squared_errors(made(skill, moving).x, moving),
        "the same, batch fit of as many states": squared_errors(made(batch, moving).x, moving),
        "K with the penalties of figure 5.3": streamed(printed, moving).clusters,
    }
    pictures = {"figure-5.1-states": draw_states(model, moving), "figure-5.1-graph": plots.state_graph(skill)}
    return row, pictures


def made(skill: pf.Skill, moving: Sequence[Demonstration]) -> Motion:
    """The motion from where the first demonstration began."""
    here, start = pf.adapt(skill, moving[0].frames), moving[0].x[0]
    reference = pf.plan(here, start, horizon=HORIZON)
    return pf.track(
        pf.control.double_integrator(3, period=here.period), reference, control_cost=CONTROL_COST
    ).rollout(start)


def draw_states(model: OnlineModel, moving: Sequence[Demonstration]) -> Figure:
    figure = Figure(figsize=(7, 6), layout="constrained")
    axes = figure.add_subplot(projection="3d")
    draw_clusters(axes, model, np.vstack([one.x for one in moving]))
    skill = to_skill(model)
    axes.plot(*made(skill, moving).x[:, :3].T, color="black", linewidth=2.0)
    for k, mean in enumerate(skill.means[0][:, :3]):
        style = [withStroke(linewidth=3, foreground="white")]
        axes.text(*mean, f" {k}", fontsize=13, fontweight="bold", zorder=20, path_effects=style)
    axes.set_title("states of SOSC, and the motion (black) that they make", fontsize=11, y=0.95)
    return figure


def squared_errors(x: np.ndarray, moving: Sequence[Demonstration]) -> list[float]:
    """Along x, y and z, mean over all demonstrations."""
    errors = [np.mean((x[:, :3] - one.x[:, :3]) ** 2, axis=0) for one in moving]
    return [round(float(e), 2) for e in np.mean(errors, axis=0)]


def print_sequence(row: dict[str, object]) -> None:
    print("figure 5.1: SOSC of positions and velocities")
    for key, value in row.items():
        told = value
        if isinstance(value, dict):
            told = ", ".join(f"{name} = {number:.4g}" for name, number in value.items())
        print(f"  {key:<38}{told}")
    print()


# ------------------------------------------------------------------------------------------------- figure 5.4


def shuffle(kind: str, lengths: Sequence[int], rng: np.random.Generator) -> np.ndarray:
    """The places of the datapoints in their new order."""
    parts = np.split(np.arange(sum(lengths)), np.cumsum(lengths)[:-1])
    if kind == "demonstrations":
        return np.concatenate([parts[n] for n in rng.permutation(len(parts))])
    if kind == "within each":
        return np.concatenate([rng.permutation(part) for part in parts])
    return rng.permutation(sum(lengths))


def learn_skill(experiment: OrderExperiment, x: np.ndarray, like: Demonstration) -> OnlineModel:
    """The model of a stream that comes in this order."""
    model, seen = empty(experiment.settings, like), 0
    if experiment.initial_batch:
        seen = 2 * len(x) // 5  # as many datapoints as two demonstrations have
        first = demonstration(x[:seen], like.period, like.layout, like.frames, "the first datapoints")
        fit = pf.learn(
            [first],
            states=3,
            rng=np.random.default_rng(0),
            dynamics="mixture",
            initialisation=pf.models.KMeans(),
        )
        model = from_batch_fit(fit.skill, [first], experiment.settings)
    model, _ = observe_stream(model, x[seen:])
    for _ in range(experiment.passes - 1):
        model, _ = observe_stream(model, x)
    return model


def evaluate_model(
    experiment: OrderExperiment, model: OnlineModel, x: np.ndarray
) -> tuple[np.ndarray, float]:
    """The cluster of every datapoint, and the mean loss."""
    s = experiment.settings
    apart = squared_distances(model, x, s.bandwidth)
    penalty = s.cluster * model.clusters + s.dimension * int(model.dimensions.sum())
    return apart.argmin(axis=1), float(penalty / len(x) + apart.min(axis=1).mean())


def evaluate_shuffles(
    name: str, experiment: OrderExperiment, shown: Sequence[Demonstration], shuffles: int
) -> list[dict[str, object]]:
    x, lengths = np.vstack([one.x for one in shown]), [len(one.x) for one in shown]
    own = learn_skill(experiment, x, shown[0])
    labels, loss = evaluate_model(experiment, own, x)
    rows: list[dict[str, object]] = []
    for kind in KINDS:
        models = [
            learn_skill(experiment, x[shuffle(kind, lengths, np.random.default_rng(seed))], shown[0])
            for seed in range(shuffles)
        ]
        found = [evaluate_model(experiment, model, x) for model in models]
        K = np.array([model.clusters for model in models])
        rows.append(
            {
                "remedy": name,
                "shuffled": kind,
                "in order, clusters": own.clusters,
                "in order, loss": loss,
                "clusters": {str(n): int(np.sum(n == K)) for n in np.unique(K).tolist()},
                "mean clusters": float(K.mean()),
                "deviation of clusters": float(K.std()),
                "mean sum of dimensions": float(np.mean([model.dimensions.sum() for model in models])),
                "information with in order": mean(
                    lambda one: normalised_mutual_information(one[0], labels), found
                ),
                "information with each other": agreement([one[0] for one in found[:20]]),
                "loss": float(np.mean([one[1] for one in found])),
                "deviation of loss": float(np.std([one[1] for one in found])),
            }
        )
    return rows


def mean(
    measure: Callable[[tuple[np.ndarray, float]], float], found: Sequence[tuple[np.ndarray, float]]
) -> float:
    return float(np.mean([measure(one) for one in found]))


def agreement(labels: Sequence[np.ndarray]) -> float:
    """Mean normalised mutual information of any two of them."""
    pairs = [normalised_mutual_information(a, b) for a, b in combinations(labels, 2)]
    return float(np.mean(pairs)) if pairs else 1.0


def print_orders(rows: Sequence[dict[str, object]], shuffles: int) -> None:
    print(f"figure 5.4: {shuffles} shuffles of each kind; DP-MPPCA, lambda = 14 as a length unless told")
    print(f"{'':<39}{'in order':>13}{'shuffled: mean (deviation)':>28}{'NMI with':>16}")
    print(
        f"{'':<24}{'of':<15}{'K':>4}{'loss':>9}{'K':>15}{'sum d':>8}{'in order':>10}{'each other':>11}"
        f"{'loss':>16}"
    )
    for row in rows:
        clusters = f"{row['mean clusters']:.1f} ({row['deviation of clusters']:.1f})"
        loss = f"{row['loss']:.2f} ({row['deviation of loss']:.2f})"
        print(
            f"{row['remedy']:<24}{row['shuffled']:<15}{row['in order, clusters']:>4}"
            f"{row['in order, loss']:>9.2f}{clusters:>15}{row['mean sum of dimensions']:>8.1f}"
            f"{row['information with in order']:>10.3f}{row['information with each other']:>10.3f}{loss:>17}"
        )


def draw_orders(shown: Sequence[Demonstration]) -> Figure:
    """The models of the demonstrations as they come, and of the order of everything that agrees least."""
    x, lengths = np.vstack([one.x for one in shown]), [len(one.x) for one in shown]
    experiment = ORDER_EXPERIMENTS["lambda a length"]
    models = [learn_skill(experiment, x, shown[0])]
    labels, _ = evaluate_model(experiment, models[0], x)
    titles = ["demonstrations as they come"]
    for kind, title in ((KINDS[0], "demonstrations in another order"), (KINDS[2], "all datapoints shuffled")):
        others = [
            learn_skill(experiment, x[shuffle(kind, lengths, np.random.default_rng(seed))], shown[0])
            for seed in range(20)
        ]
        agree = [normalised_mutual_information(evaluate_model(experiment, m, x)[0], labels) for m in others]
        models.append(others[int(np.argmin(agree))])
        titles.append(title)
    figure = Figure(figsize=(14, 4.8), layout="constrained")
    for n, (model, title) in enumerate(zip(models, titles, strict=True)):
        axes = figure.add_subplot(1, 3, n + 1, projection="3d")
        draw_clusters(axes, model, x)
        d = ", ".join(map(str, model.dimensions[:, 0].tolist()))
        axes.set_title(f"{title}\nK = {model.clusters}, d = {{{d}}}", fontsize=11, y=0.95)
    return figure


if __name__ == "__main__":
    main()
