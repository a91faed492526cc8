"""Pick and place over an obstacle: figure 4.7 and the lower half of table 4.1, on demonstrations of our own.

    python reproductions/pick_and_place.py --json pick_and_place.json --out pick_and_place/

The thesis' recording was never published. Here a simulated person leads the left arm of a simulated Baxter,
the right one follows, and the printed numbers stand beside ours for their order and size, not as a target:
that ours are smaller tells of the person that was simulated, not of a robot.

Protocol of the table, as printed: eight demonstrations with the obstacle at levels 0 to 7, one after another,
each with the plate elsewhere; the first, third, fifth and seventh train, the others test; 200 datapoints of
position, quaternion and the derivative of each, D = 14; two frames, the plate where it lay and the obstacle;
K = 7. As in valve.py, for the thesis does not say it here: beginning with time bins, regularisation 1e-5,
Q = (Sigma + 2e-3 I)^-1, R = 9 I, two semi-tied sweeps in each M-step, the mean squared difference of the
seven pose coordinates, from the first state's mean and from the demonstration's own start. A showing takes 16
to 20 s here; every demonstration is stretched to 200 rows of 0.1 s.

Then, what the thesis shows in photographs: the same three structures learned with the column of the grip, and
carried out in physics in the four test situations and in 16 with plates and levels never shown; below level 0
and above 6 the skill extrapolates. "protocol" learns as above; so learned, the skill misses the plate or the
cross, or pushes the obstacle, in half of the situations or more (seeds 1 and 2), where the thesis says that
it generalises. "heard" has 12 states, regularisation and slack 1e-6, and hears a frame at a state as much as
held-out training demonstrations say (models.relevance).
That was chosen on seeds 0 and 3, by what plans would do, for the skill with alpha 1; for the others it need
not be best. Seed 1, the default, had been carried out before, without relevance and with other numbers of
states; seed 2 had no part in the choice.

Source: Tanwani 2018, section 4.3.2, figure 4.7 and table 4.1.
"""

import argparse
import json
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from recordings import recorded_once
from tqdm import tqdm

import pilotfish as pf
from pilotfish.demonstrations import Demonstration, Frame, Layout, resampled
from pilotfish.environments import Marks
from pilotfish.environments.tasks.plate import (
    BAR,
    HALF,
    PLATE,
    TABLE,
    PlateSituation,
    cross,
    obstacle_at,
    situation_at,
)
from pilotfish.errors import SkillError
from pilotfish.gaussians import DenseCovariances, Structure
from pilotfish.geometry import rotation_matrix
from pilotfish.models import covariance_parameters, relevance
from pilotfish.plots.ellipses import draw_ellipses
from pilotfish.station.evaluation import mean_squared_error, replay, replay_from_mean
from pilotfish.station.execution import Execution, Pursuit, execute
from pilotfish.station.films import Camera, strip
from pilotfish.station.recorder import PERSON, SHOWN, TRIES, UNSEEN, record, simulated
from pilotfish.types import Array, Float

PRINTED = ("train_mse", "test_mse", "covariance_parameters", "fit_seconds")
THESIS = {  # table 4.1: train and test mean squared error, covariance parameters, seconds of training
    0.0: (0.0023, 0.0138, 1470, 2.21),
    0.5: (0.0028, 0.0129, 1470, 4.73),
    1.0: (0.0033, 0.0127, 588, 10.21),
}
STATES, HORIZON, PERIOD, POSE = 7, 200, 0.1, 7
LEVELS = range(8)
LOWEST, HIGHEST = 0, 6  # levels that train; others outside are extrapolated to
NEW = (1, 3, 5, -1, 7, 8, 1, 3, 5, 7, 8, 1, 3, 5, -1, 9)  # levels of the situations that nobody showed
TIMED_FITS = 9
LEAST = 1e-6  # power of a frame that is not heard
FIGURED, PLANE = 1.0, (1, 2)  # the structure that figure 4.7 shows; y and z


@dataclass(frozen=True, slots=True)
class Way:
    """How a skill that is to be carried out is learned and followed; heard: frames by their relevance."""

    name: str
    states: int
    regularisation: float
    slack: float
    heard: bool


