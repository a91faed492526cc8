"""Models that grow with a stream, in files, to go on from another day.

docs/stream-file.md tells the format.
"""

from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from pilotfish.errors import InvalidInput, UnreadableFile
from pilotfish.io.container_format import (
    STREAM_FORMAT,
    Header,
    decode_container,
    encode_container,
    read_container,
    read_format_name,
    write_container,
)
from pilotfish.io.skill_checks import validate_sizes
from pilotfish.io.skill_fields import (
    Arrays,
    decode_dataclass,
    decode_json_value,
    decode_layout,
    encode_dataclass,
    encode_layout,
    pop_field,
    pop_list,
    reject_unknown_fields,
)
from pilotfish.io.skill_file import decode_skill
from pilotfish.io.stream_checks import MAX_INTEGER, validate_online_model
from pilotfish.kernels import ClusterColumn, StreamCounter, StreamState, round_up_to_four, zero_stream
from pilotfish.models import Skill, online
from pilotfish.validation import require_type, short_repr

# What can be written and read, by the name it has in a file. To add a kind, add a line.
LEARNER_TYPES: dict[str, type[Any]] = {
    "dp-gmm": online.DPGMM,
    "dp-mppca": online.DPMPPCA,
    "hdp-hsmm": online.HDPHSMM,
    "sosc": online.SOSC,
}
WEIGHTING_TYPES: dict[str, type[Any]] = {
    "count": online.DatapointCount,
    "exponential-decay": online.ExponentialDecay,
    "constant": online.ConstantWeight,
}
SUBSPACES = ("dimensions", "ranks", "means", "variances", "distances", "bases")
INTEGER_FIELDS = ("extra_directions", "max_clusters", "batch")


