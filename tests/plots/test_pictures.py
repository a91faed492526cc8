"""What holds of every picture: it is drawn without a warning, labelled with units, and nothing is cut or covered."""

import re
import subprocess
import sys
from collections.abc import Callable

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from pilotfish import plots
from pilotfish.control import Feedback
from pilotfish.demonstrations import Demonstration, Frame
from pilotfish.models import AdaptedSkill, Fit, Skill

PICTURES = (
    "demonstrations_seen",
    "state_graph",
    "forward_variable",
    "reproduction",
    "tracked_coordinates",
    "gains",
    "deviations",
    "basis_vectors",
    "component_correlations",
    "likelihood_trace",
)
COUNTS = {"state", "iteration", "basis vector (first is 0)"}  # axes of numbers that have no unit
Draw = Callable[[str], Figure]


@pytest.fixture
def draw(
    skill: Skill,
    make_skill: Callable[..., Skill],
    demonstrations: tuple[Demonstration, ...],
    frames: tuple[Frame, ...],
    adapted: AdaptedSkill,
    states: np.ndarray,
    feedback: Feedback,
    fit: Fit,
) -> Draw:
    """Each picture of the room by its name, drawn from the same small skill."""
    tied, human = make_skill(tied=True), demonstrations[0]
    motion = feedback.rollout(human.x[0])
    calls: dict[str, Callable[[], Figure]] = {
        "demonstrations_seen": lambda: plots.demonstrations_seen(skill, demonstrations),
        "state_graph": lambda: plots.state_graph(skill),
        "forward_variable": lambda: plots.forward_variable(skill, horizon=40),
        "reproduction": lambda: plots.reproduction(adapted, motion, frames, human=human),
        "tracked_coordinates": lambda: plots.tracked_coordinates(adapted, states, motion, human=human),
        "gains": lambda: plots.gains(feedback, adapted.layout),
        "deviations": lambda: plots.deviations(skill),
        "basis_vectors": lambda: plots.basis_vectors(tied),
        "component_correlations": lambda: plots.component_correlations([skill, tied]),
        "likelihood_trace": lambda: plots.likelihood_trace([fit, fit]),
    }
    return lambda name: calls[name]()


def drawn(figure: Figure) -> FigureCanvasAgg:
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return canvas


def test_every_picture_of_the_room_is_tried(draw: Draw):
    """The laws below hold of every function of the room that makes a figure."""
    others = {"MOST_STATES", "state_colour"}
    assert set(PICTURES) == set(plots.__all__) - others


@pytest.mark.parametrize("name", PICTURES)
def test_nothing_is_cut_off(name: str, draw: Draw):
    """All that is drawn, texts above all, lies inside the figure."""
    figure = draw(name)
    canvas = drawn(figure)
    box = figure.get_tightbbox(canvas.get_renderer())  # inches
    width, height = figure.get_size_inches()
    slack = 1.5 / figure.dpi  # antialiasing
    assert box.x0 >= -slack
    assert box.y0 >= -slack
    assert box.x1 <= width + slack
    assert box.y1 <= height + slack


@pytest.mark.parametrize("name", PICTURES)
def test_every_axis_has_a_label_with_its_unit(name: str, draw: Draw):
    """Each visible axis says what it shows and in which unit, unless it only counts or shares a label."""
    figure = draw(name)
    drawn(figure)
    for axes in figure.axes:
        if not axes.axison or axes.get_label() == "<colorbar>":
            continue
        for label, ticks in (
            (axes.get_xlabel(), axes.get_xticklabels()),
            (axes.get_ylabel(), axes.get_yticklabels()),
        ):
            texts = [tick.get_text() for tick in ticks if tick.get_visible() and tick.get_text()]
            named = texts and all(re.search(r"\[.+\]$", text) for text in texts)  # rows of a heat map
            assert not texts or named or label in COUNTS or re.search(r"\[.+\]$", label), (label, texts)


@pytest.mark.parametrize("name", PICTURES)
def test_legends_cover_no_data(name: str, draw: Draw):
    """The legend of a sheet lies outside all of its panels, and no panel has one of its own."""
    figure = draw(name)
    renderer = drawn(figure).get_renderer()
    for legend in figure.legends:
        box = legend.get_window_extent(renderer)
        for axes in figure.axes:
            assert not box.overlaps(axes.get_window_extent(renderer))
    assert not any(axes.get_legend() for axes in figure.axes)


@pytest.mark.parametrize("name", PICTURES)
def test_the_settings_of_matplotlib_are_left_alone(name: str, draw: Draw):
    """Drawing changes no global setting."""
    before = dict(mpl.rcParams)
    drawn(draw(name))
    assert dict(mpl.rcParams) == before


def test_drawing_needs_no_pyplot():
    """The room does not load pyplot, which keeps figures alive and picks a window system."""
    program = "import sys, pilotfish.plots; sys.exit('matplotlib.pyplot' in sys.modules)"
    assert subprocess.run([sys.executable, "-W", "ignore", "-c", program], check=False).returncode == 0


@pytest.mark.parametrize("count", [1, 2, 20])
def test_few_and_many_states_fit(count: int, make_skill: Callable[..., Skill]):
    """Pictures of a skill with one state, or with twenty, keep all texts inside."""
    skill = make_skill(count, ("world",))
    for figure in (
        plots.state_graph(skill),
        plots.forward_variable(skill, horizon=30),
        plots.deviations(skill),
        plots.component_correlations([skill]),
    ):
        canvas = drawn(figure)
        box = figure.get_tightbbox(canvas.get_renderer())
        width, height = figure.get_size_inches()
        assert box.x0 >= -0.02
        assert box.y0 >= -0.02
        assert box.x1 <= width + 0.02
        assert box.y1 <= height + 0.02
