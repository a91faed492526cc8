"""Streamed skills beside batch fits: a valve, a cube that is put into a bin, and exercises.

    python reproductions/online_tasks.py --json tasks.json

valve: every demonstration is left out once, and reproduced from its own start over its own length by a skill
of the other seven. Distances to the demonstration are a mean over steps, and at the end [mm].

cube: a simulated person approaches a cube, grasps it, carries it to a bin and lets go, with frames at both.
Six demonstrations train, four others test, for each of several seeds. Least distances of the motion to the
cube and to the place over the bin where it lets go, and the mean distance to the demonstration [mm].

In both, "batch" learns from all demonstrations together. "from four" streams the others into a model that
begins with the batch fit of the first four, and "from nothing" streams all of them into an empty model.
Scales and penalties are estimated from the first four, as `pilotfish stream` does.

exercises: accuracy of segments against a person's labels, as in segmentation.py, for the recorded order of
the four sequences, and for all 24 orders with one seed. Streams start from nothing.

Source: the comparison is ours.
"""

from collections.abc import Callable, Sequence
from itertools import permutations

import numpy as np
from protocol import argument_parser, write_numbers
from segmentation import FEATURES, STATES

import pilotfish as pf
from pilotfish.demonstrations import Demonstration, Frame, Layout, Part, Quantity, frame
from pilotfish.geometry import from_rotation_vector, minimum_jerk, rotation_matrix
from pilotfish.models import matched_accuracy, viterbi
from pilotfish.models.online import (
    estimate_penalties,
    estimate_settings,
    from_batch_fit,
    observe_demonstration,
    online_model,
    to_skill,
)
from pilotfish.planning import reproduce_demonstration

FIRST, COUNTS, SEEDS = 4, (7, 10, 15), 6
TRAINING, TESTING = 6, 4
REGULARISATION = 0.01  # of the batch fit of exercises, in columns of unit variance
LAYOUT = Layout((Part("position", Quantity.POSITION, 3, "m"), Part("gripper", Quantity.SCALAR, 1, "m")))
PERIOD, OPENING, RELEASE_HEIGHT = 0.05, 0.08, 0.05  # s, m, m above the bin
UP, APPROACH = np.array([0.0, 0.0, 1.0]), np.array([-0.05, 0.02, 0.12])  # m, in the frame of the object
DURATIONS = (2.0, 1.0, 0.5, 0.8, 2.0, 1.0, 0.5, 1.0)  # of the phases [s]
Measure = Callable[[pf.Skill, Demonstration], tuple[float, ...]]
Row = dict[str, object]


def main() -> None:
    parser = argument_parser(__doc__)
    parser.add_argument(
        "--seeds", type=int, default=SEEDS, help="number of draws of the cube's demonstrations"
    )
    parser.add_argument("--states", nargs="+", type=int, default=COUNTS, help="numbers of states")
    parser.add_argument("--orders", type=int, default=24, help="number of orders of the exercises")
    arguments = parser.parse_args()
    try:
        valve, exercises = pf.datasets.valve(), pf.datasets.mocap6()
    except pf.SkillError as error:
        parser.exit(1, f"{error}\n")
    splits = [([d for d in valve if d is not left_out], [left_out]) for left_out in valve]
    rows = compare("valve: mean, end", splits, arguments.states, measure_valve)
    drawn = [simulate_cubes(np.random.default_rng(seed)) for seed in range(arguments.seeds)]
    splits = [(each[:TRAINING], each[TRAINING:]) for each in drawn]
    rows += compare("cube: cube, bin, mean", splits, arguments.states, measure_cube)
    rows += compare_segments(exercises, pf.datasets.mocap6_labels(), arguments.orders)
    if arguments.json:
        write_numbers(arguments.json, rows)


