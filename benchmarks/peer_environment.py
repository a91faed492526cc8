"""Environments of the peers: build/peers-venv holds the packages of peers.txt, installed by uv or pip."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

LISTS = Path(__file__).parent
BUILD = Path(__file__).parents[1] / "build"

Run = Callable[
    [Sequence[str]], str
]  # runs a command and returns the reason of its failure, or an empty string


def execute(command: Sequence[str]) -> str:
    """Run a command and return the reason of its failure, or an empty string."""
    links = os.environ.get("PIP_FIND_LINKS")  # uv looks there too
    variables = os.environ | ({"UV_FIND_LINKS": links.replace(" ", ",")} if links else {})
    done = subprocess.run(command, capture_output=True, text=True, env=variables)
    output = (done.stderr or done.stdout).strip().splitlines()
    return (
        ""
        if done.returncode == 0
        else output[-1].strip()
        if output
        else f"{command[0]} ended with {done.returncode}"
    )


def environment_folder(environment: str) -> tuple[Path, Path]:
    """Return the folder of an environment and the list of its packages."""
    return BUILD / f"{environment}-venv", LISTS / f"{environment}.txt"


def peer_environment(folder: Path, listed: Path, run: Run) -> tuple[Path, dict[str, str]]:
    """Return the Python of an environment, and the reason for each peer that could not be installed.

    The environment is created if it is missing or has other packages. If all packages cannot be installed at
    once, each is installed separately.
    """
    python, ready = folder / "bin" / "python", folder / "installed.txt"
    requested = listed.read_text(encoding="utf-8")
    if ready.exists() and ready.read_text(encoding="utf-8") == requested:
        return python, {}
    shutil.rmtree(folder, ignore_errors=True)
    uv = shutil.which("uv") or shutil.which("uv", path=str(Path(sys.executable).parent))
    if uv:
        create = [uv, "venv", "--quiet", "--python", sys.executable, str(folder)]
        install = [uv, "pip", "install", "--quiet", "--compile-bytecode", "--python", str(python)]
    else:
        create = [sys.executable, "-m", "venv", str(folder)]
        install = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    requirements = requested.split()
    if reason := run(create):
        return python, {requirement.split("==")[0]: reason for requirement in requirements}
    failures = install_all(install, requirements, run)
    if not failures:
        ready.write_text(requested, encoding="utf-8")
    return python, failures


def install_all(install: Sequence[str], requirements: Sequence[str], run: Run) -> dict[str, str]:
    """Install packages and return the reason of each failure."""
    if not run([*install, *requirements]):
        return {}
    reasons = {requirement: run([*install, requirement]) for requirement in requirements}
    return {requirement.split("==")[0]: reason for requirement, reason in reasons.items() if reason}
