"""Run `pilotfish demo` on recorded data and keep its intermediate results."""

from dataclasses import dataclass
from pathlib import Path

import pytest
from annotations import check_annotations
from click.testing import CliRunner, Result

from pilotfish.cli.demo import physics as demo_physics
from pilotfish.cli.demo.physics import ValveResult
from pilotfish.cli.main import cli
from pilotfish.cli.output.html_report import Section
from pilotfish.cli.output.tables import Table


@dataclass(frozen=True)
class DemoRun:
    """Result of the command, its folder, and the simulation section with its table and results."""

    result: Result
    folder: Path
    section: Section
    physics_table: Table
    valve_openings: list[ValveResult]


def run_demo(folder: Path, data: Path) -> DemoRun:
    """Run `pilotfish demo --out build/demo --json` in a folder; annotations are not checked."""
    valve_openings: list[ValveResult] = []
    physics_parts: list[tuple[Section, Table]] = []
    result_table, simulate = demo_physics.result_table, demo_physics.simulate_reproductions
    with pytest.MonkeyPatch.context() as patch, check_annotations(False):
        patch.setenv("PILOTFISH_DATA", str(data))
        patch.chdir(folder)
        patch.setattr(
            demo_physics,
            "result_table",
            lambda names, done: valve_openings.extend(done) or result_table(names, done),
        )
        patch.setattr(
            demo_physics,
            "simulate_reproductions",
            lambda *a, **k: physics_parts.append(simulate(*a, **k)) or physics_parts[-1],
        )
        line = ["demo", "--out", "build/demo", "--json"]
        result = CliRunner().invoke(cli, line, prog_name="pilotfish", catch_exceptions=False)
    ((section, physics_table),) = physics_parts
    return DemoRun(result, folder, section, physics_table, valve_openings)
