"""Assistance by the protocol of table 6.1: every demonstration as operator input in every configuration.

    python reproductions/assistance.py --json assistance.json --out assistance/

Nothing is live. Of eight demonstrations, six train and two test. Each of the eight is the operator's input,
who sees the scene of that demonstration, while the robot acts in the scene of another one. The target is
compared with what the person demonstrated in that scene: over the path, row by row, and at its end. A
recording of another length is resampled to the rows of the input. Autonomous control takes over after a tenth
of the rows.

The carabiner may be hooked anywhere along the rod, and the place is random in every demonstration. Another
operator's place says nothing about it. Its table therefore also has the distance of the ends across the rod.

The table gives the mean distance [cm] and its square [cm^2] on training and test scenes, and their ratios to
direct control. The thesis prints mean squared errors "in cm" of the end for the target and of the
path for the valve. Its valve recording is known; the simulated tasks have no counterpart in it.

The skill is learned with the defaults of `pf.learn`, except that the literal variant has the printed seven
states with full covariances. The gate of the authority is calibrated on the training demonstrations alone.

Source: Tanwani 2018, section 6.5.2 and table 6.1.
"""

import argparse
import sys
from collections.abc import Sequence
from functools import cache

import numpy as np
from matplotlib.figure import Figure
from protocol import Row, argument_parser, write_figures, write_numbers
from recordings import cached_recording
from tqdm import tqdm

import pilotfish as pf
from pilotfish import assistance
from pilotfish.demonstrations import Demonstration, resample
from pilotfish.environments import TASKS
from pilotfish.geometry import normalise
from pilotfish.simulation import record_demonstrations
from pilotfish.types import Array, Float

RECORDED = "recorded valve"
NAMES = (RECORDED, "stab", "valve", "carabiner", "screwdriver")
MODES = ("direct", "literal", "carried", "autonomous", "fixture")
TRAIN, TEST = 6, 2
LITERAL_STATES = 7
SWITCH = 0.1  # share of the rows after which autonomous control begins
MEASURES = ("path", "end")
PRINTED = {  # table 6.1, train and test, mean squared errors "in cm"
    "valve": {
        "direct": (1.412, 1.261),
        "shared": (0.717, 0.721),
        "autonomous": (0.737, 0.464),
        "fixture": (2.836, 2.011),
    },
    "target": {
        "direct": (1.954, 1.959),
        "shared": (0.23, 0.31),
        "autonomous": (0.109, 0.178),
        "fixture": (0.183, 0.311),
    },
}
LIMITS = assistance.Limits(speed=2.0, acceleration=50.0, angular_speed=20.0, angular_acceleration=500.0)


def main() -> None:
    parser = argument_parser(__doc__)
    parser.add_argument("--tasks", nargs="+", default=NAMES, choices=NAMES, help="which recordings")
    parser.add_argument("--modes", nargs="+", default=MODES, choices=MODES, help="which modes")
    parser.add_argument("--seed", type=int, default=0, help="seed of the simulated demonstrations")
    arguments = parser.parse_args()
    if "direct" not in arguments.modes:
        arguments.modes = ["direct", *arguments.modes]
    rows: list[Row] = []
    for name in arguments.tasks:
        try:
            demonstrations = load_demonstrations(name, arguments.seed)
        except pf.SkillError as error:
            print(f"{name}: left out: {error}")
            continue
        print_rows(task_rows := evaluate_task(name, demonstrations, arguments))
        rows += task_rows
    print_printed_values()
    if arguments.out:
        write_figures(arguments.out, {"ratios": draw_ratios(rows)})
    if arguments.json:
        write_numbers(arguments.json, {"rows": rows, "printed": PRINTED})


