"""A stream that changes twice: figures 5.5 to 5.7 of the thesis.

    python reproductions/online_stages.py --json stages.json --out stages/

One SOSC model observes three stages of 2500 datapoints in three dimensions, with the penalties of the thesis.
stage_stream.py samples the stream and learns it.

The table compares three kinds of maintenance. "thesis": as printed, clusters with means closer than lambda =
3.6 are merged, although lambda is otherwise compared with squared distances. "separate": they are merged
below the square root of lambda, 1.9. "forgetting": as before, and clusters with weights below .3 are removed.

Source: Tanwani 2018, section 5.7.1.1.
"""

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.figure import Figure
from stage_stream import (
    CLUSTERS,
    DEVIATION_OF_DURATIONS,
    LENGTH,
    MAINTENANCES,
    MAX_DURATION,
    MEAN_DURATION,
    MIN_DURATION,
    D,
    StageResult,
    models_by_step,
    nearest_cluster,
    stage_results,
    stages,
)

import pilotfish as pf
from pilotfish import plots
from pilotfish.models import (
    SemiMarkovChain,
    match_labels,
    normalised_mutual_information,
    state_segments,
)
from pilotfish.models.online import OnlineModel, to_skill

SEEDS, MAX_EXAMPLES = 20, 2
NOTES = (
    "exponential decay applies to subspaces, not to transitions or durations: the transition from the fourth",
    "cluster to the first, before the third stage, remains in the transition matrix, hence that error",
    "a datapoint that starts a cluster cuts the current segment; it is restored when the two clusters",
    "merge while the stream is in one of them and came from the other; where clusters merge later, segments",
    "stay cut: durations are short and vary. Joined: along the clusters at the end of a stage",
    "the thesis shows one run without numbers, and says that K and d are found in every stage",
)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", type=Path, help="file for the numbers")
    parser.add_argument("--out", type=Path, help="folder for the pictures and the animation")
    parser.add_argument("--seeds", type=int, default=SEEDS, help="streams for each maintenance")
    arguments = parser.parse_args()
    rows = [row for variant in MAINTENANCES for row in summarise_stages(variant, arguments.seeds)]
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


# --------------------------------------------------------------------------------------------------- results


def evaluate_stage(stage_result: StageResult) -> dict[str, object]:
    """Compare the model after a stage with the truth."""
    true, indices = stage_result.stage.dimensions, nearest_cluster(stage_result)
    clusters = stage_result.model.clusters
    learned = [int(stage_result.model.dimensions[k, 0]) for k in indices]
    right = clusters == len(true) and len(set(indices)) == len(true)
    chain = to_skill(stage_result.model).dynamics
    assert isinstance(chain, SemiMarkovChain)
    joined = state_segments(stage_result.cluster_ids)[1][1:-1]  # without the segments that the stage cuts
    errors = chain.transitions[np.ix_(indices, indices)] - np.roll(np.eye(len(true)), 1, axis=1)
    return {
        "clusters": clusters,
        "dimensions": learned,
        "true dimensions": true,
        "clusters right": right,
        "all right": right and learned == true,
        "information": normalised_mutual_information(stage_result.cluster_ids, stage_result.stage.labels),
        "transition error": float(np.abs(errors).sum(axis=1).mean() / 2),
        "transition error without the fourth": float(
            np.abs(np.delete(errors, 3, axis=0)).sum(axis=1).mean() / 2
        ),
        "duration [steps]": float(chain.durations.means[indices].mean()),
        "deviation of durations [steps]": float(
            np.sqrt(np.mean(np.square(chain.durations.deviations[indices])))
        ),
        "duration, joined [steps]": float(joined.mean()),
        "deviation of durations, joined [steps]": float(joined.std()),
        "seconds": stage_result.seconds,
    }


