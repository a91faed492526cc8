"""Columns that switch, and the steps at which all demonstrations do."""

import numpy as np
import pytest

from pilotfish.demonstrations import (
    Demonstration,
    Layout,
    Part,
    Quantity,
    common_switches,
    demonstration,
    switching_columns,
)

LAYOUT = Layout((Part("position", Quantity.POSITION, 1, "m"), Part("tool", Quantity.SCALAR, 2, "1")))


def make_demonstration(first: str, second: str) -> Demonstration:
    """Return a demonstration with two columns that are high where a word has a 1."""
    tools = np.array([[2.0 * int(a) - 1.0, 5.0 * int(b)] for a, b in zip(first, second, strict=True)])
    return demonstration(np.column_stack([np.arange(float(len(tools))), tools]), 0.1, LAYOUT, (), "one")


def test_common_switches_equal_order_gives_steps_of_each():
    demos = [make_demonstration("001111110", "000001111"), make_demonstration("01111000", "00011111")]
    assert switching_columns(np.concatenate([d.x for d in demos]), LAYOUT) == ("tool 1", "tool 2")
    assert common_switches(demos, ["tool 1", "tool 2"]) == ((2, 5, 8), (1, 3, 5))
    assert common_switches(demos, ["tool 2"]) == ((5,), (3,))


def test_common_switches_at_one_step_are_one_event():
    demos = [make_demonstration("0011", "0011"), make_demonstration("01111", "01111")]
    assert common_switches(demos, ["tool 1", "tool 2"]) == ((2,), (1,))


@pytest.mark.parametrize(
    ("first", "second"),
    [("0000", "0000"), ("1100", "0000"), ("0101", "0000"), ("0000", "0011"), ("0011", "1111")],
    ids=["no switch", "other direction", "twice more", "other column", "other column differs"],
)
def test_common_switches_another_order_gives_none(first, second):
    demos = [make_demonstration("0011", "0000"), make_demonstration(first, second)]
    assert common_switches(demos, ["tool 1", "tool 2"]) == ()


def test_common_switches_without_columns_gives_none():
    assert common_switches([make_demonstration("0011", "0000")], []) == ()
