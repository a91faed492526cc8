"""Demonstrations and published files that need much memory or time, or have text that cannot be printed."""

import io
import json
import os
import struct
import zipfile
import zlib
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import pytest
from scipy.io import savemat

from pilotfish.demonstrations import (
    Layout,
    Part,
    Quantity,
    demonstration,
    diagnose,
    frame,
    position_layout,
)
from pilotfish.errors import MAX_MESSAGE_LENGTH, InvalidInput
from pilotfish.io.demonstration_folder import read_demonstrations
from pilotfish.io.demonstration_tables import MAX_ARRAYS, decode_npz, load_npz
from pilotfish.io.manifest import parse_manifest
from pilotfish.io.published_matlab import read_valve_mat, read_zshape_mat
from pilotfish.io.published_npy import read_robotasks_npy
from pilotfish.io.published_npz import read_chicken_dance_npz

QUICK = 2.0  # s of CPU time
CONTROL = ["\ud800", "\x1b[2J", "a\nb", "\u202e", "n" * 201]
PART = {"name": "position", "quantity": "position", "size": 2, "unit": "m"}
CSV = "position x,position y\n0,1\n2,3.5\n"


def manifest(**changes: Any) -> dict[str, Any]:
    content = {
        "format": "pilotfish demonstrations",
        "version": 1,
        "period": 0.5,
        "layout": [dict(PART)],
        "demonstration": [{"file": "a.csv"}],
    }
    return content | changes


def refused(content: dict[str, Any], message: str) -> None:
    """Assert that parsing the manifest raises one short line in little CPU time."""
    data, begin = json.dumps(content).encode(), process_time()
    with pytest.raises(InvalidInput, match=message) as caught:
        parse_manifest(data, "demonstrations.json")
    assert process_time() - begin < QUICK
    assert len(str(caught.value)) <= MAX_MESSAGE_LENGTH
    assert str(caught.value).isprintable()


@pytest.mark.parametrize(
    ("part", "message"),
    [
        (
            {"size": 10**8},
            "layout 0: the size of part 'position' is 100000000, expected a whole number from 1 to 10000",
        ),
        ({"size": 10**400}, "layout 0: size is a whole number of 1329 bits"),
        (
            {"derivative": 10**10},
            "layout 0: the derivative of part 'position' is 10000000000, expected a whole number from 0 to 9",
        ),
        ({"derivative": 10**19}, "layout 0: derivative is"),
        ({"size": 9999, "quantity": "scalar"}, ""),
    ],
    ids=["size", "digits", "prime marks", "overflow", "wide"],
)
def test_parse_manifest_layout_out_of_bounds_raises(part: dict[str, Any], message: str) -> None:
    content = manifest(layout=[{**PART, **part}, {**PART, "name": "other"}])
    refused(content, message or "columns of the layout is 10001, expected a whole number from 0 to 10000")


@pytest.mark.parametrize(
    "frames",
    [
        [{"name": "cup", "position": [0, 0, 0], "quaternion": [1, 0, 0, 0]}],
        [{"name": "cup", "A": "A", "b": "b"}],
        [],
    ],
    ids=["pose", "arrays", "world"],
)
def test_parse_manifest_too_many_frame_entries_raise(frames: list[dict[str, Any]]) -> None:
    layout = [{"name": "wide", "quantity": "scalar", "size": 9000, "unit": "1"}]
    listed = [{"file": "a.csv", "frames": frames}]
    refused(manifest(layout=layout, demonstration=listed), "1 frames of 9000 columns have 81000000 numbers")


@pytest.mark.parametrize("text", CONTROL, ids=ascii)
@pytest.mark.parametrize(
    "changes",
    [
        lambda text: {"layout": [{**PART, "name": text}]},
        lambda text: {"layout": [{**PART, "unit": text}]},
        lambda text: {"demonstration": [{"file": "a.csv", "name": text}]},
        lambda text: {"demonstration": [{"file": f"{text}.csv"}]},
        lambda text: {"demonstration": [{"file": "a.csv", "sha256": text}]},
        lambda text: {"demonstration": [{"file": "a.npz", "frames": [{"name": text, "A": "A", "b": "b"}]}]},
        lambda text: {"demonstration": [{"file": "a.npz", "frames": [{"name": "cup", "A": text, "b": "b"}]}]},
        lambda text: {"demonstration": [{"file": "a.npz", "frames": [{"name": "cup", "A": "A", "b": text}]}]},
        lambda text: {text: 1},
        lambda text: {"format": text},
        lambda text: {"sha256": text},
    ],
    ids=["part", "unit", "name", "file", "sha256", "frame", "A", "b", "key", "format", "own sha256"],
)
def test_parse_manifest_unprintable_text_raises(changes: Any, text: str) -> None:
    refused(manifest(**changes(text)), r"demonstrations\.json")


