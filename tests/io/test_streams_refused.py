"""Stream files with a valid hash and invalid content are refused with a message."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from container_by_spec import split_container, with_hash
from hypothesis import given, settings
from hypothesis import strategies as st

import pilotfish as pf
from pilotfish.demonstrations import Layout, Part, Quantity
from pilotfish.errors import UnreadableFile
from pilotfish.io.stream_file import decode_stream, encode_stream
from pilotfish.kernels import StreamState
from pilotfish.models import online

Header = dict[str, Any]
Arrays = dict[str, np.ndarray]
LAYOUT = Layout((Part("place", Quantity.POSITION, 2, "m"), Part("grip ∆", Quantity.SCALAR, 1, "1")))
MAINTENANCES = [
    online.Maintenance(),
    online.Maintenance(discount=0.97, forget_below=0.2),
    online.Maintenance(constant_weight=20.0),
]


def walk(seed: int, n: int) -> np.ndarray:
    """Return datapoints of a periodic motion in two frames."""
    rng, t = np.random.default_rng(seed), np.arange(n) / 9.0
    x = np.stack([np.cos(t), np.sin(t), 0.3 * np.sin(2 * t)], axis=1) + 0.05 * rng.normal(size=(n, 3))
    return np.stack([x, 0.5 - x], axis=1)


def stream_bytes(maintenance: online.Maintenance) -> bytes:
    """Return the file of a model in the middle of its second demonstration."""
    model = online.online_model(
        online.SOSC(0.6, 0.02, 0.01, 2.0, 0.01, 0.02, maintenance), LAYOUT, 0.02, ("world", "cup")
    )
    for part in np.array_split(walk(0, 60), 2):
        model, _ = online.observe_stream(online.begin_demonstration(model), part)
    return encode_stream(model)


def scaled_stream_bytes() -> bytes:
    """Return the file of a scaled model with the ends of two demonstrations."""
    learner = online.SOSC(2.4, 0.08, 0.04, 8.0, 0.04, 0.08, scales=(0.5, 0.5, 3.0))
    model = online.online_model(learner, LAYOUT, 0.02, ("world", "cup"))
    frames = [
        pf.demonstrations.frame("world", np.eye(3), np.zeros(3)),
        pf.demonstrations.frame("cup", -np.eye(3), 0.5 * np.ones(3)),
    ]
    for part in np.array_split(walk(0, 60)[:, 0], 2):
        model, _ = online.observe_demonstration(model, pf.demonstration(part, 0.02, LAYOUT, frames))
    return encode_stream(model)


FILES = [*(stream_bytes(maintenance) for maintenance in MAINTENANCES), scaled_stream_bytes()]


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5) | st.just(10**4000),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=5,
)


@given(st.data())
@settings(max_examples=300)
def test_decode_stream_any_json_in_header_is_refused_or_kept(data: st.DataObject):
    """Decoding fails with UnreadableFile only, and what opens encodes to the same header."""
    header, arrays = split_container(data.draw(st.sampled_from(FILES)))
    if data.draw(st.booleans()):
        header, arrays = {**header, "counters": EMPTY_COUNTERS.copy()}, empty(arrays)
    table: Any = header
    while True:
        key = data.draw(st.sampled_from(sorted(table) if isinstance(table, dict) else range(len(table))))
        if not isinstance(table[key], dict | list) or not table[key] or data.draw(st.booleans()):
            break
        table = table[key]
    table[key] = data.draw(JSON)
    try:
        opened = decode_stream(with_hash(header, arrays))
    except UnreadableFile:
        return
    again, _ = split_container(encode_stream(opened))
    assert {k: v for k, v in again.items() if k != "content"} == {
        k: v for k, v in header.items() if k != "content"
    }


EMPTY_COUNTERS = StreamState.empty(2, 3).to_counters()


def empty(arrays: Arrays) -> Arrays:
    """Return the arrays of a model before its first datapoint."""
    none = {name: array[:0].copy() for name, array in arrays.items()}
    return none | {"transition_counts": np.empty((0, 0))}


NUMBERS = st.sampled_from([math.nan, math.inf, -1.0, -1e-300, 0.0, 0.5, 1.0, 2.0, 7.0, 1e16, 1e300, -1e300])


@given(place=st.floats(0.0, 1.0, exclude_max=True), value=NUMBERS, data=st.sampled_from(FILES))
@settings(max_examples=300)
def test_decode_stream_any_number_in_arrays_is_refused_or_usable(place: float, value: float, data: bytes):
    """A model that opens can observe datapoints and be converted to a skill."""
    header, arrays = split_container(data)
    sizes = np.cumsum([arrays[name].size for name in sorted(arrays)])
    flat = int(place * sizes[-1])
    n = int(np.searchsorted(sizes, flat, side="right"))
    name = sorted(arrays)[n]
    arrays[name].flat[flat - (sizes[n - 1] if n else 0)] = value
    try:
        opened = decode_stream(with_hash(header, arrays))
    except UnreadableFile:
        return
    after, _ = online.observe_stream(opened, walk(2, 5))
    assert np.isfinite(after.state.rows).all()
    online.to_skill(after)


def set_value(name: str, place: tuple[int, ...], value: float) -> Callable[[Any, Any], None]:
    """Return an edit of one number of an array."""

    def edit(_: Any, arrays: Any) -> None:
        arrays[name][place] = value

    return edit


def set_counter(**values: int) -> Callable[[Any, Any], None]:
    return lambda header, _: header["counters"].update(values)


def maintenance(**values: Any) -> Callable[[Any, Any], None]:
    return lambda header, _: header["settings"]["maintenance"].update(values)


def ends(**changed: np.ndarray) -> Arrays:
    """Return the ends of one demonstration, with changes."""
    scatter = np.zeros((2, 2, 3, 3))
    return {
        "end_counts": np.ones((2, 2)),
        "end_means": np.zeros((2, 2, 3)),
        "end_scatter_matrices": scatter,
    } | changed


# Fault, text of the message, and edit; of a SOSC model with default maintenance and three columns.
REFUSED: dict[str, tuple[str, Callable[[Any, Any], None]]] = {
    "another format": ("expected 'pilotfish-stream'", lambda h, _: h.update(format="other")),
    "a skill's format": (
        "it is a skill: read it with open_skill",
        lambda h, _: h.update(format="pilotfish-skill"),
    ),
    "a newer version": (r"newer version \(format 4.*upgrade", lambda h, _: h.update(version=4)),
    "scales of another width": ("1 scales, expected 3", lambda h, _: h["settings"].update(scales=[1.0])),
    "a scale of 0": (r"scales\[1\] is 0", lambda h, _: h["settings"].update(scales=[1.0, 0.0, 1.0])),
    "scales that are no list": ("a list of numbers, or null", lambda h, _: h["settings"].update(scales=2.0)),
    "a scale that is text": (r"settings.scales\[0\]", lambda h, _: h["settings"].update(scales=["a"] * 3)),
    "an unknown learner": ("'levy'", lambda h, _: h["settings"].update(kind="levy")),
    "an unknown weighting": ("at most one of them", maintenance(discount=0.5, constant_weight=2.0)),
    "a discount of one": ("discount is 1.0", maintenance(discount=1.0)),
    "a negative penalty": ("cluster is -1.0", lambda h, _: h["settings"].update(cluster=-1.0)),
    "a missing penalty": ("lacks 'noise'", lambda h, _: h["settings"].pop("noise")),
    "another penalty": ("unknown fields", lambda h, _: h["settings"].update(colour=1.0)),
    "a batch of none": ("batch is 0", maintenance(batch=0)),
    "a batch beyond all": ("batch is 2147483648", maintenance(batch=2**31)),
    "a text for a number": ("expected int", maintenance(extra_directions="1")),
    "another maintenance field": ("unknown fields", maintenance(colour=1.0)),
    "a negative merge distance": ("merge_distance is -1.0", maintenance(merge_distance=-1.0)),
    "no period": ("period is nan", lambda h, _: h.update(period=None)),
    "another key": ("unknown fields", lambda h, _: h.update(colour="red")),
    "another array": ("unknown fields", lambda _, a: a.update(other=np.zeros(3))),
    "a missing array": ("lacks 'segments'", lambda _, a: a.pop("segments")),
    "a frame too few": ("dimensions has shape", lambda h, _: h["frames"].pop()),
    "two frames of one name": ("no duplicates", lambda h, _: h.update(frames=["a", "a"])),
    "an orientation on S^3": (
        "orientations on S",
        lambda h, a: (
            h.update(
                layout=[{"name": "o", "quantity": "orientation", "size": 4, "unit": "1", "derivative": 0}]
            ),
            h.update(counters=EMPTY_COUNTERS),
            a.update(empty(a) | {"means": np.empty((0, 2, 4)), "bases": np.empty((0, 2, 4, 4))}),
        ),
    ),
    "a variance too few": (
        "variances has shape",
        lambda _, a: a.update(variances=a["variances"][..., 1:].copy()),
    ),
    "a missing row of counts": (
        "transition_counts has shape",
        lambda _, a: a.update(transition_counts=a["transition_counts"][1:].copy()),
    ),
    "a missing counter": ("lacks 'datapoints'", lambda h, _: h["counters"].pop("datapoints")),
    "NaN": (r"weights\[0\] is nan", set_value("weights", (0,), math.nan)),
    "a current cluster that does not exist": ("current_cluster is 99", set_counter(current_cluster=99)),
    "half a current cluster": ("current_cluster is 0.5", set_counter(current_cluster=0.5)),
    "a segment without a step": ("steps_in_cluster is 0", set_counter(steps_in_cluster=0)),
    "a next identifier that is used": ("below next_cluster_id, 0", set_counter(next_cluster_id=0)),
    "more datapoints than there were": ("clusters have 60 datapoints", set_counter(datapoints=59)),
    "an identifier twice": ("expected increasing", set_value("cluster_ids", (1,), 0.0)),
    "half an identifier": ("cluster_ids", set_value("cluster_ids", (0,), 0.5)),
    "no weight": ("weights.*more than 0", set_value("weights", (0,), 0.0)),
    "a cluster without a datapoint": ("at least one", set_value("points", (0,), 0.0)),
    "minus one segment": ("segments", set_value("segments", (0,), -1.0)),
    "a negative duration": ("mean_durations", set_value("mean_durations", (0,), -1.0)),
    "a negative variance of durations": ("squared_deviations", set_value("squared_deviations", (0,), -1.0)),
    "minus one transition": ("transition_counts", set_value("transition_counts", (0, 0), -1.0)),
    "half a transition": ("transition_counts", set_value("transition_counts", (0, 0), 0.5)),
    "a dimension of all columns": ("dimension", set_value("dimensions", (0, 0), 3.0)),
    "a dimension beyond its directions": ("ranks", set_value("ranks", (0, 0), 0.0)),
    "half a direction": ("ranks", set_value("ranks", (0, 0), 1.5)),
    "a mean beyond all": ("mean", set_value("means", (0, 1, 2), 1e200)),
    "a negative variance": ("variance", set_value("variances", (0, 0, 0), -1.0)),
    "a negative distance": ("distance", set_value("distances", (0, 1, 0), -1.0)),
    "a variance beyond its directions": ("variance", set_value("variances", (0, 0, -1), 1.0)),
    "a direction too many": ("bases", set_value("bases", (0, 0, 0, -1), 1e-9)),
    "a direction too long": ("bases", set_value("bases", (0, 0, 0, 0), 1e200)),
    "ends of another shape": ("end_means has shape", lambda _, a: a.update(ends(end_means=np.zeros((2, 3))))),
    "a missing array of the ends": (
        "lacks 'end_counts'",
        lambda _, a: a.update(end_means=np.zeros((2, 2, 3))),
    ),
    "half an end": ("end_counts", lambda _, a: a.update(ends(end_counts=np.full((2, 2), 1.5)))),
    "an end of no demonstration": ("end_counts", lambda _, a: a.update(ends(end_counts=np.zeros((2, 2))))),
    "an end beyond all": ("end_means", lambda _, a: a.update(ends(end_means=np.full((2, 2, 3), 1e200)))),
    "an end that is NaN": ("end_means", lambda _, a: a.update(ends(end_means=np.full((2, 2, 3), np.nan)))),
    "a negative variance of ends": (
        "end_scatter_matrices",
        lambda _, a: a.update(ends(end_scatter_matrices=np.tile(-np.eye(3), (2, 2, 1, 1)))),
    ),
    "a direction too short": ("products of bases", lambda _, a: a["bases"].__imul__(0.9)),
}


@pytest.mark.parametrize("what", REFUSED)
def test_open_stream_invalid_content_is_refused(what: str, tmp_path: Path):
    """The message names the fault and the file, in one line."""
    words, edit = REFUSED[what]
    header, arrays = split_container(FILES[0])
    edit(header, arrays)
    (tmp_path / "file").write_bytes(with_hash(header, arrays))
    with pytest.raises(UnreadableFile, match=words) as refusal:
        pf.io.open_stream(tmp_path / "file")
    assert str(refusal.value).startswith(str(tmp_path / "file"))
    assert "\n" not in str(refusal.value)
