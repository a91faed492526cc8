"""The peers' own environments: build/peers-venv has what peers.txt names, installed by name by uv or pip."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

LISTS = Path(__file__).parent
BUILD = Path(__file__).parents[1] / "build"

Run = Callable[[Sequence[str]], str]  # runs a command; says why it failed, nothing when it did not


def execute(command: Sequence[str]) -> str:
    links = os.environ.get("PIP_FIND_LINKS")  # where pip is told to look first, uv looks too
    told = os.environ | ({"UV_FIND_LINKS": links.replace(" ", ",")} if links else {})
    done = subprocess.run(command, capture_output=True, text=True, env=told)
    said = (done.stderr or done.stdout).strip().splitlines()
    return (
        ""
        if done.returncode == 0
        else said[-1].strip()
        if said
        else f"{command[0]} ended with {done.returncode}"
    )


def environment_folder(environment: str) -> tuple[Path, Path]:
    """The folder of an environment of that name, and the list of what is in it."""
    return BUILD / f"{environment}-venv", LISTS / f"{environment}.txt"


def peer_environment(folder: Path, listed: Path, run: Run) -> tuple[Path, dict[str, str]]:
    """The peers' python, made when it is missing or another list was installed, and why a peer is not there.

    A peer that cannot be installed does not keep the others out: after all at once, each is tried alone.
    """
    python, ready = folder / "bin" / "python", folder / "installed.txt"
    wanted = listed.read_text(encoding="utf-8")
    if ready.exists() and ready.read_text(encoding="utf-8") == wanted:
        return python, {}
    shutil.rmtree(folder, ignore_errors=True)
    uv = shutil.which("uv") or shutil.which("uv", path=str(Path(sys.executable).parent))
    if uv:
        create = [uv, "venv", "--quiet", "--python", sys.executable, str(folder)]
        install = [uv, "pip", "install", "--quiet", "--compile-bytecode", "--python", str(python)]
    else:
        create = [sys.executable, "-m", "venv", str(folder)]
        install = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    requirements = wanted.split()
    if reason := run(create):
        return python, {requirement.split("==")[0]: reason for requirement in requirements}
    failures = install_all(install, requirements, run)
    if not failures:
        ready.write_text(wanted, encoding="utf-8")
    return python, failures


def install_all(install: Sequence[str], requirements: Sequence[str], run: Run) -> dict[str, str]:
    """Why each requirement could not be installed; empty when all could."""
    if not run([*install, *requirements]):
        return {}
    reasons = {requirement: run([*install, requirement]) for requirement in requirements}
    return {requirement.split("==")[0]: reason for requirement, reason in reasons.items() if reason}
