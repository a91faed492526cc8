"""pilotfish mission: an operator and a remote robot, with physics and a bad link, faster than real time."""

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass, replace
from json import dumps
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import click

from pilotfish.cli.commands.record import find_task
from pilotfish.cli.options.execution import require_one_situation, require_simulation
from pilotfish.cli.options.missions import mission_options, mission_settings
from pilotfish.cli.output.missions import (
    LIVE_PERIOD,
    Mission,
    MissionLog,
    format_live_line,
    name_member,
    summarise_missions,
)
from pilotfish.cli.output.results import (
    CommandResult,
    example_epilog,
    print_result,
    require_writable_file,
)
from pilotfish.cli.output.terminal import is_interactive, live_line, print_note
from pilotfish.io import open_skill

if TYPE_CHECKING:
    from pilotfish.environments import Task, Workcell
    from pilotfish.simulation import FilmRecorder, MissionResult, MissionSettings, SessionRecorder
    from pilotfish.teleop import OperatorInput, OperatorView, RobotStep

ELLIPSOIDS = (1.0, 2.0)  # standard deviations
FILM_DISTANCE = 1.15  # relative to the view of the task
PARAMETERS = ("mode", "rtt", "jitter", "loss", "burst", "view_off", "view_turn", "budget", "seed")
Observer = Callable[["Workcell[Any]", "RobotStep", "OperatorView", "OperatorInput"], None]


@dataclass(frozen=True, slots=True)
class ChosenSkill:
    """Skill of the mission: its bytes, and a text that says where it comes from."""

    data: bytes
    source: str


@click.command(
    epilog=example_epilog(
        "pilotfish mission valve --mode shared --rtt 1.2 --loss 2 --outage 20:10 --out session.mcap",
        "pilotfish mission stab --mode autonomous --rtt 1 --outage 12:4 --allow-after-outage 20",
        "pilotfish mission stab --mode direct --rtt 1 --allow-direct 2",
    )
)
@click.argument("task")
@mission_options
@print_result
def mission(task: str, **options: Any) -> CommandResult:
    """Do TASK with a remote robot: physics, a simulated operator and a bad link, faster than real time.

    Both sites run as they would over a network, with sealed datagrams on a virtual clock. The skill is sent
    first. A failure is explained by the first phase of the task that was not passed. The exit code is 0 also
    if the task fails.
    """
    require_one_situation(options["situation"], "situations")
    settings, selected = mission_settings(options), find_task(task)
    _require_outputs(options)
    skill = _choose_skill(selected, options)
    count, number = options["situations"], options["situation"]
    missions: list[Mission] = []
    recording_failure: str | None = None
    for n in range(count) if number is None else (number,):
        is_first = not missions
        mission, failure = _run_once(skill, selected, n, settings, options, is_first=is_first)
        missions.append(mission)
        recording_failure = recording_failure or failure
        if is_interactive() and count > 1:
            print_note(f"situation {n}: {'success' if mission.result.outcome.success else 'failure'}")
    notes = _notes(missions, settings, options, recording_failure)
    facts = [("mode", settings.mode), ("link", _describe_link(settings, options)), ("skill", skill.source)]
    data = {
        **{name: options[name] for name in PARAMETERS},
        "task": task,
        "out": None if recording_failure or not options["out"] else str(options["out"]),
        "film": str(options["film"]) if options["film"] else None,
        "skill": skill.source,
    }
    return summarise_missions(missions, selected, facts, notes, data)


def _require_outputs(options: dict[str, Any]) -> None:
    """Check, before the work begins, what will be written."""
    skill, film, out = options["skill"], options["film"], options["out"]
    require_simulation(skill or Path(), film, meshes=options["meshes"], force=options["force"])
    require_writable_file(out, film, force=options["force"], inputs=(skill,))
    if out:
        from pilotfish.simulation import SessionRecorder

        SessionRecorder(out, overwrite=options["force"])


