"""Skill files: exact, equal on every machine, and safe against damaged or hostile content."""

import json
import math
import pickle
import string
from collections.abc import Callable
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from container_by_spec import documented_hash, split_container, with_hash
from hypothesis import given, settings
from hypothesis import strategies as st
from safetensors.numpy import save

from pilotfish.demonstrations import Layout, Part, Quantity
from pilotfish.errors import InvalidInput, NotPositiveDefinite, UnreadableFile
from pilotfish.gaussians.structures import EMLLT, HDDC, MFA, MLT, DenseCovariances, SemiTied
from pilotfish.io.skill_file import content_hash, decode_skill, encode_skill, open_skill, save_skill
from pilotfish.models import (
    MarkovChain,
    MixtureWeights,
    Provenance,
    SemiMarkovChain,
    Skill,
)
from pilotfish.models import durations as distributions

DYNAMICS = ("mixture", "markov", "semi-markov")
STRUCTURES = ("dense", "semi-tied", "latent", "expanded", "multiple-transforms", "mixed")
SEEDS = st.integers(0, 2**32 - 1)

Header = dict[str, Any]
Arrays = dict[str, np.ndarray]


def random_dynamics(
    rng: np.random.Generator, kind: str, K: int
) -> MixtureWeights | MarkovChain | SemiMarkovChain:
    initial, transitions = rng.dirichlet(np.ones(K)), rng.dirichlet(np.ones(K), size=K)
    if kind == "mixture":
        return MixtureWeights(initial)
    if kind == "markov":
        return MarkovChain(initial, transitions)
    onward = transitions * (1.0 - np.eye(K))
    onward[-1] = 0.0  # a final state
    statistics = onward.sum(axis=1, keepdims=True)
    onward = np.divide(onward, statistics, out=np.zeros_like(onward), where=statistics > 0.0)
    return SemiMarkovChain(initial, onward, distributions.Gaussian(*rng.uniform(0.1, 30.0, size=(2, K))))


def random_layout(rng: np.random.Generator) -> Layout:
    choices = (
        Part("position", Quantity.POSITION, 3, "m"),
        Part("orientation", Quantity.QUATERNION, 4, "1"),
        Part("force", Quantity.VECTOR, 2, "N"),
        Part("gripper ∆", Quantity.SCALAR, 1, "m"),
    )
    chosen = tuple(part for part in choices if rng.random() < 0.4) or choices[-1:]
    layout = Layout(chosen)
    return layout.differentiate() if rng.random() < 0.5 else layout


