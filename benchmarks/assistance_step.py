"""Measure the CPU time of one step of assistance.

    python benchmarks/assistance_step.py --steps 1000000

A skill of a pose with a grip, seven states and two frames follows a hand that repeats a demonstration at
1 kHz. The rows are

    kernel           one step in the compiled kernel, called from Python
    step, still      step_assistance while no frame moves
    step, moving     step_assistance while the frames of both scenes move at every step
    reference        the kernel's NumPy reference

Times are CPU microseconds of this thread. The first and last median are those of the first and last tenth.
"""

import argparse
import json
import time
from collections.abc import Callable
from dataclasses import asdict, replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from machine import load, machine

import pilotfish as pf
from pilotfish import assistance, kernels
from pilotfish.demonstrations import Demonstration, Frame, Layout, Part, Quantity, demonstration, pose_layout
from pilotfish.kernels import AssistanceInput
from pilotfish.types import Array, Float

reference: Any = import_module("pilotfish.kernels.reference")

STATES, PERIOD = 7, 0.001
LAYOUT = Layout((*pose_layout().parts, Part("grip", Quantity.SCALAR, 1, "1")))
COLUMNS = ("row", "median", "p99.9", "first median", "last median")
SLOW_STEPS = 2000  # of rows that take milliseconds


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--steps", type=int, default=100_000, help="number of steps of a row")
    parser.add_argument("--json", type=Path, help="write the numbers to this file")
    arguments = parser.parse_args()
    rows = measure(arguments.steps)
    print(f"{kernels.BACKEND} kernels, {arguments.steps:,} steps, CPU us; {machine().processor}")
    print(f"load {load():.1f} of {machine().cores} cores\n")
    print("| " + " | ".join(COLUMNS) + " |\n| --- |" + " ---: |" * (len(COLUMNS) - 1))
    for name, values in rows.items():
        print(f"| {name} | " + " | ".join(f"{value:.1f}" for value in values) + " |")
    if arguments.json:
        arguments.json.write_text(json.dumps({"machine": asdict(machine()), "rows": rows}, indent=1))


def measure(steps: int) -> dict[str, tuple[float, ...]]:
    """Return median, p99.9, first and last median of each row [us]."""
    demo, skill = learn()
    assisted = assistance.assisted_skill(skill)
    assistant = assistance.make_assistant([assisted])
    hands = [np.ascontiguousarray(row) for row in demo.x]
    still = [frame.at(0) for frame in demo.frames]
    moved = [shifted(frame, 0.03) for frame in still]
    state = assistance.initial_state(assistant, hands[0], still, moved)
    arguments = (
        state.hand_map,
        state.situation.carried,
        assisted.tables,
        assistant.settings[0],
    )

    def kernel_step(step: Callable[..., kernels.AssistanceStep]) -> Callable[[int], None]:
        memory = state.memory
        given = AssistanceInput(hands[0], None, None, PERIOD, kernels.SHARED, True, True, False)

        def run(t: int) -> None:
            nonlocal memory
            memory = step(*arguments, memory, replace(given, hand=hand_at(hands, t))).memory

        return run

    def whole_step(is_moving: bool) -> Callable[[int], None]:
        now = state

        def run(t: int) -> None:
            nonlocal now
            actual = [shifted(frame, 0.03 + 1e-6 * (t % 1000)) for frame in still] if is_moving else moved
            command = assistance.Command(hand_at(hands, t))
            now, _ = assistance.step_assistance(assistant, now, command, still, actual, PERIOD)

        return run

    few = min(steps, SLOW_STEPS)
    return {
        "kernel": timed(kernel_step(kernels.assistance_step), steps),
        "step, still": timed(whole_step(False), steps),
        "step, moving": timed(whole_step(True), few),
        "reference": timed(kernel_step(reference.assistance_step), few),
    }


def learn() -> tuple[Demonstration, pf.Skill]:
    """Return a demonstration of the simulated valve with a grip, and a skill learned from eight."""
    demos = []
    for demo in pf.io.synthetic_valve(np.random.default_rng(0)):
        grip = (np.abs(np.linspace(-1.0, 1.0, len(demo.x))) < 0.5).astype(float)
        frames = []
        for frame in (each.at(0) for each in demo.frames):
            A = np.eye(8)
            A[:7, :7] = frame.A[:7, :7]
            frames.append(Frame(frame.name, A, np.append(frame.b[:7], 0.0)))
        x = np.column_stack([demo.x[:, :7], grip])
        demos.append(demonstration(x, demo.period, LAYOUT, frames, demo.name))
    return demos[0], pf.learn(demos, states=STATES, rng=np.random.default_rng(0)).skill


def hand_at(hands: list[Float[Array, " D"]], t: int) -> Float[Array, " D"]:
    """Return the hand after t steps of 1 ms, forwards and backwards through 10 rows per second."""
    n = (t // 100) % (2 * len(hands) - 2)
    return hands[min(n, 2 * len(hands) - 2 - n)]


def shifted(frame: Frame, distance: float) -> Frame:
    """Return the frame moved along x."""
    return Frame(frame.name, frame.A, frame.b + distance * np.eye(len(frame.b))[0])


def timed(run: Callable[[int], None], steps: int) -> tuple[float, ...]:
    """Return median, p99.9, first and last median of the CPU time of a call [us]."""
    for t in range(100):
        run(t)
    times = np.empty(steps)
    for t in range(steps):
        start = time.thread_time_ns()
        run(t)
        times[t] = time.thread_time_ns() - start
    times /= 1e3
    tenth = max(1, steps // 10)
    first, last = np.median(times[:tenth]), np.median(times[-tenth:])
    return float(np.median(times)), float(np.quantile(times, 0.999)), float(first), float(last)


if __name__ == "__main__":
    main()
