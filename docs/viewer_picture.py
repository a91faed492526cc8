"""Take the picture of docs/viewer.md: the page of four simulated demonstrations and their skill.

`python docs/viewer_picture.py` needs Chromium, and the extras sim, panel and dev.
"""

import io
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from PIL import Image
from playwright.sync_api import sync_playwright

COLOURS = 128
FLAGS = ["--headless", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
SECONDS = "9.5"  # of the motion, when the tool carries the plate
RAISED = "0.16"  # height of the obstacle [m], which was lower in the demonstrations


def run(folder: str, *arguments: str) -> None:
    """Run a command of pilotfish in a folder."""
    subprocess.run([sys.executable, "-m", "pilotfish", *arguments], cwd=folder, check=True)


def fill(page: Any, number: int, text: str) -> None:
    """Type into an input of the form."""
    entry = page.locator("input[inputmode=decimal]").nth(number)
    entry.fill(text)
    entry.press("Enter")


def take_picture(address: str) -> bytes:
    """Return a screenshot of the page after an object was moved."""
    with sync_playwright() as runner:
        browser = runner.chromium.launch(executable_path="/usr/bin/chromium", args=FLAGS)
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.goto(address)
        page.locator('[data-row="ends at [m]"]').wait_for()
        time.sleep(10.0)  # viser renders a few images a second here
        for button in page.locator("[class*=Notification-close]").all():
            button.click()
        fill(page, 8, RAISED)
        fill(page, 12, SECONDS)
        time.sleep(10.0)
        picture = page.screenshot()
        browser.close()
    return picture


with tempfile.TemporaryDirectory() as folder:
    run(folder, "record", "plate", "--demonstrations", "4", "--seed", "0", "--out", "plate")
    run(folder, "learn", "plate", "--out", "plate.skill")
    command = [
        sys.executable,
        "-m",
        "pilotfish",
        "view",
        "plate",
        "--skill",
        "plate.skill",
        "--port",
        "0",
        "--json",
    ]
    with subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE) as viewer:
        picture = take_picture(json.loads(viewer.stdout.readline())["address"])  # type: ignore[union-attr]
        viewer.terminate()
with Image.open(io.BytesIO(picture)) as image:
    colours = image.convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE)
    colours.save(Path(__file__).parent / "viewer.png", optimize=True)
