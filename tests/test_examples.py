"""Every example runs from top to bottom, is short, and keeps what it promises."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

EXAMPLES = sorted((Path(__file__).parents[1] / "examples").glob("*.py"))
SLOW = {"hook_a_carabiner"}  # four demonstrations and three executions in physics


def number(printed: str, before: str, after: str) -> float:
    return float(printed.split(before)[1].split(after)[0])


def the_valve_is_opened_near_to_what_the_person_did(printed: str) -> None:
    assert number(printed, "on average ", " mm") < 60.0


def the_hand_reaches_a_cup_where_none_was_shown(printed: str) -> None:
    assert number(printed, "ends ", " mm") < 10.0


def the_tool_passes_the_point_within_its_deviation_and_comes_back(printed: str) -> None:
    assert number(printed, "passes ", " mm") < 0.5
    assert number(printed, "ends ", " mm") < 0.1


def a_chair_matters_nowhere_and_no_longer_bends_the_motion(printed: str) -> None:
    assert "relevant at no state: chair\n" in printed
    assert number(printed, "count equally: the motion changes by ", " mm") > 100.0
    assert number(printed, "frames are weighted: ", " mm") < 1.0
    equal, weighted, without = (number(line, ": ", " mm") for line in printed.splitlines()[-3:])
    assert max(weighted, without) < 0.5 * equal


def exact_durations_are_nearer_to_those_drawn_than_counted_ones_and_likelier(printed: str) -> None:
    rows = {line[:26].strip(): line[27:].split() for line in printed.splitlines()[1:]}
    means = {name: np.array(row[0:9:3], float) for name, row in rows.items()}
    errors = {name: np.abs(mean / means["true"] - 1.0).mean() for name, mean in means.items()}
    assert errors["gamma"] < 0.7 * errors["counted"]
    assert float(rows["gamma"][-1]) > float(rows["counted"][-1])


def a_jug_turns_nearer_on_the_sphere_and_its_quaternions_keep_their_length(printed: str) -> None:
    flat, sphere = printed.split("on the sphere")
    averages = [
        [float(line.split()[2]) for line in part.splitlines() if "average" in line] for part in (flat, sphere)
    ]
    assert all(on < off for off, on in zip(*averages, strict=True))
    assert sphere.count("norms of quaternions off by 0.000") == 4


def the_streamed_skill_gains_states_when_the_way_changes(printed: str) -> None:
    *head, last = printed.splitlines()
    states = [int(line.split()[1]) for line in head[1:]]
    assert states[7] == 2
    assert states[-1] > 3
    assert float(last.split("[")[1].split()[1]) < -0.3


def the_carabiner_is_hooked_where_it_never_was(printed: str) -> None:
    lines = [line for line in printed.splitlines() if line.startswith("rod at ")]
    assert len(lines) == 3
    assert sum("m: hooked, " in line for line in lines) >= 2


PROMISES = {
    "adapt_to_a_moved_cup": the_hand_reaches_a_cup_where_none_was_shown,
    "exact_durations": exact_durations_are_nearer_to_those_drawn_than_counted_ones_and_likelier,
    "hook_a_carabiner": the_carabiner_is_hooked_where_it_never_was,
    "learn_from_a_stream": the_streamed_skill_gains_states_when_the_way_changes,
    "leave_out_what_does_not_matter": a_chair_matters_nowhere_and_no_longer_bends_the_motion,
    "open_a_valve": the_valve_is_opened_near_to_what_the_person_did,
    "pass_through_a_point": the_tool_passes_the_point_within_its_deviation_and_comes_back,
    "turn_on_the_sphere": a_jug_turns_nearer_on_the_sphere_and_its_quaternions_keep_their_length,
}


@pytest.mark.parametrize(
    "example",
    [pytest.param(file, marks=[pytest.mark.slow] * (file.stem in SLOW), id=file.stem) for file in EXAMPLES],
)
def test_an_example_runs_as_it_stands_and_keeps_its_promise(request, example):
    """Under 80 lines, run once from top to bottom."""
    text = example.read_text(encoding="utf-8")
    assert len(text.splitlines()) < 80
    if "datasets." in text:
        request.getfixturevalue("data_folder")
    ran = subprocess.run([sys.executable, example], check=False, capture_output=True, text=True, timeout=120)
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout
    PROMISES[example.stem](ran.stdout)
