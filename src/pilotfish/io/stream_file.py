"""Files of online models: a stream continues from an opened model to the last bit.

docs/stream-file.md specifies the format.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pilotfish.errors import InvalidInput, UnreadableFile
from pilotfish.gaussians import Moments
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
    decode_json_value,
    decode_layout,
    encode_layout,
    pop_field,
    pop_list,
    reject_unknown_fields,
)
from pilotfish.io.skill_file import decode_skill
from pilotfish.io.stream_checks import MAX_INTEGER, validate_online_model
from pilotfish.kernels import StreamState, zero_arrays
from pilotfish.models import Skill, online
from pilotfish.validation import require_type, short_repr

INTEGER_FIELDS = ("extra_directions", "max_clusters", "batch")
ENDS = ("end_counts", "end_means", "end_scatter_matrices")  # absent before the first demonstration
OPTIONAL_FIELDS = ("discount", "constant_weight", "merge_distance")  # null where they are None


def save_stream(
    model: online.OnlineModel, path: str | Path, *, overwrite: bool = True, use_free_name: bool = False
) -> None:
    """Write an online model to a file, completely or not at all.

    Equal models give equal bytes.

    Args:
        model: Model after any number of datapoints.
        path: File to write.
        overwrite: Whether an existing file may be replaced.
        use_free_name: Whether to write to a similar free name if path exists and may not be replaced, so that
            the result of a long run is kept; the error gives that name.

    Raises:
        InvalidInput: If path cannot be written, or exists and may not be replaced, or `open_stream` would
            refuse the model.
        OutputExists: If the result was written to the `path` of the error, because path exists and may not be
            replaced: with use_free_name, or because the file was created in the meantime.
    """
    write_container(encode_stream(model), path, overwrite=overwrite, use_free_name=use_free_name)


def open_stream(path: str | Path) -> online.OnlineModel:
    """Return the online model that `save_stream` wrote.

    Args:
        path: File to read.

    Raises:
        UnreadableFile: If the file is damaged, altered, of another kind or of another version.
        InvalidInput: If the file does not exist or cannot be read.
    """
    return read_container(path, "stream", decode_stream)


def load_any(path: str | Path) -> Skill | online.OnlineModel:
    """Return the skill or the online model in a file.

    Args:
        path: File to read.

    Raises:
        UnreadableFile: If the file is damaged, altered, of another kind or of another version.
        InvalidInput: If the file does not exist or cannot be read.
    """

    def decode(data: bytes) -> Skill | online.OnlineModel:
        return decode_stream(data) if read_format_name(data) == STREAM_FORMAT else decode_skill(data)

    return read_container(path, "skill or stream", decode)


def encode_stream(model: online.OnlineModel) -> bytes:
    """Return the bytes of the file of a model; raise InvalidInput as `save_stream` does."""
    require_type(model, "model", online.OnlineModel, "online.online_model makes one")
    validate_online_model(model)
    header = {
        "settings": _encode_settings(model.settings),
        "layout": encode_layout(model.layout),
        "period": float(model.period),
        "frames": list(model.frame_names),
        "counters": model.state.to_counters(),
    }
    return encode_container(STREAM_FORMAT, header, model.state.to_arrays() | _encode_ends(model.ends))


def decode_stream(data: bytes) -> online.OnlineModel:
    """Return the model that `encode_stream` wrote, or raise UnreadableFile."""
    return decode_container(STREAM_FORMAT, data, _decode_model)


def _decode_model(header: Header, arrays: Arrays) -> online.OnlineModel:
    layout = decode_layout(pop_list(header, "layout"))
    names = decode_json_value(pop_field(header, "frames", "the header"), tuple[str, ...], "frames")
    settings = _decode_settings(pop_field(header, "settings", "the header"))
    period = decode_json_value(pop_field(header, "period", "the header"), float, "period")
    counters = _decode_counters(pop_field(header, "counters", "the header"))
    if "points" in arrays and arrays["points"].ndim and arrays["points"].size:
        validate_sizes(len(names), len(arrays["points"]), layout.width)
    state = _decode_state(arrays, counters, len(names), layout.width)
    ends = _decode_ends(arrays, len(names), layout.width)
    reject_unknown_fields(header, "the header")
    reject_unknown_fields(arrays, "the file")
    model = replace(online.online_model(settings, layout, period, names), state=state, ends=ends)
    validate_online_model(model)
    return model


def _decode_counters(values: Any) -> dict[str, int]:
    names = StreamState.empty(1, 1).to_counters()
    counters = {name: pop_field(values, name, "counters") for name in names}
    reject_unknown_fields(values, "counters")
    for name, value in counters.items():
        if type(value) is not int or not -1 <= value <= 2**53:
            raise InvalidInput(f"counters.{name} is {short_repr(value)}, expected a whole number")
    return counters


def _decode_state(arrays: Arrays, counters: dict[str, int], P: int, D: int) -> StreamState:
    held = {name: pop_field(arrays, name, "the file") for name in zero_arrays(0, P, D, 0)}
    if (held["bases"].shape or (0,))[-1] % 4:
        raise InvalidInput(f"bases has shape {held['bases'].shape}, expected a multiple of four directions")
    K, C = (len(held["points"]) if held["points"].ndim else 0), (held["bases"].shape or (0,))[-1]
    for name, zeros in zero_arrays(K, P, D, C).items():
        if held[name].shape != zeros.shape:
            raise InvalidInput(f"{name} has shape {held[name].shape}, expected {zeros.shape}")
    return StreamState.from_arrays(held, counters)


def _encode_ends(ends: tuple[Moments, ...]) -> Arrays:
    """Return the moments of the ends of demonstrations, if there are any."""
    if not ends:
        return {}
    return {
        name: np.stack([getattr(moments, name.removeprefix("end_")) for moments in ends]) for name in ENDS
    }


def _decode_ends(arrays: Arrays, P: int, D: int) -> tuple[Moments, ...]:
    if not arrays.keys() & set(ENDS):
        return ()
    held = [pop_field(arrays, name, "the file") for name in ENDS]
    for name, values, shape in zip(ENDS, held, ((P, 2), (P, 2, D), (P, 2, D, D)), strict=True):
        if values.shape != shape:
            raise InvalidInput(f"{name} has shape {values.shape}, expected {shape}")
    return tuple(Moments(*values) for values in zip(*held, strict=True))


def _encode_settings(settings: online.OnlineSettings) -> dict[str, Any]:
    """Return the name of the learner, its penalties by name, the maintenance and the scales."""
    maintenance = settings.maintenance
    encoded: dict[str, Any] = {"forget_below": float(maintenance.forget_below)}
    for name in OPTIONAL_FIELDS:
        value = getattr(maintenance, name)
        encoded[name] = None if value is None else float(value)
    for name in INTEGER_FIELDS:
        encoded[name] = _require_integer(getattr(maintenance, name), f"maintenance.{name}")
    penalties = {name: float(getattr(settings, name)) for name in _penalty_names(type(settings))}
    scales = None if settings.scales is None else list(settings.scales)
    return {"kind": settings.name, **penalties, "maintenance": encoded, "scales": scales}


def _decode_settings(values: Any) -> online.OnlineSettings:
    kind = pop_field(values, "kind", "settings")
    if not isinstance(kind, str) or kind not in online.LEARNERS:
        raise UnreadableFile(
            f"the learner is {short_repr(kind)}, expected one of {list(online.LEARNERS)}; upgrade pilotfish"
        )
    learner: type[Any] = online.LEARNERS[kind]
    maintenance = pop_field(values, "maintenance", "settings")
    penalties = {
        name: decode_json_value(pop_field(values, name, "settings"), float, f"settings.{name}")
        for name in _penalty_names(learner)
    }
    scales = _decode_scales(pop_field(values, "scales", "settings"))
    reject_unknown_fields(values, "settings")
    settings: online.OnlineSettings = learner(
        **penalties, maintenance=_decode_maintenance(maintenance), scales=scales
    )
    return settings


def _decode_scales(values: Any) -> tuple[float, ...] | None:
    if values is None:
        return None
    if not isinstance(values, list):
        raise InvalidInput(f"settings.scales is {short_repr(values)}, expected a list of numbers, or null")
    return tuple(decode_json_value(value, float, f"settings.scales[{n}]") for n, value in enumerate(values))


def _decode_maintenance(values: Any) -> online.Maintenance:
    decoded: dict[str, Any] = {}
    for name in ("forget_below", *OPTIONAL_FIELDS):
        value = pop_field(values, name, "maintenance")
        is_null = value is None and name in OPTIONAL_FIELDS
        decoded[name] = None if is_null else decode_json_value(value, float, f"maintenance.{name}")
    for name in INTEGER_FIELDS:
        decoded[name] = _require_integer(pop_field(values, name, "maintenance"), f"maintenance.{name}")
    reject_unknown_fields(values, "maintenance")
    return online.Maintenance(**decoded)


def _penalty_names(learner: type[Any]) -> list[str]:
    return online.penalty_names(learner)


def _require_integer(value: Any, place: str) -> int:
    number: int = decode_json_value(value, int, place)
    if not 0 <= number <= MAX_INTEGER:
        raise InvalidInput(f"{place} is {number}, expected a whole number from 0 to {MAX_INTEGER}")
    return number
