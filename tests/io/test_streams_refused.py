"""Files of growing models that no stream could have left: refused in words, whatever they hold."""

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
from pilotfish.kernels import ClusterColumn
from pilotfish.models import online

Header = dict[str, Any]
Arrays = dict[str, np.ndarray]
LAYOUT = Layout((Part("place", Quantity.POSITION, 2, "m"), Part("grip ∆", Quantity.SCALAR, 1, "1")))
WEIGHTINGS = [online.DatapointCount(), online.ExponentialDecay(0.97, 0.2), online.ConstantWeight(20.0)]


def walk(seed: int, n: int) -> np.ndarray:
    """Datapoints that come by the same places again and again, as two frames see them."""
    rng, t = np.random.default_rng(seed), np.arange(n) / 9.0
    x = np.stack([np.cos(t), np.sin(t), 0.3 * np.sin(2 * t)], axis=1) + 0.05 * rng.normal(size=(n, 3))
    return np.stack([x, 0.5 - x], axis=1)


def stream_bytes(weighting: online.Weighting = WEIGHTINGS[0]) -> bytes:
    """That of a model that has met two demonstrations, the second going on."""
    maintenance = online.Maintenance(weighting)
    model = online.online_model(
        online.SOSC(0.6, 0.02, 0.01, 2.0, 0.01, 0.02, maintenance), LAYOUT, 0.02, ("world", "cup")
    )
    for part in np.array_split(walk(0, 60), 2):
        model, _ = online.observe_stream(online.begin_demonstration(model), part)
    return encode_stream(model)


FILES = [stream_bytes(weighting) for weighting in WEIGHTINGS]


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5) | st.just(10**4000),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=5,
)


@given(st.data())
@settings(max_examples=300)
def test_any_json_anywhere_in_the_header_is_refused_or_means_what_it_says(data: st.DataObject):
    """With a right hash too, no header makes decoding fail in another way; what opens can be saved."""
    header, arrays = split_container(data.draw(st.sampled_from(FILES)))
    if data.draw(st.booleans()):
        arrays = empty(arrays)
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


def empty(arrays: Arrays) -> Arrays:
    """Those of a model before its first datapoint."""
    none = {name: array[:0].copy() for name, array in arrays.items()}
    return none | {"head": np.array([-1.0, 0, 0, 0, -1.0, 0]), "counts": np.empty((0, 0))}


NUMBERS = st.sampled_from([math.nan, math.inf, -1.0, -1e-300, 0.0, 0.5, 1.0, 2.0, 7.0, 1e16, 1e300, -1e300])


@given(place=st.floats(0.0, 1.0, exclude_max=True), value=NUMBERS, data=st.sampled_from(FILES))
@settings(max_examples=300)
def test_any_number_anywhere_is_refused_or_harmless(place: float, value: float, data: bytes):
    """With a right hash too: what opens learns the next datapoints and reads out without a fault."""
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
    assert np.isfinite(after.state.clusters).all()
    online.to_skill(after)


def set_value(name: str, place: tuple[int, ...], value: float) -> Callable[[Any, Any], None]:
    """An edit of one number of an array."""

    def edit(_: Any, arrays: Any) -> None:
        arrays[name][place] = value

    return edit


def maintenance(**values: Any) -> Callable[[Any, Any], None]:
    return lambda header, _: header["settings"]["maintenance"].update(values)