def _choose_skill(task: "Task[Any]", options: dict[str, Any]) -> ChosenSkill:
    """Return the skill of a file, or that of the task at defaults."""
    from pilotfish.io import decode_assisted_skill, encode_assisted_skill
    from pilotfish.simulation import mission_skill

    if file := options["skill"]:
        if options["mode"] == "fixture":
            raise click.UsageError(
                "--mode fixture needs the demonstrations, which a skill file does not contain; omit --skill"
            )
        chosen = ChosenSkill(encode_assisted_skill(open_skill(file)), str(file))
    else:
        begin = perf_counter()
        with live_line() as print_line:
            found = mission_skill(
                task, lambda n, count: print_line(f"recorded demonstration {n} of {count} of {task.name}")
            )
        source = f"learned from {found.demonstrations} simulated demonstrations"
        if found.is_new:
            source += f" in {perf_counter() - begin:.0f} s"
        source += f", kept in {found.file}" if found.file else ", not kept: no cache folder"
        chosen = ChosenSkill(found.data, source)
    needs_order = options["mode"] == "autonomous" or options["allow_after_outage"]
    if needs_order and not decode_assisted_skill(chosen.data).can_plan:
        name = "--mode autonomous" if options["mode"] == "autonomous" else "--allow-after-outage"
        raise click.UsageError(
            f"{name} needs a skill with an order in time, and this one has none; learn it without --dynamics "
            "mixture, or choose --mode shared without it"
        )
    return chosen


def _run_once(
    skill: ChosenSkill,
    task: "Task[Any]",
    number: int,
    settings: "MissionSettings",
    options: dict[str, Any],
    *,
    is_first: bool,
) -> tuple[Mission, str | None]:
    """Run a mission in one situation; return why its recording ended early as well."""
    import numpy as np

    from pilotfish.simulation import FilmRecorder, run_mission, situation_from_seed

    seed = options["seed"]
    situation, log = situation_from_seed(task, "test", seed, number), MissionLog()
    film = FilmRecorder(distance=FILM_DISTANCE) if options["film"] and is_first else None
    recorder = _recorder(task, number, options) if options["out"] and is_first else None
    with live_line() as print_line, recorder or nullcontext():
        result = run_mission(
            skill.data,
            task,
            situation,
            np.random.default_rng([seed, number, 1]),
            _with_envelope(settings, skill.data, task, situation, options),
            on_step=_observer(log, film, print_line),
            recorder=recorder,
        )
    if film:
        _write_film(film, task, number, result, options)
    return Mission(number, result, log), recorder.failure if recorder else None


def _recorder(task: "Task[Any]", number: int, options: dict[str, Any]) -> "SessionRecorder":
    from pilotfish.simulation import SessionRecorder

    texts = {name: options[name] for name in PARAMETERS}
    facts = {**texts, "task": task.name, "situation": number, "outages": options["outages"]}
    return SessionRecorder(options["out"], overwrite=options["force"], texts={"mission": dumps(facts)})


def _with_envelope(
    settings: "MissionSettings", skill: bytes, task: "Task[Any]", situation: Any, options: dict[str, Any]
) -> "MissionSettings":
    """Return the settings with the envelope around the skill in a situation, if it is asked for."""
    from pilotfish.environments import Workcell
    from pilotfish.simulation import envelope_around_skill

    if not (duration := options["allow_after_outage"]):
        return settings
    modes = options["continue_from"] or (settings.mode,)
    poses = Workcell(task, situation).frames()
    return replace(settings, envelope=envelope_around_skill(skill, poses, duration, modes))


def _observer(log: MissionLog, film: "FilmRecorder | None", print_line: Callable[[str], None]) -> Observer:
    """Return a function that notes, films and prints a step."""
    next_line, is_live = 0.0, is_interactive()

    def observe(
        cell: "Workcell[Any]", step: "RobotStep", view: "OperatorView", given: "OperatorInput"
    ) -> None:
        nonlocal next_line
        log.add(step)
        if film and log.began is not None:
            _film_step(film, cell, step, given)
        if is_live and cell.time >= next_line:
            next_line = cell.time + LIVE_PERIOD
            print_line(format_live_line(cell, step, view, given))

    return observe


