"""Run the commands and programs of the tutorials, and write their output and pictures into the pages.

    python docs/run_tutorials.py [first-skill own-recordings ...]

A page is run from top to bottom in an empty folder. A `console` block has commands after `$ ` and their
output. The `python` blocks of a page are one program; a `text` block after one of them is its output. The
pictures of a page are made by its commands; this script reduces their colours and saves them beside the page.
The tests run the same pages and compare the output, numbers left out (`tests/test_tutorials.py`).
"""

import contextlib
import io
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

TUTORIALS = Path(__file__).parent / "tutorials"
BLOCK = re.compile(r"^```(console|python|text)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
PICTURE = re.compile(r"!\[[^\]]*\]\(([\w-]+\.png)\)")
COLOURS, MAX_SIZE = 255, (1400, 1100)  # of a picture that is kept


def run_page(text: str, folder: Path) -> str:
    """Return the page with the output that its blocks have now."""
    names: dict[str, Any] = {"__name__": "__main__"}
    printed = ""

    def run_block(match: re.Match[str]) -> str:
        nonlocal printed
        kind, content = match.groups()
        if kind == "console":
            content = "".join(f"$ {command}\n{run_command(command, folder)}" for command in commands(content))
        elif kind == "python":
            printed = run_program(content, names, folder)
        else:
            content = printed
        return f"```{kind}\n{content}```"

    return BLOCK.sub(run_block, text)


def commands(console: str) -> list[str]:
    """Return the commands of a console block, those that a backslash continues as one."""
    joined = console.replace("\\\n", "\\\0")
    return [line[2:].replace("\\\0", "\\\n") for line in joined.splitlines() if line.startswith("$ ")]


def run_command(command: str, folder: Path) -> str:
    """Return what a command prints, standard error included."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = os.environ | {"PATH": path, "COLUMNS": "100"}
    ran = subprocess.run(
        ["bash", "-c", command],
        cwd=folder,
        env=environment,
        check=False,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    )
    if ran.returncode:
        raise RuntimeError(f"{command}: exit code {ran.returncode}\n{ran.stdout}")
    return "".join(f"{line.rstrip()}\n" for line in ran.stdout.splitlines())


def run_program(program: str, names: dict[str, Any], folder: Path) -> str:
    """Run one Python block with the names of those before it, and return what it prints."""
    output = io.StringIO()
    with contextlib.chdir(folder), contextlib.redirect_stdout(output):
        exec(program, names)  # noqa: S102 - our own text
    return output.getvalue()


def save_pictures(text: str, folder: Path) -> None:
    """Keep the pictures that a page displays beside it, with few colours."""
    from PIL import Image

    for name in PICTURE.findall(text):
        with Image.open(folder / name) as picture:
            picture.thumbnail(MAX_SIZE)
            reduced = picture.convert("RGB").quantize(COLOURS, Image.Quantize.MAXCOVERAGE)
            reduced.save(TUTORIALS / name, optimize=True)


def main() -> None:
    """Run the pages named on the command line, or all of them."""
    for name in sys.argv[1:] or sorted(path.stem for path in TUTORIALS.glob("*.md") if path.stem != "index"):
        page = TUTORIALS / f"{name}.md"
        with tempfile.TemporaryDirectory() as folder:
            text = run_page(page.read_text(encoding="utf-8"), Path(folder))
            save_pictures(text, Path(folder))
        page.write_text(text, encoding="utf-8")
        print(f"{name}: done")


if __name__ == "__main__":
    main()
