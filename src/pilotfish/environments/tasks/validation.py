"""Checks of the poses of objects in a situation."""

from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, pose
from pilotfish.validation import require_type

MAX_DISTANCE = 3.0  # m from the torso along each axis, beyond the reach of the arm
MAX_ANGLE = 100.0  # rad


def validate_object_pose(value: object, name: str, min_height: float) -> None:
    """Check that a value is the pose of an object near the robot.

    Args:
        value: Pose in torso axes.
        name: Name of the object; the message begins with it.
        min_height: Smallest height [m], because the object needs a support.

    Raises:
        InvalidInput: If it is not a pose, or is too low or too far away.
    """
    require_type(value, name, Pose, "geometry.pose(position, quaternion) creates one")
    assert isinstance(value, Pose)
    try:
        position = pose(value.position, value.quaternion).position
    except InvalidInput as error:
        raise InvalidInput(f"{name}: {error}") from error
    if abs(position).max() > MAX_DISTANCE or position[2] < min_height:
        raise InvalidInput(
            f"{name} is at {position.tolist()} m, expected at most {MAX_DISTANCE:g} m from the torso along "
            f"each axis and a height of at least {min_height:g} m"
        )
