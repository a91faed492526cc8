"""What the physics costs: how much faster than real time each task runs, and what a step of control takes.

`python benchmarks/physics.py` measures on one core, prints the tables and writes them to
docs/benchmarks-physics.md. A run of a part (--quick) writes no file unless --out names one. With --peers the
kinematics are timed beside mink and Pinocchio, which are installed into build/peers-kinematics-venv.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from statistics import median
from time import perf_counter_ns, process_time
from typing import Any

import numpy as np

from pilotfish.simulation import require_mujoco

require_mujoco()  # it chooses what draws here, before anything else imports MuJoCo

import mujoco  # noqa: E402 - after the choice, as all that follows
from kinematics import Peer, compare_with_peers  # noqa: E402
from machine import load, machine  # noqa: E402
from workers import timed_environment  # noqa: E402

from pilotfish.control import impedance_torque  # noqa: E402
from pilotfish.environments import TASKS, SceneRenderer, Workcell  # noqa: E402
from pilotfish.environments.contacts import contact_forces  # noqa: E402
from pilotfish.environments.guidance import linear_path  # noqa: E402
from pilotfish.errors import SkillError  # noqa: E402
from pilotfish.geometry import Pose  # noqa: E402

HERE = Path(__file__).parent
TOP = HERE.parent
DOCUMENT = TOP / "docs" / "benchmarks-physics.md"
MIN_REALTIME_FACTOR, MAX_STEP, MAX_IMPORT = 5.0, 60.0, 0.3  # times real time; us; s: what is promised
STEPS_PER_OBSERVATION, AWAY, TURN = (
    20,
    0.05,
    3.0,
)  # ticks of one call; m and rad/s of the circle on which a target moves
PARTS = (
    "path",
    "reading",
    "Jacobian in it",
    "impedance",
    "motors",
    "step of control",
    "physics",
    "forces felt",
)
MODULES = ("pilotfish", "pilotfish.environments")


@dataclass(frozen=True, slots=True)
class MeasurementSettings:
    """rounds of each figure; seconds of simulation; ticks of control; targets of kinematics."""

    rounds: int
    seconds: float
    ticks: int
    targets: int


FULL, QUICK = MeasurementSettings(7, 3.0, 20_000, 100), MeasurementSettings(2, 0.2, 200, 4)


@dataclass(frozen=True, slots=True)
class Speed:
    """Of one task: simulated seconds for each of CPU, seconds of CPU to set up and to draw 640 x 480."""

    task: str
    held: float
    moving: float
    led: float
    setup: float
    frame: float | None
    contacts: int


@dataclass(frozen=True, slots=True)
class Part:
    """Microseconds of wall time of a part of one tick."""

    name: str
    median: float
    p99: float


def main() -> None:
    asked = arguments()
    measurement, before = QUICK if asked.quick else FULL, load()
    speeds = [speed(name, measurement) for name in sorted(TASKS)]
    parts = tick_parts(measurement)
    imports = {module: import_seconds(module, measurement.rounds) for module in MODULES}
    sizes = None if asked.quick else download_sizes()
    peers = compare_with_peers(measurement.rounds, measurement.targets) if asked.peers else []
    words = "python benchmarks/physics.py" + " --quick" * asked.quick + " --peers" * asked.peers
    text = "\n".join(document(words, (before, load()), speeds, parts, (imports, sizes), peers)) + "\n"
    print(text)
    out = asked.out or (None if asked.quick else DOCUMENT)
    if out:
        out.write_text(text, encoding="utf-8")
    if asked.json:
        told: dict[str, Any] = {"machine": asdict(machine()), "imports": imports, "download_mb": sizes}
        told |= {
            "speeds": [*map(asdict, speeds)],
            "parts": [*map(asdict, parts)],
            "peers": [*map(asdict, peers)],
        }
        asked.json.write_text(json.dumps(told, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="a moment of each: does everything work?")
    parser.add_argument("--peers", action="store_true", help="kinematics beside mink and Pinocchio")
    parser.add_argument("--out", type=Path, help="file for the tables (default docs/benchmarks-physics.md)")
    parser.add_argument("--json", type=Path, help="file for all figures")
    return parser.parse_args()


def workcell(name: str, *, guided: bool = False) -> Workcell[Any]:
    task = TASKS[name]
    return Workcell(task, task.sample_situation(np.random.default_rng(0)), guided=guided)


def speed(name: str, measurement: MeasurementSettings) -> Speed:
    print(name, file=sys.stderr, flush=True)
    taken = [cpu(lambda: workcell(name)) for _ in range(measurement.rounds)]
    cell, both = workcell(name), workcell(name, guided=True)
    held: list[float] = []
    moving: list[float] = []
    led: list[float] = []
    for _ in range(measurement.rounds):
        held.append(realtime_factor(cell, cell.step_impedance, measurement, still=True))
        moving.append(realtime_factor(cell, cell.step_impedance, measurement))
        led.append(realtime_factor(both, both.step_guidance, measurement))
    frame = frame_seconds(cell, name, measurement.rounds)
    figures = median(held), median(moving), median(led), median(taken)
    return Speed(name, *figures, frame, int(cell.data.ncon))


def cpu(act: Callable[[], object]) -> float:
    before = process_time()
    act()
    return process_time() - before


Move = Callable[[Pose, float, int], None]


def realtime_factor(
    cell: Workcell[Any], move: Move, measurement: MeasurementSettings, *, still: bool = False
) -> float:
    """Simulated seconds for each of CPU; the target goes up and down unless it is held still."""
    start_pose = cell.target
    looks = round(measurement.seconds / (STEPS_PER_OBSERVATION * Workcell.timestep))

    def act() -> None:
        for n in range(1, looks + 1):
            up = 0.0 if still else AWAY * (1.0 - np.cos(TURN * n * STEPS_PER_OBSERVATION * Workcell.timestep))
            move(
                Pose(start_pose.position + np.array([0.0, 0.0, up]), start_pose.quaternion),
                0.0,
                STEPS_PER_OBSERVATION,
            )

    simulated = looks * STEPS_PER_OBSERVATION * Workcell.timestep
    seconds = cpu(act)
    move(start_pose, 0.0, STEPS_PER_OBSERVATION)
    return simulated / seconds


def frame_seconds(cell: Workcell[Any], name: str, rounds: int) -> float | None:
    try:
        with SceneRenderer(cell.model, cell.task.view) as renderer:
            renderer.render(cell.data)
            return median(cpu(lambda: renderer.render(cell.data)) for _ in range(rounds))
    except SkillError as error:
        print(error, file=sys.stderr)
        return None


def tick_parts(measurement: MeasurementSettings) -> list[Part]:
    """The parts of Workcell.step_impedance's tick, in its order, on the valve with a moving target."""
    cell = workcell("valve")
    start_pose = cell.target
    stamps: list[tuple[int, ...]] = []
    while len(stamps) < measurement.ticks:
        up = AWAY * (1.0 - np.cos(TURN * cell.time))
        target = Pose(start_pose.position + np.array([0.0, 0.0, up]), start_pose.quaternion)
        path = linear_path(cell.target, target, STEPS_PER_OBSERVATION, Workcell.timestep)
        stamps += [tick(cell, path, n) for n in range(STEPS_PER_OBSERVATION)]
        cell.target = target
    jacobians = [timed_jacobian(cell) for _ in range(measurement.ticks)]
    path_, reading, torque, motors, moved, felt, placed = (np.diff(np.array(stamps), axis=1) / 1000.0).T
    whole = path_ + reading + torque + motors
    columns = (path_, reading, np.array(jacobians), torque, motors, whole, moved + placed, felt)
    return [
        Part(name, float(np.median(took)), float(np.quantile(took, 0.99)))
        for name, took in zip(PARTS, columns, strict=True)
    ]


