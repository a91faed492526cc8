"""Cases that are measured, their entries, and the requirements on pilotfish."""

from kinds import Case, Entry
from requirements import MemoryLimit, MinSpeedup, Requirement, TimeLimit
from stream_cases import STREAM_CASES, STREAM_REQUIREMENTS

_PRIOR = "its prior on covariances can be made small, but not disabled"
_END = "it also learns the final state"
_OTHER_DURATIONS = "its duration M-step and its posteriors are not those of EM"

_PILOTFISH_EM = Entry("pilotfish", "em", "pilotfish")
_HMM = (
    _PILOTFISH_EM,
    Entry("pilotfish_baseline", "em", "pilotfish, portable kernels"),
    Entry("hmmlearn", "em", "hmmlearn, in logarithms (its default)"),
    Entry("hmmlearn", "em_scaling", "hmmlearn, by scaling"),
    Entry("dynamax", "em", "dynamax", _PRIOR),
    Entry("pomegranate", "em", "pomegranate", _END),
)
_EM = (
    "E-step and M-step of a hidden Markov model with full covariances in one frame. Every library starts "
    "from the same parameters, without regularisation, and runs the same number of iterations. Times are "
    "for one iteration."
)
_MIXTURE = (
    "E-step and M-step of a Gaussian mixture with full covariances from the same initial parameters. Times "
    "are for one iteration."
)
_MIXTURES = (
    Entry("pilotfish", "em_mixture", "pilotfish"),
    Entry("scikit_learn", "em_mixture", "scikit-learn"),
)
_SEMI_MARKOV = (
    "Exact EM of a hidden semi-Markov model with a histogram of durations up to {max_duration} steps and a "
    "right-censored last segment. Every library starts from the same parameters. Times are for one "
    "iteration."
)
_SEMI_MARKOV_ENTRIES = (
    Entry("pilotfish", "em_semi_markov", "pilotfish"),
    Entry("pilotfish_baseline", "em_semi_markov", "pilotfish, portable kernels"),
    Entry("chadhmm", "em_semi_markov", "chadhmm", _OTHER_DURATIONS),
)
_LIKELIHOOD = "log-likelihood in the last iteration"