@pytest.mark.parametrize("text", CONTROL, ids=ascii)
def test_constructors_unprintable_text_raises(text: str) -> None:
    x = np.zeros((3, 2)) + np.arange(3.0)[:, None]
    for make in (
        lambda: Part(text, Quantity.SCALAR, 1, "1"),
        lambda: Part("a", Quantity.SCALAR, 1, text),
        lambda: frame(text, np.eye(2), np.zeros(2)),
        lambda: demonstration(x, 0.1, position_layout(2), name=text),
    ):
        with pytest.raises(InvalidInput, match=r"expected (printable|at most)"):
            make()


@pytest.mark.parametrize(
    "key", ["period", "version", "size", "derivative", "name", "quantity", "file", "extra"]
)
def test_read_demonstrations_toml_number_of_5000_digits_raises(manual_folder: Path, key: str) -> None:
    file, huge = manual_folder / "demonstrations.toml", "0x1" + 5000 * "0"
    text = file.read_text()
    lines = [f"{key} = {huge}" if line.startswith(f"{key} = ") else line for line in text.splitlines()]
    if key == "derivative":
        lines.insert(lines.index('unit = "m"'), f"derivative = {huge}")
    if key == "extra":
        lines.insert(1, f"extra = [{huge}]\nsha256 = ''")
    file.write_text("\n".join(lines))
    with pytest.raises(InvalidInput, match=r"demonstrations\.toml"):
        read_demonstrations(manual_folder)


@pytest.mark.parametrize("number", ["1" + 400 * "0", "0x1" + 5000 * "0"], ids=["overflow", "digits"])
@pytest.mark.parametrize(
    "frame_text",
    [
        "A = [[1, 0], [0, NUMBER]], b = [0.5, 0]",
        "A = [[1, 0], [0, 1]], b = [NUMBER, 0]",
        "position = [NUMBER, 0, 0], quaternion = [1, 0, 0, 0]",
        "position = [0, 0, 0], quaternion = [NUMBER, 0, 0, 0]",
    ],
    ids=["A", "b", "position", "quaternion"],
)
def test_read_demonstrations_frame_number_beyond_float_raises(
    manual_folder: Path, frame_text: str, number: str
) -> None:
    file = manual_folder / "demonstrations.toml"
    old = "A = [[1, 0], [0, 2]], b = [0.5, 0]"
    file.write_text(file.read_text().replace(old, frame_text.replace("NUMBER", number), 1))
    with pytest.raises(InvalidInput, match="demonstration 0, frame 0: "):
        read_demonstrations(manual_folder)


def test_parse_manifest_deeply_nested_tables_raise() -> None:
    data = b"format = 'pilotfish demonstrations'\nversion = 1\nperiod = 1\nlayout = []\nsha256 = ''\n"
    data += b"demonstration" + b".a" * 5000 + b" = 1\n"
    with pytest.raises(InvalidInput, match="sha256 cannot be checked"):
        parse_manifest(data, "demonstrations.toml")


def test_parse_manifest_thousands_of_names_take_linear_time() -> None:
    names = [f"n{n}" for n in range(20_000)]
    refused(manifest(**dict.fromkeys(names, 0)), "unknown key 'n0'")
    twice = json.dumps(manifest())[:-1] + "".join(f', "{name}": 0' for name in names) + ', "n0": 0}'
    begin = process_time()
    with pytest.raises(InvalidInput, match="key 'n0' is given more than once"):
        parse_manifest(twice.encode(), "demonstrations.json")
    frames = [{"name": name, "A": "A", "b": "b"} for name in names[:10_000]]
    files = [{"file": f"{name}.csv"} for name in names[:9_999]] + [{"file": "n0.csv"}]
    for listed in ([{"file": "a.npz", "frames": [*frames, frames[0]]}], files):
        with pytest.raises(InvalidInput, match=r"are named|named more than once"):
            parse_manifest(json.dumps(manifest(demonstration=listed)).encode(), "demonstrations.json")
    with pytest.raises(InvalidInput, match="more than once"):
        Layout(tuple(Part(name, Quantity.SCALAR, 1, "1") for name in [*names[:9_999], "n0"]))
    assert process_time() - begin < 4 * QUICK


