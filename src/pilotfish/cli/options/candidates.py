"""Structures and kinds of durations by the names that a command line gives them."""

from collections.abc import Sequence

from pilotfish.cli.options.learners import CANDIDATE_NAMES, duration_model
from pilotfish.cli.options.structures import parse_structure
from pilotfish.errors import InvalidInput
from pilotfish.gaussians.structures import CovarianceStructure
from pilotfish.models import MAX_STATES, Candidate, MarkovChain, MixtureWeights
from pilotfish.validation import first_duplicate, nearest_name, short_repr

MAX_CANDIDATES = 500  # candidates of one selection


def parse_candidates(states: str, structures: str, durations: str) -> list[Candidate]:
    """All combinations of what three options list, structures varying slowest, states fastest.

    Raises: InvalidInput, when one is unknown, twice there, or there are too many.
    """
    structures_tried, durations_tried, state_counts = (
        parse_structures(structures),
        parse_durations(durations),
        parse_state_counts(states),
    )
    if (count := len(structures_tried) * len(durations_tried) * len(state_counts)) > MAX_CANDIDATES:
        raise InvalidInput(
            f"{count} candidates were asked for, expected at most {MAX_CANDIDATES}; list fewer of each"
        )
    return [
        Candidate(
            K,
            kind,
            name if name in (MarkovChain.name, MixtureWeights.name) else "semi-markov",
            duration_model(name),
        )
        for kind in structures_tried
        for name in durations_tried
        for K in state_counts
    ]


def parse_structures(text: str) -> list[CovarianceStructure]:
    """Covariance structures such as full,semi-tied:0.5,mfa:4.    Raises: InvalidInput."""
    return [parse_structure(word) for word in _split_list("structures", text)]


def parse_durations(text: str) -> list[str]:
    """Names of what is made of durations, such as counted,markov.    Raises: InvalidInput."""
    words = _split_list("durations", text)
    for word in words:
        if word not in CANDIDATE_NAMES:
            raise InvalidInput(_unknown_name_message("durations", word, CANDIDATE_NAMES))
    return words


def parse_state_counts(text: str) -> list[int]:
    """Numbers of states such as 3:10 or 3,5,8:12, in rising order.    Raises: InvalidInput."""
    state_counts: set[int] = set()
    for word in _split_list("states", text):
        ends = word.split(":")
        if len(ends) > 2 or not all(end.isdecimal() and len(end) < 6 for end in ends):
            raise InvalidInput(f"--states has {short_repr(word)}, expected numbers such as 5 or 3:10")
        first, last = int(ends[0]), int(ends[-1])
        if not 1 <= first <= last <= MAX_STATES:
            raise InvalidInput(
                f"--states has {short_repr(word)}, expected a range that rises, from 1 to {MAX_STATES}, "
                "say 3:10"
            )
        state_counts.update(range(first, last + 1))
        if len(state_counts) > MAX_CANDIDATES:
            raise InvalidInput(
                f"--states lists {len(state_counts)} and more, expected at most {MAX_CANDIDATES}; list fewer"
            )
    return sorted(state_counts)


def _split_list(option: str, text: str) -> list[str]:
    words = [word.strip().lower() for word in text.split(",")]
    if not all(words):
        raise InvalidInput(f"--{option} is {short_repr(text)}, expected a list with commas between")
    if (repeated := first_duplicate(words)) is not None:
        raise InvalidInput(f"--{option} names {short_repr(repeated)} more than once")
    return words


def _unknown_name_message(option: str, word: str, known: Sequence[str]) -> str:
    nearest = nearest_name(word, known)
    hint = f"; did you mean {nearest!r}?" if nearest else ""
    return f"--{option} has {short_repr(word)}, expected some of {', '.join(known)}{hint}"
