"""Choice of MuJoCo's rendering backend, which MuJoCo reads once, when it is imported."""

import os
import sys
from collections.abc import Callable, Mapping
from ctypes.util import find_library

from pilotfish.errors import SkillError

VARIABLE = "MUJOCO_GL"
DISPLAY_VARIABLES = ("DISPLAY", "WAYLAND_DISPLAY")
# Backends that need no display, the faster one first, and their libraries.
HEADLESS_BACKENDS = {"osmesa": "OSMesa", "egl": "EGL"}
REMEDY = "leave it unset, or set it to osmesa (apt-get install libosmesa6)"


def headless_backend(variables: Mapping[str, str], find: Callable[[str], str | None]) -> str | None:
    """Return a value for MUJOCO_GL; None if it is set, a display exists, or no library is found."""
    if variables.get(VARIABLE) or any(variables.get(display) for display in DISPLAY_VARIABLES):
        return None
    return next((name for name, library in HEADLESS_BACKENDS.items() if find(library)), None)


def require_mujoco() -> None:
    """Import MuJoCo with a rendering backend that works here; call it before anything else imports MuJoCo.

    Raises:
        SkillError: If MuJoCo is not installed, or MUJOCO_GL names a missing backend.
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
        raise SkillError(
            f"simulation needs {error.name or error}: pip install '.[sim]' in the clone"
        ) from error
    except (RuntimeError, AttributeError) as error:  # MuJoCo's errors for a missing library
        chosen = os.environ.get(VARIABLE)
        raise SkillError(f"MuJoCo cannot be imported with {VARIABLE}={chosen} ({error}): {REMEDY}") from error


def require_renderer() -> None:
    """Check that MuJoCo can render here, before a long computation.

    Raises:
        SkillError: If it cannot.
    """
    require_mujoco()
    import mujoco

    from pilotfish.environments import SceneRenderer  # needs MuJoCo

    SceneRenderer(mujoco.MjSpec().compile(), width=1, height=1).close()
