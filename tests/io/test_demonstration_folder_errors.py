"""Invalid folders of demonstrations: messages name the place and the nearest fix."""

from pathlib import Path

import numpy as np
import pytest

from pilotfish.errors import InvalidInput
from pilotfish.io.demonstration_folder import read_demonstrations

BAD_MANIFESTS = [
    ("format = ", "# ", "format is None, expected format = "),
    ("pilotfish demonstrations", "other", "format is 'other'"),
    ("version = 1", "version = 2", r"newer version \(format 2, this one reads 1\); upgrade"),
    ("version = 1", "version = 0", "version is 0, expected 1"),
    ("version = 1", "version = '1'", "version is '1', expected a whole number"),
    ("version = 1", "version = true", "version is True"),
    ("period", "perod", "unknown key 'perod'; did you mean 'period'"),
    ("period = 0.5", "", "key 'period' is missing"),
    ("period = 0.5", "period = nan", "period is nan, expected a number from 1e-09"),
    ("period = 0.5", "period = -1", "^demonstrations.toml: period is -1, expected a number from 1e-09"),
    ("period = 0.5", "period = 0", "^demonstrations.toml: period is 0, expected a number from 1e-09"),
    ("period = 0.5", "period = 'fast'", "period is 'fast'"),
    ("period = 0.5", "period = 1" + 400 * "0", "period is a whole number of 1329 bits, expected a number"),
    ("period = 0.5", "period = 1" + 5000 * "0", "not TOML that can be read|too long"),
    ("period = 0.5", "period = ", "not TOML that can be read: .*line 4"),
    ("[[layout]]", "[layout]", "layout is .*expected a list"),
    ('"position"\nsize', '"posture"\nsize', "layout 0: quantity is 'posture', expected one of position"),
    ("size = 2", "size = 3", "^demonstrations.toml: demonstration 0, frame 0: .*2 wide, .*layout.* 3"),
    (
        "{ name",
        "{ name = 'cup', A = [[1, 0], [0, 1]], b = [0, 0] }, { name",
        "^demonstrations.toml: demonstration 0: two frames are named 'cup'",
    ),
    (
        "A = [[1, 0], [0, 2]], b = [0.5, 0]",
        "A = [[1]], b = [0.5]",
        "^demonstrations.toml: demonstration 0, frame 0: .*1 wide, .*layout.* 2",
    ),
    ("size = 2", "size = -2", "layout 0: the size of part 'position' is -2, expected a whole number from 1"),
    ("size = 2", "size = 2.0", "layout 0: size is 2.0, expected a whole number"),
    ('unit = "m"', "unit = 1", "layout 0: unit is 1, expected text"),
    ('"first.csv"', '"third.csv"', "third.csv cannot be read: No such file"),
    ('"first.csv"', '"second.csv"', "file 'second.csv' is named more than once"),
    ('"first.csv"', '"../first.csv"', "demonstration 0: file is '../first.csv', expected the name of"),
    ('"first.csv"', '"first.txt"', "expected the name of a .csv or .npz file"),
    ('"first.csv"', '"a\\u0000.csv"', "file is .*expected printable"),
    ('file = "first.csv"', "", "demonstration 0: key 'file' is missing"),
    ('file = "first.csv"', 'files = "first.csv"', "unknown key 'files'; did you mean 'file'"),
    (", b = [0.5, 0]", "", "demonstration 0, frame 0: key 'b' is missing"),
    ("b = [0.5, 0]", "b = [0.5]", r"frame 0: frame 'cup': A has shape \(2, 2\) and b \(1,\)"),
    ("b = [0.5, 0]", "b = [0.5, inf]", r"frame 0: frame 'cup': b\[1\] is inf"),
    ("b = [0.5, 0]", "b = [0.5, 'a']", "frame 0: frame 'cup': b holds 'a'"),
    ("[[1, 0], [0, 2]]", "[[1, 0], [0]]", "frame 0: frame 'cup': A has rows of different lengths"),
    ("[[1, 0], [0, 2]]", "[[0, 0], [0, 2]]", "frame 0: frame 'cup': A is singular"),
    (
        "A = [[1, 0], [0, 2]], b = [0.5, 0]",
        "A = 'A', b = 'b'",
        "no array 'A'.*moving frames need an NPZ file",
    ),
    ("A = [[1, 0], [0, 2]], b = [0.5, 0]", "position = [1, 2, 3]", "key 'quaternion' is missing"),
    (
        "A = [[1, 0], [0, 2]], b = [0.5, 0]",
        "position = [1, 2, 3], quaternion = [1, 1, 0, 0]",
        r"frame 0: quaternion .* has norm 1\.41421",
    ),
    ('name = "cup", A', 'name = "", A', "the name of a frame is ''"),
    ("[{ name", "[3, { name", "demonstration 0, frame 0 is 3, expected a table: name with position"),
]


@pytest.mark.parametrize(("old", "new", "message"), BAD_MANIFESTS, ids=range(len(BAD_MANIFESTS)))
def test_read_demonstrations_invalid_manifest_names_key_and_fix(
    manual_folder: Path, old: str, new: str, message: str
):
    file = manual_folder / "demonstrations.toml"
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new, 1))
    with pytest.raises(InvalidInput, match=message):
        read_demonstrations(manual_folder)


