"""Pytest plugin that tests kernels from another build: -p sanitized_kernels.

SANITIZED_FOLDER is the folder of the build, SANITIZED_LEVEL its instruction set.
"""

import os
import sys
from importlib import import_module
from importlib.machinery import ExtensionFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path

FOLDER, LEVEL = Path(os.environ["SANITIZED_FOLDER"]), os.environ["SANITIZED_LEVEL"]


def load(name: str) -> None:
    """Load a module from the folder in place of the installed one."""
    (file,) = FOLDER.glob(f"{name}.*.so")
    full_name = f"pilotfish.kernels.{name}"
    loader = ExtensionFileLoader(full_name, str(file))
    spec = spec_from_loader(full_name, loader)
    assert spec
    sys.modules[full_name] = module_from_spec(spec)
    loader.exec_module(sys.modules[full_name])


load("_baseline")
if LEVEL == "baseline":
    sys.modules["pilotfish.kernels._baseline"].supports_v3 = lambda: False  # type: ignore[attr-defined]
else:
    load("_v3")


def pytest_report_header() -> str:
    """Return a line with the tested kernels, after checking that they are in use."""
    compiled = import_module("pilotfish.kernels.compiled")
    assert compiled.INSTRUCTION_SET == LEVEL, f"{compiled.INSTRUCTION_SET} is in use, expected {LEVEL}"
    assert Path(compiled._native.__file__).parent.samefile(FOLDER)
    return f"kernels: {LEVEL} of {FOLDER}"
