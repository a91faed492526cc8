"""Find out from demonstrations that a frame is not relevant, and leave it out.

A valve was opened while a chair stood at random places. The chair is recorded as a third frame.

Run it:  python examples/leave_out_what_does_not_matter.py
"""

from dataclasses import replace

import numpy as np

import pilotfish as pf
from pilotfish.demonstrations import frame_from_pose
from pilotfish.geometry import normalise, pose

rng = np.random.default_rng(0)


def add_chair_frame(demonstration):
    """Return the recording with a chair at a random pose as a further frame."""
    position = np.array([0.5, -0.9, 0.2]) + 0.3 * rng.normal(size=3)  # [m]
    chair = frame_from_pose("chair", demonstration.layout, pose(position, normalise(rng.normal(size=4))))
    return replace(demonstration, frames=(*demonstration.frames, chair))


training = [add_chair_frame(demonstration) for demonstration in pf.datasets.valve()[:4]]
skill = pf.learn(training, states=7, rng=rng).skill

# Each demonstration is held out in turn: which powers of the frame Gaussians predict it best?
frame_relevance = pf.relevance(skill, training)
for name, row in zip(frame_relevance.frame_names, frame_relevance.values, strict=True):
    print(f"{name:<13}" + " ".join(f"{value:5.2f}" for value in row))
print(f"relevant at no state: {', '.join(frame_relevance.distractors)}")

# Two situations of the same valve that differ in the pose of the chair only.
unseen = pf.datasets.valve()[4]
situations = add_chair_frame(unseen), add_chair_frame(unseen)
system = pf.control.double_integrator(7, period=0.1)


def reproduce(skill, situation, relevance=None):
    """Return the positions of the reproduction from the start of the demonstration."""
    adapted = pf.adapt(skill, situation.frames, relevance=relevance)
    reference = pf.plan(adapted, situation.x[0], horizon=200)
    return pf.track(system, reference, control_cost=9.0).rollout(situation.x[0]).x[:, :3]


def largest_change(skill, relevance=None):
    """Return the largest change of the reproduction by the pose of the chair [mm]."""
    first, second = (reproduce(skill, situation, relevance) for situation in situations)
    return 1000 * np.linalg.norm(first - second, axis=1).max()


def mean_error(positions):
    """Return the mean distance from the demonstration [mm]."""
    return 1000 * np.linalg.norm(positions - unseen.x[:, :3], axis=1).mean()


print(f"the chair moves, all frames count equally: the motion changes by {largest_change(skill):.0f} mm")
print(f"the chair moves, frames are weighted: {largest_change(skill, frame_relevance.values):.3f} mm")

# Or learn again without the chair: its pose is then not needed.
selected = pf.learn(pf.models.select_frames(training, frame_relevance), states=7, rng=rng).skill
print(f"learned again from {' and '.join(selected.frame_names)}; mean error of the reproduction:")
for label, positions in (
    ("equal frames", reproduce(skill, situations[0])),
    ("weighted frames", reproduce(skill, situations[0], frame_relevance.values)),
    ("without the chair", reproduce(selected, unseen)),
):
    print(f"  {label}: {mean_error(positions):.0f} mm")