def tick(cell: Workcell[Any], path: Any, n: int) -> tuple[int, ...]:
    """One tick; when each part of it began, and when it ended [ns]."""
    began = perf_counter_ns()
    wanted = path[n]
    there = perf_counter_ns()
    reading = cell.arm.read_state()
    read = perf_counter_ns()
    torque = impedance_torque(cell.impedance, cell.limits, reading, wanted).torque
    thought = perf_counter_ns()
    cell.arm.motors[:] = torque
    written = perf_counter_ns()
    mujoco.mj_step2(cell.model, cell.data)
    moved = perf_counter_ns()
    contact_forces(cell.model, cell.data, cell.task.fragile_geoms)
    felt = perf_counter_ns()
    mujoco.mj_step1(cell.model, cell.data)
    return began, there, read, thought, written, moved, felt, perf_counter_ns()


def timed_jacobian(cell: Workcell[Any]) -> float:
    began = perf_counter_ns()
    cell.arm.jacobian()
    return (perf_counter_ns() - began) / 1000.0


def import_seconds(module: str, rounds: int) -> float:
    """The median over fresh processes, the first for nothing: it writes bytecode."""
    program = f"from time import perf_counter as now; t = now(); import {module}; print(now() - t)"
    command = [sys.executable, "-W", "ignore", "-c", program]
    told = [
        subprocess.run(command, capture_output=True, text=True, env=timed_environment(), check=True).stdout
        for _ in range(rounds + 1)
    ]
    return median(float(words) for words in told[1:])


