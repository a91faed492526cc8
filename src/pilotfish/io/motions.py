"""CSV files of motions."""

import csv
from pathlib import Path

import numpy as np

from pilotfish.control import Motion
from pilotfish.demonstrations import Layout
from pilotfish.types import Array, Float


def write_motion(path: Path, motion: Motion, layout: Layout) -> None:
    """Write a motion as a CSV file: a header with units, then time and state of each step.

    Every number has the digits that restore it exactly; quaternions are normalised.

    Args:
        path: File to write; `atomic_file` gives one that appears complete.
        motion: Motion to write.
        layout: Columns of the motion.
    """
    header = [f"{name} [{unit}]" for name, unit in zip(layout.names, layout.units, strict=True)]
    rows = normalise_quaternions(motion.x, layout).tolist()
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["time [s]", *header])
        writer.writerows([_round_time(motion.period * t), *row] for t, row in enumerate(rows))


def normalise_quaternions(x: Float[Array, "T D"], layout: Layout) -> Float[Array, "T D"]:
    """Return rows whose quaternions have unit norm; a linear controller leaves it slightly.

    Args:
        x: States of a motion. Orientations on S^3 have unit norm already and are not changed.
        layout: Columns of x.
    """
    normalised = x.copy()
    for columns in layout.quaternions:
        normalised[:, columns] /= np.linalg.norm(x[:, columns], axis=1, keepdims=True)
    return normalised


def _round_time(seconds: float) -> float:
    """Return a time [s] rounded to 12 digits: 0.3 instead of 0.30000000000000004."""
    return float(f"{seconds:.12g}")
