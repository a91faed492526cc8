"""A stream that changes twice: figures 5.5 to 5.7 of the thesis.

    python reproductions/online_stages.py --json stages.json --out stages/

Three stages of 2500 datapoints in three dimensions. Clusters follow one another in a cycle, visits last 70 to
90 datapoints, all lengths alike likely. In the first stage there are four clusters, each a subspace of one or
two dimensions; in the second each has the other D - d dimensions; in the third there are two more. One model
(SOSC) sees every datapoint once, with the thesis' penalties. What the thesis leaves unsaid, and is ours:
datapoints are normal about the centre with deviation 1 along each basis vector of the subspace, and .2
(.04 I) in every column; the dimensions that a cluster flips to are those that it did not have, its
complement; the visit that goes on when a stage ends goes on; centres of the fifth and sixth cluster keep the
distance too.

The table is for three ways to keep the past. "thesis": as printed, where clusters whose means are closer than
lambda = 3.6 merge, although lambda is compared with squared distances elsewhere. "apart": they merge below
the square root of lambda, 1.9. "forgetting": the same, and clusters that have not been visited for long are
forgotten (weights below .3).

Source: Tanwani 2018, section 5.7.1.1.
"""

import argparse
import json
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.figure import Figure

import pilotfish as pf
from pilotfish import plots
from pilotfish.demonstrations import position_layout
from pilotfish.models import (
    SemiMarkovChain,
    log_state_likelihoods,
    match_labels,
    normalised_mutual_information,
    state_segments,
)
from pilotfish.models.online import (
    SOSC,
    Maintenance,
    OnlineModel,
    observe_stream,
    online_model,
    to_skill,
)

D, LENGTH, CLUSTERS = 3, 2500, (4, 4, 6)
MAX_COORDINATE, MIN_SEPARATION, MIN_DURATION, MAX_DURATION, DEVIATION = 5.0, 4.0, 70, 90, 0.2
MEAN_DURATION, DEVIATION_OF_DURATIONS = (
    80.0,
    float(np.sqrt(((MAX_DURATION - MIN_DURATION + 1) ** 2 - 1) / 12)),
)
SEEDS, SHOWN, PERIOD = 20, 2, 1.0  # a step is taken for a second: the thesis names no time
UPKEEPS = {
    "thesis": Maintenance(discount=0.995, merge_distance=3.6),
    "apart": Maintenance(discount=0.995),
    "forgetting": Maintenance(discount=0.995, forget_below=0.3),
}
NOTES = (
    "traces make subspaces forget, not transitions or durations: that the first followed the fourth before",
    "the third stage stays in the transition matrix, hence that error",
    "a datapoint that begins a cluster cuts the visit it falls into; the cut is undone when the two merge",
    "while the stream is in the one and came from the other, as with all born within the merge distance;",
    "where clusters merge later, visits stay cut: durations are short and spread. Joined: along the clusters",
    "that datapoints are in at the end of a stage",
    "the thesis shows one run, prints no number of it, and says that K and d are found in every stage",
)


@dataclass(frozen=True, slots=True, eq=False)
class Stage:
    """Datapoints, the cluster of each, and the truth of it: centres and bases."""

    x: np.ndarray
    labels: np.ndarray
    centres: np.ndarray
    bases: tuple[np.ndarray, ...]

    @property
    def dimensions(self) -> list[int]:
        return [basis.shape[1] for basis in self.bases]


@dataclass(frozen=True, slots=True, eq=False)
class StageResult:
    """The model after a stage, its own clusters of the stage's datapoints, and the time it took [s]."""

    stage: Stage
    model: OnlineModel
    cluster_ids: np.ndarray
    seconds: float


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", type=Path, help="file for the numbers")
    parser.add_argument("--out", type=Path, help="folder for the pictures and the animation")
    parser.add_argument("--seeds", type=int, default=SEEDS, help="streams of every way")
    arguments = parser.parse_args()
    rows = [row for way in UPKEEPS for row in measured(way, arguments.seeds)]
    print_table(rows, arguments.seeds)
    if arguments.out:
        arguments.out.mkdir(parents=True, exist_ok=True)
        for name, figure in pictures(0).items():
            figure.savefig(arguments.out / f"{name}.png", dpi=110)
        animate(0, arguments.out / "growing.gif")
        print(f"pictures and growing.gif in {arguments.out}")
    if arguments.json:
        arguments.json.parent.mkdir(parents=True, exist_ok=True)
        arguments.json.write_text(json.dumps({"rows": rows, "notes": NOTES}, indent=2) + "\n")


