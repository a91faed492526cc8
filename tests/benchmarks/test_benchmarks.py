"""The benchmarks run, evaluate the requirements, and continue without a missing peer."""

import json
import subprocess
import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture
def benchmark_module(monkeypatch: pytest.MonkeyPatch):
    """Import modules of benchmarks/ like `python benchmarks/run.py`."""
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    return import_module


def results(measure: ModuleType, kinds: ModuleType, case_results: dict[str, tuple[float, float]]):
    """Return a result for each library with constant CPU time and an answer."""
    return [
        measure.Result(kinds.Entry(name, "", name), cpu=measure.sample_statistics([cpu] * 3), answer=answer)
        for name, (cpu, answer) in case_results.items()
    ]


@pytest.mark.slow  # times every problem: 26 CPU seconds
def test_quick_run_fills_table_and_json(tmp_path: Path):
    table, figures = tmp_path / "table.md", tmp_path / "figures.json"
    options = ["--quick", "--only", "pilotfish", "--out", str(table), "--json", str(figures)]
    command = [sys.executable, str(BENCHMARKS / "run.py"), *options]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    figures_read = json.loads(figures.read_text(), parse_constant=pytest.fail)  # NaN is not JSON
    assert len(figures_read["cases"]) >= 8
    for case in figures_read["cases"]:
        assert f"`{case['case']}`" in table.read_text()
        for entry in case["entries"]:
            assert entry["entry"]["library"] == "pilotfish"
            assert not entry["failure"], entry["failure"]
            assert 0 < entry["cpu"]["minimum"] <= entry["cpu"]["median"]
            assert entry["first"]["peak_mb"] > 1
    assert {target["verdict"] for target in figures_read["targets"]} <= {"pass", "miss", "not measured"}
    assert table.read_text() + "\n" == done.stdout


def test_quartiles_contain_half_of_samples(benchmark_module, rng: np.random.Generator):
    sample_statistics = benchmark_module("measure").sample_statistics
    samples = rng.exponential(size=15)
    case_results = sample_statistics(samples.tolist())
    expected = np.percentile(samples, [25, 50, 75])
    np.testing.assert_allclose(
        [case_results.lower, case_results.median, case_results.upper], expected, rtol=1e-12
    )
    assert case_results.minimum == samples.min()
    assert (
        sample_statistics([2.0]).lower,
        sample_statistics([2.0]).median,
        sample_statistics([2.0]).upper,
    ) == (2.0, 2.0, 2.0)


@pytest.mark.parametrize(("cpu", "verdict"), [(1.9e-3, "pass"), (2e-3, "pass"), (2.1e-3, "miss")])
def test_time_limit_is_upper_bound(benchmark_module, cpu: float, verdict: str):
    cases, kinds, measure, judging, requirements = map(
        benchmark_module, ("cases", "kinds", "measure", "judging", "requirements")
    )
    case = next(case for case in cases.CASES if case.name == "lqt")
    case_results = [(case, results(measure, kinds, {"pilotfish": (cpu, 1.0)}))]
    assert (
        judging.evaluate_requirement(requirements.TimeLimit("lqt", milliseconds=2.0), case_results).verdict
        == verdict
    )


@pytest.mark.parametrize(("slower", "verdict"), [(4.5, "pass"), (3.5, "miss")])
def test_min_speedup_uses_fastest_entry_of_peer(benchmark_module, slower: float, verdict: str):
    cases, kinds, measure, judging, requirements = map(
        benchmark_module, ("cases", "kinds", "measure", "judging", "requirements")
    )
    case = next(case for case in cases.CASES if case.name == "em_valve")
    own = results(measure, kinds, {"pilotfish": (1e-3, 1.0)})
    slow, fast = (results(measure, kinds, {"hmmlearn": (s * 1e-3, 1.0)}) for s in (9.0, slower))
    case_results = [(case, [*own, *slow, *fast])]
    assert (
        judging.evaluate_requirement(
            requirements.MinSpeedup("em_valve", over="hmmlearn", times=4.0), case_results
        ).verdict
        == verdict
    )


@pytest.mark.parametrize("answer", [1.1, np.nan])
def test_requirements_different_answers_are_not_comparable(benchmark_module, answer: float):
    cases, kinds, measure, judging, requirements = map(
        benchmark_module, ("cases", "kinds", "measure", "judging", "requirements")
    )
    case = next(case for case in cases.CASES if case.name == "em_valve")
    case_results = results(measure, kinds, {"pilotfish": (1e-3, 1.0), "hmmlearn": (9e-3, answer)})
    judged = judging.evaluate_requirement(
        requirements.MinSpeedup("em_valve", over="hmmlearn", times=4.0), [(case, case_results)]
    )
    assert judged.verdict.startswith("not comparable")


@pytest.mark.parametrize(("slower", "verdict"), [(3.5, "pass"), (2.5, "miss")])
def test_min_speedup_over_all_uses_fastest_peer(benchmark_module, slower: float, verdict: str):
    cases, kinds, measure, judging, requirements = map(
        benchmark_module, ("cases", "kinds", "measure", "judging", "requirements")
    )
    case = next(case for case in cases.CASES if case.name == "em_valve")
    seconds = {"pilotfish": 1.0, "pilotfish_baseline": 1.1, "hmmlearn": 9.0, "dynamax": slower}
    case_results = [(case, results(measure, kinds, {name: (s * 1e-3, 1.0) for name, s in seconds.items()}))]
    judged = judging.evaluate_requirement(requirements.MinSpeedup("em_valve", times=3.0), case_results)
    assert (judged.verdict, judged.measured) == (verdict, f"{slower:.1f} x (dynamax)")


