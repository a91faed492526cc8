"""Learning from streams: what is measured, and what pilotfish promises."""

from kinds import BestAnswer, Case, Entry, MemoryLimit, MinRate, MinSpeedup, Requirement, TimeLimit

_ONE, _BATCHES = "one by one", "in batches of 100"
_SPEED = Entry("pilotfish", "from_array", "pilotfish, from an array")
_PORTABLE = Entry("pilotfish_baseline", "from_array", "pilotfish, portable kernels")
_WORST = (
    Entry("pilotfish", "worst_case", "pilotfish, from an array"),
    Entry("pilotfish_baseline", "worst_case", "pilotfish, portable kernels"),
)
_OURS = (_SPEED, Entry("pilotfish", "one_by_one", f"pilotfish, {_ONE}"), _PORTABLE)
_PEERS = (
    Entry("river", "dbstream", f"river DBSTREAM, {_ONE}"),
    Entry("river", "denstream", f"river DenStream, {_ONE}"),
    Entry("river", "clustream", f"river CluStream, {_ONE}"),
    Entry("river", "stream_k_means", f"river STREAMKMeans, {_ONE}"),
    Entry("scikit_learn", "k_means_one_by_one", f"scikit-learn MiniBatchKMeans, {_ONE}"),
    Entry("scikit_learn", "k_means_in_batches", f"scikit-learn MiniBatchKMeans, {_BATCHES}"),
    Entry("scikit_learn", "birch_one_by_one", f"scikit-learn Birch, {_ONE}"),
    Entry("scikit_learn", "birch_in_batches", f"scikit-learn Birch, {_BATCHES}"),
    Entry(
        "scikit_learn",
        "birch_that_keeps",
        "scikit-learn Birch that keeps the stream",
        differs="a batch method: it keeps most datapoints and clusters them at the end",
    ),
    Entry("dp_means", "one_by_one", f"DP-means, {_ONE}"),
    Entry("dp_means", "in_batches", f"DP-means, {_BATCHES}"),
)
_NMI = "NMI with the true clusters"
_RULE = (
    "pilotfish (SOSC) has its penalties by one rule from the generator's scales: lambda is 2/5 of a "
    "cluster's variance r^2, or 1/4 of the squared distance of centres if that is more; lambda_1 the "
    "geometric mean of the variances along a subspace and beside it; lambda_2 and lambda_3 the thesis' "
    "shares of lambda; b_m fades to 9/10 at 2 r^2; clusters merge at 1/4 of the distance of centres; a "
    "trace lasts one round of all clusters and forgets below 0.3. Its labels are those of assignment, "
    "merged clusters followed, but not one by one. "
)
_NEAR = (
    "{stream} datapoints; 7 clusters in a circle, visits of 70 to 90 steps. Each is a random subspace of "
    "{d} dimensions in {D}, standard deviation 3 along it and .2 in every column; centres are at least "
    "{apart} apart, so that the nearest mean is often another's. Within a visit coordinates along the "
    "subspace wander, correlated by .9 from step to step. "
)
_TUNED = (
    "Peers are told the true number of clusters where they take one, and have the setting of most NMI on "
    "these very data, looked for outside the time. Their labels are read with the model of the end of the "
    "stream, or a hundred datapoints at a time as they came, whichever is better; to read them is in the "
    "time, since pilotfish tells them as it learns. Birch may keep a tenth of the datapoints, as one who "
    "learns a stream, or as many as it likes, in an entry that is not judged. r is a cluster's "
    "radius, the extent times the root of the largest dimension. Grids: DBSTREAM clustering_threshold "
    "{.5, .7, 1} r, fading_factor {.0005, .002}, intersection_factor {.02, .05, .2}; DenStream epsilon "
    "{.35, .5, .7, 1, 1.4} r, decaying_factor {.2, .6, 2}; CluStream with 50 micro-clusters (100 take four "
    "times as long) halflife {.3, .5}, sigma {.03, .1} r, two seeds; STREAMKMeans chunks of {10, 100}, "
    "halflife {.03, .1, .5}, sigma {.03, .1} r, three seeds; MiniBatchKMeans reassignment_ratio {0, .01, "
    ".1}, four seeds, begun at points of the whole stream; Birch threshold {.1, .15, .2, .25, .35, .5, "
    ".7, 1} r; DP-means delta {.3, .5, .7, 1, 1.4, 2, 2.8, 4} r^2. "
)
_FAR = (
    "{long} datapoints, 20 clusters at least 4 sqrt(D) apart, standard deviation 1 along {d} and .2 in "
    "every column, independent draws. "
)
_CIRCLE = "A circle of visits of 70 to 90 steps. "
_SHUFFLED = (
    "The worst case: every step draws its cluster anew, so that nothing is gained by the order of visits; "
    "the model has settled on the first 10,000 datapoints, and from then on b_m is so large that subspaces "
    "do not fade and no cluster can be passed over because it is far. In 3 dimensions, planes that do not "
    "fade cross other clusters, and NMI is less for it. "
)


def _near(D: int, d: str, apart: int) -> Case:
    told = _NEAR.replace("{d}", d).replace("{D}", str(D)).replace("{apart}", str(apart))
    explanation = told + _TUNED + _RULE
    title = f"sequence data in {D} dimensions, near clusters"
    return Case(f"stream_{D}", title, f"stream_{D}", explanation, _NMI, (*_OURS, *_PEERS), unit="datapoint")


def _far(D: int, d: str, shuffled: bool) -> Case:
    name = f"shuffled_{D}" if shuffled else f"long_{D}"
    title = f"long stream in {D} dimensions" + (", worst case" if shuffled else "")
    explanation = _FAR.replace("{d}", d) + (_SHUFFLED if shuffled else _CIRCLE) + "Penalties as above."
    entries = _WORST if shuffled else (_SPEED, _PORTABLE)
    return Case(name, title, name, explanation, _NMI, entries, unit="datapoint")


_SIZES = ((3, "1 or 2 dimensions"), (14, "4 dimensions"), (75, "8 dimensions"))

STREAM_CASES = (
    _near(14, "2 to 4", 5),
    _near(75, "4 to 8", 4),
    *(_far(D, d, shuffled) for D, d in _SIZES for shuffled in (False, True)),
    Case(
        "endless_3",
        "a stream of 10 million datapoints in 3 dimensions",
        "long_3",
        "The first 100,000 datapoints of long_3 a hundred times: 240 MB, had they been kept. What grows "
        "is the memory of a chunk's assignments.",
        "NMI with the true clusters, the last time",
        (Entry("pilotfish", "endless", "pilotfish, in chunks of 100,000"),),
        unit="datapoint",
        lengthy=True,
    ),
)

STREAM_TARGETS: tuple[Requirement, ...] = (
    *(BestAnswer(case) for case in ("stream_14", "stream_75")),
    *(MinSpeedup(case, times=1.0) for case in ("stream_14", "stream_75")),
    TimeLimit("stream_14", milliseconds=0.01, entry=f"pilotfish, {_ONE}"),
    *(
        MinRate(f"{order}_{D}", datapoints_per_second=rate)
        for D, rate in ((3, 500_000), (14, 200_000), (75, 60_000))
        for order in ("long", "shuffled")
    ),
    MemoryLimit("endless_3", data_mb=240.0, times=0.05),
)