def test_diagnose_thousands_of_demonstrations_takes_linear_time() -> None:
    layout = position_layout(2)
    made = [demonstration([[m, 0.0], [m, 1.0]], 0.1, layout) for m in range(3000)]
    begin = process_time()
    found = [finding for finding in diagnose([*made, made[7], made[7]]) if "same rows" in finding.message]
    assert process_time() - begin < 4 * QUICK
    assert [finding.location for finding in found] == ["demonstration 3000", "demonstration 3001"]
    assert "same rows as demonstration 7" in found[0].message


@pytest.fixture
def plain(tmp_path: Path) -> Path:
    """Return a folder of one demonstration, a.csv."""
    here = tmp_path / "plain"
    here.mkdir()
    (here / "demonstrations.json").write_text(json.dumps(manifest()))
    (here / "a.csv").write_text(CSV)
    assert len(read_demonstrations(here)) == 1
    return here


@pytest.mark.parametrize("name", ["a.csv", "demonstrations.json"])
def test_read_demonstrations_link_out_of_folder_raises(plain: Path, name: str) -> None:
    content = (plain / name).read_bytes()
    (plain / "within").write_bytes(content)
    (plain / name).unlink()
    (plain / name).symlink_to("within")
    assert len(read_demonstrations(plain)) == 1
    (plain.parent / "outside").write_bytes(content)
    (plain / name).unlink()
    (plain / name).symlink_to(plain.parent / "outside")
    with pytest.raises(InvalidInput, match="link to a file outside the folder; copy that file"):
        read_demonstrations(plain)


def test_read_demonstrations_follows_link_to_folder(plain: Path) -> None:
    (plain.parent / "link").symlink_to(plain)
    assert len(read_demonstrations(plain.parent / "link")) == 1


@pytest.mark.parametrize("kind", ["fifo", "zero", "loop", "folder", "large"])
def test_read_demonstrations_special_file_raises(plain: Path, kind: str) -> None:
    file = plain / "a.csv"
    file.unlink()
    match kind:
        case "fifo":
            os.mkfifo(file)
        case "zero":
            file.symlink_to("/dev/zero")
        case "loop":
            file.symlink_to(file)
        case "folder":
            file.mkdir()
        case "large":
            with file.open("wb") as sparse:
                sparse.truncate(2**40)
    with pytest.raises(InvalidInput, match=r"a\.csv"):
        read_demonstrations(plain)


READERS = [read_chicken_dance_npz, read_robotasks_npy, read_valve_mat, read_zshape_mat]


@pytest.mark.parametrize("read", READERS)
@pytest.mark.parametrize("kind", ["fifo", "zero", "long", "large"])
def test_published_readers_special_file_raises(tmp_path: Path, read: Any, kind: str) -> None:
    file = tmp_path / ("n" * 300 if kind == "long" else "file")
    if kind == "fifo":
        os.mkfifo(file)
    elif kind == "large":
        with file.open("wb") as sparse:
            sparse.truncate(2**40)
    with pytest.raises(InvalidInput, match="expected a"):
        read("/dev/zero" if kind == "zero" else file)


def archive(count: int, size: int, name: str = "x{}.npy", method: int = zipfile.ZIP_DEFLATED) -> bytes:
    """Return an NPZ file of arrays of zeros."""
    array, out = io.BytesIO(), io.BytesIO()
    np.save(array, np.zeros(size, dtype=np.int8))
    with zipfile.ZipFile(out, "w", method) as written:
        for n in range(count):
            written.writestr(name.format(n), array.getvalue())
    return out.getvalue()


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (archive(MAX_ARRAYS + 1, 1), "it has 1001 arrays, expected at most 1000"),
        (archive(6, 10**8), "it expands to 6000007.. bytes, expected at most"),
        (archive(1, 8, "\x1b[2J{}.npy"), r"an array is named '\\x1b\[2J0.npy'"),
        (archive(1, 8, "n" * 50_000 + "{}"), "an array is named 'nnn"),
        (archive(1, 10**6, method=zipfile.ZIP_BZIP2), "compressed in an unsupported way"),
        (archive(1, 10**6, method=zipfile.ZIP_LZMA), "compressed in an unsupported way"),
    ],
    ids=["many", "bomb", "name", "long name", "bzip2", "lzma"],
)
def test_decode_npz_archive_out_of_bounds_raises(data: bytes, message: str) -> None:
    begin = process_time()
    with pytest.raises(InvalidInput, match=message):
        decode_npz(data, "a.npz")
    assert process_time() - begin < QUICK