WAYS = (Way("protocol", STATES, 1e-5, 1e-5, heard=False), Way("heard", 12, 1e-6, 1e-6, heard=True))


@dataclass(frozen=True, slots=True, eq=False)
class Showing:
    """What was shown where."""

    where: PlateSituation
    demonstration: Demonstration


@dataclass(frozen=True, slots=True)
class Row:
    """A skill carried out in situations of one kind. error [m] is the median; push [N] the largest."""

    way: str
    alpha: float
    situations: str
    levels: list[int]
    succeeded: int
    error: float
    touched: int
    push: float
    failures: list[str]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", type=Path, help="file for the numbers")
    parser.add_argument("--out", type=Path, help="folder for the pictures")
    parser.add_argument("--situations", type=int, default=len(NEW), help="how many that nobody showed")
    parser.add_argument("--seed", type=int, default=1, help="seed of demonstrations and situations")
    asked = parser.parse_args()
    bar = tqdm(LEVELS, "showing", leave=False, disable=not sys.stderr.isatty())
    try:
        showings = [showing(level, asked.seed) for level in bar]
    except SkillError as error:
        parser.exit(1, f"{error}\n")
    poses = [pf.with_derivatives(without_grip(shown.demonstration)) for shown in showings]
    fits = {alpha: learned(poses[::2], structure(alpha)) for alpha in THESIS}
    table = [table_row(alpha, fits[alpha], poses) for alpha in THESIS]
    print_table(table)
    tried = groups(showings, asked.seed, asked.situations)
    rows = [row for way in WAYS for alpha in THESIS for row in carried_out(way, alpha, showings, tried)]
    print_rows(rows)
    if asked.out:
        asked.out.mkdir(parents=True, exist_ok=True)
        figure_4_7(fits[FIGURED].skill, showings, poses).savefig(asked.out / "figure-4.7.png", dpi=110)
        filmed(showings, tried).savefig(asked.out / "execution.png", dpi=110)
        print(f"pictures in {asked.out}")
    if asked.json:
        asked.json.parent.mkdir(parents=True, exist_ok=True)
        numbers = {"simulated": True, "rows": table, "physics": [asdict(row) for row in rows]}
        asked.json.write_text(json.dumps(numbers, indent=2) + "\n")


def showing(level: int, seed: int) -> Showing:
    """The work shown with the obstacle at that level, again with another hand until it is done.

    Raises: SkillError, when it fails again and again.
    """
    where = situation_at(level, np.random.default_rng([seed, SHOWN, level]))

    def make() -> list[Demonstration]:
        for attempt in range(TRIES):
            rng = np.random.default_rng([seed, SHOWN, level, attempt])
            made = record(PLATE, where, simulated(PLATE, where, PERSON, rng), f"level {level}")
            if made.verdict.success:
                return [made.demonstration]
        raise SkillError(f"level {level} failed {TRIES} times, the last because {made.verdict.why}")

    (demonstration,) = recorded_once(__file__, f"level {level}, seed {seed}", make)
    return Showing(where, stretched(demonstration))


def stretched(shown: Demonstration) -> Demonstration:
    """The same way in 200 rows of 0.1 s: slower or faster than it was shown."""
    rows = resampled(shown, HORIZON)
    return pf.demonstration(rows.x, PERIOD, rows.layout, rows.frames, rows.name)


def without_grip(shown: Demonstration) -> Demonstration:
    """The pose alone, and frames of a pose."""
    layout = Layout(shown.layout.parts[:2])
    frames = [Frame(f.name, f.A[:POSE, :POSE], f.b[:POSE]) for f in shown.frames if isinstance(f, Frame)]
    return pf.demonstration(shown.x[:, :POSE], shown.period, layout, frames, shown.name)


def structure(alpha: float) -> Structure:
    return pf.SemiTied(alpha) if alpha else pf.Full()


def learned(
    demonstrations: Sequence[Demonstration],
    structure: Structure,
    states: int = STATES,
    regularisation: float = 1e-5,
) -> pf.Fit:
    settings = pf.EMSettings(regularisation=regularisation)
    rng = np.random.default_rng(0)
    return pf.learn(demonstrations, states=states, rng=rng, structure=structure, settings=settings)


