"""Skill and stream files that need much memory or time, or have text that cannot be printed."""

import os
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import pytest
from container_by_spec import split_container, with_hash

from pilotfish.demonstrations import Layout, Part, Quantity
from pilotfish.errors import MAX_MESSAGE_LENGTH, InvalidInput, UnreadableFile
from pilotfish.gaussians.structures import DenseCovariances, ExpandedPrecisions
from pilotfish.io.skill_file import decode_skill, encode_skill, open_skill
from pilotfish.io.stream_file import decode_stream, encode_stream, load_any
from pilotfish.models import (
    Censoring,
    Provenance,
    SemiMarkovChain,
    Skill,
    online,
)
from pilotfish.models import durations as distributions

QUICK = 3.0  # s of CPU time
TEXTS = ["\ud800", "\x1b[2J", "note\ncontent 123", "\u202e"]
LINE = Layout((Part("place", Quantity.SCALAR, 1, "m"),))


def skill(durations: Any = None) -> Skill:
    """Return a skill of two alternating states."""
    durations = durations or distributions.Gaussian(np.array([3.0, 9.0]), np.array([1.0, 2.0]))
    return Skill(
        SemiMarkovChain(np.array([0.5, 0.5]), np.eye(2)[::-1].copy(), durations, Censoring.RIGHT),
        np.array([[[0.0], [1.0]]]),
        (DenseCovariances(np.ones((2, 1, 1))),),
        LINE,
        0.1,
        ("world",),
        Provenance(("one",), 100, "", "full", -1.0, 1, True, "pilotfish"),
    )


def assert_rejected(data: bytes, message: str, decode: Callable[[bytes], Any] = decode_skill) -> None:
    """Assert that decoding raises one short line, without warnings and in little CPU time."""
    begin = process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(UnreadableFile, match=message) as caught:
            decode(data)
    assert process_time() - begin < QUICK
    assert len(str(caught.value)) <= MAX_MESSAGE_LENGTH
    assert str(caught.value).isprintable()


def edited_file(change: Callable[[dict[str, Any], dict[str, np.ndarray]], object]) -> bytes:
    """Return the bytes of a skill with an edited header or arrays and a valid hash."""
    header, arrays = split_container(encode_skill(skill()))
    change(header, arrays)
    return with_hash(header, arrays)


def test_encode_skill_overflowing_covariances_raise() -> None:
    expanded = ExpandedPrecisions(np.ones((1, 1)), np.full((2, 1), 5e-324))
    with pytest.raises(InvalidInput, match="the covariance in frame 'world' of state"):
        encode_skill(replace(skill(), covariances=(expanded,)))


PAIRS = [
    (1e9, 1.0),
    (1e13, 1e12),
    (1e150, 1.0),
    (1e308, 5e-324),
    (3.0, 5e-324),
    (3.0, 1e-160),
    (-1e150, 1.0),
]
LONG = [
    *(distributions.Gaussian(np.array([m, 9.0]), np.array([s, 2.0])) for m, s in PAIRS),
    distributions.Gaussian(np.array([3.0, 9.0]), np.array([1e13, 1.0])),
    distributions.LogNormal(np.array([1e3, 1.0]), np.array([1.0, 1.0])),
    distributions.LogNormal(np.array([25.0, 1.0]), np.array([1e-9, 1.0])),
    distributions.Gamma(np.array([1e12, 1.0]), np.array([1.0, 1.0])),
    distributions.Gamma(np.array([1.0, 1.0]), np.array([5e-324, 1.0])),
    distributions.Gamma(np.array([1e300, 1.0]), np.array([1e300, 1.0])),
    distributions.Poisson(np.array([1e10, 1.0])),
    distributions.Poisson(np.array([1e300, 1.0])),
    distributions.NegativeBinomial(np.array([1e12, 1.0]), np.array([0.5, 0.5])),
    distributions.NegativeBinomial(np.array([1.0, 1.0]), np.array([1e-300, 0.5])),
]


@pytest.mark.parametrize("durations", LONG, ids=range(len(LONG)))
def test_decode_skill_durations_without_finite_sums_raise(durations: Any) -> None:
    """No memory is reserved for each step, and no sum is NaN."""
    header, arrays = split_container(encode_skill(skill(_like(durations))))
    for name, values in _parameters(durations).items():
        arrays[f"dynamics.durations.{name}"] = values
    assert_rejected(with_hash(header, arrays), "durations")


