"""Compare fitted and counted durations with the true ones of sampled recordings.

    python reproductions/durations.py --json durations.json --out durations/

Three states in a loop with gamma durations are observed in one noisy column. The last segment of a recording
is right-censored. Durations are counted along Viterbi paths (thesis, section 3.2.2), or fitted by EM over
states and durations.
"""

import argparse
import json
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import pilotfish as pf
from pilotfish.demonstrations import Demonstration, Layout, Part, Quantity, demonstration
from pilotfish.gaussians.structures import DenseCovariances
from pilotfish.models import (
    FromModel,
    HiddenModel,
    MarkovChain,
    SemiMarkovChain,
    viterbi,
)

COUNTS, SEEDS, LENGTH, SPACING = (2, 4, 8, 16, 32, 64, 128), 10, 120, 2.0
TRUE_DURATIONS = pf.durations.Gamma(np.array([20.0, 9.0, 30.0]), np.array([2.0, 0.6, 1.5]))
CHAIN = SemiMarkovChain(np.full(3, 1 / 3), np.roll(np.eye(3), 1, axis=1), TRUE_DURATIONS)
LAYOUT = Layout((Part("place", Quantity.SCALAR, 1, "m"),))
METHODS = {"fitted": "#004488", "counted": "#BB5566"}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", type=Path, help="file for the numbers")
    parser.add_argument("--out", type=Path, help="folder for the picture")
    parser.add_argument("--seeds", type=int, default=SEEDS, help="data sets of each size")
    arguments = parser.parse_args()
    rows = [summarise(count, arguments.seeds) for count in COUNTS]
    print_table(rows, arguments.seeds)
    if arguments.out:
        arguments.out.mkdir(parents=True, exist_ok=True)
        draw(rows).savefig(arguments.out / "durations.png", dpi=110)
        print(f"the picture is in {arguments.out}")
    if arguments.json:
        arguments.json.parent.mkdir(parents=True, exist_ok=True)
        arguments.json.write_text(json.dumps({"rows": rows}, indent=2) + "\n")


def summarise(count: int, seeds: int) -> dict[str, float]:
    """Return root-mean-square errors and biases over data sets of `count` recordings."""
    trials = [run_trial(count, seed) for seed in range(seeds)]
    row: dict[str, float] = {"demonstrations": count}
    for method in METHODS:
        means = np.stack([trial[f"{method} means"] for trial in trials])
        deviations = np.stack([trial[f"{method} deviations"] for trial in trials])
        accuracies = [trial[f"{method} accuracy"] for trial in trials]
        row[f"{method} error of the means [fraction]"] = float(np.sqrt(np.mean(means**2)))
        row[f"{method} bias of the means [fraction]"] = float(np.mean(means))
        row[f"{method} error of the deviations [fraction]"] = float(np.sqrt(np.mean(deviations**2)))
        row[f"{method} accuracy of the states [fraction]"] = float(np.mean(accuracies))
    return row


def run_trial(count: int, seed: int) -> dict[str, np.ndarray]:
    """Return relative errors of means and deviations, and the accuracy of Viterbi paths on new recordings."""
    rng = np.random.default_rng(seed)
    paths = [CHAIN.sample(LENGTH, rng) for _ in range(count)]
    demonstrations = [sample_recording(path, rng) for path in paths]
    model = HiddenModel(
        MarkovChain(np.full(3, 1 / 3), np.full((3, 3), 0.05) + 0.85 * np.eye(3)),
        SPACING * np.arange(3.0)[None, :, None],
        (DenseCovariances(np.ones((3, 1, 1))),),
    )
    skills = {
        method: pf.learn(
            demonstrations,
            states=3,
            rng=rng,
            durations=durations,
            initialisation=FromModel(model),
            settings=pf.models.EMSettings(regularisation=1e-5, tolerance=1e-7, duration_regularisation=1.0),
        ).skill
        for method, durations in (("fitted", pf.models.DurationModel(pf.durations.Gamma)), ("counted", None))
    }
    test_paths = [CHAIN.sample(LENGTH, rng) for _ in range(10)]
    tests = [sample_recording(path, rng) for path in test_paths]
    result: dict[str, np.ndarray] = {}
    for method, skill in skills.items():
        durations = skill.dynamics.durations
        assert durations is not None
        result[f"{method} means"] = durations.means / TRUE_DURATIONS.means - 1.0
        result[f"{method} deviations"] = durations.deviations / TRUE_DURATIONS.deviations - 1.0
        correct = [viterbi(skill, d) == path for d, path in zip(tests, test_paths, strict=True)]
        result[f"{method} accuracy"] = np.mean(correct)
    return result


def sample_recording(path: np.ndarray, rng: np.random.Generator) -> Demonstration:
    x = SPACING * path[:, None] + rng.normal(size=(LENGTH, 1))
    return demonstration(x, 0.1, LAYOUT, (), "a recording")


def print_table(rows: list[dict[str, float]], seeds: int) -> None:
    print(f"{seeds} data sets of each size, {LENGTH} steps per recording, means {SPACING:g} deviations apart")
    for name in rows[0]:
        values = "".join(
            f"{row[name]:>9.0f}" if name == "demonstrations" else f"{row[name]:>9.4f}" for row in rows
        )
        print(f"  {name:<44}{values}")


def draw(rows: list[dict[str, float]]) -> Figure:
    figure = Figure(figsize=(11, 4.2), layout="constrained")
    panels = figure.subplots(1, 3)
    counts = np.array([row["demonstrations"] for row in rows])
    for axes, what in zip(
        panels, ("error of the means", "error of the deviations", "accuracy of the states"), strict=True
    ):
        for method, colour in METHODS.items():
            values = np.array([row[f"{method} {what} [fraction]"] for row in rows])
            axes.plot(counts, values, "o-", color=colour, label=method)
        if what.startswith("error"):
            first = rows[0][f"fitted {what} [fraction]"]
            axes.plot(
                counts,
                first * np.sqrt(counts[0] / counts),
                ":",
                color="0.4",
                label="1 / sqrt(demonstrations)",
            )
            axes.set_yscale("log")
        axes.set_xscale("log", base=2)
        axes.set_xticks(counts, [f"{count:.0f}" for count in counts])
        axes.set(xlabel="demonstrations", ylabel=f"{what} [fraction]", title=what)
        axes.grid(alpha=0.3)
    panels[0].legend(frameon=False)
    return figure


if __name__ == "__main__":
    main()