CASES = (
    Case(
        "em_valve",
        "EM iteration, 4 x 200 x 14, K = 7",
        "valve",
        f"{_EM} Data: the valve.",
        _LIKELIHOOD,
        _HMM,
        1e-6,
    ),
    Case(
        "em_large",
        "EM iteration, 50 x 500 x 14, K = 10",
        "large",
        f"{_EM} Data: sampled from such a model with a fixed seed.",
        _LIKELIHOOD,
        _HMM,
        1e-6,
    ),
    Case(
        "em_vast",
        "EM iteration, 2000 x 300 x 14, K = 10",
        "vast",
        f"{_EM} Data: sampled from such a model with a fixed seed; 67 MB.",
        _LIKELIHOOD,
        (*_HMM[:1], Entry("pilotfish", "em_all_cores", "pilotfish, on all cores"), *_HMM[1:]),
        1e-6,
    ),
    Case(
        "em_wide",
        "EM iteration, 2 x 500 x 94, K = 30",
        "wide",
        "The same with more columns than a state has steps, where maximum likelihood has no maximum. "
        "pilotfish adds 1e-5 to variances, hmmlearn and dynamax use their default priors, and pomegranate "
        "has no regularisation. Data: sampled from such a model with a fixed seed.",
        _LIKELIHOOD,
        (
            _PILOTFISH_EM,
            Entry("pilotfish_baseline", "em", "pilotfish, portable kernels"),
            Entry("hmmlearn", "em_default", "hmmlearn, in logarithms (its default)", "its own prior"),
            Entry("hmmlearn", "em_default_scaling", "hmmlearn, by scaling", "its own prior"),
            Entry("dynamax", "em", "dynamax", "its own prior"),
            Entry("pomegranate", "em", "pomegranate", "it has no regularisation"),
        ),
        1e-6,
    ),
    Case(
        "mixture_valve",
        "mixture, 4 x 200 x 14, K = 7",
        "valve",
        f"{_MIXTURE} Data: the valve.",
        _LIKELIHOOD,
        _MIXTURES,
        1e-6,
    ),
    Case(
        "mixture_large",
        "mixture, 50 x 500 x 14, K = 10",
        "large",
        f"{_MIXTURE} Data: as em_large.",
        _LIKELIHOOD,
        _MIXTURES,
        1e-6,
    ),
    Case(
        "mixture_vast",
        "mixture, 2000 x 300 x 14, K = 10",
        "vast",
        f"{_MIXTURE} Data: as em_vast.",
        _LIKELIHOOD,
        _MIXTURES,
        1e-6,
    ),
    Case(
        "mixture_wide",
        "mixture, 2 x 500 x 94, K = 30",
        "wide",
        f"{_MIXTURE} Both add 1e-5 to variances. Data: as em_wide.",
        _LIKELIHOOD,
        _MIXTURES,
        1e-6,
    ),
    Case(
        "semi_markov",
        "semi-Markov EM iteration, 1 x 500 x 14, K = 10, durations to 100",
        "semi_markov",
        f"{_SEMI_MARKOV} Data: sampled from such a model with a fixed seed.".replace("{max_duration}", "100"),
        _LIKELIHOOD,
        _SEMI_MARKOV_ENTRIES,
        1e-6,
    ),
    Case(
        "semi_markov_valve",
        "semi-Markov EM iteration, 4 x 200 x 14, K = 7, durations to 100",
        "semi_markov_valve",
        f"{_SEMI_MARKOV} Data: the valve.".replace("{max_duration}", "100"),
        _LIKELIHOOD,
        _SEMI_MARKOV_ENTRIES,
        1e-6,
    ),
    Case(
        "fit_vast",
        "whole fit, 2000 x 300 x 14, K = 10",
        "vast",
        "From 2000 demonstrations to a semi-Markov skill: initial time bins, {vast} iterations of EM. "
        "Data: as em_vast.",
        "log-likelihood",
        (Entry("pilotfish", "fit_vast", "pilotfish"),),
    ),
    Case(
        "poses",
        "whole fit of poses, 4 x 200 x (R^3 x S^3) x 2 frames, K = 7",
        "poses",
        "Poses with orientations on S^3, and covariances in its tangent spaces. Data: noisy movements of a "
        "tool between two objects with varying poses, with a fixed seed.",
        "log-likelihood",
        (Entry("pilotfish", "fit_poses", "pilotfish"),),
    ),
    Case(
        "em_frames",
        "task-parameterised EM iteration, 4 x 200 x 14 x 2 frames, K = 7",
        "frames",
        "The same for a task-parameterised model with two frames, which no peer has. Data: the valve; 1e-5 "
        "is added to variances.",
        "log-likelihood in the last iteration",
        (Entry("pilotfish", "em_frames", "pilotfish"),),
    ),
    Case(
        "fit",
        "whole fit, 4 x 200 x 14 x 2 frames, K = 7",
        "frames",
        "From demonstrations to a model: initial time bins, then EM until each library's own criterion or "
        "{valve} iterations. The models differ. pilotfish has a 14 x 14 covariance in each frame; its "
        "semi-Markov entry also learns transitions and durations. The others fit one 28 x 28 covariance to "
        "both frames side by side, without time. gmr adds nothing to variances, the others 1e-5; gmr does "
        "not report its iterations. Data: the valve.",
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
        "Gains and feedforward for a step-wise reference with 7 targets of the valve, and a double "
        "integrator of 7 axes. pilotfish's time includes the validation of its arguments.",
        "norm of gains and feedforward",
        (Entry("pilotfish", "tracker", "pilotfish"), Entry("textbook", "tracker", "NumPy textbook")),
        agreement=1e-6,
    ),
    Case(
        "lqr",
        "infinite-horizon gains, 14 states, 7 weights",
        "tracking",
        "LQR gains for the same 7 weights: seven algebraic Riccati equations. pilotfish finds the distinct "
        "ones of the 200 weights; control gets only these.",
        "norm of gains and feedforward",
        (Entry("pilotfish", "regulator", "pilotfish"), Entry("control", "regulator", "control")),
        agreement=1e-6,
    ),
    Case(
        "viterbi_valve",
        "Viterbi, 4 x 200 x 14, K = 7",
        "valve",
        "Most probable state sequences under the initial model of EM, including the emission densities.",
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
    *STREAM_CASES,
)

REQUIREMENTS: tuple[Requirement, ...] = (
    MinSpeedup("em_valve", times=3.0),
    MinSpeedup("em_large", times=3.0),
    MinSpeedup("em_vast", times=3.0),
    MinSpeedup("em_wide", times=3.0),
    MinSpeedup("semi_markov", times=20.0),
    MinSpeedup("semi_markov_valve", times=20.0),
    TimeLimit("poses", milliseconds=300.0),
    MemoryLimit("fit_vast", data_mb=67.2, times=2.0),
    TimeLimit("em_frames", milliseconds=2.0),
    TimeLimit("lqt", milliseconds=2.0),
    MinSpeedup("lqt", over="textbook", times=4.0),
    *STREAM_REQUIREMENTS,
)
