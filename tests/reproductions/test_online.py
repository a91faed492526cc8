"""Reproductions of online learning: clusters, subspaces, transitions, and the effect of the order."""

import json
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from PIL import Image

import pilotfish as pf
from pilotfish.models import state_segments
from pilotfish.models.online import observe_stream

FOLDER = Path(__file__).parents[2] / "reproductions"


def run(name: str, *options: object) -> None:
    command = [sys.executable, "-W", "ignore", FOLDER / f"{name}.py", *map(str, options)]
    subprocess.run(command, check=True, capture_output=True, timeout=400)


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("variant", ["thesis", "forgetting"])
def test_stages_clusters_and_dimensions_equal_truth(online_stages: ModuleType, variant: str, seed: int):
    """Labels and transitions agree with the truth, too."""
    for stage_result in online_stages.stage_results(variant, seed):
        result = online_stages.evaluate_stage(stage_result)
        assert result["all right"], result
        assert result["information"] > 0.97
        assert result["transition error without the fourth"] < 0.02
    assert [len(stage.bases) for stage in online_stages.stages(seed)] == [4, 4, 6]


def test_stages_joined_segments_have_true_durations(online_stages: ModuleType):
    """Joined: 80 steps with a deviation of 6; segments that were cut are shorter."""
    result = online_stages.evaluate_stage(online_stages.stage_results("thesis", 0)[0])
    assert result["duration, joined [steps]"] == pytest.approx(80.0, abs=2.5)
    assert result["deviation of durations, joined [steps]"] < 8.0
    assert result["duration [steps]"] < result["duration, joined [steps]"]


def test_stages_stream_equals_specification(online_stages: ModuleType):
    """Separated centres, complementary subspaces, and segments of 70 to 90 datapoints in a cycle."""
    first, second, third = online_stages.stages(3)
    gaps = np.linalg.norm(third.centres[:, None] - third.centres, axis=2)[~np.eye(6, dtype=bool)]
    assert gaps.min() >= 4 * np.sqrt(3)
    for basis, complement in zip(first.bases, second.bases, strict=True):
        joint = np.column_stack([basis, complement])
        np.testing.assert_allclose(joint.T @ joint, np.eye(3), atol=1e-12)
    segment_states, lengths = state_segments(np.concatenate([s.labels for s in (first, second, third)]))
    assert lengths[:-1].min() >= 70
    assert lengths[:-1].max() <= 90
    assert set(zip(segment_states[:-1].tolist(), segment_states[1:].tolist(), strict=True)) >= {
        (0, 1),
        (3, 0),
        (3, 4),
        (5, 0),
    }


def test_models_by_step_end_with_model_of_whole_stream(online_stages: ModuleType):
    """The pictures' models, learned piece by piece, end where the table's do."""
    whole = online_stages.stage_results("thesis", 0)[-1].model
    pieces = online_stages.models_by_step("thesis", 0, 500)[-1]
    np.testing.assert_array_equal(pieces.state.rows, whole.state.rows)


def test_zshape_number_of_clusters_depends_on_unit_of_lambda(data_folder, online_zshape: ModuleType):
    """Dozens of clusters if lambda is a square, and a handful if it is a length."""
    demonstrations = pf.datasets.zshape()
    models = [
        online_zshape.learn_stream(settings, demonstrations) for settings in online_zshape.ENCODINGS.values()
    ]
    assert [model.clusters for model in models] == [94, 6, 21, 7]
    distances = [
        online_zshape.encoding(name, model, demonstrations)["mean squared distance"]
        for name, model in zip(online_zshape.ENCODINGS, models, strict=True)
    ]
    assert distances[2] < distances[0] < distances[3] < distances[1]


def test_zshape_sosc_motion_follows_z(data_folder, online_zshape: ModuleType):
    """Four states in sequence; the error is below 3 units except along x."""
    row, pictures = online_zshape.sosc(pf.datasets.zshape())
    assert row["K after each demonstration"] == [4, 4, 4, 4, 4]
    assert max(row["squared error along x, y, z"][1:]) < 9.0
    assert set(pictures) == {"figure-5.1-states", "figure-5.1-graph"}


def test_squared_distances_equal_definition(online_zshape: ModuleType, rng):
    """|e - rho U U^T e|^2 (5.13), for each datapoint."""
    like = pf.demonstration(rng.normal(size=(50, 3)), 0.1, pf.demonstrations.position_layout(3))
    model = online_zshape.empty_model(pf.online.DPMPPCA(20.0, 0.1, 0.1, 9.0), like)
    model, _ = observe_stream(model, like.x)
    distances = online_zshape.squared_distances(model, like.x[:5], 9.0)
    for x, row in zip(like.x, distances, strict=False):
        for k, distance in enumerate(row):
            e, d = x - model.means[k, 0], model.dimensions[k, 0]
            U = model.state.bases[k, 0][:, :d]
            rho = np.exp(-(e @ e) / 9.0)
            np.testing.assert_allclose(distance, np.sum((e - rho * U @ (U.T @ e)) ** 2), atol=1e-12)


