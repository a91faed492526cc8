"""Scales and penalties estimated from data: independent of units, and robust to wild rows."""

from dataclasses import fields, replace

import numpy as np
import pytest

import pilotfish as pf
from pilotfish.demonstrations import Demonstration, Layout, Part, Quantity, position_layout
from pilotfish.errors import InvalidInput
from pilotfish.io.stream_file import decode_stream, encode_stream
from pilotfish.io.synthetic import synthetic_valve
from pilotfish.models import online
from pilotfish.models.online import SOSC, Maintenance, penalty_names

ROBOT = Layout(
    (
        Part("position", Quantity.POSITION, 3, "m"),
        Part("position", Quantity.POSITION, 3, "m/s", 1),
        Part("gripper", Quantity.SCALAR, 1, "1"),
    )
)


def stop_and_go(rng, rounds=6):
    """Return rows that pass four places in turn, with speeds and a gripper, and the place of each."""
    places = np.array([[0.3, 0.0, 0.2], [0.5, 0.1, 0.0], [0.4, -0.3, 0.1], [0.6, 0.3, 0.4]])
    states = np.repeat(np.tile(np.arange(4), rounds), 25)
    position = places[states] + 0.01 * rng.normal(size=(len(states), 3))
    speed = np.roll(places, 1, axis=0)[states] - places[states] + 0.05 * rng.normal(size=(len(states), 3))
    gripper = (states[:, None] >= 2) * 0.08 + 0.001 * rng.normal(size=(len(states), 1))
    return np.hstack([position, speed, gripper]), states


def estimate(x, layout=ROBOT, states=4, **options):
    recording = pf.demonstration(x, 0.02, layout)
    return online.estimate_settings([recording], states=states, rng=np.random.default_rng(0), **options)


def stream(settings, x, layout=ROBOT):
    return online.observe_stream(online.online_model(settings, layout, 0.02), x)


def purity(labels, states):
    """Return the share of rows that are in the most frequent place of their cluster."""
    return sum(np.bincount(states[labels == k]).max() for k in np.unique(labels)) / len(states)


def in_millimetres(demonstration: Demonstration) -> Demonstration:
    """Return a demonstration of poses and velocities with positions in millimetres."""
    factors = np.ones(demonstration.layout.width)
    for part, columns in zip(demonstration.layout.parts, demonstration.layout.slices, strict=True):
        if part.quantity is Quantity.POSITION:
            factors[columns] = 1000.0
    frames = tuple(
        replace(f, A=factors[:, None] * f.A / factors, b=factors * f.b) for f in demonstration.frames
    )
    return replace(demonstration, x=demonstration.x * factors, frames=frames)


def largest_change(one: SOSC, other: SOSC) -> float:
    """Return the largest relative change of a penalty or scale."""
    values = [[*(getattr(s, name) for name in penalty_names(s)), *(s.scales or ())] for s in (one, other)]
    return float(np.max(np.abs(np.divide(*values) - 1.0)))


@pytest.mark.parametrize("factor", [1000.0, 1.0 / 0.0254, 1e-6])
def test_stream_in_other_units_gives_same_clusters(rng, factor):
    """Metres and millimetres give the same assignments, penalties and, converted, the same means."""
    x, states = stop_and_go(rng)
    factors = np.array([factor] * 6 + [100.0])
    one, other = estimate(x[:150]), estimate(x[:150] * factors)
    for name in penalty_names(one):
        np.testing.assert_allclose(getattr(other, name), getattr(one, name), rtol=1e-9)
    model, assignments = stream(one, x)
    again, assignments_again = stream(other, x * factors)
    np.testing.assert_array_equal(assignments_again.cluster_ids, assignments.cluster_ids)
    np.testing.assert_array_equal(again.dimensions, model.dimensions)
    np.testing.assert_allclose(again.means, model.means * factors, rtol=1e-7, atol=1e-9 * factor)
    assert purity(assignments.current_cluster_ids(), states) > 0.95


