"""Skill files: save, open and name a learned skill (docs/skill-file.md)."""

from pathlib import Path
from typing import Any

import numpy as np

from pilotfish.demonstrations import Layout
from pilotfish.errors import InvalidInput
from pilotfish.gaussians.structures import COVARIANCE_KINDS
from pilotfish.io.container_format import (
    SKILL_FORMAT,
    Header,
    container_hash,
    decode_container,
    encode_container,
    read_container,
    write_container,
)
from pilotfish.io.skill_checks import validate_dimensions, validate_sizes, validate_values
from pilotfish.io.skill_fields import (
    Arrays,
    Variants,
    decode_dataclass,
    decode_json_value,
    decode_layout,
    decode_variant,
    encode_dataclass,
    encode_layout,
    encode_variant,
    pop_field,
    pop_list,
    reject_unknown_fields,
    validate_array,
)
from pilotfish.models import (
    DemonstrationStatistics,
    Endpoints,
    MarkovChain,
    MixtureWeights,
    Provenance,
    SemiMarkovChain,
    Skill,
)
from pilotfish.types import Array, Float

OPTIONAL_FIELDS = {"demonstrated": DemonstrationStatistics, "endpoints": Endpoints}
DYNAMICS: Variants = {kind.name: kind for kind in (MixtureWeights, MarkovChain, SemiMarkovChain)}


def save_skill(
    skill: Skill, path: str | Path, *, overwrite: bool = True, use_free_name: bool = False
) -> None:
    """Write a skill to a file, which is complete or absent at every moment.

    Equal skills give equal bytes.

    Args:
        skill: Skill to write.
        path: File to write.
        overwrite: Whether an existing file may be replaced.
        use_free_name: Whether to write to a similar free name if path exists and may not be replaced, so that
            a result is not lost; the error states that name.

    Raises:
        InvalidInput: If path cannot be written, or exists and may not be replaced, or the skill has values
            that `open_skill` would refuse.
        OutputExists: If path exists and may not be replaced, and the result was written to the `path` of the
            error: with use_free_name, or if the file appeared in the meantime.
        NotPositiveDefinite: If a covariance is not positive definite.

    Example:
        >>> save_skill(fit.skill, "valve.skill")  # doctest: +SKIP
    """
    write_container(encode_skill(skill), path, overwrite=overwrite, use_free_name=use_free_name)


def open_skill(path: str | Path) -> Skill:
    """Return the skill in a file, equal number for number to the one that was saved.

    Args:
        path: File that `save_skill` wrote.

    Raises:
        UnreadableFile: If the file is damaged, altered, of another kind, or of another version.
        InvalidInput: If the file cannot be read.

    Example:
        >>> skill = open_skill("valve.skill")  # doctest: +SKIP
    """
    return read_container(path, "skill", decode_skill)


def content_hash(skill: Skill) -> str:
    """Return the SHA-256 of a skill, which is equal on every machine and identifies the skill.

    Args:
        skill: Skill to identify.

    Raises:
        InvalidInput: If the skill cannot be saved.
        NotPositiveDefinite: If a covariance is not positive definite.
    """
    return container_hash(SKILL_FORMAT, *_encode_fields(skill))


def encode_skill(skill: Skill) -> bytes:
    """Return the bytes of a skill's file; raise as `save_skill`."""
    return encode_container(SKILL_FORMAT, *_encode_fields(skill))


def decode_skill(data: bytes) -> Skill:
    """Return the skill in the bytes of a file, or raise UnreadableFile."""
    return decode_container(SKILL_FORMAT, data, _decode_fields)