def test_zshape_batch_initialisation_reduces_effect_of_order(data_folder, online_zshape: ModuleType):
    """In the original order, batches have a much smaller loss."""
    demonstrations = pf.datasets.zshape()
    plain, initialised, batches = (
        online_zshape.evaluate_shuffles(name, online_zshape.ORDER_EXPERIMENTS[name], demonstrations, 8)[2]
        for name in ("lambda a length", "initialised from a batch fit", "batches of 50")
    )
    assert initialised["information with each other"] > plain["information with each other"] + 0.1
    assert initialised["deviation of clusters"] < plain["deviation of clusters"]
    assert batches["in order, loss"] < 0.2 * plain["in order, loss"]


def test_silhouette_equals_definition(online_dimensions: ModuleType, rng):
    """Mean distances for each datapoint (footnote 6); a datapoint alone in its cluster has 0."""
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


def test_dimensions_clusters_and_labels_equal_truth(online_dimensions: ModuleType):
    """Dimensions as well where there are enough datapoints (figure 5.8)."""
    for D in (10, 75):
        stream = online_dimensions.sample_stream(D, 1000, 0)
        result = online_dimensions.evaluate_model(stream, online_dimensions.settings(D))
        assert result["clusters"] == 4
        assert result["information"] > 0.95
        assert result["silhouette"] > 0.7
        assert result["distance of means"] < 1.5 * result["expected distance"]
        assert result["dimensions right"] == 1.0 or D == 75


def test_parameters_of_equals_table_5_1(online_valve: ModuleType):
    """211 for subspaces of 4, 3, 4 and 318 for 5, 5, 4, 3, in 14 columns."""
    assert online_valve.parameters_of(3, 1, 14, 4 + 3 + 4) == 211
    assert online_valve.parameters_of(4, 1, 14, 5 + 5 + 4 + 3) == 318


def test_valve_converted_batch_fit_generalises_and_stream_does_not(data_folder, online_valve: ModuleType):
    """On test demonstrations, compared with the batch fit."""
    demonstrations = pf.datasets.valve()
    train, test = demonstrations[:4], demonstrations[4:]
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


def test_cube_is_grasped_and_released_at_its_frames(online_tasks: ModuleType, rng):
    """The gripper closes within a millimetre of the cube, and opens above the bin."""
    for demonstration in online_tasks.simulate_cubes(rng):
        x, (cube, bin_) = demonstration.x, (frame.b[:3] for frame in demonstration.frames)
        closing, opening = np.flatnonzero(np.diff(x[:, 3]) < 0.0), np.flatnonzero(np.diff(x[:, 3]) > 0.0)
        above = bin_ + online_tasks.RELEASE_HEIGHT * online_tasks.UP
        for steps, place in ((closing, cube), (opening, above)):
            assert np.linalg.norm(x[steps, :3] - place, axis=1).max() < 0.004


@pytest.mark.slow  # learns 57 skills and streams: 26 CPU seconds
def test_streams_from_a_batch_are_within_twice_the_error(data_folder, online_tasks: ModuleType):
    """Figures of docs/online.md: least distances to cube and bin, and mean distance and end on the valve."""
    valve = pf.datasets.valve()
    splits = [([d for d in valve if d is not left_out], [left_out]) for left_out in valve]
    drawn = [online_tasks.simulate_cubes(np.random.default_rng(seed)) for seed in range(3)]
    cubes = [(each[:6], each[6:]) for each in drawn]
    for name, cases, states, measure in (
        ("valve", splits, (7, 10), online_tasks.measure_valve),
        ("cube", cubes, (10,), online_tasks.measure_cube),
    ):
        rows = {(r["states"], r["way"]): r for r in online_tasks.compare(name, cases, states, measure)}
        for count in states:
            batch, streamed = (np.array(rows[count, way]["distances"]) for way in ("batch", "from four"))
            assert (streamed <= 2.0 * batch + 0.1).all(), (name, count, batch, streamed)  # rounding of .1 mm


@pytest.mark.slow  # runs the whole script for one draw: 20 CPU seconds
def test_online_tasks_reaches_most_of_the_accuracy_from_nothing(data_folder, tmp_path):
    """Segments of exercises in the recorded order, from nothing, beside those of a batch fit."""
    run("online_tasks", "--json", tmp_path / "rows.json", "--seeds", 1, "--states", 7, "--orders", 1)
    rows = json.loads((tmp_path / "rows.json").read_text())
    exercises = [row for row in rows if "orders" in row]
    assert len(exercises) == 2
    assert all(row["stream"] >= 0.9 * row["batch"] for row in exercises)


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
def test_online_reproduction_writes_numbers_and_pictures(data_folder, tmp_path, name, options, count):
    report, pictures = tmp_path / "rows.json", tmp_path / "pictures"
    run(name, "--json", report, "--out", pictures, *options)
    assert json.loads(report.read_text())["rows"]
    assert len(list(pictures.glob("*.png"))) == count
    if name == "online_stages":
        assert (pictures / "growing.gif").stat().st_size < 5_000_000
        with Image.open(pictures / "growing.gif") as film:
            assert film.n_frames == 75
