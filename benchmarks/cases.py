"""What is measured, who takes part, and what pilotfish promises."""

from kinds import Case, Entry, Library, MemoryLimit, MinSpeedup, Requirement, TimeLimit
from stream_cases import STREAM_CASES, STREAM_TARGETS

OURS = "pilotfish"
OWN = (OURS, "pilotfish_baseline")  # no peers of ours

LIBRARIES = {
    "pilotfish": Library("pilotfish", "pilotfish", "pilotfish", "all cases, by its public functions"),
    "pilotfish_baseline": Library(
        "pilotfish, portable kernels",
        "pilotfish",
        "pilotfish",
        "the same, with the kernels of processors without AVX2",
    ),
    "textbook": Library(
        "NumPy textbook",
        "numpy",
        "numpy",
        "finite-horizon LQT: the backward recursion as a textbook has it, written for this comparison",
    ),
    "hmmlearn": Library(
        "hmmlearn", "hmmlearn", "hmmlearn.hmm", "hidden Markov models in one frame; Viterbi", "peers"
    ),
    "scikit_learn": Library(
        "scikit-learn",
        "scikit-learn",
        "sklearn.mixture",
        "Gaussian mixtures; streams: MiniBatchKMeans and Birch",
        "peers",
    ),
    "gmr": Library("gmr", "gmr", "gmr", "Gaussian mixtures, for regression", "peers"),
    "control": Library(
        "control",
        "control",
        "control",
        "infinite-horizon LQR (dlqr); it has no finite-horizon tracker",
        "peers",
    ),
    "dynamax": Library(
        "dynamax",
        "dynamax",
        "dynamax.hidden_markov_model",
        "hidden Markov models, all iterations in one jit",
        "peers-jax",
    ),
    "pomegranate": Library(
        "pomegranate",
        "pomegranate",
        "pomegranate.hmm",
        "hidden Markov models, PyTorch on the CPU",
        "peers-torch",
    ),
    "chadhmm": Library(
        "chadhmm", "chadhmm", "chadhmm.hsmm", "hidden semi-Markov models, PyTorch on the CPU", "peers-torch"
    ),
    "river": Library(
        "river", "river", "river.cluster", "streams: DBSTREAM, DenStream, CluStream, STREAMKMeans", "peers"
    ),
    "dp_means": Library(
        "pdc-dp-means", "pdc-dp-means", "pdc_dp_means", "streams: MiniBatchDPMeans", "peers-dpmeans"
    ),
}

# What was tried besides, and how that ended.
NOT_INSTALLABLE = {
    "pyhsmm 0.1.7": (
        "its setup downloads Eigen from an address that does not answer, and its code needs SciPy below 1.3. "
        "Built by hand for Python 3.7 and NumPy 1.16 against a local Eigen it took 145 ms CPU for an EM step "
        "on 1 x 500 x 14, K = 10, Poisson durations without truncation, which its EM cannot do"
    ),
    "ssm 0.0.1": (
        "its setup needs Cython and NumPy to be there already, its code an autograd that Python 3.11 cannot "
        "import. Built by hand for Python 3.7 it took 2280 ms CPU for an EM iteration of the same size, "
        "negative binomial durations of up to 20 phases"
    ),
    "edhsmm": "no package index that was asked has it",
    "riepybdlib": "no package index that was asked has it",
}

