"""The looks of the real Baxter, taken from an installed package of robot models and thinned once."""

import os
import re
from collections.abc import Iterator, Sequence
from hashlib import sha256
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from pilotfish.environments import VisualMesh
from pilotfish.errors import InvalidInput, SkillError
from pilotfish.io import atomic_file, is_file, make_folder, read_file
from pilotfish.types import Array, Float, Int

PACKAGE = "example-robot-data"
FOLDER = "cmeel.prefix/share/example-robot-data/robots/baxter_description/meshes"
MAX_FACES_BY_PART = {"torso": 4500}  # triangles that are kept of the files of a part
MAX_FACES, MIN_FACES = 1500, 60  # of those of the others, and at least of each colour
CACHE_VERSION = 1  # one more whenever surfaces are made otherwise: old ones in the cache are then left alone
DEFAULT_COLOUR = (0.25, 0.25, 0.26)  # of what has no colour
GAMMA = 1.5  # chosen: the package tells amounts of light, of which a screen would show little
SIMPLIFICATION_AGGRESSIVENESS = 3  # of 10: how roughly surfaces are thinned
VERTEX_MERGE_DIGITS = 4  # digits of a metre, in which places of one vertex agree
DIGEST = 32  # bytes, before the rest of a file in the cache
MAX_CACHE_BYTES = 2**26  # bytes of a file in the cache
FIELDS = ("vertices", "faces", "rgba")  # of a surface
ORIGIN = (0.0, 0.0, 0.0)

# What wears each file, where it lies there [m] and how it is turned (roll, pitch, yaw [rad]), as the
# package's URDF says; the head looks ahead.
MESH_PLACEMENTS = {
    "torso/base_link": ("torso", ORIGIN, ORIGIN),
    "head/H0": ("torso", (0.06, 0.0, 0.69553), ORIGIN),
    "head/H1": ("torso", (0.14686, 0.0, 0.68283), (1.570796, 0.179774, 0.0)),
    "upper_shoulder/S0": ("s0", ORIGIN, ORIGIN),
    "lower_shoulder/S1": ("s1", ORIGIN, ORIGIN),
    "upper_elbow/E0": ("e0", ORIGIN, ORIGIN),
    "lower_elbow/E1": ("e1", ORIGIN, ORIGIN),
    "upper_forearm/W0": ("w0", ORIGIN, ORIGIN),
    "lower_forearm/W1": ("w1", ORIGIN, ORIGIN),
    "wrist/W2": ("w2", ORIGIN, ORIGIN),
}


# How the faces of a surface are named in the cache: its number, then what wears it.
FACES_OF = re.compile(
    rf"[0-9]{{1,4}}\.({'|'.join(sorted({part for part, _, _ in MESH_PLACEMENTS.values()}))})\.faces"
)


def baxter_meshes() -> tuple[VisualMesh, ...]:
    """What Baxter may wear in pictures: from the user's cache, or made of the package's meshes, then kept.

    Raises: SkillError, when the package, or what reads and thins its meshes, is not installed; InvalidInput,
    when the cache cannot be written.
    """
    try:
        package = metadata.distribution(PACKAGE)
    except metadata.PackageNotFoundError as error:
        raise SkillError(_install_hint(PACKAGE)) from error
    kept = cache_folder() / f"baxter-{package.version}-{MAX_FACES}-{CACHE_VERSION}.surfaces"
    if (found := _read_cache(kept)) is None:
        found = tuple(_convert_meshes(Path(str(package.locate_file(FOLDER)))))
        _write_cache(found, kept)
    return found


def cache_folder() -> Path:
    """The folder of pilotfish in the user's cache.    Raises: SkillError, when the user has none."""
    if named := os.environ.get("XDG_CACHE_HOME"):
        return Path(named) / "pilotfish"
    try:
        return Path.home() / ".cache" / "pilotfish"
    except RuntimeError as error:
        raise SkillError("there is no home folder; set XDG_CACHE_HOME to a folder for surfaces") from error


def _install_hint(name: str) -> str:
    return f"the meshes of Baxter need {name}: pip install 'pilotfish[meshes]'"


