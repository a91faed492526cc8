"""Files of online models: they continue to the last bit, and damaged files are refused."""

import json
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from container_by_spec import documented_hash, split_container, with_hash
from hypothesis import given, settings
from hypothesis import strategies as st
from safetensors.numpy import save

import pilotfish as pf
from pilotfish.demonstrations import Layout, Part, Quantity, position_layout
from pilotfish.errors import InvalidInput, UnreadableFile
from pilotfish.io.stream_file import decode_stream, encode_stream, load_any
from pilotfish.kernels import StreamState
from pilotfish.models import online

MAINTENANCES = {
    "count": online.Maintenance(),
    "exponential-decay": online.Maintenance(
        discount=0.97, forget_below=0.2, merge_distance=0.3, extra_directions=2, max_clusters=5
    ),
    "constant": online.Maintenance(constant_weight=20.0, merge_distance=0.0, extra_directions=0, batch=7),
}
ARRAYS = {"cluster_ids", "weights", "points", "demonstration_starts", "segments", "mean_durations"}
ARRAYS |= {"squared_deviations", "censored", "mean_censored_durations", "transition_counts"}
ARRAYS |= {"dimensions", "ranks", "means", "variances", "distances", "bases"}
COUNTERS = {"current_cluster", "steps_in_cluster", "next_cluster_id", "datapoints"}
COUNTERS |= {"previous_cluster", "previous_steps"}
Header = dict[str, Any]
Arrays = dict[str, np.ndarray]
SCALES = (0.5, 0.25, 3.0)
LEARNER_TYPES: dict[str, Callable[[online.Maintenance], online.OnlineSettings]] = {
    "dp-gmm": lambda maintenance: online.DPGMM(0.6, 0.01, maintenance),
    "dp-mppca": lambda maintenance: online.DPMPPCA(0.6, 0.02, 0.01, 2.0, maintenance),
    "hdp-hsmm": lambda maintenance: online.HDPHSMM(0.6, 0.01, 0.01, 0.02, maintenance),
    "sosc": lambda maintenance: online.SOSC(0.6, 0.02, 0.01, 2.0, 0.01, 0.02, maintenance),
    "scaled sosc": lambda maintenance: online.SOSC(
        2.4, 0.08, 0.04, 8.0, 0.04, 0.08, maintenance, scales=SCALES
    ),
}
KINDS = [(learner, maintenance) for learner in LEARNER_TYPES for maintenance in MAINTENANCES]
LAYOUT = Layout((Part("place", Quantity.POSITION, 2, "m"), Part("grip ∆", Quantity.SCALAR, 1, "1")))
FRAMES = ("world", "cup")


def walk(seed: int, n: int) -> np.ndarray:
    """Return datapoints of a periodic motion in two frames."""
    rng, t = np.random.default_rng(seed), np.arange(n) / 9.0
    x = np.stack([np.cos(t), np.sin(t), 0.3 * np.sin(2 * t)], axis=1) + 0.05 * rng.normal(size=(n, 3))
    return np.stack([x, 0.5 - x], axis=1)


@cache
def trained_model(learner: str, maintenance: str, seed: int = 0, n: int = 60) -> online.OnlineModel:
    """Return a model in the middle of its second demonstration."""
    model = online.online_model(LEARNER_TYPES[learner](MAINTENANCES[maintenance]), LAYOUT, 0.02, FRAMES)
    for part in np.array_split(walk(seed, n), 2):
        model, _ = online.observe_stream(online.begin_demonstration(model), part)
    return model


def models_equal(one: online.OnlineModel, other: online.OnlineModel) -> bool:
    """Return whether two models are equal to the last bit."""
    arrays = all(
        getattr(one.state, name).tobytes() == getattr(other.state, name).tobytes()
        and getattr(one.state, name).shape == getattr(other.state, name).shape
        for name in ("counters", "rows", "transition_counts")
    )
    plain = [
        (
            m.settings,
            m.layout,
            m.period,
            m.frame_names,
            m.parameters,
            m.state.frames,
            m.state.width,
            m.state.capacity,
        )
        for m in (one, other)
    ]
    ends = [
        [moments.scatter_matrices.tobytes() + moments.means.tobytes() for moments in m.ends]
        for m in (one, other)
    ]
    return arrays and plain[0] == plain[1] and ends[0] == ends[1]