def _encode_fields(skill: Skill) -> tuple[Header, Arrays]:
    validate_dimensions(skill)
    sizes = _axis_sizes(skill.means)
    tangent_sizes = _tangent_sizes(sizes, skill.layout)
    dynamics, arrays = encode_variant(skill.dynamics, DYNAMICS, "dynamics", sizes)
    arrays["means"] = np.ascontiguousarray(skill.means, dtype=np.float64)
    covariances = []
    for p, given in enumerate(skill.covariances):
        fields, inner = encode_variant(given, COVARIANCE_KINDS, f"covariances.{p}", tangent_sizes)
        covariances.append(fields)
        arrays |= inner
    validate_values(skill)
    optional, inner = _encode_optional_fields(skill, sizes)
    arrays |= inner
    header = {
        **optional,
        "dynamics": dynamics,
        "covariances": covariances,
        "layout": encode_layout(skill.layout),
        "period": float(skill.period),
        "frames": list(skill.frame_names),
        "provenance": encode_dataclass(skill.provenance, "provenance", {})[0],
    }
    return header, arrays


def _encode_optional_fields(skill: Skill, sizes: dict[str, int]) -> tuple[Header, Arrays]:
    """Return the fields that the skill of a stream does not have."""
    header: Header = {}
    arrays: Arrays = {}
    sizes = sizes | {"E": _tangent_sizes(sizes, skill.layout)["D"]}
    for name in OPTIONAL_FIELDS:
        if (value := getattr(skill, name)) is not None:
            header[name], inner = encode_dataclass(value, name, sizes)
            arrays |= inner
    if skill.regularisation is not None:
        arrays["regularisation"] = np.ascontiguousarray(skill.regularisation, dtype=np.float64)
    return header, arrays


def _decode_optional_fields(header: dict[str, Any], arrays: Arrays, sizes: dict[str, int]) -> dict[str, Any]:
    """Return the fields that `_encode_optional_fields` encoded."""
    values: dict[str, Any] = {"regularisation": arrays.pop("regularisation", None)}
    if values["regularisation"] is not None:
        validate_array(values["regularisation"], Float[Array, " E"], "regularisation", dict(sizes))
    for name, kind in OPTIONAL_FIELDS.items():
        if name in header:
            values[name] = decode_dataclass(kind, name, header.pop(name), arrays, sizes)
    return values


def _decode_fields(header: dict[str, Any], arrays: Arrays) -> Skill:
    """Return the skill; fields and arrays that remain are unknown and are refused."""
    means = pop_field(arrays, "means", "the file")
    if means.ndim != 3:
        raise InvalidInput(f"means has shape {means.shape}, expected (frames, states, columns)")
    sizes = _axis_sizes(means)
    layout = decode_layout(pop_list(header, "layout"))
    validate_sizes(*means.shape)
    tangent_sizes = _tangent_sizes(sizes, layout)
    dynamics, period, frames, provenance = (
        pop_field(header, name, "the header") for name in ("dynamics", "period", "frames", "provenance")
    )
    skill = Skill(
        dynamics=decode_variant(DYNAMICS, "dynamics", dynamics, arrays, sizes),
        means=means,
        covariances=tuple(
            decode_variant(COVARIANCE_KINDS, f"covariances.{p}", fields, arrays, tangent_sizes)
            for p, fields in enumerate(pop_list(header, "covariances"))
        ),
        layout=layout,
        period=decode_json_value(period, float, "period"),
        frame_names=decode_json_value(frames, tuple[str, ...], "frames"),
        provenance=decode_dataclass(Provenance, "provenance", provenance, {}, {}),
        **_decode_optional_fields(header, arrays, sizes | {"E": tangent_sizes["D"]}),
    )
    reject_unknown_fields(header, "the header")
    reject_unknown_fields(arrays, "the file")
    validate_dimensions(skill)
    validate_values(skill)
    return skill


def _axis_sizes(means: Float[Array, "P K D"]) -> dict[str, int]:
    return dict(zip("PKD", means.shape, strict=True))


def _tangent_sizes(sizes: dict[str, int], layout: Layout) -> dict[str, int]:
    """Return the sizes with D of covariances: an orientation has four columns, and three tangent columns."""
    return sizes | {"D": sizes["D"] - len(layout.orientation_starts)}