# ------------------------------------------------------------------------------------------------- the stream


@cache
def stages(seed: int) -> tuple[Stage, ...]:
    rng = np.random.default_rng(seed)
    centres = far_apart(rng, CLUSTERS[-1])
    first = [orthonormal(rng, int(d)) for d in rng.integers(1, D, size=CLUSTERS[0])]
    second = [complement(basis) for basis in first]
    third = [*second, *(orthonormal(rng, int(d)) for d in rng.integers(1, D, size=2))]
    made, cluster, left = [], 0, int(rng.integers(MIN_DURATION, MAX_DURATION + 1))
    for bases in (first, second, third):
        labels, cluster, left = sample_cycle(rng, len(bases), cluster, left)
        x = np.stack([sample_segment(rng, centres[k], bases[k]) for k in labels])
        made.append(Stage(x, labels, centres[: len(bases)], tuple(bases)))
    return tuple(made)


def far_apart(rng: np.random.Generator, count: int) -> np.ndarray:
    """Centres in [-5, 5]^D, each at least 4 sqrt(D) from the others; begun anew when no more fit in."""
    while True:
        centres: list[np.ndarray] = []
        for candidate in rng.uniform(-MAX_COORDINATE, MAX_COORDINATE, size=(20_000, D)):
            if all(np.linalg.norm(candidate - other) >= MIN_SEPARATION * np.sqrt(D) for other in centres):
                centres.append(candidate)
            if len(centres) == count:
                return np.stack(centres)


def orthonormal(rng: np.random.Generator, d: int) -> np.ndarray:
    return np.linalg.qr(rng.normal(size=(D, d)))[0]


def complement(basis: np.ndarray) -> np.ndarray:
    """The other D - d directions."""
    return np.linalg.svd(basis)[0][:, basis.shape[1] :]


def sample_cycle(
    rng: np.random.Generator, count: int, cluster: int, left: int
) -> tuple[np.ndarray, int, int]:
    """The clusters of one stage's datapoints; which is visited at its end, and how long that goes on."""
    labels = []
    for _ in range(LENGTH):
        if left == 0:
            cluster, left = (cluster + 1) % count, int(rng.integers(MIN_DURATION, MAX_DURATION + 1))
        labels.append(cluster)
        left -= 1
    return np.array(labels), cluster, left


def sample_segment(rng: np.random.Generator, centre: np.ndarray, basis: np.ndarray) -> np.ndarray:
    return centre + basis @ rng.normal(size=basis.shape[1]) + DEVIATION * rng.normal(size=D)


# --------------------------------------------------------------------------------------------------- learning


def settings(way: str) -> SOSC:
    return SOSC(
        cluster=3.6,
        dimension=0.35,
        noise=0.15,
        bandwidth=50.0,
        transition=0.025,
        new_transition=0.025,
        maintenance=UPKEEPS[way],
    )


def empty_model(way: str) -> OnlineModel:
    return online_model(settings(way), position_layout(D, "1"), PERIOD)


@cache
def stage_results(way: str, seed: int) -> tuple[StageResult, ...]:
    model, made = empty_model(way), []
    for stage in stages(seed):
        begin = time.process_time()
        model, assignments = observe_stream(model, stage.x)
        made.append(StageResult(stage, model, assignments.current_cluster_ids(), time.process_time() - begin))
    return tuple(made)


def models_by_step(way: str, seed: int, step: int) -> list[OnlineModel]:
    """The model after every so many datapoints."""
    model, models = empty_model(way), []
    for stage in stages(seed):
        for start in range(0, LENGTH, step):
            model, _ = observe_stream(model, stage.x[start : start + step])
            models.append(model)
    return models


