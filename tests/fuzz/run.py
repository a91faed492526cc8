"""Fuzz every decoder and public function; `make fuzz` calls it."""

import argparse
import os
import sys
import time
from fnmatch import fnmatch
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "shared"))

from fuzzing.campaign import run_target, table
from fuzzing.targets import TARGETS, shares

MUTANTS = 10**6


def main() -> int:
    """Run the mutants and print the outcomes; return 1 if one failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--mutants", type=int, default=int(os.environ.get("PILOTFISH_FUZZ", MUTANTS)))
    parser.add_argument("--target", action="append", help="a name or pattern of targets  [default: all]")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--start", type=int, default=0, help="number of the first mutant of each target")
    arguments = parser.parse_args()
    names = [name for name in TARGETS if any(fnmatch(name, one) for one in arguments.target or ["*"])]
    if not names:
        parser.error(f"no target is called {arguments.target}, there are {', '.join(TARGETS)}")
    tallies = []
    for name, count in shares(arguments.mutants, names).items():
        start_time = time.monotonic()
        tally = run_target(name, TARGETS[name][0](), arguments.seed, count, arguments.start)
        tallies.append(tally)
        seconds = time.monotonic() - start_time
        failures = f", {len(tally.failures)} kinds of failure" if tally.failures else ""
        sys.stdout.write(f"{name}: {tally.mutants} mutants in {seconds:.0f} s{failures}\n")
        for failure in tally.failures:
            sys.stdout.write(f"\n{failure}\n")
        sys.stdout.flush()
    sys.stdout.write(f"\nseed {arguments.seed}\n{table(tallies)}\n")
    return int(any(tally.failures for tally in tallies))


if __name__ == "__main__":
    sys.exit(main())
