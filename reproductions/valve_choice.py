"""The valve's test error when nothing but the four training demonstrations chooses the model.

    python reproductions/valve_choice.py --json choice.json

Table 4.1 prints .0119 for semi-tied covariances, with seven states, slack and effort given. Here states,
structure, regularisation, slack, effort, and whether frames are weighted by their relevance, are chosen by
replaying each training demonstration with the skill that the other three give; the four test demonstrations
are looked at once, for the choice. Protocol otherwise as in valve.py: durations counted, beginning with time
bins, replay from the first state's mean, mean squared difference of the seven pose coordinates. Beside the
choice stand the best without relevance, the configuration of table 4.1, and the choice for replays that begin
where the person began ("own start"), with all errors in both ways.

What the test error is made of: printed by fifths of the movement. A replay from the first state's mean knows
nothing of how the hand was held at the beginning, which no frame tells, and which differs most in the tests.

Source: Tanwani 2018, section 4.3.1, for the protocol and the figures it is compared with.
"""

import argparse
import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from protocol import CONTROL_COST, COVARIANCE_REGULARISATION

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

Powers = Float[Array, "P K"] | None


@dataclass(frozen=True, slots=True)
class Choice:
    """All that the training demonstrations decide, and the mean error of replaying what was held out."""

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
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", type=Path, help="file for the numbers")
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
        arguments.json.parent.mkdir(parents=True, exist_ok=True)
        arguments.json.write_text(json.dumps({"rows": rows, "tried": len(tried)}, indent=2) + "\n")


def search(train: Sequence[Demonstration]) -> Iterator[Choice]:
    """Every combination, scored by replaying each training demonstration with the skill of the others."""
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
                        powers if weighted else None,
                        left,
                        covariance_regularisation,
                        control_cost,
                        own_start,
                    ).mean()
                    for (skill, powers), left in folds
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
) -> tuple[pf.Skill, Powers]:
    settings = pf.models.EMSettings(regularisation=regularisation)
    rng = np.random.default_rng(0)
    skill = pf.learn(training, states=states, rng=rng, structure=structure, settings=settings).skill
    return skill, relevance(skill, training).values


def squared_errors(
    skill: pf.Skill,
    powers: Powers,
    training: Demonstration,
    covariance_regularisation: float,
    control_cost: float,
    own_start: bool,
) -> Float[Array, " T"]:
    """Mean squared difference of the pose coordinates at each step; infinite where frames contradict."""
    try:
        here = pf.adapt(skill, training.frames, relevance=powers)
    except pf.SkillError:
        return np.full(len(training.x), np.inf)
    horizon, start = len(training.x), training.x[0]
    if own_start:
        reference = pf.plan(here, start, horizon=horizon, covariance_regularisation=covariance_regularisation)
    else:
        reference = pf.plan(here, horizon=horizon, covariance_regularisation=covariance_regularisation)
        start = reference.targets[0]
    motion = pf.track(
        pf.control.double_integrator(7, period=training.period), reference, control_cost
    ).rollout(start)
    return np.asarray(((motion.x[:, :7] - training.x[:, :7]) ** 2).mean(axis=1))


def compare_choices(tried: Sequence[Choice]) -> dict[str, Choice]:
    def best(choices: Iterator[Choice]) -> Choice:
        return min(choices, key=lambda choice: choice.held_out)

    def as_printed(choice: Choice) -> bool:
        given = (
            choice.states,
            choice.structure,
            choice.regularisation,
            choice.covariance_regularisation,
            choice.control_cost,
        )
        return given == (7, pf.structures.SemiTied().label, 1e-5, COVARIANCE_REGULARISATION, CONTROL_COST)

    blind = [choice for choice in tried if not choice.own_start]
    return {
        "chosen": best(iter(blind)),
        "chosen without relevance": best(c for c in blind if not c.weighted),
        "table 4.1, semi-tied": next(c for c in blind if as_printed(c) and not c.weighted),
        "the same, weighted": next(c for c in blind if as_printed(c) and c.weighted),
        "chosen for own start": best(c for c in tried if c.own_start),
        "the same, without relevance": best(c for c in tried if c.own_start and not c.weighted),
    }


def row(choice: Choice, train: Sequence[Demonstration], test: Sequence[Demonstration]) -> dict[str, Any]:
    """The choice learned anew from all training demonstrations, and its errors, begun in both ways."""
    structure = next(s for s in STRUCTURES if s.label == choice.structure)
    skill, powers = learn_skill(train, choice.states, structure, choice.regularisation)
    heard = powers if choice.weighted else None

    def errors(training: Sequence[Demonstration], own_start: bool) -> Float[Array, "M T"]:
        replays = [
            squared_errors(skill, heard, d, choice.covariance_regularisation, choice.control_cost, own_start)
            for d in training
        ]
        return np.stack(replays)

    told = None if powers is None else powers.round(3).tolist()
    return {
        **asdict(choice),
        "train": float(errors(train, own_start=False).mean()),
        "test": float(errors(test, own_start=False).mean()),
        "train_own_start": float(errors(train, own_start=True).mean()),
        "test_own_start": float(errors(test, own_start=True).mean()),
        "test_by_fifths": errors_by_fifth(errors(test, own_start=False)),
        "relevance": told,
    }


def errors_by_fifth(errors: Float[Array, "M T"]) -> list[float]:
    """Mean errors of the first, second ... fifth part of the movement."""
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
