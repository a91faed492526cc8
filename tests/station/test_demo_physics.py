"""The demonstration's skill opens the recorded valve in physics, and its report shows that it did."""

import sys
from dataclasses import replace
from io import BytesIO
from math import radians

import numpy as np
import pytest
from demonstrating import Demonstrated
from drawing import needs_renderer
from matplotlib.figure import Figure
from PIL import Image

from pilotfish.control import Motion
from pilotfish.demonstrations import Demonstration
from pilotfish.environments import RECORDED_VALVE, Verdict, Workcell
from pilotfish.errors import SkillError
from pilotfish.gaussians import SemiTied
from pilotfish.models import learn
from pilotfish.station import demo, demo_physics
from pilotfish.station.demo_physics import ABOUT, Opening, carried_out, opened
from pilotfish.station.evaluation import SETTINGS, STATES, TRAINED, replay
from pilotfish.station.lessons import Lesson
from pilotfish.station.report import Film, Picture, Section, Table
from pilotfish.store import datasets, synthetic_valve

SLOW = pytest.mark.slow  # the whole demonstration: eight openings of twenty seconds


def taught(shown: tuple[Demonstration, ...]) -> Lesson:
    """The demonstration's lesson with semi-tied covariances."""
    fit = learn(
        shown[:TRAINED],
        states=STATES,
        rng=np.random.default_rng(0),
        structure=SemiTied(),
        settings=SETTINGS,
    )
    own = tuple(replay(fit.skill, showing) for showing in shown)
    return Lesson(fit, SemiTied(), shown, own, own, 0.0)


@pytest.fixture(scope="module")
def lesson(data_folder: object) -> Lesson:
    return taught(datasets.valve())


@SLOW
def test_valves_are_opened(demonstrated: Demonstrated):
    """Of eight replays seven open the valve, four shown and three new; six at least on any machine, for one
    ends a twentieth of a degree within what counts. The valve with ten degrees to go is not opened.
    """
    openings = demonstrated.openings
    assert [opening.new for opening in openings] == [False] * 4 + [True] * 4
    open_ones = [opening.verdict.success for opening in openings]
    assert sum(open_ones) >= 6
    assert not open_ones[7]
    for opening in openings[:7]:
        assert opening.verdict.error < radians(12.0)
        assert opening.verdict.error < 0.2 * opening.turn
        assert 1.0 < opening.force < 80.0
        assert opening.away < 0.06


@SLOW
def test_the_table_says_how_each_went(demonstrated: Demonstrated, lesson: Lesson):
    """A row for each showing, in order: whether it was shown, whether it is open, angles in degrees."""
    measured, openings = demonstrated.measured, demonstrated.openings
    assert [row[0] for row in measured.rows] == [showing.name for showing in lesson.shown]
    assert [row[1] for row in measured.rows] == ["yes"] * 4 + ["no"] * 4
    for row, opening in zip(measured.rows, openings, strict=True):
        assert row[2] == ("yes" if opening.verdict.success else "no")
        assert float(row[3]) == pytest.approx(np.degrees(opening.turn), abs=0.5)
        assert float(row[4]) == pytest.approx(np.degrees(opening.verdict.error), abs=0.05)
        assert float(row[5]) == pytest.approx(opening.force, abs=0.5)
        assert float(row[6]) == pytest.approx(1000.0 * opening.away, abs=0.5)


@SLOW
@needs_renderer
def test_the_section_holds_one_film_and_its_moments(demonstrated: Demonstrated, lesson: Lesson):
    """Words, the table, a film of the first new situation, a frame for each row of the plan, six moments."""
    section, measured = demonstrated.section, demonstrated.measured
    words, shown, film, picture = section.parts
    assert (section.heading, words, shown) == ("In physics", ABOUT, measured)
    assert isinstance(film, Film)
    assert isinstance(picture, Picture)
    assert isinstance(picture.figure, Figure)
    assert lesson.shown[TRAINED].name in film.caption
    with Image.open(BytesIO(film.webp)) as opened_film:
        assert (opened_film.format, opened_film.n_frames) == ("WEBP", len(lesson.own[TRAINED].motion.x))
    assert len(picture.figure.axes) == 6


def still(lesson: Lesson, m: int) -> tuple[demo_physics.Replay, Demonstration]:
    """A replay that stays where it begins, for two seconds."""
    motion = lesson.own[m].motion
    x = np.tile(motion.x[0], (20, 1))
    return replace(
        lesson.own[m], motion=Motion(x, np.zeros((19, motion.u.shape[1])), motion.period)
    ), lesson.shown[m]


