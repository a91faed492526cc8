"""Methods of metaworld.py: from demonstrations and a new situation to commands of hand and gripper.

A path is an array with one row per time step of the demonstrations: the commanded position of the hand [m]
and the command of the gripper. Its first row is the start, at which no command was given.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from problems import Floats

import pilotfish as pf
from pilotfish.geometry import Pose

STEP = 0.0125  # s, of the suite
BASIS_FUNCTIONS, WEIGHT_PENALTY = 20, 1e-6  # of ProMP: radial functions, penalty of the least squares
CONTEXT_NOISE = 1e-6  # m^2, of ProMP: variance that is added to the covariance of the situations


@dataclass(frozen=True, slots=True, eq=False)
class Situation:
    """Positions at the start of an episode [m].

    Attributes:
        seed: Seed by which the suite creates the situation.
        hand: Commanded position of the hand.
        object: Position of the object.
        goal: Position of the goal.
    """

    seed: int
    hand: Floats
    object: Floats
    goal: Floats

    @property
    def positions(self) -> Floats:
        """Hand, object and goal in one row."""
        return np.concatenate([self.hand, self.object, self.goal])


@dataclass(frozen=True, slots=True, eq=False)
class Episode:
    """Episode of the expert.

    Attributes:
        situation: Where it began.
        commands: Commanded position of the hand and command of the gripper, per step of the suite.
        succeeded: Whether the suite reported success.
    """

    situation: Situation
    commands: Floats
    succeeded: bool


Reproduce = Callable[[Situation], Floats]
Method = Callable[[Sequence[Episode], int, int], Reproduce]  # of demonstrations, steps per row and seed


def episode_path(episode: Episode, steps_per_row: int) -> Floats:
    """Return every n-th row of an episode, from the start on; the remaining steps at the end are left out."""
    start = np.append(episode.situation.hand, episode.commands[0, 3])
    return np.vstack([start, episode.commands])[::steps_per_row]


def commands_of_path(path: Floats, steps_per_row: int) -> Floats:
    """Interpolate a path at each step of the suite after the start; the gripper is held."""
    times = np.arange(1, (len(path) - 1) * steps_per_row + 1)
    rows = np.arange(len(path)) * steps_per_row
    hand = [np.interp(times, rows, column) for column in path[:, :3].T]
    return np.column_stack([*hand, path[times // steps_per_row, 3]])


def prepare_ours(demonstrations: Sequence[Episode], steps_per_row: int, seed: int) -> Reproduce:
    """Learn a skill with pilotfish and reproduce it, both at defaults."""
    period = STEP * steps_per_row
    layout = pf.demonstrations.Layout(
        (
            pf.demonstrations.Part("position", pf.demonstrations.Quantity.POSITION, 3, "m"),
            pf.demonstrations.Part("gripper", pf.demonstrations.Quantity.SCALAR, 1, "1"),
        )
    )
    recordings = [
        pf.demonstration(
            episode_path(episode, steps_per_row),
            period,
            layout,
            situation_frames(episode.situation, layout),
            f"seed {episode.situation.seed}",
        )
        for episode in demonstrations
    ]
    skill = learn_skill(recordings, seed)
    gripper = float(np.median([episode.commands[0, 3] for episode in demonstrations]))

    def reproduce(situation: Situation) -> Floats:
        start = np.concatenate([situation.hand, [gripper], np.zeros(4)])
        return reproduce_path(skill, situation_frames(situation, skill.layout), start)

    return reproduce


def learn_skill(recordings: Sequence[pf.Demonstration], seed: int) -> pf.Skill:
    """Learn from recordings without derivatives, at defaults."""
    demonstrations = [pf.add_derivatives(recording) for recording in recordings]
    return pf.learn(demonstrations, rng=np.random.default_rng(seed)).skill


def reproduce_path(skill: pf.Skill, frames: Sequence[pf.Frame], start: Floats) -> Floats:
    """Reproduce a skill at defaults."""
    return np.asarray(pf.reproduce(skill, frames, start).motion.x[:, :4])


def situation_frames(situation: Situation, layout: pf.demonstrations.Layout) -> list[pf.Frame]:
    """Return the frames of world, object and goal, which differ by translations."""
    origins = {"world": np.zeros(3), "object": situation.object, "goal": situation.goal}
    upright = np.array([1.0, 0.0, 0.0, 0.0])
    return [
        pf.demonstrations.frame_from_pose(name, layout, Pose(origin, upright))
        for name, origin in origins.items()
    ]


def prepare_nearest(demonstrations: Sequence[Episode], steps_per_row: int, seed: int) -> Reproduce:
    """Shift the demonstration of the nearest situation by offsets of start, object and goal."""

    def reproduce(situation: Situation) -> Floats:
        distances = [
            np.linalg.norm(episode.situation.positions - situation.positions) for episode in demonstrations
        ]
        nearest = demonstrations[int(np.argmin(distances))]
        return shift_path(episode_path(nearest, steps_per_row), nearest.situation, situation)

    return reproduce


def shift_path(path: Floats, old: Situation, new: Situation) -> Floats:
    """Shift the hand at the start, nearest to the object and at the end, as start, object and goal moved.

    Between these three rows the offset changes in proportion to the length of the path.
    """
    lengths = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(path[:, :3], axis=0), axis=1)))
    at_object = int(np.argmin(np.linalg.norm(path[:, :3] - old.object, axis=1)))
    offsets = np.stack([new.hand - old.hand, new.object - old.object, new.goal - old.goal])
    knots = lengths[[0, at_object, -1]]
    shift = np.column_stack([np.interp(lengths, knots, column) for column in offsets.T])
    return np.column_stack([path[:, :3] + shift, path[:, 3]])


def prepare_mean(demonstrations: Sequence[Episode], steps_per_row: int, seed: int) -> Reproduce:
    """Average the demonstrations over relative time, and add offsets of start and goal, linear in time."""
    path = average_path([episode_path(episode, steps_per_row) for episode in demonstrations])
    hand = np.mean([episode.situation.hand for episode in demonstrations], axis=0)
    goal = np.mean([episode.situation.goal for episode in demonstrations], axis=0)
    phase = np.linspace(0.0, 1.0, len(path))[:, None]

    def reproduce(situation: Situation) -> Floats:
        shift = (1.0 - phase) * (situation.hand - hand) + phase * (situation.goal - goal)
        return np.column_stack([path[:, :3] + shift, path[:, 3]])

    return reproduce


def average_path(paths: Sequence[Floats]) -> Floats:
    """Return the mean of the hand and the median of the gripper over relative time, of the mean length."""
    length = round(np.mean([len(path) for path in paths]))
    resampled = np.stack([resample(path, length) for path in paths])
    return np.column_stack([resampled[:, :, :3].mean(axis=0), np.median(resampled[:, :, 3], axis=0)])


def resample(path: Floats, length: int) -> Floats:
    """Return a path at another number of times: the hand linearly; the gripper is held."""
    times = np.linspace(0.0, len(path) - 1.0, length)
    hand = [np.interp(times, np.arange(len(path)), column) for column in path[:, :3].T]
    return np.column_stack([*hand, path[times.astype(int), 3]])


def prepare_promp(demonstrations: Sequence[Episode], steps_per_row: int, seed: int) -> Reproduce:
    """Condition a probabilistic movement primitive (ProMP) on the situation.

    The weights of the radial basis functions and the situation have a joint Gaussian distribution; the hand
    follows the mean of the weights given the situation. The gripper is that of the average, as it is no
    smooth function.

    Source:
        Paraschos et al. 2018, "Using probabilistic movement primitives in robotics", sections 2 and 3.4.
    """
    paths = [episode_path(episode, steps_per_row) for episode in demonstrations]
    average = average_path(paths)
    weights = np.stack([_promp_weights(path) for path in paths])
    contexts = np.stack([episode.situation.positions for episode in demonstrations])
    weight_mean, context_mean = weights.mean(axis=0), contexts.mean(axis=0)
    M = len(paths)
    context_covariance = np.cov(contexts.T) + CONTEXT_NOISE * np.eye(contexts.shape[1])
    cross_covariance = (weights - weight_mean).T @ (contexts - context_mean) / (M - 1)
    basis = basis_functions(len(average))

    def reproduce(situation: Situation) -> Floats:
        change = cross_covariance @ np.linalg.solve(context_covariance, situation.positions - context_mean)
        hand = basis @ (weight_mean + change).reshape(BASIS_FUNCTIONS, 3)
        return np.column_stack([hand, average[:, 3]])

    return reproduce


def _promp_weights(path: Floats) -> Floats:
    """Return the weights of a path by ridge regression, in one row."""
    basis = basis_functions(len(path))
    gram = basis.T @ basis + WEIGHT_PENALTY * np.eye(BASIS_FUNCTIONS)
    return np.asarray(np.linalg.solve(gram, basis.T @ path[:, :3]).ravel())


def basis_functions(length: int) -> Floats:
    """Return normalised radial basis functions over relative time, one row per step."""
    centres = np.linspace(0.0, 1.0, BASIS_FUNCTIONS)
    width = centres[1] - centres[0]
    values = np.exp(-0.5 * ((np.linspace(0.0, 1.0, length)[:, None] - centres) / width) ** 2)
    return np.asarray(values / values.sum(axis=1, keepdims=True))


METHODS: dict[str, tuple[str, Method]] = {
    "ours": ("pilotfish at defaults", prepare_ours),
    "nearest": ("nearest demonstration, shifted", prepare_nearest),
    "mean": ("mean of demonstrations, start and goal offsets", prepare_mean),
    "promp": ("ProMP given the situation", prepare_promp),
}
