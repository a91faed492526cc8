"""Arguments of a wrong type are refused with the given type, the expected one and the fix."""

from types import SimpleNamespace

import numpy as np
import pytest

import pilotfish as pf
from pilotfish.models import FromModel

pytestmark = pytest.mark.usefixtures("unchecked")  # annotations are not checked, as for a user

INVALID_CALLS = {
    "start is a list": (lambda g: pf.plan(g.adapted, list(g.start), horizon=9), "np.array(start)"),
    "start is a matrix": (lambda g: pf.plan(g.adapted, g.start[None], horizon=9), "(1, 14)"),
    "skill is not adapted": (lambda g: pf.plan(g.fit.skill, g.start, horizon=9), "pf.adapt"),
    "horizon is fractional": (lambda g: pf.plan(g.adapted, g.start, horizon=9.5), "whole number"),
    "regularisation is text": (
        lambda g: pf.plan(g.adapted, g.start, horizon=9, covariance_regularisation="a"),
        "covariance_regularisation",
    ),
    "control cost is text": (lambda g: pf.track(g.system, g.reference, control_cost="9"), "control_cost"),
    "control cost is a list": (
        lambda g: pf.track(g.system, g.reference, control_cost=[1.0] * 7),
        "control_cost",
    ),
    "control cost is a vector": (
        lambda g: pf.track(g.system, g.reference, control_cost=np.ones(7)),
        "np.diag",
    ),
    "period differs": (
        lambda g: pf.track(pf.control.double_integrator(7, 1.0), g.reference, control_cost=9.0),
        "0.1 s",
    ),
    "reference is a skill": (lambda g: pf.track(g.system, g.adapted, control_cost=9.0), "pf.plan"),
    "axes are fractional": (lambda g: pf.control.double_integrator(7.0, 0.1), "whole number"),
    "states are fractional": (lambda g: g.learn(states=3.5), "whole number"),
    "rng is a seed": (lambda g: g.learn(rng=0), "default_rng"),
    "structure is a name": (lambda g: g.learn(structure="full"), "pf.structures.Full()"),
    "structure is a class": (lambda g: g.learn(structure=pf.structures.SemiTied), "pf.structures.Full()"),
    "initialisation is a class": (lambda g: g.learn(initialisation=pf.models.KMeans), "pf.models.KMeans()"),
    "dynamics is a number": (lambda g: g.learn(dynamics=3), "dynamics"),
    "durations is a class": (lambda g: g.learn(durations=pf.durations.Gamma), "pf.models.DurationModel("),
    "distribution is an instance": (
        lambda g: pf.models.DurationModel(pf.durations.Poisson(np.ones(1))),
        "pf.durations.LogNormal",
    ),
    "censoring is text": (lambda g: pf.models.DurationModel(censoring="both"), "pf.models.Censoring"),
    "one demonstration": (lambda g: g.learn(g.demos[0]), "list"),
    "demonstrations are arrays": (lambda g: g.learn([d.x for d in g.demos]), "pf.demonstration"),
    "skill is a fit": (lambda g: pf.adapt(g.fit, g.demos[0].frames), "fit.skill"),
    "frames is one frame": (lambda g: pf.adapt(g.fit.skill, g.demos[0].frames[0]), "list of frames"),
    "frames is a demonstration": (lambda g: pf.adapt(g.fit.skill, g.demos[0]), ".frames"),
    "restarts from a given model": (
        lambda g: g.learn(
            initialisation=FromModel(g.fit.markov_skill), settings=pf.models.EMSettings(restarts=2)
        ),
        "restarts",
    ),
    "tying is text": (lambda g: pf.structures.SemiTied("a"), "tying"),
    "factors is text": (lambda g: pf.structures.MFA("4"), "factors"),
    "components is fractional": (lambda g: pf.structures.MPPCA(1.5), "components"),
    "directions is fractional": (lambda g: pf.structures.EMLLT(20.0), "directions"),
    "transforms is fractional": (lambda g: pf.structures.MLT(2.0), "transforms"),
    "online settings are a name": (
        lambda g: pf.online.online_model("sosc", g.demos[0].layout, 0.1),
        "SOSC(",
    ),
    "maintenance is a number": (lambda g: pf.online.DPGMM(1.0, 0.1, maintenance=3), "Maintenance("),
    "discount is text": (lambda g: pf.online.Maintenance(discount="0.9"), "give a number or None"),
    "penalty is text": (lambda g: pf.online.DPGMM("1", 0.1), "cluster"),
    "datapoint is text": (lambda g: pf.online.observe(g.stream, "text"), "not real numbers"),
    "datapoint has None": (lambda g: pf.online.observe(g.stream, [1.0, None, 2.0]), "not real numbers"),
    "demonstration is an array": (
        lambda g: pf.online.observe_demonstration(g.stream, g.demos[0].x),
        "pf.demonstration",
    ),
}


@pytest.fixture(scope="module")
def given() -> SimpleNamespace:
    rng = np.random.default_rng(0)
    demos = pf.io.synthetic_valve(rng)[:3]
    fit = pf.learn(demos, states=3, rng=rng)
    adapted, start = pf.adapt(fit.skill, demos[0].frames), demos[0].x[0]

    def learn(demonstrations=demos, **options):
        return pf.learn(demonstrations, **{"states": 3, "rng": rng, **options})

    return SimpleNamespace(
        learn=learn,
        demos=demos,
        fit=fit,
        adapted=adapted,
        start=start,
        reference=pf.plan(adapted, start, horizon=20),
        system=pf.control.double_integrator(7, 0.1),
        stream=pf.online.online_model(pf.online.DPGMM(1.0, 0.1), pf.demonstrations.position_layout(3), 0.1),
    )


@pytest.mark.parametrize("name", INVALID_CALLS)
def test_argument_of_wrong_type_error_names_the_fix(given, name):
    call, words = INVALID_CALLS[name]
    with pytest.raises(pf.InvalidInput) as error:
        call(given)
    assert words in str(error.value)
