"""Dynamics of a skill: the prior over its state sequence.

A skill has K states with Gaussian emissions b_k(x). Its dynamics say how states follow one another:

    mixture      every step draws its state independently, p(k) = w_k                              (TP-GMM)
    Markov       p(k_0) = pi_k and p(k_t = j | k_t-1 = i) = a_ij; durations are geometric          (TP-HMM)
    semi-Markov  a segment of state k lasts d steps with probability p_k(d), see `semi_markov.py` (TP-HSMM)

All three have the same methods, so that planning, regression, relevance and files need not tell them apart.
The forward-backward algorithm gives the filtered and the smoothed state probabilities (Rabiner 1989, eq.
19-27; Tanwani 2018, 3.8-3.11, 3.38-3.41), the Viterbi algorithm the most probable sequence. A step without an
observation has log-density zero in every state: filtering beyond the observed prefix is then prediction.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pilotfish import kernels
from pilotfish.errors import InvalidInput
from pilotfish.models.durations import Segments
from pilotfish.models.statistics import Statistics
from pilotfish.types import Array, Bool, Float, Int
from pilotfish.validation import require_count, shorten_repr

MAX_HORIZON = 1_000_000  # steps
MAX_STATE_PROBS = 2**24  # numbers for every step and state; a few arrays of them are held at a time

EStep = tuple[kernels.EStep, Segments | None]


class StateDynamics(ABC):
    """Prior over the state sequence of a skill, the base class of the three kinds of dynamics.

    Methods that are not abstract hold for dynamics of single steps (mixture, Markov chain).
    """

    __slots__ = ()
    name: ClassVar[str]
    has_time_order: ClassVar[bool] = True

    @abstractmethod
    def step_probabilities(self) -> tuple[Float[Array, " K"], Float[Array, "K K"]]:
        """Return the initial probabilities and the transition matrix of one step.

        Raises:
            InvalidInput: If the dynamics are semi-Markov, which have no transition matrix of one step.
        """

    @abstractmethod
    def sample(self, horizon: int, rng: np.random.Generator) -> Int[Array, " T"]:
        """Return a random state sequence; branches of a movement appear with their probabilities.

        A final state lasts to the end.

        Args:
            horizon: Number of steps.
            rng: Source of randomness.
        """

    @abstractmethod
    def degrees_of_freedom(self, fixed_duration_parameters: int = 0) -> int:
        """Return the number of free parameters of the dynamics.

        Probabilities that sum to one have one free parameter less. A probability of zero counts as fixed:
        a left-right initialisation excludes it, and expectation-maximisation never makes it positive.
        Durations of final states are not identifiable and do not count.

        Args:
            fixed_duration_parameters: Parameters of each duration distribution that the fit held fixed, such
                as the shape of a negative binomial.
        """

    @abstractmethod
    def final_states(self) -> Bool[Array, " K"]:
        """Return whether each state is never left; a mixture has no final state."""

    @abstractmethod
    def _smooth(self, relative: Float[Array, "T K"]) -> Float[Array, "T K"]: ...

    def log_forward(self, log_observed: Float[Array, "S K"], horizon: int) -> Float[Array, "T K"]:
        """Compute the forward variable log p(x_0 .. x_t, state k at step t) (3.8, 3.41).

        Args:
            log_observed: log b_k(x_t) of the first S steps, finite; later steps are not observed.
            horizon: Number of steps T, at least S.

        Raises:
            InvalidInput: If the dynamics are a mixture, which has no order in time; if a log-density is not
                finite; if the horizon is too short or too long.
        """
        validate_observations(log_observed, horizon)
        padded = pad_unobserved(log_observed, horizon)
        return kernels.forward_backward(padded, *self.step_probabilities()).log_forward

    def filtered_state_probs(self, log_observed: Float[Array, "S K"], horizon: int) -> Float[Array, "T K"]:
        """Compute p(state k at step t | observations up to step t); rows sum to one.

        Within the S observed steps this is filtering (3.38), beyond them prediction (3.41). Without an
        observation (S = 0) it is the prior.

        Args:
            log_observed: log b_k(x_t) of the first S steps, finite.
            horizon: Number of steps T, at least S.

        Raises:
            InvalidInput: As `log_forward` does.
        """
        validate_observations(log_observed, horizon)
        relative = log_observed - log_observed.max(axis=1, keepdims=True, initial=-np.inf)
        log_p = self.log_forward(relative, horizon)
        return np.asarray(np.exp(log_p - np.logaddexp.reduce(log_p, axis=1)[:, None]))

    def most_probable_states(self, log_observed: Float[Array, "S K"], horizon: int) -> Int[Array, " T"]:
        """Return the state of largest filtered probability at every step (3.42), a deterministic plan.

        Args:
            log_observed: log b_k(x_t) of the first S steps, finite.
            horizon: Number of steps T, at least S.
        """
        return np.asarray(self.filtered_state_probs(log_observed, horizon).argmax(axis=1))

    def plan_states(
        self, log_observed: Float[Array, "S K"], horizon: int, *, complete: bool
    ) -> Int[Array, " T"]:
        """Return a state sequence for a plan.

        It is the most probable sequence of a semi-Markov chain, and the state of largest posterior
        probability at every step of a Markov chain. With fewer steps than states, a complete sequence is
        planned for as many steps as states, and states are passed over at equal distances.

        Args:
            log_observed: log b_k(x_t) of the first S steps, finite; a row of zeros has no observation.
            horizon: Number of steps T, at least S.
            complete: Whether the sequence ends in a final state; ignored where there is none or it cannot be
                reached.

        Raises:
            InvalidInput: As `log_forward` does.
        """
        relative = relative_observations(log_observed, horizon)
        if complete and self.final_states().any():
            (states, reached), (T, K) = self._plan_complete(relative), relative.shape
            if reached:
                return states
            if T < K:
                rows = np.linspace(K - 1, 0, T).round().astype(np.int64)[::-1]
                spread = np.zeros((K, K))
                spread[rows] = relative
                states, reached = self._plan_complete(spread)
                if reached:
                    return states[rows]
        return self._plan_incomplete(relative)

    def _plan_complete(self, relative: Float[Array, "T K"]) -> tuple[Int[Array, " T"], bool]:
        """Return a sequence that ends in a final state, and whether there is one."""
        ending = relative.copy()
        ending[-1, ~self.final_states()] = -np.inf
        result = kernels.forward_backward(ending, *self.step_probabilities())
        return result.smoothed_state_probs.argmax(axis=1), bool(np.isfinite(result.log_likelihood))

    def _plan_incomplete(self, relative: Float[Array, "T K"]) -> Int[Array, " T"]:
        return np.asarray(self._smooth(relative).argmax(axis=1))

    def smoothed_state_probs(self, log_observed: Float[Array, "T K"]) -> Float[Array, "T K"]:
        """Compute p(state k at step t | all T observations) by forward-backward; rows sum to one.

        The last segment may last beyond step T: it is right-censored.

        Args:
            log_observed: log b_k(x_t), finite; a row of zeros is a step without an observation.

        Raises:
            InvalidInput: If log_observed has no rows, or a log-density is not finite.

        Source:
            Rabiner 1989, eq. 27; Yu 2010 for explicit durations.
        """
        if not len(log_observed):
            raise InvalidInput("log_observed has no rows, expected at least one; pass a row of zeros")
        _require_finite(log_observed, "that it is in the units of the demonstrations")
        return self._smooth(np.ascontiguousarray(log_observed - log_observed.max(axis=1, keepdims=True)))

    def viterbi(self, log_emissions: Float[Array, "T K"]) -> Int[Array, " T"]:
        """Compute the most probable state sequence of one recording.

        Args:
            log_emissions: log b_k(x_t).
        """
        states, _ = kernels.viterbi(log_emissions, *self.step_probabilities())
        return states

    def log_likelihood(self, log_emissions: Float[Array, "T K"], max_duration: int | None = None) -> float:
        """Compute log p(x_0 .. x_T-1), summed over all state sequences [nats].

        Args:
            log_emissions: log b_k(x_t).
            max_duration: Longest segment of a semi-Markov chain [steps]. By default it is doubled until the
                result changes by less than 1e-8 nats per step.
        """
        return kernels.forward_backward(log_emissions, *self.step_probabilities()).log_likelihood

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
        """Compute expected sufficient statistics by the forward-backward algorithm (3.8-3.15).

        Args:
            x: Datapoints of all recordings, one after another, as every frame sees them.
            lengths: Number of steps of each recording.
            emissions: Gaussians of the states in every frame.
            max_duration: Longest segment of a semi-Markov chain [steps]. By default every segment is longer
                with a probability of at most 1e-8.
            threads: Number of threads; 0 uses all cores. The sums do not depend on it.
            final: Probability of a recording to end at its last step, given the state there; None is 1. A
                semi-Markov chain has the censoring of its segments instead.

        Returns:
            The sums of the kernel, and the expected segments of a semi-Markov chain.
        """
        return kernels.e_step(x, lengths, *self.step_probabilities(), emissions, threads, final), None


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class MarkovChain(StateDynamics):
    """Markov chain over the states of a hidden Markov model (TP-HMM).

    Attributes:
        initial: Probability of each state at the first step.
        transitions: transitions[i, j] is the probability of state j one step after state i; rows sum to one.
    """

    name: ClassVar[str] = "markov"
    durations: ClassVar[None] = None
    initial: Float[Array, " K"]
    transitions: Float[Array, "K K"]

    @classmethod
    def fit(cls, statistics: Statistics, previous: object = None) -> "MarkovChain":
        """Compute the maximum-likelihood chain from expected counts (3.12, 3.13).

        A state without departures keeps to itself. Statistics of a semi-Markov model count transitions
        between segments only; the steps within segments are added.

        Args:
            statistics: Expected statistics.
            previous: Not used; the M-steps of all dynamics have the same arguments.

        Returns:
            The chain.
        """
        steps = statistics.transitions
        if statistics.segments:
            segments_started = statistics.initial_counts + steps.sum(axis=0)
            steps = steps + np.diag(np.maximum(statistics.moments[0].counts - segments_started, 0.0))
        departures = steps.sum(axis=1, keepdims=True)
        transitions = np.divide(steps, departures, out=np.eye(len(departures)), where=departures > 0.0)
        return cls(statistics.initial_counts / statistics.initial_counts.sum(), transitions)

    def step_probabilities(self) -> tuple[Float[Array, " K"], Float[Array, "K K"]]:
        return self.initial, self.transitions

    def sample(self, horizon: int, rng: np.random.Generator) -> Int[Array, " T"]:
        require_count(horizon, "horizon", MAX_HORIZON, 1)
        K = len(self.initial)
        states = [rng.choice(K, p=self.initial)]
        while len(states) < horizon:
            states.append(rng.choice(K, p=self.transitions[states[-1]]))
        return np.array(states)

    def degrees_of_freedom(self, fixed_duration_parameters: int = 0) -> int:
        return count_free_probabilities(self.initial[None]) + count_free_probabilities(self.transitions)

    def final_states(self) -> Bool[Array, " K"]:
        return np.asarray(~(self.transitions * (1.0 - np.eye(len(self.initial)))).any(axis=1))

    def _smooth(self, relative: Float[Array, "T K"]) -> Float[Array, "T K"]:
        return kernels.forward_backward(relative, self.initial, self.transitions).smoothed_state_probs


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class MixtureWeights(StateDynamics):
    """Weights of a Gaussian mixture (TP-GMM): every step draws its state independently.

    Attributes:
        weights: Probability of each state.
    """

    name: ClassVar[str] = "mixture"
    has_time_order: ClassVar[bool] = False
    durations: ClassVar[None] = None
    weights: Float[Array, " K"]

    @classmethod
    def fit(cls, statistics: Statistics, previous: object = None) -> "MixtureWeights":
        """Compute the maximum-likelihood weights: the shares of the datapoints.

        Args:
            statistics: Expected statistics.
            previous: Not used; the M-steps of all dynamics have the same arguments.

        Returns:
            The weights.
        """
        counts = statistics.moments[0].counts
        return cls(counts / counts.sum())

    @property
    def initial(self) -> Float[Array, " K"]:
        """Return the probability of each state at the first step: the weights."""
        return self.weights

    @property
    def transitions(self) -> Float[Array, "K K"]:
        """Return the transition matrix of one step: every row is the weights."""
        return np.tile(self.weights, (len(self.weights), 1))

    def step_probabilities(self) -> tuple[Float[Array, " K"], Float[Array, "K K"]]:
        return self.initial, self.transitions

    def log_forward(self, log_observed: Float[Array, "S K"], horizon: int) -> Float[Array, "T K"]:
        raise InvalidInput(
            "the skill has mixture dynamics, which have no order in time, so neither filtered state "
            "probabilities nor a plan; learn a Markov or semi-Markov skill"
        )

    def plan_states(
        self, log_observed: Float[Array, "S K"], horizon: int, *, complete: bool
    ) -> Int[Array, " T"]:
        return np.asarray(self.log_forward(log_observed, horizon).argmax(axis=1))

    def sample(self, horizon: int, rng: np.random.Generator) -> Int[Array, " T"]:
        require_count(horizon, "horizon", MAX_HORIZON, 1)
        return rng.choice(len(self.weights), size=horizon, p=self.weights)

    def degrees_of_freedom(self, fixed_duration_parameters: int = 0) -> int:
        return count_free_probabilities(self.weights[None])

    def final_states(self) -> Bool[Array, " K"]:
        return np.zeros(len(self.weights), dtype=bool)

    def _smooth(self, relative: Float[Array, "T K"]) -> Float[Array, "T K"]:
        weighted = self.weights * np.exp(relative)
        return np.asarray(weighted / weighted.sum(axis=1, keepdims=True))


def count_free_probabilities(rows: Float[Array, "R C"]) -> int:
    """Return the number of positive entries, less one for each row that sums to one."""
    possible = np.count_nonzero(rows, axis=1)
    return int(np.maximum(possible - 1, 0).sum())


def pad_unobserved(log_observed: Float[Array, "S K"], horizon: int) -> Float[Array, "T K"]:
    """Append rows of zeros, log-densities of steps without an observation, up to the horizon."""
    return np.concatenate([log_observed, np.zeros((horizon - len(log_observed), log_observed.shape[1]))])


def relative_observations(log_observed: Float[Array, "S K"], horizon: int) -> Float[Array, "T K"]:
    """Return valid observations relative to the largest of each step, padded to the horizon."""
    validate_observations(log_observed, horizon)
    relative = log_observed - log_observed.max(axis=1, keepdims=True, initial=-np.inf)
    return np.ascontiguousarray(pad_unobserved(relative, horizon))


def validate_observations(log_observed: Float[Array, "S K"], horizon: int) -> None:
    """Raise InvalidInput unless the horizon covers the observations, which are finite."""
    require_count(horizon, "horizon", MAX_HORIZON, max(1, len(log_observed)))
    if horizon * log_observed.shape[1] > MAX_STATE_PROBS:
        limit = MAX_STATE_PROBS // log_observed.shape[1]
        raise InvalidInput(
            f"horizon is {horizon} steps, expected at most {limit} for {log_observed.shape[1]} states"
        )
    _require_finite(log_observed, "that start and frames are finite and in the units of the demonstrations")


def _require_finite(log_observed: Float[Array, "S K"], advice: str) -> None:
    if not np.isfinite(log_observed).all():
        t, k = np.argwhere(~np.isfinite(log_observed))[0]
        raise InvalidInput(
            f"log p of observation {t} in state {k} is {log_observed[t, k]}, expected a finite number; check "
            f"{advice}"
        )
