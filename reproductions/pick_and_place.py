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
from protocol import reproduce_published
from recordings import cached_recording
from tqdm import tqdm

import pilotfish as pf
from pilotfish.demonstrations import Demonstration, Frame, Layout, resample
from pilotfish.environments.human import HumanModel
from pilotfish.environments.tasks import plate
from pilotfish.errors import SkillError
from pilotfish.gaussians.structures import CovarianceStructure, DenseCovariances
from pilotfish.geometry import rotation_matrix
from pilotfish.models import relevance
from pilotfish.planning import mean_squared_error
from pilotfish.plots.ellipses import draw_ellipses
from pilotfish.simulation import (
    ExecutionResult,
    FilmRecorder,
    film_strip,
    perform,
    record,
    simulated_leader,
)
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
NEW_LEVELS = (1, 3, 5, -1, 7, 8, 1, 3, 5, 7, 8, 1, 3, 5, -1, 9)  # levels of the situations that nobody showed
TIMED_FITS = 9
MAX_ATTEMPTS = 5  # of one demonstration
DEMONSTRATION_STREAM, TEST_STREAM = 1, 2  # of random numbers
MIN_VARIANCE = 1e-6  # power of a frame that is not heard
FIGURE_ALPHA, PLANE = 1.0, (1, 2)  # the structure that figure 4.7 shows; y and z


@dataclass(frozen=True, slots=True)
class Method:
    """How a skill that is to be carried out is learned and followed; heard: frames by their relevance."""

    name: str
    states: int
    regularisation: float
    covariance_regularisation: float
    weighted: bool


METHODS = (
    Method("protocol", STATES, 1e-5, 1e-5, weighted=False),
    Method("heard", 12, 1e-6, 1e-6, weighted=True),
)


@dataclass(frozen=True, slots=True, eq=False)
class SituationDemonstration:
    """What was shown where."""

    where: plate.PlateSituation
    demonstration: Demonstration


@dataclass(frozen=True, slots=True)
class Row:
    """A skill carried out in situations of one kind. error [m] is the median; push [N] the largest."""

    method: str
    alpha: float
    situations: str
    levels: list[int]
    succeeded: int
    error: float
    contacts: int
    max_force: float
    failures: list[str]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", type=Path, help="file for the numbers")
    parser.add_argument("--out", type=Path, help="folder for the pictures")
    parser.add_argument("--situations", type=int, default=len(NEW_LEVELS), help="how many that nobody showed")
    parser.add_argument("--seed", type=int, default=1, help="seed of demonstrations and situations")
    asked = parser.parse_args()
    bar = tqdm(LEVELS, "showing", leave=False, disable=not sys.stderr.isatty())
    try:
        demonstrations_by_situation = [record_demonstration(level, asked.seed) for level in bar]
    except SkillError as error:
        parser.exit(1, f"{error}\n")
    poses = [pf.add_derivatives(drop_grip(shown.demonstration)) for shown in demonstrations_by_situation]
    fits = {alpha: learn_skill(poses[::2], structure(alpha)) for alpha in THESIS}
    table = [table_row(alpha, fits[alpha], poses) for alpha in THESIS]
    print_table(table)
    tried = group_situations(demonstrations_by_situation, asked.seed, asked.situations)
    rows = [
        row
        for method in METHODS
        for alpha in THESIS
        for row in execute_skill(method, alpha, demonstrations_by_situation, tried)
    ]
    print_rows(rows)
    if asked.out:
        asked.out.mkdir(parents=True, exist_ok=True)
        figure_4_7(fits[FIGURE_ALPHA].skill, demonstrations_by_situation, poses).savefig(
            asked.out / "figure-4.7.png", dpi=110
        )
        record_film(demonstrations_by_situation, tried).savefig(asked.out / "execution.png", dpi=110)
        print(f"pictures in {asked.out}")
    if asked.json:
        asked.json.parent.mkdir(parents=True, exist_ok=True)
        numbers = {"simulated": True, "rows": table, "physics": [asdict(row) for row in rows]}
        asked.json.write_text(json.dumps(numbers, indent=2) + "\n")


def record_demonstration(level: int, seed: int) -> SituationDemonstration:
    """The work shown with the obstacle at that level, again with another hand until it is done.

    Raises: SkillError, when it fails again and again.
    """
    where = plate.situation_for_level(level, np.random.default_rng([seed, DEMONSTRATION_STREAM, level]))

    def make() -> list[Demonstration]:
        for attempt in range(MAX_ATTEMPTS):
            rng = np.random.default_rng([seed, DEMONSTRATION_STREAM, level, attempt])
            made = record(
                plate.PLATE, where, simulated_leader(plate.PLATE, where, HumanModel(), rng), f"level {level}"
            )
            if made.outcome.success:
                return [made.demonstration]
        raise SkillError(f"level {level} failed {MAX_ATTEMPTS} times, the last because {made.outcome.reason}")

    (demonstration,) = cached_recording(__file__, f"level {level}, seed {seed}", make)
    return SituationDemonstration(where, resample_to_horizon(demonstration))


