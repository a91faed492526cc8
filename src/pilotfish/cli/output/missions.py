"""What a mission prints: a live line, the holds, and the summary with the bytes of the link."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from pilotfish.cli.output.results import CommandResult
from pilotfish.cli.output.tables import Table, key_value_table
from pilotfish.validation import shorten_repr

if TYPE_CHECKING:
    from pilotfish.environments import Task, Workcell
    from pilotfish.simulation import MissionResult
    from pilotfish.teleop import OperatorInput, OperatorView, RobotStep

FORWARD_RATE, BACKWARD_RATE = 256.0, 768.0  # kbit/s: the links for which the protocol is made
LIVE_PERIOD = 0.1  # s of simulated time
BITS, KBIT = 8, 1000.0
OPERATOR = 1
HELD, MOVING = ("hold", "stopped"), ("active", "continuing")  # states of a session


@dataclass(slots=True)
class Change:
    """Time at which the session entered a state.

    Attributes:
        time: Time of the session [s].
        state: Name of the state, such as "hold".
        reason: Latched reason in words; empty for none.
        action: The one action that clears it; empty for none.
    """

    time: float
    state: str
    reason: str
    action: str


@shorten_repr
@dataclass(slots=True)
class MissionLog:
    """What happened in the session of a mission, by the robot's site.

    Attributes:
        changes: Changes of the state of the session.
        time: Time of the last step [s].
    """

    changes: list[Change] = field(default_factory=list)
    time: float = 0.0

    def add(self, step: "RobotStep") -> None:
        """Note a change of the state of the session.

        Args:
            step: Step of the robot's site.
        """
        from pilotfish.teleop import CLEARING_ACTIONS, Reason

        self.time, control = step.site.time / 1e9, step.site.control
        state, reason = name_member(control.state), control.reason
        if self.changes and (self.changes[-1].state, self.changes[-1].reason) == (state, _reason(reason)):
            return
        action = "" if reason is Reason.NONE else name_member(CLEARING_ACTIONS[reason])
        self.changes.append(Change(self.time, state, _reason(reason), action))

    @property
    def began(self) -> float | None:
        """Time of the first motion [s]; None if there was none."""
        return next((change.time for change in self.changes if change.state == "active"), None)

    @property
    def holds(self) -> list[tuple[Change, float | None]]:
        """Each hold, and when the robot moved again [s]; None if it did not before the next one."""
        found: list[tuple[Change, float | None]] = []
        for change in self.changes:
            if change.state in HELD:
                found.append((change, None))
            elif change.state in MOVING and found and found[-1][1] is None:
                found[-1] = (found[-1][0], change.time)
        return found


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Mission:
    """Mission in one situation.

    Attributes:
        situation: Number of the situation.
        result: Result of the mission.
        log: What happened in the session.
    """

    situation: int
    result: "MissionResult"
    log: MissionLog


def name_member(member: Any) -> str:
    """Return the name of a member of an enumeration in words."""
    return str(member.name).lower().replace("_", " ")


def _reason(reason: Any) -> str:
    return name_member(reason) if reason else ""


def format_live_line(
    cell: "Workcell[Any]", step: "RobotStep", view: "OperatorView", given: "OperatorInput"
) -> str:
    """Return what the operator knows now in one line, and the progress of the task at the robot.

    Args:
        cell: Workcell of the robot.
        step: Step of the robot's site, which gives the authority.
        view: What is displayed to the operator.
        given: What the operator does.
    """
    from pilotfish.teleop import SkillState, describe_link_drop, next_action

    report = view.report
    if report is None:
        return f"{cell.time:5.1f} s  connecting"
    parts = [f"{cell.time:5.1f} s", name_member(report.state)]
    if report.reason:
        action = next_action(view, OPERATOR)
        clears = name_member(action).replace("arm", "arm again") if action is not None else "waiting"
        parts.append(f"({_reason(report.reason)}: {clears})")
    parts.append(report.mode if report.state.name in ("ACTIVE", "CONTINUING") else given.mode)
    if not report.holder:
        parts.append("taking control")
    elif any(each is not SkillState.READY for each in view.skills) and given.mode != "direct":
        parts.append("sending the skill")
    last = step.site.motion.last
    parts.append(f"authority {last.authority if last else 0.0:4.2f}")
    if view.round_trips:
        parts.append(f"round trip {view.round_trips[-1]:4.2f} s")
    parts += [f"age {view.report_age:4.2f} s", f"if the link drops now, {describe_link_drop(report)}"]
    if cell.task.progress:
        parts.append(cell.task.progress.describe(cell.measure_progress()))
    return "  ".join(parts)


def summarise_missions(
    missions: Sequence[Mission],
    task: "Task[Any]",
    facts: Sequence[tuple[str, str]],
    notes: Sequence[str],
    data: dict[str, Any],
) -> CommandResult:
    """Return the output of the command.

    Args:
        missions: One mission or more.
        task: Task.
        facts: Rows above the results: mode, link, skill.
        notes: Paragraphs below them.
        data: Further members of the JSON object.
    """
    succeeded = sum(mission.result.outcome.success for mission in missions)
    blocks: list[str | Table] = []
    if len(missions) == 1:
        blocks.append(key_value_table([*facts, *_mission_rows(missions[0], task)]))
    else:
        blocks += [
            key_value_table([("result", f"{succeeded} of {len(missions)} succeeded"), *facts]),
            _missions_table(missions, task),
        ]
    failures = [
        f"situation {mission.situation}: {explain(mission.result)}"
        for mission in missions
        if not mission.result.outcome.success
    ]
    if len(missions) > 1 and failures:
        blocks.append("\n".join(failures))
    json = {
        "succeeded": succeeded,
        "unit": task.unit,
        "situations": [_to_json(mission) for mission in missions],
        "notes": list(notes),
    }
    return CommandResult([*blocks, *notes], {**data, **json})


def _mission_rows(mission: Mission, task: "Task[Any]") -> list[tuple[str, str]]:
    result, log = mission.result, mission.log
    outcome = "success" if result.outcome.success else f"failure, {explain(result)}"
    rows = [
        ("result", outcome),
        ("error", f"{result.outcome.error:.2g} {task.unit}, peak force {result.peak_forces['tool']:.0f} N"),
        ("time", _describe_time(mission)),
        (
            "movements of the hand",
            f"{result.submovements}, {result.effort:.2f} m; aligned again {result.alignments} times",
        ),
        ("holds", _describe_holds(log) or "none"),
        ("stale commands", str(result.stale)),
    ]
    directions = (
        ("to the robot", result.bytes_forward, FORWARD_RATE),
        ("from the robot", result.bytes_backward, BACKWARD_RATE),
    )
    for name, count, limit in directions:
        rate = BITS * count / max(log.time, 1e-9) / KBIT
        share = f"{100.0 * rate / limit:.0f} % of {limit:.0f} kbit/s"
        rows.append((name, f"{count / KBIT:.0f} kB, {rate:.0f} kbit/s: {share}"))
    return rows


def _missions_table(missions: Sequence[Mission], task: "Task[Any]") -> Table:
    rows = [
        (
            str(mission.situation),
            "success" if mission.result.outcome.success else "failure",
            f"{mission.result.outcome.error:.2g} {task.unit}",
            f"{mission.result.duration:.1f} s",
            str(mission.result.submovements),
            _describe_holds(mission.log) or "none",
            str(mission.result.stale),
        )
        for mission in missions
    ]
    header = ("situation", "result", "error", "time", "movements", "holds", "stale commands")
    return Table(header, tuple(rows))


def _describe_time(mission: Mission) -> str:
    began, log = mission.log.began, mission.log
    if began is None:
        return f"no motion in {log.time:.1f} s"
    end = "" if mission.result.is_completed else ", not ended"
    return (
        f"{mission.result.duration:.1f} s from the first motion{end}; it began {began:.1f} s after the start"
    )


def _describe_holds(log: MissionLog) -> str:
    parts = []
    for change, again in log.holds:
        after = "" if again is None else f" to {again:.1f} s"
        name = change.reason if change.state == "hold" else "stopped"
        parts.append(f"{name} at {change.time:.1f} s{after}")
    return "; ".join(parts)


def explain(result: "MissionResult") -> str:
    """Return why a mission failed: the first phase that was not passed, or the state of the task.

    Args:
        result: Result of a mission that did not succeed.
    """
    failure = result.failure
    if failure is None:
        return result.outcome.reason
    return failure.detail if failure.phase == "other" else f"{failure.summary}: {failure.detail}"


def _to_json(mission: Mission) -> dict[str, Any]:
    result, log = mission.result, mission.log
    failure = result.failure
    return {
        "situation": mission.situation,
        "success": result.outcome.success,
        "error": result.outcome.error,
        "reason": result.outcome.reason,
        "failure": {"phase": failure.phase.value, "summary": failure.summary, "detail": failure.detail}
        if failure
        else None,
        "completed": result.is_completed,
        "seconds": result.duration,
        "session_seconds": log.time,
        "began": log.began,
        "movements": result.submovements,
        "effort": result.effort,
        "alignments": result.alignments,
        "holds": [
            {"time": change.time, "reason": change.reason, "action": change.action, "moved_again": again}
            for change, again in log.holds
        ],
        "stale": result.stale,
        "bytes_forward": result.bytes_forward,
        "bytes_backward": result.bytes_backward,
        "peak_forces": result.peak_forces,
    }
