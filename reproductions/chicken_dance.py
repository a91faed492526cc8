"""Whole-body dance: figures 4.3 and 4.4 of the thesis, from the recording of one of the two dancers.

    python reproductions/chicken_dance.py --json dance.json --out dance/

The thesis regenerates one dancer from the other. Only one of the two recordings is available. Here the same
dancer is regenerated in three ways: the body from time; the middle and the right of the body from time and
its left; and the middle and the right from the left, without the last quarter of the dance in the training.

Protocol: the dance is resampled to 500 datapoints; x, y, z of 28 nodes and time are D = 85 columns. The
thesis has 31 joints, of which ten coincide with others here: D = 94. Mixtures start from time bins, 1e-4 (a
square centimetre) is added to every variance, and regression is GaussianMixture.regress (Gaussian mixture
regression). Errors are means over steps and regenerated coordinates.

Source: Tanwani 2018, section 4.2.3.
"""

import time
from collections.abc import Sequence
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from protocol import argument_parser, write_figures, write_numbers

import pilotfish as pf
from pilotfish import plots
from pilotfish.demonstrations import Demonstration, Layout, Part, Quantity, demonstration, resample
from pilotfish.gaussians.structures import CovarianceStructure, component_correlation

POINTS, TRAINED = 500, 375  # datapoints; those before the last quarter
FACTORS = 4  # of MFA and HDDC; the thesis names no number
COMPONENTS = (5, 10, 20, 40, 75)
SETTINGS = pf.models.EMSettings(regularisation=1e-4, tolerance=1e-5, duration_regularisation=1.0)
STRUCTURES: dict[str, CovarianceStructure] = {
    s.label: s
    for s in (
        pf.structures.SemiTied(1.0),
        pf.structures.SemiTied(0.6),
        pf.structures.Full(),
        pf.structures.MFA(FACTORS),
        pf.structures.HDDC(FACTORS),
    )
}
STYLES = (
    ("#D55E00", "-", 3),
    ("#E69F00", "--", 4),
    ("#0072B2", "-", 2),
    ("#009E73", "--", 4),
    ("#CC79A7", ":", 5),
)
THESIS_WIDTH, THESIS_COUNTS = 94, {"full": 334_875, "semi-tied(1)": 15_886}  # of 75 components
TASKS = {
    "time": "the body from time",
    "half": "middle and right from the left and time",
    "unseen": "middle and right from the left, last quarter not in the training",
}
CLAIMS = (
    "thesis: the semi-tied mixture needs more components for the same error; .6 lies between it and the full",
    "thesis: its parameters are an order of magnitude fewer, its components correlate more; errors are drawn",
)
BONES = """
Hips LeftUpLeg LeftLeg LeftFoot LeftToeBase LeftToeBase_end
Hips RightUpLeg RightLeg RightFoot RightToeBase RightToeBase_end
Hips Spine Spine1 Neck1 Head Head_end
Spine1 LeftArm LeftForeArm LeftHand LeftHandIndex1 LeftHandIndex1_end
Spine1 RightArm RightForeArm RightHand RightHandIndex1 RightHandIndex1_end
LeftHand LThumb_end
RightHand RThumb_end
"""  # chains of nodes; bones have constant length, which a test checks


def main() -> None:
    parser = argument_parser(__doc__)
    parser.add_argument("--components", type=int, nargs="+", default=COMPONENTS, help="numbers of components")
    arguments = parser.parse_args()
    try:
        dance = add_time_column(resample(pf.datasets.chicken_dance()[0], POINTS))
    except pf.SkillError as error:
        parser.exit(1, f"{error}\n")
    rows = []
    for label in STRUCTURES:
        for states in arguments.components:
            rows.append(measure_mixture(dance, label, states))
            print_row(rows[-1], first=len(rows) == 1)
    for line in (*CLAIMS, *counts(), *comparisons(rows), baseline_errors(dance)):
        print(line)
    if arguments.out:
        most = max(arguments.components)
        write_figures(arguments.out, draw_figures(dance, rows, most))
        animate(dance, most, arguments.out / "dance.gif")
        print(f"pictures and dance.gif in {arguments.out}")
    if arguments.json:
        write_numbers(arguments.json, {"rows": rows, "notes": comparisons(rows)})