def _film_step(
    film: "FilmRecorder", cell: "Workcell[Any]", step: "RobotStep", given: "OperatorInput"
) -> None:
    """Film the arm, a copy of the tool at the hand, and the covariance of the target; add the session."""
    from pilotfish.environments import Ellipsoid, ToolCopy
    from pilotfish.geometry import Pose

    last, control, count = step.site.motion.last, step.site.control, len(film.images)
    ellipsoids = []
    if last is not None:
        covariance = last.covariance[:3, :3]
        ellipsoids = [Ellipsoid(step.target.pose[:3], covariance, deviations) for deviations in ELLIPSOIDS]
    hand = Pose(given.hand[:3], given.hand[3:7])
    film(cell, ellipsoids=ellipsoids, tool_copies=[ToolCopy(cell.mounted_tool.point, hand)])
    if len(film.images) > count:
        state = name_member(control.state) + (f", {name_member(control.reason)}" if control.reason else "")
        film.phases[-1] = f"{film.phases[-1]} | {state}" if film.phases[-1] else state


def _write_film(
    film: "FilmRecorder", task: "Task[Any]", number: int, result: "MissionResult", options: dict[str, Any]
) -> None:
    from pilotfish.simulation import caption_images, write_film

    if film.images:
        images = caption_images(
            film.images,
            film.times,
            film.phases,
            title=f"{task.name}, {options['mode']}, round trip {options['rtt']:g} s, situation {number}",
            outcome="succeeded" if result.outcome.success else f"failed: {_summary(result)}",
            success=result.outcome.success,
        )
        write_film(images, options["film"], film.period, overwrite=options["force"])
    film.close()


def _summary(result: "MissionResult") -> str:
    return result.failure.summary if result.failure else result.outcome.reason


def _describe_link(settings: "MissionSettings", options: dict[str, Any]) -> str:
    parts = [f"round trip {options['rtt']:g} s"]
    parts += [f"jitter {options['jitter']:g} s"] if options["jitter"] else []
    parts += [f"loss {options['loss']:g} %"] if options["loss"] else []
    for start, duration, directions in options["outages"]:
        way = "" if len(directions) > 1 else f" {directions[0]}"
        parts.append(f"outage{way} {start:g} s to {start + duration:g} s")
    return f"{', '.join(parts)}; agreed budget {settings.agreed_budget:.2f} s"


def _notes(
    missions: list[Mission],
    settings: "MissionSettings",
    options: dict[str, Any],
    recording_failure: str | None,
) -> list[str]:
    """Return what a user should know about the options, the outputs and the replay."""
    notes, last = [], max(mission.log.time for mission in missions)
    late = [start for start, _, _ in options["outages"] if start >= last]
    if late:
        notes.append(
            f"note: the outage at {late[0]:g} s had no effect, since the session ended at {last:.1f} s"
        )
    for mission in missions:
        if mission.log.began is None:
            state = mission.log.changes[-1].state
            notes.append(
                f"note: the robot did not move in situation {mission.situation}: the session is {state}"
            )
    if settings.agreed_budget < settings.round_trip:
        notes.append(
            f"note: the budget of {settings.agreed_budget:g} s is below the round trip of "
            f"{settings.round_trip:g} s; omit --budget"
        )
    if out := options["out"]:
        notes.append(
            f"note: the recording ended early: {recording_failure}"
            if recording_failure
            else f"recorded in {out}; replay: pilotfish replay-session {out}"
        )
    if (film := options["film"]) and missions[0].log.began is None:
        notes.append(f"note: {film} was not written, since the robot did not move")
    return notes
