"""The timed steps are those of the workcell, and a missed requirement is reported."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("mujoco")

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"


@pytest.fixture
def physics(monkeypatch: pytest.MonkeyPatch):
    """Import benchmarks/physics.py like `python benchmarks/physics.py`."""
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    from importlib import import_module

    return import_module("physics")


def test_timed_steps_equal_workcell_steps(physics):
    from pilotfish.environments import linear_path
    from pilotfish.geometry import Pose

    timed, reference = physics.workcell("valve"), physics.workcell("valve")
    target = Pose(timed.target.position + np.array([0.0, 0.0, 0.01]), timed.target.quaternion)
    path = linear_path(timed.target, target, physics.STEPS_PER_CALL, timed.timestep)
    for n in range(physics.STEPS_PER_CALL):
        stamps = physics.timed_step(timed, path, n)
        assert list(stamps) == sorted(stamps)
    reference.step_impedance(target, 0.0, physics.STEPS_PER_CALL)
    np.testing.assert_array_equal(timed.data.qpos, reference.data.qpos)
    np.testing.assert_array_equal(timed.data.qvel, reference.data.qvel)


@pytest.mark.parametrize("which", range(4))
def test_requirement_results_missed_target_is_reported(physics, which):
    held, step, import_ = [(9.0, 20.0, 0.2), (4.9, 20.0, 0.2), (9.0, 61.0, 0.2), (9.0, 20.0, 0.31)][which]
    speeds = [physics.Speed("valve", held, 9.0, 1.0, 0.1, None, 0)]
    rows = list(
        physics.requirement_results(
            speeds, [physics.Part("control step", step, 99.0)], {"pilotfish": import_}
        )
    )
    assert [row.endswith("MISS |") for row in rows[2:]] == [which == n for n in (1, 2, 3)]


@pytest.mark.slow  # times the physics
def test_quick_run_fills_tables_and_json(tmp_path):
    table, figures = tmp_path / "table.md", tmp_path / "figures.json"
    options = ["--quick", "--out", str(table), "--json", str(figures)]
    command = [sys.executable, str(BENCHMARKS / "physics.py"), *options]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    results = json.loads(figures.read_text(), parse_constant=pytest.fail)  # NaN is not JSON
    assert len(results["speeds"]) == 5
    assert "## Control step" in table.read_text()
