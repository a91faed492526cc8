"""Reproductions of skills with orientations on S^3."""

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import Result

from pilotfish.control import double_integrator, track
from pilotfish.demonstrations import Demonstration, add_derivatives, frame_from_pose, to_sphere
from pilotfish.geometry import angle, pose
from pilotfish.io.situations import read_frames
from pilotfish.io.skill_file import open_skill, save_skill
from pilotfish.models import Skill, adapt, learn
from pilotfish.planning import (
    default_control_cost,
    end_orientation_error,
    mean_squared_error,
    plan,
    reproduce_demonstration,
    tangent_chart,
)

RunCommand = Callable[..., Result]
RunJson = Callable[..., dict[str, Any]]
RunFailing = Callable[..., str]
START = {"position": [0.0, -0.4, 0.3], "quaternion": [0.9800666, 0.1986693, 0.0, 0.0]}


@pytest.fixture(scope="session")
def sphere_skill(reach_demonstrations: tuple[Demonstration, ...]) -> Skill:
    demonstrations = [add_derivatives(to_sphere(demo)) for demo in reach_demonstrations]
    return learn(demonstrations, states=3, rng=np.random.default_rng(0)).skill


@pytest.fixture
def sphere_skill_file(tmp_path: Path, sphere_skill: Skill) -> Path:
    save_skill(sphere_skill, tmp_path / "sphere.skill")
    return tmp_path / "sphere.skill"


@pytest.fixture
def start(tmp_path: Path) -> Path:
    (tmp_path / "start.json").write_text(json.dumps(START))
    return tmp_path / "start.json"


