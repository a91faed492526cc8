"""Learn manipulation skills from a few demonstrations and reproduce them in new situations.

A demonstration is a recording of a task with one frame (task parameter) per object. From a few of them
`learn` fits a task-parameterised hidden semi-Markov model (TP-HSMM): Gaussians in every frame, with
durations. `adapt` multiplies these Gaussians where the objects are now, `plan` turns the state sequence into
targets and weights, and `track` follows them by linear quadratic tracking (LQT). `reproduce` does the three
in one call.

Import it as `import pilotfish as pf`. The public names by step:

    demonstrate  load, datasets, demonstration -> Demonstration, with one Frame per object; add_derivatives
    learn        learn -> a fit that holds a Skill; choices: pf.structures, pf.durations
    compare      select candidates; relevance of frames
    keep         save_skill, open_skill
    reproduce    adapt, plan, track, or all in one: reproduce; via_point
    stream       online: learn from one datapoint at a time
    errors       SkillError is the base class; InvalidInput: an argument cannot be used

The packages hold the rest: `pf.models`, `pf.demonstrations`, `pf.planning`, `pf.control`, `pf.io`,
`pf.assistance`, `pf.plots`, `pf.simulation` and others.
"""

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

# The package of each public name. A package is imported when one of its names is first used, so that
# `import pilotfish` takes a few milliseconds. Keep __init__.pyi, for static type checkers, in step.
_PACKAGES = {
    "control": "track",
    "demonstrations": "Demonstration Frame demonstration add_derivatives",
    "errors": "InvalidInput SkillError",
    "io": "datasets load open_skill save_skill",
    "models": "Skill adapt learn online relevance select",
    "planning": "plan reproduce via_point",
}
_PACKAGE_OF = {name: package for package, names in _PACKAGES.items() for name in names.split()}
__all__ = sorted(_PACKAGE_OF)  # noqa: PLE0605 - a list, derived from the table
_NAMES_IN_PACKAGE = {"load": "read_demonstrations"}  # where the two differ
_SUBPACKAGES = {
    **{
        package: package
        for package in (*_PACKAGES, "assistance", "environments", "gaussians", "geometry", "kernels", "plots")
    },
    "durations": "models.durations",
    "panel": "panel",
    "simulation": "simulation",
    "structures": "gaussians.structures",
    "teleop": "teleop",
}


def __getattr__(name: str) -> Any:
    """Import a public name, or a package, at its first use."""
    if name in _PACKAGE_OF:
        package = import_module(f"{__name__}.{_PACKAGE_OF[name]}")
        value = getattr(package, _NAMES_IN_PACKAGE.get(name, name))
    elif name in _SUBPACKAGES:
        value = import_module(f"{__name__}.{_SUBPACKAGES[name]}")
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """List the public names and the packages, imported yet or not."""
    return sorted({*globals(), *__all__, *_SUBPACKAGES})
