"""A chair stood about while a valve was opened. Find out that it does not matter, and leave it out.

Run it:  python examples/leave_out_what_does_not_matter.py
"""

from dataclasses import replace

import numpy as np

import pilotfish as pf
from pilotfish.demonstrations import frame_from_pose
from pilotfish.geometry import normalise, pose

rng = np.random.default_rng(0)


def add_chair_frame(demonstration):
    """The same recording, seen from a chair as well, which stood anywhere."""
    place = np.array([0.5, -0.9, 0.2]) + 0.3 * rng.normal(size=3)  # [m]
    chair = frame_from_pose("chair", demonstration.layout, pose(place, normalise(rng.normal(size=4))))
    return replace(demonstration, frames=(*demonstration.frames, chair))


training = [add_chair_frame(demonstration) for demonstration in pf.datasets.valve()[:4]]
skill = pf.learn(training, states=7, rng=rng).skill

# Each demonstration is held out in turn: how much of which frame foretells it best from the others?
found = pf.relevance(skill, training)
for name, row in zip(found.frame_names, found.values, strict=True):
    print(f"{name:<13}" + " ".join(f"{value:5.2f}" for value in row))
print(f"matter at no state: {', '.join(found.distractors)}")

# The same valve twice; only the chair has moved in between.
unseen = pf.datasets.valve()[4]
before, after = add_chair_frame(unseen), add_chair_frame(unseen)


def motion(skill, situation, relevance=None):
    """The valve opened from where the person began."""
    adapted = pf.adapt(skill, situation.frames, relevance=relevance)
    reference = pf.plan(adapted, situation.x[0], horizon=200)
    return pf.track(pf.control.double_integrator(7, period=0.1), reference, control_cost=9.0).rollout(
        situation.x[0]
    )


def follow(skill, relevance=None):
    """How far the motion is led astray by the chair, at most [mm]."""
    one, other = (motion(skill, situation, relevance).x[:, :3] for situation in (before, after))
    return 1000 * np.linalg.norm(one - other, axis=1).max()


def error(x):
    """Distance from what the person did, the mean over steps [mm]."""
    return 1000 * np.linalg.norm(x[:, :3] - unseen.x[:, :3], axis=1).mean()


print(f"the chair moved, all frames heard: the motion bends by up to {follow(skill):.0f} mm")
print(f"the chair moved, each heard as it matters: {follow(skill, found.values):.3f} mm")

# Or learn anew without it: then nobody need know where the chair stands.
fewer = pf.learn(pf.select_frames(training, found), states=7, rng=rng).skill
print(f"learned anew from {' and '.join(fewer.frame_names)}")
for how, x in (
    ("all frames heard", motion(skill, before).x),
    ("each as it matters", motion(skill, before, found.values).x),
    ("without the chair", motion(fewer, unseen).x),
):
    print(f"  {how}: on average {error(x):.0f} mm from what the person did")
