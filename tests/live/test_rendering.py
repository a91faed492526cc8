"""Another Python, without a screen: what draws is found, and what is missing is named with its remedy."""

import os
import subprocess
import sys

import pytest
from drawing import needs_renderer

CHOICES = {"MUJOCO_GL", "PYOPENGL_PLATFORM", "DISPLAY", "WAYLAND_DISPLAY"}


def told(code: str, **variables: str) -> str:
    """What another Python without a screen prints when it runs the code."""
    bare = {k: v for k, v in os.environ.items() if k not in CHOICES}
    done = subprocess.run(
        [sys.executable, "-c", code], env=bare | variables, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    return done.stdout + done.stderr


REFUSED = """
from pilotfish.errors import SkillError
from pilotfish.simulation.rendering import {name}
for again in range({times}):
    try:
        {name}()
    except SkillError as error:
        print("refused:", error)
"""


@needs_renderer
def test_without_a_screen_and_a_word_pictures_are_drawn():
    """Nothing but the library is needed."""
    assert told("from pilotfish.simulation.rendering import require_renderer; require_renderer()") == ""


@pytest.mark.parametrize("value", ["glfw", "off"])
def test_where_nothing_draws_the_remedy_is_told(value: str):
    """The refusal names the package and the variable, without noise before it, however often one asks."""
    words = told(REFUSED.format(name="require_renderer", times=3), MUJOCO_GL=value)
    assert words.startswith("refused: nothing draws")
    assert words.count("refused") == 3
    assert "libosmesa6" in words
    assert "MUJOCO_GL=osmesa" in words


def test_a_word_that_mujoco_does_not_know_is_refused():
    """The refusal gives the word and what it may be."""
    words = told(REFUSED.format(name="require_mujoco", times=1), MUJOCO_GL="nonsense")
    assert words.startswith("refused: MuJoCo does not start with MUJOCO_GL=nonsense")
    assert "osmesa" in words


def test_without_mujoco_the_extra_is_named():
    """The refusal tells how to install it."""
    words = told(
        "import sys; sys.modules['mujoco'] = None\n" + REFUSED.format(name="require_mujoco", times=1)
    )
    assert "simulation needs mujoco: pip install 'pilotfish[sim]'" in words


def test_a_library_that_is_not_to_be_had_is_told():
    """MUJOCO_GL=osmesa, where another library of OpenGL came first, is refused in words of ours."""
    words = told(
        "import OpenGL.platform\n" + REFUSED.format(name="require_mujoco", times=1), MUJOCO_GL="osmesa"
    )
    assert words.startswith("refused: MuJoCo does not start with MUJOCO_GL=osmesa")
    assert "libosmesa6" in words