def read(path: Path) -> tuple[list[str], np.ndarray]:
    with path.open(encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    return header, np.array(rows, dtype=float)


def test_riemannian_reproduction_equals_tangent_plan(
    run_json: RunJson, sphere_skill_file: Path, sphere_skill: Skill, frames: Path, start: Path, tmp_path: Path
):
    run_json(
        "reproduce",
        sphere_skill_file,
        "--frames",
        frames,
        "--start",
        start,
        "--out",
        "m.csv",
        "--gains",
        "g.npz",
    )
    header, rows = read(tmp_path / "m.csv")
    named = [
        f"{name} [{unit}]"
        for name, unit in zip(sphere_skill.layout.names, sphere_skill.layout.units, strict=True)
    ]
    assert header == ["time [s]", *named]
    chart = tangent_chart(adapt(sphere_skill, read_frames(frames, sphere_skill)))
    begin = chart.to_tangent(np.array([*START["position"], *START["quaternion"], *np.zeros(6)]))
    reference = plan(chart.skill, begin, horizon=24)
    feedback = track(double_integrator(6, sphere_skill.period), reference, default_control_cost(chart.skill))
    np.testing.assert_allclose(rows[:, 1:], chart.to_manifold(feedback.rollout(begin).x), atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(rows[:, 4:8], axis=1), 1.0, rtol=1e-12)
    assert angle(rows[0, 4:8], np.array(START["quaternion"])) < 1e-6
    with np.load(tmp_path / "g.npz") as controller:
        np.testing.assert_allclose(controller["gains"], feedback.gains, atol=1e-9)
        np.testing.assert_allclose(controller["bases"], chart.base_quaternions)
        assert tuple(controller["columns"]) == chart.skill.layout.names


def test_start_quaternion_sign_changes_nothing(
    run_json: RunJson, sphere_skill_file: Path, frames: Path, start: Path, tmp_path: Path
):
    turned = [-value for value in START["quaternion"]]
    rows = []
    for given in (START, {**START, "quaternion": turned}, {"x": [*START["position"], *turned, *[0.0] * 6]}):
        start.write_text(json.dumps(given))
        run_json(
            "reproduce", sphere_skill_file, "--frames", frames, "--start", start, "--out", "m.csv", "--force"
        )
        rows.append(read(tmp_path / "m.csv")[1])
    np.testing.assert_allclose(rows[1], rows[0], atol=1e-9)
    np.testing.assert_allclose(rows[2], rows[0], atol=1e-7)


def test_orientation_distances_are_in_degrees(
    run_json: RunJson, run_command_line: RunCommand, sphere_skill_file: Path, frames: Path, start: Path
):
    reproduce = ["reproduce", sphere_skill_file, "--frames", frames, "--start", start, "--horizon", "12"]
    output = run_json(*reproduce)["start_to_first_target"]["orientation"]
    skill = open_skill(sphere_skill_file)
    first = adapt(skill, read_frames(frames, skill)).means[:, 3:7]
    gaps = np.degrees(angle(first, np.array(START["quaternion"])))
    assert np.abs(gaps - output).min() < 1e-6
    text = run_command_line(*reproduce).stdout
    assert f"start to first target  {output:.4g} deg" in text
    assert "rad/s²" in text


def test_distant_start_orientation_has_note(
    run_json: RunJson, sphere_skill_file: Path, frames: Path, start: Path
):
    start.write_text(json.dumps({**START, "quaternion": [0.0, 0.0, 1.0, 0.0]}))
    (note,) = (
        note
        for note in run_json("reproduce", sphere_skill_file, "--frames", frames, "--start", start)["notes"]
        if "extrapolation" in note
    )
    assert "the start's orientation is 1" in note
    assert " deg from the nearest state" in note


def test_frame_as_matrix_equals_frame_as_pose(
    run_json: RunJson,
    run_failing: RunFailing,
    sphere_skill_file: Path,
    sphere_skill: Skill,
    frames: Path,
    tmp_path: Path,
):
    given = json.loads(frames.read_text())
    poses = [
        frame_from_pose(
            f["name"], sphere_skill.layout, pose(np.array(f["position"]), np.array(f["quaternion"]))
        )
        for f in given
    ]
    finals = []
    for width in (None, 13, 7):
        listed = [
            {"name": f.name, "A": f.A[:width, :width].tolist(), "b": f.b[:width].tolist()} for f in poses
        ]
        frames.write_text(json.dumps(given if width is None else listed))
        finals.append(run_json("reproduce", sphere_skill_file, "--frames", frames)["final"])
    for final in finals[1:]:
        np.testing.assert_allclose(final["position"], finals[0]["position"], atol=1e-9)
        np.testing.assert_allclose(final["orientation"], finals[0]["orientation"], atol=1e-9)
    listed = [{"name": f.name, "A": f.A[:5, :5].tolist(), "b": f.b[:5].tolist()} for f in poses]
    frames.write_text(json.dumps(listed))
    assert "13" in run_failing("reproduce", sphere_skill_file, "--frames", frames)


def test_riemannian_skill_without_velocities_is_rejected(
    run_failing: RunFailing, reach_demonstrations: tuple[Demonstration, ...], frames: Path, tmp_path: Path
):
    demonstrations = [to_sphere(demo) for demo in reach_demonstrations]
    save_skill(learn(demonstrations, states=2, rng=np.random.default_rng(0)).skill, tmp_path / "still.skill")
    assert "learn --velocities" in run_failing("reproduce", "still.skill", "--frames", frames)


def test_riemannian_skill_has_all_plots(run_json: RunJson, sphere_skill_file: Path, frames: Path):
    pytest.importorskip("matplotlib")
    run_json("reproduce", sphere_skill_file, "--frames", frames, "--plot", "m.png")
    output = run_json("show", sphere_skill_file, "--plots", "plots")
    assert (len(output["plots"]), output["not_plotted"]) == (3, {})


def test_riemannian_errors_ignore_quaternion_signs(
    sphere_skill: Skill, reach_demonstrations: tuple[Demonstration, ...]
):
    demo = add_derivatives(to_sphere(reach_demonstrations[0]))
    x = demo.x.copy()
    x[:, 3:7] *= -1.0
    negated = Demonstration(x, demo.period, demo.layout, demo.frames, demo.name)
    result = reproduce_demonstration(sphere_skill, demo)
    assert end_orientation_error(result.motion, demo) < np.radians(5.0)
    for error in (end_orientation_error, mean_squared_error):
        assert error(result.motion, negated) == pytest.approx(error(result.motion, demo), abs=1e-12)
    assert mean_squared_error(result.motion, demo) < 0.01
