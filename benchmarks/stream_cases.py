"""Cases of online learning from streams, and the requirements on pilotfish."""

from kinds import Case, Entry
from requirements import BestAnswer, MemoryLimit, MinRate, MinSpeedup, Requirement, TimeLimit

_ONE, _BATCHES = "point by point", "in batches of 100"
_SPEED = Entry("pilotfish", "from_array", "pilotfish, from an array")
_PORTABLE = Entry("pilotfish_baseline", "from_array", "pilotfish, portable kernels")
_WORST = (
    Entry("pilotfish", "worst_case", "pilotfish, from an array"),
    Entry("pilotfish_baseline", "worst_case", "pilotfish, portable kernels"),
)
_OURS = (_SPEED, Entry("pilotfish", "single_points", f"pilotfish, {_ONE}"), _PORTABLE)
_PEERS = (
    Entry("river", "dbstream", f"river DBSTREAM, {_ONE}"),
    Entry("river", "denstream", f"river DenStream, {_ONE}"),
    Entry("river", "clustream", f"river CluStream, {_ONE}"),
    Entry("river", "stream_k_means", f"river STREAMKMeans, {_ONE}"),
    Entry("scikit_learn", "k_means_single_points", f"scikit-learn MiniBatchKMeans, {_ONE}"),
    Entry("scikit_learn", "k_means_batches", f"scikit-learn MiniBatchKMeans, {_BATCHES}"),
    Entry("scikit_learn", "birch_single_points", f"scikit-learn Birch, {_ONE}"),
    Entry("scikit_learn", "birch_batches", f"scikit-learn Birch, {_BATCHES}"),
    Entry(
        "scikit_learn",
        "birch_unlimited",
        "scikit-learn Birch without a limit",
        differs="a batch method: it stores most datapoints and clusters them at the end",
    ),
    Entry("dp_means", "single_points", f"DP-means, {_ONE}"),
    Entry("dp_means", "batches", f"DP-means, {_BATCHES}"),
)
_NMI = "NMI with the true clusters"
_RULE = (
    "pilotfish (SOSC) sets its penalties by one rule from the generator's scales. lambda is 2/5 of a "
    "cluster's variance r^2, or 1/4 of the squared distance of centres if that is larger. lambda_1 is the "
    "geometric mean of the variances along a subspace and outside it; lambda_2 and lambda_3 are the "
    "thesis' shares of lambda. b_m decays to 9/10 at 2 r^2. Clusters merge at 1/4 of the distance of "
    "centres. A trace lasts one cycle of all clusters and forgets below 0.3. Its labels are the "
    "assignments; after a merge they follow the merged cluster, except point by point. "
)
_NEAR = (
    "{stream} datapoints; a cycle of 7 clusters in segments of 70 to 90 steps. Each is a random subspace of "
    "{d} dimensions in {D}, with standard deviation 3 along it and .2 in every column. Centres are at "
    "least {separation} apart, so that the nearest mean is often that of another cluster. Within a segment, "
    "coordinates along the subspace have a correlation of .9 between steps. "
)
_TUNED = (
    "Peers get the true number of clusters if they take one, and the setting with the largest NMI on the "
    "same data, which is searched outside the time. Their labels are predicted by the final model, or after "
    "every hundred datapoints, whichever is better. The time includes this prediction, since pilotfish "
    "returns labels while it learns. Birch may store a tenth of the datapoints, like a stream learner; "
    "a second entry has no limit and is not compared. r is a cluster's "
    "radius, the extent times the root of the largest dimension. Grids: DBSTREAM clustering_threshold "
    "{.5, .7, 1} r, fading_factor {.0005, .002}, intersection_factor {.02, .05, .2}; DenStream epsilon "
    "{.35, .5, .7, 1, 1.4} r, decaying_factor {.2, .6, 2}; CluStream with 50 micro-clusters (100 take four "
    "times as long) halflife {.3, .5}, sigma {.03, .1} r, two seeds; STREAMKMeans chunks of {10, 100}, "
    "halflife {.03, .1, .5}, sigma {.03, .1} r, three seeds; MiniBatchKMeans reassignment_ratio {0, .01, "
    ".1}, four seeds, initial centres from the whole stream; Birch threshold {.1, .15, .2, .25, .35, .5, "
    ".7, 1} r; DP-means delta {.3, .5, .7, 1, 1.4, 2, 2.8, 4} r^2. "
)
_FAR = (
    "{long} datapoints, 20 clusters at least 4 sqrt(D) apart, standard deviation 1 along {d} and .2 in "
    "every column, independent samples. "
)
_CYCLE = "A cycle of segments of 70 to 90 steps. "
_SHUFFLED = (
    "The worst case: every step samples its cluster independently, so that the order gives no advantage. "
    "The model has converged on the first 10,000 datapoints. From then on b_m is so large that subspaces "
    "do not decay and no cluster is pruned by its distance. In 3 dimensions, planes that do not decay "
    "cross other clusters, which reduces NMI. "
)


def _near(D: int, d: str, separation: int) -> Case:
    text = _NEAR.replace("{d}", d).replace("{D}", str(D)).replace("{separation}", str(separation))
    explanation = text + _TUNED + _RULE
    title = f"sequence data in {D} dimensions, near clusters"
    return Case(f"stream_{D}", title, f"stream_{D}", explanation, _NMI, (*_OURS, *_PEERS), unit="datapoint")


def _far(D: int, d: str, shuffled: bool) -> Case:
    name = f"shuffled_{D}" if shuffled else f"long_{D}"
    title = f"long stream in {D} dimensions" + (", worst case" if shuffled else "")
    explanation = _FAR.replace("{d}", d) + (_SHUFFLED if shuffled else _CYCLE) + "Penalties as above."
    entries = _WORST if shuffled else (_SPEED, _PORTABLE)
    return Case(name, title, name, explanation, _NMI, entries, unit="datapoint")


_SIZES = ((3, "1 or 2 dimensions"), (14, "4 dimensions"), (75, "8 dimensions"))

STREAM_CASES = (
    _near(14, "2 to 4", 5),
    _near(75, "4 to 8", 4),
    *(_far(D, d, shuffled) for D, d in _SIZES for shuffled in (False, True)),
    Case(
        "repeated_3",
        "a stream of 10 million datapoints in 3 dimensions",
        "long_3",
        "The first 100,000 datapoints of long_3 a hundred times, which would be 240 MB. The memory of one "
        "chunk's assignments is the only growth.",
        "NMI with the true clusters in the last repetition",
        (Entry("pilotfish", "repeated_stream", "pilotfish, in chunks of 100,000"),),
        unit="datapoint",
        lengthy=True,
    ),
)

STREAM_REQUIREMENTS: tuple[Requirement, ...] = (
    *(BestAnswer(case) for case in ("stream_14", "stream_75")),
    *(MinSpeedup(case, times=1.0) for case in ("stream_14", "stream_75")),
    TimeLimit("stream_14", milliseconds=0.01, entry=f"pilotfish, {_ONE}"),
    *(
        MinRate(f"{order}_{D}", datapoints_per_second=rate)
        for D, rate in ((3, 500_000), (14, 200_000), (75, 60_000))
        for order in ("long", "shuffled")
    ),
    MemoryLimit("repeated_3", data_mb=240.0, times=0.05),
)
