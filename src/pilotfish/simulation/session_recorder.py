"""Record the robot's site of a session in a file, and replay the file bit for bit.

A full disk ends the recording, and never the session: the recorder keeps the reason. Every chunk of half a
second is written at once, so a killed process loses no more.
"""

import platform
from pathlib import Path
from types import TracebackType

import numpy as np

import pilotfish
from pilotfish import kernels
from pilotfish.errors import InvalidInput, SkillError, UnreadableFile
from pilotfish.io import SessionFile, SessionWriter, decode_assisted_skill, read_session
from pilotfish.teleop import (
    RECORD_VERSIONS,
    ReceivedMessage,
    Replay,
    RobotSettings,
    RobotState,
    RobotStep,
    decode_robot_settings,
    encode_robot_settings,
    encode_start,
    encode_step,
    replay_records,
)

REFUSED = ("recording", "messages", "pilotfish")  # versions that must be the same for a replay
SETTINGS = "robot"  # name of the settings among the metadata


def session_versions() -> dict[str, str]:
    """Return the versions on which a session depends, by name."""
    return {
        **RECORD_VERSIONS,
        "pilotfish": pilotfish.__version__,
        "kernels": kernels.BACKEND,
        "numpy": np.__version__,
        "machine": platform.machine(),
    }


class SessionRecorder:
    """Recorder of the robot's site, a context manager; pass it to `run_mission` or `VirtualSession`.

    Attributes:
        failure: Why the recording ended early, such as a full disk; None if it did not.

    Example:
        >>> with SessionRecorder("session.mcap") as recorder:      # doctest: +SKIP
        ...     run_mission(skill, task, situation, rng, settings, recorder=recorder)
    """

    def __init__(
        self, path: str | Path, *, overwrite: bool = False, texts: dict[str, str] | None = None
    ) -> None:
        """Check the arguments; the file is made at the start of the `with` block.

        Args:
            path: File to write.
            overwrite: Whether an existing file may be replaced.
            texts: Further texts by name, such as the options of a mission.

        Raises:
            InvalidInput: If the file cannot be written, or mcap is not installed.
        """
        self.failure: str | None = None
        self._writer = SessionWriter(path, overwrite=overwrite)
        self._texts, self._is_described = texts or {}, False

    def __enter__(self) -> "SessionRecorder":
        self._writer.__enter__()
        return self

    def start(self, settings: RobotSettings, time_ns: int, robot: RobotState) -> None:
        """Record a start of the robot's site, the first time with settings and versions.

        Args:
            settings: Settings of the site.
            time_ns: Time of the robot's clock [ns].
            robot: What the robot senses.
        """
        if self.failure:
            return
        try:
            if not self._is_described:
                texts = {SETTINGS: encode_robot_settings(settings), **session_versions()}
                self._writer.describe({**self._texts, **texts})
                self._is_described = True
            channel, data = encode_start(robot)
            self._writer.write(channel, time_ns, data)
        except SkillError as error:
            self.failure = str(error)

    def record(self, received: tuple[ReceivedMessage, ...], robot: RobotState, step: RobotStep) -> None:
        """Record a step.

        Args:
            received: Messages that the step was given.
            robot: What the robot senses.
            step: Result of the step.
        """
        if self.failure:
            return
        try:
            for channel, data in encode_step(received, robot, step):
                self._writer.write(channel, step.site.time, data)
        except SkillError as error:
            self.failure = str(error)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if self.failure and error is None:  # keep what was recorded under the name of an unfinished session
            error = InvalidInput(self.failure)
        try:
            self._writer.__exit__(type(error) if error else None, error, traceback)
        except InvalidInput as problem:
            if problem is not error:
                self.failure = self.failure or str(problem)


def replay_session(path: str | Path) -> tuple[Replay, SessionFile]:
    """Repeat a recorded session and compare every target and every message bit for bit.

    Args:
        path: File that `SessionRecorder` wrote, or the `.part` of a recording that was cut short.

    Returns:
        What was compared, up to the first difference, and the file.

    Raises:
        UnreadableFile: If the file is damaged, of another version, or not a recording of a robot's site.
        SkillError: If a record is damaged, or the file cannot be read.
    """
    session = read_session(path)
    for name in REFUSED:
        recorded, present = session.metadata.get(name), session_versions()[name]
        if recorded is None:
            raise UnreadableFile(
                f"{path} does not state the version of {name}, expected a recording of pilotfish mission"
            )
        if recorded != present:
            raise UnreadableFile(
                f"{path} was recorded with {name} {recorded}, and this is {present}; replay it with the "
                "version that recorded it"
            )
    settings = decode_robot_settings(session.metadata.get(SETTINGS, ""), decode_assisted_skill)
    return replay_records(settings, session.records()), session


def changed_versions(session: SessionFile) -> dict[str, tuple[str, str]]:
    """Return versions that differ from the present ones and may explain a difference: recorded, present.

    Args:
        session: Recorded session.
    """
    recorded = session.metadata
    return {
        name: (recorded[name], present)
        for name, present in session_versions().items()
        if name in recorded and recorded[name] != present
    }