def summarise_stages(variant: str, seeds: int) -> list[dict[str, object]]:
    """Return a row per stage: means over the seeds, and the results of the seeds that are wrong."""
    rows: list[dict[str, object]] = []
    for n in range(len(CLUSTERS)):
        results = [evaluate_stage(stage_results(variant, seed)[n]) for seed in range(seeds)]
        row: dict[str, object] = {"maintenance": variant, "stage": n + 1, "true clusters": CLUSTERS[n]}
        for name, value in results[0].items():
            if isinstance(value, bool):
                row[name] = sum(bool(result[name]) for result in results)
            elif isinstance(value, float):
                row[name] = float(np.mean([float(str(result[name])) for result in results]))
        row["least information"] = min(float(str(result["information"])) for result in results)
        row["wrong"] = [{"seed": s} | r for s, r in enumerate(results) if not r["all right"]]
        rows.append(row)
    return rows


def print_table(rows: Sequence[dict[str, object]], seeds: int) -> None:
    print(f"{seeds} streams; K, and K and d: number of streams in which they are correct; means otherwise")
    print(
        "maintenance stage  true K       K   K and d    NMI (least)   transitions  without 4th"
        "      duration        joined    CPU s"
    )
    for row in rows:
        print(
            f"{row['maintenance']:<12}{row['stage']:>5}{row['true clusters']:>8}{row['clusters right']:>8}"
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
        for result in wrong[:MAX_EXAMPLES]:
            print(
                f"  {row['maintenance']}, stage {row['stage']}, seed {result['seed']}: "
                f"K = {result['clusters']}, d = {result['dimensions']} of {result['true dimensions']}"
            )
        if len(wrong) > MAX_EXAMPLES:
            print(f"  {row['maintenance']}, stage {row['stage']}: and {len(wrong) - MAX_EXAMPLES} more")
    for note in NOTES:
        print(f"note: {note}")


# --------------------------------------------------------------------------------------------------- pictures


def pictures(seed: int) -> dict[str, Figure]:
    last = stage_results("thesis", seed)[-1]
    skill = to_skill(last.model)
    adapted = pf.adapt(skill, [pf.Frame("world", np.eye(D), np.zeros(D))])
    observed = adapted.log_state_likelihoods(stages(seed)[0].x[:1])
    return {
        "figure-5.5-clusters": draw_stages(seed),
        "figure-5.6-growth": draw_growth(seed),
        "figure-5.7-model": draw_model(last),
        "figure-5.7-graph": plots.state_graph(skill),
        "figure-5.7-forward-variable": plots.forward_variable(skill, horizon=480, log_observed=observed),
    }


def draw_stages(seed: int) -> Figure:
    """Draw the data of each stage above, and the model after it below."""
    figure = Figure(figsize=(11, 7.2), layout="constrained")
    for n, stage_result in enumerate(stage_results("thesis", seed)):
        above, below = (figure.add_subplot(2, 3, n + 1 + 3 * row, projection="3d") for row in range(2))
        true = stage_result.stage
        for k in range(len(true.bases)):
            own = true.x[true.labels == k]
            above.scatter(*own.T, s=3.5, color=plots.state_colour(k), alpha=0.5, linewidths=0)
        above.set_title(
            f"stage {n + 1}, true: K = {len(true.bases)}, d = {format_dimensions(true.dimensions)}",
            fontsize=10,
            y=0.95,
        )
        indices = nearest_cluster(stage_result)
        d = [int(stage_result.model.dimensions[k, 0]) for k in indices]
        matching = match_labels(stage_result.cluster_ids, true.labels)
        for cluster_id in np.unique(stage_result.cluster_ids):
            own = true.x[stage_result.cluster_ids == cluster_id]
            colour = plots.state_colour(matching[cluster_id]) if cluster_id in matching else "0.5"
            below.scatter(*own[::2].T, s=3.5, color=colour, alpha=0.6, linewidths=0)
        draw_model_in_space(below, stage_result.model, stage_result.stage.centres)
        below.set_title(
            f"learned: K = {stage_result.model.clusters}, d = {format_dimensions(d)}", fontsize=10, y=0.95
        )
        for axes in (above, below):
            style_axes(axes)
    return figure


def draw_model_in_space(axes, model: OnlineModel, centres: np.ndarray) -> None:  # type: ignore[no-untyped-def]  # 3-D axes are untyped in matplotlib
    """Draw the ellipsoid of every cluster at two standard deviations, in the colour of the nearest truth."""
    around, along = np.meshgrid(np.linspace(0, 2 * np.pi, 25), np.linspace(0, np.pi, 13))
    ball = np.stack([np.cos(around) * np.sin(along), np.sin(around) * np.sin(along), np.cos(along)], axis=-1)
    skill = to_skill(model)
    for mean, covariance in zip(skill.means[0], skill.covariances[0].dense, strict=True):
        values, vectors = np.linalg.eigh(covariance)
        surface = mean + 2.0 * (ball * np.sqrt(values)) @ vectors.T
        distances = np.linalg.norm(centres - mean, axis=1)
        colour = plots.state_colour(int(distances.argmin())) if distances.min() < 2.0 else "0.4"
        axes.plot_surface(*np.moveaxis(surface, -1, 0), color=colour, alpha=0.3, linewidth=0)


def style_axes(axes) -> None:  # type: ignore[no-untyped-def]
    """Set limits and labels of 3-D axes."""
    axes.set(xlim=(-7, 7), ylim=(-7, 7), zlim=(-7, 7), xlabel="x [1]", ylabel="y [1]", zlabel="z [1]")
    axes.set_box_aspect(None, zoom=0.78)  # leaves space for the label of z
    axes.tick_params(labelsize=8, pad=0)


def format_dimensions(dimensions: Sequence[int]) -> str:
    return "{" + ", ".join(map(str, dimensions)) + "}"


def draw_growth(seed: int) -> Figure:
    """Draw K and d over time, with the truth dotted and a line at the end of each stage."""
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
    """Draw the transition matrix and the durations, in the order of the true clusters."""
    chain = to_skill(stage_result.model).dynamics
    assert isinstance(chain, SemiMarkovChain)
    indices = nearest_cluster(stage_result)
    transitions = chain.transitions[np.ix_(indices, indices)]
    figure = Figure(figsize=(10, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(1.0, 1.5))
    left.imshow(transitions, cmap="Greys", vmin=0, vmax=1)
    for (i, j), p in np.ndenumerate(transitions):
        if p >= 0.005:
            left.text(j, i, f"{p:.2f}", ha="center", va="center", color="white" if p > 0.5 else "black")
    left.set(xlabel="to state", ylabel="from state", title="transitions [probability]")
    left.set_xticks(range(len(indices)))
    left.set_yticks(range(len(indices)))
    steps = np.arange(1, 151)
    for k, index in enumerate(indices):
        distribution = pf.durations.Gaussian(
            chain.durations.means[[index]], chain.durations.deviations[[index]]
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
    """Animate the last 200 datapoints and the model, in steps of 100 datapoints."""
    step, memory = 100, 200
    models = models_by_step("thesis", seed, step)
    x = np.vstack([stage.x for stage in stages(seed)])
    labels = np.concatenate([stage.labels for stage in stages(seed)])
    colours = np.array([plots.state_colour(k) for k in range(CLUSTERS[-1])])
    figure = Figure(figsize=(5.6, 5.4))
    axes: Any = figure.add_axes((0.02, 0.06, 0.92, 0.84), projection="3d")

    def draw(m: int) -> list[Any]:
        axes.clear()
        recent = slice(max(0, (m + 1) * step - memory), (m + 1) * step)
        axes.scatter(*x[recent].T, s=5, color=colours[labels[recent]], linewidths=0)
        draw_model_in_space(axes, models[m], stages(seed)[-1].centres)
        style_axes(axes)
        n = min(m * step // LENGTH, len(CLUSTERS) - 1)
        d = format_dimensions(models[m].dimensions[:, 0].tolist())
        axes.set_title(
            f"stage {n + 1}, {recent.stop} datapoints: K = {models[m].clusters}, d = {d}", fontsize=10
        )
        return []

    animation = FuncAnimation(figure, draw, frames=len(models), blit=False)
    animation.save(file, writer=PillowWriter(fps=8), dpi=70)


if __name__ == "__main__":
    main()