@pytest.mark.parametrize("m", range(8))
def test_to_do_nothing_is_not_to_open(lesson: Lesson, m: int):
    """The arm that stays where the person began leaves every valve as it was."""
    made = carried_out(*still(lesson, m), m >= TRAINED, None)
    assert not made.verdict.success
    assert made.verdict.error == pytest.approx(made.turn, abs=1e-3)
    assert made.force < 5.0


@pytest.mark.parametrize("m", [1, 5, 7])
def test_the_gripper_shuts_at_the_handle_and_opens_where_it_is_to_be(
    lesson: Lesson, m: int, monkeypatch: pytest.MonkeyPatch
):
    """Shut from the row of the plan that is nearest to the handle before the turn, until that, of those after
    it, which is nearest to the handle after the turn; each row is asked for a period.
    """
    asked: list[tuple[np.ndarray, float, int]] = []

    class Noted(Workcell):  # type: ignore[type-arg]
        def follow(self, target: object, grip: float, ticks: int) -> None:
            asked.append((target.position, grip, ticks))

    monkeypatch.setattr(demo_physics, "Workcell", Noted)
    carried_out(lesson.own[m], lesson.shown[m], True, None)
    places, grips, ticks = (np.array(column) for column in zip(*asked, strict=True))
    assert np.array_equal(places, lesson.own[m].motion.x[:, :3])
    assert set(ticks) == {100}
    before, after = (np.linalg.norm(places - frame.b[:3], axis=1) for frame in lesson.shown[m].frames)
    shut = np.flatnonzero(grips)
    assert shut[0] == np.argmin(before)
    assert shut[-1] + 1 == shut[0] + np.argmin(after[shut[0] :])
    assert np.all(grips[shut[0] : shut[-1] + 1] == 1.0)


@SLOW
def test_generated_openings_are_carried_out_too(unchecked: None):
    """A skill that was learned from generated data opens the valve that this was generated for."""
    shown = synthetic_valve(np.random.default_rng(0))
    lesson = taught(shown)
    made = carried_out(lesson.own[6], shown[6], True, None)
    assert made.verdict.success, made.verdict.why
    assert made.name == shown[6].name


def test_without_pictures_there_is_a_table_alone(lesson: Lesson, monkeypatch: pytest.MonkeyPatch):
    """Nothing is filmed, and the words stay."""
    row = Opening("x", True, Verdict(False, 0.1, "so"), 0.2, 3.0, 0.01)
    monkeypatch.setattr(demo_physics, "carried_out", lambda *given: row if given[-1] is None else 1 / 0)
    section, measured = opened(lesson, pictures=False)
    assert section.parts == (ABOUT, measured)
    assert measured.rows == (("x", "no", "no", "11", "5.7", "3", "10"),) * 8


def test_without_mujoco_the_report_says_what_is_missing(lesson: Lesson, monkeypatch: pytest.MonkeyPatch):
    """No table, a paragraph with the remedy, and the same words on the terminal."""
    monkeypatch.setitem(sys.modules, "mujoco", None)
    said: list[str] = []
    section, tables = demo._in_physics(lesson, said.append)
    assert tables == ()
    assert section.heading == "In physics"
    for words in (*section.parts, *said):
        assert isinstance(words, str)
        assert "not carried out" in words
        assert "pip install 'pilotfish[sim]'" in words
    assert len(section.parts) == len(said) == 1


def test_without_a_renderer_the_valve_is_opened_without_a_film(
    lesson: Lesson, monkeypatch: pytest.MonkeyPatch
):
    """The terminal says why there is no film; everything else is there."""

    def refuse() -> None:
        raise SkillError("nothing draws here")

    asked: list[bool] = []
    nothing = Section("In physics", ()), Table("t", ("a",), (("b",),))
    monkeypatch.setattr(demo, "require_renderer", refuse)
    monkeypatch.setattr(demo_physics, "opened", lambda _, pictures: asked.append(pictures) or nothing)
    said: list[str] = []
    section, tables = demo._in_physics(lesson, said.append)
    assert (section, tables) == (nothing[0], (nothing[1],))
    assert asked == [False]
    assert "no film of the physics: nothing draws here" in "\n".join(said)


def test_the_valve_of_a_showing_is_the_recorded_one(lesson: Lesson):
    """What is carried out is carried out on the task of that name."""
    assert RECORDED_VALVE.frames == tuple(frame.name for frame in lesson.shown[0].frames)
