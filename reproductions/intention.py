"""Intention: which of two skills the operator follows, on the recorded valve or a simulated task.

    python reproductions/intention.py --json intention.json

The two skills of a task are its demonstrations and the same rows in reverse order: the same poses in the same
frames, so that they differ in the order only. Each of the eight demonstrations is left out once. The skills
are learned from the other seven, the calibration from four of these, and the one left out is the operator's
input in both directions.
Columns:

    right      share of steps at which the right skill has more than half of the probability
    delay      share of the demonstration after which it has more than half for good, mean
    last       probability of the right skill at the end, mean
    confidence, accuracy   mean probability of the more probable skill, and how often it is the right one
    none       probability of none at the end for an unrelated motion: axes exchanged, moved by 30 cm
"""

from dataclasses import asdict, dataclass, replace

import numpy as np
from protocol import argument_parser, write_numbers
from tqdm import tqdm
from virtual_fixture import load

import pilotfish as pf
from pilotfish import assistance
from pilotfish.demonstrations import Demonstration
from pilotfish.types import Array, Float

STATES, OFFSET = 7, 0.3


@dataclass(frozen=True, slots=True)
class Row:
    """Result of one task."""

    task: str
    right: float
    delay: float
    last: float
    confidence: float
    accuracy: float
    none: float


def main() -> None:
    parser = argument_parser(__doc__)
    parser.add_argument("--tasks", nargs="+", default=("recorded valve",))
    arguments = parser.parse_args()
    rows = [evaluate(task, list(load(task))) for task in arguments.tasks]
    print("task            right  delay   last  confidence  accuracy   none")
    for row in rows:
        print(
            f"{row.task:<15} {row.right:>5.2f} {row.delay:>6.2f} {row.last:>6.2f} {row.confidence:>11.2f} "
            f"{row.accuracy:>9.2f} {row.none:>6.2f}"
        )
    if arguments.json:
        write_numbers(arguments.json, [asdict(row) for row in rows])


def learn(demonstrations: list[Demonstration]) -> pf.Skill:
    return pf.learn(demonstrations, states=STATES, rng=np.random.default_rng(0)).skill


def backwards(demonstration: Demonstration) -> Demonstration:
    """Return a demonstration with its rows, and the frames of each, in reverse order."""
    frames = [replace(f, A=f.A[::-1], b=f.b[::-1]) if f.is_moving else f for f in demonstration.frames]
    return replace(demonstration, x=demonstration.x[::-1].copy(), frames=tuple(frames))


def evaluate(task: str, demonstrations: list[Demonstration]) -> Row:
    right, delays, last, nones = [], [], [], []
    confidences, hits = [], []
    for m, left_out in enumerate(tqdm(demonstrations, task)):
        others = [demo for n, demo in enumerate(demonstrations) if n != m]
        both = [others, [backwards(demo) for demo in others]]
        calibration = assistance.calibrate_intention([demos[:4] for demos in both], learn)
        skills = [assistance.assisted_skill(learn(demos)) for demos in both]
        intention = assistance.intention_filter(skills, calibration)
        for n, demo in enumerate((left_out, backwards(left_out))):
            probs = follow(intention, demo)
            is_right = probs[:, n] > 0.5
            right.append(is_right.mean())
            delays.append((len(is_right) - np.argmin(is_right[::-1])) / len(is_right) * (not is_right.all()))
            last.append(probs[-1, n])
            confidences.append(probs[:, :2].max(axis=1))
            hits.append(probs[:, :2].argmax(axis=1) == n)
            nones.append(follow(intention, displaced(demo))[-1, 2])
    confidence, accuracy = np.concatenate(confidences).mean(), np.concatenate(hits).mean()
    return Row(task, *(float(np.mean(v)) for v in (right, delays, last, confidence, accuracy, nones)))


def displaced(demonstration: Demonstration) -> Demonstration:
    """Return a motion that no skill describes: the positions are moved, their axes exchanged."""
    x = demonstration.x.copy()
    x[:, :3] = x[:, [1, 2, 0]] + OFFSET
    return replace(demonstration, x=x)


def follow(intention: assistance.IntentionFilter, demonstration: Demonstration) -> Float[Array, "T 3"]:
    """Return the probabilities of both skills and of none at every step."""
    poses = demonstration.x[:, np.array(demonstration.layout.coordinates)]
    state = assistance.start_intention(intention, [f.at(0) for f in demonstration.frames])
    rows = []
    for t, pose in enumerate(poses):
        frames = [f.at(t) for f in demonstration.frames]
        state, result = assistance.step_intention(intention, state, pose, frames)
        rows.append([*result.skills, result.none])
    return np.array(rows)


if __name__ == "__main__":
    main()
