"""Nested splits: is the choice of `pilotfish select` better than the default on an unseen demonstration?

    python reproductions/select_splits.py --json splits.json
    python reproductions/select_splits.py --splits 2 --only valve "letters a"

Each demonstration of a recording is held out once. The candidates of `pilotfish select` are compared on the
others alone, as a user would. The choice and the default are then learned from these, and reproduce the
held-out demonstration from its start, over its number of steps. Both have the score of
`planning/selection.py`: the sum of mean distance, warped distance and end error, relative to the scales of
the demonstrations; lower is better. A kept default counts as no worse.

Recordings are those of peer_recordings.py, with frames at start and end or of the valve.
"""

import os
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from peer_recordings import Recording, load_recordings
from protocol import argument_parser, write_numbers

import pilotfish as pf
from pilotfish.planning import (
    DEFAULT_CANDIDATE,
    default_candidates,
    held_out_errors,
    select_by_reproduction,
)

RECORDINGS = (
    "robotasks",
    "helloworld",
    "letters a",
    "letters e",
    "letters m",
    "valve",
)


@dataclass(frozen=True, slots=True)
class Row:
    """One split.

    Attributes:
        recording: Recording.
        held_out: Number of the demonstration that was held out.
        choice: Label of the candidate that was selected.
        kept: Whether it is the default.
        score: Score of the choice on the held-out demonstration.
        default: Score of the default there.
        fits: Number of fits of the selection.
    """

    recording: str
    held_out: int
    choice: str
    kept: bool
    score: float
    default: float
    fits: int

    @property
    def is_no_worse(self) -> bool:
        """Whether the choice is no worse than the default, up to rounding."""
        return self.score <= self.default * (1.0 + 1e-9)


def main() -> None:
    parser = argument_parser(__doc__)
    parser.add_argument("--data", type=Path, help="folder of recordings (default: PILOTFISH_DATA)")
    parser.add_argument("--only", nargs="+", default=RECORDINGS, help="these recordings or groups")
    parser.add_argument("--splits", type=int, default=100, help="largest number of splits of each recording")
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="processes (default: all cores)")
    arguments = parser.parse_args()
    if arguments.data:
        os.environ["PILOTFISH_DATA"] = str(arguments.data)
    try:
        recordings = load_recordings(arguments.only)
    except pf.SkillError as error:
        parser.exit(1, f"{error}\n")
    rows = []
    with ProcessPoolExecutor(arguments.workers, mp_context=get_context("spawn")) as executor:
        tasks = [task for recording in recordings for task in choose_splits(recording, arguments.splits)]
        for row in executor.map(run_split, tasks):
            print_row(row)
            rows.append(row)
    print_summary(rows)
    if arguments.json:
        write_numbers(arguments.json, {"rows": [asdict(row) for row in rows]})


def choose_splits(recording: Recording, count: int) -> Iterator[tuple[Recording, int]]:
    """Yield splits of a recording whose held-out demonstrations are evenly spread."""
    total = len(recording.demonstrations)
    for m in np.unique(np.linspace(0, total - 1, min(count, total)).round().astype(int)):
        yield recording, int(m)


def run_split(task: tuple[Recording, int]) -> Row:
    """Select on all demonstrations but one, and score choice and default on that one."""
    recording, m = task
    demonstrations = recording.demonstrations
    training, test = [*demonstrations[:m], *demonstrations[m + 1 :]], demonstrations[m]
    candidates = default_candidates(training)
    selection = select_by_reproduction(training, candidates, rng=np.random.default_rng(0))
    choice = selection.best.candidate
    scores = {
        candidate.label: held_out_errors(candidate, training, [test], rng=np.random.default_rng(0))[
            0, :3
        ].sum()
        for candidate in (choice, DEFAULT_CANDIDATE)
    }
    return Row(
        recording.name,
        m,
        choice.label,
        choice == DEFAULT_CANDIDATE,
        float(scores[choice.label]),
        float(scores[DEFAULT_CANDIDATE.label]),
        selection.fits,
    )


def print_row(row: Row) -> None:
    change = 100.0 * (row.score / row.default - 1.0)
    print(f"{row.recording:30}{row.held_out:3}{row.fits:5} fits{change:+7.1f} %  {row.choice}", flush=True)


def print_summary(rows: Sequence[Row]) -> None:
    if not rows:
        print("no splits")
        return
    changed = [row for row in rows if not row.kept]
    better = sum(row.is_no_worse for row in changed)
    no_worse = sum(row.is_no_worse for row in rows)
    ratio = np.exp(np.mean([np.log(row.score / row.default) for row in rows]))
    print(f"no worse than the default in {no_worse} of {len(rows)} splits ({no_worse / len(rows):.0%})")
    print(f"another candidate was chosen in {len(changed)}, and was no worse in {better} of them")
    print(f"score of the choice relative to the default, geometric mean: {ratio:.3f}")
    print(f"fits: {sum(row.fits for row in rows)}, {np.mean([row.fits for row in rows]):.0f} per selection")


if __name__ == "__main__":
    main()