BAD_TABLES = [
    (
        "",
        r"first.csv, line 1: the header is not the layout's: 0 columns, expected 2; .*position x, position y",
    ),
    ("position y,position x\n0,1\n2,3\n", "line 1: .*column 1 is 'position y', expected 'position x'"),
    ("position x;position y\n0;1\n2;3\n", "separated by commas, not semicolons"),
    ("0,1\n2,3\n", "line 1: the header is not the layout's"),
    ("position x,position y\n", "first.csv .*shape \\(0, 2\\)"),
    ("position x,position y\n0,1\n", "first.csv .*shape \\(1, 2\\)"),
    ("position x,position y\n0,1\n2\n", "first.csv, line 3 has 1 values, expected 2"),
    ("position x,position y\n0,1\n\n2,3\n", "first.csv, line 3 has 0 values"),
    ("position x,position y\n0,1\n2,3,\n", "first.csv, line 3 has 3 values"),
    ("position x,position y\n0,1\n2,3 m\n", "first.csv, line 3, column 'position y' is '3 m'"),
    ("position x,position y\n0,1\n2,1_0\n", "line 3, column 'position y' is '1_0'"),
    ("position x,position y\n0,1\n,3\n", "line 3, column 'position x' is ''"),
    ("position x,position y\n0,1\nnan,3\n", "^first.csv, line 3, column 'position x' is 'nan'"),
    ("position x,position y\n0,1\n1e999,3\n", "^first.csv, line 3, column 'position x' is '1e999'"),
    ('position x,position y\n0,1\n"2,3\n', "not CSV that can be read"),
    (b"position x,position y\n0,1\n2,\xff\n", "first.csv: byte 28 is not UTF-8 text"),
    (b"position x,position y\n0,1\n2,\x00\n", "first.csv, line 3"),
]


@pytest.mark.parametrize(("text", "message"), BAD_TABLES, ids=range(len(BAD_TABLES)))
def test_read_demonstrations_invalid_csv_names_line_and_column(
    manual_folder: Path, text: str | bytes, message: str
):
    (manual_folder / "first.csv").write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InvalidInput, match=message):
        read_demonstrations(manual_folder)


ARRAYS = {"x": np.zeros((2, 2)), "A": np.tile(np.eye(2), (2, 1, 1)), "b": np.zeros((2, 2))}
BAD_ARRAYS = [
    ({**ARRAYS, "y": np.zeros(2)}, "first.npz has an array 'y' that no frame names"),
    ({"x": ARRAYS["x"], "A": ARRAYS["A"]}, r"first.npz has no array 'b', it has A, x"),
    ({**ARRAYS, "x": np.zeros((3, 2))}, "first.npz: demonstration 'first': moving frame 'belt' has 2 steps"),
    ({**ARRAYS, "A": 0 * ARRAYS["A"]}, "first.npz: moving frame 'belt': A at step 0 .*singular"),
    ({**ARRAYS, "x": np.array([[None]])}, "first.npz: not an NPZ file of numbers"),
    ({**ARRAYS, "x": np.array([["a"]])}, "first.npz: array 'x' has .*not real numbers"),
]


@pytest.mark.parametrize(("arrays", "message"), BAD_ARRAYS, ids=range(len(BAD_ARRAYS)))
def test_read_demonstrations_invalid_npz_names_array(
    manual_folder: Path, arrays: dict[str, np.ndarray], message: str
):
    keyed = (manual_folder / "demonstrations.toml").read_text()
    keyed = keyed.replace("first.csv", "first.npz").replace(
        "A = [[1, 0], [0, 2]], b = [0.5, 0]", "A='A', b='b'", 1
    )
    (manual_folder / "demonstrations.toml").write_text(keyed.replace('"cup"', '"belt"', 1))
    np.savez(manual_folder / "first.npz", **ARRAYS)
    assert read_demonstrations(manual_folder)[0].frames[0].name == "belt"
    np.savez(manual_folder / "first.npz", **arrays)
    with pytest.raises(InvalidInput, match=message):
        read_demonstrations(manual_folder)


def test_read_demonstrations_npz_that_is_not_an_archive_raises(manual_folder: Path):
    text = (manual_folder / "demonstrations.toml").read_text()
    (manual_folder / "demonstrations.toml").write_text(text.replace("first.csv", "first.npz"))
    for write in (lambda f: np.save(f, np.zeros((2, 2))), lambda f: f.write(b"rubbish"), lambda f: None):
        with (manual_folder / "first.npz").open("wb") as file:
            write(file)
        with pytest.raises(InvalidInput, match=r"first\.npz: not an NPZ file") as refused:
            read_demonstrations(manual_folder)
        assert "pickle" not in str(refused.value)  # NumPy's advice is not ours


def test_read_demonstrations_without_exactly_one_manifest_raises(manual_folder: Path):
    with pytest.raises(InvalidInput, match="is not a folder"):
        read_demonstrations(manual_folder / "missing")
    with pytest.raises(InvalidInput, match="is not a folder"):
        read_demonstrations(manual_folder / "first.csv")
    (manual_folder / "demonstrations.json").write_text("{}")
    with pytest.raises(InvalidInput, match="has both of"):
        read_demonstrations(manual_folder)
    (manual_folder / "demonstrations.json").unlink()
    (manual_folder / "demonstrations.toml").unlink()
    with pytest.raises(InvalidInput, match="has neither of"):
        read_demonstrations(manual_folder)


@pytest.mark.parametrize(
    "text", ["[1, 2]", "3", "", "{", '{"version": 1, "version": 1}', "[" * 100_000, "nul"]
)
def test_read_demonstrations_json_that_is_not_a_manifest_raises(manual_folder: Path, text: str):
    (manual_folder / "demonstrations.toml").unlink()
    (manual_folder / "demonstrations.json").write_text(text)
    with pytest.raises(InvalidInput, match=r"demonstrations\.json: "):
        read_demonstrations(manual_folder)
