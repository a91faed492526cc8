"""The house has rooms, imports point downward, and no room, file or function outgrows its idea."""

import ast
import importlib
from collections.abc import Iterator
from pathlib import Path

import pytest

# Room: the rooms it may import from. Every row names only rows above it, so no circle can be written here.
# types and errors are open to all; the front door may look into every room that imports quickly.
# A new arrow is a decision, taken by editing this table.
ARROWS: dict[str, set[str]] = {
    "validation": set(),
    "files": set(),
    "kernels": set(),
    "geometry": set(),
    "gaussians": {"geometry", "kernels"},
    "demonstrations": {"geometry"},
    "control": {"geometry", "kernels"},
    "models": {"gaussians", "demonstrations", "kernels", "geometry"},
    "planning": {"models", "control", "gaussians", "demonstrations", "geometry"},
    "environments": {"geometry", "control"},
    "rewards": {"control", "models"},
    "assistance": {"models", "control"},
    "teleop": {"assistance"},
    "store": {"demonstrations", "models", "gaussians", "geometry", "kernels"},
    "plots": {"kernels", "geometry", "gaussians", "demonstrations", "control", "models", "planning"},
}
OPEN = {"types", "errors", "validation", "files"}
ARROWS["station"] = set(ARROWS)
ARROWS["__main__"] = {"station"}
ARROWS["__init__"] = set(ARROWS) - {"station", "plots", "__main__"}

# Clocks, threads, sockets and the operating system stay on the roof.
WORLD = {"time", "threading", "multiprocessing", "subprocess", "socket", "asyncio", "logging", "os", "signal"}
ROOF = {"store", "station", "validation", "files", "__main__"}

HOMELESS = {"utils", "util", "common", "helpers", "base", "core", "misc"}
LONGEST_FILE, LONGEST_FUNCTION, LONGEST_EXAMPLE = 500, 50, 80

TOP = Path(__file__).parents[1]
HOUSE = TOP / "src" / "pilotfish"
MODULES = sorted(HOUSE.rglob("*.py"))
DOORS = [file for file in MODULES if file.name == "__init__.py" and file.parent != HOUSE]
FOLDERS = [HOUSE, *(TOP / name for name in ("tests", "benchmarks", "examples"))]
ENDINGS = {".py", ".cpp", ".hpp"}
SOURCES = sorted(file for folder in FOLDERS for file in folder.rglob("*") if file.suffix in ENDINGS)


def shown(file: Path) -> str:
    return str(file.relative_to(TOP))


def room(file: Path) -> str:
    """The room that a module of pilotfish lies in; a file beside the rooms is a room of its own."""
    return file.relative_to(HOUSE).parts[0].removesuffix(".py")


def tree(file: Path) -> ast.Module:
    return ast.parse(file.read_text(encoding="utf-8"), shown(file))


