"""Virtual fixture, all by all: the column VFC of table 6.1, on the recorded valve and four tasks in physics.

    python reproductions/virtual_fixture.py --json fixture.json

Every recorded demonstration is the operator's input in every configuration: 6 demonstrations learn, and 2
give the test configurations. The target is compared with the human demonstration of the configuration, both
at the same share of their time. The table gives the mean distance of the positions [cm], that of direct
control, their ratio, the reversals per run, and the mean of the last phase. Rows:

    literal  (6.12) alone, with the frames of the configuration
    guarded  with the guard against reversals and vanishing Jacobians
    observed     also with the phase on the path adapted to the frames that the operator saw

The demonstrations in physics are simulated. Printed by the thesis for the valve: direct 1.412 (train) and
1.261 (test), virtual fixture 2.836 and 2.011, in a unit that is not cm: the distances here are those of the
recording.

Source: Tanwani 2018, sections 6.4 and 6.5, table 6.1.
"""

import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np
from protocol import argument_parser, write_numbers
from recordings import cached_recording
from tqdm import tqdm

import pilotfish as pf
from pilotfish.assistance import (
    VirtualFixture,
    learn_virtual_fixture,
    start_fixture,
    step_fixture,
)
from pilotfish.demonstrations import Demonstration, Frame
from pilotfish.environments import TASKS
from pilotfish.geometry import log_map
from pilotfish.simulation import record_demonstrations
from pilotfish.types import Array, Float

STEPS, TRAIN, NUMBER, SEED = 100, 6, 8, 1
SIMULATED = ("stab", "valve", "carabiner", "screwdriver")
VARIANTS = ("literal", "guarded", "observed")


@dataclass(frozen=True, slots=True)
class Row:
    """Result of one variant on the train or test configurations of one task."""

    task: str
    phase: str
    variant: str
    configurations: str
    distance_cm: float
    direct_cm: float
    ratio: float
    reversals: float
    last_phase: float


def main() -> None:
    parser = argument_parser(__doc__)
    parser.add_argument("--tasks", nargs="+", default=("recorded valve", *SIMULATED))
    parser.add_argument("--phases", nargs="+", default=("path", "logistic"), choices=("path", "logistic"))
    parser.add_argument("--train", action="store_true", help="also the train configurations")
    arguments = parser.parse_args()
    rows: list[Row] = []
    print(
        "task             phase     variant  configurations    fixture   direct  ratio  reversals  last phase"
    )
    for task in arguments.tasks:
        demonstrations = load(task)
        for phase in arguments.phases:
            for row in evaluate(task, demonstrations, phase, train=arguments.train):
                rows.append(row)
                print_row(row)
    if arguments.json:
        write_numbers(arguments.json, [asdict(row) for row in rows])


def print_row(row: Row) -> None:
    print(
        f"{row.task:<16} {row.phase:<9} {row.variant:<8} {row.configurations:<14} {row.distance_cm:>7.2f} cm "
        f"{row.direct_cm:>5.2f} cm {row.ratio:>6.2f} {row.reversals:>10.2f} {row.last_phase:>11.2f}",
        flush=True,
    )


def load(task: str) -> Sequence[Demonstration]:
    """Return the eight demonstrations of a task."""
    if task == "recorded valve":
        return pf.datasets.valve()

    def make() -> list[Demonstration]:
        recordings = record_demonstrations(TASKS[task], NUMBER, SEED)
        bar = tqdm(recordings, f"{task}: recording", NUMBER, disable=not sys.stderr.isatty())
        return [recording.demonstration for recording, _ in bar]

    return cached_recording(__file__, f"{task}, {NUMBER} demonstrations, seed {SEED}", make)


def configurations(
    demonstrations: Sequence[Demonstration], train: bool
) -> dict[str, Sequence[Demonstration]]:
    test = {"test": demonstrations[TRAIN:]}
    return {"train": demonstrations[:TRAIN]} | test if train else test


def evaluate(
    task: str, demonstrations: Sequence[Demonstration], phase: str, *, train: bool = False
) -> list[Row]:
    """Return the rows of one task and phase."""
    fixture = learn_virtual_fixture(demonstrations[:TRAIN], rng=np.random.default_rng(0), phase=phase)
    positions = fixture.layout.columns("position")
    rows = []
    for variant in VARIANTS:
        used = replace(fixture, look_ahead=0.0) if variant == "literal" else fixture
        for name, chosen in configurations(demonstrations, train).items():
            results = []
            for human in chosen:
                for operator in demonstrations:
                    x, reversals, last = run(used, operator, human, observed=variant == "observed")
                    there = human.x[:, positions]
                    distances = [distance_cm(p[:, positions], there) for p in (x, operator.x)]
                    results.append([*distances, reversals, last])
            distance, direct, reversals, last = np.mean(results, axis=0).tolist()
            rows.append(Row(task, phase, variant, name, distance, direct, distance / direct, reversals, last))
    return rows


def run(
    fixture: VirtualFixture, operator: Demonstration, human: Demonstration, *, observed: bool
) -> tuple[Float[Array, "T D"], int, float]:
    """Return the targets with one demonstration as input in the situation of another."""
    starts = tuple(columns.start for columns in fixture.layout.unit_quaternions)
    poses = operator.x[:, : fixture.layout.width]
    steps = log_map(poses[:-1], poses[1:], starts) / operator.period
    velocities = np.vstack([steps[:1], steps])
    state = start_fixture(fixture, frames_at(operator if observed else human, 0.0))
    targets = []
    for share, pose, velocity in zip(np.linspace(0.0, 1.0, len(poses)), poses, velocities, strict=True):
        observed_frames = frames_at(operator, share) if observed else None
        state, target = step_fixture(
            fixture,
            state,
            pose,
            velocity,
            frames_at(human, share),
            operator.period,
            observed_frames=observed_frames,
        )
        targets.append(target.mean)
    return np.array(targets), state.reversals, state.phase


def frames_at(demonstration: Demonstration, share: float) -> list[Frame]:
    """Return the frames at a share of the time."""
    return [frame.at(round(share * (len(demonstration.x) - 1))) for frame in demonstration.frames]


def distance_cm(a: Float[Array, "T 3"], b: Float[Array, "S 3"]) -> float:
    """Return the mean distance of two motions at the same share of their time."""
    at = [interpolate(x, np.linspace(0.0, len(x) - 1.0, STEPS)) for x in (a, b)]
    return 100.0 * float(np.linalg.norm(at[0] - at[1], axis=1).mean())


def interpolate(x: Float[Array, "T 3"], rows: Float[Array, " S"]) -> Float[Array, "S 3"]:
    return np.stack([np.interp(rows, np.arange(len(x)), column) for column in x.T], axis=1)


if __name__ == "__main__":
    main()
