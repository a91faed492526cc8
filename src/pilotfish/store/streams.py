"""Models that grow with a stream, in files, to go on from another day.

docs/stream-file.md tells the format.
"""

from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from pilotfish.errors import InvalidInput, UnknownSkill, require_kind
from pilotfish.kernels import StreamColumn, StreamHead, StreamState, in_fours, stream_of
from pilotfish.models import Skill, online
from pilotfish.store.headed_files import STREAM, Header, decoded, encoded, format_name, opened, written
from pilotfish.store.skills import decode_skill
from pilotfish.store.skills_checks import require_sizes
from pilotfish.store.skills_fields import (
    Arrays,
    from_json,
    layout_apart,
    layout_together,
    put_together,
    require_nothing_left,
    take_apart,
    taken,
    taken_list,
)
from pilotfish.store.streams_checks import MOST, require_sound_stream
from pilotfish.validation import short_repr

# What can be written and read, by the name it has in a file. To add a kind, add a line.
LEARNERS: dict[str, type[Any]] = {
    "dp-gmm": online.DPGMM,
    "dp-mppca": online.DPMPPCA,
    "hdp-hsmm": online.HDPHSMM,
    "sosc": online.SOSC,
}
WEIGHTINGS: dict[str, type[Any]] = {"count": online.Count, "trace": online.Trace, "constant": online.Constant}
SUBSPACES = ("dimensions", "ranks", "means", "variances", "distances", "bases")
WHOLE = ("spare", "most_clusters", "batch")


def save_stream(
    model: online.OnlineModel, path: str | Path, *, overwrite: bool = True, beside: bool = False
) -> None:
    """Write the model to path, whole or not at all. The same model gives the same bytes.

    Args:
        model: The model.
        path: The file to write.
        overwrite: Whether an existing file may be replaced.
        beside: Whether to write to a similar free name if path exists and may not be replaced, so that the
            result of long work is kept; the error gives that name.

    Raises:
        InvalidInput: If path cannot be written, or exists and may not be replaced, or the model holds what
            open_stream would refuse.
        NameTaken: If path exists and may not be replaced, and the result was written to the `path` of the
            error: with beside, or where the file came into being in the meantime.
    """
    written(encode_stream(model), path, overwrite=overwrite, beside=beside)


def open_stream(path: str | Path) -> online.OnlineModel:
    """The model that save_stream wrote, number for number: it goes on as if it had never been away.

    Raises: UnknownSkill, when the file is damaged, altered, of another kind or from a newer version;
    InvalidInput, when there is none that can be read.
    """
    return opened(path, "stream", decode_stream)


def open_kept(path: str | Path) -> Skill | online.OnlineModel:
    """The skill or the model in the file, whichever it holds.    Raises: as open_skill and open_stream."""

    def decode(data: bytes) -> Skill | online.OnlineModel:
        return decode_stream(data) if format_name(data) == STREAM.name else decode_skill(data)

    return opened(path, "skill or stream", decode)


def encode_stream(model: online.OnlineModel) -> bytes:
    """The bytes of the model's file.    Raises: InvalidInput, as save_stream does."""
    require_kind("model", model, online.OnlineModel, "online.online_model makes one")
    require_sound_stream(model)
    header = {
        "settings": _settings_apart(model.settings),
        "layout": layout_apart(model.layout),
        "period": float(model.period),
        "frames": list(model.frame_names),
    }
    return encoded(STREAM, header, _state_apart(model.state))


def decode_stream(data: bytes) -> online.OnlineModel:
    """The model that encode_stream wrote, or UnknownSkill."""
    return decoded(STREAM, data, _model)


def _model(header: Header, arrays: Arrays) -> online.OnlineModel:
    """The inverse of encode_stream. It uses header and arrays up, so that what is too much is seen."""
    layout = layout_together(taken_list(header, "layout"))
    names = from_json(taken(header, "frames", "the header"), tuple[str, ...], "frames")
    settings = _settings_together(taken(header, "settings", "the header"))
    period = from_json(taken(header, "period", "the header"), float, "period")
    if "numbers" in arrays and arrays["numbers"].ndim and arrays["numbers"].size:
        require_sizes(len(names), len(arrays["numbers"]), layout.width)
    state = _state_together(arrays, len(names), layout.width)
    require_nothing_left(header, "the header")
    require_nothing_left(arrays, "the file")
    model = replace(online.online_model(settings, layout, period, names), state=state)
    require_sound_stream(model)
    return model


