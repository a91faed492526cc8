"""The public names of pilotfish, and the page of the reference on which each is documented.

A name that two packages export is documented once, on the page of the package that comes first in PACKAGES.
"""

import importlib
import inspect
from functools import cache
from typing import Any

PACKAGES = (
    "models.durations", "models.online", "models", "demonstrations", "gaussians.structures", "gaussians",
    "geometry", "control", "planning", "plots", "io.datasets", "io", "environments.human",
    "environments.tasks", "environments.baxter", "environments", "simulation", "kernels", "errors",
    "validation",
)  # fmt: skip


def public_members(package: str) -> dict[str, Any]:
    """Return the public names of a package of pilotfish, modules left out."""
    module = importlib.import_module(f"pilotfish.{package}" if package else "pilotfish")
    names = getattr(module, "__all__", None) or defined_names(module)
    members = {name: getattr(module, name) for name in names}
    return {name: value for name, value in members.items() if not inspect.ismodule(value)}


def defined_names(module: Any) -> list[str]:
    """Return the public functions and classes that a module without __all__ defines."""
    return [
        name
        for name, value in vars(module).items()
        if not name.startswith("_") and getattr(value, "__module__", "") == module.__name__
    ]


def has_docstring(value: Any) -> bool:
    """Return whether a value is a function or a class with a docstring."""
    return bool((inspect.isroutine(value) or inspect.isclass(value)) and inspect.getdoc(value))


@cache
def home_packages() -> dict[int, tuple[str, str]]:
    """Return the package and the name under which each public function and class is documented."""
    homes: dict[int, tuple[str, str]] = {}
    for package in PACKAGES:
        for name, value in public_members(package).items():
            if has_docstring(value):
                homes.setdefault(id(value), (package, name))
    return homes


@cache
def documented_names() -> dict[str, str]:
    """Return where each public name is documented, by name and by package.name, unless ambiguous."""
    targets: dict[str, set[str]] = {}
    for package in ("", *PACKAGES):
        for name, value in public_members(package).items():
            if id(value) in home_packages():
                target = "pilotfish." + ".".join(home_packages()[id(value)])
                for key in {name, f"{package}.{name}".lstrip("."), f"{package.rpartition('.')[2]}.{name}"}:
                    targets.setdefault(key, set()).add(target)
    front = {name: home_packages().get(id(value)) for name, value in public_members("").items()}
    unique = {name: found.pop() for name, found in targets.items() if len(found) == 1}
    return unique | {name: f"pilotfish.{'.'.join(home)}" for name, home in front.items() if home}