def download_sizes() -> dict[str, float] | None:
    """Megabytes of each wheel that pip fetches for pilotfish[sim], without pilotfish itself."""
    project = tomllib.loads((TOP / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    wanted = [*project["dependencies"], *project["optional-dependencies"]["sim"]]
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "pip", "download", "--quiet", "--dest", folder, *wanted]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            print(done.stderr, file=sys.stderr)
            return None
        return {file.name.split("-")[0]: file.stat().st_size / 1e6 for file in sorted(Path(folder).iterdir())}


def document(
    words: str,
    loads: tuple[float, float],
    speeds: Sequence[Speed],
    parts: Sequence[Part],
    rest: tuple[Mapping[str, float], Mapping[str, float] | None],
    peers: Sequence[Peer],
) -> Iterator[str]:
    imports, sizes = rest
    yield "# Benchmarks of the physics"
    yield ""
    yield (
        f"Written on {datetime.now(UTC):%Y-%m-%d} by `{words}`. Everything runs on one core, physics "
        "and control both at 1 kHz, without pictures. Figures are medians over rounds."
    )
    yield from ("", "## Targets", "")
    yield from requirement_results(speeds, parts, imports)
    yield from ("", "## Faster than real time", "")
    yield from table_of_speeds(speeds)
    yield from ("", "## A step of control", "")
    yield from table_of_parts(parts)
    yield from ("", "## Imports and download", "")
    yield from describe_imports(imports, sizes)
    if peers:
        yield from ("", "## Kinematics", "")
        yield from table_of_peers(peers)
    yield from ("", "## Machine", "")
    m = machine()
    yield (
        f"{m.processor}, {m.cores} cores, {m.memory_gb:.0f} GB, {m.system}; MuJoCo {mujoco.__version__}, "
        f"NumPy {np.__version__}; load {loads[0]:.1f} before and {loads[1]:.1f} after: with more than one "
        "process to a core, times of parts and their p99 are longer than on a machine that is idle."
    )


def requirement_results(
    speeds: Sequence[Speed], parts: Sequence[Part], imports: Mapping[str, float]
) -> Iterator[str]:
    slowest = min(speeds, key=lambda s: min(s.held, s.moving))
    factor_ = min(slowest.held, slowest.moving)
    step = next(part for part in parts if part.name == "step of control").median
    yield from ("| target | measured | verdict |", "| --- | --- | ---: |")
    for target, told, kept in (
        (
            f"one arm at least {MIN_REALTIME_FACTOR:g} x real time in every task",
            f"{factor_:.1f} x ({slowest.task})",
            factor_ >= MIN_REALTIME_FACTOR,
        ),
        (f"a step of control at most {MAX_STEP:g} us, median", f"{step:.1f} us", step <= MAX_STEP),
        (
            f"`import pilotfish` under {MAX_IMPORT:g} s",
            f"{imports['pilotfish']:.2f} s",
            imports["pilotfish"] < MAX_IMPORT,
        ),
    ):
        yield f"| {target} | {told} | {'pass' if kept else 'MISS'} |"


def table_of_speeds(speeds: Sequence[Speed]) -> Iterator[str]:
    yield (
        "Simulated seconds for each second of CPU: one arm that holds its home, one whose tool goes up and "
        "down by 100 mm, and two arms, the left led by a hand that moves so and the right following. Set-up "
        "is from task and situation to an arm that waits; a frame has 640 x 480 points; contacts are those "
        "at the end of the rounds."
    )
    yield ""
    yield "| task | held | moving | two arms, led | set-up s | frame ms | contacts |"
    yield "| --- | ---: | ---: | ---: | ---: | ---: | ---: |"
    for s in speeds:
        frame = "" if s.frame is None else f"{1000 * s.frame:.0f}"
        factors = f"{s.held:.1f} | {s.moving:.1f} | {s.led:.1f}"
        yield f"| {s.task} | {factors} | {s.setup:.3f} | {frame} | {s.contacts} |"


def table_of_parts(parts: Sequence[Part]) -> Iterator[str]:
    yield (
        "Wall time of the parts of one tick of the valve's arm, in the order in which `Workcell.step_impedance` does "
        "them. A step of control is what stands above it; the Jacobian was timed by itself."
    )
    yield from ("", "| part | median us | p99 us |", "| --- | ---: | ---: |")
    for part in parts:
        yield f"| {part.name} | {part.median:.1f} | {part.p99:.1f} |"


def describe_imports(imports: Mapping[str, float], sizes: Mapping[str, float] | None) -> Iterator[str]:
    for module, seconds in imports.items():
        yield f"- `import {module}` takes {seconds:.2f} s, in a fresh process."
    if sizes:
        largest = sorted(sizes.items(), key=lambda item: -item[1])[:4]
        told = ", ".join(f"{name} {size:.0f}" for name, size in largest)
        yield (
            f"- `pip install 'pilotfish[sim]'` downloads {sum(sizes.values()):.0f} MB in {len(sizes)} "
            "files besides pilotfish itself: what `pip download` fetches for this Python and system, nothing "
            f"being there. The largest: {told} MB."
        )


def table_of_peers(peers: Sequence[Peer]) -> Iterator[str]:
    yield (
        "CPU of one call, by turns in one run; a ratio below 1 says that the peer is faster. Targets differ "
        "from the start by up to half a radian in each joint and are reached within 1e-6 m and 1e-5 rad. No "
        "loop waits for ours: a workcell asks for one posture when it is set up."
    )
    yield ""
    yield from (
        "| what | pilotfish us | peer | its us | ratio | remarks |",
        "| --- | ---: | --- | ---: | ---: | --- |",
    )
    for p in peers:
        figures = f"{p.ours:.1f} | {p.name} | {p.theirs:.1f} | {p.theirs / p.ours:.2f}"
        yield f"| {p.what} | {figures} | {p.print_note} |"


if __name__ == "__main__":
    main()
