"""Run mutants of a target in forked processes with bounded memory and time.

A mutant must be accepted and sound, or refused by a SkillError or click.UsageError of one line.
"""

import faulthandler
import json
import mmap
import os
import re
import resource
import signal
import sys
import time
import traceback
import warnings
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import Any, NoReturn

import click

from fuzzing.soundness import InvariantViolation, require_sound_refusal
from fuzzing.target import Mutant, Target, mutant_of, plan_of
from pilotfish.errors import SkillError

MAX_SECONDS = 2.0  # CPU time of one mutant [s]
HANG_TIMEOUT = 60.0  # s after which a child without progress is killed
MAX_MEMORY_GROWTH = 200 * 2**20  # bytes
MEMORY_LIMIT = 300 * 2**20  # bytes of address space more than at the start
THOROUGH_CHECK_INTERVAL = 10  # every tenth accepted mutant is also planned and written again


class Hang(BaseException):
    """Raised when a mutant takes too long; no decoder catches it."""


@dataclass
class Failure:
    """Failure with the smallest mutant that causes it."""

    target: str
    seed: int
    index: int
    kind: str
    message: str
    base: int = -1
    edits: list[str] = field(default_factory=list)
    data: str = ""
    trace: str = ""
    count: int = 1

    def __str__(self) -> str:
        edits = "\n".join(f"    {edit}" for edit in self.edits)
        again = f"--target {self.target!r} --seed {self.seed} --start {self.index} --mutants 1"
        return (
            f"{self.target}: {self.kind} ({self.count} times): {self.message[:300]}\n"
            f"  again: .venv/bin/python tests/fuzz/run.py {again}\n  base {self.base}, edits\n{edits}\n"
            f"  input: {self.data}\n{self.trace}"
        )


@dataclass
class Tally:
    """Outcomes of the mutants of one target."""

    target: str
    mutants: int = 0
    accepted: int = 0
    refused: int = 0
    slowest: float = 0.0
    slowest_index: int = -1
    growth: int = 0
    failures: list[Failure] = field(default_factory=list)

    def add(self, other: "Tally") -> None:
        """Add the outcomes of more mutants."""
        self.mutants += other.mutants
        self.accepted += other.accepted
        self.refused += other.refused
        self.growth = max(self.growth, other.growth)
        if other.slowest > self.slowest:
            self.slowest, self.slowest_index = other.slowest, other.slowest_index
        self.failures += other.failures


def attempt(target: Target, data: Any, thorough: bool) -> bool:
    """Return whether a mutant is accepted; raise if it is accepted but not sound, or not refused properly."""
    try:
        value = target.read(data)
    except SkillError as error:
        require_sound_refusal(error)
        return False
    except click.UsageError as error:
        require_sound_refusal(error, error.format_message())
        return False
    target.use(value, thorough)
    return True


def measure_attempt(target: Target, data: Any, thorough: bool) -> bool:
    """Run `attempt` for at most MAX_SECONDS of CPU time."""
    signal.setitimer(signal.ITIMER_PROF, MAX_SECONDS)
    try:
        return attempt(target, data, thorough)
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)


def run_in_process(
    name: str, target: Target, seed: int, indices: range, progress: mmap.mmap | None = None
) -> Tally:
    """Run mutants in this process, and write the number of the current one to shared memory."""
    tally, kinds = Tally(name), {}
    before = _peak_memory()
    for index in indices:
        if progress is not None:
            progress[:24] = b"".join(n.to_bytes(8, "little") for n in (index, tally.accepted, tally.refused))
        base, edits = plan_of(target, name, seed, index)
        try:
            draw_mutant = mutant_of(target, base, edits)
        except MemoryError:  # repeated edits can exceed the limit themselves
            continue
        before += max(0, _peak_memory() - before - tally.growth)  # memory of the edits
        start_time = time.process_time()
        try:
            if measure_attempt(target, draw_mutant.data, tally.accepted % THOROUGH_CHECK_INTERVAL == 0):
                tally.accepted += 1
            else:
                tally.refused += 1
            if (
                growth := _peak_memory() - before
            ) > MAX_MEMORY_GROWTH and growth > tally.growth + MAX_MEMORY_GROWTH // 4:
                raise InvariantViolation(f"memory grew by {growth // 2**20} MiB")
        except (Exception, Hang) as error:  # noqa: BLE001 - any other exception is a failure
            _add_failure(tally, kinds, _failure(name, target, seed, index, (base, edits), error))
        seconds = time.process_time() - start_time
        if seconds > tally.slowest:
            tally.slowest, tally.slowest_index = seconds, index
        tally.growth = max(tally.growth, _peak_memory() - before)
        tally.mutants += 1
    return tally


