"""Protocol of table 4.1, and the command line of the reproductions.

The protocol of the published experiments: K = 7 states, initialised by time bins, regularisation 1e-5, Q =
(Sigma + 2e-3 I)^-1, R = 9 I. The error is the mean squared difference of the seven pose coordinates, metres
and quaternion components alike, for a reproduction from the first state's mean.

Source: Tanwani 2018, sections 3.4, 4.3.1 and 4.3.2.
"""

import argparse
import json
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

import pilotfish as pf
from pilotfish.demonstrations import Demonstration
from pilotfish.gaussians.structures import CovarianceStructure
from pilotfish.models import EMSettings
from pilotfish.planning import Reproduction, mean_squared_error, reproduce_demonstration

STATES = 7
SETTINGS = EMSettings(regularisation=1e-5, tolerance=1e-5, duration_regularisation=1.0)
PUBLISHED: dict[str, Any] = {"initialisation": pf.models.TimeBins(), "settings": SETTINGS}  # of pf.learn
COVARIANCE_REGULARISATION = 2e-3  # m^2, and squared quaternion components
CONTROL_COST = 9.0
TIMED_FITS = 9
PRINTED = ("train_mse", "test_mse", "covariance_parameters", "fit_seconds")
Row = dict[str, Any]


def structure(alpha: float, sweeps: int = 2) -> CovarianceStructure:
    """Return semi-tied covariances with a tying factor, or full ones for zero."""
    return pf.structures.SemiTied(alpha, sweeps) if alpha else pf.structures.Full()


def learn_skill(
    demonstrations: Sequence[Demonstration],
    structure: CovarianceStructure,
    states: int = STATES,
    settings: EMSettings = SETTINGS,
) -> pf.models.Fit:
    """Learn a skill from time bins."""
    rng = np.random.default_rng(0)
    return pf.learn(
        demonstrations,
        states=states,
        rng=rng,
        structure=structure,
        initialisation=pf.models.TimeBins(),
        settings=settings,
    )


def reproduce_published(
    skill: pf.Skill, demonstration: Demonstration, *, from_first_state: bool = False
) -> Reproduction:
    """Reproduce a skill in the situation of a demonstration, with the published control parameters."""
    return reproduce_demonstration(
        skill,
        demonstration,
        from_first_state=from_first_state,
        control_cost=CONTROL_COST,
        covariance_regularisation=COVARIANCE_REGULARISATION,
        stepwise=True,
    )


def mean_error(skill: pf.Skill, demonstrations: Sequence[Demonstration], *, own_start: bool = False) -> float:
    """Return the mean error from the first state's mean, or from each demonstration's own start."""
    errors = [
        mean_squared_error(reproduce_published(skill, d, from_first_state=not own_start).motion, d)
        for d in demonstrations
    ]
    return float(np.mean(errors))


def table_row(
    alpha: float,
    fit: pf.models.Fit,
    parts: tuple[Sequence[Demonstration], Sequence[Demonstration]],
    thesis: tuple[float, float, int, float],
) -> Row:
    """Return a row of table 4.1 for training and test demonstrations, with the published one."""
    train, test = parts
    seconds = []
    for _ in range(TIMED_FITS):
        start = time.process_time()
        learn_skill(train, structure(alpha))
        seconds.append(time.process_time() - start)
    return {
        "alpha": alpha,
        "train_mse": mean_error(fit.skill, train),
        "test_mse": mean_error(fit.skill, test),
        "train_mse_own_start": mean_error(fit.skill, train, own_start=True),
        "test_mse_own_start": mean_error(fit.skill, test, own_start=True),
        "covariance_parameters": 2 * structure(alpha).parameter_count(STATES, fit.skill.width),
        "fit_seconds": float(np.median(seconds)),
        "iterations": fit.convergence.iterations,
        "converged": fit.convergence.converged,
        "thesis": dict(zip(PRINTED, thesis, strict=True)),
    }


def print_table(rows: Sequence[Row]) -> None:
    """Print rows of table 4.1 with the published numbers in brackets."""
    print("alpha             train             test    own start: train  test   parameters     CPU seconds")
    for row in rows:
        train, test, parameters, seconds = row["thesis"].values()
        cells = (
            f"{row['alpha']:>5}",
            f"{row['train_mse']:>9.5f} ({train:.4f})",
            f"{row['test_mse']:.5f} ({test:.4f})",
            f"{row['train_mse_own_start']:>15.5f} {row['test_mse_own_start']:.5f}",
            f"{row['covariance_parameters']:>5} ({parameters})",
            f"{row['fit_seconds']:>6.3f} ({seconds:.2f})",
        )
        print("  ".join(cells))


def argument_parser(description: str | None) -> argparse.ArgumentParser:
    """Return a parser with --json and --out."""
    parser = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", type=Path, help="file for the numbers")
    parser.add_argument("--out", type=Path, help="folder for the figures")
    return parser


def write_figures(folder: Path, figures: Mapping[str, Figure]) -> None:
    """Write figures as PNG files into a folder, which is created."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, figure in figures.items():
        figure.savefig(folder / f"{name}.png", dpi=110)


def write_numbers(file: Path, numbers: object) -> None:
    """Write numbers as JSON, and create the folder of the file."""
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(json.dumps(numbers, indent=2) + "\n")
