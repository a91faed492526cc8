"""The demonstration's skill opens the recorded valve in physics, and its report shows that it did."""

import sys
from dataclasses import replace
from io import BytesIO
from math import radians

import numpy as np
import pytest
from demo_run import DemoRun
from drawing import needs_renderer
from matplotlib.figure import Figure
from PIL import Image

from pilotfish.cli.demo import demo
from pilotfish.cli.demo import physics as demo_physics
from pilotfish.cli.demo.demonstrations import StructureEvaluation
from pilotfish.cli.demo.physics import ABOUT, ValveResult, simulate_reproduction, simulate_reproductions
from pilotfish.cli.output.report import Film, ReportFigure, Section, Table
from pilotfish.control import Motion
from pilotfish.demonstrations import Demonstration
from pilotfish.environments import RECORDED_VALVE, Outcome, Workcell
from pilotfish.errors import SkillError
from pilotfish.gaussians.structures import SemiTied
from pilotfish.io import datasets
from pilotfish.io.synthetic import synthetic_valve
from pilotfish.models import learn
from pilotfish.planning.evaluation import SETTINGS, STATES, TRAINING_DEMONSTRATIONS, replay

SLOW = pytest.mark.slow  # the whole demonstration: eight openings of twenty seconds


def make_lesson(shown: tuple[Demonstration, ...]) -> StructureEvaluation:
    """The demonstration's lesson with semi-tied covariances."""
    fit = learn(
        shown[:TRAINING_DEMONSTRATIONS],
        states=STATES,
        rng=np.random.default_rng(0),
        structure=SemiTied(),
        settings=SETTINGS,
    )
    own = tuple(replay(fit.skill, showing) for showing in shown)
    return StructureEvaluation(fit, SemiTied(), shown, own, own, 0.0)


@pytest.fixture(scope="module")
def evaluation(data_folder: object) -> StructureEvaluation:
    return make_lesson(datasets.valve())


@SLOW
def test_valves_are_opened(demo_run: DemoRun):
    """Of eight replays seven open the valve, four shown and three new; six at least on any machine, for one
    ends a twentieth of a degree within what counts. The valve with ten degrees to go is not opened.
    """
    valve_recordings = demo_run.valve_recordings
    assert [opening.new for opening in valve_recordings] == [False] * 4 + [True] * 4
    open_ones = [opening.outcome.success for opening in valve_recordings]
    assert sum(open_ones) >= 6
    assert not open_ones[7]
    for opening in valve_recordings[:7]:
        assert opening.outcome.error < radians(12.0)
        assert opening.outcome.error < 0.2 * opening.turn
        assert 1.0 < opening.force < 80.0
        assert opening.max_deviation < 0.06


@SLOW
def test_the_table_says_how_each_went(demo_run: DemoRun, evaluation: StructureEvaluation):
    """A row for each showing, in order: whether it was shown, whether it is open, angles in degrees."""
    measured, valve_recordings = demo_run.measured, demo_run.valve_recordings
    assert [row[0] for row in measured.rows] == [showing.name for showing in evaluation.shown]
    assert [row[1] for row in measured.rows] == ["yes"] * 4 + ["no"] * 4
    for row, opening in zip(measured.rows, valve_recordings, strict=True):
        assert row[2] == ("yes" if opening.outcome.success else "no")
        assert float(row[3]) == pytest.approx(np.degrees(opening.turn), abs=0.5)
        assert float(row[4]) == pytest.approx(np.degrees(opening.outcome.error), abs=0.05)
        assert float(row[5]) == pytest.approx(opening.force, abs=0.5)
        assert float(row[6]) == pytest.approx(1000.0 * opening.max_deviation, abs=0.5)


@SLOW
@needs_renderer
def test_the_section_holds_one_film_and_its_moments(demo_run: DemoRun, evaluation: StructureEvaluation):
    """Words, the table, a film of the first new situation, a frame for each row of the plan, six moments."""
    section, measured = demo_run.section, demo_run.measured
    words, shown, film, picture = section.parts
    assert (section.heading, words, shown) == ("In physics", ABOUT, measured)
    assert isinstance(film, Film)
    assert isinstance(picture, ReportFigure)
    assert isinstance(picture.figure, Figure)
    assert evaluation.shown[TRAINING_DEMONSTRATIONS].name in film.caption
    with Image.open(BytesIO(film.webp)) as opened_film:
        assert (opened_film.format, opened_film.n_frames) == (
            "WEBP",
            len(evaluation.own[TRAINING_DEMONSTRATIONS].motion.x),
        )
    assert len(picture.figure.axes) == 6


def still(evaluation: StructureEvaluation, m: int) -> tuple[demo_physics.Replay, Demonstration]:
    """A replay that stays where it begins, for two seconds."""
    motion = evaluation.own[m].motion
    x = np.tile(motion.x[0], (20, 1))
    return replace(
        evaluation.own[m], motion=Motion(x, np.zeros((19, motion.u.shape[1])), motion.period)
    ), evaluation.shown[m]


