"""`--via-point`: points that a replay is asked to pass."""

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


@pytest.fixture(params=["flat", "sphere"])
def run_with_and_without(
    request: pytest.FixtureRequest,
    skill: Path,
    reach_demonstrations: tuple[Demonstration, ...],
    tmp_path: Path,
) -> Path:
    """The skill with quaternions as four numbers, and on their sphere."""
    if request.param == "flat":
        return skill
    shown = [add_derivatives(to_sphere(demo)) for demo in reach_demonstrations]
    save_skill(learn(shown, states=3, rng=np.random.default_rng(0)).skill, tmp_path / "sphere.skill")
    return tmp_path / "sphere.skill"


def test_the_motion_passes_where_it_is_asked_to(
    run_json: RunJson, run_with_and_without: Path, frames: Path, tmp_path: Path
):
    """At 0.8 s it is at the place, at 1.2 s turned as asked; the misses told are those of the file."""
    place = "position=.1,-.2,.4@.8s+-.0001"
    replay = ["reproduce", run_with_and_without, "--frames", frames, "--out", "m.csv"]
    output = run_json(
        *replay,
        "--via-point",
        place,
        "--via-point",
        ORIENTATION_VIA_POINT,
        "--via-point",
        "position z=.1@1.6s+-.0001",
    )["via_points"]
    with (tmp_path / "m.csv").open(encoding="utf-8", newline="") as file:
        x = np.array(list(csv.reader(file))[1:], dtype=float)[:, 1:]
    assert [(miss["via_point"], miss["step"], miss["unit"]) for miss in output] == [
        (place, 8, "m"),
        (ORIENTATION_VIA_POINT, 12, "deg"),
        ("position z=.1@1.6s+-.0001", 16, "m"),
    ]
    measured = [
        np.linalg.norm(x[8, :3] - [0.1, -0.2, 0.4]),
        np.degrees(angle(x[12, 3:7], QUATERNION)),
        abs(x[16, 2] - 0.1),
    ]
    np.testing.assert_allclose([miss["error"] for miss in output], measured, atol=2e-6)
    assert np.all(np.array(measured) < [1e-3, 0.1, 1e-3])


def test_a_via_point_far_wider_than_the_way_changes_nothing(
    run_json: RunJson, run_with_and_without: Path, frames: Path, tmp_path: Path
):
    """A measurement without precision carries no information."""
    replay = ["reproduce", run_with_and_without, "--frames", frames, "--out"]
    output = run_json(*replay, "a.csv")
    wide = run_json(*replay, "b.csv", "--via-point", "position=9,9,9@1s+-1e6")
    assert output["via_points"] == []
    for part in ("position", "orientation"):
        np.testing.assert_allclose(wide["final"][part], output["final"][part], atol=1e-6)


def test_what_is_missed_by_more_than_its_deviation_is_remarked(
    run_json: RunJson, run_command_line: RunCommand, skill: Path, frames: Path
):
    """Weak wishes give way to the skill, and the note says so; the text tells every miss."""
    replay = ["reproduce", skill, "--frames", frames, "--via-point"]
    weak, strong = "position=.1,-.2,.9@.8s+-.2", "position=.1,-.2,.9@.8s+-.0001"
    notes = {wish: [n for n in run_json(*replay, wish)["notes"] if "missed" in n] for wish in (weak, strong)}
    text = run_command_line(*replay, strong).stdout
    assert "via position at .8 s" in text
    assert "missed by" in text
    assert len(notes[weak]) == 1
    assert "a smaller deviation pulls harder" in notes[weak][0]


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
def test_a_point_that_cannot_be_read_is_misuse(
    run_command_line: RunCommand, skill: Path, frames: Path, typed: str
):
    """Exit code 2, and the line shows what to type."""
    result = run_command_line("reproduce", skill, "--frames", frames, "--via-point", typed)
    assert (result.exit_code, result.stdout) == (2, "")
    assert "position=.4,.1,.3@4s+-.001" in result.stderr


@pytest.mark.parametrize(
    ("typed", "told"),
    [
        ("positon=1,2,3@1s+-.1", "did you mean 'position'?"),
        ("position=1,2@1s+-.1", "expected 3"),
        ("position=1,2,3@0s+-.1", "expected 0.1 to 2.3 s"),
        ("position=1,2,3@9s+-.1", "expected 0.1 to 2.3 s"),
        ("position=1,2,3@1s+-0", "positive"),
        ("orientation=1,0,0,0@1s+-2", "say +-2deg"),
        ("position=1,2,3@1s+-2deg", "without deg"),
        ("orientation=1,1,0,0@1s+-2deg", "unit quaternion"),
    ],
)
def test_a_point_that_cannot_be_passed_is_refused(
    run_failing: RunFailing, run_with_and_without: Path, frames: Path, typed: str, output: str
):
    """One line, with what was expected or the fix; the same on the sphere."""
    assert output in run_failing("reproduce", run_with_and_without, "--frames", frames, "--via-point", typed)


def test_a_column_of_an_orientation_on_the_sphere_is_refused(
    run_failing: RunFailing, reach_demonstrations: tuple[Demonstration, ...], frames: Path, tmp_path: Path
):
    """There is no plan in which one number of a quaternion could be held alone."""
    shown = [add_derivatives(to_sphere(demo)) for demo in reach_demonstrations]
    save_skill(learn(shown, states=2, rng=np.random.default_rng(0)).skill, tmp_path / "sphere.skill")
    output = run_failing(
        "reproduce", "sphere.skill", "--frames", frames, "--via-point", "orientation w=.5@1s+-.1"
    )
    assert "expected a whole unit quaternion of 'orientation'" in output


def test_pictures_mark_the_points(
    run_json: RunJson, run_command_line: RunCommand, run_with_and_without: Path, frames: Path
):
    """One in space and one over time; the latter needs a point."""
    pytest.importorskip("matplotlib")
    replay = ["reproduce", run_with_and_without, "--frames", frames, "--via-plot", "via.png"]
    output = run_json(
        *replay,
        "--plot",
        "m.png",
        "--via-point",
        "position=.1,-.2,.4@.8s+-.001",
        "--via-point",
        ORIENTATION_VIA_POINT,
    )
    assert output["files"] == {"plot": "m.png", "via_plot": "via.png"}
    refused = run_command_line(*replay, "--force")
    assert refused.exit_code == 2
    assert "--via-point WHAT=NUMBERS@SECONDS+-DEVIATION" in refused.stderr


def test_the_answer_of_a_replay_is_json(run_command_line: RunCommand, skill: Path, frames: Path):
    """Numbers of misses are plain floats."""
    result = run_command_line(
        "reproduce", skill, "--frames", frames, "--via-point", "position=.1,-.2,.4@.8s+-.001", "--json"
    )
    assert isinstance(json.loads(result.stdout)["via_points"][0]["error"], float)
