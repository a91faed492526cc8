"""Installation without a compiler: the NumPy references run, after one warning that names the fix."""

import os
import re
import shutil
import subprocess
import sys
import sysconfig
import venv
from pathlib import Path

import pytest

TOP = Path(__file__).parents[2]
SOURCES = ("src", "pyproject.toml", "CMakeLists.txt", "README.md", "LICENSE")


def run(command: list[str | Path], **more: object) -> subprocess.CompletedProcess[str]:
    finished = subprocess.run(command, capture_output=True, text=True, check=False, **more)  # type: ignore[call-overload]
    assert finished.returncode == 0, f"{command}\n{finished.stdout}\n{finished.stderr}"
    return finished


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build a wheel with compilers that fail, from a copy without earlier builds."""
    copy, wheels = tmp_path_factory.mktemp("copy"), tmp_path_factory.mktemp("wheels")
    for name in SOURCES:
        source = TOP / name
        (shutil.copytree if source.is_dir() else shutil.copy2)(source, copy / name)
    for built in copy.rglob("*.so"):
        built.unlink()
    broken = {**os.environ, "CC": "/bin/false", "CXX": "/bin/false"}
    options = ["--no-build-isolation", "--no-deps", "--no-cache-dir", "--wheel-dir", wheels]
    run([sys.executable, "-m", "pip", "wheel", *options, copy], env=broken)
    (built,) = wheels.glob("pilotfish-*.whl")
    return built


@pytest.fixture(scope="module")
def python(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the Python of a temporary environment with that wheel and the dependencies of this one."""
    folder = tmp_path_factory.mktemp("venv")
    venv.create(folder, with_pip=False)
    python = folder / "bin" / "python"
    run([sys.executable, "-m", "pip", "--python", python, "install", "--no-deps", "--no-index", wheel])
    site = run([python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"]).stdout.strip()
    Path(site, "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n", encoding="utf-8")
    return python


def run_program(python: Path, program: str) -> subprocess.CompletedProcess[str]:
    """Run a program outside the checkout, so that it imports the wheel."""
    clean = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    return run([python, "-W", "always", "-c", program], env=clean, cwd=python.parent)


def test_wheel_without_compiler_is_pure_python(wheel: Path):
    assert wheel.name.endswith("-py3-none-any.whl")


def test_kernels_without_compiler_warn_once_and_give_results(python: Path):
    program = (
        "import numpy as np, pilotfish as pf\n"
        "system = pf.control.double_integrator(1, period=0.1)\n"
        "from pilotfish.kernels import viterbi\n"
        "half, stay = np.full(2, 0.5), np.full((2, 2), 0.5)\n"
        "observed = np.log(np.array([[0.9, 0.1], [0.2, 0.8], [0.7, 0.3]]))\n"
        "print(pf.__file__)\n"
        "for _ in range(2):\n"
        "    print(*viterbi(observed, half, stay)[0])\n"
    )
    finished = run_program(python, program)
    file, *states = finished.stdout.splitlines()
    assert Path(file).is_relative_to(python.parents[1]), f"{file} was imported, expected the wheel"
    assert states == ["0 1 0", "0 1 0"]
    warnings = re.findall(r"^\S+:\d+: \w+: .*", finished.stderr, re.MULTILINE)
    assert len(warnings) == 1, finished.stderr
    assert "SlowKernelsWarning" in warnings[0]
    assert "g++" in warnings[0]
