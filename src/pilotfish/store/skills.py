"""Skills in files: arrays as they are, everything else in one JSON header, named by the hash of both.

docs/skill-file.md tells the format.
"""

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np

from pilotfish.demonstrations import Layout, Part
from pilotfish.errors import InvalidInput, SkillError, UnknownSkill
from pilotfish.gaussians import (
    DenseCovariances,
    ExpandedPrecisions,
    LatentCovariances,
    MultipleTransformCovariances,
    SemiTiedCovariances,
)
from pilotfish.models import MarkovChain, Provenance, SemiMarkovChain, Skill, Weights
from pilotfish.store.skills_checks import require_agreement, require_sound
from pilotfish.store.skills_fields import (
    Arrays,
    from_json,
    put_together,
    require_nothing_left,
    take_apart,
    taken,
)
from pilotfish.store.whole_files import whole_file
from pilotfish.types import Array, Float

FORMAT, VERSION, KEY = "pilotfish-skill", 1, "pilotfish"

# What can be written and read, by the name it has in a file. To add a kind, add a line.
DYNAMICS: dict[str, type[Any]] = {"mixture": Weights, "markov": MarkovChain, "semi-markov": SemiMarkovChain}
COVARIANCES: dict[str, type[Any]] = {
    "dense": DenseCovariances,
    "semi-tied": SemiTiedCovariances,
    "latent": LatentCovariances,
    "expanded": ExpandedPrecisions,
    "multiple-transforms": MultipleTransformCovariances,
}


def save_skill(skill: Skill, path: str | Path) -> None:
    """Writes the skill to path, whole or not at all. The same skill gives the same bytes.

    Raises: InvalidInput, when path cannot be written or the skill holds what open_skill would refuse;
    NotPositiveDefinite, when one of its covariances is not.
    """
    data = encode_skill(skill)
    with whole_file(path) as part:
        part.write_bytes(data)


def open_skill(path: str | Path) -> Skill:
    """The skill that save_skill wrote, number for number.

    Raises: UnknownSkill, when the file is damaged, altered, of another kind or from a newer version;
    InvalidInput, when there is none that can be read.
    """
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise InvalidInput(f"{path} cannot be read: {error.strerror}; expected a skill file") from error
    try:
        return decode_skill(data)
    except UnknownSkill as error:
        raise UnknownSkill(f"{path}: {error}") from error


def content_hash(skill: Skill) -> str:
    """SHA-256 of all that the skill holds: two sites that name skills by it mean the same, on any machine.

    Raises: as save_skill does.
    """
    return _hash(*_parts(skill))


def encode_skill(skill: Skill) -> bytes:
    """The bytes of the skill's file.    Raises: as save_skill does."""
    from safetensors.numpy import save  # slow to import

    header, arrays = _parts(skill)
    return bytes(save(arrays, {KEY: _canonical(header | {"content": _hash(header, arrays)})}))


def decode_skill(data: bytes) -> Skill:
    """The skill that encode_skill wrote, or UnknownSkill."""
    text, arrays = _unpacked(data)
    try:
        header = json.loads(text)
        _require_known(header)
        _require_unaltered(header, arrays)
        return _skill(header, arrays)
    except UnknownSkill:
        raise
    except (SkillError, ValueError, RecursionError) as error:
        raise UnknownSkill(f"the header cannot be used: {error}") from error


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
        "format": FORMAT,
        "version": VERSION,
        "dynamics": {"kind": _name(skill.dynamics, DYNAMICS), **dynamics},
        "covariances": covariances,
        "layout": [take_apart(part, "layout", {})[0] for part in skill.layout.parts],
        "period": float(skill.period),
        "frames": list(skill.frame_names),
        "provenance": take_apart(skill.provenance, "provenance", {})[0],
    }
    return header, arrays


def _skill(header: dict[str, Any], arrays: Arrays) -> Skill:
    """The inverse of _parts. It uses header and arrays up, so that what is too much is seen."""
    del header["format"], header["version"]
    means = taken(arrays, "means", "the file")
    if means.ndim != 3:
        raise InvalidInput(f"means has shape {means.shape}, expected (frames, states, columns)")
    sizes = _sizes(means)
    layout = Layout(tuple(put_together(Part, "layout", part, {}, {}) for part in _tables(header, "layout")))
    tangent = _tangent(sizes, layout)
    dynamics = taken(header, "dynamics", "the header")
    skill = Skill(
        dynamics=put_together(_kind(dynamics, DYNAMICS, "dynamics"), "dynamics", dynamics, arrays, sizes),
        means=means,
        covariances=tuple(
            put_together(_kind(one, COVARIANCES, "covariances"), f"covariances.{p}", one, arrays, tangent)
            for p, one in enumerate(_tables(header, "covariances"))
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


def _unpacked(data: bytes) -> tuple[str, Arrays]:
    """The header's text and the arrays of a safetensors file, its checksum not yet looked at."""
    import safetensors  # slow to import

    try:
        tensors = safetensors.deserialize(data)  # type: ignore[no-untyped-call]
        length = int.from_bytes(data[:8], "little")
        text = json.loads(data[8 : 8 + length])["__metadata__"][KEY]
    except safetensors.SafetensorError as error:
        raise UnknownSkill(f"no safetensors file, or not all of one: {error}") from error
    except (KeyError, TypeError, ValueError, RecursionError) as error:
        raise UnknownSkill(f"a safetensors file without the header of a skill ({KEY!r})") from error
    return text, {name: _array(name, tensor) for name, tensor in tensors}


def _array(name: str, tensor: dict[str, Any]) -> Array:
    if tensor["dtype"] != "F64":
        raise UnknownSkill(f"{name} holds {tensor['dtype']}, expected F64")
    return np.frombuffer(tensor["data"], dtype="<f8").astype(np.float64).reshape(tensor["shape"])


def _require_known(header: Any) -> None:
    said = header if isinstance(header, dict) else {}
    if said.get("format") != FORMAT:
        raise UnknownSkill(f"its format is {said.get('format')!r}, expected {FORMAT!r}")
    version = said.get("version")
    if type(version) is not int or version < VERSION:
        raise UnknownSkill(f"its format's version is {version!r}, expected {VERSION}")
    if version > VERSION:
        raise UnknownSkill(
            f"written by a newer pilotfish (format {version}, this one reads {VERSION}); upgrade pilotfish"
        )


def _require_unaltered(header: dict[str, Any], arrays: Arrays) -> None:
    written = taken(header, "content", "the header")
    if written != (now := _hash(header, arrays)):
        raise UnknownSkill(
            f"the file was altered: its content has the hash {now}, the one written in it is {written!r}; "
            "fetch or learn the skill again"
        )


def _hash(header: dict[str, Any], arrays: Arrays) -> str:
    digest = hashlib.sha256(_canonical(header).encode())
    for name in sorted(arrays):
        digest.update(_canonical([name, "F64", arrays[name].shape]).encode())
        digest.update(arrays[name].astype("<f8").tobytes())
    return digest.hexdigest()


def _canonical(value: object) -> str:
    """JSON that is the same for equal values: keys in order, no blanks, ASCII alone."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)


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
            f"{place} are of the kind {name!r}, which this version does not know, only {list(kinds)}"
        )
    return kinds[name]


def _tables(header: dict[str, Any], name: str) -> list[Any]:
    value = taken(header, name, "the header")
    if not isinstance(value, list):
        raise InvalidInput(f"{name} is {value!r}, expected a list")
    return value
