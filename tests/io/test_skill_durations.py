"""Duration distributions and censoring in skill files."""

from collections.abc import Callable
from dataclasses import fields
from typing import Any

import numpy as np
import pytest
from container_by_spec import split_container, with_hash

from pilotfish.demonstrations import Layout, Part, Quantity
from pilotfish.errors import UnreadableFile
from pilotfish.gaussians.structures import DenseCovariances
from pilotfish.io.skill_file import content_hash, decode_skill, encode_skill
from pilotfish.models import (
    Censoring,
    Provenance,
    SemiMarkovChain,
    Skill,
)
from pilotfish.models import durations as distributions
from pilotfish.models.durations import DurationDistribution

Header = dict[str, Any]
Arrays = dict[str, np.ndarray]


EXAMPLES = {
    "gaussian": distributions.Gaussian(np.array([3.0, 9.0]), np.array([1.0, 2.0])),
    "log-normal": distributions.LogNormal(np.array([1.0, 2.0]), np.array([0.3, 0.5])),
    "gamma": distributions.Gamma(np.array([4.0, 9.0]), np.array([0.5, 0.6])),
    "poisson": distributions.Poisson(np.array([4.0, 0.5])),
    "negative-binomial": distributions.NegativeBinomial(np.array([1.0, 2.5]), np.array([0.1, 0.6])),
    "histogram": distributions.Histogram(np.array([[0.25, 0.0], [0.5, 1.0], [0.25, 0.0]])),
}


def skill_with_durations(durations: DurationDistribution, censoring: Censoring = Censoring.RIGHT) -> Skill:
    """Return a skill of two states with these durations."""
    return Skill(
        SemiMarkovChain(np.array([0.5, 0.5]), np.eye(2)[::-1].copy(), durations, censoring),
        np.array([[[0.0], [1.0]]]),
        (DenseCovariances(np.ones((2, 1, 1))),),
        Layout((Part("place", Quantity.SCALAR, 1, "m"),)),
        0.1,
        ("world",),
        Provenance(("one",), 100, "", "full", -1.0, 1, True, "pilotfish"),
    )


@pytest.mark.parametrize("censoring", Censoring)
@pytest.mark.parametrize("name", EXAMPLES)
def test_decode_every_distribution_and_censoring_equals_encoded(name: str, censoring: Censoring):
    durations = EXAMPLES[name]
    skill = skill_with_durations(durations, censoring)
    opened = decode_skill(encode_skill(skill))
    assert content_hash(opened) == content_hash(skill)
    assert isinstance(opened.dynamics, SemiMarkovChain)
    assert opened.dynamics.censoring == censoring
    assert type(opened.dynamics.durations) is type(durations)
    for field in fields(durations):
        read, written = getattr(opened.dynamics.durations, field.name), getattr(durations, field.name)
        np.testing.assert_array_equal(read, written)
    header, _ = split_container(encode_skill(skill))
    assert header["dynamics"]["durations"] == {"kind": name}
    assert header["dynamics"]["censoring"] == censoring.value


def test_examples_have_every_registered_distribution():
    assert set(EXAMPLES) == set(distributions.DISTRIBUTIONS)


def set_kind(name: Any) -> Callable[[Header, Arrays], object]:
    return lambda header, _: header["dynamics"]["durations"].update(kind=name)


def set_first(array: str, value: float, index: int = 0) -> Callable[[Header, Arrays], object]:
    return lambda _, arrays: arrays[f"dynamics.durations.{array}"].put(index, value)


@pytest.mark.parametrize(
    ("distribution", "message", "edit"),
    [
        ("gamma", "durations.kind is 'weibull', expected one of gaussian", set_kind("weibull")),
        ("gamma", "lacks 'dynamics.durations.means'", set_kind("gaussian")),
        ("gamma", "durations.kind is 3", set_kind(3)),
        ("gamma", "dynamics.durations lacks 'kind'", lambda h, a: h["dynamics"].update(durations=[1])),
        ("gamma", "durations has the unknown fields x", lambda h, a: h["dynamics"]["durations"].update(x=1)),
        ("gamma", "rates", set_first("rates", -1.0)),
        ("gamma", "shapes", set_first("shapes", 0.0)),
        ("log-normal", "log_deviations", set_first("log_deviations", 0.0)),
        ("poisson", "more", set_first("rates", 0.0, 1)),
        ("negative-binomial", "exit_probs", set_first("exit_probs", 1.0, 1)),
        ("histogram", "probabilities", set_first("probabilities", 0.5)),
        (
            "histogram",
            "shape",
            lambda h, a: a.update({"dynamics.durations.probabilities": np.ones((3, 3)) / 3}),
        ),
        ("gaussian", "censoring is 'up', expected one of", lambda h, a: h["dynamics"].update(censoring="up")),
        ("gaussian", "lacks 'censoring'", lambda h, a: h["dynamics"].pop("censoring")),
    ],
)
def test_decode_invalid_durations_raises(distribution: str, message: str, edit: Any):
    header, arrays = split_container(encode_skill(skill_with_durations(EXAMPLES[distribution])))
    edit(header, arrays)
    with pytest.raises(UnreadableFile, match=message):
        decode_skill(with_hash(header, arrays))
