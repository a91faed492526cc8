"""Autonomous control: continue the skill from the filtered state, and plan again when objects move.

The filter gives the state k and the steps d already spent in it. The printed start (6.10) weighs the states
by their initial probabilities, which send a left-right skill back to its first state. Here the chain is
conditioned on d steps in state k:

    initial := one in state k,    steps 1 .. d observed in state k,    later steps not observed.

The most probable sequence that ends in a final state is then that of `plan_states`, from step d on; durations
count the time already spent. Its length is the mean time that remains: what is left of state k, and the means
of the states that most probably follow.

The states of the plan stay when objects move. Targets and weights are taken from the skill adapted to the new
frames, and tracking (LQT) starts again from the row that the plan has reached, with the velocity planned
there. It does not start from the target: that differs from the plan by what remains of a transition, which
would be added twice. In a scene that does not change, the plan is therefore the same again.

Tracking. A double integrator follows the means with the weights (Sigma + r I)^-1; velocities have no weight.
The control cost is 0.01 (s / s'^2)^2 for a coordinate of scale s and speed s', as in `planning/costs.py`,
with the speed between the means of successive states.
"""

from dataclasses import dataclass, replace

import numpy as np

from pilotfish.control import Reference, double_integrator, track
from pilotfish.demonstrations import Frame
from pilotfish.geometry import exp_map, log_map
from pilotfish.models import AdaptedSkill, Dynamics, MarkovChain, MixtureWeights, SemiMarkovChain, part_scales
from pilotfish.planning import TangentChart, default_covariance_regularisation, tangent_chart
from pilotfish.types import Array, Float, Int
from pilotfish.validation import shorten_repr

IMPOSSIBLE = -1e6  # log-density of states that were not occupied
MAX_STEPS = 5000  # of a plan
MAX_MEAN = 1000.0  # steps of a state that is never left
RELATIVE_CONTROL_COST = 0.01
DEVIATIONS = 2.0  # standard deviations after which a segment has nearly ended
SHORT = 1e-4  # s, over which rates of the chart are differences
MIN_SPEED = 1e-3  # of the scale of a part, per period
REST = 1.0  # s that a plan made again has at least, so that it comes to rest at its end


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class AutonomousPlan:
    """Motion planned for the rest of a skill.

    Attributes:
        states: State at each period, from now on.
        poses: Pose and scalars at each period.
        velocities: Velocity at each period, of rotations in body axes.
        frames: Frames that it was planned for.
        period: Time between two rows [s].
        elapsed: Time since the first row [s].
        rest: Number of rows after the end of the movement, at which the plan stays.
    """

    states: Int[Array, " T"]
    poses: Float[Array, "T D"]
    velocities: Float[Array, "T E"]
    frames: tuple[Frame, ...]
    period: float
    elapsed: float
    rest: int = 0

    @property
    def is_moving(self) -> bool:
        """Whether the movement has not come to its end."""
        return self.row < len(self.states) - 1 - self.rest

    @property
    def row(self) -> int:
        """Row that the plan has reached."""
        return min(int(self.elapsed / self.period + 1e-9), len(self.states) - 1)

    @property
    def phase(self) -> float:
        """Time since that row [s]."""
        return max(0.0, self.elapsed - self.row * self.period)

    def pose(self, orientation_starts: tuple[int, ...]) -> Float[Array, " D"]:
        """Return the pose now, between two rows.

        Args:
            orientation_starts: First column of each quaternion.
        """
        row = self.row
        if row == len(self.poses) - 1:
            return np.asarray(self.poses[row])
        fraction = self.elapsed / self.period - row
        step = log_map(self.poses[row], self.poses[row + 1], orientation_starts)
        return np.asarray(exp_map(self.poses[row], fraction * step, orientation_starts))


