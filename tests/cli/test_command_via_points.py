"""Via-points: `reproduce --via-point`."""

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import Result

from pilotfish.demonstrations import Demonstration, add_derivatives, to_sphere
from pilotfish.geometry import angle
from pilotfish.io.skill_file import save_skill
from pilotfish.models import learn

RunCommand = Callable[..., Result]
RunJson = Callable[..., dict[str, Any]]
RunFailing = Callable[..., str]
QUATERNION = np.array([0.9238795, 0.0, 0.3826834, 0.0])
ORIENTATION_VIA_POINT = "orientation=" + ",".join(map(str, QUATERNION)) + "@1.2+-.01deg"


@pytest.fixture(params=["euclidean", "riemannian"])
def skill_file(
    request: pytest.FixtureRequest,
    skill: Path,
    reach_demonstrations: tuple[Demonstration, ...],
    tmp_path: Path,
) -> Path:
    """Skill with quaternions as four numbers, and as orientations on S^3."""
    if request.param == "euclidean":
        return skill
    demonstrations = [add_derivatives(to_sphere(demo)) for demo in reach_demonstrations]
    save_skill(learn(demonstrations, states=3, rng=np.random.default_rng(0)).skill, tmp_path / "sphere.skill")
    return tmp_path / "sphere.skill"


def test_motion_passes_via_points(run_json: RunJson, skill_file: Path, frames: Path, tmp_path: Path):
    place = "position=.1,-.2,.4@.8s+-.0001"
    reproduce = ["reproduce", skill_file, "--frames", frames, "--out", "m.csv"]
    reproduce += ["--covariance-regularisation", "2e-3"]  # so that the skill does not outweigh the via-points
    output = run_json(
        *reproduce,
        "--via-point",
        place,
        "--via-point",
        ORIENTATION_VIA_POINT,
        "--via-point",
        "position z=.1@1.6s+-.0001",
    )["via_points"]
    with (tmp_path / "m.csv").open(encoding="utf-8", newline="") as file:
        x = np.array(list(csv.reader(file))[1:], dtype=float)[:, 1:]
    assert [(error["via_point"], error["step"], error["unit"]) for error in output] == [
        (place, 8, "m"),
        (ORIENTATION_VIA_POINT, 12, "deg"),
        ("position z=.1@1.6s+-.0001", 16, "m"),
    ]
    measured = [
        np.linalg.norm(x[8, :3] - [0.1, -0.2, 0.4]),
        np.degrees(angle(x[12, 3:7], QUATERNION)),
        abs(x[16, 2] - 0.1),
    ]
    np.testing.assert_allclose([error["error"] for error in output], measured, atol=2e-6)
    assert np.all(np.array(measured) < [1e-3, 0.1, 1e-3])


def test_via_point_with_huge_deviation_changes_nothing(
    run_json: RunJson, skill_file: Path, frames: Path, tmp_path: Path
):
    reproduce = ["reproduce", skill_file, "--frames", frames, "--out"]
    output = run_json(*reproduce, "a.csv")
    wide = run_json(*reproduce, "b.csv", "--via-point", "position=9,9,9@1s+-1e6")
    assert output["via_points"] == []
    for part in ("position", "orientation"):
        np.testing.assert_allclose(wide["final"][part], output["final"][part], atol=1e-6)


def test_missed_via_point_has_note(
    run_json: RunJson, run_command_line: RunCommand, skill: Path, frames: Path
):
    reproduce = ["reproduce", skill, "--frames", frames, "--via-point"]
    weak, strong = "position=.1,-.2,.9@.8s+-.2", "position=.1,-.2,.9@.8s+-.0001"
    notes = {
        point: [n for n in run_json(*reproduce, point)["notes"] if "misses" in n] for point in (weak, strong)
    }
    text = run_command_line(*reproduce, strong).stdout
    assert "via position at .8 s" in text
    assert "  error " in text
    assert len(notes[weak]) == 1
    assert "a smaller deviation brings it closer" in notes[weak][0]


@pytest.mark.parametrize(
    "typed",
    [
        "",
        "position",
        "position=1,2,3",
        "position=1,2,3@4s",
        "position=1,a,3@4s+-.1",
        "position=1,2,3@x+-.1",
        "position=1,2,3@4s+-",
        "=1@2s+-.1",
        "position=1,,3@4s+-.1",
        "position=1,2,nan@4s+-.1",
    ],
)
def test_via_point_wrong_syntax_is_usage_error(
    run_command_line: RunCommand, skill: Path, frames: Path, typed: str
):
    result = run_command_line("reproduce", skill, "--frames", frames, "--via-point", typed)
    assert (result.exit_code, result.stdout) == (2, "")
    assert "position=.4,.1,.3@4s+-.001" in result.stderr


@pytest.mark.parametrize(
    ("typed", "message"),
    [
        ("positon=1,2,3@1s+-.1", "did you mean 'position'?"),
        ("position=1,2@1s+-.1", "expected 3"),
        ("position=1,2,3@0s+-.1", "expected 0.1 to 2.3 s"),
        ("position=1,2,3@9s+-.1", "expected 0.1 to 2.3 s"),
        ("position=1,2,3@1s+-0", "positive"),
        ("orientation=1,0,0,0@1s+-2", "write +-2deg"),
        ("position=1,2,3@1s+-2deg", "without deg"),
        ("orientation=1,1,0,0@1s+-2deg", "unit quaternion"),
    ],
)
def test_via_point_invalid_is_rejected(
    run_failing: RunFailing, skill_file: Path, frames: Path, typed: str, message: str
):
    assert message in run_failing("reproduce", skill_file, "--frames", frames, "--via-point", typed)


def test_via_point_column_of_orientation_is_rejected(
    run_failing: RunFailing, reach_demonstrations: tuple[Demonstration, ...], frames: Path, tmp_path: Path
):
    demonstrations = [add_derivatives(to_sphere(demo)) for demo in reach_demonstrations]
    save_skill(learn(demonstrations, states=2, rng=np.random.default_rng(0)).skill, tmp_path / "sphere.skill")
    output = run_failing(
        "reproduce", "sphere.skill", "--frames", frames, "--via-point", "orientation w=.5@1s+-.1"
    )
    assert "expected a whole unit quaternion of 'orientation'" in output


def test_plots_with_via_points(
    run_json: RunJson, run_command_line: RunCommand, skill_file: Path, frames: Path
):
    pytest.importorskip("matplotlib")
    reproduce = ["reproduce", skill_file, "--frames", frames, "--via-plot", "via.png"]
    output = run_json(
        *reproduce,
        "--plot",
        "m.png",
        "--via-point",
        "position=.1,-.2,.4@.8s+-.001",
        "--via-point",
        ORIENTATION_VIA_POINT,
    )
    assert output["files"] == {"plot": "m.png", "via_plot": "via.png"}
    result = run_command_line(*reproduce, "--force")
    assert result.exit_code == 2
    assert "--via-point NAME=VALUES@SECONDS+-DEVIATION" in result.stderr


def test_via_point_errors_are_json_numbers(run_command_line: RunCommand, skill: Path, frames: Path):
    result = run_command_line(
        "reproduce", skill, "--frames", frames, "--via-point", "position=.1,-.2,.4@.8s+-.001", "--json"
    )
    assert isinstance(json.loads(result.stdout)["via_points"][0]["error"], float)
