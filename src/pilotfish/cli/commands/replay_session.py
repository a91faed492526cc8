"""pilotfish replay-session: repeat the robot's side of a recorded session, bit for bit."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pilotfish.cli.options.execution import FILE
from pilotfish.cli.output.results import CommandResult, example_epilog, print_result

if TYPE_CHECKING:
    from pilotfish.io import SessionFile
    from pilotfish.teleop import Replay

NANO = 1e9


@click.command(name="replay-session", epilog=example_epilog("pilotfish replay-session session.mcap"))
@click.argument("session", type=FILE)
@print_result
def replay_session_command(session: Path) -> CommandResult:
    """Repeat what the robot did in the recording SESSION, and compare it bit for bit.

    The robot's site is given the recorded messages and what was sensed, and each target and each message that
    it sends is compared. The exit code is 1 if one differs. A recording that was cut short is compared up to
    its end; it may be the .part that a killed mission leaves.
    """
    from pilotfish.simulation import replay_session

    replay, file = replay_session(session)
    counts = f"{replay.steps} steps, {replay.messages} messages"
    difference = replay.difference
    if difference is None:
        blocks = [f"{counts}: identical"]
    else:
        blocks = [
            f"{counts}: the last step differs, {difference.time_ns / NANO:.3f} s on the robot's clock",
            f"{difference.field}: recorded {difference.recorded}, repeated {difference.replayed}",
        ]
    blocks += _notes(replay, file)
    data: dict[str, Any] = {
        "steps": replay.steps,
        "messages": replay.messages,
        "identical": difference is None,
        "complete": file.is_complete,
        "seconds": replay.time_ns / NANO,
        "left_over_records": replay.left_over,
        "difference": None
        if difference is None
        else {
            "time_ns": difference.time_ns,
            "field": difference.field,
            "recorded": difference.recorded,
            "replayed": difference.replayed,
        },
    }
    return CommandResult(blocks, data, exit_code=int(difference is not None))


def _notes(replay: "Replay", file: "SessionFile") -> list[str]:
    """Return what is missing in the file, and what else may explain a difference."""
    from pilotfish.simulation import changed_versions

    notes = []
    if not file.is_complete:
        rest = (
            f", and {replay.left_over} records of an incomplete step are left out" if replay.left_over else ""
        )
        notes.append(
            f"note: the recording was cut short: all after {replay.time_ns / NANO:.2f} s is missing{rest}"
        )
    if replay.difference is not None:
        notes += [
            f"note: recorded with {name} {recorded}, and this is {present}, which may round differently"
            for name, (recorded, present) in changed_versions(file).items()
        ]
    return notes
