"""Runs the demonstration on the real recording, and keeps what its parts made on the way."""

from dataclasses import dataclass
from pathlib import Path

import pytest
from annotations import annotations_checked
from click.testing import CliRunner, Result

from pilotfish.station import demo_physics
from pilotfish.station.command_line import cli
from pilotfish.station.demo_physics import Opening
from pilotfish.station.report import Section, Table


@dataclass(frozen=True)
class Demonstrated:
    """What the command answered, the folder that it ran in, its section on physics and each opening in it."""

    answer: Result
    folder: Path
    section: Section
    measured: Table
    openings: list[Opening]


def demonstrate(folder: Path, data: Path) -> Demonstrated:
    """Run `pilotfish demo --out build/demo --json` in a folder; annotations are not checked."""
    openings: list[Opening] = []
    opened: list[tuple[Section, Table]] = []
    table, carry_out = demo_physics.table, demo_physics.opened
    with pytest.MonkeyPatch.context() as patch, annotations_checked(False):
        patch.setenv("PILOTFISH_DATA", str(data))
        patch.chdir(folder)
        patch.setattr(demo_physics, "table", lambda done: openings.extend(done) or table(done))
        patch.setattr(demo_physics, "opened", lambda *a, **k: opened.append(carry_out(*a, **k)) or opened[-1])
        line = ["demo", "--out", "build/demo", "--json"]
        answer = CliRunner().invoke(cli, line, prog_name="pilotfish", catch_exceptions=False)
    ((section, measured),) = opened
    return Demonstrated(answer, folder, section, measured, openings)
