"""Killed processes, full disks and signals at each system call of a write (docs/robustness.md)."""

import shutil
from pathlib import Path

import fault_sweep
import pytest
from fault_commands import FAULTS, commands

QUICK = ("learn", "stream", "reproduce", "data export")
NAMES = sorted({command.name for command in commands(Path())})

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler for the fault library")


def faulty(names: list[str], faults: tuple[str, ...], folder: Path, *, brief: bool) -> list[str]:
    outcomes = fault_sweep.sweep(names, faults, folder, brief=brief)
    assert {outcome.fault for outcome in outcomes} == set(faults)
    assert any("new" in outcome.outputs.values() for outcome in outcomes)
    return [f"{outcome}: {outcome.faulty}" for outcome in outcomes if outcome.faulty]


def test_learn_killed_or_full_disk_leaves_old_or_new_file(tmp_path: Path):
    """Only a killed process leaves a hidden file."""
    assert faulty(["learn"], ("killed", "disk full", "SIGTERM"), tmp_path, brief=True) == []


def test_data_export_killed_leaves_old_or_new_folder(tmp_path: Path):
    assert faulty(["data export"], ("killed",), tmp_path, brief=True) == []


@pytest.mark.slow  # some hundred processes for each command, pictures and physics for six of them
@pytest.mark.parametrize("name", NAMES)
def test_every_command_fault_at_each_call_leaves_old_or_new_output(name: str, tmp_path: Path):
    """Without old outputs too where that is quick. Of demo, which takes long, one fault of each kind."""
    faults = ("killed", "disk full", "SIGTERM") if name == "demo" else tuple(FAULTS)
    assert faulty([name], faults, tmp_path, brief=name not in QUICK) == []


def test_sweep_finds_file_written_in_place(tmp_path: Path):
    outcomes = fault_sweep.sweep(["in place"], ("killed", "disk full"), tmp_path, brief=True)
    assert any("neither old nor new" in outcome.outputs.values() for outcome in outcomes)
    assert all(outcome.faulty for outcome in outcomes if outcome.call.startswith("write"))
