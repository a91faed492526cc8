"""Growing models in files: opened, they go on as if never away; nothing damaged comes through."""

import json
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from container_by_spec import documented_hash, split_container
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
        online.ExponentialDecay(0.97, 0.2), merge_distance=0.3, extra_directions=2, max_clusters=5
    ),
    "constant": online.Maintenance(
        online.ConstantWeight(20.0), merge_distance=0.0, extra_directions=0, batch=7
    ),
}
ARRAYS = {"head", "counts", "numbers", "dimensions", "ranks"}
ARRAYS |= {"means", "variances", "distances", "bases"}
Header = dict[str, Any]
Arrays = dict[str, np.ndarray]
LEARNER_TYPES: dict[str, Callable[[online.Maintenance], online.OnlineSettings]] = {
    "dp-gmm": lambda maintenance: online.DPGMM(0.6, 0.01, maintenance),
    "dp-mppca": lambda maintenance: online.DPMPPCA(0.6, 0.02, 0.01, 2.0, maintenance),
    "hdp-hsmm": lambda maintenance: online.HDPHSMM(0.6, 0.01, 0.01, 0.02, maintenance),
    "sosc": lambda maintenance: online.SOSC(0.6, 0.02, 0.01, 2.0, 0.01, 0.02, maintenance),
}
KINDS = [(learner, maintenance) for learner in LEARNER_TYPES for maintenance in MAINTENANCES]
LAYOUT = Layout((Part("place", Quantity.POSITION, 2, "m"), Part("grip ∆", Quantity.SCALAR, 1, "1")))
FRAMES = ("world", "cup")


def walk(seed: int, n: int) -> np.ndarray:
    """Datapoints that come by the same places again and again, as two frames see them."""
    rng, t = np.random.default_rng(seed), np.arange(n) / 9.0
    x = np.stack([np.cos(t), np.sin(t), 0.3 * np.sin(2 * t)], axis=1) + 0.05 * rng.normal(size=(n, 3))
    return np.stack([x, 0.5 - x], axis=1)


@cache
def trained_model(learner: str, maintenance: str, seed: int = 0, n: int = 60) -> online.OnlineModel:
    """One that has met two demonstrations, the second going on."""
    model = online.online_model(LEARNER_TYPES[learner](MAINTENANCES[maintenance]), LAYOUT, 0.02, FRAMES)
    for part in np.array_split(walk(seed, n), 2):
        model, _ = online.observe_stream(online.begin_demonstration(model), part)
    return model


