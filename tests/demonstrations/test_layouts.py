"""Layouts: names, units and indices of columns."""

import pytest

from pilotfish.demonstrations import Layout, Part, Quantity, pose_layout, position_layout
from pilotfish.errors import InvalidInput

POSITION = Part("position", Quantity.POSITION, 2, "m")
JOINTS = Part("joints", Quantity.SCALAR, 7, "rad")


def test_layout_pose_with_derivatives_has_fourteen_columns():
    """Names, units and slices of the fourteen columns of a pose and its derivative."""
    layout = pose_layout().differentiate()
    assert layout.width == 14 == len(layout.names) == len(layout.units)
    assert layout.names[:5] == ("position x", "position y", "position z", "orientation w", "orientation x")
    assert layout.names[7:] == tuple(f"{name}'" for name in layout.names[:7])
    assert layout.units == ("m",) * 3 + ("1",) * 4 + ("m/s",) * 3 + ("1/s",) * 4
    assert layout.columns("orientation") == slice(3, 7)
    assert layout.columns("orientation", derivative=1) == slice(10, 14)
    assert layout.quaternions == (slice(3, 7),)


def test_slices_several_parts_are_contiguous():
    """The slices are contiguous and complete."""
    layout = Layout((JOINTS, POSITION, Part("grip", Quantity.SCALAR, 1, "m")))
    columns = [n for s in layout.slices for n in range(s.start, s.stop)]
    assert columns == list(range(layout.width))
    assert layout.names[6:] == ("joints 7", "position x", "position y", "grip")


def test_names_all_quantities_are_unique():
    """Column names are unique."""
    force = Part("force", Quantity.VECTOR, 3, "N")
    names = Layout((*pose_layout().parts, force, JOINTS)).differentiate().names
    assert len(set(names)) == len(names)


def test_layout_equal_parts_compare_equal():
    """Two layouts with equal parts are equal."""
    assert pose_layout() == pose_layout() != position_layout()


@pytest.mark.parametrize(
    ("name", "size", "quantity", "derivative", "message"),
    [
        ("q", 3, Quantity.QUATERNION, 0, "size 3, expected 4"),
        ("p", 0, Quantity.POSITION, 0, "size of part 'p' is 0, expected a whole number from 1 to 10000"),
        ("p", 3, Quantity.POSITION, -1, "derivative of part 'p' is -1"),
        ("", 3, Quantity.POSITION, 0, "name of a part is ''"),
        (" p", 3, Quantity.POSITION, 0, "without blanks at its ends"),
        ("a\nb", 3, Quantity.POSITION, 0, "one line"),
        ("n" * 201, 3, Quantity.POSITION, 0, "has 201 characters, expected at most 200"),
        ("p", 3, Quantity.POSITION, 10, "derivative of part 'p' is 10, expected a whole number from 0 to 9"),
        ("p", 10**19, Quantity.SCALAR, 0, "size of part 'p' is 10{19}, expected a whole number from 1"),
    ],
)
def test_part_unusable_field_is_refused(
    name: str, size: int, quantity: Quantity, derivative: int, message: str
):
    """A part has a name on one line and columns, four if it is a quaternion."""
    with pytest.raises(InvalidInput, match=message):
        Part(name, quantity, size, "1", derivative)


def test_layout_unusable_parts_are_refused():
    """Repeated parts, no parts and a second differentiation are refused."""
    with pytest.raises(InvalidInput, match="more than once"):
        Layout((POSITION, POSITION))
    with pytest.raises(InvalidInput, match="no parts"):
        Layout(())
    with pytest.raises(InvalidInput, match="derivative of 'position' already"):
        pose_layout().differentiate().differentiate()


def test_columns_unknown_part_names_nearest():
    """The message lists the parts and the nearest name."""
    with pytest.raises(InvalidInput, match="did you mean 'orientation'"):
        pose_layout().columns("orientatoin")
    with pytest.raises(InvalidInput, match=r"'position' \(derivative 0\)"):
        pose_layout().columns("position", derivative=1)


def test_orientations_two_on_sphere_gives_columns_of_points_and_deviations():
    """The second orientation has no angular velocity; both are shifted by one column per orientation."""
    tool, wrist = (Part(name, Quantity.ORIENTATION, 4, "1") for name in ("tool", "wrist"))
    layout = Layout((POSITION, tool, wrist, Part("tool", Quantity.SCALAR, 3, "rad/s", derivative=1)))
    first, second = layout.orientations
    assert (first.quaternion, first.rotation_vector) == (slice(2, 6), slice(2, 5))
    assert (first.angular_velocity, first.rotation_rate) == (slice(10, 13), slice(8, 11))
    assert (second.quaternion, second.rotation_vector) == (slice(6, 10), slice(5, 8))
    assert (second.angular_velocity, second.rotation_rate) == (None, None)
    assert layout.orientation_starts == (2, 6)


def test_unit_quaternions_either_representation_leave_out_derivatives():
    """Four numbers in R^4 and points of S^3 both count; `quaternions` has the former only."""
    layout = pose_layout().differentiate()
    sphere = Layout((*layout.parts, Part("tool", Quantity.ORIENTATION, 4, "1")))
    assert sphere.unit_quaternions == (slice(3, 7), slice(14, 18))
    assert sphere.quaternions == (slice(3, 7),)
    assert sphere.coordinates == (*range(7), *range(14, 18))


def test_rate_column_is_that_of_the_derivative_of_the_same_axis():
    """Position, force and gripper, then their rates."""
    parts = (
        Part("position", Quantity.POSITION, 3, "m"),
        Part("force", Quantity.VECTOR, 2, "N"),
        Part("gripper", Quantity.SCALAR, 1, "1"),
    )
    layout = Layout(parts).differentiate()
    assert [layout.rate_column(column) for column in range(6)] == [6, 7, 8, 9, 10, 11]
    assert layout.rate_column(6) is None
    assert Layout(parts).rate_column(5) is None
    with pytest.raises(InvalidInput, match="column is 12"):
        layout.rate_column(12)
