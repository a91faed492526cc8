"""Tables of the filter of states (`kernels/occupancy.py`) for the dynamics of a skill.

Two deviations from the learned chain keep the filter right for a person who is slower, pauses, or goes back:
the hazard is at most MAX_HAZARD, and at every step the state is drawn again with the probability RESET.

Invariant. With MAX_HAZARD = 1 and RESET = 0, the sum of the belief over ages equals
`SemiMarkovChain.filtered_state_probs`.
"""

import numpy as np

from pilotfish.kernels import OccupancyTables, StateFilter
from pilotfish.models import Dynamics, SemiMarkovChain
from pilotfish.types import Array, Float

MAX_HAZARD = 0.5  # per step
RESET = 1e-4  # per step
RESUMED = 0.5  # share of the belief that stays where autonomous control ended
TAIL_PROBABILITY = 1e-8  # of segments longer than the ages that are distinguished
MAX_AGES = 2000  # steps


def occupancy_tables(
    dynamics: Dynamics, *, max_hazard: float = MAX_HAZARD, reset: float = RESET
) -> OccupancyTables:
    """Return the tables of the filter for the dynamics of a skill.

    Args:
        dynamics: Mixture, Markov or semi-Markov dynamics.
        max_hazard: Largest probability that a segment ends at a step.
        reset: Probability per step that the state is drawn again.
    """
    if isinstance(dynamics, SemiMarkovChain):
        limit = min(dynamics.durations.max_duration(TAIL_PROBABILITY), MAX_AGES)
        log_survival = dynamics.durations.log_survival(limit)[0]
        hazards = np.exp(np.minimum(dynamics.durations.log_table(limit) - log_survival, 0.0))
        hazards = np.where(dynamics.final_states(), 0.0, np.minimum(hazards, max_hazard))
        hazards = np.ascontiguousarray(hazards)  # as the kernel reads it
        return OccupancyTables(dynamics.initial, dynamics.transitions, hazards, reset)
    _, steps = dynamics.step_probabilities()
    return OccupancyTables(dynamics.initial, steps, np.ones((1, len(steps))), reset)


def initial_belief(tables: OccupancyTables) -> Float[Array, "L K"]:
    """Return the belief before the first command: every state at age one with its initial probability.

    Args:
        tables: Tables of the skill.
    """
    belief = np.zeros_like(tables.hazards)
    belief[0] = (1.0 - tables.reset) * tables.initial + tables.reset / len(tables.initial)
    return belief


def start_filter(tables: OccupancyTables) -> StateFilter:
    """Return the filter before the first command.

    Args:
        tables: Tables of the skill.
    """
    return _unobserved(initial_belief(tables))


def resume_filter(tables: OccupancyTables, state: int | None) -> StateFilter:
    """Return the filter when the operator returns after autonomous control.

    Half of the belief stays in the state where autonomous control ended; half allows any state.

    Args:
        tables: Tables of the skill.
        state: State of the plan; None if it is not known.
    """
    belief = np.zeros_like(tables.hazards)
    belief[0] = (1.0 - RESUMED if state is not None else 1.0) / belief.shape[1]
    if state is not None:
        belief[0, state] += RESUMED
    return _unobserved(belief)


def _unobserved(belief: Float[Array, "L K"]) -> StateFilter:
    probs = belief.sum(axis=0)
    return StateFilter(belief, probs, probs, np.inf)
