"""pilotfish stream from a real pipe: rows are learned as they arrive, and always saved."""

import fcntl
import os
import signal
import subprocess
import sys
import termios
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

import pilotfish as pf
from pilotfish.demonstrations import Layout, Part, Quantity
from pilotfish.io.stream_file import encode_stream
from pilotfish.models import online

TIMEOUT = 60.0  # s, for a process on a busy machine
OPTIONS = ["--learner", "dp-gmm", "--cluster", "0.5", "--noise", "0.01", "--no-scale", "--out", "now.stream"]
LAYOUT = Layout((Part("column", Quantity.SCALAR, 3, "1"),))
StartCommand = Callable[..., subprocess.Popen[bytes]]


def rows(n: int) -> np.ndarray:
    t = np.arange(n) / 5.0
    return np.stack([np.cos(t), np.sin(t), 0.1 * t % 1.0], axis=1).round(6)


def text(x: np.ndarray) -> bytes:
    return "".join(f"{a!r} {b!r} {c!r}\n" for a, b, c in x.tolist()).encode()


def expected(x: np.ndarray) -> bytes:
    model = online.online_model(online.DPGMM(0.5, 0.01), LAYOUT, 0.01)
    return encode_stream(online.observe_stream(model, x)[0])


def restore_signals() -> None:
    """Restore default signal handlers, which a background job does not have."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_DFL)


@pytest.fixture
def start(tmp_path: Path) -> Iterator[StartCommand]:
    """Start a command that reads a pipe; it is killed after the test."""
    running: list[subprocess.Popen[bytes]] = []
    source = str(Path(__file__).parents[2] / "src")

    def start_command(*options: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-W", "ignore", "-m", "pilotfish", "stream", "-", *OPTIONS, *options]
        process = subprocess.Popen(
            command,
            cwd=tmp_path,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env={**os.environ, "PYTHONPATH": source},
            preexec_fn=restore_signals,
        )
        running.append(process)
        return process

    yield start_command
    for process in running:
        process.kill()
        process.communicate()


def send(process: subprocess.Popen[bytes], data: bytes) -> None:
    assert process.stdin
    process.stdin.write(data)
    process.stdin.flush()


def wait_until(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + TIMEOUT
    while not condition():
        assert time.monotonic() < end, "timeout"
        time.sleep(0.02)


def saved_datapoints(folder: Path) -> int:
    """Return the number of datapoints in the saved stream file."""
    path = folder / "now.stream"
    return pf.io.open_stream(path).datapoints if path.exists() else 0


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_signal_saves_all_rows_before_it(
    start: StartCommand, tmp_path: Path, number: signal.Signals, code: int
):
    process = start("--save-every", "0.01")
    x = rows(120)
    for part in np.array_split(x, 40):
        send(process, text(part))
    send(process, b"0.5 0.2")
    wait_until(lambda: saved_datapoints(tmp_path) == 120)
    process.send_signal(number)
    process.send_signal(number)  # some wrappers send it once more
    out, err = process.communicate(timeout=TIMEOUT)
    assert (process.returncode, err) == (code, b"")
    assert b"120 datapoints" in out
    assert (tmp_path / "now.stream").read_bytes() == expected(x)


def test_row_is_learned_before_next_arrives(start: StartCommand, tmp_path: Path):
    process = start("--save-every", "0.01")
    x = rows(3)
    for n in range(3):
        send(process, text(x[n : n + 1]))
        wait_until(lambda n=n: saved_datapoints(tmp_path) == n + 1)  # type: ignore[misc]
    _, err = process.communicate(text(x[:1]).removesuffix(b"\n"), timeout=TIMEOUT)
    assert (process.returncode, err) == (0, b"")
    assert (tmp_path / "now.stream").read_bytes() == expected(np.concatenate([x, x[:1]]))


def test_signal_before_first_row_leaves_no_file(start: StartCommand, tmp_path: Path):
    process = start("--every", "1")
    send(process, b"# hello\n")
    wait_until(lambda: unread(process) == 0)
    process.send_signal(signal.SIGTERM)
    out, err = process.communicate(timeout=TIMEOUT)
    assert (process.returncode, out) == (143, b"")
    assert b"stopped before the first datapoint" in err
    assert not (tmp_path / "now.stream").exists()


def unread(process: subprocess.Popen[bytes]) -> int:
    """Return the number of bytes in the pipe that the process has not read."""
    assert process.stdin
    count = fcntl.ioctl(process.stdin, termios.FIONREAD, bytes(4))
    return int.from_bytes(count, sys.byteorder)


def test_rows_option_leaves_endless_source(start: StartCommand, tmp_path: Path):
    process = start("--rows", "5")
    process.communicate(text(rows(2000)), timeout=TIMEOUT)
    assert process.returncode == 0
    assert (tmp_path / "now.stream").read_bytes() == expected(rows(2000)[:5])
