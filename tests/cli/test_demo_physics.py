"""The demo opens the recorded valve in simulation, and reports it."""

import sys
from dataclasses import replace
from io import BytesIO
from math import radians

import numpy as np
import pytest
from demo_run import DemoRun
from drawing import needs_renderer
from PIL.Image import open as open_image

from pilotfish.cli.demo import physics as demo_physics
from pilotfish.cli.demo import run as demo_module
from pilotfish.cli.demo.evaluation_tables import StructureEvaluation
from pilotfish.cli.demo.physics import (
    INTRODUCTION,
    simulate_reproduction,
    simulate_reproductions,
)
from pilotfish.cli.demo.protocol import (
    CONTROL_COST,
    COVARIANCE_REGULARISATION,
    SETTINGS,
    STATES,
    TRAINING_DEMONSTRATIONS,
)
from pilotfish.cli.output.html_report import Image, Section
from pilotfish.cli.output.tables import Table
from pilotfish.control import Motion
from pilotfish.demonstrations import Demonstration
from pilotfish.environments import RECORDED_VALVE, Outcome, Workcell
from pilotfish.errors import SkillError
from pilotfish.gaussians.structures import SemiTied
from pilotfish.io import datasets
from pilotfish.io.synthetic import synthetic_valve
from pilotfish.models import TimeBins, learn
from pilotfish.planning import Reproduction, reproduce_demonstration

SLOW = pytest.mark.slow  # the whole demo: eight simulations of twenty seconds


def evaluate(demonstrations: tuple[Demonstration, ...]) -> StructureEvaluation:
    """Evaluate semi-tied covariances as the demo does."""
    fit = learn(
        demonstrations[:TRAINING_DEMONSTRATIONS],
        states=STATES,
        rng=np.random.default_rng(0),
        structure=SemiTied(),
        settings=SETTINGS,
        initialisation=TimeBins(),
    )
    reproductions = tuple(
        reproduce_demonstration(
            fit.skill,
            demo,
            control_cost=CONTROL_COST,
            covariance_regularisation=COVARIANCE_REGULARISATION,
            stepwise=True,
        )
        for demo in demonstrations
    )
    return StructureEvaluation(fit, SemiTied(), demonstrations, reproductions, reproductions, 0.0)


@pytest.fixture(scope="module")
def evaluation(data_folder: object) -> StructureEvaluation:
    return evaluate(datasets.valve())


@SLOW
def test_demo_reproductions_open_valves(demo_run: DemoRun):
    results = demo_run.valve_openings
    assert [row[1] for row in demo_run.physics_table.rows] == ["yes"] * 4 + ["no"] * 4
    open_ones = [outcome.success for outcome, _, _, _ in results]
    assert sum(open_ones) >= 6
    assert not open_ones[7]
    for outcome, turn, force, max_deviation in results[:7]:
        assert outcome.error < radians(12.0)
        assert outcome.error < 0.2 * turn
        assert 1.0 < force < 80.0
        assert max_deviation < 0.06


@SLOW
def test_demo_simulation_table_equals_results(demo_run: DemoRun, evaluation: StructureEvaluation):
    table, results = demo_run.physics_table, demo_run.valve_openings
    assert [row[0] for row in table.rows] == [demo.name for demo in evaluation.demonstrations]
    assert [row[1] for row in table.rows] == ["yes"] * 4 + ["no"] * 4
    for row, (outcome, turn, force, max_deviation) in zip(table.rows, results, strict=True):
        assert row[2] == ("yes" if outcome.success else "no")
        assert float(row[3]) == pytest.approx(np.degrees(turn), abs=0.5)
        assert float(row[4]) == pytest.approx(np.degrees(outcome.error), abs=0.05)
        assert float(row[5]) == pytest.approx(force, abs=0.5)
        assert float(row[6]) == pytest.approx(1000.0 * max_deviation, abs=0.5)


@SLOW
@needs_renderer
def test_demo_section_has_film_and_six_frames(demo_run: DemoRun, evaluation: StructureEvaluation):
    section = demo_run.section
    text, table, film, strip = section.parts
    assert (section.heading, text, table) == ("Simulation", INTRODUCTION, demo_run.physics_table)
    assert isinstance(film, Image)
    assert isinstance(strip, Image)
    assert evaluation.demonstrations[TRAINING_DEMONSTRATIONS].name in film.caption
    with open_image(BytesIO(film.data)) as opened_film:
        assert (opened_film.format, opened_film.n_frames) == (
            "WEBP",
            len(evaluation.from_first_point[TRAINING_DEMONSTRATIONS].motion.x),
        )
    with open_image(BytesIO(strip.data)) as image:
        assert image.format == "PNG"
    assert "Six frames" in strip.caption


