"""pilotfish view in a headless browser: an object is dragged with the mouse, and the reproduction follows.

Chromium renders a few images a second here, so that every test waits for numbers in the page.
"""

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pilotfish.demonstrations import Frame
from pilotfish.geometry import Pose, rotation_matrix
from pilotfish.io import open_skill, read_demonstrations, save_skill, synthetic_valve, write_demonstrations
from pilotfish.models import Skill, learn
from pilotfish.panel import compute_reproduction, frame_pose, move_frame, view_content
from pilotfish.panel.scene_drawing import HANDLE_SIZE
from pilotfish.panel.scene_values import FIELD_OF_VIEW, Extent, extent_of, first_camera

CHROMIUM = Path("/usr/bin/chromium")
FLAGS = (
    "--headless",
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
WIDTH, HEIGHT = 1280, 800
ARROW = 0.85  # of the size of a handle, from its origin to the middle of an arrow's head
TIMEOUT = 120.0  # s, on a busy machine
MAX_MILLISECONDS = 100.0  # processor time of a computation
PICTURES = os.environ.get("PILOTFISH_PICTURES")  # folder that keeps the screenshots


@dataclass(frozen=True)
class Viewer:
    """Running command, and what it displays."""

    process: "subprocess.Popen[str]"
    address: str
    skill: Skill
    frames: tuple[Frame, ...]
    extent: Extent

    @property
    def poses(self) -> list[Pose]:
        """Poses of the frames at the beginning."""
        return [frame_pose(each, self.skill.layout) for each in self.frames]


def restore_signals() -> None:
    """Restore the default handler, which a background job does not have."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def start_command(folder: Path, *arguments: str) -> "subprocess.Popen[str]":
    return subprocess.Popen(
        [sys.executable, "-W", "ignore", "-m", "pilotfish", "view", *arguments],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={
            **os.environ,
            "PYTHONPATH": f"{Path(__file__).parents[2] / 'src'}:{os.environ.get('PYTHONPATH', '')}",
        },
        preexec_fn=restore_signals,
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with demonstrations and the skill that `learn` learns from them at defaults."""
    path = tmp_path_factory.mktemp("viewed")
    write_demonstrations(synthetic_valve(np.random.default_rng(0)), path / "valve")
    demonstrations = read_demonstrations(path / "valve")
    save_skill(learn(demonstrations, rng=np.random.default_rng(0)).skill, path / "valve.skill")
    return path


@pytest.fixture
def viewer(folder: Path) -> Iterator[Viewer]:
    """Start the command on any free port; it is killed after the test."""
    process = start_command(folder, "valve", "--skill", "valve.skill", "--port", "0", "--json")
    try:
        assert process.stdout
        address = json.loads(process.stdout.readline())["address"]
        skill = open_skill(folder / "valve.skill")
        content = view_content(read_demonstrations(folder / "valve"), skill)
        adapted = compute_reproduction(skill, content.situations[0].frames).adapted
        frames = content.situations[0].frames
        yield Viewer(process, address, skill, frames, extent_of(content, adapted))
    finally:
        process.kill()
        process.communicate()


@pytest.fixture
def page(viewer: Viewer) -> Iterator[Any]:
    """Open the page in headless Chromium; only this computer can be reached."""
    if not CHROMIUM.exists():
        pytest.skip(f"{CHROMIUM} is missing: apt-get install chromium")
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    with playwright.sync_playwright() as runner:
        browser = runner.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        opened = browser.new_page(viewport={"width": WIDTH, "height": HEIGHT})
        opened.set_default_timeout(1e3 * TIMEOUT)
        requests: list[str] = []
        opened.on("request", lambda request: requests.append(request.url))
        opened.goto(viewer.address)
        opened.locator('[data-row="ends at [m]"]').wait_for()
        wait_until(lambda: opened.locator("canvas").first.bounding_box()["width"] < WIDTH)
        yield opened
        browser.close()
    outside = [url for url in requests if not url.startswith((viewer.address, "data:", "blob:"))]
    assert outside == []


def wait_until(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + TIMEOUT
    while not condition():
        assert time.monotonic() < end, "timeout"
        time.sleep(0.05)


def numbers(page: Any, row: str) -> list[float]:
    text = page.locator(f'[data-row="{row}"]').inner_text()
    return [float(number) for number in re.findall(r"-?[0-9.]+", text)]


def origin(page: Any, frame: int) -> np.ndarray:
    """Return the position of a frame in the form: three inputs of each frame, then three of its turn."""
    inputs = page.locator("input[inputmode=decimal]")
    return np.array([float(inputs.nth(6 * frame + axis).input_value()) for axis in range(3)])


def project(page: Any, extent: Extent, point: np.ndarray) -> tuple[float, float]:
    """Return where a point is on the page, by the first camera."""
    box, camera = page.locator("canvas").first.bounding_box(), first_camera(extent)
    forward = (camera.look_at - camera.position) / np.linalg.norm(camera.look_at - camera.position)
    right = np.cross(forward, camera.up) / np.linalg.norm(np.cross(forward, camera.up))
    offset = point - camera.position
    pixels = 0.5 * box["height"] / np.tan(0.5 * FIELD_OF_VIEW) / (offset @ forward)
    across, up = offset @ right, offset @ np.cross(right, forward)
    return (
        box["x"] + 0.5 * box["width"] + pixels * across,
        box["y"] + 0.5 * box["height"] - pixels * up,
    )


def drag_along_axis(page: Any, viewer: Viewer, frame: int, axis: int, distance: float) -> None:
    """Drag the arrow of a handle with the mouse by a distance [m]."""
    pose = viewer.poses[frame]
    direction = rotation_matrix(pose.quaternion)[:, axis]
    arrow = pose.position + ARROW * HANDLE_SIZE * viewer.extent.size * direction
    start = np.array(project(page, viewer.extent, arrow))
    end = np.array(project(page, viewer.extent, arrow + distance * direction))
    page.mouse.move(*start)
    time.sleep(2.0)  # until an image with the arrow under the mouse is rendered
    page.mouse.down()
    for share in np.linspace(0.0, 1.0, 12)[1:]:
        page.mouse.move(*(start + share * (end - start)))
        time.sleep(0.1)
    page.mouse.up()


def save_picture(page: Any, name: str) -> None:
    """Keep a screenshot if PILOTFISH_PICTURES names a folder; in any case take one."""
    for button in page.locator("[class*=Notification-close]").all():
        button.click()  # viser warns that it renders without a graphics card
    picture = page.screenshot()
    assert picture.startswith(b"\x89PNG")
    if PICTURES:
        (Path(PICTURES) / f"{name}.png").write_bytes(picture)


def test_dragged_object_moves_the_reproduction(viewer: Viewer, page: Any):
    """The numbers in the page after a drag are those of the skill at the frames in the page."""
    before, end = origin(page, 1), numbers(page, "ends at [m]")
    save_picture(page, "before the drag")
    drag_along_axis(page, viewer, frame=1, axis=1, distance=0.2)
    wait_until(lambda: bool(np.linalg.norm(origin(page, 1) - before) > 0.1))
    time.sleep(2.0)  # until the last event of the drag has arrived
    wait_until(lambda: "..." not in page.locator("text=/Notes: .../").all_inner_texts())
    moved = origin(page, 1)
    direction = rotation_matrix(viewer.poses[1].quaternion)[:, 1]
    assert abs((moved - before) @ direction - np.linalg.norm(moved - before)) < 2e-3  # along the arrow
    target = Pose(moved, viewer.poses[1].quaternion)
    frames = (viewer.frames[0], move_frame(viewer.frames[1], viewer.skill.layout, target))
    expected = compute_reproduction(viewer.skill, frames).reproduction
    assert expected
    np.testing.assert_allclose(numbers(page, "ends at [m]"), expected.motion.x[-1, :3], atol=2e-3)
    assert np.linalg.norm(np.subtract(numbers(page, "ends at [m]"), end)) > 0.05
    (milliseconds,) = numbers(page, "processor time")
    assert 0.0 < milliseconds < MAX_MILLISECONDS
    save_picture(page, "after the drag")
    page.get_by_role("button", name="Reset").click()
    wait_until(lambda: bool(np.allclose(origin(page, 1), before)))
    wait_until(lambda: bool(np.allclose(numbers(page, "ends at [m]"), end)))


def test_typed_position_and_time_change_the_motion(viewer: Viewer, page: Any):
    end = numbers(page, "ends at [m]")
    first = page.locator("input[inputmode=decimal]").nth(8)  # z of the second frame
    first.fill("0.5")
    first.press("Enter")
    wait_until(lambda: abs(numbers(page, "ends at [m]")[2] - end[2]) > 0.05)
    assert numbers(page, "step")[0] == 0.0
    page.get_by_role("button", name="Play").click()
    wait_until(lambda: numbers(page, "step")[0] > 5.0)
    page.get_by_role("button", name="Pause").click()
    wait_until(lambda: page.get_by_role("button", name="Play").count() == 1)
    step = numbers(page, "step")[0]
    time.sleep(1.0)
    assert numbers(page, "step")[0] == step


def test_interrupt_ends_the_command_without_traceback(viewer: Viewer):
    viewer.process.send_signal(signal.SIGINT)
    output, errors = viewer.process.communicate(timeout=TIMEOUT)
    assert (viewer.process.returncode, errors) == (130, "stopped by SIGINT\n")
    assert output == ""


def test_port_in_use_is_refused(viewer: Viewer, folder: Path):
    port = viewer.address.rpartition(":")[2]
    process = start_command(folder, "valve", "--port", port)
    output, errors = process.communicate(timeout=TIMEOUT)
    assert (process.returncode, output) == (1, "")
    assert errors == (
        f"Error: port {port} of 127.0.0.1 is in use by another program; choose another, or 0 for any free "
        "one\n"
    )


def test_page_is_not_shared_beyond_this_computer(viewer: Viewer):
    """The port is bound to the loopback address only."""
    port = int(viewer.address.rpartition(":")[2])
    listening = [
        line.split()[1]
        for line in Path("/proc/net/tcp").read_text().splitlines()[1:]
        if line.split()[3] == "0A"
    ]
    assert f"0100007F:{port:04X}" in listening
    assert f"00000000:{port:04X}" not in listening