@pytest.mark.parametrize(("grown", "verdict"), [(134.0, "pass"), (135.0, "miss")])
def test_memory_limit_uses_added_memory(benchmark_module, grown: float, verdict: str):
    cases, kinds, measure, judging, requirements = map(
        benchmark_module, ("cases", "kinds", "measure", "judging", "requirements")
    )
    case = next(case for case in cases.CASES if case.name == "fit_vast")
    first = measure.FirstCall(cpu=1.0, wall=1.0, result=2.0, peak_mb=1e4, grown_mb=grown)
    case_results = measure.Result(
        kinds.Entry("pilotfish", "", ""), measure.sample_statistics([1.0]), first=first, answer=1.0
    )
    assert (
        judging.evaluate_requirement(
            requirements.MemoryLimit("fit_vast", 67.2, 2.0), [(case, [case_results])]
        ).verdict
        == verdict
    )


@pytest.mark.parametrize(("begin", "comparable"), [(2.0, True), (2.1, False), (np.nan, False)])
def test_agreement_different_model_compares_start(benchmark_module, begin: float, comparable: bool):
    cases, kinds, measure, judging, requirements = map(
        benchmark_module, ("cases", "kinds", "measure", "judging", "requirements")
    )
    case = next(case for case in cases.CASES if case.name == "em_valve")
    own = measure.Result(
        kinds.Entry("pilotfish", "", ""), measure.sample_statistics([1.0]), answer=5.0, begin=2.0
    )
    other = kinds.Entry("dynamax", "", "", differs="its prior")
    case_results = [own, measure.Result(other, measure.sample_statistics([9.0]), answer=4.0, begin=begin)]
    judged = judging.evaluate_requirement(
        requirements.MinSpeedup("em_valve", times=3.0), [(case, case_results)]
    )
    assert judged.verdict == ("pass" if comparable else "not comparable: the answers differ")


def test_added_memory_ignores_released_memory(benchmark_module):
    worker = benchmark_module("worker")
    if not worker.RESET.exists():
        pytest.skip("this kernel counts one peak for the whole of a process")
    held = np.ones(40_000_000)  # 320 MB
    del held
    worker.reset_peak_memory()
    before = worker.peak_mb()
    held = np.ones(20_000_000)
    assert 150.0 < worker.peak_mb() - before < 250.0
    del held


def test_peer_environment_failed_install_keeps_others(benchmark_module, tmp_path: Path):
    module = benchmark_module("peer_environment")
    listed, installed = tmp_path / "peers.txt", []
    listed.write_text("good==1.0\nbad==2.0\nfine==3.0\n")

    def run(command) -> str:
        if any("bad==" in word for word in command):
            return "no such version"
        installed.extend(word for word in command if "==" in word)
        return ""

    _, failures = module.peer_environment(tmp_path / "venv", listed, run)
    assert failures == {"bad": "no such version"}
    assert installed == ["good==1.0", "fine==3.0"]
    assert not (tmp_path / "venv" / "installed.txt").exists()


def test_worker_missing_library_is_reported(benchmark_module):
    workers = benchmark_module("workers")
    with (
        workers.Worker(Path(sys.executable), "no_such_library", workers.timed_environment()) as worker,
        pytest.raises(workers.WorkerError, match="no_such_library"),
    ):
        worker.ask("introduce")


def test_peer_lists_are_pinned():
    lines = [line for listed in BENCHMARKS.glob("peers*.txt") for line in listed.read_text().splitlines()]
    assert len(lines) > 10
    for line in lines:
        name, version = line.split("==")
        assert name.replace("-", "").isalnum()
        assert version.replace(".", "").isalnum()


def test_textbook_tracker_equals_least_squares(benchmark_module, rng: np.random.Generator):
    lqt = benchmark_module("libraries.textbook").lqt
    T, n, m = 6, 3, 2
    A, B, z, x0 = (
        rng.normal(size=(n, n)),
        rng.normal(size=(n, m)),
        rng.normal(size=(T, n)),
        rng.normal(size=n),
    )
    roots = rng.normal(size=(T, n, n))
    Q, R = roots @ roots.swapaxes(1, 2), np.diag([1.0, 2.0])
    K, k = lqt(A, B, Q, z, R)
    x, u = x0, []
    for t in range(T - 1):
        u.append(k[t] - K[t] @ x)
        x = A @ x + B @ u[-1]
    powers = [np.linalg.matrix_power(A, t) for t in range(T)]
    drift = np.concatenate([power @ x0 for power in powers])
    zero = np.zeros((n, m))
    push = np.block([[powers[t - 1 - s] @ B if s < t else zero for s in range(T - 1)] for t in range(T)])
    weight = np.zeros((T * n, T * n))
    for t in range(T):
        weight[t * n : (t + 1) * n, t * n : (t + 1) * n] = Q[t]
    hessian = push.T @ weight @ push + np.kron(np.eye(T - 1), R)
    best = np.linalg.solve(hessian, push.T @ weight @ (z.ravel() - drift))
    np.testing.assert_allclose(np.concatenate(u), best, rtol=1e-6, atol=1e-8)