def compare(
    name: str,
    splits: Sequence[tuple[Sequence[Demonstration], Sequence[Demonstration]]],
    counts: Sequence[int],
    measure: Measure,
) -> list[Row]:
    """Return and print the mean distances of each skill over all splits [mm]."""
    print(f"{name} [mm]")
    rows = []
    for states in counts:
        results: dict[str, list[tuple[float, ...]]] = {}
        for train, test in splits:
            for way, skill in learn_skills(train, states).items():
                results.setdefault(way, []).extend((*measure(skill, d), float(skill.states)) for d in test)
        for way, values in results.items():
            *distances, clusters = np.mean(values, axis=0).tolist()
            print(
                f"  {states:>2} states, {way:<13}{clusters:>6.1f} " + "".join(f"{d:>8.1f}" for d in distances)
            )
            rows.append({"task": name, "states": states, "way": way, "distances": distances, "K": clusters})
    return rows


def learn_skills(train: Sequence[Demonstration], states: int) -> dict[str, pf.Skill]:
    """Return the skill of all demonstrations together, and of two streams."""

    def learn(demonstrations: Sequence[Demonstration]) -> pf.Skill:
        return pf.learn(demonstrations, states=states, rng=np.random.default_rng(0)).skill

    skill = learn(train[:FIRST])
    begun = from_batch_fit(skill, train[:FIRST], estimate_penalties(skill, train[:FIRST]))
    for demonstration in train[FIRST:]:
        begun, _ = observe_demonstration(begun, demonstration)
    nothing = stream_from_nothing(train, states, 0)
    return {"batch": learn(train), "from four": to_skill(begun), "from nothing": nothing}


def stream_from_nothing(demonstrations: Sequence[Demonstration], states: int, seed: int) -> pf.Skill:
    """Return the skill of a stream into an empty model, with settings of the first demonstrations."""
    rng, first = np.random.default_rng(seed), demonstrations[0]
    settings = estimate_settings(demonstrations[:FIRST], states=states, rng=rng)
    model = online_model(settings, first.layout, first.period, tuple(f.name for f in first.frames))
    for demonstration in demonstrations:
        model, _ = observe_demonstration(model, demonstration)
    return to_skill(model)


def measure_valve(skill: pf.Skill, demonstration: Demonstration) -> tuple[float, ...]:
    """Return the mean distance to a demonstration, and the distance at the end [mm]."""
    x = reproduce_demonstration(skill, demonstration).motion.x
    distances = 1000.0 * np.linalg.norm(x[:, :3] - demonstration.x[:, :3], axis=1)
    return float(distances.mean()), float(distances[-1])


def measure_cube(skill: pf.Skill, demonstration: Demonstration) -> tuple[float, ...]:
    """Return the least distances to cube and release, and the mean distance to a demonstration [mm]."""
    x = reproduce_demonstration(skill, demonstration).motion.x[:, :3]
    cube, bin_ = (np.asarray(frame.b)[:3] for frame in demonstration.frames)
    targets = (cube, bin_ + RELEASE_HEIGHT * UP)
    least = [1000.0 * float(np.linalg.norm(x - target, axis=1).min()) for target in targets]
    return *least, 1000.0 * float(np.linalg.norm(x - demonstration.x[:, :3], axis=1).mean())


def simulate_cubes(rng: np.random.Generator) -> list[Demonstration]:
    """Return demonstrations with cubes and bins at random poses."""
    return [simulate_cube(rng, f"cube {n}") for n in range(TRAINING + TESTING)]


