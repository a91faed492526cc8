"""Held-out demonstrations: pilotfish at defaults, ProMP, DMP, GMR, and the mean of the demonstrations.

    python reproductions/peers.py --json peers.json --out peers/ --only robotasks "letters a"
    python reproductions/peers.py --markdown docs/how-good-is-it.md

Protocol: each demonstration is held out once, and every method learns from the others. It is then given the
start and the end of the held-out demonstration, and its number of steps. pilotfish has both as frames, the
start also as its first state, with the mean velocity of the others. The end of the valve is not known: there
pilotfish has the frames of the valve before and after, and the others, which take one coordinate system,
learn in that of the valve after, with the mean end in it. Recordings of 1000 rows are resampled to 200;
ProMP, DMP, GMR and the mean learn from rows at equal shares of the time.

Settings: benchmarks/motion_peers.py. Those of ProMP were chosen on these recordings; pilotfish has its
defaults. GMR takes no start and end, so it has the offsets of the mean: the differences at start and end,
fading linearly. The peers are installed into build/peers-motions-venv.
"""

import inspect
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from motion_measures import (
    extent,
    mean_angle,
    mean_distance,
    mean_with_offsets,
    relative_size,
    shift_ends,
)
from peer_recordings import Split, load_recordings, splits
from peer_tables import markdown_tables, print_table, replace_tables
from protocol import argument_parser, write_figures, write_numbers

import pilotfish as pf
from pilotfish.planning import time_warped_distance

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"
sys.path.append(str(BENCHMARKS))
from peer_environment import environment_folder, execute, peer_environment  # noqa: E402 - in that folder
from workers import timed_environment  # noqa: E402

OURS, MEAN = "pilotfish", "mean + offsets"
PEERS = ("ProMP", "DMP", "GMR")
STATES = 20  # while `pf.learn` has no default
MILLIMETRES, PERCENT = 1e3, 1e2
NOTES = (
    "distances are in mm for poses, and in % of the diagonal of the demonstration's bounding box for letters",
    "size: root-mean-square distance of the motion from its mean, in % of the demonstration's",
    "force: mean absolute error in % of the demonstration's range",
)


@dataclass(frozen=True, slots=True)
class Measures:
    """Measures of one method, the mean over held-out demonstrations.

    Attributes:
        mean: Mean distance at the same time.
        warped: Mean distance after dynamic time warping.
        end: Distance of the last points.
        degrees: Mean angle between orientations [deg]; None without orientations.
        size: Size relative to the demonstration [%].
        force: Mean absolute error of the force [% of its range]; None without force.
        seconds: Time of learning [CPU s].
    """

    mean: float
    warped: float
    end: float
    degrees: float | None
    size: float
    force: float | None
    seconds: float


@dataclass(frozen=True, slots=True, eq=False)
class Answer:
    """Motion of a method in world coordinates, and its time of learning [CPU s]."""

    x: np.ndarray
    seconds: float


Answers = dict[str, dict[str, Answer]]  # by split and method


def main() -> None:
    parser = argument_parser(__doc__)
    parser.add_argument("--data", type=Path, help="folder of recordings (default: PILOTFISH_DATA)")
    parser.add_argument("--only", nargs="+", default=[], help="these recordings or groups (default: all)")
    parser.add_argument("--markdown", type=Path, help="page whose tables are replaced")
    arguments = parser.parse_args()
    if arguments.data:
        os.environ["PILOTFISH_DATA"] = str(arguments.data)
    try:
        recordings = load_recordings(arguments.only)
    except pf.SkillError as error:
        parser.exit(1, f"{error}\n")
    parts = {recording.name: splits(recording) for recording in recordings}
    answers, notes, versions = compare([part for found in parts.values() for part in found])
    rows = [row for found in parts.values() for row in table_rows(found, answers)]
    print_table(rows)
    for note in notes:
        print(f"note: {note}")
    if arguments.markdown:
        try:
            replace_tables(arguments.markdown, markdown_tables(rows))
        except (OSError, pf.SkillError) as error:
            parser.exit(1, f"{error}\n")
    if arguments.out:
        write_figures(arguments.out, {name: draw(found[0], answers) for name, found in parts.items()})
        print(f"pictures in {arguments.out}")
    if arguments.json:
        write_numbers(arguments.json, {"rows": rows, "notes": notes, "versions": versions})


def compare(found: Sequence[Split]) -> tuple[Answers, list[str], dict[str, str]]:
    """Return the motions of all methods, notes, and versions of pilotfish and the peers."""
    replies, missing, versions = peer_answers(found)
    answers = {part.name: {OURS: ours(part)} | replies[part.name] | {MEAN: mean(part)} for part in found}
    notes = [*NOTES, *(f"{method} is left out: {reason}" for method, reason in missing.items())]
    return answers, notes, {OURS: pf.__version__} | versions


def ours(part: Split) -> Answer:
    """Learn and reproduce with pilotfish at its defaults."""
    given: dict[str, Any] = {}
    if inspect.signature(pf.learn).parameters["states"].default is inspect.Parameter.empty:
        given = {"states": STATES, "structure": pf.structures.Diagonal()}
    before = time.process_time()
    fit = pf.learn(part.training, rng=np.random.default_rng(0), **given)
    seconds = time.process_time() - before
    x = pf.reproduce(fit.skill, part.test.frames, start_state(part), horizon=len(part.test.x)).motion.x
    return Answer(part.unit_quaternions(x[:, : part.recording.width]), seconds)