def load_demonstrations(name: str, seed: int) -> tuple[Demonstration, ...]:
    """Return eight recordings of poses."""
    if name == RECORDED:
        return pf.datasets.valve()

    def make() -> list[Demonstration]:
        recordings = record_demonstrations(TASKS[name], TRAIN + TEST, seed)
        bar = tqdm(recordings, f"{name}: recording", TRAIN + TEST, disable=not sys.stderr.isatty())
        return [recording.demonstration for recording, _ in bar]

    return cached_recording(__file__, f"{name}, poses, seed {seed}", make)


def learn_skill(demonstrations: Sequence[Demonstration]) -> pf.Skill:
    """Learn a skill with the defaults."""
    return pf.learn(demonstrations, rng=np.random.default_rng(0)).skill


def make_assistant(
    training: list[Demonstration], *, literal: bool, limited: bool = False
) -> assistance.Assistant:
    """Learn the skill, its virtual fixture and the joint skill of the literal variant; calibrate the gate.

    The limits are those of the defaults, or so wide that they do not matter.
    """
    joint = None
    if literal:
        augmented = [assistance.joint_demonstration(demo) for demo in training]
        joint = pf.learn(augmented, states=LITERAL_STATES, rng=np.random.default_rng(0)).skill
    gate = assistance.calibrate_gate(training, learn_skill)
    fixture = assistance.learn_virtual_fixture(training, rng=np.random.default_rng(0))
    skill = assistance.assisted_skill(learn_skill(training), gate=gate, joint_skill=joint, fixture=fixture)
    return assistance.make_assistant([skill], limits=None if limited else LIMITS)


def evaluate_task(
    name: str, demonstrations: Sequence[Demonstration], arguments: argparse.Namespace
) -> list[Row]:
    """Return one row for each mode."""
    training = list(demonstrations[:TRAIN])
    assistants = {literal: make_assistant(training, literal=literal) for literal in (False, True)}
    rows: list[Row] = []
    for mode in arguments.modes:
        distances = all_by_all(assistants[mode == "literal"], mode, demonstrations)
        rows.append(summarise(name, mode, distances, rows[0] if rows else None))
    return rows


def all_by_all(
    assistant: assistance.Assistant, mode: str, demonstrations: Sequence[Demonstration]
) -> dict[str, Float[Array, "M M"]]:
    """Return the distances [m] of path and end for each input (row) in each scene (column)."""
    M = len(demonstrations)
    distances = {measure: np.zeros((M, M)) for measure in MEASURES}
    squares, off_rod = np.zeros((2, M, M))
    pairs = [(m, n) for m in range(M) for n in range(M)]
    for m, n in tqdm(pairs, mode, disable=not sys.stderr.isatty()):
        given = demonstrations[m]
        scene = demonstrations[n]
        if len(scene.x) != len(given.x):
            scene = resample(scene, len(given.x))
        poses = run_mode(assistant, mode, given, scene)
        d = np.linalg.norm(poses[:, :3] - scene.x[:, :3], axis=1)
        distances["path"][m, n], distances["end"][m, n] = d.mean(), d[-1]
        squares[m, n] = np.mean(d**2)
        off_rod[m, n] = distance_off_rod(poses[-1] - scene.x[-1, : poses.shape[1]], scene)
    found = {**distances, "path squared": squares, "end squared": distances["end"] ** 2}
    return {**found, "end off the rod": off_rod} if has_rod(demonstrations[0]) else found


def has_rod(demonstration: Demonstration) -> bool:
    """Return whether the object is a rod, along which the place to hook is the person's choice."""
    return [frame.name for frame in demonstration.frames] == ["rod"]


def distance_off_rod(deviation: Float[Array, " D"], scene: Demonstration) -> float:
    """Return the length of a deviation of position across the rod, the x axis of its frame [m]."""
    local = scene.frames[0].at(0).A[:3, :3].T @ deviation[:3]
    return float(np.linalg.norm(local[1:]))


