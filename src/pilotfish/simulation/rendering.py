"""What draws pictures of the physics on this machine; MuJoCo decides that when it is imported."""

import os
import sys
from collections.abc import Callable, Mapping
from ctypes.util import find_library

from pilotfish.errors import SkillError

VARIABLE = "MUJOCO_GL"
DISPLAY_VARIABLES = ("DISPLAY", "WAYLAND_DISPLAY")
HEADLESS_BACKENDS = {
    "osmesa": "OSMesa",
    "egl": "EGL",
}  # what draws without a screen, the quicker one first; its library
REMEDY = "leave it unset, or set it to osmesa (apt-get install libosmesa6)"


def headless_backend(variables: Mapping[str, str], find: Callable[[str], str | None]) -> str | None:
    """What MUJOCO_GL is to be; None where it is set already, a screen is there, or nothing is found."""
    if variables.get(VARIABLE) or any(variables.get(screen) for screen in DISPLAY_VARIABLES):
        return None
    return next((name for name, library in HEADLESS_BACKENDS.items() if find(library)), None)


def require_mujoco() -> None:
    """MuJoCo is imported, with what can draw here. To be asked before anything else imports it.

    Raises: SkillError, when it is not installed, or MUJOCO_GL names what is not there.
    """
    if (
        "mujoco" not in sys.modules
        and sys.platform == "linux"
        and (name := headless_backend(os.environ, find_library))
    ):
        os.environ[VARIABLE] = name
    try:
        import mujoco  # noqa: F401
    except ImportError as error:
        raise SkillError(f"simulation needs {error.name or error}: pip install 'pilotfish[sim]'") from error
    except (
        RuntimeError,
        AttributeError,
    ) as error:  # so it ends where MUJOCO_GL names a library that is missing
        chosen = os.environ.get(VARIABLE)
        raise SkillError(f"MuJoCo does not start with {VARIABLE}={chosen} ({error}): {REMEDY}") from error


def require_renderer() -> None:
    """Raises: SkillError, when the physics cannot be drawn here. To be asked before the work."""
    require_mujoco()
    import mujoco

    from pilotfish.environments import SceneRenderer  # needs MuJoCo

    SceneRenderer(mujoco.MjSpec().compile(), width=1, height=1).close()
