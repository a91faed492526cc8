"""Streams in many dimensions: figure 5.8 of the thesis.

    python reproductions/online_dimensions.py --json dimensions.json --out dimensions/

The first stage of online_stages.py, four clusters in a cycle, in D = 10 to 75 dimensions and for streams of
1000 to 7500 datapoints, ten of each. As in the thesis, dimensions of subspaces are uniform on 1 to D - 1. The
standard deviation is 1 along each basis vector, and the noise .04 I. Weights are numbers of datapoints.

The thesis chooses lambda for every experiment and gives no values. Here one rule serves all. Squared
distances of datapoints to the centre of their cluster are about d, less than D. Those between centres are at
least 16 D. So lambda = 6 D lies between, and b_m = 5 D lets the influence of subspaces decay between
clusters, not within them. lambda_1 = .2 is the geometric mean of the variances along a subspace (1.04) and
outside it (.04). Subspaces store 5 extra directions: with 1, as in the thesis, they miss some of dozens of
dimensions. The last table says how many, also with lambda_1 = .35 of the stages.

Silhouettes are those of the learned labels over all datapoints, with Euclidean distances (footnote 6).
Seconds are CPU time of the stream alone.

Source: Tanwani 2018, section 5.7.1.2.
"""

import argparse
import json
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import pilotfish as pf  # noqa: F401 - first, so that its warning about kernels appears once
from pilotfish.demonstrations import position_layout
from pilotfish.models import normalised_mutual_information
from pilotfish.models.online import (
    SOSC,
    Maintenance,
    OnlineModel,
    observe_stream,
    online_model,
)

CLUSTERS, DIMENSIONS, LENGTHS, REPEATS = 4, (10, 25, 50, 75), (1000, 2500, 5000, 7500), 10
MAX_COORDINATE, MIN_SEPARATION, MIN_DURATION, MAX_DURATION, DEVIATION = 5.0, 4.0, 70, 90, 0.2
LAMBDA, BANDWIDTH, LAMBDA_1, EXTRA_DIRECTIONS, EXTRA_DIRECTION_CHOICES = 6.0, 5.0, 0.2, 5, (1, 2, 5, 10, 75)
STAGES_LAMBDA_1 = 0.35  # of section 5.7.1.1
BLOCK = 500  # rows of distances at a time
PANELS = (
    ("silhouette", "silhouette score [1]"),
    ("information", "normalised mutual information [1]"),
    ("seconds", "CPU time of the stream [s]"),
    ("distance of means", "distance of means to the truth [1]"),
    ("clusters", "clusters K [1]"),
    ("dimension", "mean dimension of subspaces [1]"),
)
CONSTANTS = {"information": 1.0, "clusters": float(CLUSTERS)}
COLOURS = dict(zip(DIMENSIONS, ("#004488", "#44AA99", "#DDAA33", "#BB5566"), strict=True))
NOTES = (
    "the thesis says that silhouettes and information are high; its figure gives no numbers",
    "its times are of another machine and language and are not compared",
)


@dataclass(frozen=True, slots=True, eq=False)
class Stream:
    """Datapoints, the cluster of each, and the true centres and dimensions."""

    x: np.ndarray
    labels: np.ndarray
    centres: np.ndarray
    dimensions: np.ndarray


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", type=Path, help="file for the numbers")
    parser.add_argument("--out", type=Path, help="folder for the picture")
    parser.add_argument("--repeats", type=int, default=REPEATS, help="number of streams for each size")
    parser.add_argument("--dimensions", type=int, nargs="+", default=DIMENSIONS)
    parser.add_argument("--lengths", type=int, nargs="+", default=LENGTHS)
    arguments = parser.parse_args()
    rows = []
    for D in arguments.dimensions:
        for T in arguments.lengths:
            rows.append(row(D, T, arguments.repeats))
            print_row(rows[-1], first=len(rows) == 1)
    extra_rows = [
        compare_extra_directions(max(arguments.dimensions), extra_directions, arguments.repeats)
        for extra_directions in EXTRA_DIRECTION_CHOICES
    ]
    print_extra_directions(extra_rows)
    for note in NOTES:
        print(f"note: {note}")
    if arguments.out:
        arguments.out.mkdir(parents=True, exist_ok=True)
        picture(rows).savefig(arguments.out / "figure-5.8-dimensions.png", dpi=110)
        print(f"the picture is in {arguments.out}")
    if arguments.json:
        arguments.json.parent.mkdir(parents=True, exist_ok=True)
        arguments.json.write_text(
            json.dumps({"rows": rows, "extra directions": extra_rows, "notes": NOTES}, indent=2) + "\n"
        )


