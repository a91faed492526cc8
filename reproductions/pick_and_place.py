"""Pick and place over an obstacle: figure 4.7 and the lower half of table 4.1, on simulated demonstrations.

    python reproductions/pick_and_place.py --json pick_and_place.json --out pick_and_place/

The thesis' recording was never published. Here a simulated person guides the left arm of a simulated Baxter,
and the right one follows. The published numbers are printed for their order and size, not as a target: ours
are smaller because of the simulated person, not of a robot.

Protocol of the table, as printed: eight demonstrations with the obstacle at levels 0 to 7, each with another
pose of the plate. The first, third, fifth and seventh train, the others test. 200 datapoints of position,
quaternion and the derivative of each, D = 14; two frames, the initial plate and the obstacle. The other
parameters are those of protocol.py. A demonstration takes 16 to 20 s and is resampled to 200 rows of 0.1 s.

Then, what the thesis shows in photographs: the same three structures are learned with the grip column and
performed in physics, in the four test situations and in 16 with new plates and levels. Below level 0 and
above 6 the skill extrapolates. "protocol" learns as above; in half of the situations or more (seeds 1 and 2),
it misses the plate or the cross, or pushes the obstacle, where the thesis reports generalisation. "weighted"
has 12 states, regularisation and covariance regularisation 1e-6, and weights the frames at each state by
held-out training demonstrations (models.relevance). These values were chosen on seeds 0 and 3 by the plans of
the skill with alpha 1; for the others they need not be best. Seed 1, the default, had been performed before,
without relevance and with other numbers of states; seed 2 had no part in the choice.

Source: Tanwani 2018, section 4.3.2, figure 4.7 and table 4.1.
"""

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from protocol import (
    STATES,
    argument_parser,
    learn_skill,
    print_table,
    reproduce_published,
    structure,
    table_row,
    write_figures,
    write_numbers,
)
from recordings import cached_recording
from tqdm import tqdm

import pilotfish as pf
from pilotfish.demonstrations import Demonstration, Frame, Layout, resample
from pilotfish.environments.human import HumanModel
from pilotfish.environments.tasks import plate
from pilotfish.errors import SkillError
from pilotfish.gaussians.structures import DenseCovariances
from pilotfish.geometry import rotation_matrix
from pilotfish.models import EMSettings, relevance
from pilotfish.plots import draw_ellipses
from pilotfish.simulation import (
    ExecutionResult,
    FilmRecorder,
    film_strip,
    perform,
    record,
    simulated_leader,
)
from pilotfish.types import Array, Float

THESIS = {  # table 4.1: train and test mean squared error, covariance parameters, seconds of training
    0.0: (0.0023, 0.0138, 1470, 2.21),
    0.5: (0.0028, 0.0129, 1470, 4.73),
    1.0: (0.0033, 0.0127, 588, 10.21),
}
HORIZON, PERIOD, POSE, CONTROL_COST = 200, 0.1, 7, 0.1
LEVELS = range(8)
MIN_LEVEL, MAX_LEVEL = 0, 6  # of the training demonstrations; the skill extrapolates outside
NEW_LEVELS = (1, 3, 5, -1, 7, 8, 1, 3, 5, 7, 8, 1, 3, 5, -1, 9)  # of the new situations
MAX_ATTEMPTS = 5  # of one demonstration
DEMONSTRATION_STREAM, TEST_STREAM = 1, 2  # of random numbers
MIN_WEIGHT = 1e-6  # of a frame without relevance
FIGURE_ALPHA, PLANE = 1.0, (1, 2)  # structure and columns (y, z) of figure 4.7


@dataclass(frozen=True, slots=True)
class Method:
    """How a skill is learned and performed."""

    name: str
    states: int
    regularisation: float
    covariance_regularisation: float
    weighted: bool  # weight the frames by their relevance


METHODS = (
    Method("protocol", STATES, 1e-5, 1e-5, weighted=False),
    Method("weighted", 12, 1e-6, 1e-6, weighted=True),
)


