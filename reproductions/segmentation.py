"""Segmentation of exercises: states found in joint angles against labels of a person.

    python reproductions/segmentation.py --json segments.json --out segmentation/

Four sequences of two people with ten kinds of exercise, labelled by hand at every tenth of a second (mocap6).
The labels are used for scoring only. Every method has K = 12 states (the whole set has twelve exercises),
full covariances, the same initialisation (k-means, all transitions) and the same regularisation. The
regularisation was chosen by the likelihood of left-out sequences under the Markov model. Features are the
twelve recorded columns with zero mean and unit variance. Because an exercise is a repeated movement and not a
pose, a second set has their mean and deviation over 1.1 s around every step, standardised again. The
segmentation of a method is its most likely path. Scores are the share of steps whose state matches the label
under the best one-to-one matching, and normalised mutual information; means and deviations are over seeds.

Source: Fox, Hughes, Sudderth & Jordan 2014 for the data; the comparison is ours.
"""

import time
from collections.abc import Callable, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from protocol import argument_parser, write_figures, write_numbers

import pilotfish as pf
from pilotfish import plots
from pilotfish.demonstrations import Demonstration, Layout, Part, Quantity, demonstration, views
from pilotfish.models import (
    log_emissions,
    log_likelihood,
    match_labels,
    matched_accuracy,
    normalised_mutual_information,
    state_segments,
    viterbi,
)

STATES, SEEDS, CHOOSING_SEEDS = 12, 20, 2
REGULARISATIONS = (1e-3, 1e-2, 1e-1, 0.3, 1.0)  # of columns of unit variance
SECONDS = 0.1  # of a step
AROUND = 5  # steps of the window before and after
ACTIONS = {
    1: "jumping jacks",
    2: "jogging",
    3: "squats",
    4: "knee raises",
    5: "arm circles",
    6: "twists",
    7: "side reaches",
    8: "boxing",
    9: "up and down",
    10: "toe touches, one hand",
    11: "side bends",
    12: "toe touches, two hands",
}
COLOURS = dict(
    zip(
        ACTIONS,
        (*map(plots.state_colour, range(8)), "#F0E442", "#999933", "#DDCC77", "#AA4499"),
        strict=True,
    )
)
METHODS = ("mixture", "HMM", "counted durations", "exact durations")
Labels = np.ndarray
Features = Callable[[Sequence[Demonstration]], tuple[Demonstration, ...]]


def main() -> None:
    parser = argument_parser(__doc__)
    parser.add_argument("--seeds", type=int, default=SEEDS, help="number of initialisations of each method")
    arguments = parser.parse_args()
    try:
        recorded, labels = pf.datasets.mocap6(), pf.datasets.mocap6_labels()
    except pf.SkillError as error:
        parser.exit(1, f"{error}\n")
    report: dict[str, object] = {}
    for name, features in FEATURES.items():
        sequences = features(recorded)
        choice = choose_regularisation(sequences)
        regularisation = max(choice, key=lambda value: choice[value])
        trials = [run_trial(sequences, labels, seed, regularisation) for seed in range(arguments.seeds)]
        rows = [summary(method, trials) for method in METHODS]
        print_table(name, choice, rows, labels)
        report[name] = {"regularisation": regularisation, "left_out": choice, "rows": rows}
        if arguments.out:
            best = {
                m: max((t[m] for t in trials), key=lambda r: float(str(r["log_likelihood"]))) for m in METHODS
            }
            figures = {
                f"{name.replace(' ', '-')}-segments": draw_segments(recorded, labels, best),
                f"{name.replace(' ', '-')}-durations": draw_durations(labels, best),
            }
            write_figures(arguments.out, figures)
    if arguments.json:
        write_numbers(arguments.json, report)


