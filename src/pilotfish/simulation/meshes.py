"""Visual meshes of the real Baxter, simplified once from an installed package of robot models."""

import re
from collections.abc import Iterator, Sequence
from hashlib import sha256
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from pilotfish.environments.baxter import VisualMesh
from pilotfish.errors import InvalidInput, SkillError
from pilotfish.io import atomic_file, make_folder, path_exists, read_file
from pilotfish.types import Array, Float, Int

PACKAGE = "example-robot-data"
FOLDER = "cmeel.prefix/share/example-robot-data/robots/baxter_description/meshes"
MAX_FACES_BY_PART = {"torso": 4500}  # triangles of a part
MAX_FACES, MIN_FACES = 1500, 60  # triangles of the other parts, and minimum of each colour
CACHE_VERSION = 1  # increase it when meshes are simplified differently: cached files are then ignored
DEFAULT_COLOUR = (0.25, 0.25, 0.26)
GAMMA = 1.5  # chosen: the package has linear colours, which would be too dark on a screen
SIMPLIFICATION_AGGRESSIVENESS = 3  # of 10
VERTEX_MERGE_DIGITS = 4  # vertices that agree to this many digits of a metre are merged
DIGEST = 32  # bytes of the SHA-256 at the start of a cached file
MAX_CACHE_BYTES = 2**26
FIELDS = ("vertices", "faces", "rgba")
ORIGIN = (0.0, 0.0, 0.0)

# Part, position [m] and roll, pitch, yaw [rad] of each file, from the package's URDF; the head looks ahead.
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

# Name of the faces of a mesh in a cached file: number of the mesh, then its part.
FACES_OF = re.compile(
    rf"[0-9]{{1,4}}\.({'|'.join(sorted({part for part, _, _ in MESH_PLACEMENTS.values()}))})\.faces"
)


def baxter_meshes() -> tuple[VisualMesh, ...]:
    """Return visual meshes of Baxter from the user's cache, or simplify the package's meshes and cache them.

    Raises:
        SkillError: If the package, or a library that reads its meshes, is not installed.
        InvalidInput: If the cache cannot be written.
    """
    try:
        package = metadata.distribution(PACKAGE)
    except metadata.PackageNotFoundError as error:
        raise SkillError(_install_hint(PACKAGE)) from error
    file = cache_folder() / f"baxter-{package.version}-{MAX_FACES}-{CACHE_VERSION}.meshes"
    if (found := _read_cache(file)) is None:
        found = tuple(_convert_meshes(Path(str(package.locate_file(FOLDER)))))
        _write_cache(found, file)
    return found


def cache_folder() -> Path:
    """Return pilotfish's folder in the user's cache.

    Raises:
        SkillError: If the user has no home folder.
    """
    from platformdirs import user_cache_path

    folder = user_cache_path("pilotfish", appauthor=False)
    if not folder.is_absolute():
        raise SkillError(f"the cache folder is {folder}, expected an absolute path; set XDG_CACHE_HOME")
    return folder


def _install_hint(name: str) -> str:
    return f"the meshes of Baxter need {name}: pip install '.[meshes]' in the clone"


def _convert_meshes(folder: Path) -> Iterator[VisualMesh]:
    try:
        import collada  # noqa: F401 # trimesh reads these files with it
        import fast_simplification  # noqa: F401
        import trimesh
    except ImportError as error:
        raise SkillError(_install_hint(error.name or str(error))) from error
    for name, (part, place, turn) in MESH_PLACEMENTS.items():
        file = folder / f"{name}.DAE"
        if not path_exists(file):
            raise SkillError(f"{PACKAGE} has no {file}; install the version of 'pilotfish[meshes]'")
        pieces = trimesh.load_scene(file).dump()
        total = sum(len(piece.faces) for piece in pieces)
        placement = trimesh.transformations.compose_matrix(translate=place, angles=turn)
        for piece in pieces:
            piece.apply_transform(placement)
            n_faces = max(MAX_FACES_BY_PART.get(part, MAX_FACES) * len(piece.faces) // total, MIN_FACES)
            yield VisualMesh(part, *_simplify_mesh(piece, n_faces), _colour(piece))


def _simplify_mesh(piece: Any, n_faces: int) -> tuple[Float[Array, "V 3"], Int[Array, "F 3"]]:
    """Return vertices and faces of a similar surface with about n_faces faces."""
    import fast_simplification

    # Without merged vertices, simplification tears the surface.
    piece.merge_vertices(merge_tex=True, merge_norm=True, digits_vertex=VERTEX_MERGE_DIGITS)
    vertices, faces = np.asarray(piece.vertices, np.float32), np.asarray(piece.faces, np.int32)
    if len(faces) > n_faces:
        vertices, faces = fast_simplification.simplify(
            vertices, faces, target_count=n_faces, agg=SIMPLIFICATION_AGGRESSIVENESS
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
    """Return the meshes of a cached file; None if it is missing, damaged or too large."""
    try:
        data = read_file(file, "meshes", MAX_CACHE_BYTES)
    except InvalidInput:
        return None
    digest, content = data[:DIGEST], data[DIGEST:]
    return _decode_meshes(content) if sha256(content).digest() == digest else None


def _decode_meshes(content: bytes) -> tuple[VisualMesh, ...] | None:
    """Return the meshes in the bytes of a safetensors file; None if it contains anything else."""
    from safetensors import SafetensorError
    from safetensors.numpy import load

    try:
        arrays = load(content)
    except (SafetensorError, ValueError):  # ValueError: an impossible shape
        return None
    names = [name.removesuffix(".faces") for name in arrays if FACES_OF.fullmatch(name)]
    names.sort(key=lambda name: int(name.split(".")[0]))
    if set(arrays) != {f"{name}.{field}" for name in names for field in FIELDS}:
        return None
    visual_meshes = [_decode_mesh(name, *(arrays[f"{name}.{field}"] for field in FIELDS)) for name in names]
    valid = [mesh for mesh in visual_meshes if mesh is not None]
    return tuple(valid) if len(valid) == len(visual_meshes) else None


def _decode_mesh(name: str, vertices: Array, faces: Array, rgba: Array) -> VisualMesh | None:
    """Return a mesh if its numbers are finite and its faces have vertices; None otherwise."""
    shapes = vertices.shape[1:] == faces.shape[1:] == (3,) and rgba.shape == (4,)
    kinds = vertices.dtype == rgba.dtype == np.float64 and faces.dtype == np.int32
    if not shapes or not kinds or not np.isfinite(vertices).all() or not np.isfinite(rgba).all():
        return None
    if not faces.size or faces.min() < 0 or faces.max() >= len(vertices):
        return None
    red, green, blue, alpha = rgba.tolist()
    return VisualMesh(name.split(".")[1], vertices, faces, (red, green, blue, alpha))
