"""Synthetic valve demonstrations beside the recorded ones."""

from pathlib import Path

import numpy as np
import pytest

from pilotfish.demonstrations import diagnose, views
from pilotfish.geometry import angle
from pilotfish.io.published_matlab import read_valve_mat
from pilotfish.io.synthetic import synthetic_valve


def test_synthetic_valve_same_seed_gives_equal_demonstrations():
    one, same, other = (synthetic_valve(np.random.default_rng(seed)) for seed in (1, 1, 2))
    assert all(np.array_equal(a.x, b.x) for a, b in zip(one, same, strict=True))
    assert not np.array_equal(one[0].x, other[0].x)


def test_synthetic_valve_equals_recording_in_shape(rng: np.random.Generator, data_folder: Path):
    recorded = read_valve_mat(data_folder / "valve" / "BaxterValveDemos2.mat")
    made = synthetic_valve(rng)
    for a, b in zip(made, recorded, strict=True):
        assert a.layout == b.layout
        assert a.period == b.period
        assert a.x.shape == b.x.shape
        assert a.name == f"synthetic {b.name}"
        assert [given.name for given in a.frames] == [given.name for given in b.frames]
        for ours, theirs in zip(a.frames, b.frames, strict=True):
            assert np.abs(ours.b - theirs.b).max() < 0.06  # m
        assert np.abs(a.x[0] - b.x[0])[:3].max() < 0.25  # m


def test_synthetic_valve_varies_least_in_frame_of_handle(rng: np.random.Generator):
    """At the grasp it is the frame before, at the release the frame after."""
    local = views(synthetic_valve(rng)).x.reshape(2, 8, 200, 14)
    for j, rows in ((0, slice(66, 70)), (1, slice(130, 134))):
        assert np.abs(local[j, :, rows, :3]).max() < 0.03  # m, at the handle
        spread = local[:, :, rows].std(axis=1).mean(axis=(1, 2))
        assert spread[j] < 0.3 * spread[1 - j]


def test_synthetic_valve_is_smooth_without_warnings(rng: np.random.Generator):
    """The only diagnostic is the constant second frame."""
    made = synthetic_valve(rng)
    assert [(found.severity, found.location) for found in diagnose(made)] == [("note", "frame 'valve after'")]
    for demo in made:
        assert np.linalg.norm(demo.x[:, 7:10], axis=1).max() < 1.0  # m/s
        assert angle(demo.x[:-1, 3:7], demo.x[1:, 3:7]).max() / demo.period < 2.5  # rad/s


@pytest.mark.parametrize("degrees", ["180", "22.5"])
def test_synthetic_valve_frames_differ_by_angle_in_name(rng: np.random.Generator, degrees: str):
    demo = next(demo for demo in synthetic_valve(rng) if demo.name.endswith(f" {degrees} deg"))
    before, after = (given.A[:3, :3] for given in demo.frames)
    turned = np.degrees(np.arccos(np.clip((np.trace(before.T @ after) - 1) / 2, -1, 1)))
    assert abs(turned - float(degrees)) < 1e-5