C = ClusterColumn
# What is wrong, words of the refusal, and the edit that makes it so; sosc with count, spare 1, of 3 columns.
REFUSED: dict[str, tuple[str, Callable[[Any, Any], None]]] = {
    "another format": ("expected 'pilotfish-stream'", lambda h, _: h.update(format="other")),
    "a skill's format": ("it is a skill: open_skill", lambda h, _: h.update(format="pilotfish-skill")),
    "a newer version": (r"newer pilotfish \(format 2.*upgrade", lambda h, _: h.update(version=2)),
    "an unknown learner": ("'levy'", lambda h, _: h["settings"].update(kind="levy")),
    "an unknown weighting": ("'levy'", maintenance(weighting={"kind": "levy"})),
    "a discount of one": (
        "discount is 1.0",
        maintenance(weighting={"kind": "exponential-decay", "discount": 1.0, "forget_below": 0.0}),
    ),
    "a negative penalty": ("cluster is -1.0", lambda h, _: h["settings"].update(cluster=-1.0)),
    "a missing penalty": ("lacks 'noise'", lambda h, _: h["settings"].pop("noise")),
    "another penalty": ("expected nothing more", lambda h, _: h["settings"].update(colour=1.0)),
    "a batch of none": ("batch is 0", maintenance(batch=0)),
    "a batch beyond all": ("batch is 2147483648", maintenance(batch=2**31)),
    "a text for a number": ("expected int", maintenance(extra_directions="1")),
    "another upkeep": ("expected nothing more", maintenance(colour=1.0)),
    "a negative merge distance": ("merge_distance is -1.0", maintenance(merge_distance=-1.0)),
    "no period": ("period is nan", lambda h, _: h.update(period=None)),
    "another key": ("expected nothing more", lambda h, _: h.update(colour="red")),
    "another array": ("expected nothing more", lambda _, a: a.update(other=np.zeros(3))),
    "a missing array": ("lacks 'counts'", lambda _, a: a.pop("counts")),
    "a frame too few": ("dimensions has shape", lambda h, _: h["frames"].pop()),
    "two frames of one name": ("different names", lambda h, _: h.update(frames=["a", "a"])),
    "an orientation on its sphere": (
        "on their sphere",
        lambda h, a: (
            h.update(
                layout=[{"name": "o", "quantity": "orientation", "size": 4, "unit": "1", "derivative": 0}]
            ),
            a.update(empty(a) | {"means": np.empty((0, 2, 4)), "bases": np.empty((0, 2, 4, 4))}),
        ),
    ),
    "a variance too few": (
        "variances has shape",
        lambda _, a: a.update(variances=a["variances"][..., 1:].copy()),
    ),
    "a row too few of counts": ("counts has shape", lambda _, a: a.update(counts=a["counts"][1:].copy())),
    "a flat head": ("head has shape", lambda _, a: a.update(head=a["head"][:3].copy())),
    "NaN": (r"clusters\[0, 1\] is nan", set_value("numbers", (0, 1), math.nan)),
    "a current row that is none": ("current row is 99", set_value("head", (0,), 99.0)),
    "half a current row": ("current row is 0.5", set_value("head", (0,), 0.5)),
    "a visit of no step": ("how long it has lasted", set_value("head", (1,), 0.0)),
    "an identity that comes again": ("below the next one, 0", set_value("head", (2,), 0.0)),
    "more datapoints than there were": ("clusters hold 60 datapoints", set_value("head", (3,), 59.0)),
    "an identity twice": ("expected them to rise", set_value("numbers", (1, C.CLUSTER_ID), 0.0)),
    "half an identity": ("cluster id of cluster", set_value("numbers", (0, C.CLUSTER_ID), 0.5)),
    "no weight": ("weight of cluster.*more than 0", set_value("numbers", (0, C.WEIGHT), 0.0)),
    "a cluster without a datapoint": ("at least one", set_value("numbers", (0, C.POINTS), 0.0)),
    "minus one visit": ("segments of cluster", set_value("numbers", (0, C.SEGMENTS), -1.0)),
    "a negative duration": ("duration of cluster", set_value("numbers", (0, C.MEAN_DURATION), -1.0)),
    "a negative variance of durations": (
        "squared deviations of cluster",
        set_value("numbers", (0, C.SQUARED_DEVIATIONS), -1.0),
    ),
    "minus one transition": ("counts", set_value("counts", (0, 0), -1.0)),
    "half a transition": ("counts", set_value("counts", (0, 0), 0.5)),
    "a dimension of all columns": ("dimension", set_value("dimensions", (0, 0), 3.0)),
    "a dimension beyond its directions": ("number of directions", set_value("ranks", (0, 0), 0.0)),
    "half a direction": ("number of directions", set_value("ranks", (0, 0), 1.5)),
    "a mean beyond all": ("mean", set_value("means", (0, 1, 2), 1e200)),
    "a negative variance": ("variance", set_value("variances", (0, 0, 0), -1.0)),
    "a negative distance": ("distance", set_value("distances", (0, 1, 0), -1.0)),
    "a variance beyond its directions": ("variance", set_value("variances", (0, 0, -1), 1.0)),
    "a direction too many": ("direction", set_value("bases", (0, 0, 0, -1), 1e-9)),
    "a direction too long": ("direction", set_value("bases", (0, 0, 0, 0), 1e200)),
    "a direction too short": ("product of directions", lambda _, a: a["bases"].__imul__(0.9)),
}


@pytest.mark.parametrize("what", REFUSED)
def test_what_no_stream_could_have_left_is_refused_though_its_hash_is_right(what: str, tmp_path: Path):
    """Each fault is named, beside the file, in one line."""
    words, edit = REFUSED[what]
    header, arrays = split_container(FILES[0])
    edit(header, arrays)
    (tmp_path / "file").write_bytes(with_hash(header, arrays))
    with pytest.raises(UnreadableFile, match=words) as refusal:
        pf.open_stream(tmp_path / "file")
    assert str(refusal.value).startswith(str(tmp_path / "file"))
    assert "\n" not in str(refusal.value)
