"""Every example runs, is short, and prints numbers within its limits."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

EXAMPLES = sorted((Path(__file__).parents[1] / "examples").glob("*.py"))
SLOW = {"hook_a_carabiner"}  # four demonstrations and three executions in physics


def number(output: str, before: str, after: str) -> float:
    return float(output.split(before)[1].split(after)[0])


def check_open_a_valve(output: str) -> None:
    assert number(output, "on average ", " mm") < 60.0


def check_adapt_to_a_moved_cup(output: str) -> None:
    assert number(output, "ends ", " mm") < 10.0


def check_pass_through_a_point(output: str) -> None:
    assert number(output, "passes ", " mm") < 0.5
    assert number(output, "the motion ends ", " mm") < 0.1


def check_exact_durations(output: str) -> None:
    rows = {line[:26].strip(): line[27:].split() for line in output.splitlines()[1:]}
    means = {name: np.array(row[0:9:3], float) for name, row in rows.items()}
    errors = {name: np.abs(mean / means["true"] - 1.0).mean() for name, mean in means.items()}
    assert errors["gamma"] < 0.7 * errors["counted"]
    assert float(rows["gamma"][-1]) > float(rows["counted"][-1])


def check_turn_on_the_sphere(output: str) -> None:
    flat, sphere = output.split("on the sphere")
    averages = [
        [float(line.split()[2]) for line in part.splitlines() if "average" in line] for part in (flat, sphere)
    ]
    assert len(averages[0]) == 4
    assert all(on_sphere < flat for flat, on_sphere in zip(*averages, strict=True))
    assert sphere.count("norms of quaternions off by 0.000") == 4


def check_leave_out_what_does_not_matter(output: str) -> None:
    assert "relevant at no state: chair\n" in output
    assert number(output, "count equally: the motion changes by ", " mm") > 100.0
    assert number(output, "frames are weighted: ", " mm") < 1.0
    equal, weighted, without = (number(line, ": ", " mm") for line in output.splitlines()[-3:])
    assert max(weighted, without) < 0.5 * equal


def check_learn_from_a_stream(output: str) -> None:
    *head, last = output.splitlines()
    states = [int(line.split()[1]) for line in head[1:]]
    assert states[7] == 2
    assert states[-1] > 3
    assert float(last.split("[")[1].split()[1]) < -0.3


def check_hook_a_carabiner(output: str) -> None:
    lines = [line for line in output.splitlines() if line.startswith("rod at ")]
    assert len(lines) == 3
    assert sum("m: hooked, " in line for line in lines) >= 2


CHECKS = {
    name.removeprefix("check_"): check
    for name, check in globals().copy().items()
    if name.startswith("check_")
}


@pytest.mark.parametrize(
    "example",
    [pytest.param(file, marks=[pytest.mark.slow] * (file.stem in SLOW), id=file.stem) for file in EXAMPLES],
)
def test_example_prints_numbers_within_limits(request, example):
    text = example.read_text(encoding="utf-8")
    assert len(text.splitlines()) < 80
    if "datasets." in text:
        request.getfixturevalue("data_folder")
    ran = subprocess.run([sys.executable, example], check=False, capture_output=True, text=True, timeout=120)
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout
    CHECKS[example.stem](ran.stdout)
