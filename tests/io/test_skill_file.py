"""Skill files: exact, equal on every machine, and safe against damaged content."""

import pickle
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from container_by_spec import documented_hash, split_container
from hypothesis import given, settings
from hypothesis import strategies as st
from random_skills import DYNAMICS, SEEDS, STRUCTURES, equal, random_skill

from pilotfish.demonstrations import Layout
from pilotfish.errors import UnreadableFile
from pilotfish.gaussians.structures import DenseCovariances
from pilotfish.io.skill_file import content_hash, decode_skill, encode_skill, open_skill
from pilotfish.models import (
    MarkovChain,
    Skill,
)


def opens_equal_or_is_refused(data: bytes, skill: Skill) -> bool:
    """Return True if the file is refused; fail if it opens as another skill."""
    try:
        opened = decode_skill(data)
    except UnreadableFile:
        return True
    assert equal(opened, skill)
    return False


@pytest.fixture
def skill() -> Skill:
    """Return a semi-Markov skill of two frames, one dense and one semi-tied."""
    rng = np.random.default_rng(4)
    while True:
        one = random_skill(rng, "semi-markov", "mixed")
        complete = all(value is not None for value in (one.regularisation, one.demonstrated, one.endpoints))
        if len(one.frame_names) == 2 and one.states == 3 and one.width > 1 and complete:
            return one


@pytest.mark.parametrize("structure", STRUCTURES)
@pytest.mark.parametrize("dynamics", DYNAMICS)
@given(seed=SEEDS)
@settings(max_examples=25)
def test_decode_skill_of_encoded_equals_skill(dynamics: str, structure: str, seed: int):
    one = random_skill(np.random.default_rng(seed), dynamics, structure)
    data = encode_skill(one)
    opened = decode_skill(data)
    assert equal(opened, one)
    assert encode_skill(opened) == data


@given(seed=SEEDS, kind=st.sampled_from(DYNAMICS))
@settings(max_examples=25)
def test_content_hash_equals_documented_hash(seed: int, kind: str):
    one = random_skill(np.random.default_rng(seed), kind, "mixed")
    header, arrays = split_container(encode_skill(one))
    assert header["content"] == documented_hash(header, arrays) == content_hash(one)


def test_encode_skill_memory_layout_has_no_effect(skill: Skill):
    """Safetensors alone would save views and Fortran order wrongly."""
    wide = np.zeros((*skill.means.shape[:2], 2 * skill.width))
    wide[:, :, ::2] = skill.means
    strided = replace(skill, means=wide[:, :, ::2])
    turned = replace(skill, means=np.asfortranarray(skill.means))
    assert encode_skill(strided) == encode_skill(turned) == encode_skill(skill)


CHANGES: dict[str, Callable[[Skill], Skill]] = {
    "a mean": lambda s: replace(s, means=np.nextafter(s.means, np.inf)),
    "the period": lambda s: replace(s, period=2 * s.period),
    "a frame's name": lambda s: replace(s, frame_names=("other", *s.frame_names[1:])),
    "the order of frames": lambda s: replace(s, frame_names=s.frame_names[::-1]),
    "the regularisation": lambda s: replace(s, regularisation=np.full(s.width, 0.25)),
    "no regularisation": lambda s: replace(s, regularisation=None),
    "no statistics": lambda s: replace(s, demonstrated=None),
    "no end points": lambda s: replace(s, endpoints=None),
    "a scale": lambda s: replace(s, demonstrated=replace(s.demonstrated, scales=2.0 * s.demonstrated.scales)),
    "the switches": lambda s: replace(
        s, demonstrated=replace(s.demonstrated, switches=(*s.demonstrated.switches, s.layout.names[0]))
    ),
    "an end point": lambda s: replace(
        s, endpoints=replace(s.endpoints, means=np.nextafter(s.endpoints.means, np.inf))
    ),
    "a note": lambda s: replace(s, provenance=replace(s.provenance, note="other")),
    "the dynamics": lambda s: replace(s, dynamics=MarkovChain(s.dynamics.initial, np.eye(s.states))),
    "a structure": lambda s: replace(s, covariances=tuple(DenseCovariances(c.dense) for c in s.covariances)),
    "a unit": lambda s: replace(
        s, layout=Layout((replace(s.layout.parts[0], unit="ell"), *s.layout.parts[1:]))
    ),
}


@pytest.mark.parametrize("what", CHANGES)
def test_content_hash_changes_with_every_field(skill: Skill, what: str):
    assert content_hash(CHANGES[what](skill)) != content_hash(skill)


@given(seed=SEEDS, place=st.floats(0.0, 1.0, exclude_max=True), flip=st.integers(1, 255))
@settings(max_examples=300)
def test_decode_skill_changed_byte_equals_or_raises(seed: int, place: float, flip: int):
    one = random_skill(np.random.default_rng(seed % 7), DYNAMICS[seed % 3], "mixed")
    data = bytearray(encode_skill(one))
    data[int(place * len(data))] ^= flip
    opens_equal_or_is_refused(bytes(data), one)


@pytest.mark.parametrize("seed", range(2))
def test_decode_skill_changed_header_bit_equals_or_raises(seed: int):
    """The lowest bit of each byte before the arrays, and of some within."""
    one = random_skill(np.random.default_rng(seed), "semi-markov", "semi-tied")
    data = encode_skill(one)
    header = 8 + int.from_bytes(data[:8], "little")
    for place in [*range(header), *range(header, len(data), 97)]:
        opens_equal_or_is_refused(data[:place] + bytes([data[place] ^ 1]) + data[place + 1 :], one)


def test_decode_skill_truncated_or_lengthened_raises(skill: Skill):
    data = encode_skill(skill)
    for length in [*range(0, len(data), 61), len(data) - 1]:
        assert opens_equal_or_is_refused(data[:length], skill)
    for more in (b"\0", b"x" * 8, data):
        assert opens_equal_or_is_refused(data + more, skill)


@given(data=st.binary(max_size=200))
def test_decode_skill_random_bytes_raise(data: bytes):
    with pytest.raises(UnreadableFile):
        decode_skill(data)


def test_open_skill_pickle_raises_without_executing(tmp_path: Path):
    (tmp_path / "trap").write_bytes(pickle.dumps(_Trap()))
    with pytest.raises(UnreadableFile, match="not a complete safetensors file"):
        open_skill(tmp_path / "trap")
    assert not _Trap.sprung


class _Trap:
    sprung = False

    def __reduce__(self) -> tuple[Callable[..., object], tuple[object, ...]]:
        return setattr, (_Trap, "sprung", True)
