"""The valve's test error when nothing but the four training demonstrations chooses the model.

    python reproductions/valve_choice.py --json choice.json

Table 4.1 prints .0119 for semi-tied covariances, with seven states, slack and effort given. Here states,
structure, regularisation, slack, effort, and whether frames are weighted by their relevance, are chosen by
replaying each training demonstration with the skill that the other three give; the four test demonstrations
are looked at once, for the choice. Protocol otherwise as in valve.py: durations counted, beginning with time
bins, replay from the first state's mean, mean squared difference of the seven pose coordinates. Beside the
choice stand the best without relevance, and the configuration of table 4.1.

Source: Tanwani 2018, section 4.3.1, for the protocol and the figures it is compared with.
"""

import argparse
import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import product
from pathlib import Path

import numpy as np

import pilotfish as pf
from pilotfish.demonstrations import Demonstration
from pilotfish.gaussians import HDDC, MFA, Structure
from pilotfish.models import relevance
from pilotfish.planning import expected_plan
from pilotfish.station.evaluation import EFFORT, SLACK, mean_squared_error
from pilotfish.types import Array, Float

THESIS = 0.0119
STATES = range(4, 11)
STRUCTURES: tuple[Structure, ...] = (pf.Full(), pf.Diagonal(), pf.SemiTied(), HDDC(4), MFA(2))
REGULARISATIONS = (1e-5, 1e-4)
SLACKS = (2e-4, 2e-3, 2e-2)
EFFORTS = (1.0, 9.0)

Powers = Float[Array, "P K"] | None


@dataclass(frozen=True, slots=True)
class Choice:
    """All that the training demonstrations decide, and the mean error of replaying what was held out."""

    states: int
    structure: str
    regularisation: float
    weighted: bool
    slack: float
    effort: float
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
    rows = {name: row(choice, train, test) for name, choice in compared(tried).items()}
    print_table(rows, len(tried))
    if arguments.json:
        arguments.json.parent.mkdir(parents=True, exist_ok=True)
        arguments.json.write_text(json.dumps({"rows": rows, "tried": len(tried)}, indent=2) + "\n")


def search(train: Sequence[Demonstration]) -> Iterator[Choice]:
    """Every combination, scored by replaying each training demonstration with the skill of the others."""
    for states, structure, regularisation in product(STATES, STRUCTURES, REGULARISATIONS):
        try:
            folds = [
                (learned([*train[:m], *train[m + 1 :]], states, structure, regularisation), left)
                for m, left in enumerate(train)
            ]
        except pf.SkillError as error:
            print(f"not learned: {states} states, {structure.label}, {regularisation:g}: {error}")
            continue
        for weighted, slack, effort in product((False, True), SLACKS, EFFORTS):
            errors = np.array(
                [
                    replay_error(skill, powers if weighted else None, left, slack, effort)
                    for (skill, powers), left in folds
                ]
            )
            yield Choice(
                states,
                structure.label,
                regularisation,
                weighted,
                slack,
                effort,
                float(errors.mean()),
                float(errors.std(ddof=1) / np.sqrt(len(errors))),
            )


def learned(
    shown: Sequence[Demonstration], states: int, structure: Structure, regularisation: float
) -> tuple[pf.Skill, Powers]:
    settings = pf.EMSettings(regularisation=regularisation)
    rng = np.random.default_rng(0)
    skill = pf.learn(shown, states=states, rng=rng, structure=structure, settings=settings).skill
    return skill, relevance(skill, shown).values


def replay_error(
    skill: pf.Skill, powers: Powers, demonstration: Demonstration, slack: float, effort: float
) -> float:
    """From the first state's mean, as in table 4.1; infinite where frames contradict each other."""
    try:
        here = pf.adapt(skill, demonstration.frames, relevance=powers)
    except pf.SkillError:
        return np.inf
    reference = expected_plan(here, horizon=len(demonstration.x), slack=slack)
    feedback = pf.track(pf.double_integrator(7, period=demonstration.period), reference, effort)
    return mean_squared_error(feedback.rollout(reference.targets[0]), demonstration)


def compared(tried: Sequence[Choice]) -> dict[str, Choice]:
    def best(choices: Iterator[Choice]) -> Choice:
        return min(choices, key=lambda choice: choice.held_out)

    def as_printed(choice: Choice) -> bool:
        given = (choice.states, choice.structure, choice.regularisation, choice.slack, choice.effort)
        return given == (7, pf.SemiTied().label, 1e-5, SLACK, EFFORT)

    return {
        "chosen": best(iter(tried)),
        "chosen without relevance": best(c for c in tried if not c.weighted),
        "table 4.1, semi-tied": next(c for c in tried if as_printed(c) and not c.weighted),
        "the same, weighted": next(c for c in tried if as_printed(c) and c.weighted),
    }


def row(choice: Choice, train: Sequence[Demonstration], test: Sequence[Demonstration]) -> dict[str, object]:
    """The choice learned anew from all training demonstrations, and its errors."""
    structure = next(s for s in STRUCTURES if s.label == choice.structure)
    skill, powers = learned(train, choice.states, structure, choice.regularisation)
    errors = [
        np.mean(
            [
                replay_error(skill, powers if choice.weighted else None, d, choice.slack, choice.effort)
                for d in part
            ]
        )
        for part in (train, test)
    ]
    told = None if powers is None else powers.round(3).tolist()
    return {**asdict(choice), "train": float(errors[0]), "test": float(errors[1]), "relevance": told}


def print_table(rows: dict[str, dict[str, object]], tried: int) -> None:
    print(f"{tried} configurations, chosen by replaying training demonstrations that were held out")
    print(f"mean squared error; the thesis prints {THESIS} on the test demonstrations")
    print(f"{'':26}{'held out':>16}{'train':>9}{'test':>9}   configuration")
    for name, row in rows.items():
        configuration = (
            f"{row['states']} states, {row['structure']}, regularisation {row['regularisation']:g}, "
            f"slack {row['slack']:g}, effort {row['effort']:g}, {'' if row['weighted'] else 'not '}weighted"
        )
        held_out = f"{row['held_out']:.5f} +- {row['standard_error']:.5f}"
        print(f"{name:26}{held_out:>16}{row['train']:9.5f}{row['test']:9.5f}   {configuration}")


if __name__ == "__main__":
    main()
