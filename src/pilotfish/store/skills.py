"""Skills in files: arrays as they are, everything else in one JSON header, named by the hash of both.

docs/skill-file.md tells the format.
"""

from pathlib import Path
from typing import Any

import numpy as np

from pilotfish.demonstrations import Layout
from pilotfish.errors import InvalidInput, UnknownSkill
from pilotfish.gaussians import (
    DenseCovariances,
    ExpandedPrecisions,
    LatentCovariances,
    MultipleTransformCovariances,
    SemiTiedCovariances,
)
from pilotfish.models import MarkovChain, Provenance, SemiMarkovChain, Skill, Weights
from pilotfish.store.headed_files import SKILL, content_of, decoded, encoded, opened, written
from pilotfish.store.skills_checks import require_agreement, require_sizes, require_sound
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
from pilotfish.types import Array, Float
from pilotfish.validation import short_repr

# What can be written and read, by the name it has in a file. To add a kind, add a line.
DYNAMICS: dict[str, type[Any]] = {"mixture": Weights, "markov": MarkovChain, "semi-markov": SemiMarkovChain}
COVARIANCES: dict[str, type[Any]] = {
    "dense": DenseCovariances,
    "semi-tied": SemiTiedCovariances,
    "latent": LatentCovariances,
    "expanded": ExpandedPrecisions,
    "multiple-transforms": MultipleTransformCovariances,
}


def save_skill(skill: Skill, path: str | Path, *, overwrite: bool = True, beside: bool = False) -> None:
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
    written(encode_skill(skill), path, overwrite=overwrite, beside=beside)


def open_skill(path: str | Path) -> Skill:
    """The skill that save_skill wrote, number for number.

    Raises: UnknownSkill, when the file is damaged, altered, of another kind or from a newer version;
    InvalidInput, when there is none that can be read.
    """
    return opened(path, "skill", decode_skill)


def content_hash(skill: Skill) -> str:
    """SHA-256 of all that the skill holds: two sites that name skills by it mean the same, on any machine.

    Raises: as save_skill does.
    """
    return content_of(SKILL, *_parts(skill))


def encode_skill(skill: Skill) -> bytes:
    """The bytes of the skill's file.    Raises: as save_skill does."""
    return encoded(SKILL, *_parts(skill))


def decode_skill(data: bytes) -> Skill:
    """The skill that encode_skill wrote, or UnknownSkill."""
    return decoded(SKILL, data, _skill)


def _parts(skill: Skill) -> tuple[dict[str, Any], Arrays]:
    """What the file holds: the header but for its hash, and the arrays by name."""
    require_agreement(skill)
    sizes = _sizes(skill.means)
    dynamics, arrays = take_apart(skill.dynamics, "dynamics", sizes)
    arrays["means"] = np.ascontiguousarray(skill.means, dtype=np.float64)
    covariances = []
    for p, one in enumerate(skill.covariances):
        fields, more = take_apart(one, f"covariances.{p}", _tangent(sizes, skill.layout))
        covariances.append({"kind": _name(one, COVARIANCES), **fields})
        arrays |= more
    require_sound(skill)
    header = {
        "dynamics": {"kind": _name(skill.dynamics, DYNAMICS), **dynamics},
        "covariances": covariances,
        "layout": layout_apart(skill.layout),
        "period": float(skill.period),
        "frames": list(skill.frame_names),
        "provenance": take_apart(skill.provenance, "provenance", {})[0],
    }
    return header, arrays


def _skill(header: dict[str, Any], arrays: Arrays) -> Skill:
    """The inverse of _parts. It uses header and arrays up, so that what is too much is seen."""
    means = taken(arrays, "means", "the file")
    if means.ndim != 3:
        raise InvalidInput(f"means has shape {means.shape}, expected (frames, states, columns)")
    sizes = _sizes(means)
    layout = layout_together(taken_list(header, "layout"))
    require_sizes(*means.shape)
    tangent = _tangent(sizes, layout)
    dynamics = taken(header, "dynamics", "the header")
    skill = Skill(
        dynamics=put_together(_kind(dynamics, DYNAMICS, "dynamics"), "dynamics", dynamics, arrays, sizes),
        means=means,
        covariances=tuple(
            put_together(_kind(one, COVARIANCES, "covariances"), f"covariances.{p}", one, arrays, tangent)
            for p, one in enumerate(taken_list(header, "covariances"))
        ),
        layout=layout,
        period=from_json(taken(header, "period", "the header"), float, "period"),
        frame_names=from_json(taken(header, "frames", "the header"), tuple[str, ...], "frames"),
        provenance=put_together(Provenance, "provenance", taken(header, "provenance", "the header"), {}, {}),
    )
    require_nothing_left(header, "the header")
    require_nothing_left(arrays, "the file")
    require_agreement(skill)
    require_sound(skill)
    return skill


def _sizes(means: Float[Array, "P K D"]) -> dict[str, int]:
    return dict(zip("PKD", means.shape, strict=True))


def _tangent(sizes: dict[str, int], layout: Layout) -> dict[str, int]:
    """The sizes with D as covariances have it: deviations of an orientation have three columns for four."""
    return sizes | {"D": sizes["D"] - len(layout.turns)}


def _name(value: object, kinds: dict[str, type[Any]]) -> str:
    for name, kind in kinds.items():
        if type(value) is kind:
            return name
    raise InvalidInput(f"{type(value).__name__} cannot be written to a skill file, only {', '.join(kinds)}")


def _kind(fields: Any, kinds: dict[str, type[Any]], place: str) -> type[Any]:
    name = taken(fields, "kind", place)
    if not isinstance(name, str) or name not in kinds:
        raise UnknownSkill(
            f"{place} are of the kind {short_repr(name)}, which this version does not know, only "
            f"{list(kinds)}"
        )
    return kinds[name]
