"""Durations in skill files: every law, and what recordings cut off."""

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
    GammaDurations,
    GaussianDurations,
    HistogramDurations,
    LogNormalDurations,
    NegativeBinomialDurations,
    PoissonDurations,
    Provenance,
    SemiMarkovChain,
    Skill,
)

Header = dict[str, Any]
Arrays = dict[str, np.ndarray]


DISTRIBUTIONS = {
    "gaussian": GaussianDurations(np.array([3.0, 9.0]), np.array([1.0, 2.0])),
    "log-normal": LogNormalDurations(np.array([1.0, 2.0]), np.array([0.3, 0.5])),
    "gamma": GammaDurations(np.array([4.0, 9.0]), np.array([0.5, 0.6])),
    "poisson": PoissonDurations(np.array([4.0, 0.5])),
    "negative-binomial": NegativeBinomialDurations(np.array([1.0, 2.5]), np.array([0.1, 0.6])),
    "histogram": HistogramDurations(np.array([[0.25, 0.0], [0.5, 1.0], [0.25, 0.0]])),
}


def skill_with_durations(durations: Any, censoring: Censoring) -> Skill:
    """Two states in turn, lasting as the durations say."""
    return Skill(
        SemiMarkovChain(np.array([0.5, 0.5]), np.eye(2)[::-1].copy(), durations, censoring),
        np.array([[[0.0], [1.0]]]),
        (DenseCovariances(np.ones((2, 1, 1))),),
        Layout((Part("place", Quantity.SCALAR, 1, "m"),)),
        0.1,
        ("world",),
        Provenance(("one",), 100, "", "full", 0.0, -1.0, 1, True, "pilotfish"),
    )


@pytest.mark.parametrize("first", [False, True])
@pytest.mark.parametrize("distribution", DISTRIBUTIONS)
def test_every_law_of_durations_comes_back_number_for_number(distribution: str, first: bool):
    """And what the recordings cut off; what a file always meant is not written out."""
    skill = skill_with_durations(DISTRIBUTIONS[distribution], Censoring(first))
    opened = decode_skill(encode_skill(skill))
    assert content_hash(opened) == content_hash(skill)
    assert isinstance(opened.dynamics, SemiMarkovChain)
    assert opened.dynamics.censoring == Censoring(first)
    assert type(opened.dynamics.durations) is type(DISTRIBUTIONS[distribution])
    for field in fields(DISTRIBUTIONS[distribution]):
        kept, given = (
            getattr(opened.dynamics.durations, field.name),
            getattr(DISTRIBUTIONS[distribution], field.name),
        )
        np.testing.assert_array_equal(kept, given)
    header, _ = split_container(encode_skill(skill))
    assert ("durations.kind" in header["dynamics"]) == (distribution != "gaussian")
    assert ("censoring.left" in header["dynamics"]) == first


@pytest.mark.parametrize(
    ("distribution", "words", "edit"),
    [
        ("gamma", "kind 'weibull'", lambda h, a: h["dynamics"].update({"durations.kind": "weibull"})),
        ("gamma", "kind 'gaussian'", lambda h, a: h["dynamics"].update({"durations.kind": "gaussian"})),
        ("gamma", "kind 3", lambda h, a: h["dynamics"].update({"durations.kind": 3})),
        ("gamma", "rates", lambda h, a: a["dynamics.durations.rates"].put(0, -1.0)),
        ("gamma", "shapes", lambda h, a: a["dynamics.durations.shapes"].put(0, 0.0)),
        ("log-normal", "log_deviations", lambda h, a: a["dynamics.durations.log_deviations"].put(0, 0.0)),
        ("poisson", "more", lambda h, a: a["dynamics.durations.rates"].put(1, 0.0)),
        ("negative-binomial", "exit_probs", lambda h, a: a["dynamics.durations.exit_probs"].put(1, 1.0)),
        ("histogram", "probabilities", lambda h, a: a["dynamics.durations.probabilities"].put(0, 0.5)),
        (
            "histogram",
            "shape",
            lambda h, a: a.update({"dynamics.durations.probabilities": np.ones((3, 3)) / 3}),
        ),
        (
            "gaussian",
            "left out",
            lambda h, a: h["dynamics"].update({"censoring.left": False, "censoring.right": True}),
        ),
        ("gaussian", "lacks 'right'", lambda h, a: h["dynamics"].update({"censoring.left": True})),
    ],
)
def test_durations_that_are_none_are_refused(distribution: str, words: str, edit: Any):
    skill = skill_with_durations(DISTRIBUTIONS[distribution], Censoring())
    header, arrays = split_container(encode_skill(skill))
    edit(header, arrays)
    with pytest.raises(UnreadableFile, match=words):
        decode_skill(with_hash(header, arrays))
