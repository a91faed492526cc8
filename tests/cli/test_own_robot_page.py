"""docs/your-own-robot.md: its command lines and its program run, one after the other."""

import re
import shlex
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import Result

TOP = Path(__file__).parents[2]
PAGE = (TOP / "docs" / "your-own-robot.md").read_text(encoding="utf-8")


# Records two sets and hooks nine carabiners in physics.
@pytest.mark.slow
def test_page_runs_from_top_to_bottom(
    run_command_line: Callable[..., Result],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys,
    unchecked: None,
):
    """Every execution succeeds, and the joint positions at 500 Hz follow the motion."""
    (tmp_path / "examples").mkdir()
    shutil.copy(TOP / "examples" / "arm.urdf", tmp_path / "examples")
    monkeypatch.chdir(tmp_path)
    namespace: dict[str, Any] = {}
    for kind, text in re.findall(r"```(sh|python)\n(.*?)```", PAGE, re.DOTALL):
        if kind == "python":
            exec(text, namespace)  # noqa: S102 - the page's own program
            continue
        for line in text.splitlines():
            program, *arguments = shlex.split(line)
            assert program == "pilotfish"
            result = run_command_line(*arguments)
            assert (result.exit_code, result.stderr) == (0, ""), line
            if arguments[0] == "perform":
                assert re.search(r"(\d+) of \1 succeeded", result.output), result.output
    motion, steps = namespace["motion"], namespace["steps"]
    assert motion.q.shape == (len(motion.times), len(namespace["robot"].joint_names))
    assert np.diff(motion.times) == pytest.approx(0.002)
    assert len(steps) == len(motion.times)
    assert (tmp_path / "hooking.csv").exists()
    assert capsys.readouterr().out
