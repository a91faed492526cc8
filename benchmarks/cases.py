"""What is measured, who takes part, and what pilotfish promises."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Library:
    """distribution is its name in a package index, module what a user imports, does what it is timed at."""

    name: str
    distribution: str
    module: str
    does: str


@dataclass(frozen=True, slots=True)
class Entry:
    """One contestant: a library (a file of libraries/) and the function of that file which prepares it."""

    library: str
    function: str
    label: str


@dataclass(frozen=True, slots=True)
class Case:
    """One computation. agreement is how far apart, relatively, answers may lie; None where models differ."""

    name: str
    title: str
    problem: str
    explanation: str
    answer: str
    entries: tuple[Entry, ...]
    agreement: float | None = None


@dataclass(frozen=True, slots=True)
class Ceiling:
    """pilotfish takes at most so many milliseconds of CPU."""

    case: str
    milliseconds: float


@dataclass(frozen=True, slots=True)
class Lead:
    """Every entry of another library takes at least so many times pilotfish's CPU."""

    case: str
    over: str
    times: float


OURS = "pilotfish"

# In the environment that calls: pilotfish and textbook. The others live in one of their own: peers.txt.
LIBRARIES = {
    "pilotfish": Library("pilotfish", "pilotfish", "pilotfish", "all cases, by its public functions"),
    "textbook": Library(
        "NumPy textbook",
        "numpy",
        "numpy",
        "finite-horizon LQT: the backward recursion as a textbook has it, written for this comparison",
    ),
    "hmmlearn": Library("hmmlearn", "hmmlearn", "hmmlearn.hmm", "hidden Markov models in one frame; Viterbi"),
    "scikit_learn": Library("scikit-learn", "scikit-learn", "sklearn.mixture", "Gaussian mixtures"),
    "gmr": Library("gmr", "gmr", "gmr", "Gaussian mixtures, for regression"),
    "control": Library(
        "control", "control", "control", "infinite-horizon LQR (dlqr); it has no finite-horizon tracker"
    ),
}
PEERS = ("hmmlearn", "scikit_learn", "gmr", "control")

_PILOTFISH_EM = Entry("pilotfish", "em", "pilotfish")
_HMMLEARN = (
    Entry("hmmlearn", "em", "hmmlearn, in logarithms (its default)"),
    Entry("hmmlearn", "em_scaling", "hmmlearn, by scaling"),
)
_EM = (
    "E-step and M-step of a hidden Markov model with full covariances in one frame. Every library begins "
    "from the same parameters, adds nothing to covariances and does the same number of iterations; times "
    "are for one."
)

CASES = (
    Case(
        "em_valve",
        "EM iteration, 4 x 200 x 14, K = 7",
        "valve",
        f"{_EM} Data: the valve.",
        "log-likelihood in the last iteration",
        (_PILOTFISH_EM, *_HMMLEARN),
        agreement=1e-6,
    ),
    Case(
        "em_large",
        "EM iteration, 50 x 500 x 14, K = 10",
        "large",
        f"{_EM} Data: drawn from such a model, seeded.",
        "log-likelihood in the last iteration",
        (_PILOTFISH_EM, *_HMMLEARN),
        agreement=1e-6,
    ),
    Case(
        "em_frames",
        "task-parameterised EM iteration, 4 x 200 x 14 x 2 frames, K = 7",
        "frames",
        "The same for a model seen from two frames at once, which no peer here has. Data: the valve; 1e-5 "
        "is added to variances.",
        "log-likelihood in the last iteration",
        (Entry("pilotfish", "em_frames", "pilotfish"),),
    ),
    Case(
        "fit",
        "whole fit, 4 x 200 x 14 x 2 frames, K = 7",
        "frames",
        "From demonstrations to a model, begun from equal times, until each library's own criterion is met "
        "or {iterations} iterations are done. The models differ: pilotfish has a 14 x 14 covariance in each "
        "frame, and learns transitions and durations where it says semi-Markov; the others fit one 28 x 28 "
        "covariance to both views side by side, without order in time; gmr adds nothing to variances, the "
        "others 1e-5, and does not tell its iterations. Data: the valve.",
        "log-likelihood",
        (
            Entry("pilotfish", "fit_semi_markov", "pilotfish, semi-Markov"),
            Entry("pilotfish", "fit_mixture", "pilotfish, mixture"),
            Entry("scikit_learn", "fit_mixture", "scikit-learn, mixture"),
            Entry("gmr", "fit_mixture", "gmr, mixture"),
        ),
    ),
    Case(
        "lqt",
        "finite-horizon tracking (LQT), 14 states x 200 steps",
        "tracking",
        "Gains and feed-forwards along a step-wise reference through 7 targets of the valve, for a double "
        "integrator of 7 axes. pilotfish's time includes the checks of its door.",
        "norm of the control law",
        (Entry("pilotfish", "tracker", "pilotfish"), Entry("textbook", "tracker", "NumPy textbook")),
        agreement=1e-6,
    ),
    Case(
        "lqr",
        "infinite-horizon gains, 14 states, 7 weights",
        "tracking",
        "The regulator's gain for each of the same 7 weights: seven algebraic Riccati equations. pilotfish "
        "finds out itself which of the 200 weights are equal; control is told.",
        "norm of the control law",
        (Entry("pilotfish", "regulator", "pilotfish"), Entry("control", "regulator", "control")),
        agreement=1e-6,
    ),
    Case(
        "viterbi_valve",
        "Viterbi, 4 x 200 x 14, K = 7",
        "valve",
        "Most probable state sequences, densities included, under the model that EM begins from.",
        "log-probability of the paths",
        (Entry("pilotfish", "decode", "pilotfish"), Entry("hmmlearn", "decode", "hmmlearn")),
        agreement=1e-9,
    ),
    Case(
        "viterbi_large",
        "Viterbi, 50 x 500 x 14, K = 10",
        "large",
        "The same for 50 longer sequences.",
        "log-probability of the paths",
        (Entry("pilotfish", "decode", "pilotfish"), Entry("hmmlearn", "decode", "hmmlearn")),
        agreement=1e-9,
    ),
)

TARGETS: tuple[Ceiling | Lead, ...] = (
    Ceiling("em_frames", milliseconds=2.0),
    Lead("em_valve", over="hmmlearn", times=4.0),
    Lead("em_large", over="hmmlearn", times=4.0),
    Ceiling("lqt", milliseconds=2.0),
    Lead("lqt", over="textbook", times=4.0),
)
