"""Structures and kinds of durations by the names that a command line gives them."""

from collections.abc import Sequence

from pilotfish.errors import InvalidInput
from pilotfish.gaussians import Structure
from pilotfish.models import MOST_STATES, Candidate
from pilotfish.station.learners import LAWS, LEARNERS
from pilotfish.station.structure_names import structure_named
from pilotfish.validation import first_repeated, nearest_name, short_repr

MOST = 500  # candidates of one selection


def candidates(states: str, structures: str, durations: str) -> list[Candidate]:
    """All combinations of what three options list, structures varying slowest, states fastest.

    Raises: InvalidInput, when one is unknown, twice there, or there are too many.
    """
    kinds, ways, sizes = structure_list(structures), duration_list(durations), state_list(states)
    if (count := len(kinds) * len(ways) * len(sizes)) > MOST:
        raise InvalidInput(f"{count} candidates were asked for, expected at most {MOST}; list fewer of each")
    return [
        Candidate(K, kind, way, LEARNERS[way], LAWS.get(way)) for kind in kinds for way in ways for K in sizes
    ]


def structure_list(text: str) -> list[Structure]:
    """Covariance structures such as full,semi-tied:0.5,mfa:4.    Raises: InvalidInput."""
    return [structure_named(word) for word in _words("structures", text)]


def duration_list(text: str) -> list[str]:
    """Names of what is made of durations, such as counted,markov.    Raises: InvalidInput."""
    words = _words("durations", text)
    for word in words:
        if word not in LEARNERS:
            raise InvalidInput(_unknown("durations", word, list(LEARNERS)))
    return words


def state_list(text: str) -> list[int]:
    """Numbers of states such as 3:10 or 3,5,8:12, in rising order.    Raises: InvalidInput."""
    sizes: set[int] = set()
    for word in _words("states", text):
        ends = word.split(":")
        if len(ends) > 2 or not all(end.isdecimal() and len(end) < 6 for end in ends):
            raise InvalidInput(f"--states has {short_repr(word)}, expected numbers such as 5 or 3:10")
        first, last = int(ends[0]), int(ends[-1])
        if not 1 <= first <= last <= MOST_STATES:
            raise InvalidInput(
                f"--states has {short_repr(word)}, expected a range that rises, from 1 to {MOST_STATES}, "
                "say 3:10"
            )
        sizes.update(range(first, last + 1))
        if len(sizes) > MOST:
            raise InvalidInput(f"--states lists {len(sizes)} and more, expected at most {MOST}; list fewer")
    return sorted(sizes)


def _words(option: str, text: str) -> list[str]:
    words = [word.strip().lower() for word in text.split(",")]
    if not all(words):
        raise InvalidInput(f"--{option} is {short_repr(text)}, expected a list with commas between")
    if (twice := first_repeated(words)) is not None:
        raise InvalidInput(f"--{option} names {short_repr(twice)} more than once")
    return words


def _unknown(option: str, word: str, known: Sequence[str]) -> str:
    near = nearest_name(word, known)
    hint = f"; did you mean {near!r}?" if near else ""
    return f"--{option} has {short_repr(word)}, expected some of {', '.join(known)}{hint}"
