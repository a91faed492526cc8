"""pilotfish select: candidates, table, plot and selection."""

import pytest

from pilotfish.cli.options.candidates import (
    parse_candidates,
    parse_durations,
    parse_state_counts,
    parse_structures,
)
from pilotfish.cli.options.durations import CANDIDATE_NAMES
from pilotfish.errors import InvalidInput
from pilotfish.gaussians.structures import HDDC, MFA, Diagonal, Full, SemiTied
from pilotfish.models.durations import DISTRIBUTIONS


def test_parse_state_counts_lists_and_ranges():
    assert parse_state_counts("3:5") == [3, 4, 5]
    assert parse_state_counts("7") == [7]
    assert parse_state_counts("8:9, 3,5") == [3, 5, 8, 9]


@pytest.mark.parametrize("text", ["", "3:", "5:3", "0:2", "a", "1:2:3", "3,,4", "-3", "3,3", "2.5"])
def test_parse_state_counts_invalid_is_rejected(text):
    with pytest.raises(InvalidInput, match="--states"):
        parse_state_counts(text)


def test_parse_structures_and_durations_by_name():
    structures = parse_structures("full, Diagonal,semi-tied:0.5,mfa:4,hddc:0.95")
    assert structures == [Full(), Diagonal(), SemiTied(tying=0.5), MFA(4), HDDC(0.95)]
    assert parse_durations("markov,viterbi") == ["markov", "viterbi"]
    with pytest.raises(InvalidInput, match="did you mean 'viterbi'"):
        parse_durations("viterb")
    with pytest.raises(InvalidInput, match="'full' more than once"):
        parse_structures("full,full")
    with pytest.raises(InvalidInput, match="mfa"):
        parse_structures("mfa")


def test_parse_candidates_combines_up_to_limit():
    candidates = parse_candidates("3:4", "full,diagonal", "viterbi,markov")
    assert len({candidate.label for candidate in candidates}) == 8
    assert {candidate.dynamics_label for candidate in candidates} == {"viterbi", "markov"}
    (gamma,) = parse_candidates("3", "full", "gamma")
    assert gamma.durations.distribution is DISTRIBUTIONS["gamma"]
    with pytest.raises(InvalidInput, match="998 candidates"):
        parse_candidates("2:500", "full,diagonal", "viterbi")


def test_select_table_marks_selection_and_plots(run_command_line, folder, tmp_path):
    result = run_command_line(
        "select", folder, "--states", "2,3,30", "--structures", "diagonal", "--durations", "viterbi,markov",
        "--out", tmp_path / "scores.png",
    )  # fmt: skip
    assert result.exit_code == 0
    lines = result.stdout.splitlines()
    assert sum(line.endswith("selected") for line in lines[1:5]) == 1
    assert sum(line.startswith("failed") and "30 states" in line for line in lines) == 2
    assert (tmp_path / "scores.png").stat().st_size > 10_000
    again = run_command_line("select", folder, "--states", "2", "--out", tmp_path / "scores.png")
    assert again.exit_code == 1
    assert "--force" in again.stderr


def test_select_json_scores_are_deterministic(run_json, folder):
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


def test_select_without_learnable_candidate_is_rejected(run_failing, folder):
    assert "no candidate" in run_failing("select", folder, "--states", "40")
    assert "at least two" in run_failing("select", folder, "--only", "0", "--states", "2")


def test_select_scores_every_fit_function(run_json, folder):
    durations = ",".join(CANDIDATE_NAMES)
    output = run_json(
        "select", folder, "--states", "2", "--structures", "spherical", "--durations", durations
    )
    assert [score["durations"] for score in output["scores"]] == list(CANDIDATE_NAMES)
    count = {score["durations"]: score["parameters"] for score in output["scores"]}
    assert count["gaussian"] == count["gamma"] == count["viterbi"] == count["poisson"] + 1