def simulate_cube(rng: np.random.Generator, name: str) -> Demonstration:
    """Return one demonstration: movements of least jerk, with a sway that is small near cube and bin."""
    cube = np.array([0.45, 0.25, 0.02]) + np.append(rng.uniform(-0.15, 0.15, 2), 0.0)
    bin_ = np.array([0.45, -0.25, 0.10]) + np.append(rng.uniform(-0.15, 0.15, 2), 0.0)
    turns = rotation_matrix(from_rotation_vector(rng.uniform(-0.6, 0.6, 2)[:, None] * UP))
    release, home = bin_ + RELEASE_HEIGHT * UP, np.array([0.3, 0.0, 0.4]) + 0.01 * rng.normal(size=3)
    before_cube, before_bin = (p + R @ APPROACH for p, R in zip((cube, bin_), turns, strict=True))
    lifted, left = cube + 0.12 * UP, bin_ + 0.2 * UP
    places = [home, before_cube, cube, cube, lifted, before_bin, release, release, left]
    openings = np.array([1, 1, 1, 0, 0, 0, 0, 1, 1]) * OPENING
    points = np.hstack([np.array(places), openings[:, None]])
    steps = [max(3, round(s / PERIOD * rng.uniform(0.8, 1.2))) for s in DURATIONS]
    phases = [move(a, b, n) for a, b, n in zip(points[:-1], points[1:], steps, strict=True)]
    x = np.vstack([points[:1], *phases])
    t = np.linspace(0.0, np.pi, len(x))[:, None]
    sway = 0.01 * sum(rng.normal(size=3) * np.sin(k * t) / k for k in range(1, 6))
    near = np.minimum(*(np.linalg.norm(x[:, :3] - place, axis=1) for place in (cube, release)))
    x[:, :3] += sway * np.clip(near / 0.15, 0.03, 1.0)[:, None] + 0.0003 * rng.normal(size=(len(x), 3))
    frames = [frame_at(name, R, p) for name, R, p in zip(("cube", "bin"), turns, (cube, bin_), strict=True)]
    return pf.add_derivatives(pf.demonstration(x, PERIOD, LAYOUT, frames, name))


def move(a: np.ndarray, b: np.ndarray, steps: int) -> np.ndarray:
    """Return the points of a movement of least jerk after each step."""
    return np.asarray(a + minimum_jerk(np.linspace(0.0, 1.0, steps + 1)[1:, None]) * (b - a))


def frame_at(name: str, rotation: np.ndarray, position: np.ndarray) -> Frame:
    A = np.eye(4)
    A[:3, :3] = rotation
    return frame(name, A, np.append(position, 0.0))


def compare_segments(
    recorded: Sequence[Demonstration], labels: Sequence[np.ndarray], orders: int
) -> list[Row]:
    """Return and print accuracies of batch fits, and of streams in the recorded order and in all orders."""
    print("exercises: accuracy of batch, stream in the recorded order, and in other orders")
    rows: list[Row] = []
    truth = np.concatenate(labels)
    for name, features in FEATURES.items():
        sequences = features(recorded)

        def accuracy(skill: pf.Skill, sequences: Sequence[Demonstration] = sequences) -> float:
            return matched_accuracy(np.concatenate([viterbi(skill, d) for d in sequences]), truth)

        batch = np.mean([accuracy(fit_markov(sequences, seed)) for seed in range(SEEDS)])
        stream = np.mean([accuracy(stream_from_nothing(sequences, STATES, seed)) for seed in range(SEEDS)])
        permuted = [
            accuracy(stream_from_nothing([sequences[n] for n in order], STATES, 0))
            for order in list(permutations(range(len(sequences))))[:orders]
        ]
        print(f"  {name:<20}{batch:>6.3f}{stream:>8.3f}{np.mean(permuted):>8.3f} (least {min(permuted):.3f})")
        rows.append({"task": name, "batch": batch, "stream": stream, "orders": permuted})
    return rows


def fit_markov(sequences: Sequence[Demonstration], seed: int) -> pf.Skill:
    settings = pf.models.EMSettings(regularisation=REGULARISATION, tolerance=1e-5)
    rng, start = np.random.default_rng(seed), pf.models.KMeans()
    return pf.learn(
        sequences, states=STATES, rng=rng, dynamics="markov", initialisation=start, settings=settings
    ).skill


if __name__ == "__main__":
    main()
