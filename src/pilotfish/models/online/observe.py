"""Online learning by small-variance asymptotics: assign one datapoint, then update one cluster.

Idea. Let the emission covariances of a Bayesian nonparametric model shrink to zero, and scale its
concentration parameters with them. The posterior then has a deterministic minimiser: k-means with a penalty
on the number of clusters (DP-means, Kulis & Jordan 2012). With subspaces, transitions and durations this is
scalable online sequence clustering (SOSC, Tanwani 2018, chapter 5). Every datapoint is used once; none is
stored.

Scales. Where the settings have scales, x below is a datapoint divided by them, column by column, in each
frame. `to_skill` and `OnlineModel.means` convert back.

Assignment. Cluster k has mean mu and directions U (the first d of its basis) in each of P frames. Let
e = x - mu and rho = exp(-|e|^2 / b_m). Let i be the cluster of the last datapoint, n_ik the transition
counts, and n_i their sum over k:

    distance_k = sum over frames of |e|^2 - (2 rho - rho^2) |U^T e|^2                          (5.13)
    cost_k     = distance_k + lambda_2 log(n_i / n_ik)              if n_ik > 0                (5.26)
               = distance_k + lambda_2 log(n_i + 1) + lambda_3      otherwise                  (5.27)
    cost_new   = lambda + lambda_2 log(n_i + 1) + lambda_3                                     (5.28)

The datapoint goes to the cheapest. Where a demonstration begins, the terms of the transition are zero.

Update. With the weight w of the cluster, mu moves by e / (w + 1), and the covariance becomes
w / (w + 1) Sigma + w / (w + 1)^2 e e^T, a rank-one update of U and its variances. The dimension d minimises
lambda_1 d plus the mean squared distance to the first d directions, among the dimensions that do not increase
the loss at this datapoint. Then n_ik grows by one. If k differs from i, the completed segment of i updates
the mean and variance of its duration. Durations do not enter the assignment.

Invariants. The loss at a datapoint never increases by its update (5.35). `observe_stream` equals repeated
`observe` to the last bit if the batch is 1. The argument is not modified. With weights by count and as many
extra directions as columns, means and covariances are those of the assigned datapoints.

Keep in step: kernels/reference/streaming.py and kernels/cpp/streaming.cpp implement the equations;
`from_batch_fit` fills the same state; io/stream_file.py stores it.
"""

import numpy as np

from pilotfish import kernels
from pilotfish.demonstrations import Demonstration, views
from pilotfish.errors import InvalidInput
from pilotfish.models.online.model import OnlineModel, begin_demonstration, count_ends
from pilotfish.models.signs import nearest_quaternion_signs
from pilotfish.types import Array, Float
from pilotfish.validation import numeric_array, require_type

MODEL_HINT = "online.online_model makes one, and online.observe returns the next"


def observe(model: OnlineModel, x: Float[Array, "..."]) -> tuple[OnlineModel, int, float, float]:
    """Update a model with one datapoint.

    A step costs O(K P D d + d^3), and copies the O(K P D d) numbers of the model; `observe_stream` copies
    them once for many datapoints.

    Args:
        model: Model before the datapoint; it is not modified.
        x: Datapoint (D,), or (P, D) with one row per frame.

    Returns:
        The model after the datapoint, the identifier of its cluster, the cost of the assignment, and the
        change of the loss at the datapoint by the update, at most 0 up to rounding.

    Raises:
        InvalidInput: If x has another width, or a value that is not finite or beyond 1e100.
    """
    require_type(model, "model", OnlineModel, MODEL_HINT)
    point, state = _as_float_array(x), model.state
    if point.shape != (state.frames, state.width):
        point = _add_frame_axis(point, model)
    scaled = point if model.scales is None else point / model.scales
    try:
        after, cluster_id, cost, loss_change = kernels.observe_one(scaled, state, model.parameters)
    except InvalidInput as error:
        raise _datapoint_error(point[None], scaled[None], model) from error
    return _replace_state(model, after), cluster_id, cost, loss_change


