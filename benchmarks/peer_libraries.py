"""Libraries that take part, and libraries that cannot be installed."""

from kinds import Library

OURS = "pilotfish"
OWN = (OURS, "pilotfish_baseline")  # entries that are not peers

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
        "finite-horizon LQT: the backward recursion of a textbook, written for this comparison",
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

# Libraries that were tried without success, and why.
NOT_INSTALLABLE = {
    "pyhsmm 0.1.7": (
        "its setup downloads Eigen from an address that does not answer, and its code needs SciPy below 1.3. "
        "Built by hand for Python 3.7 and NumPy 1.16 with a local Eigen, an EM step on 1 x 500 x 14, K = 10 "
        "took 145 ms CPU. Durations were Poisson without truncation, which its EM does not support"
    ),
    "ssm 0.0.1": (
        "its setup needs an installed Cython and NumPy, and its code an autograd that Python 3.11 cannot "
        "import. Built by hand for Python 3.7, an EM iteration of the same size took 2280 ms CPU, with "
        "negative binomial durations of up to 20 phases"
    ),
    "edhsmm": "no package index has it",
    "riepybdlib": "no package index has it",
}
