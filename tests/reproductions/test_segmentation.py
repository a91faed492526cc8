"""Segmentation features, durations and scores follow their definitions."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import pilotfish as pf


@pytest.fixture(scope="module")
def recorded(data_folder):
    return pf.datasets.mocap6(), pf.datasets.mocap6_labels()


def test_standardise_keeps_steps(recorded, segmentation):
    for features in segmentation.FEATURES.values():
        sequences = features(recorded[0])
        x = np.vstack([d.x for d in sequences])
        np.testing.assert_allclose(x.mean(axis=0), 0.0, atol=1e-9)
        np.testing.assert_allclose(x.std(axis=0), 1.0, rtol=1e-9)
        assert [len(d.x) for d in sequences] == [len(of) for of in recorded[1]]


def test_window_features_are_shifted_rows(recorded, segmentation):
    window = segmentation.standardise(recorded[0])[2].x[95:106]
    sequences = segmentation.window_features(recorded[0])
    every = np.vstack([d.x for d in sequences])
    raw = [segmentation.standardise(recorded[0])[m].x for m in range(4)]
    padded = [np.pad(x, ((5, 5), (0, 0)), mode="edge") for x in raw]
    means = np.vstack([[p[t : t + 11].mean(axis=0) for t in range(len(p) - 10)] for p in padded])
    deviations = np.vstack([[p[t : t + 11].std(axis=0) for t in range(len(p) - 10)] for p in padded])
    for expected, columns, there in (
        (means, every[:, :12], window.mean(axis=0)),
        (deviations, every[:, 12:], window.std(axis=0)),
    ):
        np.testing.assert_allclose(
            columns, (expected - expected.mean(axis=0)) / expected.std(axis=0), atol=1e-9
        )
        row = sum(len(x) for x in raw[:2]) + 100
        np.testing.assert_allclose(expected[row], there, atol=1e-12)


def test_exact_durations_are_more_likely(recorded, segmentation):
    sequences = segmentation.standardise(recorded[0])
    trials = [segmentation.run_trial(sequences, recorded[1], seed, 0.1) for seed in range(2)]
    for tried in trials:
        likelihoods = {method: tried[method]["log_likelihood"] for method in segmentation.METHODS}
        assert max(likelihoods, key=likelihoods.__getitem__) == "exact durations"
        assert min(likelihoods, key=likelihoods.__getitem__) == "mixture"
        for method in segmentation.METHODS:
            assert 0.4 < tried[method]["accuracy"] < 0.7
            assert 0.45 < tried[method]["information"] < 0.75
            assert [len(path) for path in tried[method]["paths"]] == [len(of) for of in recorded[1]]
    shuffled = [np.random.default_rng(0).permutation(of) for of in recorded[1]]
    for method in segmentation.METHODS:
        chance = segmentation.matched_accuracy(
            np.concatenate(trials[0][method]["paths"]), np.concatenate(shuffled)
        )
        assert chance < 0.6 * trials[0][method]["accuracy"]


def test_duration_statistics_of_truncated_gaussian_are_exact(segmentation):
    distribution = pf.durations.Gaussian(np.array([60.0, 1.0]), np.array([5.0, 20.0]))
    means, deviations = segmentation.duration_statistics(distribution)
    np.testing.assert_allclose(means[0], 6.0, rtol=1e-6)
    np.testing.assert_allclose(deviations[0], 0.5, rtol=1e-4)
    assert 1.4 < means[1] < 1.8  # a half normal of deviation 2 s has the mean 1.6 s


def test_summary_compares_methods_by_seed(segmentation):
    scores = ("accuracy", "information", "log_likelihood", "steps_a_visit", "evidence", "seconds")
    trials = [
        {"HMM": dict.fromkeys(scores, base), "mixture": dict.fromkeys(scores, base + 0.1)}
        for base in (0.2, 0.5, 0.8)
    ]
    row = segmentation.summary("mixture", trials)
    assert row["accuracy"] == pytest.approx(0.6)
    assert row["accuracy_deviation"] == pytest.approx(0.3)
    assert row["accuracy_over_HMM"] == pytest.approx(0.1)
    assert row["accuracy_over_HMM_error"] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.slow  # runs the reproduction
def test_segmentation_writes_outputs(data_folder, tmp_path):
    report, pictures = tmp_path / "rows.json", tmp_path / "pictures"
    script = Path(__file__).parents[2] / "reproductions" / "segmentation.py"
    command = [sys.executable, script, "--seeds", "2", "--json", report, "--out", pictures]
    subprocess.run(command, check=True, capture_output=True, timeout=300)
    written = json.loads(report.read_text())
    assert [len(part["rows"]) for part in written.values()] == [4, 4]
    assert len(list(pictures.glob("*.png"))) == 4
