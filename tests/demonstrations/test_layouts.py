"""Layouts name and locate columns."""

import pytest

from pilotfish.demonstrations import Layout, Part, Quantity, pose_layout, position_layout
from pilotfish.errors import InvalidInput

POSITION = Part("position", Quantity.POSITION, 2, "m")
JOINTS = Part("joints", Quantity.SCALAR, 7, "rad")


def test_columns_of_a_pose_with_derivatives():
    """Names, units and places of the fourteen columns of a pose and its rate."""
    layout = pose_layout().differentiate()
    assert layout.width == 14 == len(layout.names) == len(layout.units)
    assert layout.names[:5] == ("position x", "position y", "position z", "orientation w", "orientation x")
    assert layout.names[7:] == tuple(f"{name}'" for name in layout.names[:7])
    assert layout.units == ("m",) * 3 + ("1",) * 4 + ("m/s",) * 3 + ("1/s",) * 4
    assert layout.columns("orientation") == slice(3, 7)
    assert layout.columns("orientation", derivative=1) == slice(10, 14)
    assert layout.quaternions == (slice(3, 7),)


def test_slices_cut_a_row_into_its_parts():
    """The slices follow one another and leave nothing out."""
    layout = Layout((JOINTS, POSITION, Part("grip", Quantity.SCALAR, 1, "m")))
    columns = [n for piece in layout.slices for n in range(piece.start, piece.stop)]
    assert columns == list(range(layout.width))
    assert layout.names[6:] == ("joints 7", "position x", "position y", "grip")


def test_no_two_columns_share_a_name():
    """Every column of a layout with all quantities is told from the others by name."""
    force = Part("force", Quantity.VECTOR, 3, "N")
    names = Layout((*pose_layout().parts, force, JOINTS)).differentiate().names
    assert len(set(names)) == len(names)


def test_layouts_are_values():
    """Two layouts with equal parts are equal."""
    assert pose_layout() == pose_layout() != position_layout()


@pytest.mark.parametrize(
    ("name", "size", "quantity", "derivative", "message"),
    [
        ("q", 3, Quantity.QUATERNION, 0, "size 3, expected 4"),
        ("p", 0, Quantity.POSITION, 0, "size of part 'p' is 0, expected a whole number from 1 to 10000"),
        ("p", 3, Quantity.POSITION, -1, "derivative of part 'p' is -1"),
        ("", 3, Quantity.POSITION, 0, "name of a part is ''"),
        (" p", 3, Quantity.POSITION, 0, "blank ends"),
        ("a\nb", 3, Quantity.POSITION, 0, "one line"),
        ("n" * 201, 3, Quantity.POSITION, 0, "has 201 characters, expected at most 200"),
        ("p", 3, Quantity.POSITION, 10, "derivative of part 'p' is 10, expected a whole number from 0 to 9"),
        ("p", 10**19, Quantity.SCALAR, 0, "size of part 'p' is 10{19}, expected a whole number from 1"),
    ],
)
def test_parts_that_cannot_be_are_refused(
    name: str, size: int, quantity: Quantity, derivative: int, message: str
):
    """A part is named on one line, has columns, and four of them when it is a quaternion."""
    with pytest.raises(InvalidInput, match=message):
        Part(name, quantity, size, "1", derivative)


def test_layouts_that_cannot_be_are_refused():
    """No part twice, not no parts, no second differentiation."""
    with pytest.raises(InvalidInput, match="more than once"):
        Layout((POSITION, POSITION))
    with pytest.raises(InvalidInput, match="no parts"):
        Layout(())
    with pytest.raises(InvalidInput, match="derivative of 'position' already"):
        pose_layout().differentiate().differentiate()


def test_an_unknown_part_is_met_with_the_nearest():
    """The message lists what there is and guesses what was meant."""
    with pytest.raises(InvalidInput, match="did you mean 'orientation'"):
        pose_layout().columns("orientatoin")
    with pytest.raises(InvalidInput, match=r"'position' \(derivative 0\)"):
        pose_layout().columns("position", derivative=1)
