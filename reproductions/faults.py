"""Faults R1 to R25 of a teleoperation session, each with many seeds, on a virtual clock.

    python reproductions/faults.py --json faults.json
    python reproductions/faults.py --only R25 --soak 24

Each fault is a function of a seed, with random delays, modes and moments. Its run fails if a statement about
the fault does not hold, or an invariant of `fault_rig` is violated at some step. The table gives the numbers
of runs that were tried, held and broken. R4 is in physics; in the others the arm is perfect. `--soak` runs
one session of many virtual hours besides, and measures its memory, and R7 with an hour of constant delay.

What is simulated: processes are killed and frozen by leaving out their steps, the disk of R20 ends at a
random byte, and the rate of R24 is 30,000 datagrams per virtual second, without timing.
"""

import gc
import resource
import sys
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import fault_intruders
import fault_processes
import fault_scenarios
import fault_streams
import numpy as np
from fault_rig import Pilot, Rig
from protocol import argument_parser, write_numbers
from tqdm import tqdm

from pilotfish import teleop
from pilotfish.teleop import SessionState

SCENARIOS = {
    **fault_scenarios.SCENARIOS,
    **fault_processes.SCENARIOS,
    **fault_intruders.SCENARIOS,
    **fault_streams.SCENARIOS,
}
WARM_UP = 600.0  # s, before memory is measured


@dataclass(frozen=True, slots=True)
class Row:
    """Result of one fault."""

    fault: str
    statement: str
    tried: int
    held: int
    broken: int
    example: str


def main() -> None:
    parser = argument_parser(__doc__)
    parser.add_argument("--seeds", type=int, default=200, help="number of runs of each fault")
    parser.add_argument("--only", nargs="+", help="faults to try, such as R1 R19")
    parser.add_argument("--workers", type=int, default=2, help="number of processes")
    parser.add_argument("--soak", type=float, default=0.0, help="virtual hours of one long run")
    arguments = parser.parse_args()
    names = [name for name in order() if not arguments.only or name.split(",")[0] in arguments.only]
    rows = []
    with ProcessPoolExecutor(arguments.workers) as pool:
        for name in names:
            tasks = pool.map(try_fault, [name] * arguments.seeds, range(arguments.seeds), chunksize=4)
            bar = tqdm(tasks, name, arguments.seeds, disable=not sys.stderr.isatty())
            rows.append(summarise(name, list(bar)))
            print(
                f"{name:<22} tried {rows[-1].tried:>4}  held {rows[-1].held:>4}  broken {rows[-1].broken:>3}"
            )
            sys.stdout.flush()
            if rows[-1].example:
                print(f"    {rows[-1].example}")
    numbers: dict[str, Any] = {"rows": [asdict(row) for row in rows]}
    if arguments.soak:
        numbers |= {"soak": soak(arguments.soak), "hour of R7": keep_delay_for_an_hour()}
    if arguments.json:
        write_numbers(arguments.json, numbers)


def order() -> list[str]:
    """Return the faults in the order of their numbers."""
    return sorted(SCENARIOS, key=lambda name: (int(name.split(",")[0][1:]), name))


def try_fault(name: str, seed: int) -> list[str]:
    """Return what did not hold."""
    return SCENARIOS[name](seed)


def summarise(name: str, results: list[list[str]]) -> Row:
    """Return the numbers of a fault, and the first statement that did not hold."""
    broken = [(seed, statements) for seed, statements in enumerate(results) if statements]
    example = f"seed {broken[0][0]}: {broken[0][1][0]}" if broken else ""
    statement = (SCENARIOS[name].__doc__ or "").split(": ", 1)[1].strip()
    return Row(name, statement, len(results), len(results) - len(broken), len(broken), example)


def keep_delay_for_an_hour() -> dict[str, Any]:
    """Run R7 with an hour of constant delay, and return what did not hold."""
    broken = fault_scenarios.keep_delay(0, 3600.0)
    print(f"R7, one hour           broken {len(broken)}")
    return {"broken": broken}


def soak(hours: float) -> dict[str, float]:
    """Run one session for many virtual hours, and return the growth of the process's memory [bytes].

    Args:
        hours: Virtual hours, after ten minutes in which buffers reach their sizes.
    """
    link = teleop.LinkSettings(delay=0.25, jitter=0.05, loss=0.02)
    rig = Rig(np.random.default_rng(0), [Pilot("shared")], forward=link, backward=link, budget=0.8)
    rig.run_until_active()
    rig.run(WARM_UP)
    forget(rig)
    before, others = resident_memory(), 0
    for _ in tqdm(range(round(hours * 60)), "virtual minutes", disable=not sys.stderr.isatty()):
        rig.run(60.0)
        others += sum(row.state is not SessionState.ACTIVE for row in rig.rows)
        forget(rig)
    growth = resident_memory() - before
    print(f"{hours:g} virtual hours: memory grew by {growth} bytes, {others} steps outside ACTIVE")
    return {"hours": hours, "growth": growth, "steps outside ACTIVE": others, "broken": len(rig.broken)}


def resident_memory() -> int:
    """Return the memory of this process that is not swapped out, without garbage [bytes]."""
    gc.collect()
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * resource.getpagesize()


def forget(rig: Rig) -> None:
    """Drop what the rig itself has recorded."""
    del rig.inputs[:], rig.rows[:]


if __name__ == "__main__":
    main()
