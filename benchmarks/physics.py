"""Measure the physics: real-time factor of each task, and time of a control step.

`python benchmarks/physics.py` measures on one core, prints the tables and writes them to
docs/benchmarks-physics.md. A quick run writes no file unless --out names one. With --peers the kinematics are
compared with mink and Pinocchio, which are installed into build/peers-kinematics-venv.
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

from pilotfish.rendering import require_mujoco

require_mujoco()  # it chooses the rendering backend before anything else imports MuJoCo

import mujoco  # noqa: E402 - after require_mujoco, like all below
from kinematics import Peer, compare_with_peers  # noqa: E402
from machine import load, machine  # noqa: E402
from workers import timed_environment  # noqa: E402

from pilotfish.control import impedance_torque  # noqa: E402
from pilotfish.environments import (  # noqa: E402
    TASKS,
    SceneRenderer,
    Workcell,
    contact_forces,
    linear_path,
)
from pilotfish.errors import SkillError  # noqa: E402
from pilotfish.geometry import Pose  # noqa: E402

HERE = Path(__file__).parent
TOP = HERE.parent
DOCUMENT = TOP / "docs" / "benchmarks-physics.md"
MIN_REALTIME_FACTOR, MAX_STEP, MAX_IMPORT = 5.0, 60.0, 0.3  # requirements: times real time, us, s
STEPS_PER_CALL = 20  # timesteps
AMPLITUDE, FREQUENCY = 0.05, 3.0  # m, rad/s, of a moving target
PARTS = (
    "path",
    "state",
    "Jacobian in it",
    "impedance",
    "motors",
    "control step",
    "physics",
    "contact forces",
)
MODULES = ("pilotfish", "pilotfish.environments")


@dataclass(frozen=True, slots=True)
class MeasurementSettings:
    """Numbers of rounds, simulated seconds, control steps and kinematic targets."""

    rounds: int
    seconds: float
    steps: int
    targets: int


FULL, QUICK = MeasurementSettings(7, 3.0, 20_000, 100), MeasurementSettings(2, 0.2, 200, 4)


@dataclass(frozen=True, slots=True)
class Speed:
    """Real-time factors of a task, and CPU seconds of its set-up and of a 640 x 480 image."""

    task: str
    held: float
    moving: float
    guided: float
    setup: float
    frame: float | None
    contacts: int


@dataclass(frozen=True, slots=True)
class Part:
    """Wall time of a part of one control step [us]."""

    name: str
    median: float
    p99: float


def main() -> None:
    options = arguments()
    measurement, before = QUICK if options.quick else FULL, load()
    speeds = [measure_speed(name, measurement) for name in sorted(TASKS)]
    parts = measure_parts(measurement)
    imports = {module: import_seconds(module, measurement.rounds) for module in MODULES}
    sizes = None if options.quick else download_sizes()
    peers = compare_with_peers(measurement.rounds, measurement.targets) if options.peers else []
    command = "python benchmarks/physics.py" + " --quick" * options.quick + " --peers" * options.peers
    text = "\n".join(document(command, (before, load()), speeds, parts, (imports, sizes), peers)) + "\n"
    print(text)
    out = options.out or (None if options.quick else DOCUMENT)
    if out:
        out.write_text(text, encoding="utf-8")
    if options.json:
        figures: dict[str, Any] = {"machine": asdict(machine()), "imports": imports, "download_mb": sizes}
        figures |= {
            "speeds": [*map(asdict, speeds)],
            "parts": [*map(asdict, parts)],
            "peers": [*map(asdict, peers)],
        }
        options.json.write_text(json.dumps(figures, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="a short run, to test that everything works")
    parser.add_argument("--peers", action="store_true", help="compare kinematics with mink and Pinocchio")
    parser.add_argument("--out", type=Path, help="file for the tables (default docs/benchmarks-physics.md)")
    parser.add_argument("--json", type=Path, help="file for all figures")
    return parser.parse_args()


def workcell(name: str, *, guided: bool = False) -> Workcell[Any]:
    """Return a workcell in the situation of seed 0."""
    task = TASKS[name]
    return Workcell(task, task.sample_situation(np.random.default_rng(0)), guided=guided)


def measure_speed(name: str, measurement: MeasurementSettings) -> Speed:
    print(name, file=sys.stderr, flush=True)
    setup = [cpu_seconds(lambda: workcell(name)) for _ in range(measurement.rounds)]
    cell, both = workcell(name), workcell(name, guided=True)
    held: list[float] = []
    moving: list[float] = []
    guided: list[float] = []
    for _ in range(measurement.rounds):
        held.append(realtime_factor(cell, cell.step_impedance, measurement, still=True))
        moving.append(realtime_factor(cell, cell.step_impedance, measurement))
        guided.append(realtime_factor(both, both.step_guidance, measurement))
    frame = frame_seconds(cell, name, measurement.rounds)
    figures = median(held), median(moving), median(guided), median(setup)
    return Speed(name, *figures, frame, int(cell.data.ncon))


def cpu_seconds(function: Callable[[], object]) -> float:
    """Return the CPU time of a call."""
    before = process_time()
    function()
    return process_time() - before


Move = Callable[[Pose, float, int], None]


def realtime_factor(
    cell: Workcell[Any], move: Move, measurement: MeasurementSettings, *, still: bool = False
) -> float:
    """Return simulated seconds per CPU second; the target oscillates unless it is still."""
    start_pose = cell.target
    calls = round(measurement.seconds / (STEPS_PER_CALL * Workcell.timestep))

    def move_all() -> None:
        for n in range(1, calls + 1):
            up = (
                0.0
                if still
                else AMPLITUDE * (1.0 - np.cos(FREQUENCY * n * STEPS_PER_CALL * Workcell.timestep))
            )
            move(
                Pose(start_pose.position + np.array([0.0, 0.0, up]), start_pose.quaternion),
                0.0,
                STEPS_PER_CALL,
            )

    simulated = calls * STEPS_PER_CALL * Workcell.timestep
    seconds = cpu_seconds(move_all)
    move(start_pose, 0.0, STEPS_PER_CALL)
    return simulated / seconds


def frame_seconds(cell: Workcell[Any], name: str, rounds: int) -> float | None:
    try:
        with SceneRenderer(cell.model, cell.task.view) as renderer:
            renderer.render(cell.data)
            return float(median(cpu_seconds(lambda: renderer.render(cell.data)) for _ in range(rounds)))
    except SkillError as error:
        print(error, file=sys.stderr)
        return None


def measure_parts(measurement: MeasurementSettings) -> list[Part]:
    """Measure the parts of a timestep of Workcell.step_impedance with a moving target."""
    cell = workcell("valve")
    start_pose = cell.target
    stamps: list[tuple[int, ...]] = []
    while len(stamps) < measurement.steps:
        up = AMPLITUDE * (1.0 - np.cos(FREQUENCY * cell.time))
        target = Pose(start_pose.position + np.array([0.0, 0.0, up]), start_pose.quaternion)
        path = linear_path(cell.target, target, STEPS_PER_CALL, Workcell.timestep)
        stamps += [timed_step(cell, path, n) for n in range(STEPS_PER_CALL)]
        cell.target = target
    jacobians = [timed_jacobian(cell) for _ in range(measurement.steps)]
    path_, state, torque, motors, step2, forces, step1 = (np.diff(np.array(stamps), axis=1) / 1000.0).T
    control_step = path_ + state + torque + motors
    columns = (path_, state, np.array(jacobians), torque, motors, control_step, step2 + step1, forces)
    return [
        Part(name, float(np.median(times)), float(np.quantile(times, 0.99)))
        for name, times in zip(PARTS, columns, strict=True)
    ]


def timed_step(cell: Workcell[Any], path: Any, n: int) -> tuple[int, ...]:
    """Simulate one timestep, and return the start of each of its parts and its end [ns]."""
    stamps = [perf_counter_ns()]
    target = path[n]
    stamps.append(perf_counter_ns())
    state = cell.arm.read_state()
    stamps.append(perf_counter_ns())
    torque = impedance_torque(cell.impedance, cell.limits, state, target).torque
    stamps.append(perf_counter_ns())
    cell.arm.motors[:] = torque
    stamps.append(perf_counter_ns())
    mujoco.mj_step2(cell.model, cell.data)
    stamps.append(perf_counter_ns())
    contact_forces(cell.model, cell.data, cell.task.fragile_geoms)
    stamps.append(perf_counter_ns())
    mujoco.mj_step1(cell.model, cell.data)
    stamps.append(perf_counter_ns())
    return tuple(stamps)


def timed_jacobian(cell: Workcell[Any]) -> float:
    """Return the time of one Jacobian [us]."""
    start = perf_counter_ns()
    cell.arm.jacobian()
    return (perf_counter_ns() - start) / 1000.0


def import_seconds(module: str, rounds: int) -> float:
    """Return the median import time of fresh processes, after one that writes bytecode [s]."""
    program = f"from time import perf_counter as now; t = now(); import {module}; print(now() - t)"
    command = [sys.executable, "-W", "ignore", "-c", program]
    outputs = [
        subprocess.run(command, capture_output=True, text=True, env=timed_environment(), check=True).stdout
        for _ in range(rounds + 1)
    ]
    return median(float(output) for output in outputs[1:])


def download_sizes() -> dict[str, float] | None:
    """Return the size of each wheel that pip downloads for pilotfish[sim], without pilotfish [MB]."""
    project = tomllib.loads((TOP / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    requirements = [*project["dependencies"], *project["optional-dependencies"]["sim"]]
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "pip", "download", "--quiet", "--dest", folder, *requirements]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            print(done.stderr, file=sys.stderr)
            return None
        return {file.name.split("-")[0]: file.stat().st_size / 1e6 for file in sorted(Path(folder).iterdir())}


def document(
    command: str,
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
        f"Written on {datetime.now(UTC):%Y-%m-%d} by `{command}`. Everything runs on one core, physics "
        "and control both at 1 kHz, without images. Figures are medians over rounds."
    )
    yield from ("", "## Targets", "")
    yield from requirement_results(speeds, parts, imports)
    yield from ("", "## Real-time factors", "")
    yield from table_of_speeds(speeds)
    yield from ("", "## Control step", "")
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
        f"NumPy {np.__version__}; load {loads[0]:.1f} before and {loads[1]:.1f} after. With more than one "
        "process per core, times of parts and their p99 are longer than on an idle machine."
    )


def requirement_results(
    speeds: Sequence[Speed], parts: Sequence[Part], imports: Mapping[str, float]
) -> Iterator[str]:
    slowest = min(speeds, key=lambda s: min(s.held, s.moving))
    factor = min(slowest.held, slowest.moving)
    step = next(part for part in parts if part.name == "control step").median
    yield from ("| target | measured | verdict |", "| --- | --- | ---: |")
    for target, measured, passed in (
        (
            f"one arm at least {MIN_REALTIME_FACTOR:g} x real time in every task",
            f"{factor:.1f} x ({slowest.task})",
            factor >= MIN_REALTIME_FACTOR,
        ),
        (f"a control step at most {MAX_STEP:g} us, median", f"{step:.1f} us", step <= MAX_STEP),
        (
            f"`import pilotfish` under {MAX_IMPORT:g} s",
            f"{imports['pilotfish']:.2f} s",
            imports["pilotfish"] < MAX_IMPORT,
        ),
    ):
        yield f"| {target} | {measured} | {'pass' if passed else 'MISS'} |"


def table_of_speeds(speeds: Sequence[Speed]) -> Iterator[str]:
    yield (
        "Simulated seconds per CPU second, for one arm at rest, for one arm whose tool oscillates by 100 mm, "
        "and for two arms. There a hand guides the left arm in the same way, and the right arm follows. "
        "Set-up builds a workcell from task and situation. An image has 640 x 480 pixels. Contacts are "
        "counted at the end of the rounds."
    )
    yield ""
    yield "| task | at rest | moving | two arms, guided | set-up s | image ms | contacts |"
    yield "| --- | ---: | ---: | ---: | ---: | ---: | ---: |"
    for s in speeds:
        frame = "" if s.frame is None else f"{1000 * s.frame:.0f}"
        factors = f"{s.held:.1f} | {s.moving:.1f} | {s.guided:.1f}"
        yield f"| {s.task} | {factors} | {s.setup:.3f} | {frame} | {s.contacts} |"


def table_of_parts(parts: Sequence[Part]) -> Iterator[str]:
    yield (
        "Wall time of the parts of a timestep of the valve task, in the order of "
        "`Workcell.step_impedance`. A control step is the sum of the parts above it; the Jacobian was "
        "also measured alone."
    )
    yield from ("", "| part | median us | p99 us |", "| --- | ---: | ---: |")
    for part in parts:
        yield f"| {part.name} | {part.median:.1f} | {part.p99:.1f} |"


def describe_imports(imports: Mapping[str, float], sizes: Mapping[str, float] | None) -> Iterator[str]:
    for module, seconds in imports.items():
        yield f"- `import {module}` takes {seconds:.2f} s in a fresh process."
    if sizes:
        largest = sorted(sizes.items(), key=lambda item: -item[1])[:4]
        names = ", ".join(f"{name} {size:.0f}" for name, size in largest)
        yield (
            f"- `pip install '.[sim]'` downloads {sum(sizes.values()):.0f} MB in {len(sizes)} "
            "files besides pilotfish, for this Python and system and without installed packages. "
            f"The largest are {names} MB."
        )


def table_of_peers(peers: Sequence[Peer]) -> Iterator[str]:
    yield (
        "CPU time of one call in one run with turns; a ratio below 1 means that the peer is faster. Targets "
        "differ from the start by up to half a radian in each joint. The tolerance is 1e-6 m and 1e-5 rad. "
        "Pilotfish solves inverse kinematics once, when a workcell is built."
    )
    yield ""
    yield from (
        "| task | pilotfish us | peer | peer us | ratio | remarks |",
        "| --- | ---: | --- | ---: | ---: | --- |",
    )
    for p in peers:
        figures = f"{p.ours:.1f} | {p.name} | {p.theirs:.1f} | {p.theirs / p.ours:.2f}"
        yield f"| {p.task} | {figures} | {p.remark} |"


if __name__ == "__main__":
    main()