def _add_failure(tally: Tally, kinds: dict[str, Failure], failure: Failure) -> None:
    if failure.kind in kinds:
        kinds[failure.kind].count += 1
    else:
        kinds[failure.kind] = failure
        tally.failures.append(failure)


def _kind(error: BaseException) -> str:
    """Return the type of an error and the line of pilotfish that raised it."""
    steps = traceback.extract_tb(error.__traceback__)
    own = [step for step in steps if f"{os.sep}pilotfish{os.sep}" in step.filename]
    last = (own or steps)[-1]
    where = "" if isinstance(error, Hang) else f" at {Path(last.filename).name}:{last.lineno}"
    if isinstance(error, InvariantViolation):
        where = f" {re.sub(r'[^a-z]+', ' ', re.split(' is |: ', str(error))[0])[:60]}"
    return f"{type(error).__name__}{where}"


def _failure(
    name: str, target: Target, seed: int, index: int, plan: tuple[int, tuple[int, ...]], error: BaseException
) -> Failure:
    """Return the failure with as few edits as still cause it."""
    kind = _kind(error)
    base, edits = plan
    draw_mutant = mutant_of(target, base, edits)
    for n in range(len(edits) - 1, -1, -1):
        fewer = (*edits[:n], *edits[n + 1 :])
        if len(edits) > 1 and (smaller := _same_failure(target, base, fewer, kind)):
            edits, draw_mutant = fewer, smaller
    data = draw_mutant.data
    if isinstance(data, bytes | str) and len(data) < 10**5 and not isinstance(error, Hang):
        data = _minimise_edits(target, data, kind)
    if isinstance(data, Path) and data.is_file():
        data = data.read_bytes()
    text = repr(data)
    if not isinstance(data, str) and len(text) > 800:
        text = f"{text[:800]}... ({len(data) if isinstance(data, bytes) else '?'} bytes)"
    trace = "".join(traceback.format_exception(error)[-6:])[-900:]
    return Failure(name, seed, index, kind, f"{error}", base, list(draw_mutant.edits), text[:2000], trace)


def _same_failure(target: Target, base: int, edits: Sequence[int], kind: str) -> Mutant | None:
    draw_mutant = mutant_of(target, base, edits)
    return draw_mutant if _error_of(target, draw_mutant.data) == kind else None


def _error_of(target: Target, data: Any) -> str | None:
    try:
        measure_attempt(target, data, True)
    except (Exception, Hang) as error:  # noqa: BLE001 - it is compared with another
        return _kind(error)
    return None


