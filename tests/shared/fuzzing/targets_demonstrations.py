"""Targets of demonstrations: manifests, tables, folders and published files."""

import io
import json
from collections.abc import Callable
from pathlib import Path
from random import Random
from tempfile import mkdtemp
from typing import Any

import numpy as np

from fuzzing.edits import edit_tree, json_text, short_text, toml_text
from fuzzing.edits_of_arrays import edit_array
from fuzzing.edits_of_text import edit_bytes
from fuzzing.seeds import gripper_demonstrations, lines, valve_demonstrations
from fuzzing.soundness import require_sound, use_demonstrations
from fuzzing.target import Target
from pilotfish import datasets
from pilotfish import io as pilotfish_io
from pilotfish.demonstrations import Demonstration, demonstration, moving_frame
from pilotfish.io.demonstration_tables import decode_csv, decode_npz, encode_csv
from pilotfish.io.manifest import manifest_hash, parse_manifest
from pilotfish.types import Array

MAX_SIZE = 2**20
CorruptedBytes = tuple[Any, tuple[int, ...]]  # a value, and the seeds of damage to its bytes


def _sound(value: Any, thorough: bool) -> None:
    require_sound(value)


def corrupted(data: bytes, seeds: tuple[int, ...]) -> bytes:
    """Return the first MAX_SIZE bytes with edits; time may grow with the size of a file."""
    data = data[:MAX_SIZE]
    for seed in seeds:
        data, _ = edit_bytes(data, Random(seed))
    return data


def edit_or_corrupt(edit: Callable[[Any, Random], tuple[Any, str]], share: float = 0.15):  # type: ignore[no-untyped-def]
    """Return an edit that sometimes corrupts the written bytes instead."""

    def either(value: CorruptedBytes, rng: Random) -> tuple[CorruptedBytes, str]:
        inner, seeds = value
        if rng.random() < share:
            seed = rng.getrandbits(32)
            return (inner, (*seeds, seed)), f"damage {seed}"
        edited, said = edit(inner, rng)
        return (edited, seeds), said

    return either


# ---------------------------------------------------------------------------------------------- manifests


def _manifest_trees() -> list[Any]:
    """Return manifests with frames by pose, by matrix and by array names, with and without a checksum."""
    place = Path(mkdtemp(prefix="fuzz-"))
    trees = []
    for n, demos in enumerate((valve_demonstrations(), lines(), gripper_demonstrations())):
        pilotfish_io.write_demonstrations(demos, place / str(n))
        trees.append(json.loads((place / str(n) / "demonstrations.json").read_text()))
    posed = json.loads(json.dumps(trees[0]))
    posed.pop("sha256")
    for entry in posed["demonstration"]:
        entry.pop("sha256")
        entry["frames"] = [{"name": "cup", "position": [0.1, 0.2, 0.3], "quaternion": [1.0, 0.0, 0.0, 0.0]}]
    keyed = json.loads(json.dumps(posed))
    for entry in keyed["demonstration"]:
        entry["file"] = entry["file"].replace(".csv", ".npz")
        entry["frames"] = [{"name": "cup", "A": "A0", "b": "b0"}]
    return [*trees, posed, keyed]


def _signed(tree: Any) -> Any:
    if isinstance(tree, dict) and "sha256" in tree:
        try:
            return {**tree, "sha256": manifest_hash(json.loads(json_text(tree)))}
        except (ValueError, RecursionError, TypeError):
            return tree
    return tree


def _manifests(ending: str, text: Callable[[Any], str]) -> Callable[[], Target]:
    def make() -> Target:
        def write(value: CorruptedBytes) -> bytes:
            return corrupted(text(_signed(value[0])).encode("utf-8", "surrogatepass"), value[1])

        def read(data: bytes) -> Any:
            return parse_manifest(data, f"demonstrations.{ending}")

        bases = [(tree, ()) for tree in _manifest_trees()]
        return Target(bases, edit_or_corrupt(edit_tree), write, read, _sound)

    return make


# ---------------------------------------------------------------------------------------------- tables


def _csv() -> Target:
    demos = (*valve_demonstrations(), *gripper_demonstrations())
    bases = [(encode_csv(demo.x, demo.layout.names), demo.layout.names) for demo in demos]

    def edit(value: Any, rng: Random) -> tuple[Any, str]:
        data, said = edit_bytes(value[0], rng)
        return (data, value[1]), said

    def read(value: Any) -> Any:
        return decode_csv(value[0], "x.csv", value[1], 0.1)

    return Target(bases, edit, lambda value: value, read, _sound)


Arrays = dict[str, Array]


