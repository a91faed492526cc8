"""Arguments of a wrong type are refused with the expression to write instead."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

# Calls, with `t` the inputs and `R` a reference, and how their messages begin.
INVALID_CALLS = {
    "plots.reproduction(t.skill, t.motion, t.frames)": (
        "skill is a Skill, expected an AdaptedSkill; adapt(skill, frames) makes one"
    ),
    "plots.reproduction(t.fit, t.motion, t.frames)": (
        "skill is a Fit, expected an AdaptedSkill; adapt(fit.skill, frames) makes one"
    ),
    "plots.reproduction(t.adapted, t.feedback, t.frames)": (
        "motion is a Feedback, expected a Motion; feedback.rollout(start) makes one"
    ),
    "plots.reproduction(t.adapted, t.motion, t.frames[0])": (
        "frames is a Frame, expected a list of them; write [frame]"
    ),
    "plots.reproduction(t.adapted, t.motion, t.frames, demonstration=t.demonstrations)": (
        "demonstration is a tuple, expected a Demonstration"
    ),
    "plots.reproduction(t.adapted, t.motion, t.frames, planes=('position x', 'position y'))": (
        "planes is ('position x', 'position y'), expected a list of pairs of names; write "
        "[('position x', 'position y')]"
    ),
    "plots.reproduction(t.adapted, t.motion, t.frames, planes=[('position x',)])": (
        "planes[0] is ('position x',), expected a pair of column names"
    ),
    "plots.model_selection(t.fit)": "selection is a Fit, expected a Selection",
    "plots.frame_relevance(t.frame_relevance.values)": (
        "frame_relevance is a ndarray, expected a FrameRelevance"
    ),
    "plots.frame_relevance(t.skill)": "frame_relevance is a Skill, expected a FrameRelevance; relevance(",
    "plots.likelihood_trace(t.fit)": "fits is a Fit, expected a list of them; write [fit]",
    "plots.likelihood_trace([t.skill])": "fits[0] is a Skill, expected a Fit; learn makes one",
    "plots.online_clusters(t.online_models[0])": (
        "models is an OnlineModel, expected a list of them; write [onlinemodel]"
    ),
    "plots.online_clusters([t.skill])": "models[0] is a Skill, expected an OnlineModel",
    "plots.covariance_correlations(t.skill)": "skills is a Skill, expected a list of them; write [skill]",
    "plots.covariance_correlations([t.fit])": "skills[0] is a Fit, expected a Skill; fit.skill is one",
    "plots.covariance_correlations(3)": "skills is an int, expected a list of Skill",
    "plots.demonstrations_in_frames(t.skill, t.demonstrations[0])": (
        "demonstrations is a Demonstration, expected a list of them; write [demonstration]"
    ),
    "plots.demonstrations_in_frames(t.skill, [])": "demonstrations is empty, expected at least one",
    "plots.tracked_coordinates(t.adapted, R, t.motion)": (
        "states is a Reference, expected an array T; planning.plan_states makes one"
    ),
    "plots.tracked_coordinates(t.adapted, t.states * 1.0, t.motion)": (
        "states has shape (24,) and entries float64, expected integer entries and axes T"
    ),
    "plots.forward_variable(t.skill, horizon=200.)": (
        "horizon is 200.0, expected a whole number of steps such as 200"
    ),
    "plots.forward_variable(t.skill, horizon='20')": "horizon is '20', expected a whole number of steps",
    "plots.forward_variable(t.skill, horizon=9, log_observed=[[0.0]])": "log_observed is a list, expected an",
    "plots.forward_variable(t.fit, horizon=9)": (
        "skill is a Fit, expected a Skill or an AdaptedSkill; fit.skill is one"
    ),
    "plots.state_graph(t.skill, min_probability='much')": "min_probability is 'much', expected a number",
    "plots.state_deviations(t.skill, columns='position x')": (
        "columns is the text 'position x', expected a list of names; write ['position x']"
    ),
    "plots.state_deviations(t.adapted)": (
        "skill is an AdaptedSkill, expected a Skill; pass the skill before adapt"
    ),
    "plots.basis_vectors(t.fit)": "skill is a Fit, expected a Skill; fit.skill is one",
    "plots.feedback_gains(R, t.skill.layout)": (
        "feedback is a Reference, expected a Feedback; track(system, reference, control_cost) makes one"
    ),
    "plots.feedback_gains(t.feedback, t.skill)": "layout is a Skill, expected a Layout",
}
PROGRAM = """
import json, sys
import numpy as np
import conftest
from pilotfish import plots
from pilotfish.errors import InvalidInput
from pilotfish.planning.plan import reference_from_states
t = conftest.make_plot_inputs(np.random.default_rng(0))
R = reference_from_states(t.adapted, t.states, 2e-3)
messages = {}
for line in json.load(sys.stdin):
    try:
        eval(line)
        messages[line] = "drawn"
    except InvalidInput as error:
        messages[line] = str(error)
    except Exception as error:
        messages[line] = f"a bare {type(error).__name__}: {error}"
print(json.dumps(messages))
"""


@pytest.fixture(scope="module")
def error_messages() -> dict[str, str]:
    """Return the messages without annotation checks, in a process of its own."""
    path = os.pathsep.join([str(Path(__file__).parent), *sys.path])
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", PROGRAM],
        input=json.dumps(list(INVALID_CALLS)),
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | {"PYTHONPATH": path},
    )
    return json.loads(done.stdout)


@pytest.mark.parametrize("line", INVALID_CALLS)
def test_plots_wrong_type_is_refused_with_fix(error_messages: dict[str, str], line: str):
    """The message names the argument, its type, what was expected and the nearest fix."""
    assert error_messages[line].startswith(INVALID_CALLS[line])
