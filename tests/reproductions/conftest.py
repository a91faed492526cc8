"""Fixtures that import the reproductions from their files."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest

FOLDER = Path(__file__).parents[2] / "reproductions"


def script(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"reproduce_{name}", FOLDER / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look themselves up there
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def chicken_dance() -> ModuleType:
    return script("chicken_dance")


@pytest.fixture(scope="session")
def segmentation() -> ModuleType:
    return script("segmentation")


@pytest.fixture(scope="session")
def robotasks() -> ModuleType:
    return script("robotasks")


@pytest.fixture(scope="session")
def peers() -> ModuleType:
    return script("peers")


@pytest.fixture(scope="session")
def online_stages() -> ModuleType:
    return script("online_stages")


@pytest.fixture(scope="session")
def online_zshape() -> ModuleType:
    return script("online_zshape")


@pytest.fixture(scope="session")
def online_dimensions() -> ModuleType:
    return script("online_dimensions")


@pytest.fixture(scope="session")
def online_valve() -> ModuleType:
    return script("online_valve")


@pytest.fixture(scope="module")
def online_tasks() -> ModuleType:
    return script("online_tasks")


@pytest.fixture(scope="session")
def joint_models() -> ModuleType:
    return script("joint_models")


@pytest.fixture(scope="session")
def assistance_models() -> ModuleType:
    return script("assistance_models")


@pytest.fixture(scope="session")
def assistance_figures() -> ModuleType:
    return script("assistance_figures")