def run_mode(
    assistant: assistance.Assistant, mode: str, given: Demonstration, scene: Demonstration
) -> Float[Array, "T D"]:
    """Return the targets for a demonstration as input, whose scene the operator sees, in another scene."""
    x = given.x[:, np.array(given.layout.coordinates)]
    for columns in assistant.layout.unit_quaternions:
        x[:, columns] = normalise(x[:, columns])
    observed, actual = frames_by_row(given), frames_by_row(scene)
    state, poses = assistance.initial_state(assistant, x[0], observed(0), actual(0)), []
    for t, hand in enumerate(x):
        name = "shared" if mode in ("literal", "carried") else mode
        if mode == "autonomous" and t < SWITCH * len(x):
            name = "shared"
        state, target = assistance.step_assistance(
            assistant, state, assistance.Command(hand, name), observed(t), actual(t), given.period
        )
        poses.append(target.pose)
    return np.array(poses)


def frames_by_row(demonstration: Demonstration):  # type: ignore[no-untyped-def]
    """Return a function from the row to the frames; those of a scene at rest are the same object."""
    if any(frame.is_moving for frame in demonstration.frames):
        return cache(lambda t: [frame.at(t) for frame in demonstration.frames])
    frames = list(demonstration.frames)
    return lambda _: frames


def summarise(name: str, mode: str, distances: dict[str, Float[Array, "M M"]], direct: Row | None) -> Row:
    """Return means over all inputs on training and test scenes, in cm and cm^2, and ratios to direct."""
    row: Row = {"recording": name, "mode": mode}
    for measure, values in distances.items():
        unit = 1e4 if "squared" in measure else 1e2
        for part, columns in (("train", slice(0, TRAIN)), ("test", slice(TRAIN, None))):
            row[f"{measure} {part}"] = unit * float(values[:, columns].mean())
    ratios = {
        f"{key} ratio": row[key] / (direct or row)[key] for key in list(row) if key.split()[0] in MEASURES
    }
    return {**row, **ratios}


def print_rows(rows: Sequence[Row]) -> None:
    print(
        f"\n{rows[0]['recording']}: distance [cm] and squared distance [cm^2], train / test (ratio of test)"
    )
    for row in rows:
        cells = []
        for measure in ("path", "path squared", "end", "end squared", "end off the rod"):
            if f"{measure} train" not in row:
                continue
            train, test = row[f"{measure} train"], row[f"{measure} test"]
            cells.append(f"{measure} {train:7.2f} / {test:7.2f} ({row[f'{measure} test ratio']:.2f})")
        print(f"  {row['mode']:10}  " + "   ".join(cells), flush=True)


def print_printed_values() -> None:
    print('\nprinted, "in cm", train / test (ratio of test to direct)')
    for task, modes in PRINTED.items():
        for mode, (train, test) in modes.items():
            print(f"  {task:6}  {mode:10}  {train:.3f} / {test:.3f} ({test / modes['direct'][1]:.2f})")


def draw_ratios(rows: Sequence[Row]) -> Figure:
    """Return bars of the ratio to direct control on test scenes, of path and end."""
    figure = Figure(figsize=(9.0, 3.5), layout="constrained")
    for axes, measure in zip(figure.subplots(1, 2, sharey=True), MEASURES, strict=True):
        names = list(dict.fromkeys(row["recording"] for row in rows))
        modes = [mode for mode in MODES[1:] if any(row["mode"] == mode for row in rows)]
        for n, mode in enumerate(modes):
            ratios = [row[f"{measure} test ratio"] for row in rows if row["mode"] == mode]
            axes.bar(np.arange(len(names)) + 0.2 * (n - 1.5), ratios, 0.18, label=mode)
        axes.axhline(1.0, color="black", linewidth=0.8)
        axes.set(xticks=np.arange(len(names)), xticklabels=names, ylabel=f"{measure}, relative to direct")
        axes.tick_params(axis="x", rotation=20)
        axes.legend()
    return figure


if __name__ == "__main__":
    main()