def sample_stream(D: int, T: int, seed: int) -> Stream:
    """Sample a stream of T datapoints in D columns."""
    rng = np.random.default_rng((seed, D))
    centres = sample_separated_centres(rng, D)
    dimensions = rng.integers(1, D, size=CLUSTERS)
    bases = [np.linalg.qr(rng.normal(size=(D, int(d))))[0] for d in dimensions]
    durations = rng.integers(MIN_DURATION, MAX_DURATION + 1, size=T // MIN_DURATION + 1)
    labels = np.repeat(np.arange(len(durations)) % CLUSTERS, durations)[:T]
    x = centres[labels] + DEVIATION * rng.normal(size=(T, D))
    for k, basis in enumerate(bases):
        own = labels == k
        x[own] += rng.normal(size=(int(own.sum()), basis.shape[1])) @ basis.T
    return Stream(x, labels, centres, dimensions)


def sample_separated_centres(rng: np.random.Generator, D: int) -> np.ndarray:
    """Sample centres in [-5, 5]^D with distances of at least 4 sqrt(D)."""
    centres: list[np.ndarray] = []
    tries = 0
    while len(centres) < CLUSTERS:
        candidate = rng.uniform(-MAX_COORDINATE, MAX_COORDINATE, size=D)
        if all(np.linalg.norm(candidate - centre) >= MIN_SEPARATION * np.sqrt(D) for centre in centres):
            centres.append(candidate)
        tries += 1
        if tries % 10_000 == 0:
            centres = []
    return np.stack(centres)


def settings(D: int, extra_directions: int = EXTRA_DIRECTIONS, penalty: float = LAMBDA_1) -> SOSC:
    """Return the penalties for D columns."""
    return SOSC(
        cluster=LAMBDA * D,
        dimension=penalty,
        noise=DEVIATION**2,
        bandwidth=BANDWIDTH * D,
        transition=0.025,
        new_transition=0.025,
        maintenance=Maintenance(extra_directions=extra_directions),
    )


def learn_stream(stream_data: Stream, sosc_settings: SOSC) -> tuple[OnlineModel, np.ndarray, float]:
    """Return the model of a stream, the cluster of every datapoint, and CPU time [s]."""
    model = online_model(sosc_settings, position_layout(stream_data.x.shape[1], "1"), 1.0)
    begin = time.process_time()
    model, assignments = observe_stream(model, stream_data.x)
    return model, assignments.current_cluster_ids(), time.process_time() - begin


def row(D: int, T: int, repeats: int) -> dict[str, float]:
    """Return means and deviations over the repeats."""
    results = [evaluate_model(sample_stream(D, T, seed), settings(D)) for seed in range(repeats)]
    numbers: dict[str, float] = {"D": D, "T": T}
    for name in results[0]:
        values = [result[name] for result in results]
        numbers[name] = float(np.mean(values))
        numbers[f"{name}, deviation"] = float(np.std(values))
    return numbers


def evaluate_model(stream_data: Stream, sosc_settings: SOSC) -> dict[str, float]:
    """Compare the model of a stream with the truth."""
    model, labels, seconds = learn_stream(stream_data, sosc_settings)
    distances = np.linalg.norm(model.means[None, :, 0] - stream_data.centres[:, None], axis=2)
    nearest = distances.argmin(axis=1)
    return {
        "silhouette": silhouette(stream_data.x, labels),
        "silhouette of the truth": silhouette(stream_data.x, stream_data.labels),
        "information": normalised_mutual_information(labels, stream_data.labels),
        "seconds": seconds,
        "distance of means": float(distances.min(axis=1).mean()),
        "expected distance": expected_distance(stream_data),
        "clusters": float(model.clusters),
        "dimension": float(model.dimensions[:, 0].mean()),
        "true dimension": float(stream_data.dimensions.mean()),
        "dimensions missing": float(np.mean(stream_data.dimensions - model.dimensions[nearest, 0])),
        "dimensions right": float(np.mean(stream_data.dimensions == model.dimensions[nearest, 0])),
    }


def expected_distance(stream_data: Stream) -> float:
    """Return the expected distance between the centre of a cluster and the mean of its datapoints."""
    counts = np.bincount(stream_data.labels, minlength=CLUSTERS)
    return float(np.mean(np.sqrt((stream_data.dimensions + stream_data.x.shape[1] * DEVIATION**2) / counts)))


def silhouette(x: np.ndarray, labels: np.ndarray) -> float:
    """Return the mean silhouette score; a datapoint alone in its cluster, or a single cluster, has 0.

    Source: Rousseeuw 1987.
    """
    names, own, counts = np.unique(labels, return_inverse=True, return_counts=True)
    if len(names) == 1:
        return 0.0
    member = np.zeros((len(x), len(names)))
    member[np.arange(len(x)), own] = 1.0
    squares = np.sum(x**2, axis=1)
    scores = np.empty(len(x))
    for start in range(0, len(x), BLOCK):
        block = slice(start, start + BLOCK)
        distances = squares[block, None] + squares - 2.0 * x[block] @ x.T
        rows = np.arange(len(distances))
        distances[rows, start + rows] = 0.0
        sums = np.sqrt(np.maximum(distances, 0.0)) @ member
        inside = sums[rows, own[block]] / np.maximum(counts[own[block]] - 1, 1)
        means = sums / counts
        means[rows, own[block]] = np.inf
        outside = means.min(axis=1)
        score = (outside - inside) / np.maximum(inside, outside)
        scores[block] = np.where(counts[own[block]] > 1, score, 0.0)
    return float(scores.mean())


def compare_extra_directions(D: int, extra_directions: int, repeats: int) -> dict[str, float]:
    """Return missing dimensions and CPU time for the shortest and longest stream and two lambda_1."""
    numbers: dict[str, float] = {"extra_directions": extra_directions}
    for T in (LENGTHS[0], LENGTHS[-1]):
        for penalty in (LAMBDA_1, STAGES_LAMBDA_1):
            missing, seconds = [], []
            for seed in range(repeats):
                stream_data = sample_stream(D, T, seed)
                model, _, spent = learn_stream(stream_data, settings(D, extra_directions, penalty))
                distances = np.linalg.norm(model.means[None, :, 0] - stream_data.centres[:, None], axis=2)
                nearest = distances.argmin(axis=1)
                missing.append(np.mean(stream_data.dimensions - model.dimensions[nearest, 0]))
                seconds.append(spent)
            numbers[f"missing, T = {T}, lambda_1 = {penalty:g}"] = float(np.mean(missing))
            numbers[f"seconds, T = {T}, lambda_1 = {penalty:g}"] = float(np.mean(seconds))
    return numbers


def print_row(numbers: dict[str, float], *, first: bool) -> None:
    if first:
        print(f"{CLUSTERS} clusters; means over the repeats (in brackets: true labels, expectation, truth)")
        print("   D     T   silhouette        NMI    CPU s   distance of means    K   dimension    d correct")
    print(
        f"{numbers['D']:>4.0f}{numbers['T']:>6.0f}{numbers['silhouette']:>8.3f} "
        f"({numbers['silhouette of the truth']:.3f}){numbers['information']:>8.4f}{numbers['seconds']:>9.4f}"
        f"{numbers['distance of means']:>8.3f} ({numbers['expected distance']:.3f})"
        f"{numbers['clusters']:>6.1f}{numbers['dimension']:>8.1f} "
        f"({numbers['true dimension']:.1f}){numbers['dimensions right']:>9.2f}"
    )


def print_extra_directions(rows: Sequence[dict[str, float]]) -> None:
    print("extra directions: missing dimensions of each subspace, and CPU seconds, at the largest D")
    names = [name.removeprefix("missing, ") for name in rows[0] if name.startswith("missing")]
    print("extra  " + "".join(f"{name:>28}" for name in names))
    for one in rows:
        cells = "".join(f"{one[f'missing, {n}']:>18.2f} ({one[f'seconds, {n}']:.3f} s)" for n in names)
        print(f"{one['extra_directions']:>5.0f}  {cells}")


def picture(rows: Sequence[dict[str, float]]) -> Figure:
    figure = Figure(figsize=(12, 6.6), layout="constrained")
    panels = figure.subplots(2, 3).ravel()
    references = {
        "silhouette": "silhouette of the truth",
        "distance of means": "expected distance",
        "dimension": "true dimension",
    }
    for axes, (name, title) in zip(panels, PANELS, strict=True):
        for D in dict.fromkeys(one["D"] for one in rows):
            own = [one for one in rows if one["D"] == D]
            T, colour = [one["T"] for one in own], COLOURS.get(int(D), "black")
            values = [one[name] for one in own]
            deviations = [one[f"{name}, deviation"] for one in own]
            axes.errorbar(T, values, deviations, fmt="o-", color=colour, capsize=3, label=f"D = {D:.0f}")
            if name in references:
                axes.plot(T, [one[references[name]] for one in own], ":", color="black", zorder=5)
        if name in CONSTANTS:
            axes.axhline(CONSTANTS[name], linestyle=":", color="black")
        axes.set(xlabel="datapoints T [1]", title=title, xticks=sorted({one["T"] for one in rows}))
        axes.title.set_fontsize(10)
        axes.grid(alpha=0.3)
    panels[0].set_ylim(0, 1)
    panels[1].set_ylim(0, 1.05)
    panels[3].set_ylim(0, None)
    panels[4].set_ylim(0, 6)
    panels[5].set_ylim(0, None)
    panels[2].set_ylim(0, None)
    handles, names = panels[0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=len(names), frameon=False)
    return figure


if __name__ == "__main__":
    main()
