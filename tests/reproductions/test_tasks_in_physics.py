"""Skills learned from recordings perform the five tasks in new situations."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from pilotfish.environments import TASKS

SCRIPT = Path(__file__).parents[2] / "reproductions" / "tasks.py"
SITUATIONS = 5  # of the twenty of the whole table


@pytest.mark.slow  # eight demonstrations and five executions of each task in physics: 10 to 60 CPU seconds
@pytest.mark.parametrize("task", sorted(TASKS))
def test_evaluate_skill_new_situations_are_done(tmp_path, task):
    numbers, pictures = tmp_path / "tasks.json", tmp_path / "pictures"
    options = [
        "--tasks",
        task,
        "--structures",
        "full",
        "--demonstrations",
        "8",
        "--situations",
        str(SITUATIONS),
    ]
    command = [sys.executable, SCRIPT, *options, "--json", numbers, "--out", pictures]
    subprocess.run(command, check=True, capture_output=True, timeout=1200)
    (row,) = json.loads(numbers.read_text())
    assert row["task"] == task
    assert row["succeeded"] >= SITUATIONS - 1, row
    assert row["force"] < 60.0, row  # N
    assert (pictures / "tasks.png").is_file()
