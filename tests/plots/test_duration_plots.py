"""The graph of a skill tells the durations of every law."""

from dataclasses import replace

import numpy as np
import pytest

from pilotfish.models import SemiMarkovChain
from pilotfish.models.durations import Gamma, Gaussian, Histogram, LogNormal, NegativeBinomial, Poisson
from pilotfish.plots import forward_variable, state_graph

DISTRIBUTIONS = {
    "gaussian": Gaussian(np.array([6.0, 8.0, 5.0]), np.array([1.0, 2.0, 0.5])),
    "log-normal": LogNormal(np.log([6.0, 8.0, 5.0]), np.array([0.2, 0.9, 0.1])),
    "gamma": Gamma(np.array([6.0, 0.7, 50.0]), np.array([1.0, 0.1, 10.0])),
    "poisson": Poisson(np.array([6.0, 8.0, 5.0])),
    "negative binomial": NegativeBinomial(np.array([1.0, 2.0, 50.0]), np.array([0.1, 0.2, 0.9])),
    "histogram": Histogram(np.full((9, 3), 1.0 / 9.0)),
}


@pytest.mark.parametrize("durations", DISTRIBUTIONS.values(), ids=DISTRIBUTIONS)
def test_mean_and_deviation_of_every_law_stand_under_its_state(make_skill_of_size, durations):
    """In seconds, two digits of the deviation."""
    skill = make_skill_of_size(states=3)
    chain = SemiMarkovChain(np.eye(3)[0], np.eye(3, k=1), durations)
    skill = replace(skill, dynamics=chain)
    titles = [axes.get_title() for axes in state_graph(skill).axes if "±" in axes.get_title()]
    for title, mean, deviation in zip(titles, durations.means, durations.deviations, strict=True):
        told = [float(number) for number in title.removesuffix(" s").split("±")]
        np.testing.assert_allclose(told, skill.period * np.array([mean, deviation]), rtol=0.1)
    assert len(forward_variable(skill, horizon=40).axes) == 2