def nearest_cluster(stage_result: StageResult) -> list[int]:
    """The place among the model's clusters of the one that is nearest to each true centre."""
    apart = stage_result.model.means[None, :, 0] - stage_result.stage.centres[:, None]
    return [int(k) for k in np.linalg.norm(apart, axis=2).argmin(axis=1)]


def judged(stage_result: StageResult) -> dict[str, object]:
    """What the model has of the truth after a stage."""
    true, places = stage_result.stage.dimensions, nearest_cluster(stage_result)
    clusters = stage_result.model.clusters
    found = [int(stage_result.model.dimensions[k, 0]) for k in places]
    right = clusters == len(true) and len(set(places)) == len(true)
    chain = to_skill(stage_result.model).dynamics
    assert isinstance(chain, SemiMarkovChain)
    joined = state_segments(stage_result.cluster_ids)[1][
        1:-1
    ]  # the first and the last are cut off by the stage's ends
    off = chain.transitions[np.ix_(places, places)] - np.roll(np.eye(len(true)), 1, axis=1)
    return {
        "clusters": clusters,
        "dimensions": found,
        "true dimensions": true,
        "clusters right": right,
        "all right": right and found == true,
        "information": normalised_mutual_information(stage_result.cluster_ids, stage_result.stage.labels),
        "transition error": float(np.abs(off).sum(axis=1).mean() / 2),
        "transition error without the fourth": float(
            np.abs(np.delete(off, 3, axis=0)).sum(axis=1).mean() / 2
        ),
        "duration [steps]": float(chain.durations.means[places].mean()),
        "deviation of durations [steps]": float(
            np.sqrt(np.mean(np.square(chain.durations.deviations[places])))
        ),
        "duration, joined [steps]": float(joined.mean()),
        "deviation of durations, joined [steps]": float(joined.std()),
        "seconds": stage_result.seconds,
    }


def measured(way: str, seeds: int) -> list[dict[str, object]]:
    """A row for each stage: means over the seeds, and how the seeds that went wrong did."""
    rows: list[dict[str, object]] = []
    for n in range(len(CLUSTERS)):
        found = [judged(stage_results(way, seed)[n]) for seed in range(seeds)]
        row: dict[str, object] = {"way": way, "stage": n + 1, "true clusters": CLUSTERS[n]}
        for name, value in found[0].items():
            if isinstance(value, bool):
                row[name] = sum(bool(one[name]) for one in found)
            elif isinstance(value, float):
                row[name] = float(np.mean([float(str(one[name])) for one in found]))
        row["least information"] = min(float(str(one["information"])) for one in found)
        row["wrong"] = [{"seed": s} | one for s, one in enumerate(found) if not one["all right"]]
        rows.append(row)
    return rows


def print_table(rows: Sequence[dict[str, object]], seeds: int) -> None:
    print(f"{seeds} streams; K and d: how many have all right after the stage; means of the others")
    print(
        "way         stage  true K       K   K and d    NMI (least)   transitions  without 4th"
        "      duration        joined    CPU s"
    )
    for row in rows:
        print(
            f"{row['way']:<12}{row['stage']:>5}{row['true clusters']:>8}{row['clusters right']:>8}"
            f"{row['all right']:>10}{row['information']:>10.4f} {row['least information']:.3f}"
            f"{row['transition error']:>14.3f}{row['transition error without the fourth']:>13.3f}"
            f"{row['duration [steps]']:>8.1f} ± {row['deviation of durations [steps]']:<4.1f}"
            f"{row['duration, joined [steps]']:>7.1f} ± {row['deviation of durations, joined [steps]']:<4.1f}"
            f"{row['seconds']:>8.4f}"
        )
    print(f"truth{MEAN_DURATION:>87.1f} ± {DEVIATION_OF_DURATIONS:.1f}")
    for row in rows:
        wrong = row["wrong"]
        assert isinstance(wrong, list)
        for one in wrong[:SHOWN]:
            print(
                f"  {row['way']}, stage {row['stage']}, seed {one['seed']}: K = {one['clusters']}, "
                f"d = {one['dimensions']} of {one['true dimensions']}"
            )
        if len(wrong) > SHOWN:
            print(f"  {row['way']}, stage {row['stage']}: and {len(wrong) - SHOWN} more")
    for note in NOTES:
        print(f"note: {note}")