def test_demonstrations_in_other_units_give_same_clusters(rng):
    """Also with frames, quaternions and derivatives."""
    found = []
    for demos in (synthetic_valve(rng)[:3], None):
        demos = [in_millimetres(d) for d in found[0][0]] if demos is None else demos
        settings = online.estimate_settings(demos, states=5, rng=np.random.default_rng(0))
        names = tuple(f.name for f in demos[0].frames)
        model, labels = online.online_model(settings, demos[0].layout, demos[0].period, names), []
        for demo in demos:
            model, assignments = online.observe_demonstration(model, demo)
            labels.append(assignments.cluster_ids)
        found.append((demos, model, np.concatenate(labels)))
    np.testing.assert_array_equal(found[1][2], found[0][2])
    np.testing.assert_array_equal(found[1][1].dimensions, found[0][1].dimensions)
    assert found[0][1].clusters > 1


def test_unscaled_stream_depends_on_units(rng):
    """The invariance is that of the scales: with the same penalties and no scales it is lost."""
    x, _ = stop_and_go(rng)
    settings = estimate(x, scales=False)
    assert stream(settings, x)[0].clusters != stream(settings, 1000.0 * x)[0].clusters


def test_scaled_stream_equals_stream_of_scaled_columns(rng):
    """The state is that of the scaled rows to the last bit; means and the skill are in the original units."""
    x, _ = stop_and_go(rng)
    settings = estimate(x[:150])
    scales = np.array(settings.scales)
    model, _ = stream(settings, x)
    scaled, _ = stream(replace(settings, scales=None), x / scales)
    assert model.state.rows.tobytes() == scaled.state.rows.tobytes()
    one_by_one = online.online_model(settings, ROBOT, 0.02)
    for row in x:
        one_by_one, *_ = online.observe(one_by_one, row)
    assert one_by_one.state.rows.tobytes() == model.state.rows.tobytes()
    np.testing.assert_allclose(online.to_skill(model).means, online.to_skill(scaled).means * scales)


def test_scaled_skill_covariances_equal_those_of_datapoints(rng):
    """Up to the regularisation; sigma^2 counts for the datapoints that a cluster lacks for 7 columns."""
    x, _ = stop_and_go(rng)
    settings = estimate(x[:150], maintenance=Maintenance(extra_directions=7, merge_distance=0.0))
    model, assignments = stream(settings, x)
    skill, scales = online.to_skill(model), np.array(settings.scales)
    for k, cluster_id in enumerate(model.cluster_ids):
        rows = x[assignments.cluster_ids == cluster_id]
        missing = max(8 - len(rows), 0)
        filled = missing / (len(rows) + missing) * settings.noise * scales**2
        relative = np.array([0.005, 0.005, 0.005, 0.2, 0.2, 0.2, 0.005])  # of the scale of the part
        added = (relative * scales) ** 2 * np.array([3, 3, 3, 3, 3, 3, 1])
        covariance = np.cov(rows.T, bias=True) + np.diag(filled + added)
        np.testing.assert_allclose(skill.covariances[0].dense[k], covariance, rtol=5e-3, atol=1e-6)


