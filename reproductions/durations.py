"""How well durations come back of sampled recordings: exact learning beside counted runs.

    python reproductions/durations.py --json durations.json --out durations/

Three states in a loop, their durations gamma, one column of noisy places; recordings end where they end.
The durations are those of the thesis' counted runs (section 3.2.2) and of exact expectation-maximisation.
"""

import argparse
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import pilotfish as pf
from pilotfish.demonstrations import Demonstration, Layout, Part, Quantity, demonstration, views
from pilotfish.gaussians.structures import DenseCovariances
from pilotfish.models import (
    FromModel,
    HiddenModel,
    MarkovChain,
    SemiMarkovChain,
    count_durations,
    viterbi,
)

COUNTS, SEEDS, LENGTH, APART = (2, 4, 8, 16, 32, 64, 128), 10, 120, 2.0
TRUTH = pf.durations.Gamma(np.array([20.0, 9.0, 30.0]), np.array([2.0, 0.6, 1.5]))
CHAIN = SemiMarkovChain(np.full(3, 1 / 3), np.roll(np.eye(3), 1, axis=1), TRUTH)
PLACE = Layout((Part("place", Quantity.SCALAR, 1, "m"),))
METHODS = {"exact": "#004488", "counted": "#BB5566"}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", type=Path, help="file for the numbers")
    parser.add_argument("--out", type=Path, help="folder for the picture")
    parser.add_argument("--seeds", type=int, default=SEEDS, help="data sets of every size")
    arguments = parser.parse_args()
    rows = [row(count, arguments.seeds) for count in COUNTS]
    print_table(rows, arguments.seeds)
    if arguments.out:
        arguments.out.mkdir(parents=True, exist_ok=True)
        picture(rows).savefig(arguments.out / "durations.png", dpi=110)
        print(f"the picture is in {arguments.out}")
    if arguments.json:
        arguments.json.parent.mkdir(parents=True, exist_ok=True)
        arguments.json.write_text(json.dumps({"rows": rows}, indent=2) + "\n")


def row(count: int, seeds: int) -> dict[str, float]:
    """Errors over data sets of so many recordings: root mean squares, biases, and states told right."""
    found = [errors(count, seed) for seed in range(seeds)]
    numbers: dict[str, float] = {"demonstrations": count}
    for way in METHODS:
        e = np.stack([one[f"{way} error"] for one in found])
        numbers[f"{way} error of the means [share]"] = float(np.sqrt(np.mean(e**2)))
        numbers[f"{way} bias of the means [share]"] = float(np.mean(e))
        d = np.stack([one[f"{way} deviation"] for one in found])
        numbers[f"{way} error of the deviations [share]"] = float(np.sqrt(np.mean(d**2)))
        numbers[f"{way} states right [share]"] = float(np.mean([one[f"{way} right"] for one in found]))
    return numbers


def errors(count: int, seed: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    paths = [CHAIN.sample(LENGTH, rng) for _ in range(count)]
    demonstrations = [recording(path, rng) for path in paths]
    initialisation = HiddenModel(
        MarkovChain(np.full(3, 1 / 3), np.full((3, 3), 0.05) + 0.85 * np.eye(3)),
        APART * np.arange(3.0)[None, :, None],
        (DenseCovariances(np.ones((3, 1, 1))),),
    )
    fit = pf.learn(
        demonstrations,
        states=3,
        rng=rng,
        initialisation=FromModel(initialisation),
        durations=pf.models.DurationModel(pf.durations.Gamma),
        settings=pf.models.EMSettings(tolerance=1e-7),
    )
    counted = replace(
        fit.markov_skill, dynamics=count_durations(fit.markov_skill, views(demonstrations), 1.0)
    )
    unseen = [CHAIN.sample(LENGTH, rng) for _ in range(10)]
    tests = [recording(path, rng) for path in unseen]
    result: dict[str, np.ndarray] = {}
    for way, skill in (("exact", fit.skill), ("counted", counted)):
        dynamics = skill.dynamics
        assert isinstance(dynamics, SemiMarkovChain)
        result[f"{way} error"] = dynamics.durations.means / TRUTH.means - 1.0
        result[f"{way} deviation"] = dynamics.durations.deviations / TRUTH.deviations - 1.0
        right = [viterbi(skill, d) == path for d, path in zip(tests, unseen, strict=True)]
        result[f"{way} right"] = np.mean(right)
    return result


def recording(path: np.ndarray, rng: np.random.Generator) -> Demonstration:
    return demonstration(APART * path[:, None] + rng.normal(size=(LENGTH, 1)), 0.1, PLACE, (), "a recording")


def print_table(rows: list[dict[str, float]], seeds: int) -> None:
    print(f"{seeds} data sets of each size, {LENGTH} steps a recording, places {APART:g} deviations apart")
    for name in rows[0]:
        values = "".join(f"{r[name]:>9.0f}" if name == "demonstrations" else f"{r[name]:>9.4f}" for r in rows)
        print(f"  {name:<44}{values}")


def picture(rows: list[dict[str, float]]) -> Figure:
    figure = Figure(figsize=(11, 4.2), layout="constrained")
    panels = figure.subplots(1, 3)
    counts = np.array([r["demonstrations"] for r in rows])
    for axes, what in zip(
        panels, ("error of the means", "error of the deviations", "states right"), strict=True
    ):
        for way, colour in METHODS.items():
            values = np.array([r[f"{way} {what} [share]"] for r in rows])
            axes.plot(counts, values, "o-", color=colour, label=way)
        if what.startswith("error"):
            first = rows[0][f"exact {what} [share]"]
            axes.plot(
                counts, first * np.sqrt(counts[0] / counts), ":", color="0.4", label="one over the root"
            )
            axes.set_yscale("log")
        axes.set_xscale("log", base=2)
        axes.set_xticks(counts, [f"{count:.0f}" for count in counts])
        axes.set(xlabel="demonstrations", ylabel=f"{what} [share]", title=what)
        axes.grid(alpha=0.3)
    panels[0].legend(frameon=False)
    return figure


if __name__ == "__main__":
    main()
