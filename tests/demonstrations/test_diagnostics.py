"""Diagnostics: each anomaly is found at its location, and a good set has none."""

from dataclasses import replace

import numpy as np
import pytest

from pilotfish.demonstrations import (
    Demonstration,
    Layout,
    Part,
    Quantity,
    add_derivatives,
    demonstration,
    diagnose,
    position_layout,
    resample,
)


def smooth(rng: np.random.Generator, steps: int = 30, name: str = "") -> Demonstration:
    t = np.linspace(0, 1, steps)[:, None]
    x = np.sin(2 * t + rng.uniform(0, 1, size=3)) + rng.normal(scale=0.1, size=3)
    return demonstration(x, 0.1, position_layout(), name=name)


def with_x(demo: Demonstration, x: np.ndarray) -> Demonstration:
    return demonstration(x, demo.period, demo.layout, demo.frames, demo.name)


@pytest.fixture
def good(rng: np.random.Generator) -> list[Demonstration]:
    return [smooth(rng, steps, name) for steps, name in [(30, "a"), (25, "b"), (40, "c")]]


def test_diagnose_good_set_is_empty(good: list[Demonstration]):
    """Similar lengths, the world frame alone and smooth movements give no diagnostic."""
    assert diagnose(good) == ()
    assert diagnose([add_derivatives(demo) for demo in good]) == ()


def require_only(found: tuple, severity: str, location: str, message: str) -> None:
    assert len(found) == 1, found
    assert found[0].severity == severity
    assert location in found[0].location
    assert message in found[0].message


def test_diagnose_copy_is_found(good: list[Demonstration]):
    """Both demonstrations are named."""
    found = diagnose([*good, replace(good[1], name="d")])
    require_only(found, "warning", "demonstration 3 (d)", "same rows as demonstration 1 (b)")


def test_diagnose_constant_column_is_found(good: list[Demonstration]):
    """The column is named."""
    x = good[0].x.copy()
    x[:, 1] = 0.3
    require_only(diagnose([with_x(good[0], x), *good[1:]]), "note", "demonstration 0 (a)", "'position y'")


def test_diagnose_much_longer_demonstration_is_found(good: list[Demonstration]):
    """Both durations are given."""
    long = resample(good[0], 100)
    long = demonstration(long.x, 0.1, long.layout, name="long")
    require_only(
        diagnose([*good, long]),
        "warning",
        "demonstration 3 (long)",
        "lasts 10 s, demonstration 1 (b) 2.5 s",
    )


def test_diagnose_missing_rows_are_found(good: list[Demonstration]):
    """A gap of a third of the movement gives one jump, at the row after it."""
    x = np.delete(good[2].x, np.s_[10:25], axis=0)
    require_only(diagnose([*good[:2], with_x(good[2], x)]), "warning", "(c)", "position jumps at row 10")


def test_diagnose_repeated_rows_are_found(good: list[Demonstration]):
    """A sensor repeats its last value and then jumps."""
    x = good[2].x.copy()
    x[10:20] = x[10]
    require_only(diagnose([*good[:2], with_x(good[2], x)]), "warning", "(c)", "position jumps at row 20")


@pytest.mark.parametrize("moving", [False, True])
def test_diagnose_constant_frame_is_found(make, moving: bool):
    """A frame that differs anywhere gives no diagnostic."""
    a, b = make(moving=moving), make(moving=moving)
    b = replace(b, frames=(a.frames[0], b.frames[1]))
    notes = [found for found in diagnose([a, b]) if found.location.startswith("frame")]
    require_only(tuple(notes), "note", "frame 'cup'", "the same in every demonstration")
    assert not [found for found in diagnose([a]) if found.location.startswith("frame")]


def test_diagnose_incompatible_demonstrations_is_error(make, good: list[Demonstration]):
    """Incompatible demonstrations are reported, not raised."""
    found = diagnose([*good, make(name="pose")])
    errors = [finding for finding in found if finding.severity == "error"]
    require_only(tuple(errors), "error", "demonstration 3 (pose)", "differ in layout")
    require_only(diagnose([]), "error", "the set", "no demonstrations")


@pytest.mark.parametrize("levels", [(0.0, 1.0), (-1.0, 1.0), (0.0, 100.0)])
def test_diagnose_column_of_two_values_is_no_jump(rng: np.random.Generator, levels: tuple[float, float]):
    """A gripper switches; the position beside it is still checked."""
    grip = Part("grip", Quantity.SCALAR, 1, "1")
    layout = Layout((*position_layout().parts, grip))
    demonstrations = []
    for steps in (30, 34, 40):
        closed = np.where(np.arange(steps) > steps // 2, levels[1], levels[0])[:, None]
        x = np.hstack([smooth(rng, steps).x, closed])
        demonstrations.append(demonstration(x, 0.1, layout))
    assert diagnose(demonstrations) == ()
    x = demonstrations[0].x.copy()
    x[20:, 0] += 1.0
    found = diagnose([demonstration(x, 0.1, layout), *demonstrations[1:]])
    require_only(found, "warning", "demonstration 0", "position jumps at row 20")
