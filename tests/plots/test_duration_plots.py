"""Plots of the durations of every distribution."""

from dataclasses import replace

import numpy as np
import pytest

from pilotfish.models import SemiMarkovChain, durations
from pilotfish.plots import forward_variable, state_graph

DISTRIBUTIONS = {
    "gaussian": durations.Gaussian(np.array([6.0, 8.0, 5.0]), np.array([1.0, 2.0, 0.5])),
    "log-normal": durations.LogNormal(np.log([6.0, 8.0, 5.0]), np.array([0.2, 0.9, 0.1])),
    "gamma": durations.Gamma(np.array([6.0, 0.7, 50.0]), np.array([1.0, 0.1, 10.0])),
    "poisson": durations.Poisson(np.array([6.0, 8.0, 5.0])),
    "negative binomial": durations.NegativeBinomial(np.array([1.0, 2.0, 50.0]), np.array([0.1, 0.2, 0.9])),
    "histogram": durations.Histogram(np.full((9, 3), 1.0 / 9.0)),
}


@pytest.mark.parametrize("distribution", DISTRIBUTIONS.values(), ids=DISTRIBUTIONS)
def test_state_graph_titles_have_mean_and_deviation(make_skill_of_size, distribution):
    """In seconds, with two digits of the deviation."""
    skill = make_skill_of_size(states=3)
    chain = SemiMarkovChain(np.eye(3)[0], np.eye(3, k=1), distribution)
    skill = replace(skill, dynamics=chain)
    titles = [axes.get_title() for axes in state_graph(skill).axes if "±" in axes.get_title()]
    for title, mean, deviation in zip(titles, distribution.means, distribution.deviations, strict=True):
        numbers = [float(number) for number in title.removesuffix(" s").split("±")]
        np.testing.assert_allclose(numbers, skill.period * np.array([mean, deviation]), rtol=0.1)
    assert len(forward_variable(skill, horizon=40).axes) == 2