def imported(module: ast.Module) -> Iterator[str]:
    """Every module that is imported anywhere in the file, functions included, by its whole dotted name."""
    for node in ast.walk(module):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module == "pilotfish":
            yield from (f"pilotfish.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.module or "."


def neighbours(file: Path) -> Iterator[list[str]]:
    """What a file imports from the rest of the house: [room, module behind its door, ...]."""
    for name in imported(tree(file)):
        house, *path = name.split(".")
        if house == "pilotfish" and path and path[0] != room(file):
            yield path


def test_the_table_of_arrows_has_no_circle():
    """Every row of the table names only rows that stand above it."""
    above: set[str] = set()
    for name, below in ARROWS.items():
        assert below <= above, f"{name} points up to {below - above}"
        above.add(name)


def test_every_folder_is_a_room_of_the_table():
    """A folder of the house stands in the table, and has a door."""
    folders = [path for path in HOUSE.iterdir() if path.is_dir() and any(path.glob("*.py"))]
    unknown = [shown(folder) for folder in folders if folder.name not in ARROWS]
    assert not unknown, f"{unknown} are no rooms: a new one is written in the table first"
    doorless = [shown(folder) for folder in folders if not (folder / "__init__.py").exists()]
    assert not doorless, f"{doorless} have no door: add __init__.py"


def test_imports_point_downward():
    """A module imports only from rooms that its own room's arrows name, inside functions too."""
    upward = [
        f"{shown(file)} imports {path[0]}"
        for file in MODULES
        for path in neighbours(file)
        if path[0] not in ARROWS.get(room(file), set()) | OPEN
    ]
    assert not upward, "\n".join(upward)


def test_rooms_are_entered_by_their_doors():
    """Modules behind a door are private: another room imports from the room, never from a module in it."""
    intruders = [
        f"{shown(file)} imports {'.'.join(path)}, expected the door of {path[0]}"
        for file in MODULES
        for path in neighbours(file)
        if len(path) > 1
    ]
    assert not intruders, "\n".join(intruders)


def test_the_world_stays_on_the_roof():
    """Clocks, threads, sockets, processes and the environment are imported on the roof alone."""
    worldly = {
        shown(file): sorted(WORLD & {name.split(".")[0] for name in imported(tree(file))})
        for file in MODULES
        if room(file) not in ROOF
    }
    assert not any(worldly.values()), {file: names for file, names in worldly.items() if names}


@pytest.mark.parametrize("file", DOORS, ids=shown)
def test_a_door_is_a_docstring_imports_and_all(file: Path):
    """The __init__ of a room holds one paragraph, re-exports and __all__; no code."""
    docstring = ast.get_docstring(tree(file))
    assert docstring, f"{shown(file)} has no docstring"
    assert "\n\n" not in docstring, f"the docstring of {shown(file)} is not one paragraph"
    for node in tree(file).body[1:]:
        is_all = isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__"
        assert is_all or isinstance(node, ast.ImportFrom | ast.Import), f"{shown(file)}:{node.lineno} is code"


@pytest.mark.parametrize("file", [*DOORS, HOUSE / "__init__.py"], ids=shown)
def test_every_public_name_exists(file: Path):
    """__all__ of every door names things that are there, each once, and none that is private."""
    name = ".".join(["pilotfish", *file.parent.relative_to(HOUSE).parts])
    module = importlib.import_module(name)
    missing = [public for public in module.__all__ if not hasattr(module, public)]
    assert not missing, f"{name}.__all__ names {missing}, which do not exist"
    assert len(set(module.__all__)) == len(module.__all__), f"{name}.__all__ repeats a name"
    assert not [public for public in module.__all__ if public.startswith("_") and public != "__version__"]


def test_a_file_holds_one_idea():
    """Files have under 500 lines, examples under 80."""
    for file in SOURCES:
        lines = len(file.read_text(encoding="utf-8").splitlines())
        limit = LONGEST_EXAMPLE if "examples" in file.relative_to(TOP).parts else LONGEST_FILE
        assert lines < limit, f"{shown(file)} has {lines} lines, fewer than {limit} are allowed: split it"


def test_everything_has_a_home():
    """No file or folder is named for holding what belongs nowhere."""
    homeless = [
        shown(file) for file in SOURCES if HOMELESS & set(file.relative_to(TOP).with_suffix("").parts)
    ]
    assert not homeless, f"{homeless}: a room is missing"


def length(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Lines of code from the name on, without the docstring."""
    docstring = ast.get_docstring(function, clean=False)
    lines = (function.end_lineno or function.lineno) - function.lineno + 1
    return lines - (len(docstring.splitlines()) if docstring else 0)


def test_a_function_can_be_read_at_once():
    """No function has more than 50 lines of code."""
    for file in MODULES:
        for node in ast.walk(tree(file)):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                assert length(node) <= LONGEST_FUNCTION, f"{shown(file)}:{node.lineno} split {node.name}"
