"""The looks of the real robot are made once, kept whole, and made anew when damaged or out of date."""

import sys
from hashlib import sha256
from importlib import metadata
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from safetensors.numpy import save

from pilotfish.environments import VisualMesh
from pilotfish.errors import InvalidInput, SkillError
from pilotfish.simulation import meshes
from pilotfish.simulation.meshes import baxter_meshes

EXTRA = r"pip install 'pilotfish\[meshes\]'"


def invented(rng: np.random.Generator, count: int) -> tuple[VisualMesh, ...]:
    return tuple(
        VisualMesh(
            rng.choice(["torso", "s0", "w2"]),
            rng.normal(size=(V, 3)),
            rng.integers(V, size=(2 * V, 3), dtype=np.int32),
            tuple(rng.uniform(size=4).tolist()),
        )
        for V in rng.integers(3, 50, size=count)
    )


def same(one: tuple[VisualMesh, ...], other: tuple[VisualMesh, ...]) -> bool:
    return len(one) == len(other) and all(
        a.part == b.part
        and a.rgba == b.rgba
        and np.array_equal(a.vertices, b.vertices)
        and np.array_equal(a.faces, b.faces)
        for a, b in zip(one, other, strict=True)
    )


@pytest.fixture
def made(rng: np.random.Generator, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """A package of a version, what is made of it, and how often it was made; the cache is a folder apart."""
    package = SimpleNamespace(version="1.0", visual_meshes=invented(rng, 12), times=0)
    package.locate_file = lambda folder: tmp_path / folder

    def make(folder: Path) -> tuple[VisualMesh, ...]:
        package.times += 1
        return package.surfaces

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(meshes.metadata, "distribution", lambda name: package)
    monkeypatch.setattr(meshes, "_convert_meshes", make)
    return package


def test_surfaces_are_made_once(made: SimpleNamespace):
    """The second time they come from the cache, the same bit for bit and in order, more than ten too."""
    assert same(baxter_meshes(), made.surfaces)
    assert same(baxter_meshes(), made.surfaces)
    assert made.times == 1


def test_another_package_is_another_look(made: SimpleNamespace, rng: np.random.Generator):
    """A new version of the package makes surfaces anew, and the old one still has its own."""
    first = made.surfaces
    baxter_meshes()
    made.version, made.surfaces = "2.0", invented(rng, 3)
    assert same(baxter_meshes(), made.surfaces)
    made.version = "1.0"
    assert same(baxter_meshes(), first)
    assert made.times == 2


@pytest.mark.parametrize("damage", ["cut", "changed", "empty"])
def test_what_is_damaged_is_made_anew(made: SimpleNamespace, tmp_path: Path, damage: str):
    """A file that is cut, changed by one bit or empty is never read as surfaces."""
    baxter_meshes()
    (file,) = (tmp_path / "cache" / "pilotfish").iterdir()
    whole = file.read_bytes()
    changed = bytearray(whole)
    changed[len(whole) // 2] ^= 1
    file.write_bytes({"cut": whole[:-7], "changed": bytes(changed), "empty": b""}[damage])
    assert same(baxter_meshes(), made.surfaces)
    assert made.times == 2
    assert file.read_bytes() == whole


FORGED = {
    "no safetensors": b"nothing",
    "another name": {"A0": np.zeros(2)},
    "no number in a name": {f"x.torso.{field}": np.zeros(3) for field in ("vertices", "faces", "rgba")},
    "an unknown part": {"0.tail.vertices": np.zeros((3, 3))},
    "faces missing": {"0.torso.vertices": np.zeros((3, 3)), "0.torso.rgba": np.ones(4)},
    "faces beyond the vertices": {"0.torso.faces": np.full((1, 3), 3, dtype=np.int32)},
    "negative faces": {"0.torso.faces": np.full((1, 3), -1, dtype=np.int32)},
    "faces as floats": {"0.torso.faces": np.zeros((1, 3))},
    "no faces": {"0.torso.faces": np.zeros((0, 3), dtype=np.int32)},
    "vertices that are not finite": {"0.torso.vertices": np.full((3, 3), np.inf)},
    "vertices in a plane": {"0.torso.vertices": np.zeros((3, 2))},
    "a colour that is not finite": {"0.torso.rgba": np.full(4, np.nan)},
    "a colour without alpha": {"0.torso.rgba": np.ones(3)},
}


@pytest.mark.parametrize("forged", FORGED)
def test_cache_of_other_content_with_the_right_hash_is_made_anew(
    made: SimpleNamespace, tmp_path: Path, forged: str
) -> None:
    """The hash tells that a file is whole, not that this program wrote it."""
    baxter_meshes()
    (file,) = (tmp_path / "cache" / "pilotfish").iterdir()
    right = {
        "0.torso.vertices": np.zeros((3, 3)),
        "0.torso.faces": np.array([[0, 1, 2]], dtype=np.int32),
        "0.torso.rgba": np.ones(4),
    }
    given = FORGED[forged]
    missing = {"0.torso.faces"} if forged == "faces missing" else set()
    arrays = {k: v for k, v in right.items() if k not in missing}
    content = given if isinstance(given, bytes) else save(arrays | given)
    file.write_bytes(sha256(content).digest() + content)
    assert same(baxter_meshes(), made.surfaces)
    assert made.times == 2


def test_a_cache_that_cannot_be_written_is_told(
    made: SimpleNamespace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """The refusal names the variable to set."""
    (tmp_path / "file").write_text("no folder")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    with pytest.raises(InvalidInput, match="set XDG_CACHE_HOME to another folder"):
        baxter_meshes()


def test_without_the_package_the_extra_is_named(monkeypatch: pytest.MonkeyPatch):
    """The refusal tells how to install it."""

    def none(name: str) -> None:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(meshes.metadata, "distribution", none)
    with pytest.raises(SkillError, match=f"need example-robot-data: {EXTRA}"):
        baxter_meshes()


@pytest.mark.parametrize("name", ["trimesh", "collada", "fast_simplification"])
def test_without_a_reader_the_extra_is_named(name: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    """What reads and thins meshes is part of the extra."""
    for module in ("trimesh", "collada", "fast_simplification"):
        monkeypatch.setitem(sys.modules, module, None if module == name else SimpleNamespace())
    with pytest.raises(SkillError, match=f"need {name}: {EXTRA}"):
        list(meshes._convert_meshes(tmp_path))


def test_the_package_is_worn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Every part of the robot has surfaces that are as large as it, and few faces."""
    for module in ("trimesh", "collada", "fast_simplification"):
        pytest.importorskip(module, reason="pilotfish[meshes] is not installed")
    try:
        metadata.distribution(meshes.PACKAGE)
    except metadata.PackageNotFoundError:
        pytest.skip("pilotfish[meshes] is not installed")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    found = baxter_meshes()
    assert {mesh.part for mesh in found} == {part for part, _, _ in meshes.MESH_PLACEMENTS.values()}
    assert sum(len(mesh.faces) for mesh in found) < 50_000
    for part in {mesh.part for mesh in found}:
        corners = np.concatenate([mesh.vertices for mesh in found if mesh.part == part])
        assert 0.05 < np.ptp(corners, axis=0).max() < (1.2 if part == "torso" else 0.5), part
    assert same(baxter_meshes(), found)
    (file,) = (tmp_path / "pilotfish").iterdir()
    assert file.stat().st_size < 2_000_000