def add_time_column(dance: Demonstration) -> Demonstration:
    """Return the dance with a leading column of time."""
    layout = Layout((Part("time", Quantity.SCALAR, 1, "s"), *dance.layout.parts))
    seconds = np.arange(len(dance.x)) * dance.period
    return demonstration(np.column_stack([seconds, dance.x]), dance.period, layout, name=dance.name)


def measure_mixture(dance: Demonstration, label: str, states: int) -> dict[str, object]:
    """Return the errors of a mixture in the three tasks, its parameters and its CPU time."""
    begin = time.process_time()
    fit = learn_skill(dance, label, states)
    seconds = time.process_time() - begin
    learned_from_part = learn_skill(training_part(dance), label, states).skill
    errors = {
        "time": squared_error(fit.skill, dance, 0, input_columns("time", dance.layout)),
        "half": squared_error(fit.skill, dance, 0, input_columns("half", dance.layout)),
        "unseen": squared_error(learned_from_part, dance, TRAINED, input_columns("unseen", dance.layout)),
    }
    correlations = component_correlation(fit.skill.covariances[0].dense)
    different = ~np.eye(fit.skill.states, dtype=bool)
    return {
        "structure": label,
        "components": states,
        "kept": fit.skill.states,
        "covariance_parameters": STRUCTURES[label].parameter_count(states, fit.skill.width),
        "mse": errors,
        "rms_cm": {task: 100 * float(np.sqrt(error)) for task, error in errors.items()},
        "mean_component_correlation": float(correlations[different].mean()),
        "log_likelihood_per_datapoint": float(fit.log_likelihoods[-1]) / POINTS,
        "iterations": fit.convergence.iterations,
        "fit_seconds": seconds,
    }


@cache
def training_part(dance: Demonstration) -> Demonstration:
    """Return the dance without its last quarter."""
    return demonstration(dance.x[:TRAINED], dance.period, dance.layout, name=dance.name)


@cache
def learn_skill(dance: Demonstration, label: str, states: int) -> pf.models.Fit:
    rng = np.random.default_rng(0)
    return pf.learn(
        [dance],
        states=states,
        rng=rng,
        dynamics="mixture",
        structure=STRUCTURES[label],
        initialisation=pf.models.TimeBins(),
        settings=SETTINGS,
    )


def input_columns(task: str, layout: Layout) -> np.ndarray:
    """Return the input columns of a task."""
    left = [
        column
        for part, columns in zip(layout.parts, layout.slices, strict=True)
        for column in range(columns.start, columns.stop)
        if part.name.startswith("L")  # the left side: LeftHand, LThumb_end ...
    ]
    return np.array({"time": [0], "half": [0, *left], "unseen": left}[task])


def regenerate(skill: pf.Skill, x: np.ndarray, inputs: np.ndarray) -> np.ndarray:
    """Replace every column except the inputs by its conditional mean."""
    adapted = pf.adapt(skill, [pf.Frame("world", np.eye(skill.width), np.zeros(skill.width))])
    expected = adapted.as_mixture().regress(inputs, np.ascontiguousarray(x[:, inputs])).means
    regenerated = x.copy()
    regenerated[:, np.setdiff1d(np.arange(x.shape[1]), inputs)] = expected
    return regenerated


def squared_error(skill: pf.Skill, dance: Demonstration, begin: int, inputs: np.ndarray) -> float:
    """Return the mean squared error of the regenerated coordinates from a row on, without time [m^2]."""
    x = dance.x[begin:]
    columns = np.setdiff1d(np.arange(1, x.shape[1]), inputs)
    return float(np.mean((regenerate(skill, x, inputs) - x)[:, columns] ** 2))


def print_row(row: dict[str, object], *, first: bool) -> None:
    if first:
        print("mean squared error [m^2 a coordinate], and its root [cm]; seconds of CPU for one fit")
        print(f"{'covariances':<13}{'K':>3}{'parameters':>12}", end="")
        print(
            "".join(f"{task:>20}" for task in TASKS), f"{'correlation':>13}{'iterations':>12}{'seconds':>9}"
        )
    mse, rms = row["mse"], row["rms_cm"]
    assert isinstance(mse, dict)
    assert isinstance(rms, dict)
    cells = "".join(f"{mse[task]:>12.2e} {rms[task]:>6.2f} " for task in TASKS)
    print(f"{row['structure']:<13}{row['components']:>3}{row['covariance_parameters']:>12}{cells}", end="")
    print(f"{row['mean_component_correlation']:>13.2f}{row['iterations']:>12}{row['fit_seconds']:>9.1f}")