def mean_error(skill: pf.Skill, demonstrations: Sequence[Demonstration], *, own_start: bool = False) -> float:
    again = replay if own_start else replay_from_mean
    return float(np.mean([mean_squared_error(again(skill, d).motion, d) for d in demonstrations]))


def table_row(alpha: float, fit: pf.Fit, demonstrations: Sequence[Demonstration]) -> dict[str, object]:
    train, test = demonstrations[::2], demonstrations[1::2]
    spent = []
    for _ in range(TIMED_FITS):
        begin = time.process_time()
        learned(train, structure(alpha))
        spent.append(time.process_time() - begin)
    return {
        "alpha": alpha,
        "train_mse": mean_error(fit.skill, train),
        "test_mse": mean_error(fit.skill, test),
        "train_mse_own_start": mean_error(fit.skill, train, own_start=True),
        "test_mse_own_start": mean_error(fit.skill, test, own_start=True),
        "covariance_parameters": covariance_parameters(structure(alpha), STATES, fit.skill.width, frames=2),
        "fit_seconds": float(np.median(spent)),
        "iterations": fit.outcome.iterations,
        "converged": fit.outcome.converged,
        "thesis": dict(zip(PRINTED, THESIS[alpha], strict=True)),
    }


def print_table(rows: Sequence[dict[str, object]]) -> None:
    print("table 4.1, pick and place, on simulated demonstrations: mean squared error")
    print("(in brackets the thesis, on a recording of its own)")
    print("alpha             train             test    own start: train  test   parameters     CPU seconds")
    for row in rows:
        train, test, parameters, seconds = THESIS[float(str(row["alpha"]))]
        cells = (
            f"{row['alpha']:>5}",
            f"{row['train_mse']:>9.5f} ({train:.4f})",
            f"{row['test_mse']:.5f} ({test:.4f})",
            f"{row['train_mse_own_start']:>15.5f} {row['test_mse_own_start']:.5f}",
            f"{row['covariance_parameters']:>5} ({parameters})",
            f"{row['fit_seconds']:>6.3f} ({seconds:.2f})",
        )
        print("  ".join(cells))


def groups(showings: Sequence[Showing], seed: int, number: int) -> dict[str, list[PlateSituation]]:
    """Where skills are carried out: where they were tested, and where nobody showed anything."""
    new = [
        situation_at(level, np.random.default_rng([seed, UNSEEN, n])) for n, level in enumerate(NEW[:number])
    ]
    beyond = [where for where in new if not LOWEST <= where.level <= HIGHEST]
    return {
        "tests": [shown.where for shown in showings[1::2]],
        "new, between": [where for where in new if LOWEST <= where.level <= HIGHEST],
        "new, beyond": beyond,
    }


def to_carry_out(way: Way, alpha: float, showings: Sequence[Showing]) -> pf.Skill:
    """A skill with the grip, of the training demonstrations."""
    train = [pf.with_derivatives(shown.demonstration) for shown in showings[::2]]
    skill = learned(train, structure(alpha), way.states, way.regularisation).skill
    return heard(skill, relevance(skill, train).values) if way.heard else skill


def heard(skill: pf.Skill, powers: Float[Array, "P K"]) -> pf.Skill:
    """The skill that adapts, without being told, as this one does with these powers of its frames."""
    covariances = [
        DenseCovariances(c.dense / np.maximum(power, LEAST)[:, None, None])
        for c, power in zip(skill.covariances, powers, strict=True)
    ]
    return replace(skill, covariances=tuple(covariances))


def carried_out(
    way: Way, alpha: float, showings: Sequence[Showing], tried: dict[str, list[PlateSituation]]
) -> Iterator[Row]:
    skill = to_carry_out(way, alpha, showings)
    for name, situations in tried.items():
        label = f"{way.name}, alpha {alpha}: {name}"
        bar = tqdm(situations, label, leave=False, disable=not sys.stderr.isatty())
        pursuit = Pursuit(slack=way.slack, horizon=HORIZON)
        done = [execute(skill, PLATE, where, pursuit=pursuit) for where in bar]
        if done:
            yield _row(way, alpha, (name, situations), done)


