"""Validation of the arguments of the kernel of assistance."""

from dataclasses import replace
from math import inf
from typing import Any

import numpy as np

from pilotfish.errors import InvalidInput
from pilotfish.kernels.assistance_types import (
    AUTONOMOUS,
    AssistanceInput,
    AssistanceMemory,
    AssistanceSettings,
    CarriedModel,
)
from pilotfish.kernels.hand_map import HandMap
from pilotfish.kernels.occupancy import OccupancyTables, StateFilter
from pilotfish.kernels.packing import MAX_NUMBER, pack_fields, require_real
from pilotfish.validation import require_count, short_repr

MIN_POSITIVE = float(np.finfo(np.float64).tiny)

MEMORY = (
    ("command", "D", "finite"),
    ("offset", "E", "finite"),
    ("pose", "D", "finite"),
    ("velocity", "E", "finite"),
    ("desired", "D", "finite"),
    ("held_values", "N", "any"),  # NaN for a scalar that does not hold
    ("held_commands", "N", "any"),
)
HAND_MAP = (
    ("matrix", "33", "finite"),
    ("shift", "3", "finite"),
    ("left", "4", "finite"),
    ("right", "4", "finite"),
)
MODEL = (
    ("observed_means", "KD", "finite"),
    ("whitening", "KEE", "finite"),
    ("actual_means", "KD", "finite"),
    ("offsets", "KE", "finite"),
    ("gains", "KEE", "finite"),
    ("fused_covariances", "KEE", "finite"),
)
TABLES = (("transitions", "KK", "finite"), ("hazards", "LK", "finite"))
FILTER = (("belief", "LK", "finite"), ("before", "K", "finite"), ("now", "K", "finite"))
SETTINGS = (("variances", "E", "finite"), ("lower", "3", "finite"), ("upper", "3", "finite"))
GIVEN = (("given_pose", "D", "finite"), ("given_covariance", "EE", "finite"))


def pack_assistance(
    hand_map: HandMap,
    model: CarriedModel,
    tables: OccupancyTables,
    settings: AssistanceSettings,
    memory: AssistanceMemory,
    given: AssistanceInput,
) -> tuple[HandMap, CarriedModel, OccupancyTables, AssistanceSettings, AssistanceMemory, AssistanceInput]:
    """Return the packed arguments of assistance_step.

    Hands may hold any numbers: bad ones are not followed.
    """
    sizes: dict[str, int] = {}
    packed_memory = pack_fields(memory, MEMORY, sizes)
    _require_pose(sizes["D"], sizes["E"], packed_memory.held_values.size)
    return (
        pack_fields(hand_map, HAND_MAP, sizes),
        pack_fields(model, MODEL, sizes),
        _with_numbers(pack_fields(tables, TABLES, sizes), reset=-MAX_NUMBER),
        _with_numbers(
            pack_fields(settings, SETTINGS, sizes),
            **dict.fromkeys(("full", "none", "speed", "acceleration"), -MAX_NUMBER),
            **dict.fromkeys(("angular_speed", "angular_acceleration"), -MAX_NUMBER),
            period=MIN_POSITIVE,
        ),
        replace(
            _with_numbers(
                packed_memory, authority=-MAX_NUMBER, blend_time=-MAX_NUMBER, blend_duration=-MAX_NUMBER
            ),
            filter=_pack_filter(memory.filter, sizes),
            is_following=_require_bool(memory.is_following, "is_following"),
            has_left=_require_bool(memory.has_left, "has_left"),
        ),
        _pack_input(given, sizes),
    )


def _require_pose(D: int, E: int, scalars: int) -> None:
    if D not in (E, E + 1) or D - (3 if D == E else 7) != scalars:
        raise InvalidInput(
            f"a pose of {D} columns with {E} of its tangent and {scalars} scalars, expected a position, "
            "then a unit quaternion if there is one more column than tangent columns, then the scalars"
        )


def _pack_filter(value: StateFilter, sizes: dict[str, int]) -> StateFilter:
    packed = pack_fields(value, FILTER, sizes)
    elapsed = require_real(value.elapsed, "elapsed")
    return packed if elapsed == inf else _with_numbers(packed, elapsed=0.0)


def _pack_input(given: AssistanceInput, sizes: dict[str, int]) -> AssistanceInput:
    with_hand = pack_fields(given, (("hand", "D", "any"),), sizes)
    mode = require_count(given.mode, "mode", AUTONOMOUS)
    if given.given_pose is not None and given.given_covariance is not None:
        with_hand = pack_fields(with_hand, GIVEN, sizes)
    elif given.given_pose is not None or given.given_covariance is not None or mode == AUTONOMOUS:
        raise InvalidInput("given_pose or given_covariance is None, expected both, or neither of them")
    packed: AssistanceInput = _with_numbers(with_hand, dt=MIN_POSITIVE)
    return replace(
        packed,
        mode=mode,
        is_closed=_require_bool(given.is_closed, "is_closed"),
        is_current=_require_bool(given.is_current, "is_current"),
        has_changed=_require_bool(given.has_changed, "has_changed"),
    )


def _with_numbers(value: Any, **lowest: float) -> Any:
    """Return a dataclass with some of its numbers as floats, each at least its lowest value."""
    numbers = {name: require_real(getattr(value, name), name) for name in lowest}
    for name, number in numbers.items():
        if not lowest[name] <= number <= MAX_NUMBER:
            raise InvalidInput(
                f"{name} is {number}, expected a number from {lowest[name]:g} to {MAX_NUMBER:g}"
            )
    return replace(value, **numbers)


def _require_bool(value: object, name: str) -> bool:
    if not isinstance(value, bool):
        raise InvalidInput(f"{name} is {short_repr(value)}, expected True or False")
    return value
