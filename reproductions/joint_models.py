"""Joint models of operator and object for the assistance: batch and streamed, with D = 14.

A demonstration of a pose is augmented by a copy of the pose that no frame moves (6.1): three coordinates and
a quaternion of four numbers, twice. The joint model is learned on these flat columns, as in the thesis.
Shared control by regression uses it on S^3. The marginal of the output part is the skill of shared control
that carries the command, and of autonomous control.

The screw of the screwdriver task is at rest here: the thesis moves the target between demonstrations. The
simulated demonstrations are cached, as those of assistance.py.

Source: Tanwani 2018, sections 5.7.2 and 6.3.
"""

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from recordings import cached_recording
from tqdm import tqdm

import pilotfish as pf
from pilotfish import assistance
from pilotfish.demonstrations import Demonstration, Frame, Layout, Quantity, pose_layout
from pilotfish.demonstrations import frame as make_frame
from pilotfish.environments import TASKS, Task, Workcell
from pilotfish.gaussians.structures import CovarianceStructure, DenseCovariances
from pilotfish.geometry import Pose, left_multiplication_matrix
from pilotfish.models import Endpoints
from pilotfish.models.online import (
    OnlineModel,
    estimate_penalties,
    estimate_settings,
    from_batch_fit,
    observe_demonstration,
    online_model,
)
from pilotfish.simulation import (
    Link,
    TeleoperationResult,
    displace_view,
    record_demonstrations,
    situation_from_seed,
    teleoperate,
)
from pilotfish.types import Array, Float

POSE, JOINT = 7, 14  # columns of a pose, and of a pose of the operator with the same in the frame
DEMONSTRATIONS = {"screwdriver": 6, "carabiner": 11, "stab": 6}
STATES = {"screwdriver": 3, "carabiner": 4, "stab": 2}  # of the thesis
FIRST = 4  # demonstrations of the batch fit with which a stream begins
EARLIEST, LATEST = 0.05, 0.75  # instants of a switch, of the duration of the operator's own motion
Learn = Callable[[Sequence[Demonstration]], pf.Skill]


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """An operator in one situation, whose view of the objects is displaced.

    Attributes:
        result: What was commanded and reached.
        actual: Poses of the objects at the robot at the start.
        observed: Poses of the objects that the operator sees at the start.
        switch: Time at which autonomous control begins [s]; infinite if it does not.
    """

    result: TeleoperationResult
    actual: dict[str, Pose]
    observed: dict[str, Pose]
    switch: float


def task_at_rest(name: str) -> Task[Any]:
    """Return a task whose objects do not move by themselves."""
    task = TASKS[name]
    if task.actuate_scene is None:
        return task
    sample = task.sample_situation
    return replace(task, actuate_scene=None, sample_situation=lambda rng: replace(sample(rng), amplitude=0.0))


def load_demonstrations(name: str, seed: int) -> tuple[Demonstration, ...]:
    """Return the demonstrations of a task, as many as in the thesis."""
    number = DEMONSTRATIONS[name]

    def make() -> list[Demonstration]:
        recordings = record_demonstrations(task_at_rest(name), number, seed)
        bar = tqdm(recordings, f"{name}: recording", number, disable=not sys.stderr.isatty())
        return [recording.demonstration for recording, _ in bar]

    return cached_recording(__file__, f"{name} at rest, {number} demonstrations, seed {seed}", make)


def augment(demonstration: Demonstration) -> Demonstration:
    """Return a demonstration with the operator's pose before the pose in the frame, flat (6.1)."""
    x = demonstration.x[:, :POSE]
    parts = pose_layout().parts
    layout = Layout((*(replace(part, name=f"operator {part.name}") for part in parts), *parts))
    frames = [augment_frame(frame) for frame in demonstration.frames if isinstance(frame, Frame)]
    return pf.demonstration(np.hstack([x, x]), demonstration.period, layout, frames, demonstration.name)


def augment_frame(frame: Frame) -> Frame:
    """Return the frame that moves the output part only."""
    A = np.eye(JOINT)
    A[POSE:, POSE:] = frame.A[:POSE, :POSE]
    return make_frame(frame.name, A, np.concatenate([np.zeros(POSE), frame.b[:POSE]]))


def learn_batch(
    demonstrations: Sequence[Demonstration], states: int, structure: CovarianceStructure
) -> pf.Skill:
    """Learn a joint model from augmented demonstrations, with the defaults of `pf.learn`."""
    rng = np.random.default_rng(0)
    return pf.learn(demonstrations, states=states, rng=rng, structure=structure).skill


def learn_stream(demonstrations: Sequence[Demonstration], states: int) -> OnlineModel:
    """Begin SOSC with a batch fit of the first four augmented demonstrations, and stream the others.

    This is how `pilotfish stream` begins, but without scales: covariances are subspaces and sigma^2, as
    printed. The stream may add clusters and merge them.
    """
    first = demonstrations[:FIRST]
    skill = learn_batch(first, states, pf.structures.Full())
    model = from_batch_fit(skill, first, estimate_penalties(skill, first, scales=False))
    return observe_all(model, demonstrations[FIRST:])


