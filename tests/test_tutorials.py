"""Every tutorial runs from top to bottom and prints what the page displays, numbers left out."""

import re
import runpy
from pathlib import Path
from typing import Any

import pytest

TOP = Path(__file__).parents[1]
TUTORIALS = TOP / "docs" / "tutorials"
MAX_PICTURES = 200_000  # bytes per page
RUNNER: dict[str, Any] = runpy.run_path(str(TOP / "docs" / "run_tutorials.py"))
PAGES = [
    "first-skill",
    "own-recordings",
    pytest.param("ros-recording", marks=pytest.mark.slow),  # writes and reads bags: 9 CPU seconds
    pytest.param("lerobot-dataset", marks=pytest.mark.slow),  # seven processes: 10 CPU seconds
    pytest.param("simulated-task", marks=pytest.mark.slow),  # records and executes in physics: 12 CPU seconds
    "stream",
]


def without_numbers(text: str) -> str:
    """Return a text with numbers and hashes masked, and runs of spaces as one."""
    text = re.sub(r"\b[0-9a-f]{64}\b", "HASH", text)
    return re.sub(r"[ -]+", " ", re.sub(r"\d[\d.e+-]*", "N", text))


@pytest.mark.parametrize("name", PAGES)
def test_tutorial_prints_what_its_page_displays(request, name: str, tmp_path, unchecked):
    text = (TUTORIALS / f"{name}.md").read_text(encoding="utf-8")
    if "datasets." in text:
        request.getfixturevalue("data_folder")
    assert without_numbers(RUNNER["run_page"](text, tmp_path)) == without_numbers(text)
    assert all((tmp_path / picture).exists() for picture in RUNNER["PICTURE"].findall(text))


def test_tutorials_state_the_time_needed_and_have_small_pictures():
    for page in sorted(TUTORIALS.glob("*.md")):
        if page.stem == "index":
            continue
        text = page.read_text(encoding="utf-8")
        pictures = RUNNER["PICTURE"].findall(text)
        assert pictures
        assert text.split("\n\n")[1].startswith("Time: ")
        assert sum((TUTORIALS / picture).stat().st_size for picture in pictures) < MAX_PICTURES


def test_tutorials_in_the_contents_are_those_that_are_run():
    names = {page if isinstance(page, str) else page.values[0] for page in PAGES}
    assert names == {page.stem for page in TUTORIALS.glob("*.md")} - {"index"}
