"""The examples in docstrings run and print what they display."""

import doctest
import importlib
from pathlib import Path

import numpy as np
import pytest

import pilotfish as pf

SOURCE = Path(__file__).parents[1] / "src"
MODULES = sorted(
    ".".join(file.relative_to(SOURCE).with_suffix("").parts).removesuffix(".__init__")
    for file in SOURCE.rglob("*.py")
    if ">>> " in file.read_text(encoding="utf-8")
)


@pytest.mark.parametrize("name", MODULES)
def test_docstring_examples_print_what_they_display(name: str, unchecked):
    module = importlib.import_module(name)
    finder, runner = doctest.DocTestFinder(exclude_empty=True), doctest.DocTestRunner()
    output: list[str] = []
    for example in finder.find(module, name, extraglobs={"np": np, "pf": pf}):
        runner.run(example, out=output.append)
    assert not runner.failures, "".join(output)
