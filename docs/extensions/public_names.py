"""The public names of pilotfish, and the page of the reference on which each is documented.

A name that two packages export is documented once, on the page of the package that comes first in PACKAGES.
"""

import importlib
import inspect
from collections.abc import Iterator
from functools import cache
from typing import Any

PACKAGES = (
    "models.durations", "models.online", "models", "demonstrations", "gaussians.structures", "gaussians",
    "geometry", "control", "planning", "assistance", "teleop", "plots", "panel", "io.datasets",
    "io.readers", "io.writers", "io", "environments.human", "environments.baxter", "environments.robots",
    "environments", "vision", "simulation", "cluster", "kernels", "errors", "validation",
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


def public_classes() -> Iterator[tuple[type, tuple[str, str]]]:
    """Yield each documented class with its package and name."""
    for package, name in home_packages().values():
        value = public_members(package)[name]
        if inspect.isclass(value):
            yield value, (package, name)


def public_methods(value: type) -> list[str]:
    """Return the names of the documented methods of a class, inherited ones from pilotfish included."""
    bases = [base for base in value.__mro__ if base.__module__.startswith("pilotfish")]
    members = {name: member for base in bases for name, member in vars(base).items() if name[0] != "_"}
    return [name for name, member in members.items() if callable(getattr(member, "__func__", member))]


@cache
def documented_names() -> dict[str, str]:
    """Return where each public name is documented, by name and by package.name, unless ambiguous."""
    targets: dict[str, set[str]] = {}
    for package in ("", *PACKAGES):
        for name, value in public_members(package).items():
            if id(value) in home_packages():
                target = "pilotfish." + ".".join(home_packages()[id(value)])
                for key in {name, f"{package}.{name}", f"{package.rpartition('.')[2]}.{name}"} - {f".{name}"}:
                    targets.setdefault(key, set()).add(target)
    for value, (package, name) in public_classes():
        for method in public_methods(value):
            for key in (f"{name}.{method}", f"{package}.{name}.{method}"):
                targets.setdefault(key, set()).add(f"pilotfish.{package}.{name}.{method}")
    front = {name: home_packages().get(id(value)) for name, value in public_members("").items()}
    unique = {name: found.pop() for name, found in targets.items() if len(found) == 1}
    return unique | {name: f"pilotfish.{'.'.join(home)}" for name, home in front.items() if home}
