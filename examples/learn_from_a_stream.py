"""Learn a skill online: every datapoint is used once and not stored.

A hand carries a part past a fixture to a tray. Half-way through, people begin to set the part down beside the
tray first. The model adds the states that this needs.

Run it:  python examples/learn_from_a_stream.py
"""

import numpy as np

import pilotfish as pf
from pilotfish.demonstrations import position_layout

STEPS, PERIOD = 120, 0.05  # of a demonstration [s]
PATH = np.array([[0.0, 0.0, 0.10], [0.25, 0.10, 0.30], [0.50, 0.0, 0.10]])  # [m]
DETOUR = np.array([[0.0, 0.0, 0.10], [0.25, 0.10, 0.30], [0.45, -0.35, 0.05], [0.50, 0.0, 0.10]])


def sample_demonstration(corners, rng):
    """Return positions through the corners, with a rest at each and a few millimetres of noise."""
    legs = np.linspace(0.0, len(corners) - 1.0, STEPS)
    s = np.clip((legs % 1.0 - 0.25) * 2.0, 0.0, 1.0)[:, None]
    begin = np.minimum(legs.astype(int), len(corners) - 2)
    s[-1] = 1.0
    path = corners[begin] + (3 * s**2 - 2 * s**3) * (corners[begin + 1] - corners[begin])
    offset = 0.004 * rng.normal(size=3)
    return path + offset + 0.002 * rng.normal(size=path.shape)


# Penalties, in squared metres: a datapoint farther than 7 cm from all lines and planes starts a state, and a
# direction of a subspace must explain more than (2 cm)^2. A discount of 0.998 remembers about 500 datapoints.
settings = pf.online.SOSC(
    cluster=0.07**2,
    dimension=0.02**2,
    noise=0.004**2,
    bandwidth=0.5**2,
    transition=1e-5,
    new_transition=1e-5,
    maintenance=pf.online.Maintenance(discount=0.998),
)
rng = np.random.default_rng(0)
model = pf.online.online_model(settings, position_layout(), PERIOD)

print("demonstration  states  dimensions")
for n in range(16):
    model = pf.online.begin_demonstration(model)
    for x in sample_demonstration(PATH if n < 8 else DETOUR, rng):  # as a sensor delivers them
        model, *_ = pf.online.observe(model, x)
    print(f"{n + 1:>13}  {model.clusters:>6}  {' '.join(map(str, model.dimensions[:, 0]))}")

# At any time the model can be converted to a skill.
skill = pf.online.to_skill(model)
world = pf.Frame("world", np.eye(3), np.zeros(3))
reference = pf.plan(pf.adapt(skill, [world]), PATH[0], horizon=STEPS)
lowest = reference.targets[np.argmin(reference.targets[:, 1])]
print(f"the plan sets the part down near {np.round(lowest[:3], 2)}, people did near {DETOUR[2]} [m]")
