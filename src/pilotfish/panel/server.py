"""Server of the page: address, start and end.

The page has no password, so it is bound to the loopback address unless the caller asks for another. viser can
open a tunnel through a server of its makers when a browser asks for it; this is switched off.
"""

import errno
import os
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from ipaddress import ip_address
from pathlib import Path
from typing import TYPE_CHECKING

from pilotfish.errors import InvalidInput, SkillError
from pilotfish.panel.content import ViewContent
from pilotfish.panel.page import Page
from pilotfish.validation import require_count, require_printable, require_type

if TYPE_CHECKING:
    import viser

LOOPBACK, DEFAULT_PORT, MAX_PORT = "127.0.0.1", 8080, 65535


def serve(
    content: ViewContent,
    should_stop: Callable[[], object],
    *,
    host: str = LOOPBACK,
    port: int = DEFAULT_PORT,
    on_start: Callable[[str], object] = lambda _: None,
) -> None:
    """Serve the page until a function returns true.

    Args:
        content: Content of the page, from `view_content`.
        should_stop: Called several times a second.
        host: Address to bind. Every computer that can reach it can read and change the page.
        port: Port; 0 takes any free one.
        on_start: Called with the address of the page when it can be opened.

    Raises:
        InvalidInput: If the port is in use, or the host is not an address of this computer.
        SkillError: If viser is not installed.
    """
    require_type(content, "content", ViewContent, "view_content returns it")
    require_printable(host, "host")
    require_count(port, "port", MAX_PORT)
    with _running_server(host, port) as server:
        page = Page(server, content)
        on_start(page_address(host, server.get_port()))
        page.run(should_stop)


def is_loopback(host: str) -> bool:
    """Return whether a host is this computer only.

    Args:
        host: Name or address.
    """
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def page_address(host: str, port: int) -> str:
    """Return the address of a page for a browser on this computer.

    Args:
        host: Address that the page is bound to.
        port: Port of the page.
    """
    if host in ("0.0.0.0", "::"):  # every address of this computer
        host = "localhost"
    return f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"


@contextmanager
def _running_server(host: str, port: int) -> "Iterator[viser.ViserServer]":
    """Start a server of viser, and stop it at the end; what it prints is dropped."""
    try:
        import viser
    except ImportError as error:
        raise SkillError(
            f"the page needs {error.name or error}: pip install '.[panel]' in the clone"
        ) from error
    _require_free(host, port)
    os.environ.pop("_VISER_PORT_OVERRIDE", None)
    with Path(os.devnull).open("w") as nowhere:
        with redirect_stdout(nowhere):
            server = viser.ViserServer(host=host, port=port, label="pilotfish", verbose=False)
        server.request_share_url = _refuse_to_share  # type: ignore[method-assign]
        try:
            if port not in (0, server.get_port()):
                raise InvalidInput(f"port {port} of {host} was taken by another program; try again")
            yield server
        finally:
            with redirect_stdout(nowhere):
                server.stop()


def _refuse_to_share(verbose: bool = True) -> None:
    """Refuse to open a tunnel to the page."""


def _require_free(host: str, port: int) -> None:
    """Check that the port can be bound; viser would take the next one silently."""
    try:
        address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)[0]
    except (OSError, UnicodeError) as error:
        raise InvalidInput(
            f"host {host!r} is unknown ({error}), expected an address such as 127.0.0.1"
        ) from error
    family, kind, protocol, _, socket_address = address
    try:
        with socket.socket(family, kind, protocol) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(socket_address)
            probe.listen(1)
    except OSError as error:
        if error.errno == errno.EADDRINUSE:
            problem = (
                f"port {port} of {host} is in use by another program; choose another, or 0 for any free one"
            )
        elif error.errno == errno.EACCES:
            problem = f"port {port} needs the rights of the administrator, expected 1024 to {MAX_PORT}, or 0"
        else:
            problem = (
                f"host {host!r} cannot be bound ({error.strerror}), expected an address of this computer"
            )
        raise InvalidInput(problem) from error
