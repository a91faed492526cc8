"""Every public name has a docstring with its arguments and its result."""

import dataclasses
import importlib
import inspect
import pkgutil
from collections.abc import Iterator
from typing import Any

import pytest

import pilotfish

PACKAGES = [
    "pilotfish",
    *(
        module.name
        for module in pkgutil.walk_packages(pilotfish.__path__, "pilotfish.")
        if module.ispkg and not module.name.startswith("pilotfish.cli")
    ),
]


def public_objects() -> Iterator[tuple[str, Any]]:
    """Yield every public function, class and method, under the name by which a user finds it."""
    found: set[int] = set()
    for package in PACKAGES:
        module = importlib.import_module(package)
        for name in getattr(module, "__all__", []):
            value = getattr(module, name)
            if not (inspect.isfunction(value) or inspect.isclass(value)) or id(value) in found:
                continue
            found.add(id(value))
            yield f"{package}.{name}", value
            if inspect.isclass(value):
                for method, member in vars(value).items():
                    function = getattr(member, "__func__", getattr(member, "fget", member))
                    if not method.startswith("_") and inspect.isfunction(function):
                        yield f"{package}.{name}.{method}", member


OBJECTS = dict(public_objects())


def arguments_of(value: Any) -> list[str]:
    function = getattr(value, "__func__", value)
    if isinstance(value, property) or not inspect.isfunction(function):
        return []
    return [name for name in inspect.signature(function).parameters if name not in ("self", "cls")]


def docstring_faults(value: Any) -> list[str]:
    """Return what the docstring of a public object lacks."""
    text = inspect.getdoc(getattr(value, "__func__", value)) or ""
    if not text.strip():
        return ["no docstring"]
    faults = []
    section = text.partition("Args:")[2]
    faults += [f"no {name} in Args" for name in arguments_of(value) if f"{name}:" not in section]
    if dataclasses.is_dataclass(value) and "__doc__" in vars(value):
        section = text.partition("Attributes:")[2]
        fields = [field.name for field in dataclasses.fields(value) if not field.name.startswith("_")]
        faults += [f"no {name} in Attributes" for name in fields if f"{name}:" not in section]
    function = getattr(value, "__func__", value)
    if inspect.isfunction(function) and not isinstance(value, property):
        returns = inspect.signature(function).return_annotation
        states_result = (
            text.split()[0] in ("Return", "Yield", "Compute", "Create")
            or "Returns:" in text
            or "Yields:" in text
        )
        if returns not in (None, "None", inspect.Signature.empty) and not states_result:
            faults.append(
                "no Returns, and the first line does not begin with Return, Yield, Compute or Create"
            )
    return faults


@pytest.mark.parametrize("name", sorted(OBJECTS))
def test_public_object_documents_arguments_and_result(name: str):
    assert not docstring_faults(OBJECTS[name])
