"""Skills in files: arrays as they are, everything else in one JSON header, named by the hash of both.

docs/skill-file.md tells the format.
"""

from pathlib import Path
from typing import Any

import numpy as np

from pilotfish.demonstrations import Layout
from pilotfish.errors import InvalidInput, UnreadableFile
from pilotfish.gaussians.structures import COVARIANCE_KINDS
from pilotfish.io.container_format import (
    SKILL_FORMAT,
    container_hash,
    decode_container,
    encode_container,
    read_container,
    write_container,
)
from pilotfish.io.skill_checks import validate_dimensions, validate_sizes, validate_values
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
from pilotfish.models import MarkovChain, MixtureWeights, Provenance, SemiMarkovChain, Skill
from pilotfish.types import Array, Float
from pilotfish.validation import short_repr

# What can be written and read, by the name it has in a file. To add a kind, add a line.
DYNAMICS_TYPES: dict[str, type[Any]] = {
    "mixture": MixtureWeights,
    "markov": MarkovChain,
    "semi-markov": SemiMarkovChain,
}


def save_skill(
    skill: Skill, path: str | Path, *, overwrite: bool = True, use_free_name: bool = False
) -> None:
    """Write the skill to path, whole or not at all. The same skill gives the same bytes.

    Args:
        skill: The skill.
        path: The file to write.
        overwrite: Whether an existing file may be replaced.
        beside: Whether to write to a similar free name if path exists and may not be replaced, so that the
            result of long work is kept; the error gives that name.

    Raises:
        InvalidInput: If path cannot be written, or exists and may not be replaced, or the skill holds what
            open_skill would refuse.
        NameTaken: If path exists and may not be replaced, and the result was written to the `path` of the
            error: with beside, or where the file came into being in the meantime.
        NotPositiveDefinite: If one of its covariances is not.
    """
    write_container(encode_skill(skill), path, overwrite=overwrite, use_free_name=use_free_name)


def open_skill(path: str | Path) -> Skill:
    """The skill that save_skill wrote, number for number.

    Raises: UnknownSkill, when the file is damaged, altered, of another kind or from a newer version;
    InvalidInput, when there is none that can be read.
    """
    return read_container(path, "skill", decode_skill)


def content_hash(skill: Skill) -> str:
    """SHA-256 of all that the skill holds: two sites that name skills by it mean the same, on any machine.

    Raises: as save_skill does.
    """
    return container_hash(SKILL_FORMAT, *_encode_fields(skill))


def encode_skill(skill: Skill) -> bytes:
    """The bytes of the skill's file.    Raises: as save_skill does."""
    return encode_container(SKILL_FORMAT, *_encode_fields(skill))


def decode_skill(data: bytes) -> Skill:
    """The skill that encode_skill wrote, or UnknownSkill."""
    return decode_container(SKILL_FORMAT, data, _decode_fields)


def _encode_fields(skill: Skill) -> tuple[dict[str, Any], Arrays]:
    """What the file holds: the header but for its hash, and the arrays by name."""
    validate_dimensions(skill)
    sizes = _sizes(skill.means)
    dynamics, arrays = encode_dataclass(skill.dynamics, "dynamics", sizes)
    arrays["means"] = np.ascontiguousarray(skill.means, dtype=np.float64)
    covariances = []
    for p, one in enumerate(skill.covariances):
        fields, more = encode_dataclass(one, f"covariances.{p}", _tangent_sizes(sizes, skill.layout))
        covariances.append({"kind": _type_name(one, COVARIANCE_KINDS), **fields})
        arrays |= more
    validate_values(skill)
    header = {
        "dynamics": {"kind": _type_name(skill.dynamics, DYNAMICS_TYPES), **dynamics},
        "covariances": covariances,
        "layout": encode_layout(skill.layout),
        "period": float(skill.period),
        "frames": list(skill.frame_names),
        "provenance": encode_dataclass(skill.provenance, "provenance", {})[0],
    }
    return header, arrays


def _decode_fields(header: dict[str, Any], arrays: Arrays) -> Skill:
    """The inverse of _parts. It uses header and arrays up, so that what is too much is seen."""
    means = pop_field(arrays, "means", "the file")
    if means.ndim != 3:
        raise InvalidInput(f"means has shape {means.shape}, expected (frames, states, columns)")
    sizes = _sizes(means)
    layout = decode_layout(pop_list(header, "layout"))
    validate_sizes(*means.shape)
    tangent = _tangent_sizes(sizes, layout)
    dynamics = pop_field(header, "dynamics", "the header")
    skill = Skill(
        dynamics=decode_dataclass(
            _type_of_name(dynamics, DYNAMICS_TYPES, "dynamics"), "dynamics", dynamics, arrays, sizes
        ),
        means=means,
        covariances=tuple(
            decode_dataclass(
                _type_of_name(one, COVARIANCE_KINDS, "covariances"), f"covariances.{p}", one, arrays, tangent
            )
            for p, one in enumerate(pop_list(header, "covariances"))
        ),
        layout=layout,
        period=decode_json_value(pop_field(header, "period", "the header"), float, "period"),
        frame_names=decode_json_value(pop_field(header, "frames", "the header"), tuple[str, ...], "frames"),
        provenance=decode_dataclass(
            Provenance, "provenance", pop_field(header, "provenance", "the header"), {}, {}
        ),
    )
    reject_unknown_fields(header, "the header")
    reject_unknown_fields(arrays, "the file")
    validate_dimensions(skill)
    validate_values(skill)
    return skill


def _sizes(means: Float[Array, "P K D"]) -> dict[str, int]:
    return dict(zip("PKD", means.shape, strict=True))


def _tangent_sizes(sizes: dict[str, int], layout: Layout) -> dict[str, int]:
    """The sizes with D as covariances have it: deviations of an orientation have three columns for four."""
    return sizes | {"D": sizes["D"] - len(layout.orientation_starts)}


def _type_name(value: object, kinds: dict[str, type[Any]]) -> str:
    for name, kind in kinds.items():
        if type(value) is kind:
            return name
    raise InvalidInput(f"{type(value).__name__} cannot be written to a skill file, only {', '.join(kinds)}")


def _type_of_name(fields: Any, kinds: dict[str, type[Any]], place: str) -> type[Any]:
    name = pop_field(fields, "kind", place)
    if not isinstance(name, str) or name not in kinds:
        raise UnreadableFile(
            f"{place} are of the kind {short_repr(name)}, which this version does not know, only "
            f"{list(kinds)}"
        )
    return kinds[name]