def is_refused_or_equal(data: bytes, model: online.OnlineModel) -> bool:
    """Return whether the file is refused; fail if it opens as another model."""
    try:
        opened = decode_stream(data)
    except UnreadableFile:
        return True
    assert models_equal(opened, model)
    return False


@pytest.mark.parametrize(("learner", "maintenance"), KINDS)
def test_open_stream_saved_model_continues_bit_for_bit(learner: str, maintenance: str, tmp_path: Path):
    """For every learner and maintenance, both models and both files are equal after further datapoints."""
    model = trained_model(learner, maintenance)
    pf.io.save_stream(model, tmp_path / "model.stream")
    opened = pf.io.open_stream(tmp_path / "model.stream")
    assert models_equal(opened, model)
    assert encode_stream(opened) == (tmp_path / "model.stream").read_bytes() == encode_stream(model)
    after, assignments = online.observe_stream(model, walk(1, 25))
    again, assignments_again = online.observe_stream(opened, walk(1, 25))
    assert models_equal(again, after)
    np.testing.assert_array_equal(assignments_again.costs, assignments.costs)
    assert encode_stream(again) == encode_stream(after)


@pytest.mark.parametrize(("learner", "maintenance"), KINDS)
def test_decode_stream_empty_model_equals_original(learner: str, maintenance: str):
    """A model without clusters has empty arrays."""
    empty = online.online_model(LEARNER_TYPES[learner](MAINTENANCES[maintenance]), LAYOUT, 0.02, FRAMES)
    opened = decode_stream(encode_stream(empty))
    assert models_equal(opened, empty)
    assert models_equal(*(online.observe_stream(model, walk(0, 10))[0] for model in (opened, empty)))


def test_decode_stream_model_from_batch_fit_equals_original(rng: np.random.Generator):
    """Its subspaces have a larger capacity than any of them needs."""
    layout = position_layout(2).differentiate()
    demos = [
        pf.demonstration(np.cumsum(rng.normal(size=(40, 4)), axis=0), 0.1, layout, name=f"{m}")
        for m in range(2)
    ]
    skill = pf.learn(demos, states=3, rng=rng).skill
    model = online.from_batch_fit(skill, demos, online.estimate_penalties(skill, demos))
    assert models_equal(decode_stream(encode_stream(model)), model)
    after, _ = online.observe_demonstration(model, demos[0])
    assert models_equal(decode_stream(encode_stream(after)), after)


def test_decode_stream_underflowed_weight_equals_original():
    """A weight that decays without datapoints becomes 0 in floating point, which is valid."""
    model = online.online_model(
        online.DPGMM(1.0, 0.1, online.Maintenance(discount=0.1)), LAYOUT, 0.02, FRAMES
    )
    model, _ = online.observe_stream(model, np.concatenate([np.full((1, 2, 3), 9.0), np.zeros((400, 2, 3))]))
    assert model.weights.min() == 0.0
    assert models_equal(decode_stream(encode_stream(model)), model)


def test_encode_stream_hash_and_fields_equal_documentation():
    """The hash, counters and arrays are those that docs/stream-file.md specifies."""
    for learner, maintenance in KINDS:
        header, arrays = split_container(encode_stream(trained_model(learner, maintenance)))
        assert header["content"] == documented_hash(header, arrays)
        assert header["format"] == "pilotfish-stream"
        assert header["settings"]["kind"] == learner.removeprefix("scaled ")
        assert header["settings"]["scales"] == (list(SCALES) if learner.startswith("scaled") else None)
        assert header["settings"]["maintenance"]["batch"] == MAINTENANCES[maintenance].batch
        assert set(header["counters"]) == COUNTERS
        assert set(arrays) == ARRAYS


