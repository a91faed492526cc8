"""Streams have the stated parameters, peers are tuned, and requirements on streams are evaluated."""

import subprocess
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from pilotfish.models import normalised_mutual_information

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture
def benchmark_module(monkeypatch: pytest.MonkeyPatch):
    """Import modules of benchmarks/ like `python benchmarks/run.py`."""
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    return import_module


def results(kinds, measure, case_results: dict[str, tuple[float, float]]):
    """Return a result for each library with constant CPU time and an answer."""
    return [
        measure.Result(kinds.Entry(name, "", name), cpu=measure.sample_statistics([cpu] * 3), answer=answer)
        for name, (cpu, answer) in case_results.items()
    ]


@pytest.mark.parametrize(("K", "L"), [(1, 1), (1, 3), (4, 4), (6, 3)])
def test_mutual_information_equals_library(benchmark_module, rng: np.random.Generator, K: int, L: int):
    own = benchmark_module("streaming").normalised_mutual_information
    found, truth = rng.integers(K, size=200), rng.integers(L, size=200)
    assert own(found, truth) == pytest.approx(normalised_mutual_information(found, truth), abs=1e-12)
    assert own(7 - 3 * truth, truth) == pytest.approx(1.0)


@pytest.mark.parametrize("name", ["stream_14", "stream_75", "long_3", "shuffled_14"])
def test_sample_stream_has_stated_shape(benchmark_module, rng: np.random.Generator, name: str):
    streams = benchmark_module("make_streams")
    shape, N = streams.SHAPES[name], 20_000
    stream = streams.sample_stream(rng, shape, N)
    assert stream.x.shape == (N, shape.columns)
    assert set(stream.labels) == set(range(shape.clusters))
    durations = np.diff(np.flatnonzero(np.diff(stream.labels)))
    assert (durations.min() == 1) if shape.shuffled else (durations.min() >= 70 and durations.max() <= 90)
    groups = [stream.x[stream.labels == k] for k in range(shape.clusters)]
    for group in groups:
        deviations = np.sqrt(np.linalg.eigvalsh(np.cov(group.T))[::-1])
        along = deviations > 0.5 * shape.extent
        assert shape.min_dimension <= along.sum() <= shape.max_dimension
        # a correlation of .9 leaves a nineteenth of 2800 steps: 150 to estimate a deviation from
        assert np.all(np.abs(deviations[along] / shape.extent - 1.0) < 0.5)
        assert np.all(np.abs(deviations[~along] / stream.noise - 1.0) < 0.25)


def test_centres_are_separated(benchmark_module, rng: np.random.Generator):
    sample_separated_centres = benchmark_module("make_streams").sample_separated_centres
    for K, D in ((1, 3), (7, 14), (50, 3), (20, 75)):
        points = sample_separated_centres(rng, K, D, 2.0)
        distances = np.sqrt(((points[:, None] - points) ** 2).sum(axis=-1)) + 9.0 * np.eye(K)
        assert points.shape == (K, D)
        assert distances.min() >= 2.0


def test_coordinates_are_correlated_within_segments(benchmark_module, rng: np.random.Generator):
    begins = np.arange(0, 40_000, 4)
    c = (
        benchmark_module("make_streams")
        .sample_autocorrelated(rng, (40_000, 3), 0.9, begins)
        .reshape(-1, 4, 3)
    )
    assert np.mean(c**2) == pytest.approx(1.0, abs=0.03)  # 120,000 numbers, a few of them independent
    for t, expected in ((1, 0.9), (2, 0.81), (3, 0.729)):
        assert np.mean(c[:, 0] * c[:, t]) == pytest.approx(expected, abs=0.03)
    assert np.mean(c[:-1, 3] * c[1:, 0]) == pytest.approx(0.0, abs=0.03)


def test_tune_chooses_best_setting(benchmark_module, tmp_path: Path):
    streaming = benchmark_module("streaming")
    truth = np.repeat([0, 1], 150)
    points = truth.tolist()
    passes = []

    def make(setting):
        if setting["modulus"] == 0:
            raise ValueError("no such modulus")
        passes.append(setting["modulus"])
        return setting["modulus"]

    peer = streaming.Peer(make, lambda model, block: None, lambda model, block: [p % model for p in block])
    grid = [{"modulus": m} for m in (1, 0, 2)]
    kept = tmp_path / "peer.json"
    first, again = (streaming.prepared(kept, peer, points, truth, grid) for _ in range(2))
    assert passes == [1, 2]
    assert first.answer(first.run()).value == again.answer(again.run()).value == pytest.approx(1.0)
    assert first.answer(2).units == 300
    assert "modulus 2" in first.answer(2).remark
    with pytest.raises(ValueError, match="no such modulus"):
        streaming.tune(peer, points, truth, [{"modulus": 0}])