def save_stream(
    model: online.OnlineModel, path: str | Path, *, overwrite: bool = True, use_free_name: bool = False
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
    write_container(encode_stream(model), path, overwrite=overwrite, use_free_name=use_free_name)


def open_stream(path: str | Path) -> online.OnlineModel:
    """The model that save_stream wrote, number for number: it goes on as if it had never been away.

    Raises: UnknownSkill, when the file is damaged, altered, of another kind or from a newer version;
    InvalidInput, when there is none that can be read.
    """
    return read_container(path, "stream", decode_stream)


def load_any(path: str | Path) -> Skill | online.OnlineModel:
    """The skill or the model in the file, whichever it holds.    Raises: as open_skill and open_stream."""

    def decode(data: bytes) -> Skill | online.OnlineModel:
        return decode_stream(data) if read_format_name(data) == STREAM_FORMAT.name else decode_skill(data)

    return read_container(path, "skill or stream", decode)


def encode_stream(model: online.OnlineModel) -> bytes:
    """The bytes of the model's file.    Raises: InvalidInput, as save_stream does."""
    require_type(model, "model", online.OnlineModel, "online.online_model makes one")
    validate_online_model(model)
    header = {
        "settings": _encode_settings(model.settings),
        "layout": encode_layout(model.layout),
        "period": float(model.period),
        "frames": list(model.frame_names),
    }
    return encode_container(STREAM_FORMAT, header, _encode_state(model.state))


def decode_stream(data: bytes) -> online.OnlineModel:
    """The model that encode_stream wrote, or UnknownSkill."""
    return decode_container(STREAM_FORMAT, data, _decode_model)


def _decode_model(header: Header, arrays: Arrays) -> online.OnlineModel:
    """The inverse of encode_stream. It uses header and arrays up, so that what is too much is seen."""
    layout = decode_layout(pop_list(header, "layout"))
    names = decode_json_value(pop_field(header, "frames", "the header"), tuple[str, ...], "frames")
    settings = _decode_settings(pop_field(header, "settings", "the header"))
    period = decode_json_value(pop_field(header, "period", "the header"), float, "period")
    if "numbers" in arrays and arrays["numbers"].ndim and arrays["numbers"].size:
        validate_sizes(len(names), len(arrays["numbers"]), layout.width)
    state = _decode_state(arrays, len(names), layout.width)
    reject_unknown_fields(header, "the header")
    reject_unknown_fields(arrays, "the file")
    model = replace(online.online_model(settings, layout, period, names), state=state)
    validate_online_model(model)
    return model


def _encode_state(state: StreamState) -> Arrays:
    """What was learned, by name, without what rows are filled up with."""
    numbers = state.clusters[:, : len(ClusterColumn)]
    arrays = {"head": state.head, "counts": state.transition_counts, "numbers": numbers}
    arrays |= {name: getattr(state, name) for name in SUBSPACES}
    return {name: np.ascontiguousarray(array) for name, array in arrays.items()}


def _decode_state(arrays: Arrays, P: int, D: int) -> StreamState:
    """The inverse of _state_apart.    Raises: InvalidInput, when shapes do not agree."""
    held = {name: pop_field(arrays, name, "the file") for name in ("head", "counts", "numbers", *SUBSPACES)}
    K, C = (len(held["numbers"]) if held["numbers"].ndim else 0), (held["bases"].shape or (0,))[-1]
    shapes = {
        "head": (len(StreamCounter),),
        "counts": (K, K),
        "numbers": (K, len(ClusterColumn)),
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
    state = replace(
        zero_stream(K, P, D, round_up_to_four(C)), head=held["head"], transition_counts=held["counts"]
    )
    state.clusters[:, : len(ClusterColumn)] = held["numbers"]
    for name in SUBSPACES:
        getattr(state, name)[..., : held[name].shape[-1]] = held[name]
    return state


def _encode_settings(settings: online.OnlineSettings) -> dict[str, Any]:
    """The kind, the penalties by name, and the maintenance."""
    maintenance, apart = settings.maintenance, settings.maintenance.merge_distance
    weighting = encode_dataclass(maintenance.weighting, "weighting", {})[0]
    return {
        "kind": _type_name(settings, LEARNER_TYPES),
        **{name: float(getattr(settings, name)) for name in _penalty_names(type(settings))},
        "maintenance": {
            "weighting": {"kind": _type_name(maintenance.weighting, WEIGHTING_TYPES), **weighting},
            "merge_distance": None if apart is None else float(apart),
            **{
                name: _require_integer(getattr(maintenance, name), f"maintenance.{name}")
                for name in INTEGER_FIELDS
            },
        },
    }


def _decode_settings(plain: Any) -> online.OnlineSettings:
    kind = _type_of_name(plain, LEARNER_TYPES, "settings")
    maintenance = pop_field(plain, "maintenance", "settings")
    penalties = {
        name: decode_json_value(pop_field(plain, name, "settings"), float, f"settings.{name}")
        for name in _penalty_names(kind)
    }
    reject_unknown_fields(plain, "settings")
    settings: online.OnlineSettings = kind(**penalties, maintenance=_decode_maintenance(maintenance))
    return settings


def _decode_maintenance(plain: Any) -> online.Maintenance:
    weighting = pop_field(plain, "weighting", "maintenance")
    kind = _type_of_name(weighting, WEIGHTING_TYPES, "weighting")
    apart = pop_field(plain, "merge_distance", "maintenance")
    maintenance = online.Maintenance(
        weighting=decode_dataclass(kind, "weighting", weighting, {}, {}),
        merge_distance=None
        if apart is None
        else decode_json_value(apart, float, "maintenance.merge_distance"),
        **{
            name: _require_integer(pop_field(plain, name, "maintenance"), f"maintenance.{name}")
            for name in INTEGER_FIELDS
        },
    )
    reject_unknown_fields(plain, "maintenance")
    return maintenance


def _penalty_names(kind: type[Any]) -> list[str]:
    return [field.name for field in fields(kind) if field.name != "maintenance"]


def _require_integer(value: Any, place: str) -> int:
    number: int = decode_json_value(value, int, place)
    if not 0 <= number <= MAX_INTEGER:
        raise InvalidInput(f"{place} is {number}, expected a whole number from 0 to {MAX_INTEGER}")
    return number


def _type_name(value: object, kinds: dict[str, type[Any]]) -> str:
    for name, kind in kinds.items():
        if type(value) is kind:
            return name
    raise InvalidInput(f"{type(value).__name__} cannot be written to a stream file, only {', '.join(kinds)}")


def _type_of_name(plain: Any, kinds: dict[str, type[Any]], place: str) -> type[Any]:
    name = pop_field(plain, "kind", place)
    if isinstance(name, str) and name in kinds:
        return kinds[name]
    raise UnreadableFile(
        f"{place} is of the kind {short_repr(name)}, which this version does not know, only {list(kinds)}"
    )