def _parameters(durations: Any) -> dict[str, np.ndarray]:
    return {name: getattr(durations, name) for name in durations.__slots__}


def _like(durations: Any) -> Any:
    """Return durations of the same class, of a few steps."""
    return type(durations)(*(np.full(2, 0.5) for _ in durations.__slots__))


MODEST = [
    distributions.Gaussian(np.array([1e5, 9.0]), np.array([1e5, 2.0])),
    distributions.Gaussian(np.array([1e6, 9.0]), np.array([1.0, 2.0])),
    distributions.Gaussian(np.array([3.0, 9.0]), np.array([1e-6, 2.0])),
    distributions.LogNormal(np.array([10.0, 1.0]), np.array([3.0, 1.0])),
    distributions.Gamma(np.array([0.01, 1.0]), np.array([1e-6, 1.0])),
    distributions.NegativeBinomial(np.array([0.1, 1.0]), np.array([1e-6, 0.5])),
    distributions.Histogram(np.full((1000, 2), 1e-3)),
]


@pytest.mark.parametrize("durations", MODEST, ids=range(len(MODEST)))
def test_decode_skill_long_durations_plan_in_bounded_time(durations: Any) -> None:
    opened = decode_skill(encode_skill(skill(durations)))
    begin = process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        shares = opened.dynamics.filtered_state_probs(np.empty((0, 2)), 200)
        states = opened.dynamics.sample(200, np.random.default_rng(0))
    assert process_time() - begin < 2 * QUICK
    assert np.isfinite(shares).all()
    np.testing.assert_allclose(shares.sum(axis=1), 1.0)
    assert states.shape == (200,)


def test_sample_segments_longer_than_horizon_have_their_probability() -> None:
    long = skill(distributions.Gaussian(np.array([2.0, 1000.0]), np.array([1.0, 500.0])))
    chain = replace(long.dynamics, initial=np.array([0.0, 1.0]))
    stayed = [chain.sample(50, np.random.default_rng(n)).all() for n in range(300)]
    expected = np.exp(chain.durations.log_table(5000)[49:, 1]).sum()
    assert np.mean(stayed) == pytest.approx(expected, abs=0.03)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda h, a: h.update(period=1e308), "period is 1e[+]308, expected a number from 1e-09"),
        (lambda h, a: h.update(period=5e-324), "period is 5e-324"),
        (lambda h, a: h["layout"][0].update(derivative=10**10), "derivative of part 'place' is 10000000000"),
        (lambda h, a: h["layout"][0].update(derivative=10**19), "derivative"),
        (lambda h, a: h["layout"][0].update(size=10**8), "size of part 'place' is 100000000"),
        (
            lambda h, a: h["provenance"].update(datapoints=10**400),
            "datapoints is a whole number of 1329",
        ),
        (lambda h, a: h["provenance"].update(datapoints=-1), "datapoints is -1"),
        (
            lambda h, a: a.update(regularisation=np.array([np.nan])),
            r"regularisation\[0\] is nan, expected finite numbers",
        ),
        (lambda h, a: h["provenance"].update(log_likelihood=1e200), "log_likelihood is 1e[+]200"),
        (lambda h, a: h.update(version=10**400), "written by a newer version"),
        (lambda h, a: h.update(frames=["w"] * 200_000), "frames is .*expected a list of at most 100000"),
        (lambda h, a: h.update(frames=[f"n{n}" for n in range(99_999)]), "99999 frame names"),
        (lambda h, a: h.update({f"k{n}": 0 for n in range(50_000)}), "the header has .*50000 in all"),
        (lambda h, a: a.update({f"a{n}": np.zeros(1) for n in range(5000)}), "the file has .*5000 in all"),
        (
            lambda h, a: a.update(means=np.full((1, 2, 1), 1e200)),
            "means.*expected a finite number",
        ),
        (lambda h, a: a.update(means=np.zeros((1, 2000, 1))), "number of states is 2000"),
    ],
    ids=range(16),
)
def test_decode_skill_numbers_out_of_bounds_raise(change: Any, message: str) -> None:
    assert_rejected(edited_file(change), message)