def resample_to_horizon(shown: Demonstration) -> Demonstration:
    """The same way in 200 rows of 0.1 s: slower or faster than it was shown."""
    rows = resample(shown, HORIZON)
    return pf.demonstration(rows.x, PERIOD, rows.layout, rows.frames, rows.name)


def drop_grip(shown: Demonstration) -> Demonstration:
    """The pose alone, and frames of a pose."""
    layout = Layout(shown.layout.parts[:2])
    frames = [Frame(f.name, f.A[:POSE, :POSE], f.b[:POSE]) for f in shown.frames if isinstance(f, Frame)]
    return pf.demonstration(shown.x[:, :POSE], shown.period, layout, frames, shown.name)


def structure(alpha: float) -> CovarianceStructure:
    return pf.structures.SemiTied(alpha) if alpha else pf.structures.Full()


def learn_skill(
    demonstrations: Sequence[Demonstration],
    structure: CovarianceStructure,
    states: int = STATES,
    regularisation: float = 1e-5,
) -> pf.models.Fit:
    settings = pf.models.EMSettings(regularisation=regularisation)
    rng = np.random.default_rng(0)
    return pf.learn(demonstrations, states=states, rng=rng, structure=structure, settings=settings)


def mean_error(skill: pf.Skill, demonstrations: Sequence[Demonstration], *, own_start: bool = False) -> float:
    return float(
        np.mean(
            [
                mean_squared_error(reproduce_published(skill, d, from_first_state=not own_start).motion, d)
                for d in demonstrations
            ]
        )
    )