def standardise(recorded: Sequence[Demonstration]) -> tuple[Demonstration, ...]:
    """Return the sequences with zero mean and unit variance of each column over all of them."""
    x = np.vstack([d.x for d in recorded])
    parts = tuple(Part(p.name, Quantity.SCALAR, p.size, "1") for p in recorded[0].layout.parts)
    return tuple(
        demonstration((d.x - x.mean(axis=0)) / x.std(axis=0), d.period, Layout(parts), name=d.name)
        for d in recorded
    )


def window_features(recorded: Sequence[Demonstration]) -> tuple[Demonstration, ...]:
    """Return mean and deviation of each standardised column in a window, standardised again."""
    layout = Layout(
        tuple(
            Part(f"{what} {p.name}", Quantity.SCALAR, 1, "1")
            for what in ("mean", "deviation")
            for p in recorded[0].layout.parts
        )
    )
    windows = []
    for d in standardise(recorded):
        padded = np.pad(d.x, ((AROUND, AROUND), (0, 0)), mode="edge")
        window = np.lib.stride_tricks.sliding_window_view(padded, 2 * AROUND + 1, axis=0)  # (T, D, W)
        x = np.hstack([window.mean(axis=2), window.std(axis=2)])
        windows.append(demonstration(x, d.period, layout, name=d.name))
    return standardise(windows)


FEATURES: dict[str, Features] = {"joint angles": standardise, "around each step": window_features}


def choose_regularisation(sequences: Sequence[Demonstration]) -> dict[float, float]:
    """Return the log-likelihood per step of left-out sequences under Markov models of the others."""
    steps = sum(len(d.x) for d in sequences)
    totals = dict.fromkeys(REGULARISATIONS, 0.0)
    for value in REGULARISATIONS:
        for seed in range(CHOOSING_SEEDS):
            for left_out in range(len(sequences)):
                others = [d for m, d in enumerate(sequences) if m != left_out]
                skill = fit_skill(others, seed, value, dynamics="markov").skill
                totals[value] += float(log_likelihood(skill, [sequences[left_out]]).sum())
    return {value: total / (steps * CHOOSING_SEEDS) for value, total in totals.items()}


def fit_skill(
    sequences: Sequence[Demonstration],
    seed: int,
    regularisation: float,
    dynamics: str = "semi-markov",
    durations: pf.models.DurationModel | None = None,
) -> pf.models.Fit:
    return pf.learn(
        sequences,
        states=STATES,
        rng=np.random.default_rng(seed),
        dynamics=dynamics,
        durations=durations,
        initialisation=pf.models.KMeans(),
        settings=pf.models.EMSettings(
            regularisation=regularisation, tolerance=1e-5, duration_regularisation=1.0
        ),
    )


def run_trial(
    sequences: Sequence[Demonstration], labels: Sequence[Labels], seed: int, regularisation: float
) -> dict[str, dict[str, object]]:
    """Return path, scores and durations of each method for one initialisation."""
    begin = time.process_time()
    mixture = fit_skill(sequences, seed, regularisation, dynamics="mixture")
    after_mixture = time.process_time()
    counted = fit_skill(sequences, seed, regularisation)
    after_counted = time.process_time()
    exact = fit_skill(sequences, seed, regularisation, durations=pf.models.DurationModel())
    after_exact = time.process_time()
    skills = {
        "mixture": (mixture.skill, after_mixture - begin),
        "HMM": (counted.markov_skill, after_counted - after_mixture),
        "counted durations": (counted.skill, after_counted - after_mixture),
        "exact durations": (exact.skill, after_exact - after_counted),
    }
    return {
        name: score_skill(skill, sequences, labels) | {"seconds": s} for name, (skill, s) in skills.items()
    }


