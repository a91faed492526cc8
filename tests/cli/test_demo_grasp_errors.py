"""Errors at grasp and release: exact on demonstrations, and the baseline meets both ends."""

from dataclasses import replace

import numpy as np
import pytest

from pilotfish.cli.demo.evaluation_tables import StructureEvaluation
from pilotfish.cli.demo.grasp_errors import (
    demonstrated_spread,
    error_at,
    event_step,
    grasp_error_table,
    learned_deviation,
    mean_with_offsets,
)
from pilotfish.cli.demo.run import evaluate_structure
from pilotfish.demonstrations import Demonstration
from pilotfish.gaussians.structures import Full
from pilotfish.geometry import angle, from_rotation_vector, multiply
from pilotfish.io import synthetic_valve

POSITION, ORIENTATION = slice(0, 3), slice(3, 7)


@pytest.fixture(scope="module")
def demonstrations() -> tuple[Demonstration, ...]:
    return synthetic_valve(np.random.default_rng(0))


@pytest.fixture(scope="module")
def evaluation(demonstrations: tuple[Demonstration, ...]) -> StructureEvaluation:
    return evaluate_structure(demonstrations, Full(), np.random.default_rng(0), lambda _: None)


def test_demonstration_has_no_error_at_its_events(demonstrations: tuple[Demonstration, ...]):
    for demo in demonstrations:
        assert event_step(demo, 0) < event_step(demo, 1)
        for frame in (0, 1):
            assert error_at(demo.x, demo, frame) == pytest.approx((0.0, 0.0), abs=1e-6)


def test_error_is_that_of_a_displaced_motion(demonstrations: tuple[Demonstration, ...]):
    """A motion that is raised and rotated where it stays nearest has exactly this error."""
    demo = demonstrations[5]
    step, x = event_step(demo, 0), demo.x.copy()
    x[:, POSITION] = x[step, POSITION] + np.array([0.0, 0.0, 0.012])
    x[:, ORIENTATION] = multiply(x[step, ORIENTATION], from_rotation_vector(np.array([0.0, 0.1, 0.0])))
    assert error_at(x, demo, 0) == pytest.approx((0.012, 0.1))


def test_spread_vanishes_for_equal_demonstrations(demonstrations: tuple[Demonstration, ...]):
    assert demonstrated_spread([demonstrations[0]] * 3, 1) == pytest.approx((0.0, 0.0), abs=1e-6)
    turned = demonstrations[0].x.copy()
    turned[:, ORIENTATION] = multiply(
        turned[:, ORIENTATION], from_rotation_vector(np.array([0.0, 0.0, 0.02]))
    )
    pair = [demonstrations[0], replace(demonstrations[0], x=turned)]
    assert demonstrated_spread(pair, 0) == pytest.approx((0.0, 0.01), abs=1e-6)  # 0.01 rad from the mean


def test_learned_deviation_is_that_of_the_nearest_state(evaluation: StructureEvaluation):
    skill = evaluation.fit.skill
    deviations = [
        float(np.sqrt(np.trace(covariance[POSITION, POSITION]))) for covariance in skill.covariances[0].dense
    ]
    position, _ = learned_deviation(skill, evaluation.demonstrations[:4], 0)
    assert position == pytest.approx(min(deviations))  # the grasp is the most precise state in this frame


def test_mean_with_offsets_meets_start_and_end(demonstrations: tuple[Demonstration, ...]):
    x = mean_with_offsets(demonstrations[:4], demonstrations[5])
    np.testing.assert_allclose(x[[0, -1]], demonstrations[5].x[[0, -1]], atol=1e-12)
    opposite = demonstrations[0].x.copy()
    opposite[:, ORIENTATION] *= -1.0
    flipped = replace(demonstrations[0], x=opposite)
    same = mean_with_offsets([flipped, *demonstrations[1:4]], demonstrations[5])
    np.testing.assert_allclose(same[:, :7], x[:, :7], atol=1e-12)


def test_grasp_error_table_compares_with_baseline(evaluation: StructureEvaluation):
    rows = grasp_error_table(evaluation).rows
    assert [row[0] for row in rows] == ["grasp"] * 4 + ["release"] * 4
    motions = [r.motion.x for r in evaluation.from_first_point[4:]]
    errors = [error_at(x, d, 0) for x, d in zip(motions, evaluation.demonstrations[4:], strict=True)]
    assert rows[0][2] == f"{1000 * np.mean([distance for distance, _ in errors]):.0f}"
    assert float(rows[0][2]) < float(rows[3][2])
    step = event_step(evaluation.demonstrations[4], 0)
    nearest = np.linalg.norm(motions[0][:, POSITION] - evaluation.demonstrations[4].x[step, POSITION], axis=1)
    assert errors[0][0] == nearest.min()
    assert errors[0][1] == angle(
        motions[0][nearest.argmin(), ORIENTATION], evaluation.demonstrations[4].x[step, ORIENTATION]
    )
