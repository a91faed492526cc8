"""Inputs found by fuzzing that once caused something other than a one-line error."""

import io
import tracemalloc
from pathlib import Path
from time import process_time
from typing import Any

import click
import numpy as np
import pytest
from annotations import check_annotations
from fuzzing.campaign import MAX_SECONDS
from fuzzing.containers import container_writer, parse_container
from fuzzing.public_examples import examples, function_named
from fuzzing.seeds import streams
from fuzzing.soundness import require_sound_refusal
from fuzzing.targets import TARGETS
from scipy.io import savemat

from pilotfish.errors import InvalidInput, SkillError, UnreadableFile
from pilotfish.io.container_format import STREAM_FORMAT
from pilotfish.io.published_matlab import read_zshape_mat
from pilotfish.io.stream_file import decode_stream, encode_stream
from pilotfish.models.durations import Gaussian

# Function, one of its arguments, and a value that it must refuse.
CALLS: list[tuple[str, str, Any]] = [
    ("demonstrations.demonstration", "layout", "pose"),
    ("demonstrations.demonstration", "frames", 3),
    ("demonstrations.unwrap_orientations", "layout", True),
    ("models.online.observe", "model", "a model"),
    ("models.online.observe", "x", np.array(["0.1", "0.2"])),
    ("models.online.observe", "x", np.array([True, False])),
    ("models.online.observe_stream", "model", []),
    ("models.online.observe_stream", "x", np.full((3, 2), 1j)),
    ("models.online.observe_stream", "x", np.ma.masked_array(np.ones((3, 2)), True)),
    ("models.online.observe_demonstration", "model", None),
    ("planning.plan", "start", np.array(["a", "b", "c", "d"])),
    ("planning.plan_states", "start", np.full(4, None)),
    ("models.online.online_model", "frame_names", 0.5),
    ("models.learn", "settings", 0.5),
    ("models.learn", "settings", "few"),
    ("planning.via_point", "name", "posi\ud800tion"),
    ("planning.tangent_chart", "base_pose", np.zeros(13, "M8[s]")),
]


@pytest.mark.parametrize(("name", "argument", "value"), CALLS)
def test_function_invalid_argument_raises_one_line(name: str, argument: str, value: Any) -> None:
    """Annotations are not checked, as outside the tests."""
    given = examples(name.rpartition(".")[0])[name]
    assert argument in given
    with check_annotations(False), pytest.raises(SkillError) as refusal:
        function_named(name)(**{**given, argument: value})
    require_sound_refusal(refusal.value)


LONG = "9" * 50_000
TEXTS: list[tuple[str, str]] = [
    ("via", f"position={LONG}@1s+-1"),
    ("via", f"position=1,{'x' * 50_000}@1s+-1"),
    ("via", "position" * 5_000 + "=1@1s+-1"),
    ("via", "posi\rtion=1@1s+-1"),
    ("via", "position=1,2,\ud800@1s+-1"),
    ("only", ",".join(["0-999999"] * 500)),
    ("only", ",".join(["0"] * 50_000)),
    ("only", LONG),
    ("structure", f"mfa:{LONG}"),
    ("structure", "mfa:99999999999999999999"),
    ("structure", "hddc:" + "1" * 4000),
    ("structure", f"semi-tied:{LONG}"),
    ("structure", "mlt:0\x1b[2J"),
    ("states", ",".join(f"{n}:99999" for n in range(1, 5_000))),
    ("states", f"3;{'full,' * 20_000};markov"),
    ("states", f"3;full;{LONG}"),
]


@pytest.mark.usefixtures("unchecked")
@pytest.mark.parametrize(("option", "text"), TEXTS, ids=lambda text: text[:20])
def test_option_invalid_text_raises_one_line_quickly(option: str, text: str) -> None:
    """Ranges were once expanded and compared in pairs before their bounds were checked."""
    read = TARGETS[option][0]().read
    start_time = process_time()
    with pytest.raises((SkillError, click.UsageError)) as refusal:
        read(text)
    assert process_time() - start_time < MAX_SECONDS
    error = refusal.value
    require_sound_refusal(error, error.format_message() if isinstance(error, click.UsageError) else None)


@pytest.mark.parametrize("deviation", [1e5, 6.4e5, 3e6, 1e7])
def test_log_table_millions_of_steps_takes_little_memory(deviation: float) -> None:
    """A skill file of 1.5 kB once made its reader store 8 million steps."""
    durations = Gaussian(np.full(3, 5.0), np.full(3, deviation))
    tracemalloc.start()
    try:
        assert np.isfinite(durations.log_table(1)).all()
        assert tracemalloc.get_traced_memory()[1] < 150 * 2**20
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("length", [2**20, 2**31, 2**32 - 1])
def test_read_zshape_mat_element_longer_than_file_raises(length: int, tmp_path: Path) -> None:
    """SciPy reserves the stated length."""
    file = io.BytesIO()
    savemat(file, {"Data": np.ones((4, 1500))})
    data = bytearray(file.getvalue())
    data[132:136] = length.to_bytes(4, "little")  # of the matrix, after the header and its kind
    (tmp_path / "x.mat").write_bytes(data)
    with pytest.raises(InvalidInput, match=f"has a stated length of {length} bytes"):
        read_zshape_mat(tmp_path / "x.mat")


def test_decode_stream_scalar_array_raises() -> None:
    header, arrays, damage = parse_container(encode_stream(streams()[0]))
    data = container_writer(STREAM_FORMAT)((header, {**arrays, "points": np.array(1.0)}, damage))
    with pytest.raises(UnreadableFile, match="has shape"):
        decode_stream(data)


@pytest.mark.parametrize(
    "relevance", [np.zeros((2, 2), "M8[s]"), np.full((2, 2), None), np.array([[5e-324, 1.0], [1.0, 1.0]])]
)
def test_adapt_relevance_not_numeric_or_near_zero_raises(relevance: Any) -> None:
    """Dates and objects once reached comparisons, and a division by the tiny value overflowed."""
    given = dict(examples("models")["models.adapt"])
    shape = (len(given["skill"].frame_names), given["skill"].states)
    with check_annotations(False), pytest.raises(InvalidInput, match="relevance"):
        function_named("models.adapt")(**{**given, "relevance": np.resize(relevance, shape)})