# --------------------------------------------------------------------------------------------------- pictures


def pictures(seed: int) -> dict[str, Figure]:
    last = stage_results("thesis", seed)[-1]
    skill = to_skill(last.model)
    here = pf.adapt(skill, [pf.Frame("world", np.eye(D), np.zeros(D))])
    observed = log_state_likelihoods(here, stages(seed)[0].x[:1])
    return {
        "figure-5.5-clusters": draw_stages(seed),
        "figure-5.6-growth": draw_growth(seed),
        "figure-5.7-model": draw_model(last),
        "figure-5.7-graph": plots.state_graph(skill),
        "figure-5.7-forward-variable": plots.forward_variable(skill, horizon=480, log_observed=observed),
    }


def draw_stages(seed: int) -> Figure:
    """Above the data as they were made, below the model after each stage."""
    figure = Figure(figsize=(11, 7.2), layout="constrained")
    for n, stage_result in enumerate(stage_results("thesis", seed)):
        above, below = (figure.add_subplot(2, 3, n + 1 + 3 * row, projection="3d") for row in range(2))
        true = stage_result.stage
        for k in range(len(true.bases)):
            own = true.x[true.labels == k]
            above.scatter(*own.T, s=3.5, color=plots.state_colour(k), alpha=0.5, linewidths=0)
        above.set_title(
            f"stage {n + 1}, made: K = {len(true.bases)}, d = {format_dimensions(true.dimensions)}",
            fontsize=10,
            y=0.95,
        )
        places = nearest_cluster(stage_result)
        d = [int(stage_result.model.dimensions[k, 0]) for k in places]
        stands_for = match_labels(stage_result.cluster_ids, true.labels)
        for cluster_id in np.unique(stage_result.cluster_ids):
            own = true.x[stage_result.cluster_ids == cluster_id]
            colour = plots.state_colour(stands_for[cluster_id]) if cluster_id in stands_for else "0.5"
            below.scatter(*own[::2].T, s=3.5, color=colour, alpha=0.6, linewidths=0)
        draw_model_in_space(below, stage_result.model, stage_result.stage.centres)
        below.set_title(
            f"learned: K = {stage_result.model.clusters}, d = {format_dimensions(d)}", fontsize=10, y=0.95
        )
        for axes in (above, below):
            style_axes(axes)
    return figure


def draw_model_in_space(axes, model: OnlineModel, centres: np.ndarray) -> None:  # type: ignore[no-untyped-def]  # 3-D axes are untyped in matplotlib
    """The ellipsoid of every cluster at two deviation, in the colour of the true one that is nearest."""
    around, along = np.meshgrid(np.linspace(0, 2 * np.pi, 25), np.linspace(0, np.pi, 13))
    ball = np.stack([np.cos(around) * np.sin(along), np.sin(around) * np.sin(along), np.cos(along)], axis=-1)
    skill = to_skill(model)
    for mean, covariance in zip(skill.means[0], skill.covariances[0].dense, strict=True):
        values, vectors = np.linalg.eigh(covariance)
        surface = mean + 2.0 * (ball * np.sqrt(values)) @ vectors.T
        apart = np.linalg.norm(centres - mean, axis=1)
        colour = plots.state_colour(int(apart.argmin())) if apart.min() < 2.0 else "0.4"
        axes.plot_surface(*np.moveaxis(surface, -1, 0), color=colour, alpha=0.3, linewidth=0)


def style_axes(axes) -> None:  # type: ignore[no-untyped-def]
    axes.set(xlim=(-7, 7), ylim=(-7, 7), zlim=(-7, 7), xlabel="x [1]", ylabel="y [1]", zlabel="z [1]")
    axes.set_box_aspect(None, zoom=0.78)  # leaves room for the label of z
    axes.tick_params(labelsize=8, pad=0)


def format_dimensions(dimensions: Sequence[int]) -> str:
    return "{" + ", ".join(map(str, dimensions)) + "}"