def edit_arrays(arrays: Arrays, rng: Random) -> tuple[Arrays, str]:
    """Edit an array, or the set of arrays."""
    name = rng.choice(list(arrays)) if arrays else "x"
    if not arrays or rng.random() < 0.15:
        other = rng.choice(("", "x", "A0", "x" * 300, "a\nb", "../y", "x.npy", "\udcff"))
        if rng.random() < 0.4:
            return {k: v for k, v in arrays.items() if k != name}, f"without {name!r}"
        return {**arrays, other: arrays.get(name, np.zeros(2))}, f"with {short_text(other)} like {name!r}"
    edited, said = edit_array(arrays[name], rng)
    return {**arrays, name: edited}, f"{name}: {said}"


def npz(arrays: Arrays, packed: bool) -> bytes:
    out = io.BytesIO()
    named = {name.encode("utf-8", "replace").decode(): array for name, array in arrays.items()}
    (np.savez_compressed if packed else np.savez)(out, **named)
    return out.getvalue()


def _write_npz(value: CorruptedBytes) -> bytes:
    data = npz(value[0], len(value[1]) % 2 == 1)
    return corrupted(data, value[1])


def _npz() -> Target:
    demo = valve_demonstrations()[0]
    arrays = {"x": demo.x, "A0": np.stack([demo.frames[0].A] * 3), "b0": np.zeros((3, 7))}

    def read(data: bytes) -> Any:
        return decode_npz(data, "x.npz")

    def use(value: Any, thorough: bool) -> None:
        require_sound({name: array.shape for name, array in value.items()})

    return Target([(arrays, ())], edit_or_corrupt(edit_arrays, 0.4), _write_npz, read, use)


# ---------------------------------------------------------------------------------------------- folders


def _folder() -> Target:
    """Return a target of folders: a JSON manifest and the files that it names."""
    place, bases = Path(mkdtemp(prefix="fuzz-")), []
    for n, demos in enumerate((valve_demonstrations()[:2], lines()[:2], _moving())):
        pilotfish_io.write_demonstrations(demos, place / str(n))
        files = {file.name: file.read_bytes() for file in (place / str(n)).iterdir()}
        manifest = json.loads(files.pop("demonstrations.json"))
        manifest.pop("sha256")
        for entry in manifest["demonstration"]:
            entry.pop("sha256")
        bases.append((manifest, files))
    there = place / "there"
    there.mkdir()

    def edit(value: Any, rng: Random) -> tuple[Any, str]:
        manifest, files = value
        if rng.random() < 0.5:
            edited, said = edit_tree(manifest, rng)
            return (edited, files), said
        name = rng.choice(list(files))
        data, said = edit_bytes(files[name], rng)
        return (manifest, {**files, name: data}), f"{name}: {said}"

    def write(value: Any) -> Path:
        manifest, files = value
        for old in there.iterdir():
            old.unlink()
        for name, data in files.items():
            (there / name).write_bytes(data)
        (there / "demonstrations.json").write_text(json_text(manifest))
        return there

    return Target(bases, edit, write, pilotfish_io.read_demonstrations, use_demonstrations)


def _moving() -> list[Demonstration]:
    """Return one demonstration with a moving frame."""
    demo = valve_demonstrations()[0]
    A = np.stack([demo.frames[0].A] * len(demo.x))
    b = np.stack([demo.frames[0].b] * len(demo.x))
    frames = [moving_frame("hand", A, b)]
    return [demonstration(demo.x, demo.period, demo.layout, frames, "moving")]


# ---------------------------------------------------------------------------------------------- published


def _file_target(
    bases: list[Any], write: Callable[[Any], bytes], read: Callable[[Path], Any], edit: Any, use: Any = None
) -> Target:
    """Return a target of a decoder that takes the path of a file."""
    file = Path(mkdtemp(prefix="fuzz-")) / "file"

    def write_file(value: Any) -> Path:
        file.write_bytes(write(value))
        return file

    return Target(bases, edit, write_file, read, use or use_demonstrations)


def _mat(value: CorruptedBytes) -> bytes:
    from scipy.io import savemat

    out = io.BytesIO()
    try:
        savemat(out, value[0], do_compression=len(value[1]) % 2 == 1)
    except (TypeError, ValueError, OverflowError):  # what no MATLAB file holds
        out = io.BytesIO()
    return corrupted(out.getvalue(), value[1])


def _edit_mat(tree: Any, rng: Random) -> tuple[Any, str]:
    """Edit an array in nested dicts and lists, or its container."""
    if isinstance(tree, dict) and tree and rng.random() < 0.95:
        key = rng.choice(list(tree))
        edited, said = _edit_mat(tree[key], rng)
        return {**tree, key: edited}, f".{key}{said}"
    if isinstance(tree, list) and tree and rng.random() < 0.9:
        n = rng.randrange(len(tree))
        edited, said = _edit_mat(tree[n], rng)
        return [*tree[:n], edited, *tree[n + 1 :]], f"[{n}]{said}"
    if isinstance(tree, np.ndarray):
        return edit_array(tree, rng)
    if isinstance(tree, list):
        return tree[: rng.randint(0, len(tree))], " cut"
    return rng.choice((np.zeros(3), {}, {"A": np.eye(2)}, "text", np.array(["a"], dtype=object))), " other"