def _convert_meshes(folder: Path) -> Iterator[VisualMesh]:
    try:
        import collada  # noqa: F401 # trimesh reads these files by it
        import fast_simplification  # noqa: F401
        import trimesh
    except ImportError as error:
        raise SkillError(_install_hint(error.name or str(error))) from error
    for name, (part, place, turn) in MESH_PLACEMENTS.items():
        file = folder / f"{name}.DAE"
        if not is_file(file):
            raise SkillError(
                f"{PACKAGE} has no {file}; install the version that 'pilotfish[meshes]' asks for"
            )
        pieces = trimesh.load_scene(file).dump()
        total = sum(len(piece.faces) for piece in pieces)
        there = trimesh.transformations.compose_matrix(translate=place, angles=turn)
        for piece in pieces:
            piece.apply_transform(there)
            wanted = max(MAX_FACES_BY_PART.get(part, MAX_FACES) * len(piece.faces) // total, MIN_FACES)
            yield VisualMesh(part, *_simplify_mesh(piece, wanted), _colour(piece))


def _simplify_mesh(piece: Any, wanted: int) -> tuple[Float[Array, "V 3"], Int[Array, "F 3"]]:
    """Vertices and faces of much the same surface with about so many faces."""
    import fast_simplification

    piece.merge_vertices(
        merge_tex=True, merge_norm=True, digits_vertex=VERTEX_MERGE_DIGITS
    )  # else it comes apart
    vertices, faces = np.asarray(piece.vertices, np.float32), np.asarray(piece.faces, np.int32)
    if len(faces) > wanted:
        vertices, faces = fast_simplification.simplify(
            vertices, faces, target_count=wanted, agg=SIMPLIFICATION_AGGRESSIVENESS
        )
    return vertices.astype(np.float64), faces.astype(np.int32)


def _colour(piece: Any) -> tuple[float, float, float, float]:
    material = getattr(piece.visual, "material", None)
    if material is None:
        return (*DEFAULT_COLOUR, 1.0)
    red, green, blue = ((np.asarray(material.main_color[:3]) / 255.0) ** (1 / GAMMA)).tolist()
    return red, green, blue, 1.0


def _write_cache(visual_meshes: Sequence[VisualMesh], file: Path) -> None:
    from safetensors.numpy import save

    arrays: dict[str, Array] = {}
    for n, mesh in enumerate(visual_meshes):
        arrays[f"{n}.{mesh.part}.vertices"] = mesh.vertices
        arrays[f"{n}.{mesh.part}.faces"] = mesh.faces
        arrays[f"{n}.{mesh.part}.rgba"] = np.array(mesh.rgba)
    content = save(arrays)
    make_folder(file.parent, "set XDG_CACHE_HOME to another folder")
    with atomic_file(file) as part:
        part.write_bytes(sha256(content).digest() + content)


def _read_cache(file: Path) -> tuple[VisualMesh, ...] | None:
    """Return the surfaces in a file of the cache; None if there is none, or it is not as it was written."""
    try:
        data = read_file(file, "surfaces", MAX_CACHE_BYTES)
    except InvalidInput:  # it is missing or too large, and is made anew
        return None
    digest, content = data[:DIGEST], data[DIGEST:]
    return _decode_meshes(content) if sha256(content).digest() == digest else None


def _decode_meshes(content: bytes) -> tuple[VisualMesh, ...] | None:
    """Return the surfaces in the bytes of a safetensors file; None if it holds anything else."""
    from safetensors import SafetensorError
    from safetensors.numpy import load

    try:
        arrays = load(content)
    except (SafetensorError, ValueError):  # ValueError: a shape that no array has
        return None
    names = [name.removesuffix(".faces") for name in arrays if FACES_OF.fullmatch(name)]
    names.sort(key=lambda name: int(name.split(".")[0]))
    if set(arrays) != {f"{name}.{field}" for name in names for field in FIELDS}:
        return None
    visual_meshes = [_decode_mesh(name, *(arrays[f"{name}.{field}"] for field in FIELDS)) for name in names]
    whole = [mesh for mesh in visual_meshes if mesh is not None]
    return tuple(whole) if len(whole) == len(visual_meshes) else None


def _decode_mesh(name: str, vertices: Array, faces: Array, rgba: Array) -> VisualMesh | None:
    """Return a surface if the arrays are those of one: finite numbers, and faces of its vertices."""
    shapes = vertices.shape[1:] == faces.shape[1:] == (3,) and rgba.shape == (4,)
    kinds = vertices.dtype == rgba.dtype == np.float64 and faces.dtype == np.int32
    if not shapes or not kinds or not np.isfinite(vertices).all() or not np.isfinite(rgba).all():
        return None
    if not faces.size or faces.min() < 0 or faces.max() >= len(vertices):
        return None
    red, green, blue, alpha = rgba.tolist()
    return VisualMesh(name.split(".")[1], vertices, faces, (red, green, blue, alpha))
