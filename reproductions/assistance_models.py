"""Table 5.1: batch and streamed joint models in direct, shared and autonomous control, in physics.

    python reproductions/assistance_models.py --json models.json --out models/

The joint model of operator and object (D = 14, one frame) is learned from six demonstrations of the
screwdriver, whose screw is at rest, or eleven of the carabiner. The thesis has as many; its recordings were
not published, and these are simulated. A simulated person then operates the robot in unseen situations, and
sees the objects displaced by 5 cm in a random horizontal direction.

    SOSC                begins with a batch fit of the first four, of as many states as in the thesis, and
                        streams the others; subspaces and sigma^2 as printed
    SOSC, from nothing  streams all demonstrations into an empty model, which finds its number of states
    full, semi-tied, MFA    batch fits with the number of states of SOSC

    direct      the robot follows the operator; no model
    regression  shared control by equations 6.4-6.9, as in the thesis
    carried     shared control, the default
    autonomous  takes over from direct control at a random instant of the operator's motion, and finishes

The error is the distance at the end of the tool in physics from the bottom of the recess, or from the rod
[m]: mean and standard deviation over all situations of all seeds. A seed has its own demonstrations, models
and situations. Parameters are counted as in the thesis, with K^2 + 2 K for transitions and durations.

Source: Tanwani 2018, section 5.7.2 and table 5.1; displacement and number of situations are ours.
"""

import argparse
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass

import numpy as np
from assistance_drawings import STEP
from joint_models import (
    JOINT,
    STATES,
    Trial,
    augment,
    learn_batch,
    learn_stream,
    learn_stream_from_nothing,
    load_demonstrations,
    make_assistant,
    operate,
    switch_time,
)
from matplotlib.figure import Figure
from online_valve import stream_parameters
from protocol import Row, argument_parser, write_figures, write_numbers
from tqdm import tqdm

import pilotfish as pf
from pilotfish.demonstrations import Demonstration
from pilotfish.gaussians.structures import CovarianceStructure
from pilotfish.models import semi_markov_parameter_count
from pilotfish.models.online import OnlineModel, to_skill
from pilotfish.simulation import Link

NAMES = ("screwdriver", "carabiner")
MODES = ("regression", "carried", "autonomous")
STRUCTURES: dict[str, CovarianceStructure] = {
    "full": pf.structures.Full(),
    "semi-tied": pf.structures.SemiTied(),
    "MFA": pf.structures.MFA(4),
}
STREAMS: dict[str, Callable[[Sequence[Demonstration], int], OnlineModel]] = {
    "SOSC": learn_stream,
    "SOSC, from nothing": learn_stream_from_nothing,
}
MODELS = (*STRUCTURES, *STREAMS)
MARKERS = ("ks", "o", "D", "^")  # of direct and the other modes
LINK = Link(view_distance=0.05)  # m
PRINTED = {  # table 5.1: parameters, then mean and deviation of the errors in direct, shared, autonomous [m]
    "screwdriver": {
        "full": (372, (0.30, 0.17), (0.095, 0.025), (0.038, 2.5e-5)),
        "semi-tied": (295, (0.30, 0.17), (0.094, 0.026), (0.037, 1.8e-5)),
        "MFA": (267, (0.30, 0.17), (0.099, 0.022), (0.037, 7.7e-6)),
        "SOSC": (211, (0.30, 0.17), (0.084, 0.018), (0.043, 1.3e-4)),
    },
    "carabiner": {
        "full": (500, (0.10, 0.062), (0.081, 0.056), (0.099, 0.068)),
        "semi-tied": (332, (0.10, 0.062), (0.082, 0.058), (0.022, 2.6e-4)),
        "MFA": (360, (0.10, 0.062), (0.08, 0.056), (0.037, 8.8e-4)),
        "SOSC": (318, (0.10, 0.062), (0.08, 0.056), (0.073, 3.7e-4)),
    },
}


@dataclass(frozen=True, slots=True)
class Ending:
    """How one trial ended.

    Attributes:
        task: Name of the task.
        model: Name of the joint model; empty for direct control.
        mode: Mode of control.
        error: Distance of the tool from the target at the end [m].
        success: Whether the task was done.
        height: Height of the tool above the object when autonomous control took over [m]; None if it did not.
    """

    task: str
    model: str
    mode: str
    error: float
    success: bool
    height: float | None = None


@dataclass(frozen=True, slots=True)
class Size:
    """Number of states and parameters of one joint model."""

    task: str
    model: str
    states: int
    parameters: int


def main() -> None:
    parser = argument_parser(__doc__)
    parser.add_argument("--tasks", nargs="+", default=NAMES, choices=NAMES, help="which tasks")
    parser.add_argument("--models", nargs="+", default=MODELS, choices=MODELS, help="which models")
    parser.add_argument("--situations", type=int, default=2, help="number of situations of each seed")
    parser.add_argument("--seeds", type=int, default=3, help="number of seeds")
    arguments = parser.parse_args()
    rows: list[Row] = []
    all_endings: list[Ending] = []
    for name in arguments.tasks:
        endings, sizes = evaluate_task(name, arguments)
        all_endings += endings
        print_rows(found := [summarise(name, model, endings, sizes) for model in arguments.models])
        rows += found
    if arguments.out:
        write_figures(arguments.out, {"table_5_1": draw_errors(rows)})
    if arguments.json:
        trials = [asdict(ending) for ending in all_endings]
        write_numbers(arguments.json, {"rows": rows, "printed": PRINTED, "trials": trials})


