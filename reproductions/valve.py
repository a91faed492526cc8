"""Opening a valve: figures 3.6, 3.7 and 4.5 and the valve rows of table 4.1, from the thesis' own recording.

    python reproductions/valve.py --json valve.json --out valve/

Protocol of the published figures: the first four demonstrations train, the last four test; K = 7 states,
beginning with time bins, regularisation 1e-5, Q = (Sigma + 2e-3 I)^-1, R = 9 I, period 0.1 s, 200 steps.
The error is the mean over demonstrations of the mean squared difference of the 7 pose coordinates (metres and
quaternion components alike, as the thesis has it), for a reproduction that starts at the first state's mean;
beside it the same started at the demonstration's own first point.

Source: Tanwani 2018, sections 3.4 and 4.3.1.
"""

import argparse
import json
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from protocol import STATES, reproduce_published

import pilotfish as pf
from pilotfish import plots
from pilotfish.demonstrations import Demonstration
from pilotfish.gaussians.structures import CovarianceStructure, component_correlation
from pilotfish.models import log_state_likelihoods
from pilotfish.planning import mean_squared_error

PRINTED = ("train_mse", "test_mse", "covariance_parameters", "fit_seconds")
THESIS = {  # table 4.1: train and test mean squared error, covariance parameters, seconds of training
    0.0: (0.0021, 0.0146, 1470, 2.45),
    0.5: (0.0038, 0.0119, 1470, 5.40),
    1.0: (0.0040, 0.0119, 588, 9.78),
}
NOT_REPRODUCED = (
    "figure 3.5 is a photograph of the robot",
    "the pick-and-place rows of table 4.1: their recording was never published",
    "the inner sweeps of the semi-tied fit, which the thesis does not name: two in each M-step are ours",
)
HORIZON = 200
TIMED_FITS = 9


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", type=Path, help="file for the table's numbers")
    parser.add_argument("--out", type=Path, help="folder for the pictures")
    arguments = parser.parse_args()
    try:
        demonstrations = pf.datasets.valve()
    except pf.SkillError as error:
        parser.exit(1, f"{error}\n")
    fits = {alpha: learn_skill(demonstrations[:4], structure(alpha)) for alpha in THESIS}
    rows = [table_row(alpha, fits[alpha], demonstrations) for alpha in THESIS]
    print_table(rows)
    print_sweeps(sweep_rows := sensitivity(demonstrations))
    for reason in NOT_REPRODUCED:
        print(f"not reproduced: {reason}")
    if arguments.out:
        arguments.out.mkdir(parents=True, exist_ok=True)
        for name, figure in pictures(fits, demonstrations).items():
            figure.savefig(arguments.out / f"{name}.png", dpi=110)
        print(f"pictures in {arguments.out}")
    if arguments.json:
        arguments.json.parent.mkdir(parents=True, exist_ok=True)
        numbers = {"rows": rows, "sweeps": sweep_rows, "not_reproduced": NOT_REPRODUCED}
        arguments.json.write_text(json.dumps(numbers, indent=2) + "\n")


def structure(alpha: float, sweeps: int = 2) -> CovarianceStructure:
    return pf.structures.SemiTied(alpha, sweeps) if alpha else pf.structures.Full()


def learn_skill(demonstrations: Sequence[Demonstration], structure: CovarianceStructure) -> pf.models.Fit:
    return pf.learn(demonstrations, states=STATES, rng=np.random.default_rng(0), structure=structure)


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
    train, test = demonstrations[:4], demonstrations[4:]
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
        "log_likelihood": float(fit.log_likelihoods[-1]),
        "mean_component_correlation": correlation(fit.skill),
        "thesis": dict(zip(PRINTED, THESIS[alpha], strict=True)),
    }


def correlation(skill: pf.Skill) -> list[float]:
    """The mean correlation between different components (4.25), one number for each frame."""
    apart = ~np.eye(skill.states, dtype=bool)
    return [float(component_correlation(c.dense)[apart].mean()) for c in skill.covariances]


def print_table(rows: Sequence[dict[str, object]]) -> None:
    print("table 4.1, valve opening: mean squared error (thesis in brackets)")
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


def sensitivity(demonstrations: Sequence[Demonstration]) -> list[dict[str, object]]:
    """How much the semi-tied rows owe to the one free choice of the protocol: sweeps in each M-step."""
    rows: list[dict[str, object]] = []
    for alpha in (0.5, 1.0):
        for sweeps in (1, 2, 3, 5, 10, 20, 50):
            skill = learn_skill(demonstrations[:4], structure(alpha, sweeps)).skill
            errors = [mean_error(skill, part) for part in (demonstrations[:4], demonstrations[4:])]
            rows.append({"alpha": alpha, "sweeps": sweeps, "train_mse": errors[0], "test_mse": errors[1]})
    return rows


def print_sweeps(rows: Sequence[dict[str, object]]) -> None:
    print("the same for other numbers of semi-tied sweeps in each M-step")
    for row in rows:
        label = f"  alpha {row['alpha']}  sweeps {row['sweeps']:>2}"
        print(f"{label}  train {row['train_mse']:.5f}  test {row['test_mse']:.5f}")


def pictures(fits: dict[float, pf.models.Fit], demonstrations: Sequence[Demonstration]) -> dict[str, Figure]:
    free, tied = fits[0.0].skill, fits[1.0].skill
    drawn = {
        "figure-3.6-graph": plots.state_graph(free),
        "figure-3.6-forward-variable": plots.forward_variable(free, horizon=HORIZON),
        "figure-3.7-deviations": plots.state_deviations(free),
        "figure-3.7-seen-from-frames": plots.demonstrations_in_frames(free, demonstrations[:4]),
        "figure-4.5-correlation": plots.covariance_correlations([free, tied]),
        "figure-4.5-basis": plots.basis_vectors(tied),
        "trace": plots.likelihood_trace(list(fits.values())),
    }
    for name, skill, demonstration in (
        ("figure-3.6-training", free, demonstrations[0]),
        ("figure-3.6-unseen", free, demonstrations[6]),
        ("figure-4.5-full", free, demonstrations[4]),
        ("figure-4.5-semi-tied", tied, demonstrations[4]),
    ):
        done = reproduce_published(skill, demonstration)
        frames = [frame for frame in demonstration.frames if isinstance(frame, pf.Frame)]
        drawn[name] = plots.reproduction(done.adapted, done.motion, frames, demonstration=demonstration)
    observed = log_state_likelihoods(done.adapted, demonstration.x[:1])
    states = done.adapted.dynamics.most_probable_states(observed, HORIZON)
    drawn["figure-4.5-over-time"] = plots.tracked_coordinates(
        done.adapted, states, done.motion, demonstration=demonstration
    )
    drawn["figure-4.5-gains"] = plots.feedback_gains(done.feedback, done.adapted.layout)
    return drawn


if __name__ == "__main__":
    main()
