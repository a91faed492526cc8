"""Runs of the study on all cores; finished runs are kept when the command is stopped."""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, Future, as_completed
from pathlib import Path
from time import monotonic
from typing import Any

from pilotfish.cli.options.workers import process_pool
from pilotfish.cli.output.terminal import print_note, progress_bar
from pilotfish.cli.stream.signals import StopRequested
from pilotfish.cli.study.folder import Run, RunLog, read_runs, read_skill, write_skill
from pilotfish.simulation import StudyRun, learn_study_skills, perform_study_run, skill_name

MINUTE = 60.0  # s


def learn_skills(
    folder: Path, runs: Sequence[StudyRun], seed: int, workers: int | str | None
) -> dict[str, bytes]:
    """Return the skills that runs need by name; those that are not in the folder are learned and kept there.

    Args:
        folder: Folder of the study.
        runs: Runs of the study.
        seed: Seed of the study.
        workers: Number of processes, or address of a cluster; None for one process for each core.
    """
    names = sorted({skill_name(run.condition) for run in runs})
    skills = {name: skill for name in names if (skill := read_skill(folder, name)) is not None}
    tasks = sorted({run.condition.task for run in runs if skill_name(run.condition) not in skills})
    if not tasks:
        return skills
    with progress_bar(len(tasks), "learning skills") as advance, process_pool(workers, len(tasks)) as pool:
        for learned in _map(pool, learn_study_skills, [(task, seed) for task in tasks]):
            for name, skill in learned.items():
                if name not in skills:
                    write_skill(folder, name, skill)
                    skills[name] = skill
            advance("")
    return skills


def _map(pool: Executor | None, function: Callable[..., Any], arguments: Sequence[tuple[Any, ...]]) -> Any:
    """Yield the results of a function, in the order of the arguments."""
    columns = zip(*arguments, strict=True)
    return pool.map(function, *columns) if pool else map(function, *columns)


def perform_runs(
    folder: Path, runs: Sequence[StudyRun], seed: int, workers: int | str | None, command: str
) -> dict[str, Run]:
    """Perform the runs that are not finished and return all of them by their keys.

    Args:
        folder: Folder of the study.
        runs: Runs of the study.
        seed: Seed of the study.
        workers: Number of processes, or address of a cluster; None for one process for each core.
        command: Command line that continues the study.
    """
    finished = read_runs(folder)
    missing = [run for run in runs if run.key not in finished]
    log = RunLog(folder)
    try:
        skills = learn_skills(folder, missing, seed, workers)
        _perform(missing, skills, seed, workers, log)
    except StopRequested:
        done = len(runs) - len(missing) + len(read_runs(folder)) - len(finished)
        print_note(f"{done} of {len(runs)} runs are finished and kept; continue with: {command}")
        raise
    finally:
        log.close()
    found = read_runs(folder)
    return {run.key: found[run.key] for run in runs}


def _perform(
    runs: Sequence[StudyRun], skills: Mapping[str, bytes], seed: int, workers: int | str | None, log: RunLog
) -> None:
    began = monotonic()
    with progress_bar(len(runs), "runs") as advance, process_pool(workers, len(runs)) as pool:
        for n, result in enumerate(_results(pool, runs, skills, seed), start=1):
            log.append(result)
            advance(_remaining(monotonic() - began, n, len(runs)))


def _results(pool: Executor | None, runs: Sequence[StudyRun], skills: Mapping[str, bytes], seed: int) -> Any:
    """Yield results as runs finish; after a request to stop, those of the runs under way, then raise it."""
    if pool is None:
        for run in runs:
            yield perform_study_run(run, skills[skill_name(run.condition)], seed)
        return
    futures: list[Future[Run]] = [
        pool.submit(perform_study_run, run, skills[skill_name(run.condition)], seed) for run in runs
    ]
    given: set[Future[Run]] = set()
    try:
        for future in as_completed(futures):
            given.add(future)
            yield future.result()
    except StopRequested:
        print_note("finishing the runs under way; stop again to drop them")
        under_way = [future for future in futures if not future.cancel() and future not in given]
        yield from (future.result() for future in under_way)
        raise


def _remaining(elapsed: float, done: int, total: int) -> str:
    """Return the time that the rest takes, at the present rate."""
    seconds = elapsed / done * (total - done)
    return f"{seconds / MINUTE:.0f} min left" if seconds >= MINUTE else f"{seconds:.0f} s left"
