"""Streams are learned as the thesis shows: clusters, subspaces, their order; and order of arrival matters."""

import json
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from PIL import Image

import pilotfish as pf
from pilotfish.models.online import observe_stream

FOLDER = Path(__file__).parents[2] / "reproductions"


def run(name: str, *options: object) -> None:
    command = [sys.executable, "-W", "ignore", FOLDER / f"{name}.py", *map(str, options)]
    subprocess.run(command, check=True, capture_output=True, timeout=400)


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("way", ["thesis", "forgetting"])
def test_a_stream_that_changes_twice_is_followed(online_stages: ModuleType, way: str, seed: int):
    """K and every d are the true ones after each stage, labels agree with the truth, so do transitions."""
    for stage_result in online_stages.stage_results(way, seed):
        evaluate_model = online_stages.evaluate_model(stage_result)
        assert evaluate_model["all right"], evaluate_model
        assert evaluate_model["information"] > 0.97
        assert evaluate_model["transition error without the fourth"] < 0.02
    assert [len(stage.bases) for stage in online_stages.stages(seed)] == [4, 4, 6]


def test_with_the_printed_penalties_joined_visits_last_as_long_as_the_true_ones(online_stages: ModuleType):
    """Visits that merged clusters had cut: 80 steps in the mean, deviation 6; as counted they are shorter."""
    evaluate_model = online_stages.evaluate_model(online_stages.stage_results("thesis", 0)[0])
    assert evaluate_model["duration, joined [steps]"] == pytest.approx(80.0, abs=2.5)
    assert evaluate_model["deviation of durations, joined [steps]"] < 8.0
    assert evaluate_model["duration [steps]"] < evaluate_model["duration, joined [steps]"]


def test_the_stream_is_made_as_told(online_stages: ModuleType):
    """Centres apart, subspaces complementary, visits of 70 to 90 in a cycle that no stage's end cuts."""
    first, second, third = online_stages.stages(3)
    gaps = np.linalg.norm(third.centres[:, None] - third.centres, axis=2)[~np.eye(6, dtype=bool)]
    assert gaps.min() >= 4 * np.sqrt(3)
    for basis, other in zip(first.bases, second.bases, strict=True):
        both = np.column_stack([basis, other])
        np.testing.assert_allclose(both.T @ both, np.eye(3), atol=1e-12)
    visited, lengths = pf.models.runs(np.concatenate([s.labels for s in (first, second, third)]))
    assert lengths[:-1].min() >= 70
    assert lengths[:-1].max() <= 90
    assert set(zip(visited[:-1].tolist(), visited[1:].tolist(), strict=True)) >= {
        (0, 1),
        (3, 0),
        (3, 4),
        (5, 0),
    }


def test_growing_by_pieces_is_the_same_model(online_stages: ModuleType):
    """The pictures' models, learned piece by piece, end where the table's do."""
    whole = online_stages.stage_results("thesis", 0)[-1].model
    pieces = online_stages.models_by_step("thesis", 0, 500)[-1]
    np.testing.assert_array_equal(pieces.state.clusters, whole.state.clusters)


def test_the_clusters_of_the_z(data_folder, online_zshape: ModuleType):
    """Printed penalties: dozens of clusters when compared with squares, a handful when lambda is a length."""
    shown = pf.datasets.zshape()
    models = [online_zshape.learn_stream(settings, shown) for settings in online_zshape.ENCODINGS.values()]
    assert [model.clusters for model in models] == [94, 6, 21, 7]
    distances = [
        online_zshape.encoding(name, model, shown)["mean squared distance"]
        for name, model in zip(online_zshape.ENCODINGS, models, strict=True)
    ]
    assert distances[2] < distances[0] < distances[3] < distances[1]


def test_the_states_of_the_z_are_in_order_and_move_along_it(data_folder, online_zshape: ModuleType):
    """Four states in a row; the motion that they make keeps to the Z within 3 units, but along x."""
    row, pictures = online_zshape.sosc(pf.datasets.zshape())
    assert row["K after each demonstration"] == [4, 4, 4, 4, 4]
    assert max(row["squared error along x, y, z"][1:]) < 9.0
    assert set(pictures) == {"figure-5.1-states", "figure-5.1-graph"}


def test_distances_to_subspaces_are_those_of_the_definition(online_zshape: ModuleType, rng):
    """|e - rho U U^T e|^2 (5.13), datapoint by datapoint."""
    like = pf.demonstration(rng.normal(size=(50, 3)), 0.1, pf.demonstrations.position_layout(3))
    model = online_zshape.empty(pf.online.DPMPPCA(20.0, 0.1, 0.1, 9.0), like)
    model, _ = observe_stream(model, like.x)
    found = online_zshape.squared_distances(model, like.x[:5], 9.0)
    for x, row in zip(like.x, found, strict=False):
        for k, distance in enumerate(row):
            e, d = x - model.means[k, 0], model.dimensions[k, 0]
            U = model.bases[k, 0][:, :d]
            rho = np.exp(-(e @ e) / 9.0)
            np.testing.assert_allclose(distance, np.sum((e - rho * U @ (U.T @ e)) ** 2), atol=1e-12)


