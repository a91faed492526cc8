"""Each oddity is found where it was put, and a good set has none."""

from dataclasses import replace

import numpy as np
import pytest

from pilotfish.demonstrations import (
    Demonstration,
    Severity,
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


def test_a_good_set_has_no_findings(good: list[Demonstration]):
    """Different lengths within reason, the world's frame alone, smooth movements: nothing to say."""
    assert diagnose(good) == ()
    assert diagnose([add_derivatives(demo) for demo in good]) == ()


def only(found: tuple, severity: Severity, place: str, message: str) -> None:
    assert len(found) == 1, found
    assert found[0].severity is severity
    assert place in found[0].place
    assert message in found[0].message


def test_a_copy_is_found(good: list[Demonstration]):
    """Both places are named."""
    found = diagnose([*good, replace(good[1], name="d")])
    only(found, Severity.WARNING, "demonstration 3 (d)", "same rows as demonstration 1 (b)")


def test_a_column_that_never_changes_is_found(good: list[Demonstration]):
    """By its name."""
    x = good[0].x.copy()
    x[:, 1] = 0.3
    only(diagnose([with_x(good[0], x), *good[1:]]), Severity.NOTE, "demonstration 0 (a)", "'position y'")


def test_one_that_lasts_much_longer_is_found(good: list[Demonstration]):
    """With both durations."""
    long = resample(good[0], 100)
    long = demonstration(long.x, 0.1, long.layout, name="long")
    only(
        diagnose([*good, long]),
        Severity.WARNING,
        "demonstration 3 (long)",
        "lasts 10 s, demonstration 1 (b) 2.5 s",
    )


def test_missing_rows_are_found(good: list[Demonstration]):
    """A gap of a third of the movement shows as one jump, at the row after it."""
    x = np.delete(good[2].x, np.s_[10:25], axis=0)
    only(diagnose([*good[:2], with_x(good[2], x)]), Severity.WARNING, "(c)", "position jumps at row 10")


def test_held_rows_are_found(good: list[Demonstration]):
    """A sensor that repeats its last value and then catches up."""
    x = good[2].x.copy()
    x[10:20] = x[10]
    only(diagnose([*good[:2], with_x(good[2], x)]), Severity.WARNING, "(c)", "position jumps at row 20")


@pytest.mark.parametrize("moving", [False, True])
def test_a_frame_that_never_differs_is_found(make, moving: bool):
    """One that differs anywhere is not."""
    a, b = make(moving=moving), make(moving=moving)
    b = replace(b, frames=(a.frames[0], b.frames[1]))
    notes = [found for found in diagnose([a, b]) if found.place.startswith("frame")]
    only(tuple(notes), Severity.NOTE, "frame 'cup'", "the same in every demonstration")
    assert not [found for found in diagnose([a]) if found.place.startswith("frame")]


def test_what_cannot_be_learned_together_is_an_error(make, good: list[Demonstration]):
    """Disagreement is reported, not raised."""
    found = diagnose([*good, make(name="pose")])
    errors = [finding for finding in found if finding.severity is Severity.ERROR]
    only(tuple(errors), Severity.ERROR, "demonstration 3 (pose)", "differ in layout")
    only(diagnose([]), Severity.ERROR, "the set", "no demonstrations")