def models_equal(one: online.OnlineModel, other: online.OnlineModel) -> bool:
    """Equal to the last bit."""
    arrays = all(
        getattr(one.state, name).tobytes() == getattr(other.state, name).tobytes()
        and getattr(one.state, name).shape == getattr(other.state, name).shape
        for name in ("head", "clusters", "transition_counts")
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
    return arrays and plain[0] == plain[1]


def opens_the_same_or_is_refused(data: bytes, model: online.OnlineModel) -> bool:
    """True when it was refused. Anything but a refusal or the same model fails."""
    try:
        opened = decode_stream(data)
    except UnreadableFile:
        return True
    assert models_equal(opened, model)
    return False


@pytest.mark.parametrize(("learner", "maintenance"), KINDS)
def test_what_was_saved_is_what_is_opened_and_it_goes_on_bit_for_bit(
    learner: str, maintenance: str, tmp_path: Path
):
    """For every learner and weighting the next datapoints make the same of both, and of both files."""
    model = trained_model(learner, maintenance)
    pf.save_stream(model, tmp_path / "model.stream")
    opened = pf.open_stream(tmp_path / "model.stream")
    assert models_equal(opened, model)
    assert encode_stream(opened) == (tmp_path / "model.stream").read_bytes() == encode_stream(model)
    after, went = online.observe_stream(model, walk(1, 25))
    again, went_again = online.observe_stream(opened, walk(1, 25))
    assert models_equal(again, after)
    np.testing.assert_array_equal(went_again.costs, went.costs)
    assert encode_stream(again) == encode_stream(after)


@pytest.mark.parametrize(("learner", "maintenance"), KINDS)
def test_a_model_before_its_first_datapoint_saves_and_opens(learner: str, maintenance: str):
    """Arrays of no cluster are empty, and they are arrays all the same."""
    empty = online.online_model(LEARNER_TYPES[learner](MAINTENANCES[maintenance]), LAYOUT, 0.02, FRAMES)
    opened = decode_stream(encode_stream(empty))
    assert models_equal(opened, empty)
    assert models_equal(*(online.observe_stream(model, walk(0, 10))[0] for model in (opened, empty)))


def test_a_model_that_began_with_a_batch_saves_and_opens(rng: np.random.Generator):
    """There subspaces have more room than any of them needs yet."""
    layout = position_layout(2).differentiate()
    shown = [
        pf.demonstration(np.cumsum(rng.normal(size=(40, 4)), axis=0), 0.1, layout, name=f"{m}")
        for m in range(2)
    ]
    skill = pf.learn(shown, states=3, rng=rng).skill
    model = online.from_batch_fit(skill, shown, online.estimate_penalties(skill, shown))
    assert models_equal(decode_stream(encode_stream(model)), model)
    after, _ = online.observe_demonstration(model, shown[0])
    assert models_equal(decode_stream(encode_stream(after)), after)


def test_trace_weights_that_wore_off_to_nothing_are_kept():
    """After long enough a weight that nothing renews is 0 in floating point; that is no damage."""
    model = online.online_model(
        online.DPGMM(1.0, 0.1, online.Maintenance(online.ExponentialDecay(0.1))), LAYOUT, 0.02, FRAMES
    )
    model, _ = online.observe_stream(model, np.concatenate([np.full((1, 2, 3), 9.0), np.zeros((400, 2, 3))]))
    assert model.weights.min() == 0.0
    assert models_equal(decode_stream(encode_stream(model)), model)


def test_the_hash_is_the_documented_one():
    """A reader that has only docs/stream-file.md finds the hash that stands in the file."""
    for learner, maintenance in KINDS:
        header, arrays = split_container(encode_stream(trained_model(learner, maintenance)))
        assert header["content"] == documented_hash(header, arrays)
        assert header["format"] == "pilotfish-stream"
        assert header["settings"]["kind"] == learner
        assert header["settings"]["maintenance"]["weighting"]["kind"] == maintenance
        assert set(arrays) == ARRAYS


@given(kind=st.sampled_from(KINDS), place=st.floats(0.0, 1.0, exclude_max=True), flip=st.integers(1, 255))
@settings(max_examples=200)
def test_a_changed_byte_never_opens_as_another_model(kind: tuple[str, str], place: float, flip: int):
    """Whichever byte is hit, the file is refused as UnknownSkill or holds the model still."""
    model = trained_model(*kind)
    data = bytearray(encode_stream(model))
    data[int(place * len(data))] ^= flip
    opens_the_same_or_is_refused(bytes(data), model)


def test_a_truncated_or_lengthened_file_is_refused():
    """However much is missing or too much."""
    model = trained_model("sosc", "exponential-decay")
    data = encode_stream(model)
    for length in [*range(0, len(data), 131), len(data) - 1]:
        assert opens_the_same_or_is_refused(data[:length], model)
    for more in (b"\0", data):
        assert opens_the_same_or_is_refused(data + more, model)


@given(data=st.binary(max_size=200))
def test_noise_is_refused(data: bytes):
    """No bytes make decoding fail in another way than by UnknownSkill."""
    with pytest.raises(UnreadableFile):
        decode_stream(data)


def test_an_altered_file_is_called_altered():
    """A number changed by hand, its hash left as it was."""
    header, arrays = split_container(encode_stream(trained_model("sosc", "count")))
    with pytest.raises(UnreadableFile, match="the file was altered"):
        decode_stream(bytes(save(arrays, {"pilotfish": json.dumps({**header, "period": 9.0})})))


def with_arrays(model: online.OnlineModel, **arrays: Any) -> online.OnlineModel:
    state: StreamState = replace(model.state, **arrays)
    return replace(model, state=state)


def test_nothing_is_written_that_could_not_be_opened(tmp_path: Path):
    """A model whose numbers are none is refused by the door it leaves by."""
    model = trained_model("sosc", "count")
    with pytest.raises(InvalidInput, match="counts"):
        pf.save_stream(with_arrays(model, transition_counts=-model.transition_counts), tmp_path / "file")
    assert not list(tmp_path.iterdir())


def test_skills_and_streams_are_told_apart(tmp_path: Path):
    """Each door refuses the other's file and names the remedy; one door opens both."""
    model = trained_model("sosc", "count")
    pf.save_stream(model, tmp_path / "stream")
    pf.save_skill(online.to_skill(model), tmp_path / "skill")
    with pytest.raises(UnreadableFile, match=r"stream: .*'pilotfish-stream'.*--resume FILE --skill"):
        pf.open_skill(tmp_path / "stream")
    with pytest.raises(UnreadableFile, match=r"skill: .*'pilotfish-skill'.*open_skill"):
        pf.open_stream(tmp_path / "skill")
    assert isinstance(load_any(tmp_path / "skill"), pf.Skill)
    assert isinstance(load_any(tmp_path / "stream"), online.OnlineModel)


def test_a_file_that_is_not_there_is_named(tmp_path: Path):
    """And so is a folder: each with what was expected."""
    for place in (tmp_path / "none", tmp_path):
        with pytest.raises(InvalidInput, match="expected a stream file"):
            pf.open_stream(place)


def test_the_program_of_the_docs_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Kept after one datapoint, gone on with at the next."""
    monkeypatch.chdir(tmp_path)
    text = (Path(__file__).parents[2] / "docs" / "stream-file.md").read_text(encoding="utf-8")
    names: dict[str, Any] = {}
    exec("\n".join(re.findall(r"```python\n(.*?)```", text, re.DOTALL)), names)  # noqa: S102 - our own text
    assert names["model"].datapoints == 2
    assert pf.open_stream("now.stream").datapoints == 1
