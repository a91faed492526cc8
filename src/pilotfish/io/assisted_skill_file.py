"""Bytes of a skill prepared for assistance: the skill, its gate and its virtual fixture.

Both sites of a teleoperation session decode the same bytes, whose SHA-256 names them. They are one line of
JSON, then the bytes of the skill's file, then those of the skill of the fixture, if there is one.
"""

import json
from dataclasses import replace
from typing import Any

import numpy as np

from pilotfish.assistance import (
    AssistedSkill,
    Gate,
    PhaseSwitch,
    VirtualFixture,
    assisted_skill,
    virtual_fixture,
)
from pilotfish.errors import InvalidInput, SkillError, UnreadableFile
from pilotfish.io.container_format import canonical_json
from pilotfish.io.skill_fields import decode_layout, encode_layout
from pilotfish.io.skill_file import decode_skill, encode_skill
from pilotfish.models import Skill
from pilotfish.validation import require_type, short_repr

FORMAT, VERSION = "pilotfish-assisted-skill", 1
MAX_HEADER = 2**16  # bytes
UNIT_RATE = 1.0  # fixtures are rebuilt for a duration of 1 s, then their rates are restored


def encode_assisted_skill(
    skill: Skill, *, gate: Gate | None = None, fixture: VirtualFixture | None = None
) -> bytes:
    """Return the bytes of a skill prepared for assistance; equal values give equal bytes.

    Args:
        skill: Learned skill.
        gate: Where assistance has authority; None takes `Gate()`.
        fixture: Virtual fixture of the same demonstrations; None for none.

    Raises:
        InvalidInput: If the skill cannot be saved.
        NotPositiveDefinite: If a covariance is not positive definite.
    """
    require_type(skill, "skill", Skill, "a fit holds one: fit.skill")
    require_type(gate, "gate", (Gate, type(None)), "Gate() or calibrate_gate(...) makes one")
    require_type(fixture, "fixture", (VirtualFixture, type(None)), "learn_virtual_fixture makes one")
    limits, data = gate or Gate(), encode_skill(skill)
    path = encode_skill(fixture.skill) if fixture else b""
    header = {
        "format": FORMAT,
        "version": VERSION,
        "gate": [float(limits.full), float(limits.none)],
        "skill": len(data),
        "fixture": _encode_fixture(fixture) if fixture else None,
    }
    return canonical_json(header).encode() + b"\n" + data + path


def decode_assisted_skill(data: bytes) -> AssistedSkill:
    """Return the prepared skill in some bytes.

    Args:
        data: Bytes from `encode_assisted_skill`.

    Raises:
        UnreadableFile: If the bytes are damaged, of another kind or of another version.
    """
    require_type(data, "data", bytes, "pass the bytes from encode_assisted_skill")
    line, separator, rest = data.partition(b"\n")
    if not separator or len(line) > MAX_HEADER:
        raise UnreadableFile("the data is not a skill prepared for assistance: it has no header")
    try:
        header = json.loads(line)
        _validate_header(header, len(rest))
        size = header["skill"]
        gate, skill = Gate(*header["gate"]), decode_skill(rest[:size])
        fixture = _decode_fixture(header["fixture"], rest[size:])
        return assisted_skill(skill, gate=gate, fixture=fixture)
    except UnreadableFile:
        raise
    except (SkillError, ValueError, TypeError, KeyError, RecursionError) as error:
        raise UnreadableFile(f"the skill prepared for assistance cannot be used: {error}") from error


def _validate_header(header: Any, remaining: int) -> None:
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        raise UnreadableFile("the data is not a skill prepared for assistance")
    if header.get("version") != VERSION:
        raise UnreadableFile(
            f"the skill prepared for assistance has version {header.get('version')}, expected {VERSION}; "
            "install one release on both sites"
        )
    size = header.get("skill")
    if type(size) is not int or not 0 < size <= remaining:
        raise UnreadableFile(f"the skill has {size} bytes, expected at most {remaining}; send it again")


def _encode_fixture(fixture: VirtualFixture) -> dict[str, Any]:
    return {
        "layout": encode_layout(fixture.recorded_layout),
        "damping": fixture.damping.tolist(),
        "stiffness": fixture.stiffness.tolist(),
        "max_rate": float(fixture.max_rate),
        "min_speed": float(fixture.min_speed),
        "look_ahead": float(fixture.look_ahead),
        "switches": [
            [int(each.column), each.phases.tolist(), each.values.tolist()] for each in fixture.switches
        ],
    }


def _decode_fixture(fields: dict[str, Any] | None, data: bytes) -> VirtualFixture | None:
    if fields is None:
        if data:
            raise InvalidInput(f"{len(data)} bytes follow the skill, expected none")
        return None
    switches = [
        PhaseSwitch(column, np.array(phases, dtype=float), np.array(values, dtype=float))
        for column, phases, values in fields["switches"]
    ]
    fixture = virtual_fixture(
        decode_skill(data), UNIT_RATE, recorded_layout=decode_layout(fields["layout"]), switches=switches
    )
    damping, stiffness = (np.array(fields[name], dtype=float) for name in ("damping", "stiffness"))
    numbers = np.array([fields[name] for name in ("max_rate", "min_speed", "look_ahead")], dtype=float)
    for name, values, expected in (
        ("damping", damping, fixture.damping.shape),
        ("stiffness", stiffness, fixture.stiffness.shape),
        ("a rate or length", numbers, (3,)),
    ):
        if values.shape != expected or not np.isfinite(values).all() or (values < 0.0).any():
            raise InvalidInput(
                f"{name} of the fixture is {short_repr(values.tolist())}, expected {expected[0]} numbers of "
                "at least 0"
            )
    max_rate, min_speed, look_ahead = map(float, numbers)
    return replace(
        fixture,
        damping=damping,
        stiffness=stiffness,
        max_rate=max_rate,
        min_speed=min_speed,
        look_ahead=look_ahead,
    )