def test_load_npz_member_that_is_not_an_array_raises() -> None:
    """NumPy returns the bytes of such a member."""
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w") as listing:
        listing.writestr("x.npy", b"NUMPY without its first byte")
    with pytest.raises(InvalidInput, match="'x' is not an array; write it with"):
        load_npz(data.getvalue(), "a.npz")


def test_decode_npz_counts_numbers_of_small_integers() -> None:
    """As float64 they take eight times the memory."""
    data = archive(2, 2**25 + 1)
    with pytest.raises(InvalidInput, match="has 67108866 numbers, expected at most 67108864"):
        decode_npz(data, "a.npz")


def test_decode_npz_understated_size_raises() -> None:
    """Both records of the size say 200 bytes; no more is expanded."""
    data = bytearray(archive(1, 10**7))
    size = (10**7 + 128).to_bytes(4, "little")
    assert data.count(size) == 2
    with pytest.raises(InvalidInput, match="not an NPZ file of numbers"):
        decode_npz(bytes(data.replace(size, (200).to_bytes(4, "little"))), "a.npz")


def test_read_robotasks_npy_overstated_shape_raises(tmp_path: Path) -> None:
    out = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        out, {"descr": "<f8", "fortran_order": False, "shape": (10**12, 1, 7)}
    )
    (tmp_path / "a.npy").write_bytes(out.getvalue())
    with pytest.raises(InvalidInput, match="not an array file"):
        read_robotasks_npy(tmp_path / "a.npy")


def test_read_zshape_mat_large_expansion_raises(tmp_path: Path) -> None:
    savemat(tmp_path / "a.mat", {"Data": np.zeros((4, 3 * 10**6))}, do_compression=True)
    assert (tmp_path / "a.mat").stat().st_size < 10**6
    begin = process_time()
    with pytest.raises(InvalidInput, match="expands to more than 67108864 bytes"):
        read_zshape_mat(tmp_path / "a.mat")
    assert process_time() - begin < QUICK


def test_read_zshape_mat_unknown_element_type_raises(tmp_path: Path) -> None:
    """SciPy would index a table beyond its end, and the process would end."""
    savemat(tmp_path / "a.mat", {"Data": np.ones((4, 15))})
    data = bytearray((tmp_path / "a.mat").read_bytes())
    at = data.index(struct.pack("<II", 9, 4 * 15 * 8))  # the tag of the doubles
    data[at] = 144
    (tmp_path / "a.mat").write_bytes(data)
    with pytest.raises(InvalidInput, match="an element has the unknown type 144"):
        read_zshape_mat(tmp_path / "a.mat")


@pytest.mark.parametrize("order", ["little", "big"])
@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize("kind", [1, 2], ids=["cells", "structures"])
def test_read_valve_mat_overstated_items_raise(
    tmp_path: Path, order: str, compressed: bool, kind: int
) -> None:
    """SciPy would reserve 80 GB for 10^10 cells before it reads the first."""
    mark = "<" if order == "little" else ">"

    def element(number: int, content: bytes) -> bytes:
        return struct.pack(f"{mark}II", number, len(content)) + content + bytes(-len(content) % 8)

    flags = element(6, struct.pack(f"{mark}II", kind, 0))
    sizes, name = element(5, struct.pack(f"{mark}ii", 10**5, 10**5)), element(1, b"s")
    matrix = element(14, flags + sizes + name)
    outer = element(
        14,
        element(6, struct.pack(f"{mark}II", 1, 0))
        + element(5, struct.pack(f"{mark}ii", 1, 1))
        + element(1, b"s")
        + matrix,
    )
    if compressed:
        packed = zlib.compress(outer)
        outer = struct.pack(f"{mark}II", 15, len(packed)) + packed
    head = b"MATLAB 5.0".ljust(124) + struct.pack(f"{mark}HH", 0x0100, 0x4D49)
    (tmp_path / "a.mat").write_bytes(head + outer)
    with pytest.raises(InvalidInput, match=r"a\.mat: an array of 10000000000 cells or structures has only"):
        read_valve_mat(tmp_path / "a.mat")


def test_read_demonstrations_long_header_cell_gives_short_message(plain: Path) -> None:
    (plain / "a.csv").write_text("\x1b" * 100_000 + ",b\n")
    with pytest.raises(InvalidInput, match=r"column 1 is .*expected 'position x'") as caught:
        read_demonstrations(plain)
    assert len(str(caught.value)) <= MAX_MESSAGE_LENGTH