def _cells(tree: Any) -> Any:
    """Convert lists to cells of MATLAB."""
    if isinstance(tree, dict):
        return {key: _cells(item) for key, item in tree.items()}
    if isinstance(tree, list):
        cells = np.empty(len(tree), dtype=object)
        for n, item in enumerate(tree):
            cells[n] = _cells(item)
        return cells
    return tree


def _valve_mat() -> Target:
    demo = valve_demonstrations()[0]
    data = np.hstack([np.arange(float(len(demo.x)))[:, None], demo.x]).T
    A, b = np.eye(15), np.zeros(15)
    record = {"Data0": data, "dData0": data[1:] * 0.1, "p": [{"A": A, "b": b}, {"A": A, "b": b + 0.1}]}
    bases = [({"s": [record] * 8}, ())]

    def write(value: CorruptedBytes) -> bytes:
        return _mat((_cells(value[0]) if isinstance(value[0], dict) else {"s": value[0]}, value[1]))

    return _file_target(bases, write, datasets.read_valve_mat, edit_or_corrupt(_edit_mat, 0.3))


def _zshape_mat() -> Target:
    data = np.vstack([np.arange(1500.0), np.random.default_rng(0).normal(size=(3, 1500))])

    def write(value: CorruptedBytes) -> bytes:
        return _mat((_cells(value[0]) if isinstance(value[0], dict) else {"Data": value[0]}, value[1]))

    return _file_target(
        [({"Data": data}, ())], write, datasets.read_zshape_mat, edit_or_corrupt(_edit_mat, 0.3)
    )


def _npy(read: Callable[[Path], Any], array: Array) -> Callable[[], Target]:
    def write(value: CorruptedBytes) -> bytes:
        out = io.BytesIO()
        np.save(out, value[0], allow_pickle=False)
        return corrupted(out.getvalue(), value[1])

    def make() -> Target:
        return _file_target([(array, ())], write, read, edit_or_corrupt(edit_array, 0.4))

    return make


def _extract(
    read: Callable[[Path], Any], arrays: Callable[[], Arrays], use: Any = None
) -> Callable[[], Target]:
    def make() -> Target:
        return _file_target([(arrays(), ())], _write_npz, read, edit_or_corrupt(edit_arrays, 0.4), use)

    return make


def _chicken() -> Arrays:
    x = np.random.default_rng(0).normal(size=(20, 4, 3))
    return {"node_pos": x, "node_names": np.array(["hip", "knee", "foot", "toe"]), "fs_hz": np.array(120.0)}


def _mocap() -> Arrays:
    x = np.random.default_rng(0).normal(size=(2, 15, 12))
    return {"x0": x[0], "x1": x[1], "label0": np.arange(15) % 3 + 1, "label1": np.ones(15, dtype=np.int64)}


def _letters() -> Arrays:
    x = np.random.default_rng(0).normal(size=(2, 15, 3))
    return {"A_0": x[0], "B_1": x[1]}


def _tasks() -> Array:
    demo = valve_demonstrations()[0]
    return np.stack([demo.x * ([100.0] * 3 + [1.0] * 4)] * 2)


TARGETS: dict[str, tuple[Callable[[], Target], float]] = {
    "manifest.json": (_manifests("json", json_text), 4.0),
    "manifest.toml": (_manifests("toml", toml_text), 2.0),
    "csv": (_csv, 4.0),
    "npz": (_npz, 2.0),
    "folder": (_folder, 1.5),
    "valve.mat": (_valve_mat, 0.3),
    "zshape.mat": (_zshape_mat, 0.5),
    "robotasks.npy": (lambda: _npy(datasets.read_robotasks_npy, _tasks())(), 0.7),
    "helloworld.npy": (
        _npy(datasets.read_helloworld_npy, np.random.default_rng(0).normal(size=(2, 9, 2))),
        0.7,
    ),
    "chicken.npz": (_extract(datasets.read_chicken_dance_npz, _chicken), 0.7),
    "mocap.npz": (_extract(datasets.read_mocap6_npz, _mocap), 0.7),
    "labels.npz": (_extract(datasets.read_mocap6_labels_npz, _mocap, _sound), 0.5),
    "letters.npz": (_extract(datasets.read_letters_npz, _letters), 0.7),
}