def start_state(part: Split) -> np.ndarray:
    """Return the held-out first row, with the mean derivatives of the training demonstrations.

    The derivatives of that row are differences to the next one, which the other methods are not given.
    """
    width = part.recording.width
    rates = np.mean([d.x[0, width:] for d in part.training], axis=0)
    return np.concatenate([part.test.x[0, :width], rates])


def mean(part: Split) -> Answer:
    """Return the mean of the demonstrations with offsets; it has no time of learning beyond the mean."""
    before = time.process_time()
    local = mean_with_offsets(part.local_training, *part.local_ends)
    return Answer(part.to_world(local), time.process_time() - before)


def peer_answers(found: Sequence[Split]) -> tuple[Answers, dict[str, str], dict[str, str]]:
    """Return motions of the peers, the reason for each that is missing, and versions of their packages."""
    python, failures = peer_environment(*environment_folder("peers-motions"), execute)
    tasks = {f"{part.name}/{field}": value for part in found for field, value in task(part).items()}
    try:
        reply, motions = run_peers(python, tasks)
    except (OSError, subprocess.CalledProcessError) as error:
        reason = "; ".join([f"their process failed: {error}", *failures.values()])
        return {part.name: {} for part in found}, dict.fromkeys(PEERS, reason), {}
    answers = {
        part.name: {
            method: Answer(world_motion(part, method, motions[f"{part.name}/{method}"]), seconds[part.name])
            for method, seconds in reply["seconds"].items()
        }
        for part in found
    }
    missing = {
        method: f"{reason}; {failures[package]}" if (package := reason.split()[0]) in failures else reason
        for method, reason in reply["missing"].items()
    }
    return answers, missing, reply["versions"]


def run_peers(python: Path, tasks: dict[str, np.ndarray]) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Return the reply of the peers' process, and their motions."""
    with tempfile.TemporaryDirectory() as folder:
        files = [str(Path(folder) / name) for name in ("tasks.npz", "motions.npz")]
        np.savez(files[0], **tasks)  # type: ignore[arg-type] # NumPy's stubs: a dict may hold allow_pickle
        command = [str(python), "-W", "ignore", str(BENCHMARKS / "motion_peers.py"), *files]
        done = subprocess.run(command, stdout=subprocess.PIPE, text=True, env=timed_environment(), check=True)
        with np.load(files[1]) as loaded:
            return json.loads(done.stdout.splitlines()[-1]), {name: loaded[name] for name in loaded.files}


def task(part: Split) -> dict[str, np.ndarray]:
    """Return what the peers are given."""
    return {
        "training": part.local_training,
        "ends": part.local_ends,
        "pose": np.array(part.recording.is_pose),
    }


def world_motion(part: Split, method: str, local: np.ndarray) -> np.ndarray:
    """Return the motion of a peer in world coordinates; GMR has the offsets of the mean."""
    return part.to_world(shift_ends(local, *part.local_ends) if method == "GMR" else local)


def measure(part: Split, answer: Answer) -> Measures:
    """Return the measures of one motion."""
    P, x, y = part.recording.position, answer.x, part.x
    unit = MILLIMETRES if part.recording.is_pose else PERCENT / extent(y[:, :P])
    force = None
    if part.recording.has_force:
        force = PERCENT * float(np.abs(x[:, P] - y[:, P]).mean() / np.ptp(y[:, P]))
    return Measures(
        mean=unit * mean_distance(x[:, :P], y[:, :P]),
        warped=unit * time_warped_distance(x[:, :P], y[:, :P]),
        end=unit * float(np.linalg.norm(x[-1, :P] - y[-1, :P])),
        degrees=mean_angle(x[:, P : P + 4], y[:, P : P + 4]) if part.recording.is_pose else None,
        size=PERCENT * relative_size(x[:, :P], y[:, :P]),
        force=force,
        seconds=answer.seconds,
    )


def table_rows(found: Sequence[Split], answers: Answers) -> list[dict[str, Any]]:
    """Return one row for each method: the means over the held-out demonstrations of a recording."""
    recording = found[0].recording
    rows = []
    for method in answers[found[0].name]:
        measures = [asdict(measure(part, answers[part.name][method])) for part in found]
        means = {
            name: None if measures[0][name] is None else float(np.mean([m[name] for m in measures]))
            for name in measures[0]
        }
        unit = "mm" if recording.is_pose else "%"
        rows.append({"recording": recording.name, "method": method, "unit": unit} | means)
    return rows


def draw(part: Split, answers: Answers) -> Figure:
    """Draw the motions of all methods for a held-out demonstration."""
    figure = Figure(figsize=(7, 6), layout="constrained")
    axes = figure.add_subplot()
    columns, unit = part.recording.position, "m" if "letters" not in part.recording.name else "1"
    first, second = (0, 1) if columns == 2 else tuple(np.argsort(np.ptp(part.x[:, :3], axis=0))[::-1][:2])
    for k, demonstration in enumerate(part.training):
        label = "demonstrations to learn from" if k == 0 else None
        axes.plot(*demonstration.x[:, [first, second]].T, color="0.85", linewidth=0.8, label=label)
    axes.plot(*part.x[:, [first, second]].T, color="0.2", linewidth=2.0, label="held-out demonstration")
    for k, (method, answer) in enumerate(answers[part.name].items()):
        colour = pf.plots.state_colour(k)
        axes.plot(*answer.x[:, [first, second]].T, color=colour, linewidth=1.3, label=method)
    names = "xyz"
    axes.set(
        xlabel=f"{names[first]} [{unit}]",
        ylabel=f"{names[second]} [{unit}]",
        title=part.name,
        aspect="equal",
    )
    axes.legend(fontsize=8)
    return figure


if __name__ == "__main__":
    main()