def _row(way: Way, alpha: float, where: tuple[str, list[PlateSituation]], done: Sequence[Execution]) -> Row:
    name, situations = where
    pushes = [max(made.peaks.get(thing, 0.0) for thing in PLATE.fragile) for made in done]
    return Row(
        way=way.name,
        alpha=alpha,
        situations=name,
        levels=[w.level for w in situations],
        succeeded=sum(made.verdict.success for made in done),
        error=float(np.median([made.verdict.error for made in done])),
        touched=sum(push > 0.0 for push in pushes),
        push=max(pushes),
        failures=[
            f"level {w.level}: {made.verdict.why}"
            for w, made in zip(situations, done, strict=True)
            if not made.verdict.success
        ],
    )


def print_rows(rows: Sequence[Row]) -> None:
    print("carried out in physics")
    print("way       alpha  situations          done   median error  touched  largest push")
    for row in rows:
        done = f"{row.succeeded:>2} of {len(row.levels):<2}"
        told = f"{row.error:>11.4f} m  {row.touched:>7}  {row.push:>9.1f} N"
        print(f"{row.way:<9} {row.alpha:>5}  {row.situations:<16} {done:>8}  {told}")
        for failure in row.failures:
            print(f"    {failure}")


def figure_4_7(skill: pf.Skill, showings: Sequence[Showing], poses: Sequence[Demonstration]) -> Figure:
    """Reproductions from the side: of what was shown above, of what was held out below."""
    figure = Figure(figsize=(13.0, 5.2), layout="constrained")
    panels = figure.subplots(2, len(showings) // 2, sharex=True, sharey=True)
    for row, kind in enumerate(("training", "test")):
        chosen = zip(showings[row::2], poses[row::2], strict=True)
        for axes, (shown, pose) in zip(panels[row], chosen, strict=True):
            draw(axes, skill, shown.where, pose)
            axes.set_title(f"{kind}, obstacle at level {shown.where.level}", fontsize=10)
    for axes in panels[-1]:
        axes.set_xlabel("y [m]")
    for axes in panels[:, 0]:
        axes.set_ylabel("z [m]")
    handles = panels[0, 0].get_legend_handles_labels()
    figure.legend(*handles, loc="outside lower center", ncols=len(handles[1]), frameon=False)
    return figure


def draw(axes: Axes, skill: pf.Skill, where: PlateSituation, pose: Demonstration) -> None:
    """One situation: the bar's cross-section, the plate where it lay, the cross, and the way between."""
    done = replay(skill, pose)
    draw_ellipses(axes, done.skill.means, done.skill.covariances, PLANE, "adapted")
    axes.plot(*pose.x[:, PLANE].T, color="0.5", linestyle="--", linewidth=1.4, label="demonstration")
    axes.plot(*done.motion.x[:, PLANE].T, color="black", linewidth=1.6, label="reproduction")
    _, y, z = obstacle_at(where.level).position
    corner, size = (y - BAR[1], z - BAR[2]), (2 * BAR[1], 2 * BAR[2])
    axes.add_patch(Rectangle(corner, *size, color="#DDAA33", label="obstacle"))
    half = float(np.abs(rotation_matrix(where.plate.quaternion)[1, :2]) @ HALF[:2])
    ends = where.plate.position[1] + np.array([-half, half])
    axes.plot(ends, [where.plate.position[2]] * 2, color="#44AACC", linewidth=4, label="plate")
    axes.plot(*cross().position[1:], color="#117733", marker="x", markersize=9, linestyle="", label="cross")
    axes.axhline(TABLE, color="0.7", linewidth=0.8)
    axes.set_aspect("equal")
    axes.spines[["top", "right"]].set_visible(False)


def filmed(showings: Sequence[Showing], tried: dict[str, list[PlateSituation]]) -> Figure:
    """Six moments of the skill at work where the obstacle stands highest among the tests."""
    way = WAYS[-1]
    skill = to_carry_out(way, FIGURED, showings)
    where = max(tried["tests"], key=lambda w: w.level)
    pursuit = Pursuit(slack=way.slack, horizon=HORIZON)
    path = execute(skill, PLATE, where, pursuit=pursuit).asked[:, :3]
    camera = Camera(PLATE.name, marks=Marks(path=path))
    execute(skill, PLATE, where, pursuit=pursuit, watch=camera)
    camera.close()
    return strip(camera.frames, camera.times)


if __name__ == "__main__":
    main()
