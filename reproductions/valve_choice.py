"""The valve's test error when nothing but the four training demonstrations chooses the model.

    python reproductions/valve_choice.py --json choice.json

Table 4.1 prints .0119 for semi-tied covariances, with given numbers of states, control cost and covariance
regularisation. Here these, the structure, the regularisation and the use of relevance weights are chosen by
leave-one-out on the four training demonstrations. The test demonstrations are used once, for the choice. The
protocol is otherwise that of protocol.py. Other rows are the best choice without relevance, the configuration
of table 4.1, and the choice for reproductions from the demonstration's own start.

The test error is also printed by fifths of the movement. A reproduction from the first state's mean has no
information about the initial orientation of the hand, which no frame contains and which varies most.

Source: Tanwani 2018, section 4.3.1, for the protocol and the figures it is compared with.
"""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import product
from typing import Any

import numpy as np
from protocol import (
    CONTROL_COST,
    COVARIANCE_REGULARISATION,
    argument_parser,
    write_numbers,
)
from protocol import learn_skill as learn_published

import pilotfish as pf
from pilotfish.demonstrations import Demonstration
from pilotfish.gaussians.structures import HDDC, MFA, CovarianceStructure
from pilotfish.models import relevance
from pilotfish.types import Array, Float

THESIS = 0.0119
STATES = range(4, 11)
STRUCTURES: tuple[CovarianceStructure, ...] = (
    pf.structures.Full(),
    pf.structures.Diagonal(),
    pf.structures.SemiTied(),
    HDDC(4),
    MFA(2),
)
REGULARISATIONS = (1e-5, 1e-4)
COVARIANCE_REGULARISATIONS = (2e-4, 2e-3, 2e-2)
CONTROL_COSTS = (1.0, 9.0)

Weights = Float[Array, "P K"] | None


@dataclass(frozen=True, slots=True)
class Choice:
    """Configuration, and its leave-one-out error on the training demonstrations."""

    states: int
    structure: str
    regularisation: float
    weighted: bool
    covariance_regularisation: float
    control_cost: float
    own_start: bool
    held_out: float
    standard_error: float


def main() -> None:
    parser = argument_parser(__doc__)
    arguments = parser.parse_args()
    try:
        demonstrations = pf.datasets.valve()
    except pf.SkillError as error:
        parser.exit(1, f"{error}\n")
    train, test = demonstrations[:4], demonstrations[4:]
    tried = list(search(train))
    rows = {name: row(choice, train, test) for name, choice in compare_choices(tried).items()}
    print_table(rows, len(tried))
    if arguments.json:
        write_numbers(arguments.json, {"rows": rows, "tried": len(tried)})


def search(train: Sequence[Demonstration]) -> Iterator[Choice]:
    """Yield every configuration with its leave-one-out error."""
    for states, structure, regularisation in product(STATES, STRUCTURES, REGULARISATIONS):
        try:
            folds = [
                (learn_skill([*train[:m], *train[m + 1 :]], states, structure, regularisation), left)
                for m, left in enumerate(train)
            ]
        except pf.SkillError as error:
            print(f"not learned: {states} states, {structure.label}, {regularisation:g}: {error}")
            continue
        for weighted, covariance_regularisation, control_cost, own_start in product(
            (False, True), COVARIANCE_REGULARISATIONS, CONTROL_COSTS, (False, True)
        ):
            errors = np.array(
                [
                    squared_errors(
                        skill,
                        weights if weighted else None,
                        left,
                        covariance_regularisation,
                        control_cost,
                        own_start,
                    ).mean()
                    for (skill, weights), left in folds
                ]
            )
            yield Choice(
                states,
                structure.label,
                regularisation,
                weighted,
                covariance_regularisation,
                control_cost,
                own_start,
                float(errors.mean()),
                float(errors.std(ddof=1) / np.sqrt(len(errors))),
            )


def learn_skill(
    training: Sequence[Demonstration], states: int, structure: CovarianceStructure, regularisation: float
) -> tuple[pf.Skill, Weights]:
    """Learn a skill and the relevance of its frames."""
    settings = pf.models.EMSettings(
        regularisation=regularisation, tolerance=1e-5, duration_regularisation=1.0
    )
    skill = learn_published(training, structure, states, settings).skill
    return skill, relevance(skill, training).values