def random_covariances(rng: np.random.Generator, kind: str, K: int, D: int) -> Any:
    factors = rng.normal(size=(K, D, D))
    samples = factors @ factors.transpose(0, 2, 1) + 0.1 * np.eye(D)
    counts = np.ones(K)
    match kind:
        case "dense":
            return DenseCovariances(samples)
        case "latent":
            factors = int(rng.integers(0, D))
            structure = MFA(factors) if rng.random() < 0.5 else HDDC((factors,) * (K - 1) + (0,))
            return structure.estimate(counts, samples, None)
        case "expanded":
            return EMLLT(int(rng.integers(D, D * (D + 1) // 2 + 1))).estimate(counts, samples, None)
        case "multiple-transforms":
            return MLT(int(rng.integers(1, K + 1))).estimate(counts, samples, None)
    return SemiTied(tying=float(rng.choice([0.3, 1.0])), sweeps=2).estimate(counts, samples, None)


def random_skill(rng: np.random.Generator, dynamics: str, structure: str) -> Skill:
    layout, P, K = random_layout(rng), int(rng.integers(1, 4)), int(rng.integers(1, 5))
    kinds = {"mixed": ("dense", "semi-tied")}.get(structure, (structure,))
    means = rng.normal(size=(P, K, layout.width)) * 10.0 ** rng.integers(-300, 99)
    covariances = [random_covariances(rng, kinds[p % len(kinds)], K, layout.width) for p in range(P)]
    words = tuple(
        "".join(rng.choice(list(string.ascii_letters + string.punctuation + " é∆"), size=5))
        for _ in range(rng.integers(0, 4))
    )
    log_likelihood = float(rng.choice([rng.normal() * 1e5, math.nan]))
    provenance = Provenance(
        words,
        int(rng.integers(1, 10**6)),
        "0" * 64,
        "full",
        1e-5,
        log_likelihood,
        7,
        bool(rng.random() < 0.5),
        "x",
    )
    period, names = float(rng.uniform(1e-3, 1.0)), tuple(f"frame {p}" for p in range(P))
    chain = random_dynamics(rng, dynamics, K)
    return Skill(chain, means, tuple(covariances), layout, period, names, provenance)


def equal(one: Any, other: Any) -> bool:
    """Return whether values have the same type and the same bits at every level."""
    if type(one) is not type(other):
        return False
    if is_dataclass(one):
        return all(equal(getattr(one, f.name), getattr(other, f.name)) for f in fields(one))
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(equal, one, other))
    if isinstance(one, np.ndarray):
        return (one.dtype, one.shape, one.tobytes()) == (other.dtype, other.shape, other.tobytes())
    return bool(one == other or (one != one and other != other))


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
        if len(one.frame_names) == 2 and one.states == 3 and one.width > 1:
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


def drop(table: dict[str, Any], key: str) -> None:
    del table[key]


REFUSED: dict[str, tuple[str, Callable[[Header, Arrays], object]]] = {
    "another format": ("expected 'pilotfish-skill'", lambda h, a: h.update(format="other")),
    "a newer version": (
        r"written by a newer version \(format 3, this one reads 2\); upgrade",
        lambda h, a: h.update(version=3),
    ),
    "an older version": (
        r"was written by an older version \(format 1\); learn the skill again",
        lambda h, a: h.update(version=1),
    ),
    "an impossible version": ("version is 0", lambda h, a: h.update(version=0)),
    "unknown dynamics": ("'levy'", lambda h, a: h["dynamics"].update(kind="levy")),
    "dynamics of no kind": ("kind", lambda h, a: h["dynamics"].update(kind=[1])),
    "unknown covariances": ("'toeplitz'", lambda h, a: h["covariances"][0].update(kind="toeplitz")),
    "an unknown quantity": ("'spin'", lambda h, a: h["layout"][0].update(quantity="spin")),
    "a missing field": ("lacks 'tying'", lambda h, a: drop(h["covariances"][1], "tying")),
    "another field": ("unknown fields", lambda h, a: h["covariances"][1].update(colour="red")),
    "another key": ("unknown fields", lambda h, a: h.update(colour="red")),
    "a missing key": ("lacks 'provenance'", lambda h, a: drop(h, "provenance")),
    "a missing array": ("lacks 'dynamics.initial'", lambda h, a: drop(a, "dynamics.initial")),
    "no means": ("lacks 'means'", lambda h, a: drop(a, "means")),
    "another array": ("unknown fields", lambda h, a: a.update(other=np.zeros(3))),
    "text for a number": ("expected float", lambda h, a: h.update(period="0.1")),
    "an infinite number": ("header cannot be used", lambda h, a: h.update(period=1e999)),
    "no period": ("period is nan", lambda h, a: h.update(period=None)),
    "a negative period": ("period is -1.0", lambda h, a: h.update(period=-1.0)),
    "a frame too few": ("2 frames", lambda h, a: h["frames"].pop()),
    "two frames of one name": ("different names", lambda h, a: h.update(frames=["a", "a"])),
    "a frame that is a number": ("expected text in quotes", lambda h, a: h.update(frames=["a", 1])),
    "a column too many": ("columns", lambda h, a: h["layout"].append({**h["layout"][0], "name": "more"})),
    "a part twice": ("more than once", lambda h, a: h["layout"].append(h["layout"][0])),
    "a state too few": ("shape", lambda h, a: a.update({"dynamics.initial": a["dynamics.initial"][:-1]})),
    "flat means": ("means has shape", lambda h, a: a.update(means=a["means"].ravel())),
    "no state": ("number of states is 0", lambda h, a: a.update(means=a["means"][:, :0])),
    "NaN in means": ("means.* is nan", lambda h, a: a["means"].put(1, np.nan)),
    "NaN in a covariance": ("is nan", lambda h, a: a["covariances.0.dense"].put(0, np.nan)),
    "infinity in a basis": ("is inf", lambda h, a: a["covariances.1.basis"].put(0, np.inf)),
    "an asymmetric covariance": ("transpose", lambda h, a: a["covariances.0.dense"].put(1, 1e3)),
    "a negative covariance": ("positive definite", lambda h, a: a["covariances.0.dense"].put(0, -1.0)),
    "a negative variance": ("variances", lambda h, a: a["covariances.1.variances"].put(0, -1.0)),
    "a tying above one": ("tying is 1.5", lambda h, a: h["covariances"][1].update(tying=1.5)),
    "an initial sum of two": ("initial", lambda h, a: a["dynamics.initial"].__imul__(2.0)),
    "a row of sum a half": (r"transitions\[0\]", lambda h, a: a["dynamics.transitions"].__imul__(0.5)),
    "a state after itself": (r"transitions\[1, 1\]", lambda h, a: a["dynamics.transitions"].put(4, 0.5)),
    "a deviation of zero": ("deviations", lambda h, a: a["dynamics.durations.deviations"].put(0, 0.0)),
}


@pytest.mark.parametrize("what", REFUSED)
def test_open_skill_invalid_content_with_valid_hash_raises(skill: Skill, what: str, tmp_path: Path):
    words, edit = REFUSED[what]
    header, arrays = split_container(encode_skill(skill))
    edit(header, arrays)
    (tmp_path / "file").write_bytes(with_hash(header, arrays))
    with pytest.raises(UnreadableFile, match=words) as refusal:
        open_skill(tmp_path / "file")
    assert str(refusal.value).startswith(str(tmp_path / "file"))
    assert "\n" not in str(refusal.value)


def with_covariances(kind: str, **changes: Any) -> Callable[[Skill], Skill]:
    """Return an edit that gives the first frame covariances of this kind, with some arrays changed."""

    def edited(skill: Skill) -> Skill:
        rng = np.random.default_rng(0)
        one = random_covariances(rng, kind, skill.states, skill.width)
        arrays = {name: change(getattr(one, name)) for name, change in changes.items()}
        return replace(skill, covariances=(replace(one, **arrays), skill.covariances[1]))

    return edited


INVALID_COVARIANCES = {
    "noise is negative": (r"noise\[0, 0\]", with_covariances("latent", noise=lambda n: n * 0.0 - 1.0)),
    "noise is missing everywhere": ("positive definite", with_covariances("latent", noise=lambda n: n * 0.0)),
    "weights are negative": ("positive definite", with_covariances("expanded", weights=lambda w: -w)),
    "no basis is chosen": ("one 1", with_covariances("multiple-transforms", membership=lambda m: m * 0.0)),
    "half a basis is chosen": (
        "one 1",
        with_covariances("multiple-transforms", membership=lambda m: m * 0.5),
    ),
    "a variance is negative": ("variances", with_covariances("multiple-transforms", variances=lambda v: -v)),
}


@pytest.mark.parametrize("what", INVALID_COVARIANCES)
def test_encode_skill_invalid_covariances_raise(skill: Skill, what: str):
    words, edit = INVALID_COVARIANCES[what]
    with pytest.raises((InvalidInput, NotPositiveDefinite), match=words):
        encode_skill(edit(skill))


CENSORED: dict[str, tuple[str, str, Callable[[np.ndarray], np.ndarray]]] = {
    "loadings without a state": ("latent", "loadings", lambda a: a[1:]),
    "loadings without a factor": ("latent", "loadings", lambda a: a[:, :, :0]),
    "weights without a direction": ("expanded", "weights", lambda a: a[:, 1:]),
    "directions without a column": ("expanded", "directions", lambda a: a[:, 1:]),
    "a basis too many": ("multiple-transforms", "bases", lambda a: np.concatenate([a, a])),
}


@pytest.mark.parametrize("what", CENSORED)
def test_decode_skill_inconsistent_covariance_shapes_raise(skill: Skill, what: str):
    kind, name, change = CENSORED[what]
    header, arrays = split_container(encode_skill(with_covariances(kind)(skill)))
    arrays[f"covariances.0.{name}"] = change(arrays[f"covariances.0.{name}"]).copy()
    with pytest.raises(UnreadableFile, match="shape"):
        decode_skill(with_hash(header, arrays))


def test_encode_skill_orientation_has_three_tangent_columns(skill: Skill):
    """A covariance on S^3 has three columns for each four of the mean."""
    layout = Layout(
        (Part("orientation", Quantity.ORIENTATION, 4, "1"), Part("grip", Quantity.SCALAR, 2, "m"))
    )
    rng = np.random.default_rng(0)
    one = replace(
        skill,
        means=rng.normal(size=(2, 3, 6)),
        layout=layout,
        covariances=tuple(random_covariances(rng, kind, 3, 5) for kind in ("dense", "latent")),
    )
    assert equal(decode_skill(encode_skill(one)), one)
    with pytest.raises(InvalidInput, match="shape"):
        encode_skill(replace(one, covariances=(random_covariances(rng, "dense", 3, 6),) * 2))


def test_decode_skill_float32_raises(skill: Skill):
    header, arrays = split_container(encode_skill(skill))
    narrow = {name: np.zeros(array.shape, np.float32) for name, array in arrays.items()}
    with pytest.raises(UnreadableFile, match="expected F64"):
        decode_skill(bytes(save(narrow, {"pilotfish": json.dumps(header)})))


def test_decode_skill_foreign_safetensors_raises():
    with pytest.raises(UnreadableFile, match="without the header of a skill"):
        decode_skill(bytes(save({"weights": np.zeros(3)})))


def test_decode_skill_altered_number_raises(skill: Skill):
    header, arrays = split_container(encode_skill(skill))
    with pytest.raises(UnreadableFile, match="the file was altered"):
        decode_skill(bytes(save(arrays, {"pilotfish": json.dumps({**header, "period": 9.0})})))


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5) | st.just(10**4000),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=5,
)