@dataclass(frozen=True, slots=True, eq=False)
class SituationDemonstration:
    """Demonstration in a situation."""

    situation: plate.PlateSituation
    demonstration: Demonstration


@dataclass(frozen=True, slots=True)
class PerformanceRow:
    """Performances of a skill in a group of situations: median error [m], largest force [N]."""

    method: str
    alpha: float
    situations: str
    levels: list[int]
    succeeded: int
    error: float
    contacts: int
    max_force: float
    failures: list[str]

    def to_json(self) -> dict[str, object]:
        """Return the row with the keys of the published file."""
        return {
            "way": self.method,
            "alpha": self.alpha,
            "situations": self.situations,
            "levels": self.levels,
            "succeeded": self.succeeded,
            "error": self.error,
            "touched": self.contacts,
            "push": self.max_force,
            "failures": self.failures,
        }


def main() -> None:
    parser = argument_parser(__doc__)
    parser.add_argument("--situations", type=int, default=len(NEW_LEVELS), help="number of new situations")
    parser.add_argument("--seed", type=int, default=1, help="seed of demonstrations and situations")
    arguments = parser.parse_args()
    bar = tqdm(LEVELS, "recording", leave=False, disable=not sys.stderr.isatty())
    try:
        recorded = [record_demonstration(level, arguments.seed) for level in bar]
    except SkillError as error:
        parser.exit(1, f"{error}\n")
    poses = [pf.add_derivatives(drop_grip(item.demonstration)) for item in recorded]
    parts = poses[::2], poses[1::2]
    fits = {alpha: learn_skill(parts[0], structure(alpha)) for alpha in THESIS}
    table = [table_row(alpha, fits[alpha], parts, THESIS[alpha]) for alpha in THESIS]
    print("table 4.1, pick and place, on simulated demonstrations: mean squared error")
    print("(in brackets the thesis, on a recording of its own)")
    print_table(table)
    groups = group_situations(recorded, arguments.seed, arguments.situations)
    rows = [
        row
        for method in METHODS
        for alpha in THESIS
        for row in perform_groups(method, alpha, recorded, groups)
    ]
    print_rows(rows)
    if arguments.out:
        figures = {
            "figure-4.7": figure_4_7(fits[FIGURE_ALPHA].skill, recorded, poses),
            "execution": record_film(recorded, groups),
        }
        write_figures(arguments.out, figures)
        print(f"pictures in {arguments.out}")
    if arguments.json:
        numbers = {"simulated": True, "rows": table, "physics": [row.to_json() for row in rows]}
        write_numbers(arguments.json, numbers)


def record_demonstration(level: int, seed: int) -> SituationDemonstration:
    """Record a successful demonstration at an obstacle level; raise SkillError if all attempts fail."""
    situation = plate.situation_for_level(level, np.random.default_rng([seed, DEMONSTRATION_STREAM, level]))

    def make() -> list[Demonstration]:
        for attempt in range(MAX_ATTEMPTS):
            rng = np.random.default_rng([seed, DEMONSTRATION_STREAM, level, attempt])
            leader = simulated_leader(plate.PLATE, situation, HumanModel(), rng)
            recorded = record(plate.PLATE, situation, leader, f"level {level}")
            if recorded.outcome.success:
                return [recorded.demonstration]
        raise SkillError(
            f"level {level} failed {MAX_ATTEMPTS} times, the last time because {recorded.outcome.reason}"
        )

    (demonstration,) = cached_recording(__file__, f"level {level}, seed {seed}", make)
    return SituationDemonstration(situation, resample_to_horizon(demonstration))


def resample_to_horizon(demonstration: Demonstration) -> Demonstration:
    """Return the same path in 200 rows of 0.1 s, slower or faster."""
    rows = resample(demonstration, HORIZON)
    return pf.demonstration(rows.x, PERIOD, rows.layout, rows.frames, rows.name)


