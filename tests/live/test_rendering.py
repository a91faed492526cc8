"""Rendering in a process without a screen; messages name what is missing and the fix."""

import os
import subprocess
import sys

import pytest
from drawing import needs_renderer

CHOICES = {"MUJOCO_GL", "PYOPENGL_PLATFORM", "DISPLAY", "WAYLAND_DISPLAY"}


def run_without_screen(code: str, **variables: str) -> str:
    """Return what a Python process without a screen prints."""
    bare = {k: v for k, v in os.environ.items() if k not in CHOICES}
    done = subprocess.run(
        [sys.executable, "-c", code], env=bare | variables, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    return done.stdout + done.stderr


REFUSED = """
from pilotfish.errors import SkillError
from pilotfish.rendering import {name}
for again in range({times}):
    try:
        {name}()
    except SkillError as error:
        print("refused:", error)
"""


@needs_renderer
def test_require_renderer_without_screen_finds_osmesa():
    assert run_without_screen("from pilotfish.rendering import require_renderer; require_renderer()") == ""


@pytest.mark.parametrize("value", ["glfw", "off"])
def test_require_renderer_without_renderer_names_package_and_variable(value: str):
    output = run_without_screen(REFUSED.format(name="require_renderer", times=3), MUJOCO_GL=value)
    assert output.startswith("refused: MuJoCo cannot render")
    assert output.count("refused") == 3
    assert "libosmesa6" in output
    assert "MUJOCO_GL=osmesa" in output


def test_require_mujoco_unknown_backend_names_valid_ones():
    output = run_without_screen(REFUSED.format(name="require_mujoco", times=1), MUJOCO_GL="nonsense")
    assert output.startswith("refused: MuJoCo cannot be imported with MUJOCO_GL=nonsense")
    assert "osmesa" in output


def test_command_line_without_mujoco_starts():
    """Learning and planning need no simulation."""
    code = (
        "import sys; sys.modules['mujoco'] = None\nimport pilotfish.cli.commands.perform, pilotfish.cli.main"
    )
    assert run_without_screen(code) == ""


def test_require_mujoco_without_mujoco_names_extra():
    output = run_without_screen(
        "import sys; sys.modules['mujoco'] = None\n" + REFUSED.format(name="require_mujoco", times=1)
    )
    assert "simulation needs mujoco: pip install '.[sim]' in the clone" in output


def test_require_mujoco_backend_that_cannot_load_names_package():
    """Another OpenGL library was loaded first."""
    output = run_without_screen(
        "import OpenGL.platform\n" + REFUSED.format(name="require_mujoco", times=1), MUJOCO_GL="osmesa"
    )
    assert output.startswith("refused: MuJoCo cannot be imported with MUJOCO_GL=osmesa")
    assert "libosmesa6" in output
