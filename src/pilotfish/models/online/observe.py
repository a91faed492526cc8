"""(model, datapoint) -> (model, where it went): for one, for many, for a demonstration and its frames."""

from dataclasses import replace

import numpy as np

from pilotfish import kernels
from pilotfish.demonstrations import Demonstration, Layout, views
from pilotfish.errors import InvalidInput
from pilotfish.models.online.assignments import Assignment, Assignments
from pilotfish.models.online.model import Head, OnlineModel
from pilotfish.models.signs import sign_combinations
from pilotfish.types import Array, Float
from pilotfish.validation import numeric_array, require_type

MAX_VALUE = kernels.MAX_VALUE
MODEL_HINT = "online.online_model makes one, and online.observe gives the next"


def observe(model: OnlineModel, x: Float[Array, "..."]) -> tuple[OnlineModel, Assignment]:
    """The model after one datapoint (D,), or (P, D) as each of P frames sees it; and where it went.

    The model given is as it was. A step costs O(K P D d + d^3), and copies the model's O(K P D d) numbers;
    observe_stream copies them once for many datapoints.
    Raises: InvalidInput, when x is not finite, beyond 1e100 or of another width.
    """
    require_type(model, "model", OnlineModel, MODEL_HINT)
    point, state = _as_float_array(x), model.state
    if point.shape != (state.frames, state.width):
        point = _add_frame_axis(point, model)
    try:
        after, cluster_id, cost, loss_change = kernels.observe_one(point, state, model.parameters)
    except InvalidInput as error:
        raise _non_finite_error(point[None], model) from error
    return _replace_state(model, after), Assignment(cluster_id, cost, loss_change)


def observe_stream(model: OnlineModel, x: Float[Array, "N *rest"]) -> tuple[OnlineModel, Assignments]:
    """The model after N datapoints (N, D), or (N, P, D) as each of P frames sees them; and where they went.

    The same as one after the other, to the last bit, where Upkeep.batch is 1; otherwise batches begin anew
    with every call. The model given is as it was, and no datapoint is learned when one is refused.
    Raises: InvalidInput, when a datapoint is not finite, beyond 1e100 or of another width.
    """
    require_type(model, "model", OnlineModel, MODEL_HINT)
    P, D = len(model.frame_names), model.layout.width
    points = _as_float_array(x)
    if points.shape[1:] != (P, D) and not (P == 1 and points.shape[1:] == (D,)):
        raise InvalidInput(
            f"the datapoints have shape {points.shape}, expected (N, ...), each {_expected_shape(model)}"
        )
    points = points.reshape(len(points), P, D)
    try:
        step = kernels.observe(points, model.state, model.parameters)
    except InvalidInput as error:
        raise _non_finite_error(points, model) from error
    went = Assignments(step.cluster_ids, step.costs, step.loss_changes, step.removed)
    return _replace_state(model, step.state), went


def observe_demonstration(
    model: OnlineModel, demonstration: Demonstration
) -> tuple[OnlineModel, Assignments]:
    """The model after one more demonstration, as its frames see it; and where its datapoints went.

    Quaternions that run closer to what the model knows after a change of sign have it changed, their
    derivatives with them: q and -q are one orientation.
    Raises: InvalidInput, when it differs from the model in layout, period or names of frames.
    """
    require_type(model, "model", OnlineModel, MODEL_HINT)
    require_type(demonstration, "demonstration", Demonstration, "pf.demonstration makes one of an array")
    for what, given, known in (
        ("layout", demonstration.layout, model.layout),
        ("period [s]", demonstration.period, model.period),
        ("frames", tuple(f.name for f in demonstration.frames), model.frame_names),
    ):
        if given != known:
            raise InvalidInput(
                f"demonstration {demonstration.name!r} differs from the model in {what}: {_display_value(given)}, "
                f"expected {_display_value(known)}"
            )
    seen = views([demonstration]).x
    for p, x in enumerate(seen):
        x *= _choose_quaternion_signs(x, model.means[:, p], model.layout)
    return observe_stream(begin_demonstration(model), seen.transpose(1, 0, 2))


def begin_demonstration(model: OnlineModel) -> OnlineModel:
    """The same model, whose next datapoint begins a demonstration: no transition leads to it.

    The visit that the last datapoint was in is cut off here, and does not count as a complete one.
    """
    state = model.state
    k, steps = int(state.head[Head.CURRENT]), state.head[Head.STEPS]
    if k < 0:
        return model
    head, clusters = state.head.copy(), state.clusters.copy()
    head[Head.CURRENT], head[Head.STEPS] = -1.0, 0.0
    head[Head.PREVIOUS], head[Head.PREVIOUS_STEPS] = -1.0, 0.0
    row, C = clusters[k], kernels.ClusterColumn
    row[C.CENSORED] += 1.0
    row[C.MEAN_CENSORED_DURATION] += (steps - row[C.MEAN_CENSORED_DURATION]) / row[C.CENSORED]
    return _replace_state(model, replace(state, head=head, clusters=clusters))


def _choose_quaternion_signs(
    x: Float[Array, "T D"], means: Float[Array, "K D"], layout: Layout
) -> Float[Array, " D"]:
    """Those of orientations under which the datapoints lie closest to the means, squared and added."""
    if not layout.quaternions or not len(means):
        return np.ones(layout.width)

    def distance(signs: Float[Array, " D"]) -> float:
        squares = [np.sum((signs * x - mean) ** 2, axis=1) for mean in means]
        return float(np.min(squares, axis=0).sum())

    return min(sign_combinations(layout), key=distance)


def _replace_state(model: OnlineModel, state: kernels.StreamState) -> OnlineModel:
    """The model with another state; dataclasses.replace would take half the time of a step."""
    return OnlineModel(model.settings, model.layout, model.period, model.frame_names, model.parameters, state)


def _add_frame_axis(x: Float[Array, "..."], model: OnlineModel) -> Float[Array, "1 D"]:
    if model.state.frames != 1 or x.shape != (model.state.width,):
        raise InvalidInput(f"the datapoint has shape {x.shape}, expected {_expected_shape(model)}")
    return x.reshape(1, -1)


def _as_float_array(x: object) -> Float[Array, "..."]:
    if type(x) is np.ndarray and x.dtype == np.float64:  # a stream is one datapoint after another
        return np.ascontiguousarray(x)
    return numeric_array(x, "the datapoint")


def _expected_shape(model: OnlineModel) -> str:
    P, D = len(model.frame_names), model.layout.width
    columns = ", ".join(model.layout.names) if D <= 16 else f"{D} columns"
    return f"({D},): {columns}" if P == 1 else f"({P}, {D}): {columns}, as each frame sees them"


def _non_finite_error(points: Float[Array, "N P D"], model: OnlineModel) -> InvalidInput:
    n, p, d = np.argwhere(~(np.abs(points) <= MAX_VALUE))[0].tolist()
    return InvalidInput(
        f"datapoint {n} (first is 0), column {model.layout.names[d]!r} as frame {model.frame_names[p]!r} "
        f"sees it, is {points[n, p, d]}, expected a number of at most {MAX_VALUE:g}; leave it out: the "
        "model is as it was"
    )


def _display_value(value: object) -> object:
    return ", ".join(value.names) if hasattr(value, "names") else value
