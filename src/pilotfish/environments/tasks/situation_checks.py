"""Checks of the values that situations of tasks hold: where things can stand that an arm is to work on."""

from pilotfish.errors import InvalidInput
from pilotfish.geometry import Pose, pose
from pilotfish.validation import require_type

MAX_DISTANCE = 3.0  # m from the torso, in each direction: beyond, no arm reaches
MAX_ANGLE = 100.0  # rad


def validate_object_pose(value: object, name: str, lowest: float) -> None:
    """Check that value is the pose of a thing near the robot.

    Args:
        value: The pose, seen from the torso.
        name: What stands there; the message begins with it.
        lowest: Smallest accepted height [m], as the thing stands on something.

    Raises:
        InvalidInput: If it is no pose, or stands too low or too far away.
    """
    require_type(value, name, Pose, "geometry.pose(position, quaternion) makes one")
    assert isinstance(value, Pose)
    try:
        place = pose(value.position, value.quaternion).position
    except InvalidInput as error:
        raise InvalidInput(f"{name}: {error}") from error
    if abs(place).max() > MAX_DISTANCE or place[2] < lowest:
        raise InvalidInput(
            f"{name} stands at {place.tolist()} m, expected at most {MAX_DISTANCE:g} m from the robot's torso in "
            f"each direction, and a height of {lowest:g} m or more"
        )
