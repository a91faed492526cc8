"""Arguments of `pf.learn` by the names of the options --dynamics, --durations and --censoring."""

from pilotfish.models import COUNTED, Censoring, DurationModel
from pilotfish.models.durations import DISTRIBUTIONS

VITERBI = COUNTED
CANDIDATE_NAMES = (COUNTED, *DISTRIBUTIONS, "markov", "mixture")  # of --durations of the command select
HISTOGRAM_PSEUDOCOUNT = 1.0


def duration_model(durations: str, censoring: str = "right") -> DurationModel | None:
    """Return the duration model of a distribution by its name; None for durations that are counted."""
    if durations not in DISTRIBUTIONS:
        return None
    options = {"pseudocount": HISTOGRAM_PSEUDOCOUNT} if durations == "histogram" else {}
    return DurationModel(DISTRIBUTIONS[durations], Censoring(censoring), options=options)
