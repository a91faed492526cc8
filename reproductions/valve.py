"""Opening a valve: figures 3.6, 3.7 and 4.5 and the valve rows of table 4.1, from the thesis' own recording.

    python reproductions/valve.py --json valve.json --out valve/

The protocol is that of protocol.py: the first four demonstrations train and the last four test, with a period
of 0.1 s and 200 steps. Beside the published error stands that of reproductions from each demonstration's own
start.

Source: Tanwani 2018, sections 3.4 and 4.3.1.
"""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from protocol import (
    Row,
    argument_parser,
    learn_skill,
    mean_error,
    print_table,
    reproduce_published,
    structure,
    table_row,
    write_figures,
    write_numbers,
)

import pilotfish as pf
from pilotfish import plots
from pilotfish.demonstrations import Demonstration
from pilotfish.gaussians.structures import component_correlation

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


def main() -> None:
    parser = argument_parser(__doc__)
    arguments = parser.parse_args()
    try:
        demonstrations = pf.datasets.valve()
    except pf.SkillError as error:
        parser.exit(1, f"{error}\n")
    parts = demonstrations[:4], demonstrations[4:]
    fits = {alpha: learn_skill(parts[0], structure(alpha)) for alpha in THESIS}
    rows = [table_row(alpha, fits[alpha], parts, THESIS[alpha]) | details(fits[alpha]) for alpha in THESIS]
    print("table 4.1, valve opening: mean squared error (thesis in brackets)")
    print_table(rows)
    print_sweeps(sweep_rows := sensitivity(*parts))
    for reason in NOT_REPRODUCED:
        print(f"not reproduced: {reason}")
    if arguments.out:
        write_figures(arguments.out, draw_figures(fits, demonstrations))
        print(f"pictures in {arguments.out}")
    if arguments.json:
        numbers = {"rows": rows, "sweeps": sweep_rows, "not_reproduced": NOT_REPRODUCED}
        write_numbers(arguments.json, numbers)


def details(fit: pf.models.Fit) -> Row:
    """Return log-likelihood and mean correlation of different components (4.25) in each frame."""
    different = ~np.eye(fit.skill.states, dtype=bool)
    return {
        "log_likelihood": float(fit.log_likelihoods[-1]),
        "mean_component_correlation": [
            float(component_correlation(c.dense)[different].mean()) for c in fit.skill.covariances
        ],
    }


def sensitivity(train: Sequence[Demonstration], test: Sequence[Demonstration]) -> list[Row]:
    """Return the semi-tied rows for other numbers of sweeps, the one free choice of the protocol."""
    rows: list[Row] = []
    for alpha in (0.5, 1.0):
        for sweeps in (1, 2, 3, 5, 10, 20, 50):
            skill = learn_skill(train, structure(alpha, sweeps)).skill
            errors = {"train_mse": mean_error(skill, train), "test_mse": mean_error(skill, test)}
            rows.append({"alpha": alpha, "sweeps": sweeps, **errors})
    return rows


def print_sweeps(rows: Sequence[Row]) -> None:
    print("the same for other numbers of semi-tied sweeps in each M-step")
    for row in rows:
        label = f"  alpha {row['alpha']}  sweeps {row['sweeps']:>2}"
        print(f"{label}  train {row['train_mse']:.5f}  test {row['test_mse']:.5f}")


def draw_figures(
    fits: dict[float, pf.models.Fit], demonstrations: Sequence[Demonstration]
) -> dict[str, Figure]:
    full, tied = fits[0.0].skill, fits[1.0].skill
    figures = {
        "figure-3.6-graph": plots.state_graph(full),
        "figure-3.6-forward-variable": plots.forward_variable(full, horizon=HORIZON),
        "figure-3.7-deviations": plots.state_deviations(full),
        "figure-3.7-seen-from-frames": plots.demonstrations_in_frames(full, demonstrations[:4]),
        "figure-4.5-correlation": plots.covariance_correlations([full, tied]),
        "figure-4.5-basis": plots.basis_vectors(tied),
        "trace": plots.likelihood_trace(list(fits.values())),
    }
    for name, skill, demonstration in (
        ("figure-3.6-training", full, demonstrations[0]),
        ("figure-3.6-unseen", full, demonstrations[6]),
        ("figure-4.5-full", full, demonstrations[4]),
        ("figure-4.5-semi-tied", tied, demonstrations[4]),
    ):
        done = reproduce_published(skill, demonstration)
        frames = [frame for frame in demonstration.frames if isinstance(frame, pf.Frame)]
        figures[name] = plots.reproduction(done.adapted, done.motion, frames, demonstration=demonstration)
    observed = done.adapted.log_state_likelihoods(demonstration.x[:1])
    states = done.adapted.dynamics.most_probable_states(observed, HORIZON)
    figures["figure-4.5-over-time"] = plots.tracked_coordinates(
        done.adapted, states, done.motion, demonstration=demonstration
    )
    figures["figure-4.5-gains"] = plots.feedback_gains(done.feedback, done.adapted.layout)
    return figures


if __name__ == "__main__":
    main()
