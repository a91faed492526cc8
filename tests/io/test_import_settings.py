"""Settings of an import as a file: what is written is read, and mistakes are named."""

from pathlib import Path

import pytest

from pilotfish.demonstrations import BuildSettings, FrameSource, PartSource, Quantity
from pilotfish.errors import InvalidInput
from pilotfish.io.import_settings import format_import_settings, read_import_settings

SETTINGS = BuildSettings(
    (
        PartSource("position", Quantity.POSITION, ("arm:x", "arm:y", "arm:z"), "mm"),
        PartSource("orientation", Quantity.QUATERNION, ("q*",), representation="xyzw"),
        PartSource("grip", Quantity.SCALAR, ('a "quoted" name',)),
    ),
    (
        FrameSource(
            "cup", ("cup x", "cup y", "cup z"), ("r", "p", "y"), "rpy", angle_unit="deg", moving=True
        ),
        FrameSource("table", ("t x", "t y", "t z")),
    ),
    0.05,
)


def write(folder: Path, text: str) -> Path:
    path = folder / "import.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_written_settings_are_read_again(tmp_path: Path):
    text = format_import_settings(SETTINGS, ["Is it in mm?"])
    assert "# To decide: Is it in mm?" in text
    assert read_import_settings(write(tmp_path, text)) == SETTINGS


def test_period_of_the_recordings_and_limits_are_kept(tmp_path: Path):
    settings = BuildSettings((PartSource("a", Quantity.SCALAR, ("a",)),))
    assert read_import_settings(write(tmp_path, format_import_settings(settings))) == settings
    limits = "thin = false\nmax_gap = 3.0\n" + format_import_settings(settings)
    found = read_import_settings(write(tmp_path, limits))
    assert (found.thin, found.max_gap, found.period) == (False, 3.0, None)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"has no parts, expected \[\[part\]\]"),
        ("perod = 1.0", "did you mean 'period'"),
        ("[part]\nname = 1", "expected tables such as"),
        ("part = [1]", "part 0 is 1, expected a table with name, quantity, columns"),
        ('[[part]]\nname = "a"\nquantity = "scalar"', "part 0: key 'columns' is missing"),
        ('[[part]]\nname = "a"\nquantity = "scaler"\ncolumns = ["a"]', "expected one of position"),
        ('[[part]]\nname = "a"\nquantity = "scalar"\ncolumns = ["a"]\nunits = "m"', "did you mean 'unit'"),
        ('[[part]]\nname = "a"\nquantity = "position"\ncolumns = ["a"]\nunit = "furlong"', "furlong"),
        ("period = nan\n[[part]]\nname='a'\nquantity='scalar'\ncolumns=['a']", "period"),
        ("a = [", "not TOML"),
    ],
)
def test_mistakes_are_named(tmp_path: Path, text: str, message: str):
    with pytest.raises(InvalidInput, match=message):
        read_import_settings(write(tmp_path, text))
