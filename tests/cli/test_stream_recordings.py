"""pilotfish stream of recordings: each in turn, as its frames see it, after a batch or from nothing."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import Result

import pilotfish as pf
from pilotfish.cli.options.sources import training_demonstrations
from pilotfish.demonstrations import Demonstration, add_derivatives, moving_frame, position_layout
from pilotfish.io.demonstration_folder import write_demonstrations
from pilotfish.io.stream_file import encode_stream
from pilotfish.models import online

RunCommand = Callable[..., Result]
RunJson = Callable[..., dict[str, Any]]
Refusal = Callable[..., str]

SOSC = [
    "--cluster",
    "0.3",
    "--dimension",
    "0.02",
    "--noise",
    "0.01",
    "--bandwidth",
    "2",
    "--transition",
    "0.01",
]
PENALTIES = online.SOSC(0.3, 0.02, 0.01, 2.0, 0.01)


def models_equal(path: Path, model: online.OnlineModel) -> bool:
    return path.read_bytes() == encode_stream(model)


@pytest.fixture
def rows(tmp_path: Path) -> Path:
    (tmp_path / "rows.csv").write_text("1,2\n1,2.1\n3,4\n")
    return tmp_path / "rows.csv"


def test_recordings_have_their_own_period(run_command_line: RunCommand, folder: Path):
    """So it is misuse to give another."""
    result = run_command_line("stream", folder, "--from-batch", "2", "--period", "1")
    assert (result.exit_code, "--period goes with rows" in result.stderr) == (2, True)


def test_recordings_are_streamed_as_their_frames_see_them(
    run_command_line: RunCommand,
    folder: Path,
    tmp_path: Path,
    reach_demonstrations: tuple[Demonstration, ...],
):
    """The same as observe_demonstration, each in turn."""
    assert run_command_line("stream", folder, *SOSC, "--only", "1-3", "--out", "a.stream").exit_code == 0
    shown = [add_derivatives(demo) for demo in reach_demonstrations[1:4]]
    names = tuple(frame.name for frame in shown[0].frames)
    model = online.online_model(PENALTIES, shown[0].layout, shown[0].period, names)
    for demo in shown:
        model, _ = online.observe_demonstration(model, demo)
    assert models_equal(tmp_path / "a.stream", model)


def test_a_recording_is_cut_where_there_are_datapoints_enough(
    run_command_line: RunCommand, tmp_path: Path, rng: np.random.Generator
):
    """Its moving frames too."""
    layout = position_layout(2)
    turns = np.stack([np.eye(2)] * 9)
    shown = [
        pf.demonstration(
            rng.normal(size=(9, 2)),
            0.1,
            layout,
            [moving_frame("hand", turns, rng.normal(size=(9, 2)))],
            f"{m}",
        )
        for m in range(2)
    ]
    write_demonstrations(shown, tmp_path / "shown")
    assert (
        run_command_line(
            "stream", "shown", "--no-velocities", *SOSC, "--rows", "13", "--out", "a.stream"
        ).exit_code
        == 0
    )
    model = online.online_model(PENALTIES, layout, 0.1, ("hand",))
    model, _ = online.observe_demonstration(model, shown[0])
    frame = moving_frame("hand", turns[:4], shown[1].frames[0].b[:4])
    model, _ = online.observe_demonstration(model, pf.demonstration(shown[1].x[:4], 0.1, layout, [frame]))
    assert models_equal(tmp_path / "a.stream", model)


def test_growth_is_told_after_the_recording_that_holds_a_multiple(
    run_command_line: RunCommand, tmp_path: Path
):
    """A recording is learned as a whole."""
    layout = position_layout(1)
    shown = [pf.demonstration([[0.0], [1.0], [2.0]], 0.1, layout, name=f"{m}") for m in range(3)]
    write_demonstrations(shown, tmp_path / "shown")
    told = run_command_line("stream", "shown", "--no-velocities", *SOSC, "--every", "4").stdout.splitlines()
    assert [line.split()[0] for line in told[:2]] == ["6", "9"]


def test_a_batch_of_recordings_begins_the_model_and_guesses_its_penalties(
    run_command_line: RunCommand,
    folder: Path,
    tmp_path: Path,
    reach_demonstrations: tuple[Demonstration, ...],
):
    """As penalties_from and begin_from do; a penalty that is given wins."""
    options = [
        "--from-batch",
        "3",
        "--states",
        "4",
        "--seed",
        "5",
        "--noise",
        "0.125",
        "--extra-directions",
        "2",
    ]
    result = run_command_line("stream", folder, *options, "--out", "a.stream", "--skill", "a.skill")
    assert result.exit_code == 0
    shown = [add_derivatives(demo) for demo in reach_demonstrations]
    skill = pf.learn(shown[:3], states=4, rng=np.random.default_rng(5)).skill
    penalties = online.estimate_penalties(
        skill, shown[:3], maintenance=online.Maintenance(extra_directions=2)
    )
    model = online.from_batch_fit(skill, shown[:3], replace(penalties, noise=0.125))
    for demo in shown[3:]:
        model, _ = online.observe_demonstration(model, demo)
    assert models_equal(tmp_path / "a.stream", model)


def test_the_whole_folder_may_be_the_batch_and_more_is_refused(
    run_command_line: RunCommand, run_failing: Refusal, folder: Path
):
    """A model that has met all of them is one to go on from, by another stream."""
    assert (
        run_command_line(
            "stream", folder, "--from-batch", "5", "--states", "3", "--out", "a.stream"
        ).exit_code
        == 0
    )
    assert "there are 5 recordings" in run_failing("stream", folder, "--from-batch", "6", "--states", "3")


def test_recordings_of_another_kind_than_the_model_are_refused(
    run_command_line: RunCommand, run_failing: Refusal, folder: Path, rows: Path
):
    """Told which, in what, and what was expected."""
    assert run_command_line("stream", rows, *SOSC, "--out", "a.stream").exit_code == 0
    assert "'reach 0' differs from the model in layout" in run_failing(
        "stream", folder, "--resume", "a.stream"
    )


def test_rows_go_on_with_a_model_of_several_frames_as_each_sees_them(
    run_command_line: RunCommand,
    folder: Path,
    tmp_path: Path,
    reach_demonstrations: tuple[Demonstration, ...],
):
    """One frame's columns after the other's."""
    assert (
        run_command_line(
            "stream", folder, *SOSC, "--no-velocities", "--only", "0", "--out", "a.stream"
        ).exit_code
        == 0
    )
    model = pf.open_stream(tmp_path / "a.stream")
    seen = np.random.default_rng(0).normal(size=(5, 2, 7))
    (tmp_path / "rows").write_text(
        "\n".join(" ".join(map(repr, row)) for row in seen.reshape(5, 14).tolist())
    )
    assert run_command_line("stream", "rows", "--resume", "a.stream", "--out", "b.stream").exit_code == 0
    assert models_equal(tmp_path / "b.stream", online.observe_stream(model, seen)[0])


def test_show_tells_what_a_stream_reads_out_as(run_command_line: RunCommand, run_json: RunJson, folder: Path):
    """Of the model's file and of the skill's, without rows that say nothing."""
    assert run_command_line("stream", folder, *SOSC, "--out", "a.stream", "--skill", "a.skill").exit_code == 0
    for name, words in (
        ("a.stream", "a growing model"),
        ("a.skill", "learned from a stream of 120 datapoints"),
    ):
        told = run_command_line("show", name)
        assert (told.exit_code, told.stderr) == (0, "")
        assert words in told.stdout
        assert "nan" not in told.stdout
        assert "sha256" not in told.stdout
    answer = run_json("show", "a.stream")
    assert answer["stream"]["datapoints"] == 120
    assert answer["states"] == run_json("show", "a.skill")["states"]


def test_a_stream_file_is_no_skill_to_replay_and_the_remedy_is_named(
    run_command_line: RunCommand, run_failing: Refusal, rows: Path
):
    """Which command makes one of it."""
    assert run_command_line("stream", rows, *SOSC, "--out", "a.stream").exit_code == 0
    assert "pilotfish stream /dev/null --resume FILE --skill NEW" in run_failing("reproduce", "a.stream")


def test_a_skill_from_a_stream_was_learned_from_all_that_is_there(
    run_command_line: RunCommand, folder: Path, tmp_path: Path
):
    """It names no recordings; so relevance holds out each of the folder's."""
    assert (
        run_command_line(
            "stream", folder, "--from-batch", "3", "--states", "3", "--skill", "a.skill"
        ).exit_code
        == 0
    )
    assert len(training_demonstrations(pf.open_skill(tmp_path / "a.skill"), str(folder))) == 5
    assert run_command_line("show", "a.skill", "--relevance", folder).exit_code == 0
