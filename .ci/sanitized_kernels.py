"""Run pytest on kernels built elsewhere: -p sanitized_kernels, SANITIZED_FOLDER and SANITIZED_LEVEL."""

import os
import sys
from importlib.machinery import ExtensionFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path

FOLDER, LEVEL = Path(os.environ["SANITIZED_FOLDER"]), os.environ["SANITIZED_LEVEL"]


def load(name: str) -> None:
    """Load a module of that folder in place of the installed one."""
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
    """Say which kernels run, after making sure that they do."""
    compiled = __import__("pilotfish.kernels.compiled", fromlist=["LEVEL"])
    assert compiled.LEVEL == LEVEL, f"{compiled.LEVEL} runs, expected {LEVEL}"
    assert Path(compiled._native.__file__).parent.samefile(FOLDER)
    return f"kernels: {LEVEL} of {FOLDER}"