def observe_stream(model: OnlineModel, x: Float[Array, "N *rest"]) -> tuple[OnlineModel, kernels.Assignments]:
    """Update a model with N datapoints in order.

    The result equals that of `observe` for one after the other, to the last bit, if `Maintenance.batch` is 1.
    Otherwise batches start again with every call.

    Args:
        model: Model before the datapoints; it is not modified.
        x: Datapoints (N, D), or (N, P, D) with one row per frame.

    Returns:
        The model after all datapoints, and their assignments.

    Raises:
        InvalidInput: If x has another width, or a value that is not finite or beyond 1e100.
    """
    require_type(model, "model", OnlineModel, MODEL_HINT)
    P, D = len(model.frame_names), model.layout.width
    points = _as_float_array(x)
    if points.shape[1:] != (P, D) and not (P == 1 and points.shape[1:] == (D,)):
        raise InvalidInput(
            f"the datapoints have shape {points.shape}, expected (N, ...), each {_expected_shape(model)}"
        )
    points = points.reshape(len(points), P, D)
    scaled = points if model.scales is None else points / model.scales
    try:
        state, assignments = kernels.observe(scaled, model.state, model.parameters)
    except InvalidInput as error:
        raise _datapoint_error(points, scaled, model) from error
    return _replace_state(model, state), assignments


def observe_demonstration(
    model: OnlineModel, demonstration: Demonstration
) -> tuple[OnlineModel, kernels.Assignments]:
    """Update a model with one demonstration, in the frames of the demonstration.

    q and -q are the same orientation: a quaternion changes its sign, with its derivatives, if it is then
    closer to the means of the clusters. The first and the last datapoint also count as start and end of the
    demonstrations, which a skill with scales has beside its states.

    Args:
        model: Model before the demonstration; it is not modified.
        demonstration: Recording with the layout, period and frame names of the model.

    Returns:
        The model after the demonstration, and the assignments of its datapoints.

    Raises:
        InvalidInput: If the demonstration differs from the model in layout, period or frame names.
    """
    require_type(model, "model", OnlineModel, MODEL_HINT)
    require_type(demonstration, "demonstration", Demonstration, "pf.demonstration makes one of an array")
    for what, given, expected in (
        ("layout", demonstration.layout, model.layout),
        ("period [s]", demonstration.period, model.period),
        ("frames", tuple(f.name for f in demonstration.frames), model.frame_names),
    ):
        if given != expected:
            raise InvalidInput(
                f"demonstration {demonstration.name!r} differs from the model in {what}: "
                f"{_display_value(given)}, expected {_display_value(expected)}"
            )
    x = views([demonstration]).x
    for p, view in enumerate(x):
        view *= nearest_quaternion_signs(view, model.means[:, p], model.layout)
    after, assignments = observe_stream(begin_demonstration(model), x.transpose(1, 0, 2))
    return count_ends(after, x), assignments


def _replace_state(model: OnlineModel, state: kernels.StreamState) -> OnlineModel:
    # dataclasses.replace takes half the time of a step
    return OnlineModel(
        model.settings,
        model.layout,
        model.period,
        model.frame_names,
        model.parameters,
        state,
        model.scales,
        model.ends,
    )


def _add_frame_axis(x: Float[Array, "..."], model: OnlineModel) -> Float[Array, "1 D"]:
    if model.state.frames != 1 or x.shape != (model.state.width,):
        raise InvalidInput(f"the datapoint has shape {x.shape}, expected {_expected_shape(model)}")
    return x.reshape(1, -1)


def _as_float_array(x: object) -> Float[Array, "..."]:
    if type(x) is np.ndarray and x.dtype == np.float64:  # the usual case, without the cost of the checks
        return np.ascontiguousarray(x)
    return numeric_array(x, "the datapoint")


def _expected_shape(model: OnlineModel) -> str:
    P, D = len(model.frame_names), model.layout.width
    columns = ", ".join(model.layout.names) if D <= 16 else f"{D} columns"
    return f"({D},): {columns}" if P == 1 else f"({P}, {D}): {columns}, one row per frame"


def _datapoint_error(
    points: Float[Array, "N P D"], scaled: Float[Array, "N P D"], model: OnlineModel
) -> InvalidInput:
    n, p, d = np.argwhere(~(np.abs(scaled) <= kernels.MAX_VALUE))[0].tolist()
    scale = "" if model.scales is None else f" times its scale {model.scales[p, d]:g}"
    return InvalidInput(
        f"datapoint {n} (first is 0), column {model.layout.names[d]!r} in frame {model.frame_names[p]!r}, is "
        f"{points[n, p, d]}, expected a number of at most {kernels.MAX_VALUE:g}{scale}; leave it out: the "
        "model has not changed"
    )


def _display_value(value: object) -> object:
    return ", ".join(value.names) if hasattr(value, "names") else value
