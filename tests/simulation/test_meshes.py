"""Visual meshes are converted once, cached, and converted again if the cache is damaged or outdated."""

import sys
from hashlib import sha256
from importlib import metadata
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from safetensors.numpy import save

from pilotfish.environments.baxter import VisualMesh
from pilotfish.errors import InvalidInput, SkillError
from pilotfish.simulation import meshes
from pilotfish.simulation.meshes import baxter_meshes

EXTRA = r"pip install '.\[meshes\]' in the clone"


def random_meshes(rng: np.random.Generator, count: int) -> tuple[VisualMesh, ...]:
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
def package(rng: np.random.Generator, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """Return a fake package with its meshes and the number of conversions; the cache is in tmp_path."""
    fake = SimpleNamespace(version="1.0", visual_meshes=random_meshes(rng, 12), times=0)
    fake.locate_file = lambda folder: tmp_path / folder

    def convert(folder: Path) -> tuple[VisualMesh, ...]:
        fake.times += 1
        return fake.visual_meshes

    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(meshes.metadata, "distribution", lambda name: fake)
    monkeypatch.setattr(meshes, "_convert_meshes", convert)
    return fake


def test_baxter_meshes_second_call_uses_cache(package: SimpleNamespace):
    assert same(baxter_meshes(), package.visual_meshes)
    assert same(baxter_meshes(), package.visual_meshes)
    assert package.times == 1


def test_baxter_meshes_other_package_is_converted_again(package: SimpleNamespace, rng: np.random.Generator):
    first = package.visual_meshes
    baxter_meshes()
    package.version, package.visual_meshes = "2.0", random_meshes(rng, 3)
    assert same(baxter_meshes(), package.visual_meshes)
    package.version = "1.0"
    assert same(baxter_meshes(), first)
    assert package.times == 2


@pytest.mark.parametrize("damage", ["cut", "changed", "empty"])
def test_baxter_meshes_damaged_cache_is_replaced(package: SimpleNamespace, tmp_path: Path, damage: str):
    baxter_meshes()
    (file,) = (tmp_path / "cache" / "pilotfish").iterdir()
    whole = file.read_bytes()
    changed = bytearray(whole)
    changed[len(whole) // 2] ^= 1
    file.write_bytes({"cut": whole[:-7], "changed": bytes(changed), "empty": b""}[damage])
    assert same(baxter_meshes(), package.visual_meshes)
    assert package.times == 2
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
def test_baxter_meshes_cache_of_other_content_is_replaced(
    package: SimpleNamespace, tmp_path: Path, forged: str
) -> None:
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
    assert same(baxter_meshes(), package.visual_meshes)
    assert package.times == 2


def test_baxter_meshes_unwritable_cache_is_refused(
    package: SimpleNamespace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    (tmp_path / "file").write_text("no folder")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    with pytest.raises(InvalidInput, match="set XDG_CACHE_HOME to another folder"):
        baxter_meshes()


def test_baxter_meshes_missing_package_names_extra(monkeypatch: pytest.MonkeyPatch):
    def none(name: str) -> None:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(meshes.metadata, "distribution", none)
    with pytest.raises(SkillError, match=f"need example-robot-data: {EXTRA}"):
        baxter_meshes()


@pytest.mark.parametrize("name", ["trimesh", "collada", "fast_simplification"])
def test_baxter_meshes_missing_reader_names_extra(name: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path):
    for module in ("trimesh", "collada", "fast_simplification"):
        monkeypatch.setitem(sys.modules, module, None if module == name else SimpleNamespace())
    with pytest.raises(SkillError, match=f"need {name}: {EXTRA}"):
        list(meshes._convert_meshes(tmp_path))


def test_baxter_meshes_installed_package_is_complete(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
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
