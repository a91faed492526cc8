"""Every example runs from top to bottom, is short, and keeps what it promises."""

import subprocess
import sys
from pathlib import Path

import numpy as np
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


def printed_by(name):
    file = next(e for e in EXAMPLES if e.stem == name)
    return subprocess.run(
        [sys.executable, file], check=True, capture_output=True, text=True, timeout=120
    ).stdout


def test_a_chair_is_found_to_matter_nowhere_and_no_longer_bends_the_motion(data_folder):
    told = printed_by("leave_out_what_does_not_matter")
    assert "matter at no state: chair\n" in told
    assert float(told.split("all frames heard: the motion bends by up to ")[1].split(" mm")[0]) > 100.0
    assert float(told.split("each heard as it matters: ")[1].split(" mm")[0]) < 1.0
    heard, weighted, without = (
        float(line.split("average ")[1].split(" mm")[0]) for line in told.splitlines()[-3:]
    )
    assert max(weighted, without) < 0.5 * heard


def test_exact_durations_come_nearer_to_those_drawn_than_counted_ones_and_are_likelier():
    rows = {line[:26].strip(): line[27:].split() for line in printed_by("exact_durations").splitlines()[1:]}
    means = {name: np.array(row[0:9:3], float) for name, row in rows.items()}
    errors = {name: np.abs(mean / means["as drawn"] - 1.0).mean() for name, mean in means.items()}
    assert errors["gamma"] < 0.7 * errors["counted"]
    assert float(rows["gamma"][-1]) > float(rows["counted"][-1])


def test_a_jug_turns_as_it_should_nearer_on_the_sphere_and_its_quaternions_keep_their_length():
    flat, sphere = printed_by("turn_on_the_sphere").split("on the sphere")
    averages = [
        [float(line.split()[2]) for line in part.splitlines() if "average" in line] for part in (flat, sphere)
    ]
    assert all(on < off for off, on in zip(*averages, strict=True))
    assert sphere.count("lengths of quaternions off by 0.000") == 4


def test_the_streamed_skill_gains_states_when_the_way_changes():
    *head, last = printed_by("learn_from_a_stream").splitlines()
    states = [int(line.split()[1]) for line in head[1:]]
    assert states[7] == 2
    assert states[-1] > 3
    assert float(last.split("[")[1].split()[1]) < -0.3