def drop_grip(demonstration: Demonstration) -> Demonstration:
    """Return the demonstration and its frames with the pose columns only."""
    layout = Layout(demonstration.layout.parts[:2])
    frames = [
        Frame(f.name, f.A[:POSE, :POSE], f.b[:POSE]) for f in demonstration.frames if isinstance(f, Frame)
    ]
    x = demonstration.x[:, :POSE]
    return pf.demonstration(x, demonstration.period, layout, frames, demonstration.name)


def group_situations(
    recorded: Sequence[SituationDemonstration], seed: int, number: int
) -> dict[str, list[plate.PlateSituation]]:
    """Return the test situations, and new ones within and outside the levels of the training."""
    new = [
        plate.situation_for_level(level, np.random.default_rng([seed, TEST_STREAM, n]))
        for n, level in enumerate(NEW_LEVELS[:number])
    ]
    return {
        "tests": [item.situation for item in recorded[1::2]],
        "new, between": [situation for situation in new if MIN_LEVEL <= situation.level <= MAX_LEVEL],
        "new, beyond": [situation for situation in new if not MIN_LEVEL <= situation.level <= MAX_LEVEL],
    }


def learn_with_grip(method: Method, alpha: float, recorded: Sequence[SituationDemonstration]) -> pf.Skill:
    """Learn a skill with the grip column from the training demonstrations."""
    train = [pf.add_derivatives(item.demonstration) for item in recorded[::2]]
    settings = EMSettings(regularisation=method.regularisation, tolerance=1e-5, duration_regularisation=1.0)
    skill = learn_skill(train, structure(alpha), method.states, settings).skill
    return weight_frames(skill, relevance(skill, train).values) if method.weighted else skill


def weight_frames(skill: pf.Skill, weights: Float[Array, "P K"]) -> pf.Skill:
    """Return a skill whose unweighted adaptation equals the weighted adaptation of this one."""
    covariances = [
        DenseCovariances(c.dense / np.maximum(weight, MIN_WEIGHT)[:, None, None])
        for c, weight in zip(skill.covariances, weights, strict=True)
    ]
    return replace(skill, covariances=tuple(covariances))


def perform_groups(
    method: Method,
    alpha: float,
    recorded: Sequence[SituationDemonstration],
    groups: dict[str, list[plate.PlateSituation]],
) -> Iterator[PerformanceRow]:
    """Yield a row for each group of situations."""
    skill = learn_with_grip(method, alpha, recorded)
    for name, situations in groups.items():
        label = f"{method.name}, alpha {alpha}: {name}"
        bar = tqdm(situations, label, leave=False, disable=not sys.stderr.isatty())
        results = [perform_plate(skill, method, situation) for situation in bar]
        if results:
            yield _summarise(method, alpha, (name, situations), results)


def perform_plate(
    skill: pf.Skill, method: Method, situation: plate.PlateSituation, camera: FilmRecorder | None = None
) -> ExecutionResult:
    """Perform a skill of a method in a situation."""
    return perform(
        skill,
        plate.PLATE,
        situation,
        horizon=HORIZON,
        control_cost=CONTROL_COST,
        covariance_regularisation=method.covariance_regularisation,
        on_period=camera,
    )


def _summarise(
    method: Method,
    alpha: float,
    group: tuple[str, list[plate.PlateSituation]],
    results: Sequence[ExecutionResult],
) -> PerformanceRow:
    name, situations = group
    forces = [max(result.peak_forces.get(geom, 0.0) for geom in plate.FRAGILE_GEOMS) for result in results]
    return PerformanceRow(
        method=method.name,
        alpha=alpha,
        situations=name,
        levels=[situation.level for situation in situations],
        succeeded=sum(result.outcome.success for result in results),
        error=float(np.median([result.outcome.error for result in results])),
        contacts=sum(force > 0.0 for force in forces),
        max_force=max(forces),
        failures=[
            f"level {situation.level}: {result.outcome.reason}"
            for situation, result in zip(situations, results, strict=True)
            if not result.outcome.success
        ],
    )


