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
settings = pf.EMSettings(max_iterations=200)
common = {"states": 3, "start": pf.KMeans(), "settings": settings}

counted = pf.learn(recordings, rng=np.random.default_rng(0), **common).skill


def exact(law):
    """Visits that a recording cuts off count for what they are: at least so long."""
    timing = pf.Timing(law, pf.Censoring(first=False, last=True))
    return pf.learn_semi_markov(recordings, rng=np.random.default_rng(0), timing=timing, **common).skill


def durations(skill):
    """Mean and deviation of each phase [s], in the order of their places; a normal law's before it is cut."""
    law, order = skill.dynamics.durations, np.argsort(skill.means[0, :, 0])
    return "   ".join(f"{PERIOD * law.means[k]:.2f} +- {PERIOD * law.deviations[k]:.2f}" for k in order)


def so_likely(skill):
    """Log-likelihood per step of recordings that the skill did not learn from [nats]."""
    return pf.log_likelihood(skill, fresh).sum() / sum(len(d.x) for d in fresh)


print("phases last [s]            first          second         third          log-likelihood a step")
drawn = zip(MEANS, MEANS / np.sqrt(SHAPES), strict=True)
print(f"{'as drawn':<26} {'   '.join(f'{mean:.2f} +- {deviation:.2f}' for mean, deviation in drawn)}")
print(f"{'counted':<26} {durations(counted)}   {so_likely(counted):.4f}")
laws = (pf.Gamma(), pf.LogNormal(), pf.Normal(), pf.Poisson(), pf.NegativeBinomial())
for law in (*laws, pf.NegativeBinomial(1.0), pf.Histogram(), pf.Histogram(pseudocount=10.0)):
    skill = exact(law)
    print(f"{law.label:<26} {durations(skill)}   {so_likely(skill):.4f}")