def squared_errors(
    skill: pf.Skill,
    weights: Weights,
    demonstration: Demonstration,
    covariance_regularisation: float,
    control_cost: float,
    own_start: bool,
) -> Float[Array, " T"]:
    """Return the mean squared error of each step; infinite if the frames contradict each other."""
    try:
        adapted = pf.adapt(skill, demonstration.frames, relevance=weights)
    except pf.SkillError:
        return np.full(len(demonstration.x), np.inf)
    horizon, start = len(demonstration.x), demonstration.x[0]
    if own_start:
        reference = pf.plan(
            adapted,
            start,
            horizon=horizon,
            covariance_regularisation=covariance_regularisation,
            stepwise=True,
        )
    else:
        reference = pf.plan(
            adapted, horizon=horizon, covariance_regularisation=covariance_regularisation, stepwise=True
        )
        start = reference.targets[0]
    motion = pf.track(
        pf.control.double_integrator(7, period=demonstration.period), reference, control_cost
    ).rollout(start)
    return np.asarray(((motion.x[:, :7] - demonstration.x[:, :7]) ** 2).mean(axis=1))


def compare_choices(tried: Sequence[Choice]) -> dict[str, Choice]:
    """Return the best choices, and the configuration of the table."""

    def best(choices: Iterator[Choice]) -> Choice:
        return min(choices, key=lambda choice: choice.held_out)

    def as_printed(choice: Choice) -> bool:
        configuration = (
            choice.states,
            choice.structure,
            choice.regularisation,
            choice.covariance_regularisation,
            choice.control_cost,
        )
        semi_tied = pf.structures.SemiTied().label
        return configuration == (7, semi_tied, 1e-5, COVARIANCE_REGULARISATION, CONTROL_COST)

    from_mean = [choice for choice in tried if not choice.own_start]
    return {
        "chosen": best(iter(from_mean)),
        "chosen without relevance": best(c for c in from_mean if not c.weighted),
        "table 4.1, semi-tied": next(c for c in from_mean if as_printed(c) and not c.weighted),
        "the same, weighted": next(c for c in from_mean if as_printed(c) and c.weighted),
        "chosen for own start": best(c for c in tried if c.own_start),
        "the same, without relevance": best(c for c in tried if c.own_start and not c.weighted),
    }


def row(choice: Choice, train: Sequence[Demonstration], test: Sequence[Demonstration]) -> dict[str, Any]:
    """Learn a choice from all training demonstrations, and return its errors from both starts."""
    structure = next(s for s in STRUCTURES if s.label == choice.structure)
    skill, weights = learn_skill(train, choice.states, structure, choice.regularisation)
    used_weights = weights if choice.weighted else None
    control = choice.covariance_regularisation, choice.control_cost

    def errors(demonstrations: Sequence[Demonstration], own_start: bool) -> Float[Array, "M T"]:
        rows = [squared_errors(skill, used_weights, d, *control, own_start) for d in demonstrations]
        return np.stack(rows)

    settings = asdict(choice)
    settings["slack"] = settings.pop("covariance_regularisation")  # keys of the published file
    settings["effort"] = settings.pop("control_cost")
    return {
        **settings,
        "train": float(errors(train, own_start=False).mean()),
        "test": float(errors(test, own_start=False).mean()),
        "train_own_start": float(errors(train, own_start=True).mean()),
        "test_own_start": float(errors(test, own_start=True).mean()),
        "test_by_fifths": errors_by_fifth(errors(test, own_start=False)),
        "relevance": None if weights is None else weights.round(3).tolist(),
    }


def errors_by_fifth(errors: Float[Array, "M T"]) -> list[float]:
    """Return the mean error of each fifth of the movement."""
    return [float(part.mean()) for part in np.array_split(errors, 5, axis=1)]


def print_table(rows: dict[str, dict[str, Any]], tried: int) -> None:
    print(f"{tried} configurations, chosen by replaying training demonstrations that were held out")
    print(f"mean squared error; the thesis prints {THESIS} on the test demonstrations from the first mean")
    print(f"{'':29}{'held out':>18}{'train':>9}{'test':>9}  {'own start: train':>17}{'test':>9}")
    for name, row in rows.items():
        held_out = f"{row['held_out']:.5f} +- {row['standard_error']:.5f}"
        both = f"{row['train']:9.5f}{row['test']:9.5f}  {row['train_own_start']:17.5f}"
        print(f"{name:29}{held_out:>18}{both}{row['test_own_start']:9.5f}")
    for name, row in rows.items():
        print(
            f"{name}: {row['states']} states, {row['structure']}, regularisation {row['regularisation']:g}, "
            f"slack {row['slack']:g}, effort {row['effort']:g}, {'' if row['weighted'] else 'not '}weighted"
        )
        print(f"    test error by fifths of the movement: {np.round(row['test_by_fifths'], 5).tolist()}")


if __name__ == "__main__":
    main()