@given(st.data())
@settings(max_examples=300)
def test_decode_skill_any_json_in_header_raises_or_keeps_hash(data: st.DataObject):
    one = random_skill(np.random.default_rng(2), "semi-markov", "mixed")
    header, arrays = split_container(encode_skill(one))
    table: Any = header
    while True:
        key = data.draw(st.sampled_from(sorted(table) if isinstance(table, dict) else range(len(table))))
        if not isinstance(table[key], dict | list) or not table[key] or data.draw(st.booleans()):
            break
        table = table[key]
    table[key] = data.draw(JSON)
    try:
        opened = decode_skill(with_hash(header, arrays))
    except UnreadableFile:
        return
    assert content_hash(opened) == documented_hash(header, arrays)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_save_skill_invalid_numbers_raise(skill: Skill, value: float, tmp_path: Path):
    bad = replace(skill, means=np.where(np.arange(skill.width) == 0, value, skill.means))
    with pytest.raises(InvalidInput, match=r"means\[0, 0, 0\]"):
        save_skill(bad, tmp_path / "skill")
    assert not list(tmp_path.iterdir())


def test_encode_skill_unregistered_covariances_raise(skill: Skill):
    bad = replace(
        skill, covariances=(_UnregisteredCovariances(skill.covariances[0].dense), skill.covariances[1])
    )
    with pytest.raises(InvalidInput, match="_UnregisteredCovariances, which cannot be written"):
        encode_skill(bad)


class _UnregisteredCovariances(DenseCovariances):
    pass


def test_open_skill_missing_file_raises(tmp_path: Path):
    for place in (tmp_path / "none", tmp_path):
        with pytest.raises(InvalidInput, match=r"expected a skill file"):
            open_skill(place)
