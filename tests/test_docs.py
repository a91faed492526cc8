"""The documentation speaks of what exists."""

import importlib
import re
from pathlib import Path

import pytest

THESIS_MAP = (Path(__file__).parents[1] / "docs" / "thesis-map.md").read_text()
NAMES = sorted(set(re.findall(r"`([a-z]+)\.([A-Za-z_]+)`", THESIS_MAP)))


@pytest.mark.parametrize(("room", "name"), NAMES, ids=".".join)
def test_every_name_of_the_thesis_map_is_public_in_its_room(room, name):
    assert name in importlib.import_module(f"pilotfish.{room}").__all__
