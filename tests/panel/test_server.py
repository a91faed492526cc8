"""Server of the page: addresses, ports, a missing library, and events without a browser."""

import builtins
import socket
import urllib.request
from typing import Any

import numpy as np
import pytest

from pilotfish.demonstrations import Demonstration
from pilotfish.errors import InvalidInput, SkillError
from pilotfish.models import Skill
from pilotfish.panel import is_loopback, serve, view_content
from pilotfish.panel.server import page_address

viser = pytest.importorskip("viser", reason="viser is not installed")
Demonstrations = tuple[Demonstration, ...]


def never() -> bool:
    raise AssertionError("the page was served")


@pytest.fixture
def used_port() -> Any:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen(1)
        yield other.getsockname()[1]


def test_port_in_use_is_refused(reaches: Demonstrations, used_port: int):
    """The library would take the next port, where nobody looks for the page."""
    with pytest.raises(InvalidInput, match=f"port {used_port} of 127.0.0.1 is in use .* 0 for any free one"):
        serve(view_content(reaches), never, port=used_port)


@pytest.mark.parametrize("host", ["no.such.host.invalid", "203.0.113.7", "a..b"])
def test_host_of_another_computer_is_refused(host: str, reaches: Demonstrations):
    with pytest.raises(InvalidInput, match=f"host '{host}'.*expected an address"):
        serve(view_content(reaches), never, host=host, port=0)


@pytest.mark.usefixtures("unchecked")  # wrong types on purpose
@pytest.mark.parametrize("port", [-1, 65536, 1.5, "80"])
def test_bad_port_is_refused(port: Any, reaches: Demonstrations):
    with pytest.raises(InvalidInput, match="port"):
        serve(view_content(reaches), never, port=port)


def test_missing_library_is_named(monkeypatch: pytest.MonkeyPatch, reaches: Demonstrations):
    imported = builtins.__import__

    def import_without_viser(name: str, *arguments: Any) -> Any:
        if name == "viser":
            raise ImportError(name="viser")
        return imported(name, *arguments)

    monkeypatch.setattr(builtins, "__import__", import_without_viser)
    with pytest.raises(SkillError, match=r"the page needs viser: pip install '.\[panel\]' in the clone"):
        serve(view_content(reaches), never, port=0)


@pytest.mark.parametrize(
    ("host", "expected"),
    [("127.0.0.1", True), ("::1", True), ("localhost", True), ("0.0.0.0", False), ("lab", False)],
)
def test_is_loopback(host: str, expected: bool):
    assert is_loopback(host) is expected


def test_page_address_can_be_opened_on_this_computer():
    assert page_address("0.0.0.0", 80) == "http://localhost:80"
    assert page_address("::1", 80) == "http://[::1]:80"


@pytest.mark.parametrize("content_of", ["reach", "sphere", "stroke", "folder", "skill"])
def test_page_is_served_for_every_kind_of_content(
    content_of: str, request: pytest.FixtureRequest, capsys: pytest.CaptureFixture[str]
):
    """Skills in space, on S^3 and in a plane, demonstrations alone and a skill alone."""
    if content_of == "folder":
        content = view_content(request.getfixturevalue("reaches"))
    elif content_of == "skill":
        content = view_content((), request.getfixturevalue("reach_skill"))
    elif content_of == "stroke":
        content = view_content(request.getfixturevalue("strokes"), request.getfixturevalue("stroke_skill"))
    else:
        content = view_content((), request.getfixturevalue(f"{content_of}_skill"))
    pages: list[bytes] = []

    def fetch(address: str) -> None:
        assert address.startswith("http://127.0.0.1:")
        with urllib.request.urlopen(address, timeout=30.0) as answer:
            pages.append(answer.read(100))

    serve(content, lambda: bool(pages), port=0, on_start=fetch)
    assert b"<!doctype html" in pages[0].lower()
    assert capsys.readouterr() == ("", "")  # viser prints nothing


class Recorder:
    """Event of viser by a browser."""

    def __init__(self, target: Any) -> None:
        self.target, self.client = target, object()


def run(coroutine: Any) -> None:
    """Run a coroutine that never waits."""
    with pytest.raises(StopIteration):
        coroutine.send(None)


def test_drag_draws_the_reproduction_of_the_newest_pose(reach_skill: Skill, reaches: Demonstrations):
    """Of many drag events before the page is free, only the last one is computed."""
    from pilotfish.panel import page as page_module

    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    computed: list[np.ndarray] = []
    original = page_module.compute_reproduction

    def compute(skill: Skill, frames: Any) -> Any:
        computed.append(frames[1].b[:3])
        return original(skill, frames)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(page_module, "compute_reproduction", compute)
        page = page_module.Page(server, view_content(reaches, reach_skill))
        computed.clear()
        handle = page._scene.handles[1]
        for height in np.linspace(0.1, 0.3, 20):
            handle.position = np.array([0.6, 0.0, height])
            run(page._on_drag(1, Recorder(handle)))
        page.refresh()
    np.testing.assert_allclose(computed, [[0.6, 0.0, 0.3]])
    expected = original(reach_skill, page._latest.get().frames).reproduction
    assert expected
    np.testing.assert_allclose(page._scene._path.points[-1, 1], expected.motion.x[-1, :3], atol=1e-6)
    assert page._inputs[1][0].value == (0.6, 0.0, 0.3)
    run(page._on_reset(Recorder(None)))
    page.refresh()
    np.testing.assert_allclose(handle.position, reaches[0].frames[1].b[:3])
    server.stop()