def print_rows(rows: Sequence[PerformanceRow]) -> None:
    print("carried out in physics")
    print("way       alpha  situations          done   median error  touched  largest push")
    for row in rows:
        done = f"{row.succeeded:>2} of {len(row.levels):<2}"
        numbers = f"{row.error:>11.4f} m  {row.contacts:>7}  {row.max_force:>9.1f} N"
        print(f"{row.method:<9} {row.alpha:>5}  {row.situations:<16} {done:>8}  {numbers}")
        for failure in row.failures:
            print(f"    {failure}")


def figure_4_7(
    skill: pf.Skill, recorded: Sequence[SituationDemonstration], poses: Sequence[Demonstration]
) -> Figure:
    """Draw reproductions from the side: training situations above, test situations below."""
    figure = Figure(figsize=(13.0, 5.2), layout="constrained")
    panels = figure.subplots(2, len(recorded) // 2, sharex=True, sharey=True)
    for row, kind in enumerate(("training", "test")):
        pairs = zip(recorded[row::2], poses[row::2], strict=True)
        for axes, (item, pose) in zip(panels[row], pairs, strict=True):
            draw_situation(axes, skill, item.situation, pose)
            axes.set_title(f"{kind}, obstacle at level {item.situation.level}", fontsize=10)
    for axes in panels[-1]:
        axes.set_xlabel("y [m]")
    for axes in panels[:, 0]:
        axes.set_ylabel("z [m]")
    handles = panels[0, 0].get_legend_handles_labels()
    figure.legend(*handles, loc="outside lower center", ncols=len(handles[1]), frameon=False)
    return figure


def draw_situation(axes: Axes, skill: pf.Skill, situation: plate.PlateSituation, pose: Demonstration) -> None:
    """Draw cross-section of the bar, initial plate, cross, demonstration and reproduction."""
    done = reproduce_published(skill, pose)
    draw_ellipses(axes, done.adapted.means, done.adapted.covariances, PLANE, "adapted")
    axes.plot(*pose.x[:, PLANE].T, color="0.5", linestyle="--", linewidth=1.4, label="demonstration")
    axes.plot(*done.motion.x[:, PLANE].T, color="black", linewidth=1.6, label="reproduction")
    _, y, z = plate.obstacle_pose(situation.level).position
    corner, size = (y - plate.BAR[1], z - plate.BAR[2]), (2 * plate.BAR[1], 2 * plate.BAR[2])
    axes.add_patch(Rectangle(corner, *size, color="#DDAA33", label="obstacle"))
    half = float(np.abs(rotation_matrix(situation.plate.quaternion)[1, :2]) @ plate.HALF[:2])
    ends = situation.plate.position[1] + np.array([-half, half])
    axes.plot(ends, [situation.plate.position[2]] * 2, color="#44AACC", linewidth=4, label="plate")
    goal = plate.goal_pose().position[1:]
    axes.plot(*goal, color="#117733", marker="x", markersize=9, linestyle="", label="cross")
    axes.axhline(plate.TABLE, color="0.7", linewidth=0.8)
    axes.set_aspect("equal")
    axes.spines[["top", "right"]].set_visible(False)


def record_film(
    recorded: Sequence[SituationDemonstration], groups: dict[str, list[plate.PlateSituation]]
) -> Figure:
    """Draw six images of a performance in the test situation with the highest obstacle."""
    method = METHODS[-1]
    skill = learn_with_grip(method, FIGURE_ALPHA, recorded)
    situation = max(groups["tests"], key=lambda situation: situation.level)
    path = perform_plate(skill, method, situation).commanded[:, :3]
    camera = FilmRecorder(path=path)
    perform_plate(skill, method, situation, camera)
    camera.close()
    return film_strip(camera.images, camera.times)


if __name__ == "__main__":
    main()