@pytest.mark.parametrize("m", range(8))
def test_to_do_nothing_is_not_to_open(evaluation: StructureEvaluation, m: int):
    """The arm that stays where the person began leaves every valve as it was."""
    made = simulate_reproduction(*still(evaluation, m), m >= TRAINING_DEMONSTRATIONS, None)
    assert not made.outcome.success
    assert made.outcome.error == pytest.approx(made.turn, abs=1e-3)
    assert made.force < 5.0


@pytest.mark.parametrize("m", [1, 5, 7])
def test_the_gripper_shuts_at_the_handle_and_opens_where_it_is_to_be(
    evaluation: StructureEvaluation, m: int, monkeypatch: pytest.MonkeyPatch
):
    """Shut from the row of the plan that is nearest to the handle before the turn, until that, of those after
    it, which is nearest to the handle after the turn; each row is asked for a period.
    """
    asked: list[tuple[np.ndarray, float, int]] = []

    class Noted(Workcell):  # type: ignore[type-arg]
        def follow(self, target: object, grip: float, ticks: int) -> None:
            asked.append((target.position, grip, ticks))

    monkeypatch.setattr(demo_physics, "Workcell", Noted)
    simulate_reproduction(evaluation.own[m], evaluation.shown[m], True, None)
    places, grips, ticks = (np.array(column) for column in zip(*asked, strict=True))
    assert np.array_equal(places, evaluation.own[m].motion.x[:, :3])
    assert set(ticks) == {100}
    before, after = (np.linalg.norm(places - frame.b[:3], axis=1) for frame in evaluation.shown[m].frames)
    shut = np.flatnonzero(grips)
    assert shut[0] == np.argmin(before)
    assert shut[-1] + 1 == shut[0] + np.argmin(after[shut[0] :])
    assert np.all(grips[shut[0] : shut[-1] + 1] == 1.0)


@SLOW
def test_generated_openings_are_carried_out_too(unchecked: None):
    """A skill that was learned from generated data opens the valve that this was generated for."""
    shown = synthetic_valve(np.random.default_rng(0))
    evaluation = make_lesson(shown)
    made = simulate_reproduction(evaluation.own[6], shown[6], True, None)
    assert made.outcome.success, made.outcome.reason
    assert made.name == shown[6].name


def test_without_pictures_there_is_a_table_alone(
    evaluation: StructureEvaluation, monkeypatch: pytest.MonkeyPatch
):
    """Nothing is filmed, and the words stay."""
    row = ValveResult("x", True, Outcome(False, 0.1, "so"), 0.2, 3.0, 0.01)
    monkeypatch.setattr(
        demo_physics, "simulate_reproduction", lambda *given: row if given[-1] is None else 1 / 0
    )
    section, measured = simulate_reproductions(evaluation, pictures=False)
    assert section.parts == (ABOUT, measured)
    assert measured.rows == (("x", "no", "no", "11", "5.7", "3", "10"),) * 8


def test_without_mujoco_the_report_says_what_is_missing(
    evaluation: StructureEvaluation, monkeypatch: pytest.MonkeyPatch
):
    """No table, a paragraph with the remedy, and the same words on the terminal."""
    monkeypatch.setitem(sys.modules, "mujoco", None)
    said: list[str] = []
    section, tables = demo._in_physics(evaluation, said.append)
    assert tables == ()
    assert section.heading == "In physics"
    for words in (*section.parts, *said):
        assert isinstance(words, str)
        assert "not carried out" in words
        assert "pip install 'pilotfish[sim]'" in words
    assert len(section.parts) == len(said) == 1


def test_without_a_renderer_the_valve_is_opened_without_a_film(
    evaluation: StructureEvaluation, monkeypatch: pytest.MonkeyPatch
):
    """The terminal says why there is no film; everything else is there."""

    def refuse() -> None:
        raise SkillError("nothing draws here")

    asked: list[bool] = []
    nothing = Section("In physics", ()), Table("t", ("a",), (("b",),))
    monkeypatch.setattr(demo, "require_renderer", refuse)
    monkeypatch.setattr(
        demo_physics, "simulate_reproductions", lambda _, pictures: asked.append(pictures) or nothing
    )
    said: list[str] = []
    section, tables = demo._in_physics(evaluation, said.append)
    assert (section, tables) == (nothing[0], (nothing[1],))
    assert asked == [False]
    assert "no film of the physics: nothing draws here" in "\n".join(said)


def test_the_valve_of_a_showing_is_the_recorded_one(evaluation: StructureEvaluation):
    """What is carried out is carried out on the task of that name."""
    assert RECORDED_VALVE.frames == tuple(frame.name for frame in evaluation.shown[0].frames)
