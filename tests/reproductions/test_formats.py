"""The table of formats: every number of each file is read as it was written, in every format."""

import formats
import pytest

ROWS = {
    "labels": {"CSV": "phase", "LeRobot v3": "task"},
    "frames": {"CSV": "cube", "rosbag2 MCAP": "tf cube, tf bin"},
}


@pytest.mark.parametrize("given", formats.FORMATS, ids=lambda given: given.name)
def test_every_format_is_read_exactly(given):
    row = formats.read_format(given, 1)
    assert (row["exact"], row["rows"]) == ("yes", formats.STEPS)
    for column, expected in ROWS.items():
        assert row[column] == expected.get(given.name, row[column])


def test_changed_number_is_not_exact():
    """The comparison can fail."""
    original = formats.FORMATS[0]

    def write(folder, rng):
        path, written = original.write(folder, rng)
        return path, {name: values + 1e-12 for name, values in written.items()}

    assert formats.read_format(formats.Format("CSV", "csv", write), 1)["exact"] == "NO"


def test_large_set_is_measured(tmp_path):
    formats.write_large("robomimic", tmp_path / "set.hdf5", 0.02)
    result = formats.read_large(tmp_path / "set.hdf5")
    assert result["rows"] >= formats.EPISODE
    assert result["peak"] >= 0.0
