"""Measure the cost of a stream step by numbers of clusters K, columns D and subspace dimensions d.

`python benchmarks/streams_cost.py` learns a model at each size until it has converged, and measures further
steps. It prints a table of measured and predicted costs; --json and --out write figures and a plot. With
r = d + 1 directions of a subspace, the prediction is a + b K D r + c r^3 by least squares of relative errors.
A finer one, a + b K + c K D r + e D r + f r^2, separates the costs of a cluster and of an update.

Both are for the worst case: the cluster of each step is independent, and subspaces do not decay, so that no
cluster is pruned. The table also has the cost with a bandwidth of the clusters' size. Sizes at which the
model does not stay at K clusters of dimension d are listed and omitted.
"""

import argparse
import gc
import json
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from itertools import product
from pathlib import Path
from time import process_time

import numpy as np
from libraries.pilotfish_streams import empty, without_decay
from machine import machine
from make_streams import Shape, sample_stream
from problems import Floats

from pilotfish.models import online

CLUSTERS = (1, 2, 5, 10, 20, 50)
COLUMNS = (3, 7, 14, 28, 75)
DIMENSIONS = (0, 1, 2, 4, 8, 16)
SETTLING, MEMORY = 400, 3  # warm-up datapoints per cluster; cycles of a trace
TIMED, ROUNDS = 2000, 7
COARSE_TERMS = ("1", "K D r", "r^3")
FINE_TERMS = ("1", "K", "K D r", "D r", "r^2")


@dataclass(frozen=True, slots=True)
class Cost:
    """CPU time of one datapoint in the worst case, and with distant clusters [us].

    Both are NaN if the model did not stay at K and d; found then holds the values.
    """

    clusters: int
    columns: int
    dimension: int
    microseconds: float
    far: float
    found: str

    @property
    def settled(self) -> bool:
        return not np.isnan(self.microseconds)


@dataclass(frozen=True, slots=True)
class LinearModel:
    """Linear combination of named terms [us]."""

    names: tuple[str, ...]
    coefficients: tuple[float, ...]

    def at(self, cost: Cost) -> float:
        return float(terms([cost], self.names)[0] @ self.coefficients)

    @property
    def formula(self) -> str:
        pairs = zip(self.coefficients, self.names, strict=True)
        return " + ".join(f"{value:.2g} {name}".removesuffix(" 1") for value, name in pairs)


