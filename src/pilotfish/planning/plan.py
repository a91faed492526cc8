"""From an adapted skill to a step-wise reference: a target and a weight at every step.

A plan has two parts. First the state sequence is chosen: the most probable one given the start and all
via-points that ends with the movement, in a final state. Without via-points its states have their most
probable durations given the number of steps (`timing.py`). Then the targets are the means of those states,
and the weights are the inverses of their covariances:

    target_t = mean of state_t,    Q_t = (Sigma of state_t + r I)^-1,    r the covariance regularisation.

The last step has the end of the demonstrations in place of a state, with the weight of a whole state: that of
one step times the mean number of steps of a state, so that it does not depend on the period.

The published plan (`stepwise`) takes the most probable state of every step by itself (3.42), need not reach
the end of the movement, and has no end point.

Tracking these targets (`pilotfish.control.track`) minimises the sum of (x_t - target_t)' Q_t (x_t - target_t)
and u_t' R u_t, so that precise states are followed closely and variable ones loosely.
"""

from collections.abc import Sequence

import numpy as np

from pilotfish.control import Reference
from pilotfish.errors import InvalidInput
from pilotfish.gaussians import Gaussian, cholesky, log_density
from pilotfish.models import (
    AdaptedSkill,
    align_quaternion_signs,
)
from pilotfish.planning.conditioning import condition_on
from pilotfish.planning.costs import default_covariance_regularisation
from pilotfish.planning.timing import share_time
from pilotfish.planning.via_points import ViaPoint, ViaPointObservation, observe_via_points
from pilotfish.types import Array, Float, Int
from pilotfish.validation import MAX_MAGNITUDE, numeric_array, require_count, require_type, short_repr

MAX_HORIZON = 10**6  # steps
MAX_WEIGHTS = 2**26  # entries of the weights of all steps: 512 MiB


def plan(
    adapted: AdaptedSkill,
    start: Float[Array, " D"] | None = None,
    *,
    horizon: int,
    via_points: Sequence[ViaPoint] = (),
    covariance_regularisation: float | None = None,
    complete: bool = True,
    stepwise: bool = False,
) -> Reference:
    """Plan the targets and weights of a motion of an adapted skill.

    The start is the first observation: of the states in which the skill may begin, the one that explains it
    is first. Via-points choose the states too, before and after their times, and the reference is then
    conditioned on them (`condition_on`). Targets have the sign of the start's quaternions.

    A horizon other than the duration of the demonstrations makes the movement slower or faster.

    Args:
        adapted: Skill adapted to the frames, from `adapt`.
        start: Current state of the robot; None if it is unknown, so that the skill's own beginning is used.
        horizon: Number of steps.
        via_points: Points that the motion passes, from `via_point`.
        covariance_regularisation: Variance added to every variance before it is inverted [unit of x squared],
            so that no direction has a weight above its inverse. None takes (s / 1000)^2 for a column of scale
            s.
        complete: Whether the plan ends with the movement; False plans the first steps of it.
        stepwise: Whether to choose the state of each step by itself, as published, without an end point.

    Returns:
        One target and one weight per step.

    Raises:
        InvalidInput: If an argument cannot be used, or if the skill has orientations on S^3; use `reproduce`,
            or plan on a `tangent_chart`.

    Source:
        Tanwani 2018, equations 3.41-3.43, with Q_t = (Sigma + r I)^-1, and the most probable sequence in
        place of the most probable states.
    """
    _require_no_orientations(adapted)
    aligned, states = plan_states(
        adapted, start, horizon=horizon, via_points=via_points, complete=complete, stepwise=stepwise
    )
    end_point = complete and not stepwise
    reference = reference_from_states(aligned, states, covariance_regularisation, end_point=end_point)
    return condition_on(reference, via_points, adapted.layout) if len(via_points) else reference


def plan_states(
    adapted: AdaptedSkill,
    start: Float[Array, " D"] | None = None,
    *,
    horizon: int,
    via_points: Sequence[ViaPoint] = (),
    complete: bool = True,
    stepwise: bool = False,
) -> tuple[AdaptedSkill, Int[Array, " T"]]:
    """Choose the state of every step of a plan.

    Args:
        adapted: Skill adapted to the frames.
        start: Current state of the robot, or None.
        horizon: Number of steps.
        via_points: Points that the motion passes.
        complete: Whether the sequence ends in a final state, where the skill has one.
        stepwise: Whether to choose the most probable state of each step by itself (3.42).

    Returns:
        The skill with its quaternions on the start's half of S^3, and one state per step.

    Raises:
        InvalidInput: If an argument cannot be used.
    """
    require_type(adapted, "adapted", AdaptedSkill, "pf.adapt(skill, frames) makes one of a skill")
    require_count(horizon, "horizon", MAX_HORIZON, minimum=1)
    require_type(via_points, "via_points", Sequence, "pass a list: [pf.via_point(...)]")
    if start is None:
        aligned, log_start = adapted, np.empty((0, adapted.states))
    else:
        start = require_start(start, adapted)
        aligned = align_quaternion_signs(start, adapted)
        log_start = aligned.log_state_likelihoods(start[None])
    dynamics = aligned.dynamics
    if stepwise:
        states = dynamics.most_probable_states(log_start, horizon)
    else:
        states = dynamics.plan_states(log_start, horizon, complete=complete)
    if not len(via_points):
        reaches_end = complete and dynamics.final_states()[states[-1]]
        if reaches_end and not stepwise and dynamics.durations is not None:
            states = share_time(states, dynamics.durations)
        return aligned, states
    log_observed = np.zeros((horizon, aligned.states))
    log_observed[: len(log_start)] = log_start
    for observation in observe_via_points(via_points, aligned.layout, aligned.means[states], aligned.period):
        log_observed[observation.step] += _observation_log_likelihoods(aligned, observation)
    if stepwise:
        return aligned, dynamics.smoothed_state_probs(log_observed).argmax(axis=1)
    return aligned, dynamics.plan_states(log_observed, horizon, complete=complete)


