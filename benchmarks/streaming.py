"""What streams are judged by, and how a peer that has to be tuned is tuned: fairly, and outside the time."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from prepared import CommandResult, Prepared
from problems import Floats, Integers

BLOCK = 100  # datapoints, after which labels are read while a stream goes on
FAULTS = (ValueError, ArithmeticError, KeyError, IndexError)  # of a setting that a peer cannot run with

Setting = Mapping[str, Any]


def normalised_mutual_information(found: Integers, truth: Integers) -> float:
    """What two labellings tell of each other, over the mean of their entropies; 1 when both have one name."""
    _, rows = np.unique(found, return_inverse=True)
    _, columns = np.unique(truth, return_inverse=True)
    joint = np.zeros((rows.max() + 1, columns.max() + 1))
    np.add.at(joint, (rows, columns), 1.0)
    joint /= len(rows)
    each = _entropy(joint.sum(axis=1)) + _entropy(joint.sum(axis=0))
    shared = max(0.0, each - _entropy(joint.ravel()))
    return 1.0 if each == 0.0 else 2.0 * shared / each


def _entropy(shares: Floats) -> float:
    """In nats."""
    some = shares[shares > 0.0]
    return float(-(some * np.log(some)).sum())


def _finish_unchanged(model: Any) -> None:
    """A model that is finished whenever it is asked."""


def _describe_nothing(model: Any) -> str:
    return ""


@dataclass(frozen=True, slots=True)
class Peer:
    """A way to learn from a stream.

    make builds a model of a setting, learn has it learn datapoints, in order, finish makes it ready to tell
    labels, and label reads them: what they are called does not count. told is what else a reader should know.
    """

    make: Callable[[Setting], Any]
    learn: Callable[[Any, Any], None]
    label: Callable[[Any, Any], Sequence[int]]
    finish: Callable[[Any], None] = _finish_unchanged
    describe: Callable[[Any], str] = _describe_nothing


@dataclass(frozen=True, slots=True)
class TuningResult:
    """The setting of most NMI, of labels read when the stream had ended or a block at a time as it came."""

    setting: dict[str, Any]
    at_the_end: float
    as_it_came: float

    @property
    def best(self) -> float:
        return max(self.at_the_end, self.as_it_came)


def prepared(kept: Path, peer: Peer, points: Any, truth: Integers, grid: Sequence[Setting]) -> Prepared:
    """The peer at its best setting of the grid, which is looked for once a run and kept in that file."""
    if not kept.exists():
        kept.write_text(json.dumps(as_json(tune(peer, points, truth, grid))), encoding="utf-8")
    best = TuningResult(**json.loads(kept.read_text(encoding="utf-8")))

    end = best.at_the_end >= best.as_it_came

    def run() -> Any:
        """Learns, and reads the labels that are judged: pilotfish tells them as it learns."""
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

    def answer(model: Any) -> CommandResult:
        words = ", ".join(f"{name} {_short(value)}" for name, value in best.setting.items())
        when = "at the end" if end else "as it came"
        remarks = filter(None, (words, f"labels {when}", peer.describe(model)))
        return CommandResult(best.best, len(truth), "; ".join(remarks))

    return Prepared(run, answer)


def as_json(found: TuningResult) -> dict[str, Any]:
    return {name: getattr(found, name) for name in ("setting", "at_the_end", "as_it_came")}


def tune(peer: Peer, points: Any, truth: Integers, grid: Sequence[Setting]) -> TuningResult:
    """Raises: what a setting failed with, when every one did."""
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
    """One pass over the stream, labels of each block read right after it, and of all at the end."""
    model = peer.make(setting)
    came: list[int] = []
    for begin in range(0, len(truth), BLOCK):
        block = points[begin : begin + BLOCK]
        peer.learn(model, block)
        peer.finish(model)
        came.extend(peer.label(model, block))
    describe = partial(normalised_mutual_information, truth=truth)
    end = np.asarray(peer.label(model, points))
    return TuningResult(dict(setting), describe(end), describe(np.asarray(came)))


def _short(value: Any) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def learn_in_batches(learn: Callable[[Any, Any], None], size: int) -> Callable[[Any, Any], None]:
    """Learns points so many at a time."""

    def stepwise(model: Any, points: Any) -> None:
        for begin in range(0, len(points), size):
            learn(model, points[begin : begin + size])

    return stepwise