def _state_apart(state: StreamState) -> Arrays:
    """What was learned, by name, without what rows are filled up with."""
    numbers = state.clusters[:, : len(StreamColumn)]
    arrays = {"head": state.head, "counts": state.counts, "numbers": numbers}
    arrays |= {name: getattr(state, name) for name in SUBSPACES}
    return {name: np.ascontiguousarray(array) for name, array in arrays.items()}


def _state_together(arrays: Arrays, P: int, D: int) -> StreamState:
    """The inverse of _state_apart.    Raises: InvalidInput, when shapes do not agree."""
    held = {name: taken(arrays, name, "the file") for name in ("head", "counts", "numbers", *SUBSPACES)}
    K, C = (len(held["numbers"]) if held["numbers"].ndim else 0), (held["bases"].shape or (0,))[-1]
    shapes = {
        "head": (len(StreamHead),),
        "counts": (K, K),
        "numbers": (K, len(StreamColumn)),
        "dimensions": (K, P),
        "ranks": (K, P),
        "means": (K, P, D),
        "variances": (K, P, C),
        "distances": (K, P, C + 1),
        "bases": (K, P, D, C),
    }
    for name, shape in shapes.items():
        if held[name].shape != shape:
            raise InvalidInput(f"{name} has shape {held[name].shape}, expected {shape}")
    state = replace(stream_of(K, P, D, in_fours(C)), head=held["head"], counts=held["counts"])
    state.clusters[:, : len(StreamColumn)] = held["numbers"]
    for name in SUBSPACES:
        getattr(state, name)[..., : held[name].shape[-1]] = held[name]
    return state


def _settings_apart(settings: online.OnlineSettings) -> dict[str, Any]:
    """The kind, the penalties by name, and the upkeep."""
    upkeep, apart = settings.upkeep, settings.upkeep.merge_distance
    weighting = take_apart(upkeep.weighting, "weighting", {})[0]
    return {
        "kind": _name(settings, LEARNERS),
        **{name: float(getattr(settings, name)) for name in _penalties(type(settings))},
        "upkeep": {
            "weighting": {"kind": _name(upkeep.weighting, WEIGHTINGS), **weighting},
            "merge_distance": None if apart is None else float(apart),
            **{name: _whole(getattr(upkeep, name), f"upkeep.{name}") for name in WHOLE},
        },
    }


def _settings_together(plain: Any) -> online.OnlineSettings:
    kind = _kind(plain, LEARNERS, "settings")
    upkeep = taken(plain, "upkeep", "settings")
    penalties = {
        name: from_json(taken(plain, name, "settings"), float, f"settings.{name}")
        for name in _penalties(kind)
    }
    require_nothing_left(plain, "settings")
    settings: online.OnlineSettings = kind(**penalties, upkeep=_upkeep_together(upkeep))
    return settings


def _upkeep_together(plain: Any) -> online.Upkeep:
    weighting = taken(plain, "weighting", "upkeep")
    kind = _kind(weighting, WEIGHTINGS, "weighting")
    apart = taken(plain, "merge_distance", "upkeep")
    upkeep = online.Upkeep(
        weighting=put_together(kind, "weighting", weighting, {}, {}),
        merge_distance=None if apart is None else from_json(apart, float, "upkeep.merge_distance"),
        **{name: _whole(taken(plain, name, "upkeep"), f"upkeep.{name}") for name in WHOLE},
    )
    require_nothing_left(plain, "upkeep")
    return upkeep


def _penalties(kind: type[Any]) -> list[str]:
    return [field.name for field in fields(kind) if field.name != "upkeep"]


def _whole(value: Any, place: str) -> int:
    number: int = from_json(value, int, place)
    if not 0 <= number <= MOST:
        raise InvalidInput(f"{place} is {number}, expected a whole number from 0 to {MOST}")
    return number


def _name(value: object, kinds: dict[str, type[Any]]) -> str:
    for name, kind in kinds.items():
        if type(value) is kind:
            return name
    raise InvalidInput(f"{type(value).__name__} cannot be written to a stream file, only {', '.join(kinds)}")


def _kind(plain: Any, kinds: dict[str, type[Any]], place: str) -> type[Any]:
    name = taken(plain, "kind", place)
    if isinstance(name, str) and name in kinds:
        return kinds[name]
    raise UnknownSkill(
        f"{place} is of the kind {short_repr(name)}, which this version does not know, only {list(kinds)}"
    )