def main() -> None:
    options = arguments()
    costs = list(measure_costs(options.quick))
    settled = [cost for cost in costs if cost.settled]
    line, finer = fit_costs(settled, COARSE_TERMS), fit_costs(settled, FINE_TERMS)
    print("\n".join(table(costs, line, finer)))
    if options.json:
        lines = {"line": asdict(line), "finer": asdict(finer)}
        figures = {"machine": asdict(machine()), **lines, "costs": [_cost_to_dict(c) for c in costs]}
        options.json.write_text(json.dumps(figures, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    if options.out:
        draw(settled, line, options.out)


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--quick", action="store_true", help="a few small sizes, to test that everything works"
    )
    parser.add_argument("--json", type=Path, help="file for all figures")
    parser.add_argument("--out", type=Path, help="file for the plot, such as streams_cost.png")
    return parser.parse_args()


def measure_costs(quick: bool) -> Iterator[Cost]:
    sizes = (
        product(CLUSTERS[:2], COLUMNS[:2], DIMENSIONS[:4])
        if quick
        else product(CLUSTERS, COLUMNS, DIMENSIONS)
    )
    for K, D, d in sizes:
        if d < D:
            print(f"K = {K}, D = {D}, d = {d}", file=sys.stderr, flush=True)
            yield measure_cost(K, D, d)


def measure_cost(K: int, D: int, d: int) -> Cost:
    """Return medians over rounds that continue the same converged model with the same datapoints."""
    shape = Shape(D, K, d, d, 1.0, 4.0 * D**0.5, shuffled=True)
    stream = sample_stream(np.random.default_rng(D + 100 * d + 10_000 * K), shape, SETTLING * K + TIMED)
    problem = replace(stream, dimension=max(d, 1), clusters=MEMORY * K)  # penalties need a positive dimension
    settled, _ = online.observe_stream(empty(problem), problem.x[: SETTLING * K])
    rest = np.ascontiguousarray(problem.x[SETTLING * K :])
    models = (without_decay(settled, problem), settled)
    took = np.array([[seconds(model, rest) for model in models] for _ in range(ROUNDS)])
    ends = [online.observe_stream(model, rest)[0] for model in models]
    kept = all(end.clusters == K and (end.dimensions == d).all() for end in ends)
    worst, far = np.median(took, axis=0) / TIMED * 1e6 if kept else (np.nan, np.nan)
    found = "; ".join(
        f"K = {end.clusters}, d = {end.dimensions.min()} to {end.dimensions.max()}" for end in ends
    )
    return Cost(K, D, d, float(worst), float(far), found)


def seconds(model: online.OnlineModel, x: Floats) -> float:
    gc.collect()
    before = process_time()
    online.observe_stream(model, x)
    return process_time() - before


def terms(costs: list[Cost], names: tuple[str, ...]) -> Floats:
    sizes = np.array([(c.clusters, c.columns, c.dimension + 1) for c in costs], dtype=np.float64)
    K, D, r = sizes.T
    known = {"1": np.ones(len(costs)), "K": K, "K D r": K * D * r, "D r": D * r, "r^2": r**2, "r^3": r**3}
    return np.stack([known[name] for name in names], axis=1)


def fit_costs(costs: list[Cost], names: tuple[str, ...]) -> LinearModel:
    """Fit non-negative coefficients by least squares of relative errors."""
    from scipy.optimize import nnls

    took = np.array([cost.microseconds for cost in costs])
    coefficients, _ = nnls(terms(costs, names) / took[:, None], np.ones(len(costs)))
    return LinearModel(names, tuple(coefficients.tolist()))


def table(costs: list[Cost], line: LinearModel, finer: LinearModel) -> Iterator[str]:
    settled = [cost for cost in costs if cost.settled]
    for formula, model in (("Predicted", line), ("Finer", finer)):
        ratios = [cost.microseconds / model.at(cost) for cost in settled]
        spread = f"median {np.median(ratios):.2f}, from {min(ratios):.2f} to {max(ratios):.2f}"
        yield f"{formula}: {model.formula} microseconds, r = d + 1; measured over it: {spread}."
    yield ""
    yield "| K | D | d | measured us | predicted us | ratio | finer us | far apart us |"
    yield "| ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |"
    for cost in settled:
        size, predicted = f"{cost.clusters} | {cost.columns} | {cost.dimension}", line.at(cost)
        took = f"{cost.microseconds:.2f} | {predicted:.2f} | {cost.microseconds / predicted:.2f}"
        yield f"| {size} | {took} | {finer.at(cost):.2f} | {cost.far:.2f} |"
    for cost in costs:
        if not cost.settled:
            size = f"K = {cost.clusters}, D = {cost.columns}, d = {cost.dimension}"
            yield f"Omitted: {size}; the model was at {cost.found} (worst case; far apart)."


def _cost_to_dict(cost: Cost) -> dict[str, object]:
    return asdict(cost) | ({} if cost.settled else {"microseconds": None, "far": None})


def draw(costs: list[Cost], line: LinearModel, out: Path) -> None:
    """Plot measured against predicted costs, with a colour for each d."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.5, 5.0), layout="constrained")
    axes = figure.add_subplot()
    for d in sorted({cost.dimension for cost in costs}):
        group = [cost for cost in costs if cost.dimension == d]
        axes.scatter([line.at(c) for c in group], [c.microseconds for c in group], s=14, label=f"d = {d}")
    ends = [f(line.at(cost) for cost in costs) for f in (min, max)]
    axes.plot(ends, ends, color="black", linewidth=1.0, label=line.formula.replace("^3", "³") + ", r = d + 1")
    axes.set(xscale="log", yscale="log", xlabel="predicted [µs a step]", ylabel="measured [µs a step]")
    axes.legend(frameon=False, fontsize=8)
    figure.savefig(out, dpi=150)


if __name__ == "__main__":
    main()
