"""What is written about the house is true: version, changes, README, constraints; no machine is named."""

import ast
import importlib
import importlib.metadata
import re
import shutil
import subprocess
import sys
import sysconfig
import tomllib
from pathlib import Path

import numpy as np
import pytest

import pilotfish as pf
from pilotfish import kernels

TOP = Path(__file__).parents[1]


def read(name: str) -> str:
    return (TOP / name).read_text(encoding="utf-8")


PROJECT = tomllib.loads(read("pyproject.toml"))["project"]
README = read("README.md")

# Brackets around one letter keep these lines from naming what they look for.
NAMES_A_MACHINE = re.compile(
    r"(?<![\w.$}~])/(hom[e]|roo[t]|User[s]|wor[k]|far[m]|op[t]|mn[t]|sr[v]|tm[p])/"
    r"|pyp[i]\.org|pythonhoste[d]\.org|registry\.npmj[s]|de[b]\.debian|files\.pythonhoste[d]|--index-ur[l]"
)


def tracked() -> list[Path]:
    """Every text file that is, or is about to be, in the repository."""
    if not (TOP / ".git").exists() or shutil.which("git") is None:
        pytest.skip("not a git checkout: what is tracked cannot be told")
    command = ["git", "-C", str(TOP), "ls-files", "--cached", "--others", "--exclude-standard"]
    names = subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()
    files = [TOP / name for name in names if (TOP / name).is_file()]
    return [file for file in files if b"\0" not in file.read_bytes()[:8192]]


def test_one_version_everywhere():
    """The front door, the project file and the installed package tell the same version."""
    assert pf.__version__ == PROJECT["version"] == importlib.metadata.version("pilotfish")


def test_the_changelog_tells_of_this_version():
    """Users find what this version brought under a heading of its own."""
    assert re.search(rf"^## {re.escape(PROJECT['version'])}\b", read("CHANGELOG.md"), re.MULTILINE)


@pytest.mark.parametrize("file", ["README.md", "CONTRIBUTING.md", "docs/index.md"])
def test_every_make_command_that_is_promised_exists(file: str):
    """A reader may type any `make TARGET` that the text shows."""
    targets = set(re.findall(r"^([a-z]+):", read("Makefile"), re.MULTILINE))
    promised = set(re.findall(r"(?:^|`)make ([a-z]+)", read(file), re.MULTILINE))
    assert promised <= targets, f"{file} promises {promised - targets}"


@pytest.mark.parametrize("file", ["README.md", "CONTRIBUTING.md", "docs/index.md"])
def test_every_link_to_a_file_leads_somewhere(file: str):
    """Links inside the repository point to files that are there."""
    links = re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", read(file))
    missing = [link for link in links if not (TOP / file).parent.joinpath(link).exists()]
    assert not missing, f"{file} links to {missing}"


def test_no_file_names_a_machine_or_a_package_index():
    """The repository works anywhere: it holds no path of one machine and no address of an index or mirror."""
    found = [
        f"{file.relative_to(TOP)}:{number}: {line.strip()[:80]}"
        for file in tracked()
        if file.suffix != ".svg"
        for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), start=1)
        if NAMES_A_MACHINE.search(line)
    ]
    assert not found, "\n".join(found)


def test_constraints_are_names_and_versions():
    """Every line of constraints.txt reads name==version: no address, no path, no range, nothing twice."""
    lines = read("constraints.txt").splitlines()
    odd = [line for line in lines if not re.fullmatch(r"[a-z0-9][a-z0-9-]*==\d[\w.]*", line)]
    assert not odd, f"expected name==version, found {odd}"
    names = [line.split("==")[0] for line in lines]
    assert names == sorted(set(names))


def test_constraints_hold_all_that_is_asked_for():
    """What pilotfish, its extras and its build ask for has a version in constraints.txt."""
    asked = [*PROJECT["dependencies"], *tomllib.loads(read("pyproject.toml"))["build-system"]["requires"]]
    asked += [line for extra in PROJECT["optional-dependencies"].values() for line in extra]
    names = {re.split(r"[\[<>=~!; ]", line)[0].lower() for line in asked} - {"pilotfish"}
    held = {line.split("==")[0] for line in read("constraints.txt").splitlines()}
    assert names <= held, f"constraints.txt lacks {sorted(names - held)}"