def score_skill(
    skill: pf.Skill, sequences: Sequence[Demonstration], labels: Sequence[Labels]
) -> dict[str, object]:
    paths = [viterbi(skill, d) for d in sequences]
    densities = np.sort(log_emissions(skill, views(sequences)), axis=1)
    found, truth = np.concatenate(paths), np.concatenate(labels)
    segments = np.concatenate([state_segments(path)[1] for path in paths])
    return {
        "accuracy": matched_accuracy(found, truth),
        "information": normalised_mutual_information(found, truth),
        "log_likelihood": float(log_likelihood(skill, sequences).sum()),
        "steps_a_visit": float(segments.mean()),
        "states": skill.states,
        "evidence": float(np.median(densities[:, -1] - densities[:, -2])),
        "paths": paths,
        "stands_for": match_labels(found, truth),
        "durations": skill.dynamics.durations,
    }


def summary(method: str, trials: Sequence[dict[str, dict[str, object]]]) -> dict[str, object]:
    """Return means and deviations over seeds, and the difference from the Markov model per seed."""
    row: dict[str, object] = {"method": method, "seeds": len(trials)}
    for score in ("accuracy", "information", "log_likelihood", "steps_a_visit", "evidence", "seconds"):
        own, markov = (np.array([t[m][score] for t in trials], dtype=float) for m in (method, "HMM"))
        row[score] = float(own.mean())
        row[f"{score}_deviation"] = float(own.std(ddof=1)) if len(own) > 1 else float("nan")
        row[f"{score}_over_HMM"] = float((own - markov).mean())
        error = (own - markov).std(ddof=1) / np.sqrt(len(own)) if len(own) > 1 else float("nan")
        row[f"{score}_over_HMM_error"] = float(error)
    return row


def print_table(
    name: str, choice: dict[float, float], rows: Sequence[dict[str, object]], labels: Sequence[Labels]
) -> None:
    print(f"features: {name}. log-likelihood per step of a left-out sequence [nats], by regularisation:")
    print("  " + "   ".join(f"{value:g}: {gained:.2f}" for value, gained in choice.items()))
    print(f"{'method':<20}{'accuracy':>17}{'over HMM':>18}{'information':>17}{'over HMM':>18}", end="")
    print(f"{'log-likelihood':>18}{'segment steps':>15}{'CPU s':>7}")
    for row in rows:
        scores = "".join(
            f"{row[s]:>10.3f} ± {row[s + '_deviation']:.3f}"
            f"{row[s + '_over_HMM']:>+10.3f} ± {row[s + '_over_HMM_error']:.3f}"
            for s in ("accuracy", "information")
        )
        print(f"{row['method']:<19}{scores}", end="")
        print(f"{row['log_likelihood']:>19.0f}{row['steps_a_visit']:>15.1f}{row['seconds']:>7.2f}")
    lengths = np.concatenate([state_segments(of)[1] for of in labels])
    by = {str(row["method"]): row for row in rows}
    gained = float(str(by["exact durations"]["log_likelihood_over_HMM"]))
    segments = len(np.concatenate(labels)) / float(str(by["exact durations"]["steps_a_visit"]))
    print(f"± deviation over {rows[0]['seeds']} seeds; over HMM: mean ± standard error, seed by seed.")
    print(f"A labelled exercise lasts {lengths.mean():.1f} steps, from {lengths.min()} to {lengths.max()}.")
    print(f"Durations matter little: they gain {gained / segments:.2f} nats per segment over the HMM, while")
    evidence = by["HMM"]["evidence"]
    print(f"a single step gains {evidence:.1f} nats for its best over its second-best state (median).\n")


