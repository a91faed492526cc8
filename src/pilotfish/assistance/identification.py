"""The filter of a running skill: its belief, advanced once per period, with probabilities between."""

from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from pilotfish.assistance.assistant import AssistedSkill
from pilotfish.assistance.occupancy import OccupancyTables, initial_belief, observe_command, predict_belief
from pilotfish.assistance.situation import Situation
from pilotfish.errors import SkillError
from pilotfish.types import Array, Float
from pilotfish.validation import shorten_repr

RESUMED = 0.5  # share of the belief that stays where autonomous control ended
ROUNDING = 1e-9  # of a period


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Identification:
    """Belief about the state, of the skill and of its joint skill, if there is one.

    Attributes:
        beliefs: Probability of each age and state, (L, K), of the skill, then of the joint skill.
        before: Probability of each state one observation ago.
        now: Probability of each state at the last observation.
        elapsed: Time since the last observation [s]; infinite before the first.
    """

    beliefs: tuple[Array, ...]
    before: tuple[Array, ...]
    now: tuple[Array, ...]
    elapsed: float

    def probabilities(self, period: float, dt: float) -> tuple[Array, ...]:
        """Return the probability of each state, interpolated over a period.

        Args:
            period: Period of the skill [s].
            dt: Time of a step [s]; steps of a period or more take the last observation.
        """
        s = min(1.0, (self.elapsed + dt) / period)
        return tuple((1.0 - s) * p + s * q for p, q in zip(self.before, self.now, strict=True))


def begin_identification(skill: AssistedSkill) -> Identification:
    """Return the filter before the first command.

    Args:
        skill: Prepared skill.
    """
    beliefs = tuple(initial_belief(tables) for tables in _tables(skill))
    probs = tuple(belief.sum(axis=0) for belief in beliefs)
    return Identification(beliefs, probs, probs, np.inf)


def advance_identification(
    before: Identification, skill: AssistedSkill, situation: Situation, x: Float[Array, " D"], dt: float
) -> Identification:
    """Return the filter after a step of time dt; a command is observed once per period of the skill.

    Args:
        before: Filter before the step.
        skill: Prepared skill.
        situation: The skill in the present frames.
        x: Command.
        dt: Time of the step [s].
    """
    period, is_first = skill.skill.period, before.elapsed == np.inf
    elapsed = before.elapsed + dt
    if elapsed < (1.0 - ROUNDING) * period:
        return replace(before, elapsed=elapsed)
    steps = 0 if is_first else min(int(elapsed / period + ROUNDING), 100)
    models = (situation.carried, situation.literal)
    beliefs = []
    for tables, belief, model in zip(_tables(skill), before.beliefs, models, strict=False):
        assert model is not None
        for _ in range(steps):
            belief = predict_belief(tables, belief)
        with suppress(SkillError):  # too far for a finite density: nothing is learned from it
            belief = observe_command(belief, model.log_likelihoods(x))
        beliefs.append(belief)
    now = tuple(belief.sum(axis=0) for belief in beliefs)
    remainder = 0.0 if is_first else max(0.0, elapsed - steps * period)
    return Identification(tuple(beliefs), now if is_first else before.now, now, remainder)


def resume_identification(before: Identification, skill: AssistedSkill, state: int) -> Identification:
    """Return the filter when the operator returns after autonomous control.

    Half of the belief stays in the state where autonomous control ended; half allows any state.

    Args:
        before: Filter when autonomous control began.
        skill: Prepared skill.
        state: State of the plan.
    """
    belief = np.zeros_like(before.beliefs[0])
    belief[0] = (1.0 - RESUMED) / belief.shape[1]
    belief[0, state] += RESUMED
    others = []
    for table in _tables(skill)[1:]:
        any_state = np.zeros_like(table.hazards)
        any_state[0] = 1.0 / any_state.shape[1]
        others.append(any_state)
    beliefs = (belief, *others)
    probs = tuple(b.sum(axis=0) for b in beliefs)
    return Identification(beliefs, probs, probs, np.inf)


def _tables(skill: AssistedSkill) -> tuple[OccupancyTables, ...]:
    return (skill.tables, skill.joint_tables) if skill.joint_tables else (skill.tables,)
