"""Compare durations counted after a Markov fit with durations that are fitted within EM.

Run it:  python examples/exact_durations.py
"""

import numpy as np

import pilotfish as pf
from pilotfish.demonstrations import Layout, Part, Quantity

LAYOUT = Layout((Part("place", Quantity.SCALAR, 1, "m"),))
PERIOD = 0.1  # [s]
MEANS, SHAPES = np.array([2.0, 0.9, 3.0]), np.array([4.0, 9.0, 20.0])  # gamma distributions [s], by phase


def sample_recording(rng, steps=120):
    """Sample three places in turn, with noise; the recording ends in the middle of a segment."""
    path: list[int] = []
    phase = int(rng.integers(3))
    while len(path) < steps:
        duration = rng.gamma(SHAPES[phase], MEANS[phase] / SHAPES[phase])  # [s]
        path += [phase] * max(1, round(duration / PERIOD))
        phase = (phase + 1) % 3
    x = 2.0 * np.array(path[:steps], float)[:, None] + rng.normal(size=(steps, 1))
    return pf.demonstration(x, PERIOD, LAYOUT, ())


def learn(durations=None):
    """Learn three states; without a duration model, durations are counted."""
    rng, initialisation = np.random.default_rng(0), pf.models.KMeans()
    return pf.learn(training, states=3, rng=rng, durations=durations, initialisation=initialisation).skill


def format_row(label, skill):
    """Format the mean and deviation of each phase [s], and the log-likelihood per step of new recordings."""
    durations, order = skill.dynamics.durations, np.argsort(skill.means[0, :, 0])
    columns = [f"{PERIOD * durations.means[k]:.2f} +- {PERIOD * durations.deviations[k]:.2f}" for k in order]
    log_likelihood = pf.models.log_likelihood(skill, test).sum() / sum(len(d.x) for d in test)
    return f"{label:<26} {'   '.join(columns)}   {log_likelihood:.4f}"


rng = np.random.default_rng(0)
training, test = ([sample_recording(rng) for _ in range(count)] for count in (24, 24))

print("durations [s]              first          second         third          log-likelihood per step")
true_columns = [f"{m:.2f} +- {m / np.sqrt(s):.2f}" for m, s in zip(MEANS, SHAPES, strict=True)]
print(f"{'true':<26} {'   '.join(true_columns)}")
print(format_row("counted", learn()))
for name, distribution in pf.durations.DISTRIBUTIONS.items():
    print(format_row(name, learn(pf.models.DurationModel(distribution))))
for distribution, options in (
    (pf.durations.NegativeBinomial, {"shape": 1.0}),
    (pf.durations.Histogram, {"pseudocount": 10.0}),
):
    label = f"{distribution.name}({', '.join(f'{k} {v:g}' for k, v in options.items())})"
    print(format_row(label, learn(pf.models.DurationModel(distribution, options=options))))
