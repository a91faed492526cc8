"""Every example runs from top to bottom, is short, and keeps what it promises."""

import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = sorted((Path(__file__).parents[1] / "examples").glob("*.py"))


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda file: file.stem)
def test_an_example_runs_as_it_stands_and_is_under_80_lines(data_folder, example):
    assert len(example.read_text().splitlines()) < 80
    ran = subprocess.run([sys.executable, example], check=False, capture_output=True, text=True, timeout=120)
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout


def test_the_hand_reaches_a_cup_where_none_was_shown():
    file = next(e for e in EXAMPLES if e.stem == "adapt_to_a_moved_cup")
    ran = subprocess.run([sys.executable, file], check=True, capture_output=True, text=True, timeout=120)
    assert float(ran.stdout.split("ends ")[1].split(" mm")[0]) < 10.0


def test_the_tool_passes_the_point_within_its_deviation_and_comes_back(data_folder):
    file = next(e for e in EXAMPLES if e.stem == "pass_through_a_point")
    ran = subprocess.run([sys.executable, file], check=True, capture_output=True, text=True, timeout=120)
    assert float(ran.stdout.split("passes ")[1].split(" mm")[0]) < 0.5
    assert float(ran.stdout.split("ends ")[1].split(" mm")[0]) < 0.1