def counts() -> list[str]:
    """Return the parameter counts of the thesis, computed by the library."""
    return [
        f"parameters at K = 75, D = {THESIS_WIDTH}, {label}: "
        f"{STRUCTURES[label].parameter_count(75, THESIS_WIDTH)} (thesis {count})"
        for label, count in THESIS_COUNTS.items()
    ]


def comparisons(rows: Sequence[dict[str, object]]) -> list[str]:
    """Return statements about the claims that hold for the rows."""
    lines = []
    most = max(int(str(row["components"])) for row in rows)
    at_most = {str(row["structure"]): row for row in rows if row["components"] == most}
    full, tied = at_most["full"], at_most["semi-tied(1)"]
    ratio = int(str(full["covariance_parameters"])) / int(str(tied["covariance_parameters"]))
    ordered = [
        K
        for K in sorted({int(str(row["components"])) for row in rows})
        if errors_decrease_with_tying(rows, K)
    ]
    lines.append(f"error from time, semi-tied(1) >= semi-tied(0.6) >= full, holds for K = {ordered}")
    lines.append(f"here: K = {most}: the full mixture has {ratio:.1f} times the semi-tied one's parameters")
    for task, description in TASKS.items():
        ranked = sorted((row["rms_cm"][task], name) for name, row in at_most.items())  # type: ignore[index]
        lines.append(
            f"here: {description} [cm]: " + ", ".join(f"{name} {error:.2f}" for error, name in ranked)
        )
    pair = [row["mean_component_correlation"] for row in (tied, full)]
    lines.append(f"here: mean correlation of components: semi-tied {pair[0]:.2f}, full {pair[1]:.2f}")
    return lines


def baseline_errors(dance: Demonstration) -> str:
    """Return the errors of the mean pose of the training part, for comparison."""
    still = {"time": dance.x - dance.x.mean(axis=0)}
    still["unseen"] = dance.x[TRAINED:] - dance.x[:TRAINED].mean(axis=0)
    errors = []
    for task, error in still.items():
        columns = np.setdiff1d(np.arange(1, dance.x.shape[1]), input_columns(task, dance.layout))
        errors.append(f"{100 * np.sqrt(np.mean(error[:, columns] ** 2)):.2f} in {TASKS[task]}")
    return "for comparison, the mean of the training part has the error [cm]: " + "; ".join(errors)


def errors_decrease_with_tying(rows: Sequence[dict[str, object]], states: int) -> bool:
    """Return whether the errors from time decrease with tying."""
    errors = {
        str(row["structure"]): row["mse"]["time"]  # type: ignore[index]
        for row in rows
        if row["components"] == states
    }
    return bool(errors["semi-tied(1)"] >= errors["semi-tied(0.6)"] >= errors["full"])


def draw_figures(dance: Demonstration, rows: Sequence[dict[str, object]], states: int) -> dict[str, Figure]:
    tied, full = (learn_skill(dance, label, states).skill for label in ("semi-tied(1)", "full"))
    correlations = plots.covariance_correlations([full, tied])
    return {
        "figure-4.3-dance": draw_dance(dance, tied),
        "figure-4.3-curves": draw_curves(rows),
        "figure-4.4-correlations": correlations,
    }


def draw_dance(dance: Demonstration, skill: pf.Skill) -> Figure:
    """Draw six poses of the dance, regenerated from time above and from the left side below."""
    figure = Figure(figsize=(12, 6.4), layout="constrained")
    panels = figure.subplots(2, 6)
    moments = np.linspace(0, POINTS - 1, 8).astype(int)[1:-1]
    for row, task, title in zip(
        panels, ("time", "half"), ("from time", "from time and the left"), strict=True
    ):
        made = regenerate(skill, dance.x, input_columns(task, dance.layout))
        for axes, t in zip(row, moments, strict=True):
            draw_body(axes, dance.layout, dance.x[t], made[t], dance.layout if task == "half" else None)
            axes.set_title(f"{title}\n{dance.x[t, 0]:.1f} s", fontsize=10)
    figure.suptitle(
        f"recorded (grey) and regenerated by a semi-tied mixture of {skill.states} (orange); given: blue"
    )
    return figure


