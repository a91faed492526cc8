"""Values of --durations, and the duration models that they select."""

from pilotfish.models import VITERBI, Censoring, DurationModel, MarkovChain, MixtureWeights, SemiMarkovChain
from pilotfish.models.durations import DISTRIBUTIONS

DYNAMICS = (SemiMarkovChain.name, MarkovChain.name, MixtureWeights.name)
DURATION_NAMES = (VITERBI, *DISTRIBUTIONS)
CANDIDATE_NAMES = (*DURATION_NAMES, MarkovChain.name, MixtureWeights.name)  # of --durations of `select`
HISTOGRAM_PSEUDOCOUNT = 1.0


def duration_model(durations: str, censoring: str = Censoring.RIGHT) -> DurationModel | None:
    """Return the duration model of a semi-Markov skill; None for VITERBI and for other dynamics.

    Args:
        durations: Value of --durations.
        censoring: Value of --censoring.
    """
    if durations not in DISTRIBUTIONS:
        return None
    options = {"pseudocount": HISTOGRAM_PSEUDOCOUNT} if durations == "histogram" else {}
    return DurationModel(DISTRIBUTIONS[durations], Censoring(censoring), options=options)