_PRIOR = "its prior on covariances can be made small, not switched off"
_END = "it learns also in which state sequences end"
_OTHER_DURATIONS = "its M-step of durations and its posteriors are other than those of EM"

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
    "E-step and M-step of a hidden Markov model with full covariances in one frame. Every library begins "
    "from the same parameters, adds nothing to covariances and does the same number of iterations; times "
    "are for one."
)
_MIXTURE = (
    "E-step and M-step of a Gaussian mixture with full covariances, begun from the same parameters; times "
    "are for one iteration."
)
_MIXTURES = (
    Entry("pilotfish", "em_mixture", "pilotfish"),
    Entry("scikit_learn", "em_mixture", "scikit-learn"),
)
_SEMI_MARKOV = (
    "Exact EM of a hidden semi-Markov model with a free histogram of durations up to {longest} steps, the "
    "last visit of a recording cut off by its end. Every library begins from the same parameters; times are "
    "for one iteration."
)
_SEMI_MARKOV_ENTRIES = (
    Entry("pilotfish", "em_visits", "pilotfish"),
    Entry("pilotfish_baseline", "em_visits", "pilotfish, portable kernels"),
    Entry("chadhmm", "em_visits", "chadhmm", _OTHER_DURATIONS),
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
        f"{_EM} Data: drawn from such a model, seeded.",
        _LIKELIHOOD,
        _HMM,
        1e-6,
    ),
    Case(
        "em_vast",
        "EM iteration, 2000 x 300 x 14, K = 10",
        "vast",
        f"{_EM} Data: drawn from such a model, seeded; 67 MB.",
        _LIKELIHOOD,
        (*_HMM[:1], Entry("pilotfish", "em_all_cores", "pilotfish, on all cores"), *_HMM[1:]),
        1e-6,
    ),
    Case(
        "em_wide",
        "EM iteration, 2 x 500 x 94, K = 30",
        "wide",
        "The same with more columns than a state has steps, where plain maximum likelihood has no maximum: "
        "pilotfish adds 1e-5 to variances, hmmlearn and dynamax have the priors that are their defaults, "
        "pomegranate has none. Data: drawn from such a model, seeded.",
        _LIKELIHOOD,
        (
            _PILOTFISH_EM,
            Entry("pilotfish_baseline", "em", "pilotfish, portable kernels"),
            Entry("hmmlearn", "em_default", "hmmlearn, in logarithms (its default)", "its own prior"),
            Entry("hmmlearn", "em_default_scaling", "hmmlearn, by scaling", "its own prior"),
            Entry("dynamax", "em", "dynamax", "its own prior"),
            Entry("pomegranate", "em", "pomegranate", "nothing holds its covariances"),
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
        "visits",
        "semi-Markov EM iteration, 1 x 500 x 14, K = 10, durations to 100",
        "visits",
        f"{_SEMI_MARKOV} Data: drawn from such a model, seeded.".replace("{longest}", "100"),
        _LIKELIHOOD,
        _SEMI_MARKOV_ENTRIES,
        1e-6,
    ),
    Case(
        "visits_valve",
        "semi-Markov EM iteration, 4 x 200 x 14, K = 7, durations to 100",
        "visits_valve",
        f"{_SEMI_MARKOV} Data: the valve.".replace("{longest}", "100"),
        _LIKELIHOOD,
        _SEMI_MARKOV_ENTRIES,
        1e-6,
    ),
    Case(
        "fit_vast",
        "whole fit, 2000 x 300 x 14, K = 10",
        "vast",
        "From 2000 demonstrations to a semi-Markov skill, begun from equal times, {vast} iterations of EM. "
        "Data: as em_vast.",
        "log-likelihood",
        (Entry("pilotfish", "fit_vast", "pilotfish"),),
    ),
    Case(
        "poses",
        "whole fit of poses, 4 x 200 x (R^3 x S^3) x 2 frames, K = 7",
        "poses",
        "Poses whose orientations are points of the sphere, means and covariances in its tangent spaces. "
        "Data: a tool moved from one object to another that stand elsewhere each time, noisy, seeded.",
        "log-likelihood",
        (Entry("pilotfish", "fit_poses", "pilotfish"),),
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
        "or {valve} iterations are done. The models differ: pilotfish has a 14 x 14 covariance in each "
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
    *STREAM_CASES,
)

TARGETS: tuple[Requirement, ...] = (
    MinSpeedup("em_valve", times=3.0),
    MinSpeedup("em_large", times=3.0),
    MinSpeedup("em_vast", times=3.0),
    MinSpeedup("em_wide", times=3.0),
    MinSpeedup("visits", times=20.0),
    MinSpeedup("visits_valve", times=20.0),
    TimeLimit("poses", milliseconds=300.0),
    MemoryLimit("fit_vast", data_mb=67.2, times=2.0),
    TimeLimit("em_frames", milliseconds=2.0),
    TimeLimit("lqt", milliseconds=2.0),
    MinSpeedup("lqt", over="textbook", times=4.0),
    *STREAM_TARGETS,
)