def reference_from_states(
    adapted: AdaptedSkill,
    states: Int[Array, " T"],
    covariance_regularisation: float | None = None,
    *,
    end_point: bool = False,
) -> Reference:
    """Return the means and weights of a state sequence.

    Args:
        adapted: Skill adapted to the frames, without orientations on S^3.
        states: State of each step.
        covariance_regularisation: Variance added to every variance before it is inverted [unit of x squared];
            None takes (s / 1000)^2 for a column of scale s.
        end_point: Whether the last step has the end of the demonstrations in place of a state.

    Returns:
        One target and one weight (covariance + regularisation)^-1 per step.

    Raises:
        InvalidInput: If an argument cannot be used.
        NotPositiveDefinite: If a regularised covariance has no Cholesky factor.
    """
    _require_no_orientations(adapted)
    _require_states(states, adapted)
    added = _regularisation(covariance_regularisation, adapted)
    targets, weights = adapted.means[states], _weights(adapted.covariances, added)[states]
    if end_point and adapted.endpoints is not None:
        steps_of_a_state = len(states) / len(np.unique(states))
        end = adapted.endpoints
        targets[-1], weights[-1] = end.means[1], steps_of_a_state * _weights(end.covariances, added)[1]
    return Reference(targets, weights, adapted.period)


def _weights(covariances: Float[Array, "K D D"], added: Float[Array, " D"]) -> Float[Array, "K D D"]:
    """Return the inverses of regularised covariances."""
    identity = np.eye(len(added))
    regularised = covariances + added * identity
    cholesky(regularised, "the regularised covariance of state")
    inverse = np.linalg.solve(regularised, np.broadcast_to(identity, regularised.shape))
    return np.asarray(0.5 * (inverse + inverse.transpose(0, 2, 1)))


def _require_no_orientations(adapted: AdaptedSkill) -> None:
    """Check that a linear system can track an adapted skill."""
    require_type(adapted, "adapted", AdaptedSkill, "pf.adapt(skill, frames) makes one of a skill")
    if adapted.layout.orientation_starts:
        raise InvalidInput(
            "the skill has orientations on S^3, which a linear system cannot track; call pf.reproduce, or "
            "plan in a tangent space: chart = planning.tangent_chart(adapted), then pf.plan(chart.skill, "
            "chart.to_tangent(start), ...), and chart.to_manifold(motion.x) are the poses"
        )


def require_start(start: Float[Array, " D"], adapted: AdaptedSkill) -> Float[Array, " D"]:
    """Return start as an array if it is a finite state of the skill."""
    require_type(start, "start", np.ndarray, "pass np.array(start)")
    start = numeric_array(start, "start")
    if start.shape != (width := adapted.means.shape[1],):
        names = ", ".join(adapted.layout.names)
        raise InvalidInput(f"start has shape {start.shape}, expected ({width},): {names}")
    if not np.isfinite(start).all():
        raise InvalidInput(f"start has values that are not finite: {start.tolist()}")
    return start


def _regularisation(variance: float | None, adapted: AdaptedSkill) -> Float[Array, " D"]:
    """Return the variance added to each column."""
    if variance is None:
        return default_covariance_regularisation(adapted)
    require_type(variance, "covariance_regularisation", (float, int), "pass a variance")
    if not 0.0 <= variance <= MAX_MAGNITUDE:
        raise InvalidInput(
            f"covariance_regularisation is {variance}, expected a finite variance of at least 0"
        )
    return np.full(adapted.means.shape[1], float(variance))


def _require_states(states: Int[Array, " T"], adapted: AdaptedSkill) -> None:
    require_type(states, "states", np.ndarray, "pass np.array(states)")
    if states.dtype.kind not in "iu" or states.ndim != 1:
        raise InvalidInput(f"states is {short_repr(states)}, expected an array of integers, one per step")
    if not (states.size and 0 <= states.min() <= states.max() < adapted.states):
        raise InvalidInput(f"states is {short_repr(states)}, expected numbers from 0 to {adapted.states - 1}")
    if (numbers := states.size * adapted.means.shape[1] ** 2) > MAX_WEIGHTS:
        raise InvalidInput(
            f"the weights of {states.size} steps have {numbers} entries, expected at most {MAX_WEIGHTS}; "
            "plan fewer steps at a time"
        )


def _observation_log_likelihoods(
    adapted: AdaptedSkill, observation: ViaPointObservation
) -> Float[Array, " K"]:
    """Return log p(observed columns | state) of each state."""
    columns, noise = observation.columns, np.diag(observation.deviations**2)
    return np.array(
        [
            log_density(
                Gaussian(mean[columns], S[np.ix_(columns, columns)] + noise), observation.values[None]
            )[0]
            for mean, S in zip(adapted.means, adapted.covariances, strict=True)
        ]
    )