@given(kind=st.sampled_from(KINDS), place=st.floats(0.0, 1.0, exclude_max=True), flip=st.integers(1, 255))
@settings(max_examples=200)
def test_decode_stream_changed_byte_is_refused_or_harmless(kind: tuple[str, str], place: float, flip: int):
    """A file with a changed byte is refused, or gives the same model."""
    model = trained_model(*kind)
    data = bytearray(encode_stream(model))
    data[int(place * len(data))] ^= flip
    is_refused_or_equal(bytes(data), model)


def test_decode_stream_wrong_length_is_refused():
    """Truncated and extended files are refused."""
    model = trained_model("sosc", "exponential-decay")
    data = encode_stream(model)
    for length in [*range(0, len(data), 131), len(data) - 1]:
        assert is_refused_or_equal(data[:length], model)
    for more in (b"\0", data):
        assert is_refused_or_equal(data + more, model)


@given(data=st.binary(max_size=200))
def test_decode_stream_random_bytes_are_refused(data: bytes):
    """Decoding fails with UnreadableFile only."""
    with pytest.raises(UnreadableFile):
        decode_stream(data)


def test_decode_stream_altered_header_is_refused_by_hash():
    """The period is changed, and the hash is not."""
    header, arrays = split_container(encode_stream(trained_model("sosc", "count")))
    with pytest.raises(UnreadableFile, match="the file was altered"):
        decode_stream(bytes(save(arrays, {"pilotfish": json.dumps({**header, "period": 9.0})})))


def with_arrays(model: online.OnlineModel, **arrays: Any) -> online.OnlineModel:
    state: StreamState = replace(model.state, **arrays)
    return replace(model, state=state)


def test_save_stream_invalid_model_is_refused(tmp_path: Path):
    """No file is left behind."""
    model = trained_model("sosc", "count")
    with pytest.raises(InvalidInput, match="counts"):
        pf.io.save_stream(with_arrays(model, transition_counts=-model.transition_counts), tmp_path / "file")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("version", [1, 2])
def test_decode_stream_older_version_is_refused(version: int):
    """The message says to learn again."""
    header, arrays = split_container(encode_stream(trained_model("sosc", "count")))
    with pytest.raises(UnreadableFile, match=rf"older version \(format {version}\); run `pilotfish stream`"):
        decode_stream(with_hash({**header, "version": version}, arrays))


def test_load_any_skill_and_stream_are_distinguished(tmp_path: Path):
    """Each function refuses the file of the other and names the fix; load_any opens both."""
    model = trained_model("sosc", "count")
    pf.io.save_stream(model, tmp_path / "stream")
    pf.save_skill(online.to_skill(model), tmp_path / "skill")
    with pytest.raises(UnreadableFile, match=r"stream: .*'pilotfish-stream'.*--resume FILE --skill"):
        pf.open_skill(tmp_path / "stream")
    with pytest.raises(UnreadableFile, match=r"skill: .*'pilotfish-skill'.*open_skill"):
        pf.io.open_stream(tmp_path / "skill")
    assert isinstance(load_any(tmp_path / "skill"), pf.Skill)
    assert isinstance(load_any(tmp_path / "stream"), online.OnlineModel)


def test_open_stream_missing_file_is_refused(tmp_path: Path):
    """A folder is refused as well; the message says what was expected."""
    for place in (tmp_path / "none", tmp_path):
        with pytest.raises(InvalidInput, match="expected a stream file"):
            pf.io.open_stream(place)


def test_documentation_program_continues_stream(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """The model is saved after one datapoint and continued with the next."""
    monkeypatch.chdir(tmp_path)
    text = (Path(__file__).parents[2] / "docs" / "stream-file.md").read_text(encoding="utf-8")
    names: dict[str, Any] = {}
    exec("\n".join(re.findall(r"```python\n(.*?)```", text, re.DOTALL)), names)  # noqa: S102 - our own text
    assert names["model"].datapoints == 2
    assert pf.io.open_stream("now.stream").datapoints == 1
