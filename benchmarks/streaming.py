"""Score of a stream, and tuning of peers outside the measured time."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from prepared import Answer, Prepared
from problems import Floats, Integers

BLOCK = 100  # datapoints between predictions during a stream
FAULTS = (ValueError, ArithmeticError, KeyError, IndexError)  # of a setting that a peer does not support

Setting = Mapping[str, Any]


def normalised_mutual_information(found: Integers, truth: Integers) -> float:
    """Return the mutual information of two labellings over their mean entropy; 1 if both have one label."""
    _, rows = np.unique(found, return_inverse=True)
    _, columns = np.unique(truth, return_inverse=True)
    joint = np.zeros((rows.max() + 1, columns.max() + 1))
    np.add.at(joint, (rows, columns), 1.0)
    joint /= len(rows)
    total = _entropy(joint.sum(axis=1)) + _entropy(joint.sum(axis=0))
    shared = max(0.0, total - _entropy(joint.ravel()))
    return 1.0 if total == 0.0 else 2.0 * shared / total


def _entropy(probabilities: Floats) -> float:
    """Return the entropy in nats."""
    positive = probabilities[probabilities > 0.0]
    return float(-(positive * np.log(positive)).sum())


def _finish_unchanged(model: Any) -> None:
    """Do nothing, for a model that needs no final step."""


def _describe_nothing(model: Any) -> str:
    return ""


@dataclass(frozen=True, slots=True)
class Peer:
    """Functions of a peer that learns from a stream.

    Attributes:
        make: Create a model from a setting.
        learn: Learn datapoints in order.
        label: Return the label of each datapoint.
        finish: Prepare the model for prediction.
        describe: Return a remark for the table.
    """

    make: Callable[[Setting], Any]
    learn: Callable[[Any, Any], None]
    label: Callable[[Any, Any], Sequence[int]]
    finish: Callable[[Any], None] = _finish_unchanged
    describe: Callable[[Any], str] = _describe_nothing


@dataclass(frozen=True, slots=True)
class TuningResult:
    """Setting with the largest NMI, of labels by the final model or after each block."""

    setting: dict[str, Any]
    final_nmi: float
    block_nmi: float

    @property
    def best(self) -> float:
        return max(self.final_nmi, self.block_nmi)


def prepared(file: Path, peer: Peer, points: Any, truth: Integers, grid: Sequence[Setting]) -> Prepared:
    """Prepare a peer at its best setting of the grid, which is searched once per run and stored in a file."""
    if not file.exists():
        file.write_text(json.dumps(as_json(tune(peer, points, truth, grid))), encoding="utf-8")
    best = TuningResult(**json.loads(file.read_text(encoding="utf-8")))

    end = best.final_nmi >= best.block_nmi

    def run() -> Any:
        """Learn the stream and predict the labels."""
        model = peer.make(best.setting)
        if end:
            peer.learn(model, points)
            peer.finish(model)
            peer.label(model, points)
            return model
        for begin in range(0, len(truth), BLOCK):
            block = points[begin : begin + BLOCK]
            peer.learn(model, block)
            peer.finish(model)
            peer.label(model, block)
        return model

    def answer(model: Any) -> Answer:
        settings = ", ".join(f"{name} {_short(value)}" for name, value in best.setting.items())
        when = "at the end" if end else "after each block"
        remarks = filter(None, (settings, f"labels {when}", peer.describe(model)))
        return Answer(best.best, len(truth), "; ".join(remarks))

    return Prepared(run, answer)


def as_json(found: TuningResult) -> dict[str, Any]:
    return {name: getattr(found, name) for name in ("setting", "final_nmi", "block_nmi")}


def tune(peer: Peer, points: Any, truth: Integers, grid: Sequence[Setting]) -> TuningResult:
    """Return the best result; raise the last error if every setting failed."""
    results, fault = [], None
    for setting in grid:
        try:
            results.append(evaluate_setting(peer, points, truth, setting))
        except FAULTS as error:
            fault = error
    if not results and fault is not None:
        raise fault
    return max(results, key=lambda result: result.best)


def evaluate_setting(peer: Peer, points: Any, truth: Integers, setting: Setting) -> TuningResult:
    """Learn the stream once, and predict the labels of each block after it and of all at the end."""
    model = peer.make(setting)
    block_labels: list[int] = []
    for begin in range(0, len(truth), BLOCK):
        block = points[begin : begin + BLOCK]
        peer.learn(model, block)
        peer.finish(model)
        block_labels.extend(peer.label(model, block))
    score = partial(normalised_mutual_information, truth=truth)
    end = np.asarray(peer.label(model, points))
    return TuningResult(dict(setting), score(end), score(np.asarray(block_labels)))


def _short(value: Any) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def learn_in_batches(learn: Callable[[Any, Any], None], size: int) -> Callable[[Any, Any], None]:
    """Return a function that learns points in batches of a size."""

    def learn_batches(model: Any, points: Any) -> None:
        for begin in range(0, len(points), size):
            learn(model, points[begin : begin + size])

    return learn_batches