@pytest.mark.parametrize(("cpu", "verdict"), [(1.9e-6, "pass"), (2e-6, "pass"), (2.1e-6, "miss")])
def test_min_rate_is_lower_bound(benchmark_module, cpu: float, verdict: str):
    cases, kinds, measure, judging, requirements = map(
        benchmark_module, ("cases", "kinds", "measure", "judging", "requirements")
    )
    case = next(case for case in cases.CASES if case.name == "long_3")
    case_results = [(case, results(kinds, measure, {"pilotfish": (cpu, 1.0)}))]
    assert (
        judging.evaluate_requirement(requirements.MinRate("long_3", 500_000), case_results).verdict == verdict
    )


@pytest.mark.parametrize(
    ("best", "verdict"), [(0.89, "pass"), (0.9, "miss"), (0.95, "miss"), (np.nan, "pass")]
)
def test_best_answer_compares_every_peer(benchmark_module, best: float, verdict: str):
    cases, kinds, measure, judging, requirements = map(
        benchmark_module, ("cases", "kinds", "measure", "judging", "requirements")
    )
    case = next(case for case in cases.CASES if case.name == "stream_14")
    answers = {"pilotfish": 0.9, "pilotfish_baseline": 0.99, "river": best, "scikit_learn": 0.5}
    case_results = results(kinds, measure, {name: (1e-6, answer) for name, answer in answers.items()})
    judged = judging.evaluate_requirement(requirements.BestAnswer("stream_14"), [(case, case_results)])
    assert judged.verdict == verdict
    assert (
        judging.evaluate_requirement(requirements.BestAnswer("stream_14"), [(case, case_results[:2])]).verdict
        == "not measured"
    )


def test_time_limit_of_labelled_entry_is_used(benchmark_module):
    cases, kinds, measure, judging, requirements = map(
        benchmark_module, ("cases", "kinds", "measure", "judging", "requirements")
    )
    case = next(case for case in cases.CASES if case.name == "stream_14")
    case_results = [
        measure.Result(
            kinds.Entry("pilotfish", "", label), cpu=measure.sample_statistics([cpu] * 3), answer=1.0
        )
        for label, cpu in (("array", 1e-6), ("point by point", 9e-6))
    ]
    for milliseconds, verdict in ((0.01, "pass"), (0.005, "miss")):
        judged = judging.evaluate_requirement(
            requirements.TimeLimit("stream_14", milliseconds, entry="point by point"), [(case, case_results)]
        )
        assert judged.verdict == verdict


def test_requirements_refer_to_existing_cases(benchmark_module):
    cases, peers = map(benchmark_module, ("cases", "peer_libraries"))
    known = {case.name: [entry.label for entry in case.entries] for case in cases.CASES}
    assert len(known) == len(cases.CASES)
    for target in cases.REQUIREMENTS:
        assert target.case in known
        assert target.entry in ("", *known[target.case])
    assert {entry.library for case in cases.CASES for entry in case.entries} == set(peers.LIBRARIES)


def test_streams_quick_run_omits_long_case(benchmark_module, monkeypatch):
    run = benchmark_module("run")
    monkeypatch.setattr(sys, "argv", ["run.py", "--quick"])
    names = {case.name for case in run.select_cases(run.arguments())}
    assert "stream_14" in names
    assert "repeated_3" not in names
    monkeypatch.setattr(sys, "argv", ["run.py", "--quick", "--cases", "repeated_3"])
    assert [case.name for case in run.select_cases(run.arguments())] == ["repeated_3"]


@pytest.mark.slow  # times streams of many sizes
def test_cost_table_small_sizes_is_written(tmp_path: Path):
    picture, figures = tmp_path / "cost.png", tmp_path / "cost.json"
    command = [sys.executable, str(BENCHMARKS / "streams_cost.py"), "--quick"]
    done = subprocess.run(
        [*command, "--out", str(picture), "--json", str(figures)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "Predicted: " in done.stdout
    assert picture.stat().st_size > 10_000
    assert figures.stat().st_size > 1000