def _minimise_edits(target: Target, data: Any, kind: str) -> Any:
    """Remove what can be left out of the data, for at most 10 s."""
    end, size = time.monotonic() + 10.0, max(1, len(data) // 2)
    while size and time.monotonic() < end:
        n = 0
        while n < len(data) and time.monotonic() < end:
            fewer = data[:n] + data[n + size :]
            if _error_of(target, fewer) == kind:
                data = fewer
            else:
                n += size
        size //= 2
    return data


def _peak_memory() -> int:
    """Return the largest resident memory of this process so far [bytes]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


# ---------------------------------------------------------------------------------------------- processes


def run_target(name: str, target: Target, seed: int, mutants: int, start: int = 0) -> Tally:
    """Run mutants of a target in forked processes; one that dies or hangs is one failure."""
    total, end = Tally(name), start + mutants
    while start < end:
        tally, start = _fork_worker(name, target, seed, range(start, end))
        total.add(tally)
    return total


def _fork_worker(name: str, target: Target, seed: int, indices: range) -> tuple[Tally, int]:
    with NamedTemporaryFile() as out, NamedTemporaryFile() as err, mmap.mmap(-1, 24) as progress:
        progress[:8] = indices.start.to_bytes(8, "little")
        sys.stdout.flush()
        process = os.fork()
        if process == 0:
            _child(name, target, seed, indices, progress, (out.fileno(), err.fileno()))
        status, stuck = _wait_with_timeout(process, progress)
        if status == 0:
            fields = json.loads(Path(out.name).read_text())
            fields["failures"] = [Failure(**failure) for failure in fields["failures"]]
            return Tally(**fields), indices.stop
        index, accepted, refused = (int.from_bytes(progress[n : n + 8], "little") for n in (0, 8, 16))
        kind = "Hang outside Python" if stuck else "Crash"
        why = f"no end after {HANG_TIMEOUT:g} s" if stuck else f"the process ended with status {status}"
        failure = Failure(name, seed, index, kind, why, trace=Path(err.name).read_text()[-3000:])
        return Tally(name, index - indices.start + 1, accepted, refused, failures=[failure]), index + 1


def _child(
    name: str, target: Target, seed: int, indices: range, progress: mmap.mmap, files: tuple[int, int]
) -> NoReturn:
    """Run mutants with bounded memory and write the tally as JSON."""
    out, err = files
    try:
        os.dup2(err, 2)
        faulthandler.enable()
        warnings.simplefilter("error")
        for base in range(len(target.bases)):  # memory of imports and caches does not count
            attempt(target, mutant_of(target, base, ()).data, True)
        signal.signal(signal.SIGPROF, _hang)
        used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY_LIMIT, resource.RLIM_INFINITY))
        tally = run_in_process(name, target, seed, indices, progress)
        os.write(out, json.dumps(asdict(tally)).encode())
        os._exit(0)
    except BaseException:  # noqa: BLE001 - the process ends here
        traceback.print_exc()
        sys.stderr.flush()
        os._exit(1)


def _hang(signum: int, frame: Any) -> None:
    raise Hang(f"it took more than {MAX_SECONDS:g} s")


def _wait_with_timeout(process: int, progress: mmap.mmap) -> tuple[int, bool]:
    """Return the exit status of a child, and whether it was killed for lack of progress."""
    last, since, timeout = b"", time.monotonic(), 4 * HANG_TIMEOUT
    while True:
        ended, status = os.waitpid(process, os.WNOHANG)
        if ended:
            return status, False
        if (now := progress[:8]) != last:
            timeout = HANG_TIMEOUT if last else timeout  # the bases are tried before the first mutant
            last, since = now, time.monotonic()
        elif time.monotonic() - since > timeout:
            os.kill(process, signal.SIGKILL)
            return os.waitpid(process, 0)[1], True
        time.sleep(0.05)


def table(tallies: Sequence[Tally]) -> str:
    """Return a table with a row for each target."""
    names = ("mutants", "accepted", "refused", "failures", "slowest", "memory")
    head = f"{'target':16} " + " ".join(f"{name:>9}" for name in names)
    rows = [
        f"{t.target:16} {t.mutants:9} {t.accepted:9} {t.refused:9} {sum(f.count for f in t.failures):9} "
        f"{t.slowest:7.3f} s {t.growth / 2**20:6.0f} MB"
        for t in tallies
    ]
    total = Tally("all")
    for tally in tallies:
        total.add(tally)
    count = sum(f.count for f in total.failures)
    rows.append(
        f"{'all':16} {total.mutants:9} {total.accepted:9} {total.refused:9} {count:9} "
        f"{total.slowest:7.3f} s {total.growth / 2**20:6.0f} MB"
    )
    return "\n".join([head, *rows])
