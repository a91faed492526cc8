"""Semi-Markov chain with explicit durations: the dynamics of a TP-HSMM.

Model. The first step is in state k with probability pi_k. A segment of state k lasts d steps with probability
p_k(d) from its duration distribution, then the chain moves to state j with probability a_kj; a_kk = 0. A row
of zeros in a is a final state: the chain never leaves it, however long the recording.

Tables. The forward-backward and Viterbi kernels (`kernels.semi_markov*`) take log-probabilities of segments
of s = 1 .. L recorded steps in four kinds, by whether the recording cuts them off (`durations/segments.py`):

    0 uncensored       log p(s)                    final state: impossible
    1 first segment    left-censored:  log S(s) - log mean       else as 0
    2 last segment     right-censored: log S(s)                  else as 0
    3 only segment     both: log sum_{d >= s} S(d) - log mean    else as 1 or 2

A final state has log-probability 0 for a right-censored last segment of any length.

Maximum duration. Tables end at L steps. A fit takes the smallest L that every state exceeds with a
probability of at most 1e-8, and never less than in the iteration before, so that the likelihood of EM cannot
fall by it. Evaluation doubles L until the log-likelihood changes by less than 1e-8 nats per step: data may
contain a segment far longer than its distribution expects.

Keep in step: the order of the four kinds with `kernels.SemiMarkovTables` and with `_count_segments`; the
terms with the likelihood of `durations/fit.py`.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar, TypeVar

import numpy as np

from pilotfish import kernels
from pilotfish.errors import InvalidInput
from pilotfish.models.duration_model import Censoring, DurationModel
from pilotfish.models.durations import DurationDistribution, Segments
from pilotfish.models.dynamics import (
    MAX_HORIZON,
    EStep,
    MarkovChain,
    MixtureWeights,
    StateDynamics,
    count_free_probabilities,
    pad_unobserved,
    validate_observations,
)
from pilotfish.models.statistics import Statistics
from pilotfish.types import Array, Bool, Float, Int
from pilotfish.validation import require_count, shorten_repr

TAIL_PROBABILITY = 1e-8  # of segments longer than the maximum duration, and gain per step [nats]
SAMPLING_TAIL_PROBABILITY = 1e-12  # of segments longer than those that are sampled
FULL_LENGTH_FACTOR = 4  # recordings up to this multiple of the maximum duration are evaluated in full

Result = TypeVar("Result")


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class SemiMarkovChain(StateDynamics):
    """Semi-Markov chain over the states of a hidden semi-Markov model (TP-HSMM).

    Attributes:
        initial: Probability of each state at the first step.
        transitions: transitions[i, j] is the probability that a segment of state j follows one of state i.
            The diagonal is zero; a row of zeros is a final state.
        durations: Duration distribution of the states.
        censoring: Which ends of a recording may cut off a segment.
    """

    name: ClassVar[str] = "semi-markov"
    initial: Float[Array, " K"]
    transitions: Float[Array, "K K"]
    durations: DurationDistribution
    censoring: Censoring = Censoring.RIGHT

    @classmethod
    def fit(
        cls,
        statistics: Statistics,
        previous: object = None,
        *,
        duration_model: DurationModel,
        min_variance: float,
    ) -> "SemiMarkovChain":
        """Compute the maximum-likelihood chain from expected counts and segments (M-step).

        Args:
            statistics: Expected statistics of a semi-Markov model.
            previous: Dynamics of the previous iteration; the durations are fitted from there.
            duration_model: How durations are fitted.
            min_variance: Lower bound of the variance of the durations [steps^2].

        Returns:
            The chain.

        Raises:
            InvalidInput: If the statistics contain no segments.
        """
        if statistics.segments is None:
            raise InvalidInput("statistics has no segments, expected those of a semi-Markov model")
        before = previous if isinstance(previous, SemiMarkovChain) else None
        durations = duration_model.fit(
            statistics.segments, before.durations if before else None, min_variance
        )
        exits = statistics.transitions * (1.0 - np.eye(len(statistics.initial_counts)))
        departures = np.where(_select_final_states(statistics, before), 0.0, exits.sum(axis=1))[:, None]
        transitions = np.divide(exits, departures, out=np.zeros_like(exits), where=departures > 0.0)
        initial = statistics.initial_counts / statistics.initial_counts.sum()
        return cls(initial, transitions, durations, duration_model.censoring)

    def step_probabilities(self) -> tuple[Float[Array, " K"], Float[Array, "K K"]]:
        raise InvalidInput(
            "the skill has semi-Markov dynamics without one-step transitions; use the Markov skill, "
            "fit.markov_skill"
        )

    def final_states(self) -> Bool[Array, " K"]:
        return np.asarray(~self.transitions.any(axis=1))

    def forward(
        self, log_observed: Float[Array, "S K"], horizon: int
    ) -> tuple[Float[Array, "T K"], Float[Array, "T K"]]:
        """Compute the forward variables (3.40, 3.41) over `horizon` steps in O(T K (K + L)).

        Args:
            log_observed: log b_k(x_t) of the first S steps, finite; later steps are not observed.
            horizon: Number of steps T, at least S.

        Returns:
            `log_segment_ends[t, k]`, the log-probability of the observations and of a segment of state k that
            ends with step t, and `log_forward[t, k]`, of the observations and of state k at step t.

        Raises:
            InvalidInput: If a log-density is not finite, or the horizon is too short or too long.

        Source:
            Tanwani 2018, equations 3.40-3.41, with the segments that begin at t = 1, which (3.40) omits.
        """
        validate_observations(log_observed, horizon)
        log_emissions = pad_unobserved(log_observed, horizon)
        chain = self._right_censored()
        return self._extend_max_duration(
            horizon,
            lambda limit: kernels.semi_markov_forward(log_emissions, chain.segment_tables(limit)),
            lambda result: np.logaddexp.reduce(result[1], axis=1),
        )

    def log_forward(self, log_observed: Float[Array, "S K"], horizon: int) -> Float[Array, "T K"]:
        return self.forward(log_observed, horizon)[1]

    def viterbi(self, log_emissions: Float[Array, "T K"]) -> Int[Array, " T"]:
        return self._decode(log_emissions, self.segment_tables)[0]

    def _plan_complete(self, relative: Float[Array, "T K"]) -> tuple[Int[Array, " T"], bool]:
        """Return the most probable sequence whose last segment is a whole one of a final state.

        A longer or shorter horizon stretches or shortens all segments, in proportion to the variances of
        their durations.
        """
        states, log_p = self._decode(relative, self._right_censored()._completing_tables)
        return states, bool(np.isfinite(log_p))

    def _plan_incomplete(self, relative: Float[Array, "T K"]) -> Int[Array, " T"]:
        return self._decode(relative, self._right_censored().segment_tables)[0]

    def _decode(
        self, log_emissions: Float[Array, "T K"], tables: Callable[[int], kernels.SemiMarkovTables]
    ) -> tuple[Int[Array, " T"], float]:
        return self._extend_max_duration(
            len(log_emissions),
            lambda limit: kernels.semi_markov_viterbi(log_emissions, tables(limit)),
            lambda path: np.array(path[1]),
        )

    def _completing_tables(self, max_duration: int) -> kernels.SemiMarkovTables:
        """Return the tables of sequences whose last segment is a whole one of a final state."""
        tables = self.segment_tables(max_duration)
        ending = np.where(self.final_states(), self.durations.log_table(max_duration), -np.inf)
        weights = np.stack([*tables.log_segment_weights[:2], ending, ending])
        return replace(
            tables,
            log_segment_weights=weights,
            log_tail_weights=np.full_like(tables.log_tail_weights, -np.inf),
        )

    def log_likelihood(self, log_emissions: Float[Array, "T K"], max_duration: int | None = None) -> float:
        def compute(limit: int) -> float:
            return kernels.semi_markov_forward_backward(
                log_emissions, self.segment_tables(limit)
            ).log_likelihood

        if max_duration is not None:
            return compute(min(max_duration, len(log_emissions)))
        return float(self._extend_max_duration(len(log_emissions), compute, np.array))

    def e_step(
        self,
        x: Float[Array, "P N D"],
        lengths: Int[Array, " M"],
        emissions: kernels.Emissions,
        *,
        max_duration: int | None = None,
        threads: int = 1,
        final: Float[Array, " K"] | None = None,
    ) -> EStep:
        limit = max_duration or self.durations.max_duration(TAIL_PROBABILITY)
        tables = self.segment_tables(min(limit, int(lengths.max())))
        step = kernels.semi_markov_e_step(x, lengths, tables, emissions, threads)
        return step, self._count_segments(step.segment_counts)

    def sample(self, horizon: int, rng: np.random.Generator) -> Int[Array, " T"]:
        require_count(horizon, "horizon", MAX_HORIZON, 1)
        limit = min(self.durations.max_duration(SAMPLING_TAIL_PROBABILITY), horizon)
        table = np.exp(self.durations.log_table(limit))  # (S, K)
        table[-1] = (1.0 - table[:-1].sum(axis=0)).clip(min=0.0)  # all longer segments
        state = int(rng.choice(len(self.initial), p=self.initial))
        lengths = self._residual_durations(limit) if self.censoring.left else table
        states: list[int] = []
        while len(states) < horizon:
            next_probs = self.transitions[state]
            if not next_probs.any():
                return np.array(states + [state] * (horizon - len(states)))
            duration_probs = lengths[:, state] / lengths[:, state].sum()
            states += [state] * int(rng.choice(len(duration_probs), p=duration_probs) + 1)
            state, lengths = int(rng.choice(len(next_probs), p=next_probs)), table
        return np.array(states[:horizon])

    def degrees_of_freedom(self, fixed_duration_parameters: int = 0) -> int:
        probabilities = count_free_probabilities(self.initial[None]) + count_free_probabilities(
            self.transitions
        )
        return probabilities + self.durations.degrees_of_freedom(
            ~self.final_states(), fixed_duration_parameters
        )

    def segment_tables(self, max_duration: int) -> kernels.SemiMarkovTables:
        """Return the log-probabilities of segments up to max_duration, as defined at the head of this file.

        Args:
            max_duration: Longest segment L [steps].
        """
        log_p = self.durations.log_table(max_duration)
        log_tail, log_tail_sum = self.durations.log_survival(max_duration)
        log_residual, log_residual_tail = log_tail - log_tail_sum[0], log_tail_sum - log_tail_sum[0]
        left, right, final = self.censoring.left, self.censoring.right, self.final_states()
        uncensored = np.where(final, -np.inf, log_p)
        first = np.where(final, -np.inf, log_residual) if left else uncensored
        last = np.where(final, 0.0, log_tail) if right else log_p
        if left and right:
            only = np.where(final, 0.0, log_residual_tail)
        else:
            only = log_residual if left else last
        log_beyond = np.where(final & right, 0.0, -np.inf)
        return kernels.SemiMarkovTables(
            self.initial,
            self.transitions,
            np.stack([uncensored, first, last, only]),
            np.stack([log_beyond, log_beyond]),
        )

    def _count_segments(self, counts: Float[Array, "4 S K"]) -> Segments:
        """Sort the segments of the kernel by censoring; final states do not inform about durations."""
        uncensored, first, last, only = counts
        zeros, not_final = np.zeros_like(uncensored), ~self.final_states()
        if self.censoring is Censoring.NONE:
            return Segments.all_uncensored(uncensored + first + last + only)
        if self.censoring is Censoring.LEFT:
            return Segments(uncensored + last, zeros, first + only, zeros)
        if self.censoring is Censoring.RIGHT:
            return Segments(uncensored + first, (last + only) * not_final, zeros, zeros * not_final)
        return Segments(uncensored, last * not_final, first, only * not_final)

    def _residual_durations(self, max_duration: int) -> Float[Array, "S K"]:
        """Return p(s steps remain at a random step of a segment), up to a factor."""
        log_tail, log_tail_sum = self.durations.log_survival(max_duration)
        return np.asarray(np.exp(np.concatenate([log_tail[:-1], log_tail_sum[-1:]])))

    def _right_censored(self) -> "SemiMarkovChain":
        return replace(self, censoring=self.censoring.with_right())

    def _smooth(self, relative: Float[Array, "T K"]) -> Float[Array, "T K"]:
        chain = self._right_censored()
        return self._extend_max_duration(
            len(relative),
            lambda limit: kernels.semi_markov_forward_backward(relative, chain.segment_tables(limit)),
            lambda result: np.array(result.log_likelihood),
        ).smoothed_state_probs

    def _extend_max_duration(
        self,
        steps: int,
        compute: Callable[[int], Result],
        log_p: Callable[[Result], Float[Array, "*n"]],
    ) -> Result:
        """Double the maximum duration until no log-probability gains more than 1e-8 nats per step."""
        limit = self.durations.max_duration(TAIL_PROBABILITY)
        if steps <= FULL_LENGTH_FACTOR * limit:
            return compute(steps)
        result = compute(limit)
        while limit < steps:
            limit = min(2 * limit, steps)
            before, result = log_p(result), compute(limit)
            with np.errstate(invalid="ignore"):  # -inf - -inf: impossible before and after
                if (log_p(result) - before <= TAIL_PROBABILITY * steps).all():
                    break
        return result


Dynamics = MixtureWeights | MarkovChain | SemiMarkovChain


def _select_final_states(statistics: Statistics, before: SemiMarkovChain | None) -> Bool[Array, " K"]:
    """Return the states with less than half a departure that are at least as likely without any.

    A path that never leaves keeps at least 1 - departures of its likelihood; it gains the survival
    probability of its right-censored segments.
    """
    departures = statistics.transitions.sum(axis=1)
    rarely_left = departures < 0.5
    if before is None or statistics.segments is None:
        return np.asarray(rarely_left)
    right_censored = statistics.segments.right_censored
    log_tail, _ = before.durations.log_survival(len(right_censored))
    gains = -(right_censored * np.where(right_censored > 0.0, log_tail, 0.0)).sum(axis=0)
    losses = -np.log1p(-np.where(rarely_left, departures, 0.0))
    return np.asarray(before.final_states() | (rarely_left & (losses <= gains)))
