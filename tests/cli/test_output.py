"""Output that cannot be printed loses no file and causes no traceback; signals end every command cleanly."""

import contextlib
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

FULL_DEVICE = Path("/dev/full")
LEARN = ["learn", "reaches", "--states", "2"]
STREAM = ["stream", "rows", "--learner", "dp-gmm", "--cluster", "0.1", "--noise", "1e-3", "--no-scale"]


@pytest.fixture
def work_folder(tmp_path: Path, folder: Path) -> Path:
    """Folder with demonstrations and a file of 60 rows."""
    assert folder.name == "reaches"
    (tmp_path / "rows").write_text("".join(f"{0.1 * n} {0.01 * n * n}\n" for n in range(60)))
    return tmp_path


def run_shell(command: list[str], streams: str, work_folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a command line in a shell with redirections such as 2>&-."""
    line = f'"$@" {streams}'
    program = [sys.executable, "-W", "ignore", "-m", "pilotfish", *command]
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2] / "src")}
    return subprocess.run(
        ["bash", "-o", "pipefail", "-c", line, "-", *program],
        cwd=work_folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )


CLOSED_REDIRECTS = ["2>&-", ">&-", ">&- 2>&-", "<&- >&- 2>&-"]
FULL_REDIRECTS = [">/dev/full", "2>/dev/full", ">/dev/full 2>/dev/full"]


@pytest.mark.parametrize("streams", [*CLOSED_REDIRECTS, *FULL_REDIRECTS])
@pytest.mark.parametrize("command", [[*LEARN, "--out", "new"], [*STREAM, "--every", "10", "--out", "new"]])
def test_unwritable_standard_streams_lose_no_file(work_folder: Path, streams: str, command: list[str]):
    if "full" in streams and not FULL_DEVICE.exists():
        pytest.skip("/dev/full does not exist")
    result = run_shell(command, streams, work_folder)
    assert result.returncode == int(
        any(part in streams for part in (">&- ", ">/dev/full ")) or streams[0] == ">"
    )
    assert (work_folder / "new").stat().st_size > 100
    assert result.stderr.count("\n") == int(streams in (">&-", ">/dev/full"))
    assert "Traceback" not in result.stderr
    assert run_shell(["show", "new"], "", work_folder).returncode == 0


@pytest.mark.parametrize("command", [["--help"], ["--version"], ["data", "list"], ["data", "list", "--json"]])
@pytest.mark.parametrize("streams", [">&-", ">/dev/full"])
def test_unprintable_result_has_one_line_and_exit_code_1(work_folder: Path, command: list[str], streams: str):
    result = run_shell(command, streams, work_folder)
    assert (result.returncode, result.stderr.count("\n")) == (1, 1)
    assert result.stderr.startswith("Error: ")


def test_unprintable_rejection_does_not_end_stream(work_folder: Path):
    rows = (work_folder / "rows").read_text().splitlines()
    (work_folder / "rows").write_text("\n".join([*rows[:9], "bad", *rows[9:]]))
    result = run_shell([*STREAM, "--out", "new"], "2>/dev/full", work_folder)
    assert result.returncode == 0
    assert "60 datapoints" in result.stdout


def test_closed_pipe_loses_no_model_and_prints_nothing(work_folder: Path):
    result = run_shell([*STREAM, "--every", "1", "--out", "new"], "| head -n 1", work_folder)
    assert (result.returncode, result.stdout.count("\n"), result.stderr) == (1, 1, "")
    assert '"datapoints": 60' in run_shell(["show", "new", "--json"], "", work_folder).stdout


def test_endless_stream_without_outputs_ends_with_reader(work_folder: Path):
    endless = [STREAM[0], "-", *STREAM[2:], "--every", "1"]
    result = run_shell(endless, "< <(yes '0.1 0.2') | head -n 1", work_folder)
    assert (result.returncode, result.stderr) == (1, "")


def test_unencodable_text_is_escaped(work_folder: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("PYTHONIOENCODING", "ascii:strict")
    result = run_shell([*LEARN, "--out", "new"], "", work_folder)
    assert result.returncode == 0
    assert r"\xb1" in result.stdout


def start_process(command: list[str], work_folder: Path, **streams: int) -> subprocess.Popen[bytes]:
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2] / "src")}
    program = [sys.executable, "-W", "ignore", "-m", "pilotfish", *command]
    return subprocess.Popen(program, cwd=work_folder, env=environment, stderr=subprocess.PIPE, **streams)


@pytest.fixture
def named_pipe(work_folder: Path) -> Iterator[Path]:
    os.mkfifo(work_folder / "pipe")
    yield work_folder / "pipe"
    (work_folder / "pipe").unlink()


def wait_until_opened(named_pipe: Path) -> int:
    """Open the pipe for writing after a reader has opened it."""
    for _ in range(600):
        try:
            return os.open(named_pipe, os.O_WRONLY | os.O_NONBLOCK)
        except OSError:
            time.sleep(0.05)
    raise AssertionError("no process opened the pipe")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_signal_stops_stream_from_pipe_without_writer(
    work_folder: Path, named_pipe: Path, number: signal.Signals
):
    process = start_process([STREAM[0], "pipe", *STREAM[2:], "--out", "new"], work_folder)
    descriptors = Path(f"/proc/{process.pid}/fd")
    if not descriptors.exists():
        process.kill()
        pytest.skip("without /proc the open pipe cannot be detected")
    while not any(link.readlink() == named_pipe for link in descriptors.iterdir() if link.is_symlink()):
        time.sleep(0.05)
    process.send_signal(number)
    _, output = process.communicate(timeout=60)
    assert (process.returncode, output.count(b"\n")) == (128 + number, 1)
    assert not (work_folder / "new").exists()


def test_named_pipe_reads_all_writers(work_folder: Path, named_pipe: Path):
    process = start_process(
        [STREAM[0], "pipe", *STREAM[2:], "--out", "new"], work_folder, stdout=subprocess.PIPE
    )
    first = wait_until_opened(named_pipe)
    os.write(first, b"0.1 0.2\n0.2 0.2\n")
    second = os.open(named_pipe, os.O_WRONLY)
    os.close(first)
    time.sleep(0.6)
    os.write(second, b"0.3 0.2\n")
    os.close(second)
    answer, _ = process.communicate(timeout=60)
    assert process.returncode == 0
    assert b"3 datapoints" in answer


def test_signal_stops_stream_with_stalled_reader(work_folder: Path):
    (work_folder / "rows").write_text("0.1 0.2\n" * 4000)
    reader, writer = os.pipe()
    process = start_process([*STREAM, "--every", "1", "--out", "new"], work_folder, stdout=writer)
    os.close(writer)
    while not os.read(reader, 1):
        time.sleep(0.05)
    time.sleep(2.0)  # by now the pipe is full
    process.send_signal(signal.SIGTERM)
    _, output = process.communicate(timeout=60)
    os.close(reader)
    assert process.returncode == 128 + signal.SIGTERM
    assert b"Traceback" not in output
    assert (work_folder / "new").exists()


def test_signal_stops_command_with_stalled_reader(work_folder: Path):
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    with contextlib.suppress(BlockingIOError):
        while os.write(writer, bytes(4096)):
            pass
    os.set_blocking(writer, True)
    process = start_process([*LEARN, "--out", "new"], work_folder, stdout=writer)
    os.close(writer)
    while not (work_folder / "new").exists():
        time.sleep(0.05)
    time.sleep(0.5)  # it waits for a reader
    process.send_signal(signal.SIGTERM)
    process.communicate(timeout=60)
    os.close(reader)
    assert process.returncode == 128 + signal.SIGTERM


def test_concurrent_commands_keep_every_result(work_folder: Path):
    line = [*LEARN, "--out", "new.skill"]
    processes = [
        start_process([*line, "--seed", str(seed)], work_folder, stdout=subprocess.DEVNULL)
        for seed in range(3)
    ]
    output = [process.communicate(timeout=60)[1].decode() for process in processes]
    codes = [process.returncode for process in processes]
    assert codes.count(0) == 1
    assert all("new" in words for words, code in zip(output, codes, strict=True) if code)
    kept = [
        words for words in output if "exists and is kept" in words
    ]  # unless it saw the file before its work
    assert len(list(work_folder.glob("new*.skill"))) == 1 + len(kept)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize("after", [0.0, 0.2, 0.5, 2.5])
def test_signal_at_any_time_gives_exit_code(work_folder: Path, number: signal.Signals, after: float):
    before = sorted(file.name for file in work_folder.iterdir())
    line = ["learn", "dataset:synthetic valve", "--restarts", "500", "--states", "9", "--out", "new"]
    process = start_process(line, work_folder, stdout=subprocess.PIPE)
    wait_until_caught(process.pid, signal.SIGTERM)
    time.sleep(after)
    process.send_signal(number)
    _, output = process.communicate(timeout=60)
    assert process.returncode == 128 + number
    assert b"Traceback" not in output
    assert sorted(file.name for file in work_folder.iterdir()) == before


def wait_until_caught(process: int, number: signal.Signals) -> None:
    """Return after the process has installed its handler of the signal."""
    status = Path(f"/proc/{process}/status")
    if not status.exists():
        pytest.skip("without /proc the start of the command cannot be detected")
    while not int(re.findall(r"SigCgt:\s*(\w+)", status.read_text())[0], 16) >> (number - 1) & 1:
        time.sleep(0.005)