def occupied_state(belief: Float[Array, "L K"]) -> tuple[int, int]:
    """Return the most probable state and the mean number of steps already spent in it.

    Args:
        belief: Probability of each age and state.
    """
    k = int(belief.sum(axis=0).argmax())
    ages = np.arange(1, len(belief) + 1)
    return k, max(1, round(float(ages @ belief[:, k] / belief[:, k].sum())))


def remaining_states(dynamics: Dynamics, state: int, age: int) -> Int[Array, " T"]:
    """Return the most probable states from now to the end of the movement.

    Args:
        dynamics: Markov or semi-Markov dynamics of the skill.
        state: State now.
        age: Number of steps already spent in it, this one included.

    Raises:
        InvalidInput: If the dynamics are a mixture, which has no order in time.
    """
    means, deviations = _duration_moments(dynamics)
    observed = max(1, min(age, round(means[state] + DEVIATIONS * deviations[state])))
    remaining = max(0.0, means[state] - observed)
    for k in _following_states(dynamics, state):
        remaining += means[k]
    horizon = min(observed + round(remaining), MAX_STEPS + observed)
    initial = np.eye(len(means))[state]
    log_observed = np.full((observed, len(means)), IMPOSSIBLE)
    log_observed[:, state] = 0.0
    started = _with_initial(dynamics, initial)
    return started.plan_states(log_observed, horizon, complete=True)[observed - 1 :]


def plan_motion(
    adapted: AdaptedSkill,
    states: Int[Array, " T"],
    start: Float[Array, " D"],
    velocity: Float[Array, " E"],
    frames: tuple[Frame, ...],
    rest: int = 0,
) -> AutonomousPlan:
    """Plan the motion through a state sequence, from a pose and velocity.

    Args:
        adapted: Skill of coordinates adapted to the actual frames.
        states: State at each period.
        start: Pose and scalars now.
        velocity: Velocity and angular velocity in body axes.
        frames: The actual frames, to notice a change.
        rest: Number of rows to stay at the end.
    """
    chart = tangent_chart(adapted) if adapted.layout.orientations else None
    tangent = chart.skill if chart else adapted
    E, period = tangent.means.shape[1], adapted.period
    states = states if len(states) > 1 else np.repeat(states, 2)
    targets, weights = _reference(tangent, states)
    states = np.concatenate([states, np.repeat(states[-1:], rest)])
    targets = np.concatenate([targets, np.repeat(targets[-1:], rest, axis=0)])
    weights = np.concatenate([weights, np.repeat(weights[-1:], rest, axis=0)])
    zeros = np.zeros_like(targets)
    full_weights = np.zeros((len(states), 2 * E, 2 * E))
    full_weights[:, :E, :E] = weights
    reference = Reference(np.hstack([targets, zeros]), full_weights, period)
    motion = track(double_integrator(E, period), reference, _control_cost(tangent)).rollout(
        _tangent_start(chart, start, velocity, adapted)
    )
    poses, velocities = _planned_motion(chart, motion.x[:, :E], motion.x[:, E:], adapted)
    return AutonomousPlan(states, poses, velocities, frames, period, 0.0, rest)


def plan_again(adapted: AdaptedSkill, plan: AutonomousPlan, frames: tuple[Frame, ...]) -> AutonomousPlan:
    """Return the plan for other frames from the row that it has reached.

    It has a second at least: from a pose that still moves, a plan of one or two rows would overshoot.

    Args:
        adapted: Skill of coordinates adapted to the actual frames.
        plan: Plan so far.
        frames: The actual frames.
    """
    row, end = plan.row, len(plan.states) - plan.rest
    states = plan.states[min(row, end - 1) : end]
    rest = max(0, int(np.ceil(min(REST / plan.period, MAX_STEPS))) - len(states))
    again = plan_motion(adapted, states, plan.poses[row], plan.velocities[row], frames, rest)
    return replace(again, elapsed=plan.phase)


