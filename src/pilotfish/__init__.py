"""Learn manipulation skills from a few demonstrations and reproduce them in new situations.

Import it as `import pilotfish as pf`. The public names by step:

    data        load, demonstration, datasets -> Demonstration with one Frame per object; add_derivatives,
                to_sphere
    learn       learn -> Fit, which holds a Skill; structures and durations are choices of the model
    compare     log_likelihood, select, relevance, select_frames
    files       save_skill, open_skill, save_stream, open_stream
    reproduce   reproduce does adapt -> plan -> track in one call; via_point
    stream      online: learn from one datapoint at a time
    errors      SkillError is the base class; InvalidInput is an argument that cannot be used

The packages hold the rest: `pilotfish.models`, `pilotfish.control`, `pilotfish.plots` and others.
"""

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

# Where each public name is defined. A package is imported when one of its names is first used, so that
# `import pilotfish` takes a few milliseconds. __init__.pyi says the same to static type checkers.
_PACKAGES = {
    "control": "track",
    "demonstrations": "Demonstration Frame demonstration add_derivatives to_sphere",
    "errors": "InvalidInput SkillError",
    "io": "datasets load open_skill open_stream save_skill save_stream",
    "models": "Fit Skill adapt learn log_likelihood online relevance select select_frames",
    "planning": "plan reproduce via_point",
}
_PACKAGE_OF = {name: package for package, names in _PACKAGES.items() for name in names.split()}
__all__ = sorted(_PACKAGE_OF)  # noqa: PLE0605 - a list, derived from the table
_NAMES_THERE = {"load": "read_demonstrations"}  # where the package calls it otherwise
_SUBPACKAGES = {
    **{
        package: package
        for package in (*_PACKAGES, "environments", "gaussians", "geometry", "kernels", "plots")
    },
    "durations": "models.durations",
    "simulation": "simulation",
    "structures": "gaussians.structures",
}


def __getattr__(name: str) -> Any:
    """Import a public name, or a package, at its first use."""
    if name in _PACKAGE_OF:
        package = import_module(f"{__name__}.{_PACKAGE_OF[name]}")
        value = getattr(package, _NAMES_THERE.get(name, name))
    elif name in _SUBPACKAGES:
        value = import_module(f"{__name__}.{_SUBPACKAGES[name]}")
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """List the public names and the packages, imported yet or not."""
    return sorted({*globals(), *__all__, *_SUBPACKAGES})
