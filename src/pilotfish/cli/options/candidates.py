"""Candidates of a model selection: all combinations of state counts, structures and durations."""

from pilotfish.cli.options.durations import CANDIDATE_NAMES, DYNAMICS, duration_model
from pilotfish.cli.options.structures import parse_structure
from pilotfish.errors import InvalidInput
from pilotfish.gaussians.structures import CovarianceStructure
from pilotfish.models import MAX_STATES, Candidate
from pilotfish.validation import first_duplicate, nearest_name, short_repr

MAX_CANDIDATES = 500  # of one selection


def parse_candidates(states: str, structures: str, durations: str) -> list[Candidate]:
    """Combine the values of three options; structures vary slowest, numbers of states fastest.

    Args:
        states: Value of --states.
        structures: Value of --structures.
        durations: Value of --durations.

    Returns:
        The candidates.

    Raises:
        InvalidInput: If a value is unknown or repeated, or there are more than MAX_CANDIDATES.
    """
    counts = parse_state_counts(states)
    structure_list, duration_names = parse_structures(structures), parse_durations(durations)
    if (count := len(structure_list) * len(duration_names) * len(counts)) > MAX_CANDIDATES:
        raise InvalidInput(
            f"the options combine to {count} candidates, expected at most {MAX_CANDIDATES}; list fewer values"
        )
    return [
        Candidate(K, structure, name if name in DYNAMICS else DYNAMICS[0], duration_model(name))
        for structure in structure_list
        for name in duration_names
        for K in counts
    ]


def parse_structures(text: str) -> list[CovarianceStructure]:
    """Parse a list of covariance structures, such as full,semi-tied:0.5,mfa:4."""
    return [parse_structure(word) for word in _split_list("structures", text)]


def parse_durations(text: str) -> list[str]:
    """Parse a list of names of CANDIDATE_NAMES, such as viterbi,markov."""
    words = _split_list("durations", text)
    for word in words:
        if word not in CANDIDATE_NAMES:
            nearest = nearest_name(word, CANDIDATE_NAMES)
            hint = f"; did you mean {nearest!r}?" if nearest else ""
            raise InvalidInput(
                f"--durations has {short_repr(word)}, expected some of {', '.join(CANDIDATE_NAMES)}{hint}"
            )
    return words


def parse_state_counts(text: str) -> list[int]:
    """Parse numbers of states, such as 3:10 or 3,5,8:12, and sort them."""
    counts: set[int] = set()
    for word in _split_list("states", text):
        ends = word.split(":")
        if len(ends) > 2 or not all(end.isdecimal() and len(end) < 6 for end in ends):
            raise InvalidInput(f"--states has {short_repr(word)}, expected numbers such as 5 or 3:10")
        first, last = int(ends[0]), int(ends[-1])
        if not 1 <= first <= last <= MAX_STATES:
            raise InvalidInput(
                f"--states has {short_repr(word)}, expected an increasing range from 1 to {MAX_STATES}, "
                "such as 3:10"
            )
        counts.update(range(first, last + 1))
        if len(counts) > MAX_CANDIDATES:
            raise InvalidInput(
                f"--states has more than {len(counts)} values, expected at most {MAX_CANDIDATES}; list fewer"
            )
    return sorted(counts)


def _split_list(option: str, text: str) -> list[str]:
    words = [word.strip().lower() for word in text.split(",")]
    if not all(words):
        raise InvalidInput(f"--{option} is {short_repr(text)}, expected values separated by commas")
    if (repeated := first_duplicate(words)) is not None:
        raise InvalidInput(f"--{option} has {short_repr(repeated)} more than once; give each value once")
    return words
