"""Settings of the robot's site as JSON, for the replay of a recorded session; functions are left out."""

import json
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from pilotfish.assistance import AssistedSkill, Limits
from pilotfish.demonstrations import Layout, Part, Quantity
from pilotfish.errors import InvalidInput, UnreadableFile
from pilotfish.teleop.controlled_stop import Braking
from pilotfish.teleop.delay_contract import ContractLimits
from pilotfish.teleop.robot_values import Alignment, RobotSettings
from pilotfish.validation import short_list

PARTS = {"contract": ContractLimits, "limits": Limits, "braking": Braking, "alignment": Alignment}


def encode_robot_settings(settings: RobotSettings) -> str:
    """Return the settings of a robot's site as JSON, without the function that decodes skills.

    Args:
        settings: Settings.
    """
    values = {
        each.name: _to_json(getattr(settings, each.name))
        for each in fields(RobotSettings)
        if each.name != "decode_skill"
    }
    values["layout"] = [_to_json(part) for part in settings.layout.parts]
    return json.dumps(values, sort_keys=True, separators=(",", ":"), allow_nan=False)


def decode_robot_settings(text: str, decode_skill: Callable[[bytes], AssistedSkill]) -> RobotSettings:
    """Return the settings in JSON.

    Args:
        text: Text from `encode_robot_settings`.
        decode_skill: Function from the bytes of a skill to the prepared skill.

    Raises:
        UnreadableFile: If a setting is unknown, missing, or has a value that is not allowed.
    """
    try:
        values = json.loads(text)
        _require_names(RobotSettings, values, "settings", {"decode_skill"})
        for name, kind in PARTS.items():
            _require_names(kind, values[name], name, set())
            values[name] = kind(**values[name])
        parts = values.pop("layout")
        for part in parts:
            _require_names(Part, part, "layout", set())
            part["quantity"] = Quantity(part["quantity"])
        layout = Layout(tuple(Part(**part) for part in parts))
        for name in ("operators", "observers"):
            values[name] = tuple(values[name])
        return RobotSettings(decode_skill, layout, **values)
    except (InvalidInput, ValueError, TypeError, AttributeError) as error:
        raise UnreadableFile(f"the settings of the recorded robot cannot be used: {error}") from error


def _to_json(value: Any) -> Any:
    if is_dataclass(value):
        return {each.name: _to_json(getattr(value, each.name)) for each in fields(value)}
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, np.ndarray):
        return value.tolist()
    return value.value if isinstance(value, Quantity) else value


def _require_names(kind: type, values: Any, place: str, omitted: set[str]) -> None:
    """Refuse settings that another version has, by their names."""
    expected = {each.name for each in fields(kind)} - omitted
    if not isinstance(values, dict):
        raise UnreadableFile(f"{place} of the recorded robot: expected a JSON object with names and values")
    if other := sorted(expected ^ set(values)):
        verb = "has" if other[0] in values else "lacks"
        raise UnreadableFile(
            f"the recording {verb} {short_list(other)} in {place}, which this version of pilotfish reads "
            "differently; replay it with the version that recorded it"
        )