def test_saved_scaled_stream_continues_batch_by_batch(rng):
    """Saving and opening after each batch gives the model that was never saved, to the last bit."""
    x, _ = stop_and_go(rng)
    settings = replace(estimate(x[:150]), maintenance=Maintenance(batch=20))
    whole = saved = online.online_model(settings, ROBOT, 0.02)
    for part in np.array_split(x, len(x) // 40):
        whole, _ = online.observe_stream(whole, part)
        saved, _ = online.observe_stream(decode_stream(encode_stream(saved)), part)
    assert encode_stream(saved) == encode_stream(whole)
    assert saved.settings == settings


def test_estimate_scales_equal_deviation_of_each_part(rng):
    """Columns of a part share the root of their mean variance; a constant part has 1."""
    x = rng.normal(size=(500, 7)) * [1.0, 2.0, 3.0, 10.0, 10.0, 10.0, 0.0] + 5.0
    scales = online.estimate_scales([pf.demonstration(x, 0.02, ROBOT)])
    np.testing.assert_allclose(scales[:3], np.sqrt(x[:, :3].var(axis=0).mean()))
    np.testing.assert_allclose(scales[3:6], np.sqrt(x[:, 3:6].var(axis=0).mean()))
    assert scales[6] == 1.0
    drift = np.full((9, 1), 0.1) + np.arange(9)[:, None] * 1e-17  # rounding is no movement
    assert online.estimate_scales([pf.demonstration(drift, 0.02, position_layout(1))]) == (1.0,)


@pytest.mark.parametrize("size", [30.0, 1e6, 1e12])
@pytest.mark.parametrize("rows", [1, 6, 12])
def test_wild_rows_hardly_change_settings(rng, rows, size):
    """Two per cent of wild rows act as if they were missing, and that changes settings by a few per cent."""
    x, _ = stop_and_go(rng)
    wild = x.copy()
    places = rng.choice(len(x), rows, replace=False)
    wild[places] += size * rng.normal(size=(rows, x.shape[1]))
    found = estimate(wild)
    assert largest_change(found, estimate(np.delete(x, places, axis=0))) < 1e-9
    assert largest_change(found, estimate(x)) < 0.07


@pytest.mark.parametrize("size", [5.0, 1e4])
def test_wild_rows_hardly_change_penalties_of_skill(rng, size):
    """Also the scales; the skill is that of the clean recordings."""
    demos = synthetic_valve(rng)[:3]
    skill = pf.learn(demos, states=5, rng=np.random.default_rng(0)).skill
    wild = []
    for demo in demos:
        x = demo.x.copy()
        rows = rng.choice(len(x), 2, replace=False)
        for columns in demo.layout.slices[::2]:  # a wild quaternion is refused: it has not unit length
            x[rows, columns] += size * rng.normal(size=(2, columns.stop - columns.start))
        wild.append(replace(demo, x=x))
    clean, robust = (online.estimate_penalties(skill, some) for some in (demos, wild))
    assert largest_change(robust, clean) < 0.05


def test_estimate_settings_few_rows_give_a_model(rng):
    """A stream can start with few rows; states are as many as the rows support."""
    for rows in (2, 5, 11):
        x = rng.normal(size=(rows, 7))
        model, _ = stream(estimate(x, states=7), x)
        assert 1 <= model.clusters <= rows


def test_estimate_settings_constant_rows_are_refused():
    with pytest.raises(InvalidInput, match="all datapoints of every state are equal"):
        estimate(np.ones((50, 7)))


@pytest.mark.parametrize(
    ("scales", "words"),
    [
        ((1.0, 2.0), "scales has 2 numbers, expected 7"),
        ((1.0,) * 6 + (0.0,), r"scales\[6\] is 0.0"),
        ((1.0,) * 6 + (np.nan,), r"scales\[6\] is nan"),
    ],
)
def test_invalid_scales_are_refused(rng, scales, words):
    with pytest.raises(InvalidInput, match=words):
        estimate(stop_and_go(rng)[0], scales=scales)


def test_settings_with_scales_of_other_width_are_refused():
    settings = SOSC(1.0, 1.0, 1.0, 1.0, scales=(1.0, 2.0))
    assert "scales" in [f.name for f in fields(settings)]
    with pytest.raises(InvalidInput, match="settings have 2 scales, expected 7"):
        online.online_model(settings, ROBOT, 0.02)


def test_observe_scaled_value_too_large_names_limit(rng):
    model = online.online_model(SOSC(1.0, 1.0, 1.0, 1.0, scales=(1e-3,) * 3), position_layout(3), 0.02)
    with pytest.raises(InvalidInput, match=r"'position y'.* at most 1e\+100 times its scale 0.001"):
        online.observe(model, np.array([0.0, 1e99, 0.0]))