def _reference(
    tangent: AdaptedSkill, states: Int[Array, " T"]
) -> tuple[Float[Array, "T E"], Float[Array, "T E E"]]:
    """Return means and weights; the last step has the end of the demonstrations."""
    added = np.diag(default_covariance_regularisation(tangent))
    targets = tangent.means[states]
    weights = np.linalg.inv(tangent.covariances + added)[states]
    if tangent.endpoints is not None:
        end, steps = tangent.endpoints, len(states) / len(np.unique(states))
        targets[-1] = end.means[1]
        weights[-1] = steps * np.linalg.inv(end.covariances[1] + added)
    return targets, 0.5 * (weights + weights.swapaxes(1, 2))


def _control_cost(tangent: AdaptedSkill) -> Float[Array, "E E"]:
    """Return the cost of squared accelerations from the scales of the states."""
    layout = tangent.layout
    means, _ = _duration_moments(tangent.dynamics)
    scales = part_scales(tangent.means, np.ones(tangent.states), layout, 10.0 * tangent.period)
    speeds = np.zeros_like(scales)
    steps = np.diff(tangent.means, axis=0) / (tangent.period * 0.5 * (means[1:] + means[:-1]))[:, None]
    for columns in layout.slices:
        rate = float(np.sqrt(np.mean(np.sum(steps[:, columns] ** 2, axis=1)))) if len(steps) else 0.0
        speeds[columns] = np.maximum(rate, MIN_SPEED * scales[columns] / tangent.period)
    return np.diag(RELATIVE_CONTROL_COST * (scales / speeds**2) ** 2)


def _tangent_start(
    chart: TangentChart | None, start: Float[Array, " D"], velocity: Float[Array, " E"], adapted: AdaptedSkill
) -> Float[Array, " F"]:
    """Return the start of the double integrator: coordinates and their rates."""
    if chart is None:
        return np.concatenate([start, velocity])
    later = exp_map(start, SHORT * velocity, adapted.layout.orientation_starts)
    y = chart.to_tangent(np.stack([start, later]))
    return np.concatenate([y[0], (y[1] - y[0]) / SHORT])


def _planned_motion(
    chart: TangentChart | None, y: Float[Array, "T E"], rates: Float[Array, "T E"], adapted: AdaptedSkill
) -> tuple[Float[Array, "T D"], Float[Array, "T E"]]:
    """Return poses and velocities of coordinates and their rates."""
    if chart is None:
        return y, rates
    poses, later = np.asarray(chart.to_manifold(y)), np.asarray(chart.to_manifold(y + SHORT * rates))
    return poses, log_map(poses, later, adapted.layout.orientation_starts) / SHORT


def _duration_moments(dynamics: Dynamics) -> tuple[Float[Array, " K"], Float[Array, " K"]]:
    """Return the mean and standard deviation of the duration of each state [steps]."""
    if isinstance(dynamics, SemiMarkovChain):
        durations = dynamics.durations
        return np.clip(durations.means, 1.0, MAX_MEAN), np.minimum(durations.deviations, MAX_MEAN)
    leaving = 1.0 - np.diagonal(dynamics.step_probabilities()[1])
    means = np.where(leaving > 1.0 / MAX_MEAN, 1.0 / np.maximum(leaving, 1.0 / MAX_MEAN), 10.0)
    return means, means


def _following_states(dynamics: Dynamics, state: int) -> list[int]:
    """Return the states that most probably follow, until a final state or one visited before."""
    visited, path = {state}, []
    transitions = dynamics.transitions * (1.0 - np.eye(len(dynamics.transitions)))
    while transitions[state].any() and (state := int(transitions[state].argmax())) not in visited:
        visited.add(state)
        path.append(state)
    return path


def _with_initial(dynamics: Dynamics, initial: Float[Array, " K"]) -> Dynamics:
    if isinstance(dynamics, MixtureWeights):
        return dynamics
    assert isinstance(dynamics, MarkovChain | SemiMarkovChain)
    return replace(dynamics, initial=initial)
