"""How long does each phase last? Durations counted after a Markov fit, and durations fitted with all else.

Run it:  python examples/exact_durations.py
"""

import numpy as np

import pilotfish as pf
from pilotfish.demonstrations import Layout, Part, Quantity

LAYOUT = Layout((Part("place", Quantity.SCALAR, 1, "m"),))
PERIOD = 0.1  # [s]
MEANS, SHAPES = np.array([2.0, 0.9, 3.0]), np.array([4.0, 9.0, 20.0])  # of gamma laws [s], by phase


def recording(rng, steps=120):
    """Three places in turn, again and again, each seen with noise; it ends where the tape ends."""
    path: list[int] = []
    phase = int(rng.integers(3))
    while len(path) < steps:
        lasts = rng.gamma(SHAPES[phase], MEANS[phase] / SHAPES[phase])  # [s]
        path += [phase] * max(1, round(lasts / PERIOD))
        phase = (phase + 1) % 3
    x = 2.0 * np.array(path[:steps], float)[:, None] + rng.normal(size=(steps, 1))
    return pf.demonstration(x, PERIOD, LAYOUT, ())


rng = np.random.default_rng(0)
recordings, fresh = ([recording(rng) for _ in range(count)] for count in (24, 24))
settings = pf.models.EMSettings(max_iterations=200)
common = {"states": 3, "start": pf.models.KMeans(), "settings": settings}

counted = pf.learn(recordings, rng=np.random.default_rng(0), **common).skill


def exact(distribution):
    """Visits that a recording cuts off count for what they are: at least so long."""
    duration_model = pf.models.DurationModel(distribution, pf.models.Censoring(left=False, last=True))
    return pf.models.learn_semi_markov(
        recordings, rng=np.random.default_rng(0), duration_model=duration_model, **common
    ).skill


def durations(skill):
    """Mean and deviation of each phase [s], in the order of their places; a normal law's before it is cut."""
    distribution, order = skill.dynamics.durations, np.argsort(skill.means[0, :, 0])
    return "   ".join(
        f"{PERIOD * distribution.means[k]:.2f} +- {PERIOD * distribution.deviations[k]:.2f}" for k in order
    )


def log_likelihood_per_step(skill):
    """Log-likelihood per step of recordings that the skill did not learn from [nats]."""
    return pf.log_likelihood(skill, fresh).sum() / sum(len(d.x) for d in fresh)


print("phases last [s]            first          second         third          log-likelihood a step")
true_durations = zip(MEANS, MEANS / np.sqrt(SHAPES), strict=True)
print(
    f"{'as drawn':<26} {'   '.join(f'{mean:.2f} +- {deviation:.2f}' for mean, deviation in true_durations)}"
)
print(f"{'counted':<26} {durations(counted)}   {log_likelihood_per_step(counted):.4f}")
distributions = (
    pf.durations.Gamma(),
    pf.durations.LogNormal(),
    pf.durations.Gaussian(),
    pf.durations.Poisson(),
    pf.durations.NegativeBinomial(),
)
for distribution in (
    *distributions,
    pf.durations.NegativeBinomial(1.0),
    pf.durations.Histogram(),
    pf.durations.Histogram(pseudocount=10.0),
):
    skill = exact(distribution)
    print(f"{distribution.label:<26} {durations(skill)}   {log_likelihood_per_step(skill):.4f}")