def draw_body(
    axes: Axes, layout: Layout, recorded: np.ndarray, made: np.ndarray, half: Layout | None = None
) -> None:
    """Draw the recorded body in grey and the regenerated one, with its inputs in blue."""
    for x, colour, width in ((recorded, "0.7", 5.0), (made, "#D55E00", 1.8)):
        lines = project_bones(x, layout)
        given_side = [half is not None and width < 5 and name.startswith("L") for name in lower_ends()]
        colours = ["#0072B2" if side else colour for side in given_side]
        axes.add_collection(LineCollection(list(lines), colors=colours, linewidths=width, capstyle="round"))
    axes.set(xlim=(-0.7, 0.8), ylim=(-0.1, 1.65), aspect="equal")
    axes.axis("off")


def project_bones(x: np.ndarray, layout: Layout) -> np.ndarray:
    """Return the ends of every bone (B, 2, 2), projected to a view from the front."""
    turn = np.radians(25.0)
    across = np.array([np.cos(turn), 0.0, np.sin(turn)])
    places = {part.name: x[columns] for part, columns in zip(layout.parts, layout.slices, strict=True)}
    middle = np.array([0.36, 0.0, -0.87])  # position of the dancer
    return np.array([[(across @ (places[n] - middle), places[n][1]) for n in bone] for bone in bones()])


def bones() -> list[tuple[str, str]]:
    chains = [line.split() for line in BONES.strip().splitlines()]
    return [bone for chain in chains for bone in pairwise(chain)]


def lower_ends() -> list[str]:
    """Return the node of every bone that is farther from the hips."""
    return [bone[1] for bone in bones()]


def draw_curves(rows: Sequence[dict[str, object]]) -> Figure:
    figure = Figure(figsize=(13, 4.2), layout="constrained")
    panels = figure.subplots(1, 4)
    for label, (colour, dash, order) in zip(STRUCTURES, STYLES, strict=True):
        own = [row for row in rows if row["structure"] == label]
        K = [row["components"] for row in own]
        style = {
            "color": colour,
            "linestyle": dash,
            "zorder": order,
            "marker": "o",
            "markersize": 4,
            "label": label,
        }
        for axes, task in zip(panels, TASKS, strict=False):
            axes.plot(K, [row["mse"][task] for row in own], **style)  # type: ignore[index]
        panels[3].plot(K, [row["covariance_parameters"] for row in own], **style)
    for axes, title in zip(panels, (*TASKS.values(), "parameters of the covariances"), strict=True):
        axes.set(xlabel="components K", yscale="log")
        axes.set_title(title.replace(", ", ",\n"), fontsize=10, loc="left")
        axes.grid(True, color="0.9", which="both", linewidth=0.5)
    panels[0].set_ylabel("mean squared error [m² a coordinate]")
    panels[3].set_ylabel("numbers")
    panels[0].legend(frameon=False, fontsize=9)
    return figure


def animate(dance: Demonstration, states: int, file: Path) -> None:
    """Write an animation of the recorded and the regenerated dances."""
    skill = learn_skill(dance, "semi-tied(1)", states).skill
    trained_on_part = learn_skill(training_part(dance), "semi-tied(1)", states).skill
    made = [
        regenerate(s, dance.x, input_columns(task, dance.layout))
        for s, task in ((skill, "time"), (skill, "half"), (trained_on_part, "unseen"))
    ]
    figure = Figure(figsize=(8.4, 4.6), layout="constrained")
    panels = figure.subplots(1, 3)

    def draw(t: int) -> list[LineCollection]:
        for axes, x, task in zip(panels, made, TASKS, strict=True):
            axes.clear()
            draw_body(axes, dance.layout, dance.x[t], x[t], None if task == "time" else dance.layout)
            part = "(training)" if t < TRAINED else "(test)"
            axes.set_title(
                TASKS[task].split(",")[0] + (f"\n{part}" if task == "unseen" else "\n"), fontsize=10
            )
        figure.suptitle(
            f"{dance.x[t, 0]:4.1f} s   recorded: grey, given: blue, regenerated: orange", fontsize=10
        )
        return []

    step = 4
    animation = FuncAnimation(figure, draw, frames=range(0, POINTS, step), blit=False)
    animation.save(file, writer=PillowWriter(fps=round(1 / (step * dance.period))), dpi=80)


if __name__ == "__main__":
    main()