def evaluate_task(name: str, arguments: argparse.Namespace) -> tuple[list[Ending], list[Size]]:
    """Return the ending of every trial, and the size of every model."""
    endings: list[Ending] = []
    sizes: list[Size] = []
    for seed in range(arguments.seeds):
        demonstrations = load_demonstrations(name, seed)
        cases = [(seed, number) for number in range(arguments.situations)]
        augmented = [augment(demonstration) for demonstration in demonstrations]
        states = learn_stream(augmented, STATES[name]).clusters
        for model in arguments.models:
            sizes.append(measure(name, model, augmented, states))
        trials = try_models(name, demonstrations, states, cases, arguments.models)
        endings += tqdm(trials, f"{name}, seed {seed}", disable=not sys.stderr.isatty())
    return endings, sizes


def measure(name: str, model: str, augmented: Sequence[Demonstration], states: int) -> Size:
    """Return the size of a model of augmented demonstrations."""
    if model in STREAMS:
        stream = STREAMS[model](augmented, STATES[name])
        return Size(name, model, stream.clusters, stream_parameters(stream))
    return Size(name, model, states, semi_markov_parameter_count(STRUCTURES[model], states, JOINT))


def learn_model(name: str, model: str, states: int, augmented: Sequence[Demonstration]) -> pf.Skill:
    """Return the joint model of augmented demonstrations."""
    if model in STREAMS:
        return to_skill(STREAMS[model](augmented, STATES[name]))
    return learn_batch(augmented, states, STRUCTURES[model])


def try_models(
    name: str,
    demonstrations: Sequence[Demonstration],
    states: int,
    cases: Sequence[tuple[int, int]],
    models: Sequence[str],
) -> Iterator[Ending]:
    """Yield the ending of every trial: direct control once, and the other modes for each model."""
    durations: dict[tuple[int, int], float] = {}
    for model in models:

        def learn(chosen: Sequence[Demonstration], model: str = model) -> pf.Skill:
            return learn_model(name, model, states, chosen)

        literal = make_assistant(demonstrations, learn, literal=True)
        carried = make_assistant(demonstrations, learn, literal=False)
        for case in cases:
            if case not in durations:
                trial = operate(name, carried, case, mode="direct", link=LINK)
                durations[case] = trial.result.duration
                yield ending_of(trial, name, "", "direct")
            for mode in MODES:
                assistant = literal if mode == "regression" else carried
                before = "direct" if mode == "autonomous" else "shared"
                switch = switch_time(case, durations[case]) if mode == "autonomous" else np.inf
                trial = operate(name, assistant, case, mode=before, link=LINK, switch=switch)
                yield ending_of(trial, name, model, mode)


def ending_of(trial: Trial, name: str, model: str, mode: str) -> Ending:
    """Return how a trial ended."""
    outcome, height = trial.result.outcome, None
    if np.isfinite(trial.switch):
        (target,) = trial.actual.values()
        row = min(round(trial.switch / STEP), len(trial.result.measured) - 1)
        height = float(trial.result.measured[row, 2] - target.position[2])
    return Ending(name, model, mode, outcome.error, outcome.success, height)


def summarise(name: str, model: str, endings: Sequence[Ending], sizes: Sequence[Size]) -> Row:
    """Return sizes over seeds, and mean, deviation and successes over situations."""
    chosen = [size for size in sizes if size.model == model]
    row: Row = {
        "task": name,
        "model": model,
        "states": [size.states for size in chosen],
        "parameters": [size.parameters for size in chosen],
    }
    for mode in ("direct", *MODES):
        found = [each for each in endings if each.mode == mode and each.model in ("", model)]
        errors = [each.error for each in found]
        row[mode] = {
            "mean": float(np.mean(errors)),
            "deviation": float(np.std(errors)),
            "completed": sum(each.success for each in found),
            "of": len(found),
        }
    return row


def print_rows(rows: Sequence[Row]) -> None:
    """Print the table of one task, with the printed numbers below each row."""
    print(f"\n{rows[0]['task']}: parameters, and errors at the end [m] (completed)")
    for row in rows:
        cells = [
            f"{mode} {row[mode]['mean']:.4f} +- {row[mode]['deviation']:.4f} "
            f"({row[mode]['completed']}/{row[mode]['of']})"
            for mode in ("direct", *MODES)
        ]
        print(f"  {row['model']:18}  K {row['states']}  N {row['parameters']}  " + "   ".join(cells))
        if row["model"] in PRINTED[row["task"]]:
            parameters, *errors = PRINTED[row["task"]][row["model"]]
            words = zip(("direct", "shared", "autonomous"), errors, strict=True)
            cells = [f"{mode} {mean:g} +- {deviation:g}" for mode, (mean, deviation) in words]
            print(f"  {'printed':18}  N {parameters}  " + "   ".join(cells), flush=True)


def draw_errors(rows: Sequence[Row]) -> Figure:
    """Return the mean error of each model and mode, on a logarithmic axis."""
    names = list(dict.fromkeys(row["task"] for row in rows))
    figure = Figure(figsize=(10.0, 3.8), layout="constrained")
    modes = ("direct", *MODES)
    for axes, name in zip(figure.subplots(1, len(names), squeeze=False)[0], names, strict=True):
        chosen = [row for row in rows if row["task"] == name]
        for n, mode in enumerate(modes):
            means = [row[mode]["mean"] for row in chosen]
            axes.plot(np.arange(len(chosen)) + 0.12 * (n - 1.5), means, MARKERS[n], label=mode)
        axes.set(title=name, yscale="log", ylabel="error at the end [m]", xlabel="joint model")
        axes.grid(True, axis="y", color="0.92", linewidth=0.6)
        labels = [row["model"].replace(", ", ",\n") for row in chosen]
        axes.set_xticks(np.arange(len(chosen)), labels)
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(modes), frameon=False)
    return figure


if __name__ == "__main__":
    main()
