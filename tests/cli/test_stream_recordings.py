"""pilotfish stream of demonstrations, after an initial batch or without one."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import Result
from stream_commands import PENALTIES, SOSC, models_equal

import pilotfish as pf
from pilotfish.cli.options.demonstrations import training_demonstrations
from pilotfish.demonstrations import Demonstration, add_derivatives, moving_frame, position_layout
from pilotfish.io.demonstration_folder import write_demonstrations
from pilotfish.models import online

RunCommand = Callable[..., Result]
RunJson = Callable[..., dict[str, Any]]
RunFailing = Callable[..., str]


@pytest.fixture
def rows(tmp_path: Path) -> Path:
    (tmp_path / "rows.csv").write_text("1,2\n1,2.1\n3,4\n")
    return tmp_path / "rows.csv"


def test_stream_period_of_demonstrations_is_usage_error(run_command_line: RunCommand, folder: Path):
    result = run_command_line("stream", folder, "--from-batch", "2", "--period", "1")
    assert (result.exit_code, "--period needs rows" in result.stderr) == (2, True)


def test_stream_demonstrations_equals_library(
    run_command_line: RunCommand,
    folder: Path,
    tmp_path: Path,
    reach_demonstrations: tuple[Demonstration, ...],
):
    assert run_command_line("stream", folder, *SOSC, "--only", "1-3", "--out", "a.stream").exit_code == 0
    demonstrations = [add_derivatives(demo) for demo in reach_demonstrations[1:4]]
    names = tuple(frame.name for frame in demonstrations[0].frames)
    model = online.online_model(PENALTIES, demonstrations[0].layout, demonstrations[0].period, names)
    for demo in demonstrations:
        model, _ = online.observe_demonstration(model, demo)
    assert models_equal(tmp_path / "a.stream", model)


def test_rows_option_truncates_demonstration(
    run_command_line: RunCommand, tmp_path: Path, rng: np.random.Generator
):
    layout = position_layout(2)
    turns = np.stack([np.eye(2)] * 9)
    demonstrations = [
        pf.demonstration(
            rng.normal(size=(9, 2)),
            0.1,
            layout,
            [moving_frame("hand", turns, rng.normal(size=(9, 2)))],
            f"{m}",
        )
        for m in range(2)
    ]
    write_demonstrations(demonstrations, tmp_path / "folder")
    assert (
        run_command_line(
            "stream", "folder", "--no-velocities", *SOSC, "--rows", "13", "--out", "a.stream"
        ).exit_code
        == 0
    )
    model = online.online_model(PENALTIES, layout, 0.1, ("hand",))
    model, _ = online.observe_demonstration(model, demonstrations[0])
    frame = moving_frame("hand", turns[:4], demonstrations[1].frames[0].b[:4])
    model, _ = online.observe_demonstration(
        model, pf.demonstration(demonstrations[1].x[:4], 0.1, layout, [frame])
    )
    assert models_equal(tmp_path / "a.stream", model)


def test_every_prints_after_whole_demonstration(run_command_line: RunCommand, tmp_path: Path):
    layout = position_layout(1)
    demonstrations = [pf.demonstration([[0.0], [1.0], [2.0]], 0.1, layout, name=f"{m}") for m in range(3)]
    write_demonstrations(demonstrations, tmp_path / "folder")
    output = run_command_line(
        "stream", "folder", "--no-velocities", *SOSC, "--every", "4"
    ).stdout.splitlines()
    assert [line.split()[0] for line in output[:2]] == ["6", "9"]


def test_from_batch_estimates_penalties(
    run_command_line: RunCommand,
    folder: Path,
    tmp_path: Path,
    reach_demonstrations: tuple[Demonstration, ...],
):
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
    demonstrations = [add_derivatives(demo) for demo in reach_demonstrations]
    skill = pf.learn(demonstrations[:3], states=4, rng=np.random.default_rng(5)).skill
    penalties = online.estimate_penalties(
        skill, demonstrations[:3], maintenance=online.Maintenance(extra_directions=2)
    )
    model = online.from_batch_fit(skill, demonstrations[:3], replace(penalties, noise=0.125))
    for demo in demonstrations[3:]:
        model, _ = online.observe_demonstration(model, demo)
    assert models_equal(tmp_path / "a.stream", model)


def test_stream_of_demonstrations_without_options_starts_from_batch(
    run_command_line: RunCommand,
    folder: Path,
    tmp_path: Path,
    reach_demonstrations: tuple[Demonstration, ...],
):
    """The first four are the initial model; with --from-batch 0 they give scales and penalties only."""
    assert run_command_line("stream", folder, "--out", "a.stream").exit_code == 0
    demonstrations = [add_derivatives(demo) for demo in reach_demonstrations]
    skill = pf.learn(demonstrations[:4], states=7, rng=np.random.default_rng(0)).skill
    settings = online.estimate_penalties(skill, demonstrations[:4])
    model = online.from_batch_fit(skill, demonstrations[:4], settings)
    assert models_equal(tmp_path / "a.stream", online.observe_demonstration(model, demonstrations[4])[0])

    assert run_command_line("stream", folder, "--from-batch", "0", "--out", "b.stream").exit_code == 0
    settings = online.estimate_settings(demonstrations[:4], states=7, rng=np.random.default_rng(0))
    first = demonstrations[0]
    names = tuple(frame.name for frame in first.frames)
    model = online.online_model(settings, first.layout, first.period, names)
    for demo in demonstrations:
        model, _ = online.observe_demonstration(model, demo)
    assert models_equal(tmp_path / "b.stream", model)


def test_from_batch_larger_than_folder_is_rejected(
    run_command_line: RunCommand, run_failing: RunFailing, folder: Path
):
    assert (
        run_command_line(
            "stream", folder, "--from-batch", "5", "--states", "3", "--out", "a.stream"
        ).exit_code
        == 0
    )
    assert "expected at most 5" in run_failing("stream", folder, "--from-batch", "6", "--states", "3")


def test_resume_with_other_layout_is_rejected(
    run_command_line: RunCommand, run_failing: RunFailing, folder: Path, rows: Path
):
    assert run_command_line("stream", rows, *SOSC, "--out", "a.stream").exit_code == 0
    assert "'reach 0' differs from the model in layout" in run_failing(
        "stream", folder, "--resume", "a.stream"
    )


def test_resume_rows_of_several_frames(
    run_command_line: RunCommand,
    folder: Path,
    tmp_path: Path,
    reach_demonstrations: tuple[Demonstration, ...],
):
    assert (
        run_command_line(
            "stream", folder, *SOSC, "--no-velocities", "--only", "0", "--out", "a.stream"
        ).exit_code
        == 0
    )
    model = pf.io.open_stream(tmp_path / "a.stream")
    rows_in_frames = np.random.default_rng(0).normal(size=(5, 2, 7))
    (tmp_path / "rows").write_text(
        "\n".join(" ".join(map(repr, row)) for row in rows_in_frames.reshape(5, 14).tolist())
    )
    assert run_command_line("stream", "rows", "--resume", "a.stream", "--out", "b.stream").exit_code == 0
    assert models_equal(tmp_path / "b.stream", online.observe_stream(model, rows_in_frames)[0])


def test_show_stream_file_and_its_skill(run_command_line: RunCommand, run_json: RunJson, folder: Path):
    assert run_command_line("stream", folder, *SOSC, "--out", "a.stream", "--skill", "a.skill").exit_code == 0
    for name, words in (
        ("a.stream", "online model"),
        ("a.skill", "learned from a stream of 120 datapoints"),
    ):
        output = run_command_line("show", name)
        assert (output.exit_code, output.stderr) == (0, "")
        assert words in output.stdout
        assert "nan" not in output.stdout
        assert "sha256" not in output.stdout
    answer = run_json("show", "a.stream")
    assert answer["stream"]["datapoints"] == 120
    assert answer["states"] == run_json("show", "a.skill")["states"]


def test_reproduce_stream_file_names_conversion(
    run_command_line: RunCommand, run_failing: RunFailing, rows: Path
):
    assert run_command_line("stream", rows, *SOSC, "--out", "a.stream").exit_code == 0
    assert "pilotfish stream /dev/null --resume FILE --skill NEW" in run_failing("reproduce", "a.stream")


def test_relevance_of_streamed_skill_uses_all_demonstrations(
    run_command_line: RunCommand, folder: Path, tmp_path: Path
):
    assert (
        run_command_line(
            "stream", folder, "--from-batch", "3", "--states", "3", "--skill", "a.skill"
        ).exit_code
        == 0
    )
    assert len(training_demonstrations(pf.open_skill(tmp_path / "a.skill"), str(folder))) == 5
    assert run_command_line("show", "a.skill", "--relevance", folder).exit_code == 0