def table_row(alpha: float, fit: pf.models.Fit, demonstrations: Sequence[Demonstration]) -> dict[str, object]:
    train, test = demonstrations[::2], demonstrations[1::2]
    spent = []
    for _ in range(TIMED_FITS):
        begin = time.process_time()
        learn_skill(train, structure(alpha))
        spent.append(time.process_time() - begin)
    return {
        "alpha": alpha,
        "train_mse": mean_error(fit.skill, train),
        "test_mse": mean_error(fit.skill, test),
        "train_mse_own_start": mean_error(fit.skill, train, own_start=True),
        "test_mse_own_start": mean_error(fit.skill, test, own_start=True),
        "covariance_parameters": 2 * structure(alpha).parameter_count(STATES, fit.skill.width),
        "fit_seconds": float(np.median(spent)),
        "iterations": fit.convergence.iterations,
        "converged": fit.convergence.converged,
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


def group_situations(
    demonstrations_by_situation: Sequence[SituationDemonstration], seed: int, number: int
) -> dict[str, list[plate.PlateSituation]]:
    """Where skills are carried out: where they were tested, and where nobody showed anything."""
    new = [
        plate.situation_for_level(level, np.random.default_rng([seed, TEST_STREAM, n]))
        for n, level in enumerate(NEW_LEVELS[:number])
    ]
    beyond = [where for where in new if not LOWEST <= where.level <= HIGHEST]
    return {
        "tests": [shown.where for shown in demonstrations_by_situation[1::2]],
        "new, between": [where for where in new if LOWEST <= where.level <= HIGHEST],
        "new, beyond": beyond,
    }


def learn_for_execution(
    method: Method, alpha: float, demonstrations_by_situation: Sequence[SituationDemonstration]
) -> pf.Skill:
    """A skill with the grip, of the training demonstrations."""
    train = [pf.add_derivatives(shown.demonstration) for shown in demonstrations_by_situation[::2]]
    skill = learn_skill(train, structure(alpha), method.states, method.regularisation).skill
    return weighted(skill, relevance(skill, train).values) if method.weighted else skill


def weighted(skill: pf.Skill, powers: Float[Array, "P K"]) -> pf.Skill:
    """The skill that adapts, without being told, as this one does with these powers of its frames."""
    covariances = [
        DenseCovariances(c.dense / np.maximum(power, MIN_VARIANCE)[:, None, None])
        for c, power in zip(skill.covariances, powers, strict=True)
    ]
    return replace(skill, covariances=tuple(covariances))


def execute_skill(
    method: Method,
    alpha: float,
    demonstrations_by_situation: Sequence[SituationDemonstration],
    tried: dict[str, list[plate.PlateSituation]],
) -> Iterator[Row]:
    skill = learn_for_execution(method, alpha, demonstrations_by_situation)
    for name, situations in tried.items():
        label = f"{method.name}, alpha {alpha}: {name}"
        bar = tqdm(situations, label, leave=False, disable=not sys.stderr.isatty())
        done = [perform_plate(skill, method, where) for where in bar]
        if done:
            yield _row(method, alpha, (name, situations), done)


def perform_plate(
    skill: pf.Skill, method: Method, where: plate.PlateSituation, camera: FilmRecorder | None = None
) -> ExecutionResult:
    """Perform a skill of a method with its horizon and regularisation."""
    return perform(
        skill,
        plate.PLATE,
        where,
        horizon=HORIZON,
        covariance_regularisation=method.covariance_regularisation,
        on_period=camera,
    )


def _row(
    method: Method,
    alpha: float,
    where: tuple[str, list[plate.PlateSituation]],
    done: Sequence[ExecutionResult],
) -> Row:
    name, situations = where
    pushes = [max(made.peak_forces.get(thing, 0.0) for thing in plate.FRAGILE_GEOMS) for made in done]
    return Row(
        method=method.name,
        alpha=alpha,
        situations=name,
        levels=[w.level for w in situations],
        succeeded=sum(made.outcome.success for made in done),
        error=float(np.median([made.outcome.error for made in done])),
        contacts=sum(max_force > 0.0 for max_force in pushes),
        max_force=max(pushes),
        failures=[
            f"level {w.level}: {made.outcome.reason}"
            for w, made in zip(situations, done, strict=True)
            if not made.outcome.success
        ],
    )


def print_rows(rows: Sequence[Row]) -> None:
    print("carried out in physics")
    print("way       alpha  situations          done   median error  touched  largest push")
    for row in rows:
        done = f"{row.succeeded:>2} of {len(row.levels):<2}"
        told = f"{row.error:>11.4f} m  {row.contacts:>7}  {row.max_force:>9.1f} N"
        print(f"{row.method:<9} {row.alpha:>5}  {row.situations:<16} {done:>8}  {told}")
        for failure in row.failures:
            print(f"    {failure}")


def figure_4_7(
    skill: pf.Skill,
    demonstrations_by_situation: Sequence[SituationDemonstration],
    poses: Sequence[Demonstration],
) -> Figure:
    """Reproductions from the side: of what was shown above, of what was held out below."""
    figure = Figure(figsize=(13.0, 5.2), layout="constrained")
    panels = figure.subplots(2, len(demonstrations_by_situation) // 2, sharex=True, sharey=True)
    for row, kind in enumerate(("training", "test")):
        chosen = zip(demonstrations_by_situation[row::2], poses[row::2], strict=True)
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


def draw(axes: Axes, skill: pf.Skill, where: plate.PlateSituation, pose: Demonstration) -> None:
    """One situation: the bar's cross-section, the plate where it lay, the cross, and the way between."""
    done = reproduce_published(skill, pose)
    draw_ellipses(axes, done.adapted.means, done.adapted.covariances, PLANE, "adapted")
    axes.plot(*pose.x[:, PLANE].T, color="0.5", linestyle="--", linewidth=1.4, label="demonstration")
    axes.plot(*done.motion.x[:, PLANE].T, color="black", linewidth=1.6, label="reproduction")
    _, y, z = plate.obstacle_pose(where.level).position
    corner, size = (y - plate.BAR[1], z - plate.BAR[2]), (2 * plate.BAR[1], 2 * plate.BAR[2])
    axes.add_patch(Rectangle(corner, *size, color="#DDAA33", label="obstacle"))
    half = float(np.abs(rotation_matrix(where.plate.quaternion)[1, :2]) @ plate.HALF[:2])
    ends = where.plate.position[1] + np.array([-half, half])
    axes.plot(ends, [where.plate.position[2]] * 2, color="#44AACC", linewidth=4, label="plate")
    axes.plot(
        *plate.goal_pose().position[1:],
        color="#117733",
        marker="x",
        markersize=9,
        linestyle="",
        label="cross",
    )
    axes.axhline(plate.TABLE, color="0.7", linewidth=0.8)
    axes.set_aspect("equal")
    axes.spines[["top", "right"]].set_visible(False)


def record_film(
    demonstrations_by_situation: Sequence[SituationDemonstration],
    tried: dict[str, list[plate.PlateSituation]],
) -> Figure:
    """Six moments of the skill at work where the obstacle stands highest among the tests."""
    method = METHODS[-1]
    skill = learn_for_execution(method, FIGURE_ALPHA, demonstrations_by_situation)
    where = max(tried["tests"], key=lambda w: w.level)
    path = perform_plate(skill, method, where).commanded[:, :3]
    camera = FilmRecorder(path=path)
    perform_plate(skill, method, where, camera)
    camera.close()
    return film_strip(camera.images, camera.times)


if __name__ == "__main__":
    main()