def motionless(evaluation: StructureEvaluation, m: int) -> tuple[Reproduction, Demonstration]:
    """Return a reproduction that stays at its start for two seconds."""
    motion = evaluation.from_first_point[m].motion
    x = np.tile(motion.x[0], (20, 1))
    return replace(
        evaluation.from_first_point[m], motion=Motion(x, np.zeros((19, motion.u.shape[1])), motion.period)
    ), evaluation.demonstrations[m]


@pytest.mark.parametrize("m", range(8))
def test_simulate_motionless_reproduction_leaves_valve_closed(evaluation: StructureEvaluation, m: int):
    outcome, turn, force, _ = simulate_reproduction(*motionless(evaluation, m), None)
    assert not outcome.success
    assert outcome.error == pytest.approx(turn, abs=1e-3)
    assert force < 5.0


@pytest.mark.parametrize("m", [1, 5, 7])
def test_simulate_gripper_closes_and_opens_at_handle(
    evaluation: StructureEvaluation, m: int, monkeypatch: pytest.MonkeyPatch
):
    commands: list[tuple[np.ndarray, float, int]] = []

    class RecordingWorkcell(Workcell):  # type: ignore[type-arg]
        def step_impedance(self, target: object, grip: float, ticks: int) -> None:
            commands.append((target.position, grip, ticks))

    monkeypatch.setattr(demo_physics, "Workcell", RecordingWorkcell)
    simulate_reproduction(evaluation.from_first_point[m], evaluation.demonstrations[m], None)
    places, grips, ticks = (np.array(column) for column in zip(*commands, strict=True))
    assert np.array_equal(places, evaluation.from_first_point[m].motion.x[:, :3])
    assert set(ticks) == {100}
    before, after = (
        np.linalg.norm(places - frame.b[:3], axis=1) for frame in evaluation.demonstrations[m].frames
    )
    shut = np.flatnonzero(grips)
    assert shut[0] == np.argmin(before)
    assert shut[-1] + 1 == shut[0] + np.argmin(after[shut[0] :])
    assert np.all(grips[shut[0] : shut[-1] + 1] == 1.0)


@SLOW
def test_simulate_synthetic_demonstration_opens_valve(unchecked: None):
    demonstrations = synthetic_valve(np.random.default_rng(0))
    evaluation = evaluate(demonstrations)
    outcome, *_ = simulate_reproduction(evaluation.from_first_point[6], demonstrations[6], None)
    assert outcome.success, outcome.reason


def test_simulate_without_images_returns_table(
    evaluation: StructureEvaluation, monkeypatch: pytest.MonkeyPatch
):
    row = Outcome(False, 0.1, "so"), 0.2, 3.0, 0.01
    monkeypatch.setattr(
        demo_physics, "simulate_reproduction", lambda *given: row if given[-1] is None else 1 / 0
    )
    section, table = simulate_reproductions(evaluation, with_images=False)
    assert section.parts == (INTRODUCTION, table)
    assert [row[0] for row in table.rows] == [demo.name for demo in evaluation.demonstrations]
    assert [row[1] for row in table.rows] == ["yes"] * 4 + ["no"] * 4
    assert [row[2:] for row in table.rows] == [("no", "11", "5.7", "3", "10")] * 8


def test_simulate_without_mujoco_names_extra(
    evaluation: StructureEvaluation, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    printed: list[str] = []
    section, tables = demo_module.execute_in_simulation(evaluation, printed.append)
    assert tables == ()
    assert section.heading == "Simulation"
    for text in (*section.parts, *printed):
        assert isinstance(text, str)
        assert "not executed" in text
        assert "pip install '.[sim]' in the clone" in text
    assert len(section.parts) == len(printed) == 1


def test_simulate_without_renderer_has_no_film(
    evaluation: StructureEvaluation, monkeypatch: pytest.MonkeyPatch
):

    def refuse() -> None:
        raise SkillError("no renderer")

    calls: list[bool] = []
    nothing = Section("Simulation", ()), Table(("a",), (("b",),))
    monkeypatch.setattr(demo_module, "require_renderer", refuse)
    monkeypatch.setattr(
        demo_physics, "simulate_reproductions", lambda _, with_images: calls.append(with_images) or nothing
    )
    printed: list[str] = []
    section, tables = demo_module.execute_in_simulation(evaluation, printed.append)
    assert (section, tables) == (nothing[0], (nothing[1],))
    assert calls == [False]
    assert "no film of the simulation: no renderer" in "\n".join(printed)


def test_recorded_valve_has_frames_of_demonstrations(evaluation: StructureEvaluation):
    assert RECORDED_VALVE.frames == tuple(frame.name for frame in evaluation.demonstrations[0].frames)