def test_what_makes_the_model_of_the_z_depend_less_on_order(data_folder, online_zshape: ModuleType):
    """Shuffled datapoints: begun from a batch fit models agree; in order, batches fit far better."""
    shown = pf.datasets.zshape()
    plain, begin_from_batch, batches = (
        online_zshape.evaluate_shuffles(name, online_zshape.ORDER_EXPERIMENTS[name], shown, 8)[2]
        for name in ("lambda a length", "begun from a batch fit", "batches of 50")
    )
    assert begin_from_batch["information with each other"] > plain["information with each other"] + 0.1
    assert begin_from_batch["deviation of clusters"] < plain["deviation of clusters"]
    assert batches["in order, loss"] < 0.2 * plain["in order, loss"]


def test_silhouettes_are_those_of_the_definition(online_dimensions: ModuleType, rng):
    """Mean distances, one datapoint at a time (footnote 6); one alone in its cluster scores nothing."""
    x, labels = rng.normal(size=(40, 3)), np.append(rng.integers(0, 3, size=39), 7)
    scores = []
    for n in range(40):
        own = [np.linalg.norm(x[n] - x[m]) for m in range(40) if m != n and labels[m] == labels[n]]
        others = [
            np.mean([np.linalg.norm(x[n] - x[m]) for m in range(40) if labels[m] == k])
            for k in set(labels.tolist()) - {labels[n]}
        ]
        scores.append((min(others) - np.mean(own)) / max(min(others), np.mean(own)) if own else 0.0)
    assert online_dimensions.silhouette(x, labels) == pytest.approx(np.mean(scores), abs=1e-12)
    assert online_dimensions.silhouette(x, np.zeros(40, dtype=int)) == 0.0


def test_ten_and_seventy_five_dimensions_are_told_apart(online_dimensions: ModuleType):
    """Clusters, labels and, where there are datapoints enough, dimensions are right (figure 5.8)."""
    for D in (10, 75):
        evaluate_model = online_dimensions.evaluate_model(
            online_dimensions.stream(D, 1000, 0), online_dimensions.settings(D)
        )
        assert evaluate_model["clusters"] == 4
        assert evaluate_model["information"] > 0.95
        assert evaluate_model["silhouette"] > 0.7
        assert evaluate_model["distance of means"] < 1.5 * evaluate_model["expected distance"]
        assert evaluate_model["dimensions right"] == 1.0 or D == 75


def test_parameters_of_streams_are_counted_as_printed(online_valve: ModuleType):
    """Table 5.1: 211 for subspaces of 4, 3, 4 and 318 for 5, 5, 4, 3, in 14 dimensions."""
    assert online_valve.parameters_of(3, 1, 14, 4 + 3 + 4) == 211
    assert online_valve.parameters_of(4, 1, 14, 5 + 5 + 4 + 3) == 318


def test_the_form_of_a_stream_serves_the_valve_and_its_order_does_not(data_folder, online_valve: ModuleType):
    """A batch fit brought into it reproduces what is unseen as well; a stream from nothing does not."""
    shown = pf.datasets.valve()
    train, test = shown[:4], shown[4:]
    batch, first = online_valve.learn_skill(train), online_valve.learn_skill(train[:2])
    errors = [
        online_valve.error(skill, test)
        for skill in (
            batch,
            pf.online.to_skill(online_valve.begin_from_batch(batch, train, 0.9)),
            pf.online.to_skill(
                online_valve.learn_stream(online_valve.empty_model(first, train[:2], 0.9), train)
            ),
        )
    ]
    assert errors[1] < errors[0]
    assert errors[2] > 1.5 * errors[0]


@pytest.mark.slow  # runs the reproductions: 2 to 11 CPU seconds each
@pytest.mark.parametrize(
    ("name", "options", "count"),
    [
        ("online_stages", ("--seeds", 2), 5),
        ("online_zshape", ("--shuffles", 3), 4),
        ("online_dimensions", ("--repeats", 1, "--dimensions", 10, 25, "--lengths", 1000, 2500), 1),
        ("online_valve", ("--orders", 2), 2),
    ],
)
def test_each_online_reproduction_writes_its_numbers_and_pictures(
    data_folder, tmp_path, name, options, count
):
    report, pictures = tmp_path / "rows.json", tmp_path / "pictures"
    run(name, "--json", report, "--out", pictures, *options)
    assert json.loads(report.read_text())["rows"]
    assert len(list(pictures.glob("*.png"))) == count
    if name == "online_stages":
        assert (pictures / "growing.gif").stat().st_size < 5_000_000
        with Image.open(pictures / "growing.gif") as film:
            assert film.n_frames == 75
