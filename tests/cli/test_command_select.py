"""pilotfish select: candidates, table, plot and selection."""

import shlex

import numpy as np
import pytest

from pilotfish.cli.options.candidates import (
    parse_candidates,
    parse_durations,
    parse_state_counts,
    parse_structures,
)
from pilotfish.cli.options.durations import CANDIDATE_NAMES
from pilotfish.cli.options.structures import parse_structure, structure_text
from pilotfish.cli.options.workers import process_pool
from pilotfish.cli.output.selections import edge_notes, learn_command
from pilotfish.errors import InvalidInput
from pilotfish.gaussians.structures import HDDC, MFA, Diagonal, Full, SemiTied
from pilotfish.models import Candidate, DurationModel
from pilotfish.models.durations import DISTRIBUTIONS
from pilotfish.planning import ReproductionScore, ReproductionSelection

BY_LIKELIHOOD = ("--by", "likelihood")


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


@pytest.mark.usefixtures("unchecked")
def test_select_table_marks_selection_and_plots(run_command_line, folder, tmp_path):
    result = run_command_line(
        "select", folder, *BY_LIKELIHOOD, "--states", "2,3,30", "--structures", "diagonal",
        "--durations", "viterbi,markov",
        "--out", tmp_path / "scores.png",
    )  # fmt: skip
    assert result.exit_code == 0
    lines = result.stdout.splitlines()
    assert sum(line.endswith("selected") for line in lines[1:5]) == 1
    assert sum(line.startswith("failed") and "30 states" in line for line in lines) == 2
    assert (tmp_path / "scores.png").stat().st_size > 10_000
    again = run_command_line(
        "select", folder, *BY_LIKELIHOOD, "--states", "2", "--out", tmp_path / "scores.png"
    )
    assert again.exit_code == 1
    assert "--force" in again.stderr


@pytest.mark.usefixtures("unchecked")
def test_select_json_scores_are_deterministic(run_json, folder):
    states = ("--states", "2:3", "--structures", "diagonal,spherical")
    output, same = (run_json("select", folder, *BY_LIKELIHOOD, *states) for _ in range(2))
    assert len(output["scores"]) == 4
    assert output["selected"] in output["scores"]
    assert len(output["scores"][0]["held_out_log_likelihood"]) == 5
    assert output["failures"] == []
    for score in (*output["scores"], *same["scores"]):
        assert score.pop("cpu_seconds") > 0.0
    assert output["scores"] == same["scores"]


def test_select_without_learnable_candidate_is_rejected(run_failing, folder):
    assert "no candidate" in run_failing("select", folder, *BY_LIKELIHOOD, "--states", "40")
    assert "at least two" in run_failing("select", folder, "--only", "0", "--states", "2")


@pytest.mark.usefixtures("unchecked")
def test_select_scores_every_fit_function(run_json, folder):
    durations = ",".join(CANDIDATE_NAMES)
    output = run_json(
        "select",
        folder,
        *BY_LIKELIHOOD,
        "--states",
        "2",
        "--structures",
        "spherical",
        "--durations",
        durations,
    )
    assert [score["durations"] for score in output["scores"]] == list(CANDIDATE_NAMES)
    count = {score["durations"]: score["parameters"] for score in output["scores"]}
    assert count["gaussian"] == count["gamma"] == count["viterbi"] == count["poisson"] + 1


def test_structure_text_is_read_again():
    for text in ("full", "semi-tied", "semi-tied:0.5", "mfa:4", "hddc:0.95"):
        assert structure_text(parse_structure(text)) == text
        assert parse_structure(structure_text(parse_structure(text))) == parse_structure(text)


@pytest.mark.usefixtures("unchecked")
def test_select_by_reproduction_prints_command_that_learns_the_choice(run_command_line, folder, tmp_path):
    result = run_command_line("select", folder, "--workers", "1", "--out", tmp_path / "scores.png")
    assert result.exit_code == 0
    lines = result.stdout.splitlines()
    assert "default" in lines[1]
    assert sum("selected" in line for line in lines[1:-4]) >= 1
    assert (tmp_path / "scores.png").stat().st_size > 10_000
    (command,) = (line.split("pilotfish ")[1] for line in lines if "pilotfish learn" in line)
    learned = run_command_line(*shlex.split(command))
    assert learned.exit_code == 0
    assert (tmp_path / "my.skill").exists()


@pytest.mark.usefixtures("unchecked")
def test_select_by_reproduction_is_the_same_for_one_and_two_processes(run_json, folder):
    options = ("--states", "2:3", "--structures", "diagonal,spherical", "--max-iterations", "20")
    one, two = (run_json("select", folder, *options, "--workers", count) for count in ("1", "2"))
    assert one == two
    assert len(one["scores"]) == 5
    assert one["fits"] == 25
    assert one["scores"][0]["default"]
    assert one["selected"] in one["scores"]
    assert len(one["scores"][1]["values"]) == 5


def test_select_by_reproduction_recommends_durations_frames_and_edge(run_command_line, folder):
    """The printed commands keep what the selection used; three states of three at most are an edge."""
    candidate = Candidate(3, SemiTied(0.5), durations=DurationModel(), frames="relevance")
    options = {"only": "0-2", "riemannian": True, "velocities": True, "regularisation": 1e-4}
    learn, reproduce = learn_command(candidate, "my data", options)
    assert learn == (
        "pilotfish learn 'my data' --states 3 --structure semi-tied:0.5 --durations gaussian --only 0-2 "
        "--riemannian --regularisation 0.0001 --out my.skill"
    )
    assert reproduce == "pilotfish reproduce my.skill --relevance 'my data' --frames now.json"
    scores = [
        ReproductionScore(Candidate(states), states, np.full(3, 1.0 / states), {}) for states in (2, 4, 20)
    ]
    selection = ReproductionSelection(tuple(scores), (), 0)
    assert edge_notes(selection) == ["the largest number of states tried; try --states 20:30"]


def test_select_task_without_physics_options_is_rejected(run_command_line, folder):
    for options, text in (
        ((*BY_LIKELIHOOD, "--task", "valve"), "--task"),
        (("--situations", "3"), "--task NAME"),
    ):
        result = run_command_line("select", folder, *options)
        assert result.exit_code == 2
        assert text in result.stderr


def test_process_pool_yields_processes_only_for_several_jobs():
    with process_pool(1, 8) as one, process_pool(8, 1) as single:
        assert one is None
        assert single is None
    with process_pool(2, 8) as pool:
        assert list(pool.map(abs, [-1, 2])) == [1, 2]