def test_shapes_in_annotations_are_checked():
    """The test run refuses an array whose shape is not the annotated one."""
    with pytest.raises(Exception, match=r"(?i)type-check"):
        pf.control.double_integrator("three", period=0.1)  # type: ignore[arg-type]


def test_kernels_are_compiled_where_they_can_be():
    """With a compiler and Python's headers at hand, an install on the twins has hidden a failure."""
    headers = Path(sysconfig.get_path("include"), "Python.h")
    if not headers.exists() or not any(map(shutil.which, ("c++", "g++", "clang++"))):
        pytest.skip("no C++ compiler or no Python.h: the NumPy references run")
    assert kernels.BACKEND != "numpy", "run: python -m pip install -v --no-build-isolation --no-deps -e ."


def modules_after(program: str) -> set[str]:
    """Return what a fresh process has imported after a program."""
    command = [sys.executable, "-W", "ignore", "-c", f"{program}; import sys; print(*sys.modules)"]
    return set(subprocess.run(command, check=True, capture_output=True, text=True).stdout.split())


def test_import_pilotfish_loads_no_package_before_its_first_use():
    """`import pilotfish` itself loads nothing, not even NumPy."""
    loaded = modules_after("import pilotfish")
    assert not [name for name in loaded if name.startswith(("numpy", "jaxtyping", "pilotfish."))]


def test_import_every_public_name_loads_nothing_slow():
    """What only pictures, downloads, files, commands or shape checks need is loaded by neither."""
    slow = {"scipy", "matplotlib", "pooch", "safetensors", "click", "tqdm", "jaxtyping"}
    loaded = modules_after("import pilotfish; [getattr(pilotfish, name) for name in pilotfish.__all__]")
    assert "pilotfish.models" in loaded
    assert not loaded & (slow | {"pilotfish.cli", "pilotfish.plots"})


def test_stub_of_pilotfish_names_what_is_there():
    """Static type checkers read __init__.pyi: it imports every public name from where it is defined."""
    stub = ast.parse(read("src/pilotfish/__init__.pyi"))
    imported = {
        alias.asname or alias.name: getattr(importlib.import_module(node.module or ""), alias.name)
        for node in stub.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert sorted(imported) == pf.__all__
    assert all(getattr(pf, name) is value for name, value in imported.items())
    (public,) = (node.value for node in stub.body if isinstance(node, ast.Assign))
    assert sorted(ast.literal_eval(public)) == pf.__all__


def python_blocks(text: str) -> list[str]:
    return re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


def test_the_readme_examples_run(data_folder: Path, monkeypatch: pytest.MonkeyPatch):
    """The first example of README.md ends where a person ended there; the second goes on from it,
    and its plan is drawn through the point; the third learns on from a stream.
    """
    monkeypatch.setenv("PILOTFISH_DATA", str(data_folder))
    names: dict[str, object] = {}
    first, second, third = python_blocks(README)
    exec(compile(first, "README.md", "exec"), names)  # noqa: S102 - the text is our own
    motion, shown = names["motion"].x, names["demonstrations"][4].x  # type: ignore[attr-defined, index]
    assert np.all(np.isfinite(motion))
    assert np.linalg.norm(motion[-1, :3] - shown[-1, :3]) < 0.1  # m; the situation was never shown
    exec(compile(second, "README.md", "exec"), names)  # noqa: S102 - the text is our own
    np.testing.assert_allclose(names["reference"].targets[40, :3], [0.44, -0.95, 0.31], atol=1e-3)  # type: ignore[attr-defined]
    exec(compile(third, "README.md", "exec"), names)  # noqa: S102 - the text is our own
    assert names["model"].datapoints == 1000  # type: ignore[attr-defined]
    assert np.all(np.isfinite(names["here"].means))  # type: ignore[attr-defined]
