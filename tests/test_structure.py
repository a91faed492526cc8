"""Structure of the code: packages are imported from their `__init__`, files and functions stay short.

The directions of imports are contracts of import-linter in pyproject.toml; `make lint` checks them.
"""

import ast
import importlib
from collections.abc import Iterator
from pathlib import Path

import pytest

FORBIDDEN_NAMES = {"utils", "util", "common", "helpers", "base", "core", "misc"}
MAX_FILE, MAX_FUNCTION, MAX_EXAMPLE = 400, 40, 80  # lines

TOP = Path(__file__).parents[1]
PACKAGE = TOP / "src" / "pilotfish"
MODULES = sorted(PACKAGE.rglob("*.py"))
INITS = [file for file in MODULES if file.name == "__init__.py" and file.parent != PACKAGE]
FOLDERS = [PACKAGE, *(TOP / name for name in ("tests", "benchmarks", "examples", "reproductions"))]
SOURCES = sorted(
    file for folder in FOLDERS for file in folder.rglob("*") if file.suffix in {".py", ".cpp", ".hpp"}
)
SCRIPTS = sorted(
    file
    for name in ("examples", "reproductions", "benchmarks", "docs")
    for file in (TOP / name).rglob("*.py")
)


def relative_name(file: Path) -> str:
    return str(file.relative_to(TOP))


def parse(file: Path) -> ast.Module:
    return ast.parse(file.read_text(encoding="utf-8"), relative_name(file))


def pilotfish_imports(file: Path) -> Iterator[list[str]]:
    """Yield the parts after `pilotfish` of every module that a file imports from, functions included."""
    for node in ast.walk(parse(file)):
        if isinstance(node, ast.ImportFrom) and node.module:
            names = (
                [f"pilotfish.{a.name}" for a in node.names] if node.module == "pilotfish" else [node.module]
            )
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        else:
            continue
        for name in names:
            package, *path = name.split(".")
            if package == "pilotfish" and path:
                yield path


def is_public(path: list[str]) -> bool:
    """Return whether a dotted path is a package, or a module beside the packages."""
    folder = PACKAGE.joinpath(*path)
    return folder.is_dir() or (len(path) == 1 and folder.with_suffix(".py").exists())


@pytest.mark.parametrize("file", MODULES, ids=relative_name)
def test_module_imports_other_packages_from_their_init(file: Path):
    own = file.relative_to(PACKAGE).parts[0]
    private = [".".join(path) for path in pilotfish_imports(file) if path[0] != own and not is_public(path)]
    assert not private, f"{relative_name(file)} imports from private modules: {private}"


@pytest.mark.parametrize("file", SCRIPTS, ids=relative_name)
def test_script_imports_public_packages_only(file: Path):
    private = [
        ".".join(path) for path in pilotfish_imports(file) if not is_public(path) and path[0] != "__main__"
    ]
    assert not private, f"{relative_name(file)} imports from private modules: {private}"


@pytest.mark.parametrize("file", INITS, ids=relative_name)
def test_init_has_docstring_imports_and_all_only(file: Path):
    assert ast.get_docstring(parse(file)), f"{relative_name(file)} has no docstring"
    for node in parse(file).body[1:]:
        is_all = isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__"
        assert is_all or isinstance(node, ast.ImportFrom | ast.Import), f"{file}:{node.lineno} is code"


@pytest.mark.parametrize("file", [*INITS, PACKAGE / "__init__.py"], ids=relative_name)
def test_all_names_exist_once_and_are_public(file: Path):
    name = ".".join(["pilotfish", *file.parent.relative_to(PACKAGE).parts])
    module = importlib.import_module(name)
    names = getattr(module, "__all__", [])
    assert not [public for public in names if not hasattr(module, public)]
    assert len(set(names)) == len(names)
    assert not [public for public in names if public.startswith("_")]


def test_files_are_short():
    too_long = {
        relative_name(file): lines
        for file in SOURCES
        if (lines := len(file.read_text(encoding="utf-8").splitlines()))
        > (MAX_EXAMPLE if "examples" in file.relative_to(TOP).parts else MAX_FILE)
    }
    assert not too_long


def test_file_names_say_what_files_contain():
    assert not [
        file for file in SOURCES if FORBIDDEN_NAMES & set(file.relative_to(TOP).with_suffix("").parts)
    ]


def body_lines(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Return the number of lines from the name on, without the docstring."""
    docstring = ast.get_docstring(function, clean=False)
    lines = (function.end_lineno or function.lineno) - function.lineno + 1
    return lines - (len(docstring.splitlines()) if docstring else 0)


def test_functions_are_short():
    too_long = {
        f"{relative_name(file)}:{node.lineno} {node.name}": body_lines(node)
        for file in MODULES
        for node in ast.walk(parse(file))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and body_lines(node) > MAX_FUNCTION
    }
    assert not too_long