def draw_segments(
    recorded: Sequence[Demonstration], labels: Sequence[Labels], best: dict[str, dict[str, object]]
) -> Figure:
    """Draw hand labels and the segments of each method for its most likely seed."""
    figure = Figure(figsize=(12, 8.6), layout="constrained")
    for m, (axes, truth) in enumerate(zip(figure.subplots(len(labels), 1), labels, strict=True)):
        seconds = recorded[m].period
        draw_bar(axes, len(METHODS), truth, COLOURS, seconds)
        for height, method in enumerate(reversed(METHODS)):
            paths, matches = best[method]["paths"], best[method]["stands_for"]
            assert isinstance(paths, list)
            assert isinstance(matches, dict)
            named = {state: COLOURS[label] for state, label in matches.items()}
            draw_bar(axes, height, paths[m], named, seconds)
        axes.set_yticks(range(len(METHODS) + 1), [*reversed(METHODS), "hand labels"])
        axes.set(xlim=(0, len(truth) * seconds), ylim=(-0.5, len(METHODS) + 0.5))
        axes.set_title(recorded[m].name, loc="left", fontsize=10, fontweight="bold")
        axes.spines[["top", "right"]].set_visible(False)
    axes.set_xlabel("time [s]")
    present = [label for label in ACTIONS if any((of == label).any() for of in labels)]
    handles = [Patch(color=COLOURS[label], label=ACTIONS[label]) for label in present]
    handles.append(Patch(color=UNMATCHED, label="a state without an exercise"))
    figure.legend(handles=handles, loc="outside lower center", ncols=6, frameon=False, fontsize=9)
    return figure


UNMATCHED = "0.8"


def draw_bar(axes: Axes, height: float, path: Labels, colours: dict[int, str], seconds: float) -> None:
    """Draw the segments of a path in the colours of the matched exercises."""
    states, lengths = state_segments(np.asarray(path, dtype=np.int64))
    ends = np.cumsum(lengths)
    spans = [((end - length) * seconds, length * seconds) for end, length in zip(ends, lengths, strict=True)]
    faces = [colours.get(int(state), UNMATCHED) for state in states]
    axes.broken_barh(spans, (height - 0.36, 0.72), facecolors=faces, edgecolors="white", linewidth=0.3)


def duration_statistics(durations: object) -> tuple[np.ndarray, np.ndarray]:
    """Return mean and deviation of durations in whole steps [s], also of a truncated Gaussian."""
    assert isinstance(durations, pf.durations.DurationDistribution)
    table = np.exp(durations.log_table(durations.max_duration(1e-6)))  # (S, K)
    steps = np.arange(1, len(table) + 1)
    means = steps @ table
    deviations = np.sqrt(steps**2 @ table - means**2)
    return means * SECONDS, deviations * SECONDS


def draw_durations(labels: Sequence[Labels], best: dict[str, dict[str, object]]) -> Figure:
    """Draw the durations of the two semi-Markov models and of the exercises."""
    figure = Figure(figsize=(12, 4.4), layout="constrained")
    panels = figure.subplots(1, 3, sharey=True)
    for axes, method in zip(panels, METHODS[2:], strict=False):
        durations, matches = best[method]["durations"], best[method]["stands_for"]
        assert isinstance(matches, dict)
        means, deviations = duration_statistics(durations)
        order = np.argsort(means)
        faces = [COLOURS.get(matches.get(int(k), 0), UNMATCHED) for k in order]
        axes.bar(range(len(order)), means[order], color=faces)
        low = np.minimum(deviations[order], means[order])
        axes.errorbar(
            range(len(order)),
            means[order],
            yerr=[low, deviations[order]],
            fmt="none",
            ecolor="0.25",
            capsize=2,
        )
        axes.set_xticks(range(len(order)), [str(k) for k in order])
        axes.set_title(f"{method}: mean ± deviation", loc="left", fontsize=10, fontweight="bold")
        axes.set_xlabel("state")
    segments = sorted((int(n), int(a)) for of in labels for a, n in zip(*state_segments(of), strict=True))
    panels[2].bar(
        range(len(segments)), [n * SECONDS for n, _ in segments], color=[COLOURS[a] for _, a in segments]
    )
    panels[2].set_title("exercises as labelled", loc="left", fontsize=10, fontweight="bold")
    panels[2].set_xlabel("each time one is done")
    panels[0].set_ylabel("duration [s]")
    for axes in panels:
        axes.spines[["top", "right"]].set_visible(False)
    return figure


if __name__ == "__main__":
    main()
