"""Hostile inputs for every decoder and public function; `make fuzz` runs many more."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from fuzzing.targets import GROUPS

RUN = Path(__file__).with_name("run.py")
MUTANTS = 8000  # of each group


@pytest.mark.slow  # thousands of mutants
@pytest.mark.parametrize("group", GROUPS)
def test_mutants_are_sound_or_refused_in_one_line(group: str) -> None:
    """They run in another process, with bounded memory and without checks of annotations."""
    chosen = [part for pattern in GROUPS[group] for part in ("--target", pattern)]
    count = os.environ.get("PILOTFISH_FUZZ", str(MUTANTS))
    ran = subprocess.run(
        [sys.executable, str(RUN), "--mutants", count, *chosen], capture_output=True, text=True, check=False
    )
    assert ran.returncode == 0, f"{ran.stdout[-8000:]}\n{ran.stderr[-2000:]}"
