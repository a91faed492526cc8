"""--robot and --end-effector of `record` and `perform`."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from arm_files import urdf
from click.testing import Result


def test_record_names_the_robot_in_result_and_folder(run_command_line: Callable[..., Result], tmp_path: Path):
    (tmp_path / "arm.urdf").write_text(urdf())
    arguments = ["--robot", str(tmp_path / "arm.urdf"), "--end-effector", "tool0", "--demonstrations", "1"]
    result = run_command_line("record", "stab", *arguments, "--out", str(tmp_path / "stabs"), "--json")
    assert result.exit_code == 0, result.output
    data = json.loads(result.stdout)
    assert data["robot"] == "arm"
    assert data["demonstrations"][0]["name"] == "stab 0, arm"
    assert any((tmp_path / "stabs").glob("*stab-0-arm*"))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--robot", "kuka"], "robot 'kuka' is unknown, expected baxter, panda, ur5e or a file"),
        (["--robot", "missing.urdf"], "missing.urdf cannot be read"),
        (["--robot", "panda", "--end-effector", "hand"], "needs none"),
    ],
)
def test_unusable_robot_is_refused(
    arguments: list[str], message: str, run_command_line: Callable[..., Result], tmp_path: Path
):
    result = run_command_line("record", "stab", *arguments, "--out", str(tmp_path / "stabs"))
    assert result.exit_code != 0
    assert message in result.output
    assert not (tmp_path / "stabs").exists()
