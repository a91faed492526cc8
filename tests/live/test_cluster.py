"""Learning on a Dask cluster of real processes: equal results, killed workers, damaged parts, Ctrl-C."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pilotfish.cluster import connect, open_set
from pilotfish.demonstrations import Demonstration, demonstration, frame, position_layout
from pilotfish.errors import InvalidInput
from pilotfish.gaussians import structures
from pilotfish.io import content_hash, open_skill, write_demonstrations
from pilotfish.io.writers import lerobot_dataset
from pilotfish.models import PARTITION_SIZE, DurationModel, EMSettings, TimeBins, learn

COUNT = 2 * PARTITION_SIZE + 30  # three parts
TIMEOUT = 120.0  # s, for processes on a busy machine
FITS: dict[str, dict[str, Any]] = {
    "default": {},
    "full": {"states": 3, "structure": structures.Full()},
    "diagonal": {"states": 3, "structure": structures.Diagonal(), "initialisation": TimeBins()},
    "semi-tied": {"states": 3, "structure": structures.SemiTied()},
    "fitted durations": {"states": 3, "durations": DurationModel()},
}
pytestmark = [
    pytest.mark.slow,
    pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::DeprecationWarning"),
]


def make_demonstrations() -> list[Demonstration]:
    rng = np.random.default_rng(3)
    stops = np.array([[0.0, 0.0], [2.0, 1.0], [0.0, 3.0]])
    demos = []
    for m in range(COUNT):
        rows = np.sort(rng.integers(0, 3, size=rng.integers(18, 30)))
        x = stops[rows] + 0.1 * rng.normal(size=(len(rows), 2))
        placed = frame("object", np.eye(2), rng.normal(size=2))
        demos.append(demonstration(x, 0.1, position_layout(2), (placed,), f"passage {m}"))
    return demos


@pytest.fixture(scope="module")
def demos() -> list[Demonstration]:
    return make_demonstrations()


@pytest.fixture(scope="module")
def folder(demos: list[Demonstration], tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp("cluster") / "set"
    lerobot_dataset.write(demos, target)
    return target


@pytest.fixture(scope="module")
def client() -> Iterator[Any]:
    with connect("local:2") as connected:
        yield connected


@pytest.mark.parametrize("options", FITS.values(), ids=FITS.keys())
def test_learn_on_cluster_equals_one_process(client, folder, demos, options):
    """All numbers, names and hashes of the skill are equal: sums have the same order."""
    found = learn(open_set(client, folder), rng=np.random.default_rng(0), **options)
    expected = learn(demos, rng=np.random.default_rng(0), **options)
    np.testing.assert_allclose(found.skill.means, expected.skill.means, rtol=1e-9)
    assert content_hash(found.skill) == content_hash(expected.skill)
    assert found.convergence.reason == expected.convergence.reason


def test_learn_killed_worker_gives_the_equal_result(folder, demos):
    """The parts of the killed worker are read and computed again."""
    killed: list[int] = []
    iterations: list[int] = []

    def kill_one(done: int, total: int) -> None:
        if len(iterations) == 2 and done == 1 and not killed:
            killed.append(pids[0])
            os.kill(pids[0], signal.SIGKILL)

    settings = EMSettings(callback=lambda iteration, _: iterations.append(iteration), min_gain=1e-3)
    options: dict[str, Any] = {"states": 3, "settings": settings, "initialisation": TimeBins()}
    with connect("local:2") as client:
        pids = list(client.run(os.getpid).values())
        source = open_set(client, folder, progress=kill_one)
        found = learn(source, rng=np.random.default_rng(0), **options)
    assert killed
    expected = learn(demos, rng=np.random.default_rng(0), **options)
    assert content_hash(found.skill) == content_hash(expected.skill)


def test_open_set_damaged_demonstration_is_named(client, demos, tmp_path):
    write_demonstrations(demos, tmp_path / "set")
    file = sorted((tmp_path / "set").glob("*.csv"))[PARTITION_SIZE + 7]
    file.write_text(file.read_text().replace(".", ",", 1))
    with pytest.raises(InvalidInput, match=rf"demonstrations 100 to 199, read by worker tcp.*{file.name}"):
        learn(open_set(client, tmp_path / "set"), states=3, rng=np.random.default_rng(0))


def start_command(*arguments: str, cwd: Path) -> subprocess.Popen[bytes]:
    source = str(Path(__file__).parents[2] / "src")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([source, os.environ.get("PYTHONPATH", "")])}
    command = [sys.executable, "-W", "ignore", "-m", "pilotfish", *arguments]
    return subprocess.Popen(
        command,
        cwd=cwd,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )


def processes_of_session(session: int) -> list[int]:
    """Return the living processes of a session; zombies do not count."""
    found = []
    for entry in Path("/proc").iterdir():
        try:
            fields = (entry / "stat").read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if entry.name.isdigit() and int(fields[3]) == session and fields[0] != "Z":
            found.append(int(entry.name))
    return found


def test_learn_command_on_cluster_writes_the_same_file(folder, tmp_path):
    options = ["learn", str(folder), "--states", "3"]
    for name, more in (("one", []), ("two", ["--cluster", "local:2"])):
        process = start_command(*options, *more, "--out", f"{name}.skill", cwd=tmp_path)
        _, errors = process.communicate(timeout=TIMEOUT)
        assert process.returncode == 0, errors
        assert processes_of_session(process.pid) == []
    assert content_hash(open_skill(tmp_path / "one.skill")) == content_hash(
        open_skill(tmp_path / "two.skill")
    )


@pytest.mark.parametrize("to_group", [True, False])
def test_learn_command_interrupted_ends_all_processes(folder, tmp_path, to_group):
    """A terminal sends Ctrl-C to all processes; `kill` to one."""
    process = start_command("learn", str(folder), "--cluster", "local:2", "--out", "a.skill", cwd=tmp_path)
    deadline = time.monotonic() + TIMEOUT
    while len(processes_of_session(process.pid)) < 3 and time.monotonic() < deadline:
        time.sleep(0.05)
    (os.killpg if to_group else os.kill)(process.pid, signal.SIGINT)
    _, errors = process.communicate(timeout=TIMEOUT)
    assert process.returncode == 130
    assert errors.decode().splitlines()[-1] == "stopped by SIGINT"
    while processes_of_session(process.pid) and time.monotonic() < deadline:  # the last one is just ending
        time.sleep(0.05)
    assert processes_of_session(process.pid) == []
    assert not list(tmp_path.glob("*.skill"))
