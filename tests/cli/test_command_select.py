"""pilotfish select: candidates by name, a table, a picture, and a choice."""

import pytest

from pilotfish.cli.options.candidates import (
    parse_candidates,
    parse_durations,
    parse_state_counts,
    parse_structures,
)
from pilotfish.cli.options.learners import LEARNERS
from pilotfish.errors import InvalidInput
from pilotfish.gaussians.structures import HDDC, MFA, Diagonal, Full, SemiTied


def test_numbers_of_states_are_read_as_written():
    assert parse_state_counts("3:5") == [3, 4, 5]
    assert parse_state_counts("7") == [7]
    assert parse_state_counts("8:9, 3,5") == [3, 5, 8, 9]


@pytest.mark.parametrize("text", ["", "3:", "5:3", "0:2", "a", "1:2:3", "3,,4", "-3", "3,3", "2.5"])
def test_what_is_no_number_of_states_is_refused(text):
    with pytest.raises(InvalidInput, match="--states"):
        parse_state_counts(text)


def test_structures_and_durations_are_read_by_name():
    named = parse_structures("full, Diagonal,semi-tied:0.5,mfa:4,hddc:0.95")
    assert named == [Full(), Diagonal(), SemiTied(tying=0.5), MFA(4), HDDC(0.95)]
    assert parse_durations("markov,counted") == ["markov", "counted"]
    with pytest.raises(InvalidInput, match="did you mean 'counted'"):
        parse_durations("count")
    with pytest.raises(InvalidInput, match="'full' more than once"):
        parse_structures("full,full")
    with pytest.raises(InvalidInput, match="mfa"):
        parse_structures("mfa")


def test_every_combination_is_a_candidate_up_to_a_limit():
    tried = parse_candidates("3:4", "full,diagonal", "counted,markov")
    assert len({candidate.label for candidate in tried}) == 8
    assert all(candidate.learner is LEARNERS[candidate.durations] for candidate in tried)
    with pytest.raises(InvalidInput, match="998 candidates"):
        parse_candidates("2:500", "full,diagonal", "counted")


def test_the_table_marks_the_choice_and_the_picture_is_drawn(run_command_line, folder, tmp_path):
    """A line for each candidate, those that failed beneath, with the reason."""
    result = run_command_line(
        "select", folder, "--states", "2,3,30", "--structures", "diagonal", "--durations", "counted,markov",
        "--out", tmp_path / "sizes.png",
    )  # fmt: skip
    assert result.exit_code == 0
    lines = result.stdout.splitlines()
    assert sum(line.endswith("selected") for line in lines[1:5]) == 1
    assert sum(line.startswith("failed") and "30 states" in line for line in lines) == 2
    assert (tmp_path / "sizes.png").stat().st_size > 10_000
    again = run_command_line("select", folder, "--states", "2", "--out", tmp_path / "sizes.png")
    assert again.exit_code == 1
    assert "--force" in again.stderr


def test_programs_are_told_all_scores_the_same_every_time(run_json, folder):
    output, same = (
        run_json("select", folder, "--states", "2:3", "--structures", "diagonal,spherical") for _ in range(2)
    )
    assert len(output["scores"]) == 4
    assert output["selected"] in output["scores"]
    assert len(output["scores"][0]["held_out_log_likelihood"]) == 5
    assert output["failures"] == []
    for score in (*output["scores"], *same["scores"]):
        assert score.pop("cpu_seconds") > 0.0
    assert output["scores"] == same["scores"]


def test_when_nothing_can_be_learned_the_command_is_refused(run_failing, folder):
    assert "no candidate" in run_failing("select", folder, "--states", "40")
    assert "at least two" in run_failing("select", folder, "--only", "0", "--states", "2")


def test_every_kind_of_durations_can_be_selected_from(run_json, folder):
    """Whatever a name stands for can be learned and scored; exact laws count their own parameters."""
    output = run_json(
        "select", folder, "--states", "2", "--structures", "spherical", "--durations", ",".join(LEARNERS)
    )
    assert [score["durations"] for score in output["scores"]] == list(LEARNERS)
    count = {score["durations"]: score["parameters"] for score in output["scores"]}
    assert count["gaussian"] == count["gamma"] == count["counted"] == count["poisson"] + 1