def draw_growth(seed: int) -> Figure:
    """K and d as they grow, the truth dotted, with a line where a stage ends."""
    figure = plots.online_clusters(models_by_step("thesis", seed, 10))
    clusters = figure.axes[0]
    ends = LENGTH * np.arange(len(CLUSTERS) + 1)
    clusters.step(ends, [*CLUSTERS, CLUSTERS[-1]], where="post", color="0.4", linestyle=":", linewidth=1.4)
    for n, stage in enumerate(stages(seed)):
        middle = (ends[n] + ends[n + 1]) / 2
        clusters.text(middle, 1.3, f"stage {n + 1}: K = {CLUSTERS[n]}", ha="center", fontsize=9)
        figure.axes[1].text(
            middle, 2.55, f"true d = {format_dimensions(stage.dimensions)}", ha="center", fontsize=9
        )
    for axes in figure.axes:
        for end in ends[1:-1]:
            axes.axvline(end, color="0.6", linestyle="--", linewidth=1.0)
        axes.set_xlim(0, ends[-1])
    figure.axes[1].set_ylim(-0.3, 2.9)
    return figure


def draw_model(stage_result: StageResult) -> Figure:
    """The transition matrix and the durations, in the order of the true clusters."""
    chain = to_skill(stage_result.model).dynamics
    assert isinstance(chain, SemiMarkovChain)
    places = nearest_cluster(stage_result)
    transitions = chain.transitions[np.ix_(places, places)]
    figure = Figure(figsize=(10, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1.0, 1.5))
    left.imshow(transitions, cmap="Greys", vmin=0, vmax=1)
    for (i, j), p in np.ndenumerate(transitions):
        if p >= 0.005:
            left.text(j, i, f"{p:.2f}", ha="center", va="center", color="white" if p > 0.5 else "black")
    left.set(xlabel="to state", ylabel="from state", title="transitions [probability]")
    left.set_xticks(range(len(places)))
    left.set_yticks(range(len(places)))
    steps = np.arange(1, 151)
    for k, place in enumerate(places):
        distribution = pf.durations.Gaussian(
            chain.durations.means[[place]], chain.durations.deviations[[place]]
        )
        density = np.exp(distribution.log_table(len(steps)))[:, 0]
        label = f"state {k}: {distribution.means[0]:.0f} ± {distribution.deviations[0]:.0f}"
        right.plot(steps, density, color=plots.state_colour(k), linewidth=1.8, label=label)
    uniform = np.where(
        (steps >= MIN_DURATION) & (steps <= MAX_DURATION), 1 / (MAX_DURATION - MIN_DURATION + 1), 0.0
    )
    right.step(steps, uniform, where="mid", color="0.4", linestyle=":", label="true, all states")
    right.set(
        xlabel="duration [steps]", ylabel="probability", title="durations", xlim=(0, 150), ylim=(0, None)
    )
    right.legend(frameon=False, fontsize=9)
    right.grid(alpha=0.3)
    return figure


def animate(seed: int, file: Path) -> None:
    """The last 200 datapoints and the model at every hundredth; below, how many clusters there are."""
    step, memory = 100, 200
    models = models_by_step("thesis", seed, step)
    x = np.vstack([stage.x for stage in stages(seed)])
    labels = np.concatenate([stage.labels for stage in stages(seed)])
    colours = np.array([plots.state_colour(k) for k in range(CLUSTERS[-1])])
    figure = Figure(figsize=(5.6, 5.4))
    axes: Any = figure.add_axes((0.02, 0.06, 0.92, 0.84), projection="3d")

    def draw(m: int) -> list[Any]:
        axes.clear()
        seen = slice(max(0, (m + 1) * step - memory), (m + 1) * step)
        axes.scatter(*x[seen].T, s=5, color=colours[labels[seen]], linewidths=0)
        draw_model_in_space(axes, models[m], stages(seed)[-1].centres)
        style_axes(axes)
        n = min(m * step // LENGTH, len(CLUSTERS) - 1)
        d = format_dimensions(models[m].dimensions[:, 0].tolist())
        axes.set_title(
            f"stage {n + 1}, {seen.stop} datapoints: K = {models[m].clusters}, d = {d}", fontsize=10
        )
        return []

    animation = FuncAnimation(figure, draw, frames=len(models), blit=False)
    animation.save(file, writer=PillowWriter(fps=8), dpi=70)


if __name__ == "__main__":
    main()
