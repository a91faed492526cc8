"""(model, datapoint) -> (model, where it went): for one, for many, for a demonstration and its frames."""

from dataclasses import replace

import numpy as np

from pilotfish import kernels
from pilotfish.demonstrations import Demonstration, Layout, views
from pilotfish.errors import InvalidInput, require_kind
from pilotfish.models.online.assignments import Assignment, Assignments
from pilotfish.models.online.model import Head, OnlineModel
from pilotfish.models.signs import sign_choices
from pilotfish.types import Array, Float
from pilotfish.validation import numeric_array

LARGEST = kernels.LARGEST
MODELS = "online.online_model makes one, and online.observe gives the next"


def observe(model: OnlineModel, x: Float[Array, "..."]) -> tuple[OnlineModel, Assignment]:
    """The model after one datapoint (D,), or (P, D) as each of P frames sees it; and where it went.

    The model given is as it was. A step costs O(K P D d + d^3), and copies the model's O(K P D d) numbers;
    observe_stream copies them once for many datapoints.
    Raises: InvalidInput, when x is not finite, beyond 1e100 or of another width.
    """
    require_kind("model", model, OnlineModel, MODELS)
    point, state = _numbers(x), model.state
    if point.shape != (state.frames, state.width):
        point = _one_frame(point, model)
    try:
        after, identity, cost, change = kernels.observe_one(point, state, model.rules)
    except InvalidInput as error:
        raise _not_finite(point[None], model) from error
    return _with_state(model, after), Assignment(identity, cost, change)


def observe_stream(model: OnlineModel, x: Float[Array, "N *rest"]) -> tuple[OnlineModel, Assignments]:
    """The model after N datapoints (N, D), or (N, P, D) as each of P frames sees them; and where they went.

    The same as one after the other, to the last bit, where Upkeep.batch is 1; otherwise batches begin anew
    with every call. The model given is as it was, and no datapoint is learned when one is refused.
    Raises: InvalidInput, when a datapoint is not finite, beyond 1e100 or of another width.
    """
    require_kind("model", model, OnlineModel, MODELS)
    P, D = len(model.frame_names), model.layout.width
    points = _numbers(x)
    if points.shape[1:] != (P, D) and not (P == 1 and points.shape[1:] == (D,)):
        raise InvalidInput(
            f"the datapoints have shape {points.shape}, expected (N, ...), each {_expected(model)}"
        )
    points = points.reshape(len(points), P, D)
    try:
        step = kernels.observe(points, model.state, model.rules)
    except InvalidInput as error:
        raise _not_finite(points, model) from error
    went = Assignments(step.identities, step.costs, step.changes, step.gone)
    return _with_state(model, step.state), went


def observe_demonstration(
    model: OnlineModel, demonstration: Demonstration
) -> tuple[OnlineModel, Assignments]:
    """The model after one more demonstration, as its frames see it; and where its datapoints went.

    Quaternions that run closer to what the model knows after a change of sign have it changed, their
    derivatives with them: q and -q are one orientation.
    Raises: InvalidInput, when it differs from the model in layout, period or names of frames.
    """
    require_kind("model", model, OnlineModel, MODELS)
    require_kind("demonstration", demonstration, Demonstration, "pf.demonstration makes one of an array")
    for what, given, known in (
        ("layout", demonstration.layout, model.layout),
        ("period [s]", demonstration.period, model.period),
        ("frames", tuple(f.name for f in demonstration.frames), model.frame_names),
    ):
        if given != known:
            raise InvalidInput(
                f"demonstration {demonstration.name!r} differs from the model in {what}: {_named(given)}, "
                f"expected {_named(known)}"
            )
    seen = views([demonstration]).x
    for p, x in enumerate(seen):
        x *= _signs(x, model.means[:, p], model.layout)
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
    head[Head.BEFORE], head[Head.BEFORE_STEPS] = -1.0, 0.0
    row, C = clusters[k], kernels.StreamColumn
    row[C.CUT] += 1.0
    row[C.CUT_DURATION] += (steps - row[C.CUT_DURATION]) / row[C.CUT]
    return _with_state(model, replace(state, head=head, clusters=clusters))


def _signs(x: Float[Array, "T D"], means: Float[Array, "K D"], layout: Layout) -> Float[Array, " D"]:
    """Those of orientations under which the datapoints lie closest to the means, squared and added."""
    if not layout.quaternions or not len(means):
        return np.ones(layout.width)

    def distance(signs: Float[Array, " D"]) -> float:
        squares = [np.sum((signs * x - mean) ** 2, axis=1) for mean in means]
        return float(np.min(squares, axis=0).sum())

    return min(sign_choices(layout), key=distance)


def _with_state(model: OnlineModel, state: kernels.StreamState) -> OnlineModel:
    """The model with another state; dataclasses.replace would take half the time of a step."""
    return OnlineModel(model.settings, model.layout, model.period, model.frame_names, model.rules, state)


def _one_frame(x: Float[Array, "..."], model: OnlineModel) -> Float[Array, "1 D"]:
    if model.state.frames != 1 or x.shape != (model.state.width,):
        raise InvalidInput(f"the datapoint has shape {x.shape}, expected {_expected(model)}")
    return x.reshape(1, -1)


def _numbers(x: object) -> Float[Array, "..."]:
    if type(x) is np.ndarray and x.dtype == np.float64:  # a stream is one datapoint after another
        return np.ascontiguousarray(x)
    return numeric_array(x, "the datapoint")


def _expected(model: OnlineModel) -> str:
    P, D = len(model.frame_names), model.layout.width
    columns = ", ".join(model.layout.names) if D <= 16 else f"{D} columns"
    return f"({D},): {columns}" if P == 1 else f"({P}, {D}): {columns}, as each frame sees them"


def _not_finite(points: Float[Array, "N P D"], model: OnlineModel) -> InvalidInput:
    n, p, d = np.argwhere(~(np.abs(points) <= LARGEST))[0].tolist()
    return InvalidInput(
        f"datapoint {n} (first is 0), column {model.layout.names[d]!r} as frame {model.frame_names[p]!r} "
        f"sees it, is {points[n, p, d]}, expected a number of at most {LARGEST:g}; leave it out: the "
        "model is as it was"
    )


def _named(value: object) -> object:
    return ", ".join(value.names) if hasattr(value, "names") else value
