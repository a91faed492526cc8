"""Version, changelog, README, constraints and imports agree; no file names a machine."""

import ast
import importlib
import importlib.metadata
import inspect
import re
import shutil
import subprocess
import sys
import sysconfig
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import pilotfish as pf
from pilotfish import kernels

TOP = Path(__file__).parents[1]


def read(name: str) -> str:
    return (TOP / name).read_text(encoding="utf-8")


PROJECT = tomllib.loads(read("pyproject.toml"))["project"]
README = read("README.md")

# Brackets around one letter: otherwise these lines would match themselves.
NAMES_A_MACHINE = re.compile(
    r"(?<![\w.$}~])/(hom[e]|roo[t]|User[s]|wor[k]|far[m]|op[t]|mn[t]|sr[v]|tm[p])/"
    r"|pyp[i]\.org|pythonhoste[d]\.org|registry\.npmj[s]|de[b]\.debian|files\.pythonhoste[d]|--index-ur[l]"
)


def tracked_text_files() -> list[Path]:
    """Return every text file that git tracks or would track."""
    if not (TOP / ".git").exists() or shutil.which("git") is None:
        pytest.skip("not a git checkout: tracked files are unknown")
    command = ["git", "-C", str(TOP), "ls-files", "--cached", "--others", "--exclude-standard"]
    names = subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()
    files = [TOP / name for name in names if (TOP / name).is_file()]
    return [file for file in files if b"\0" not in file.read_bytes()[:8192]]


def test_version_of_package_project_and_install_agree():
    assert pf.__version__ == PROJECT["version"] == importlib.metadata.version("pilotfish")


def test_changelog_has_a_section_for_this_version():
    assert re.search(rf"^## \[{re.escape(PROJECT['version'])}\]", read("CHANGELOG.md"), re.MULTILINE)


@pytest.mark.parametrize("file", ["README.md", "CONTRIBUTING.md", "docs/index.md"])
def test_make_targets_in_text_exist(file: str):
    targets = set(re.findall(r"^([a-z]+):", read("Makefile"), re.MULTILINE))
    mentioned = set(re.findall(r"(?:^|`)make ([a-z]+)", read(file), re.MULTILINE))
    assert mentioned <= targets


@pytest.mark.parametrize("file", ["README.md", "CONTRIBUTING.md", "docs/index.md"])
def test_links_to_files_exist(file: str):
    links = re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", read(file))
    missing = [link for link in links if not (TOP / file).parent.joinpath(link).exists()]
    assert not missing


def test_files_named_in_contributing_exist():
    names = re.findall(r"`([\w/.-]+/[\w.-]+\.(?:py|txt))`", read("CONTRIBUTING.md"))
    assert len(names) >= 8
    assert not [
        name for name in names if not any((TOP / top / name).exists() for top in ("", "src/pilotfish"))
    ]


def test_no_file_names_a_machine_or_a_package_index():
    found = [
        f"{file.relative_to(TOP)}:{number}: {line.strip()[:80]}"
        for file in tracked_text_files()
        if file.suffix != ".svg"
        for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), start=1)
        if NAMES_A_MACHINE.search(line)
    ]
    assert not found, "\n".join(found)


def test_constraints_are_sorted_names_and_versions():
    lines = read("constraints.txt").splitlines()
    malformed = [line for line in lines if not re.fullmatch(r"[a-z0-9][a-z0-9-]*==\d[\w.]*", line)]
    assert not malformed, f"expected name==version, found {malformed}"
    names = [line.split("==")[0] for line in lines]
    assert names == sorted(set(names))


def test_constraints_pin_every_dependency():
    required = [*PROJECT["dependencies"], *tomllib.loads(read("pyproject.toml"))["build-system"]["requires"]]
    required += [line for extra in PROJECT["optional-dependencies"].values() for line in extra]
    names = {re.split(r"[\[<>=~!; ]", line)[0].lower() for line in required} - {"pilotfish"}
    pinned = {line.split("==")[0] for line in read("constraints.txt").splitlines()}
    assert names <= pinned, f"constraints.txt lacks {sorted(names - pinned)}"


def test_annotation_violated_raises(checked: None):
    with pytest.raises(Exception, match=r"(?i)type-check"):
        pf.control.double_integrator("three", period=0.1)  # type: ignore[arg-type]


def test_kernels_with_a_compiler_are_compiled():
    headers = Path(sysconfig.get_path("include"), "Python.h")
    if not headers.exists() or not any(map(shutil.which, ("c++", "g++", "clang++"))):
        pytest.skip("no C++ compiler or no Python.h: the NumPy references run")
    assert kernels.BACKEND != "numpy", "run: python -m pip install -v --no-build-isolation --no-deps -e ."


def modules_after(program: str) -> set[str]:
    """Return what a fresh process has imported after a program."""
    command = [sys.executable, "-W", "ignore", "-c", f"{program}; import sys; print(*sys.modules)"]
    return set(subprocess.run(command, check=True, capture_output=True, text=True).stdout.split())


def test_import_loads_no_package():
    loaded = modules_after("import pilotfish")
    assert not [name for name in loaded if name.startswith(("numpy", "jaxtyping", "pilotfish."))]


def test_import_of_every_public_name_loads_nothing_slow():
    slow = {"scipy", "matplotlib", "pooch", "safetensors", "click", "tqdm", "jaxtyping"}
    loaded = modules_after("import pilotfish; [getattr(pilotfish, name) for name in pilotfish.__all__]")
    assert "pilotfish.models" in loaded
    assert not loaded & (slow | {"pilotfish.cli", "pilotfish.plots"})


def test_stub_imports_every_public_name_from_its_package():
    stub = ast.parse(read("src/pilotfish/__init__.pyi"))
    modules = {name for name in pf.__dir__() if inspect.ismodule(getattr(pf, name))} - set(pf.__all__)
    imported = {
        alias.asname or alias.name: getattr(importlib.import_module(node.module or ""), alias.name)
        for node in stub.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert sorted(imported.keys() - modules) == pf.__all__
    assert all(getattr(pf, name) is value for name, value in imported.items())
    (public,) = (node.value for node in stub.body if isinstance(node, ast.Assign))
    assert sorted(ast.literal_eval(public)) == pf.__all__


def python_blocks(text: str) -> list[str]:
    return re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


def test_readme_programs_reproduce_adapt_and_stream(data_folder: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("PILOTFISH_DATA", str(data_folder))
    names: dict[str, Any] = {}
    for program in python_blocks(README):
        exec(compile(program, "README.md", "exec"), names)  # noqa: S102 - our own text
    test = names["test"].x
    assert np.all(np.isfinite(names["x"]))
    assert np.linalg.norm(names["x"][:, :3] - test[:, :3], axis=1).mean() < 0.07  # m; a new situation
    np.testing.assert_allclose(names["reference"].targets[40, :3], [0.44, -0.95, 0.31], atol=1e-3)
    assert np.linalg.norm(names["motion"].x[40, :3] - [0.44, -0.95, 0.31]) < 2e-3
    assert names["model"].datapoints == 1000
    assert np.all(np.isfinite(names["skill"].means))


def test_readme_is_short():
    assert len(README.splitlines()) < 120
