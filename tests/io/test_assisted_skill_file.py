"""Bytes of a skill prepared for assistance: equal at both sites, and refused by name when damaged."""

import numpy as np
import pytest
from teleop_sites import demonstrations

import pilotfish as pf
from pilotfish.assistance import Gate, assisted_skill, learn_virtual_fixture
from pilotfish.errors import UnreadableFile
from pilotfish.io import decode_assisted_skill, encode_assisted_skill


@pytest.fixture(scope="module")
def parts():
    training = list(demonstrations()[:4])
    skill = pf.learn(training, states=4, rng=np.random.default_rng(0)).skill
    return skill, Gate(1.5, 3.25), learn_virtual_fixture(training, rng=np.random.default_rng(0))


def test_decode_encoded_skill_gives_gate_fixture_and_equal_bytes(parts):
    skill, gate, fixture = parts
    data = encode_assisted_skill(skill, gate=gate, fixture=fixture)
    decoded = decode_assisted_skill(data)
    assert decoded.gate == gate
    expected = assisted_skill(skill, gate=gate, fixture=fixture)
    np.testing.assert_array_equal(decoded.skill.means, expected.skill.means)
    assert decoded.fixture is not None
    for name in ("damping", "stiffness", "max_rate", "min_speed", "look_ahead"):
        np.testing.assert_array_equal(getattr(decoded.fixture, name), getattr(fixture, name))
    assert [s.column for s in decoded.fixture.switches] == [s.column for s in fixture.switches]
    again = encode_assisted_skill(skill, gate=decoded.gate, fixture=decoded.fixture)
    assert again == data


def test_decode_without_fixture_has_none_and_the_default_gate(parts):
    decoded = decode_assisted_skill(encode_assisted_skill(parts[0]))
    assert decoded.fixture is None
    assert decoded.gate == Gate()


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        (b'"version":1', b'"version":2', "version 2, expected 1"),
        (b"pilotfish-assisted-skill", b"pilotfish-assisted-skull", "not a skill prepared"),
        (b'"gate":[1.0', b'"gate":[-1.0', "cannot be used"),
        (b'"fixture":null', b'"fixture":true', "cannot be used"),
        (b'"skill":', b'"skill":9999999', "expected at most"),
    ],
)
def test_decode_changed_header_is_refused_by_name(parts, old, new, match):
    data = encode_assisted_skill(parts[0])
    assert old in data
    with pytest.raises(UnreadableFile, match=match):
        decode_assisted_skill(data.replace(old, new, 1))


def test_decode_damaged_bytes_are_refused(parts, rng):
    data = encode_assisted_skill(parts[0], gate=parts[1], fixture=parts[2])
    header = data.index(b"\n") + 1
    for place in rng.integers(header, len(data), size=40):
        changed = bytearray(data)
        changed[place] ^= 1 << int(rng.integers(8))
        with pytest.raises(UnreadableFile):
            decode_assisted_skill(bytes(changed))
    for length in rng.integers(0, len(data), size=40):
        with pytest.raises(UnreadableFile):
            decode_assisted_skill(data[:length])