def learn_stream_from_nothing(demonstrations: Sequence[Demonstration], states: int) -> OnlineModel:
    """Stream augmented demonstrations into an empty SOSC model, and let it find the number of clusters.

    states is the approximate number that penalties are estimated with.
    """
    first = demonstrations[0]
    rng, names = np.random.default_rng(0), tuple(frame.name for frame in first.frames)
    settings = estimate_settings(demonstrations[:FIRST], states=states, rng=rng, scales=False)
    return observe_all(online_model(settings, first.layout, first.period, names), demonstrations)


def observe_all(model: OnlineModel, demonstrations: Sequence[Demonstration]) -> OnlineModel:
    for demonstration in demonstrations:
        model, _ = observe_demonstration(model, demonstration)
    return model


def output_skill(joint: pf.Skill) -> pf.Skill:
    """Return the marginal of the output part: a skill of the pose."""
    output = slice(POSE, JOINT)
    ends = joint.endpoints
    return replace(
        joint,
        means=joint.means[:, :, output].copy(),
        covariances=tuple(DenseCovariances(c.dense[:, output, output].copy()) for c in joint.covariances),
        layout=pose_layout(),
        regularisation=None,
        demonstrated=None,
        endpoints=Endpoints(ends.means[..., output], ends.variances[..., output]) if ends else None,
    )


def joint_on_sphere(joint: pf.Skill) -> pf.Skill:
    """Return a joint model with orientations on S^3, to first order."""
    parts = [
        replace(part, quantity=Quantity.ORIENTATION) if part.quantity is Quantity.QUATERNION else part
        for part in joint.layout.parts
    ]
    layout, means, covariances = Layout(tuple(parts)), joint.means.copy(), []
    for columns in layout.unit_quaternions:
        means[:, :, columns] /= np.linalg.norm(means[:, :, columns], axis=2, keepdims=True)
    for p, c in enumerate(joint.covariances):
        maps = np.stack([tangent_map(mean) for mean in joint.means[p]])
        covariances.append(DenseCovariances(maps @ c.dense @ maps.swapaxes(1, 2)))
    return replace(
        joint,
        means=means,
        covariances=tuple(covariances),
        layout=layout,
        regularisation=None,
        demonstrated=None,
        endpoints=None,
    )


def tangent_map(mean: Float[Array, "14"]) -> Float[Array, "12 14"]:
    """Return the matrix from deviations of two flat poses to positions and rotation vectors (body axes)."""
    M = np.zeros((12, JOINT))
    for row, column in ((0, 0), (6, POSE)):
        q = mean[column + 3 : column + POSE]
        M[row : row + 3, column : column + 3] = np.eye(3)
        scaled = left_multiplication_matrix(q / (q @ q))
        M[row + 3 : row + 6, column + 3 : column + POSE] = 2.0 * scaled[:, 1:].T
    return M


def make_assistant(
    demonstrations: Sequence[Demonstration], learn: Learn, *, literal: bool
) -> assistance.Assistant:
    """Return the assistance of a joint model, with the gate calibrated on the demonstrations.

    Args:
        demonstrations: Demonstrations of a pose.
        learn: Function that learns a joint model from augmented demonstrations.
        literal: Whether shared control is regression (6.4)-(6.9); otherwise it carries the command.
    """

    def learn_output(chosen: Sequence[Demonstration]) -> pf.Skill:
        return output_skill(learn([augment(demonstration) for demonstration in chosen]))

    gate = assistance.calibrate_gate(demonstrations, learn_output)
    joint = learn([augment(demonstration) for demonstration in demonstrations])
    on_sphere = joint_on_sphere(joint) if literal else None
    skill = assistance.assisted_skill(output_skill(joint), gate=gate, joint_skill=on_sphere)
    return assistance.make_assistant([skill])


def operate(
    name: str,
    assistant: assistance.Assistant,
    case: tuple[int, int],
    *,
    mode: str,
    link: Link,
    switch: float = np.inf,
) -> Trial:
    """Operate in one situation; the operator's noise is the same in every mode.

    Args:
        name: Name of the task.
        assistant: Assistance at the robot.
        case: Seed and number of the situation.
        mode: Mode before the switch.
        link: How far the operator's view is off.
        switch: Time at which autonomous control begins [s].
    """
    task = task_at_rest(name)
    situation = situation_from_seed(task, "test", *case)
    actual = Workcell(task, situation).frames()
    observed = displace_view(actual, link, np.random.default_rng([*case, 1]))(actual)
    rng = np.random.default_rng([*case, 1])

    def mode_at(time: float) -> str:
        return mode if time < switch else "autonomous"

    return Trial(
        teleoperate(assistant, task, situation, rng, mode=mode_at, link=link), actual, observed, switch
    )


def switch_time(case: tuple[int, int], duration: float) -> float:
    """Return a random instant of a motion, the same for every model."""
    return duration * float(np.random.default_rng([*case, 2]).uniform(EARLIEST, LATEST))