def test_encode_and_decode_skill_too_many_columns_raise() -> None:
    """A file of 160 kB with latent covariances would take 800 MB."""
    wide = replace(
        skill(),
        layout=Layout((Part("wide", Quantity.SCALAR, 10_000, "1"),)),
        means=np.zeros((1, 2, 10_000)),
    )
    with pytest.raises(InvalidInput, match="of 10000 columns have 200000000 numbers, expected at most"):
        encode_skill(wide)
    header, arrays = split_container(encode_skill(skill()))
    header["layout"][0]["size"] = 10_000
    arrays["means"] = np.zeros((1, 2, 10_000))
    assert_rejected(with_hash(header, arrays), "of 10000 columns have 200000000 numbers")


@pytest.mark.parametrize("text", TEXTS, ids=ascii)
@pytest.mark.parametrize(
    "change",
    [
        lambda h, text: h.update(frames=[text]),
        lambda h, text: h["layout"][0].update(name=text),
        lambda h, text: h["layout"][0].update(unit=text),
        lambda h, text: h["provenance"].update(demonstrations=[text]),
        lambda h, text: h["provenance"].update(data=text),
        lambda h, text: h["provenance"].update(structure=text),
        lambda h, text: h["provenance"].update(library=text),
        lambda h, text: h["provenance"].update(note=text),
        lambda h, text: h["dynamics"].update(kind=text),
        lambda h, text: h.update({text: 0}),
        lambda h, text: h.update(format=text),
    ],
    ids=range(11),
)
def test_decode_skill_unprintable_text_raises(change: Any, text: str) -> None:
    header, arrays = split_container(encode_skill(skill()))
    change(header, text)
    assert_rejected(with_hash(header, arrays), ".")


@pytest.mark.parametrize("text", TEXTS, ids=ascii)
def test_encode_skill_unprintable_text_raises(text: str) -> None:
    given = skill()
    for bad in (
        replace(given, frame_names=(text,)),
        replace(given, provenance=replace(given.provenance, demonstrations=(text,))),
        replace(given, provenance=replace(given.provenance, note=text)),
    ):
        with pytest.raises(InvalidInput, match="expected printable"):
            encode_skill(bad)


def test_decode_skill_invalid_array_name_raises() -> None:
    for name in ("n" * 100_000, "\x1b[2J"):
        assert_rejected(
            edited_file(lambda h, a, name=name: a.update({name: np.zeros(1)})), "the name of an array"
        )


@pytest.mark.parametrize("opened", [open_skill, load_any])
@pytest.mark.parametrize("kind", ["fifo", "zero", "long", "large", "loop"])
def test_open_special_file_raises(tmp_path: Path, opened: Any, kind: str) -> None:
    file = tmp_path / ("n" * 300 if kind == "long" else "file")
    if kind == "fifo":
        os.mkfifo(file)
    elif kind == "zero":
        file.symlink_to("/dev/zero")
    elif kind == "loop":
        file.symlink_to(file)
    elif kind == "large":
        with file.open("wb") as sparse:
            sparse.truncate(2**40)
    with pytest.raises(InvalidInput, match="expected a skill"):
        opened(file)


def trained_model() -> online.OnlineModel:
    settings = online.DPMPPCA(0.5, 0.1, 1e-3, 1.0)
    x = np.random.default_rng(0).normal(size=(50, 1, 2))
    model = online.online_model(settings, Layout((Part("place", Quantity.SCALAR, 2, "m"),)), 0.1)
    return online.observe_stream(model, x)[0]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda h: h.update(period=1e308), "period is"),
        (lambda h: h.update(frames=["\ud800"]), "frames 0 is"),
        (lambda h: h["layout"][0].update(derivative=10**10), "derivative"),
        (lambda h: h["layout"][0].update(size=10**8), "size"),
        (lambda h: h["layout"][0].update(unit="\x1b[2J"), "unit"),
        (lambda h: h["settings"]["maintenance"].update(batch=10**9), "batch is 1000000000"),
        (lambda h: h["settings"]["maintenance"].update(max_clusters=10**6), "max_clusters is 1000000"),
        (
            lambda h: h["settings"]["maintenance"].update(extra_directions=10**6),
            "extra_directions is 1000000",
        ),
        (lambda h: h["settings"].update(kind="\x1b" * 1000), "learner is"),
    ],
    ids=[
        "period",
        "frames",
        "derivative",
        "size",
        "unit",
        "batch",
        "max_clusters",
        "extra_directions",
        "kind",
    ],
)
def test_decode_stream_values_out_of_bounds_raise(change: Any, message: str) -> None:
    header, arrays = split_container(encode_stream(trained_model()))
    change(header)
    assert_rejected(with_hash(header, arrays), message, decode_stream)
