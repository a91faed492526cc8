"""Skill files with valid hashes and invalid content, and skills that cannot be written."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from container_by_spec import documented_hash, split_container, with_hash
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from random_skills import Arrays, Header, equal, random_covariances, random_ranges, random_skill
from safetensors.numpy import save

from pilotfish.demonstrations import Layout, Part, Quantity
from pilotfish.errors import InvalidInput, NotPositiveDefinite, UnreadableFile
from pilotfish.gaussians.structures import DenseCovariances
from pilotfish.io.skill_file import content_hash, decode_skill, encode_skill, open_skill, save_skill
from pilotfish.models import DemonstrationStatistics, Endpoints, Skill


@pytest.fixture
def skill() -> Skill:
    """Return a semi-Markov skill of two frames, one dense and one semi-tied."""
    rng = np.random.default_rng(4)
    while True:
        one = random_skill(rng, "semi-markov", "mixed")
        complete = all(value is not None for value in (one.regularisation, one.demonstrated, one.endpoints))
        if len(one.frame_names) == 2 and one.states == 3 and one.width > 1 and complete:
            return one


def drop(table: dict[str, Any], key: str) -> None:
    del table[key]


MOTION_RANGES = ("smallest_sizes", "largest_sizes", "speeds", "accelerations", "start_distances")
REFUSED: dict[str, tuple[str, Callable[[Header, Arrays], object]]] = {
    "another format": ("expected 'pilotfish-skill'", lambda h, a: h.update(format="other")),
    "a newer version": (
        r"written by a newer version \(format 4, this one reads 3\); upgrade",
        lambda h, a: h.update(version=4),
    ),
    "an older version": (
        r"was written by an older version \(format 2\); learn the skill again",
        lambda h, a: h.update(version=2),
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
    "a negative regularisation": (
        r"regularisation\[1\] is -1.0, expected a number from 0 to",
        lambda h, a: a["regularisation"].put(1, -1.0),
    ),
    "a regularisation too few": (
        "regularisation has shape",
        lambda h, a: a.update(regularisation=a["regularisation"][1:]),
    ),
    "a scale of zero": (
        r"demonstrated.scales\[0\] is 0.0, expected a number from 1e-50",
        lambda h, a: a["demonstrated.scales"].put(0, 0.0),
    ),
    "a scale too few": (
        "demonstrated.scales has shape",
        lambda h, a: a.update({"demonstrated.scales": a["demonstrated.scales"][1:]}),
    ),
    "an enormous smallest value": (
        r"demonstrated.lowest\[0\] is -1e\+150",
        lambda h, a: a["demonstrated.lowest"].put(0, -1e150),
    ),
    "an enormous largest value": (
        r"demonstrated.highest\[1\] is 1e\+150",
        lambda h, a: a["demonstrated.highest"].put(1, 1e150),
    ),
    "a smallest value above the largest": (
        r"demonstrated.lowest\[1\] is above demonstrated.highest\[1\]",
        lambda h, a: a["demonstrated.lowest"].put(1, 1e6),
    ),
    "a missing largest value": (
        "lacks 'demonstrated.highest'",
        lambda h, a: drop(a, "demonstrated.highest"),
    ),
    "an unknown switch": (
        "demonstrated.switches has no such, expected names of columns",
        lambda h, a: h["demonstrated"].update(switches=["no such"]),
    ),
    "switches that are text": (
        "demonstrated.switches is 'on', expected a list",
        lambda h, a: h["demonstrated"].update(switches="on"),
    ),
    "a negative speed": (
        r"demonstrated.motion.speeds\[0\] is -1.0, expected a number from 0 to",
        lambda h, a: a["demonstrated.motion.speeds"].put(0, -1.0),
    ),
    "a size too many": (
        "demonstrated.motion.smallest_sizes has shape",
        lambda h, a: a.update({f"demonstrated.motion.{name}": np.ones(99) for name in MOTION_RANGES}),
    ),
    "a shortest demonstration that is text": (
        "demonstrated.motion.shortest is 'no', expected int",
        lambda h, a: h["demonstrated"]["motion"].update(shortest="no"),
    ),
    "offsets of another frame": (
        "demonstrated.frames.lowest",
        lambda h, a: a.update({"demonstrated.frames.lowest": a["demonstrated.frames.lowest"][:1]}),
    ),
    "NaN in the angle of a frame": (
        r"demonstrated.frames.angles\[0\] is nan",
        lambda h, a: a["demonstrated.frames.angles"].put(0, np.nan),
    ),
    "an end point too few": (
        r"endpoints.means has shape \(2, 1, \d+\), expected \(2, 2, \d+\)",
        lambda h, a: a.update({"endpoints.means": a["endpoints.means"][:, :1].copy()}),
    ),
    "end points of another frame": (
        r"endpoints.variances has shape \(1, 2, \d+\), expected \(2, 2, \d+\)",
        lambda h, a: a.update({"endpoints.variances": a["endpoints.variances"][:1]}),
    ),
    "an enormous end point": (
        r"endpoints.means\[0, 0, 0\] is 1e\+150",
        lambda h, a: a["endpoints.means"].put(0, 1e150),
    ),
    "an enormous variance of an end point": (
        r"endpoints.variances\[0, 0, 0\] is 1e\+250",
        lambda h, a: a["endpoints.variances"].put(0, 1e250),
    ),
    "a negative variance of an end point": (
        "the variance of end point 0.*positive definite",
        lambda h, a: a["endpoints.variances"].put(0, -1.0),
    ),
    "NaN in an end point": (
        r"endpoints.means\[0, 0, 1\] is nan",
        lambda h, a: a["endpoints.means"].put(1, np.nan),
    ),
    "end points without a variance": (
        "lacks 'endpoints.variances'",
        lambda h, a: drop(a, "endpoints.variances"),
    ),
    "another field of the demonstrations": (
        "demonstrated has the unknown fields",
        lambda h, a: h["demonstrated"].update(colour="red"),
    ),
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
        regularisation=rng.uniform(size=5),
        demonstrated=DemonstrationStatistics(
            rng.uniform(0.1, 1.0, size=5),
            -np.ones(6),
            np.ones(6),
            ("grip 1",),
            *random_ranges(rng, layout, 2),
        ),
        endpoints=Endpoints(rng.normal(size=(2, 2, 6)), rng.uniform(0.1, 1.0, size=(2, 2, 5))),
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


@pytest.mark.usefixtures("unchecked")
@given(st.data())
@settings(max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture])
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
