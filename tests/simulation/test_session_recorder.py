"""Recordings of missions, and their replay bit for bit."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import numpy as np
import pytest
from teleop_messages import EXAMPLES

from pilotfish.environments import Task
from pilotfish.errors import UnreadableFile
from pilotfish.geometry import Pose
from pilotfish.io import SessionRecord, SessionWriter, encode_assisted_skill, open_skill, read_session
from pilotfish.simulation import situation_from_seed
from pilotfish.simulation.mission import MissionResult, MissionSettings, run_mission
from pilotfish.simulation.mission_skill import envelope_around_skill, learn_assisted_skill
from pilotfish.simulation.session_recorder import SessionRecorder, replay_session
from pilotfish.teleop import (
    LinkSettings,
    MalformedMessage,
    ReceivedMessage,
    RobotSettings,
    RobotState,
    SessionState,
    decode_robot_settings,
    encode_robot_settings,
    replay_records,
)
from pilotfish.teleop.session_record import (
    RECEIVED,
    SENT,
    START,
    TARGET,
    decode_received,
    decode_sensed,
    decode_target,
    encode_sensed,
)

pytestmark = pytest.mark.usefixtures("unchecked")

BAD_LINK = LinkSettings(delay=0.1, loss=0.05, jitter=0.02)
OUTAGE = 2.5  # s, while the robot moves
Record = Callable[..., MissionResult]


@pytest.fixture(scope="module")
def skill(alignment_skill: Path) -> bytes:
    return encode_assisted_skill(open_skill(alignment_skill / "skill"))


@pytest.fixture
def record(skill: bytes, alignment_task: Task[Any]) -> Record:
    """Return a function that records a mission of a short task."""

    def run(path: Path, data: bytes = skill, **options: Any) -> MissionResult:
        settings = MissionSettings(**{"forward": BAD_LINK, "backward": BAD_LINK, "piece_steps": 1, **options})
        situation = situation_from_seed(alignment_task, "test", 0, 0)
        with SessionRecorder(path) as recorder:
            result = run_mission(
                data, alignment_task, situation, np.random.default_rng(0), settings, recorder=recorder
            )
        assert recorder.failure is None
        return result

    return run


@pytest.fixture
def recording(record: Record, tmp_path: Path) -> Path:
    """Return the recording of a mission in shared control."""
    record(tmp_path / "a.mcap")
    return tmp_path / "a.mcap"


def rewrite(path: Path, change: Callable[[SessionRecord], SessionRecord], **texts: str) -> Path:
    """Write a recording with other records and texts."""
    session, other = read_session(path), path.with_name("b.mcap")
    with SessionWriter(other) as writer:
        writer.describe({**session.metadata, **texts})
        for each in session.records():
            writer.write(*change(each))
    return other


def test_replay_of_shared_mission_is_identical(recording: Path):
    replay, session = replay_session(recording)
    assert replay.difference is None
    assert session.is_complete
    assert replay.left_over == 0
    records = list(session.records())
    assert replay.steps == sum(each.channel == TARGET for each in records) > 100
    assert replay.messages == sum(each.channel in (RECEIVED, SENT) for each in records)


def test_recorder_does_not_change_the_mission(
    record: Record, skill: bytes, alignment_task: Task[Any], tmp_path: Path
):
    recorded = record(tmp_path / "a.mcap")
    plain = run_mission(
        skill,
        alignment_task,
        situation_from_seed(alignment_task, "test", 0, 0),
        np.random.default_rng(0),
        MissionSettings(forward=BAD_LINK, backward=BAD_LINK, piece_steps=1),
    )
    assert np.array_equal(plain.targets, recorded.targets)


def test_replay_of_autonomous_mission_through_an_outage_is_identical(
    record: Record, skill: bytes, alignment_task: Task[Any], tmp_path: Path
):
    from pilotfish.environments import Workcell

    poses = Workcell(alignment_task, situation_from_seed(alignment_task, "test", 0, 0)).frames()
    envelope = envelope_around_skill(skill, poses, 5.0, ("autonomous",))
    link = replace(BAD_LINK, outages=((OUTAGE, 1.0),))
    record(tmp_path / "a.mcap", mode="autonomous", envelope=envelope, forward=link, backward=link)
    replay, _ = replay_session(tmp_path / "a.mcap")
    assert (replay.difference, replay.left_over) == (None, 0)
    records = read_session(tmp_path / "a.mcap").records()
    states = {decode_target(each.data)[1] for each in records if each.channel == TARGET}
    assert SessionState.CONTINUING in states


@pytest.mark.slow  # six demonstrations are recorded, from which the fixture is learned
def test_replay_of_fixture_mission_is_identical(record: Record, alignment_task: Task[Any], tmp_path: Path):
    data = learn_assisted_skill(alignment_task, lambda done, count: None)
    record(tmp_path / "a.mcap", data, mode="fixture")
    replay, _ = replay_session(tmp_path / "a.mcap")
    assert replay.difference is None


def test_replay_flipped_bit_of_a_target_names_time_and_number(recording: Path):
    targets = [each for each in read_session(recording).records() if each.channel == TARGET]
    chosen = targets[60]

    def flip(each: SessionRecord) -> SessionRecord:
        if each != chosen:
            return each
        data = bytearray(each.data)
        data[10] ^= 1  # the lowest bit of the first number, behind time, state and reason
        return each._replace(data=bytes(data))

    difference = replay_session(rewrite(recording, flip))[0].difference
    assert difference is not None
    assert (difference.time_ns, difference.field) == (chosen.time_ns, "target pose x")
    assert difference.recorded != difference.replayed


def test_replay_flipped_bit_of_a_message_names_its_field(recording: Path):
    sent = [each for each in read_session(recording).records() if each.channel == SENT]

    def flip(each: SessionRecord) -> SessionRecord:
        if each != sent[30]:
            return each
        data = bytearray(each.data)
        data[3] ^= 1  # the number of the report, behind receiver and kind
        return each._replace(data=bytes(data))

    difference = replay_session(rewrite(recording, flip))[0].difference
    assert difference is not None
    assert difference.field == "report to 1: number"


def test_replay_changed_time_is_reported(recording: Path):
    times = sorted({each.time_ns for each in read_session(recording).records()})

    def delay(each: SessionRecord) -> SessionRecord:
        return each._replace(time_ns=each.time_ns + 1) if each.time_ns == times[50] else each

    difference = replay_session(rewrite(recording, delay))[0].difference
    assert difference is not None
    assert (difference.field, difference.recorded) == ("time", f"{times[50]} ns")


def test_replay_changed_setting_is_reported(recording: Path):
    text = read_session(recording).metadata["robot"]
    other = text.replace('"report_period":0.05', '"report_period":0.06')
    assert other != text
    difference = replay_session(rewrite(recording, lambda each: each, robot=other))[0].difference
    assert difference is not None
    assert "message" in difference.field or "report" in difference.field


def test_replay_without_the_last_received_messages_differs(recording: Path):
    session, other = read_session(recording), recording.with_name("b.mcap")
    last = max(each.time_ns for each in session.records()) // 2
    with SessionWriter(other) as writer:
        writer.describe(session.metadata)
        for each in session.records():
            if each.channel != RECEIVED or each.time_ns < last:
                writer.write(*each)
    assert replay_session(other)[0].difference is not None


@pytest.mark.parametrize("name", ["recording", "messages", "pilotfish"])
def test_replay_other_version_is_refused_by_name(recording: Path, name: str):
    other = rewrite(recording, lambda each: each, **{name: "of tomorrow"})
    with pytest.raises(UnreadableFile, match=f"{name} of tomorrow"):
        replay_session(other)


def test_replay_unknown_or_missing_setting_is_refused_by_name():
    settings = RobotSettings(lambda _: None)  # type: ignore[arg-type,return-value]
    text = encode_robot_settings(settings)
    for other, name in (
        (text.replace("max_step", "min_step"), "max_step"),
        (text.replace('"speed"', '"velocity"'), "speed"),
        ("[]", "JSON object"),
        ("{", "settings"),
    ):
        with pytest.raises(UnreadableFile, match=name):
            decode_robot_settings(other, settings.decode_skill)


def test_settings_are_the_same_after_encoding():
    settings = RobotSettings(lambda _: None, operators=(1, 3), observers=(7,), report_period=0.07)  # type: ignore[arg-type,return-value]
    text = encode_robot_settings(settings)
    assert encode_robot_settings(decode_robot_settings(text, settings.decode_skill)) == text


def test_sensed_numbers_are_the_same_bits_after_encoding(rng: np.random.Generator):
    poses = {"ventil ä": Pose(rng.normal(size=3), rng.normal(size=4))}
    for frames, reported in ((None, None), (poses, None), (poses, {}), (None, poses), ({}, poses)):
        robot = RobotState(rng.normal(size=7), rng.normal(size=6), np.nan, frames, reported)
        read = decode_sensed(encode_sensed(robot))
        assert encode_sensed(read) == encode_sensed(robot)
        assert (read.frames is None, read.reported is None) == (frames is None, reported is None)


def test_received_messages_are_the_same_after_encoding(recording: Path):
    """The codec's own tests prove it for random messages; here for every kind and a whole session."""
    for each in read_session(recording).records():
        if each.channel == RECEIVED:
            message = decode_received(each.data)
            again = encode_received(message)
            assert again == each.data
            assert repr(decode_received(again)) == repr(message)
    for kind, message in EXAMPLES.items():
        read = decode_received(encode_received(ReceivedMessage(3, message, 9))).message
        again = decode_received(encode_received(ReceivedMessage(3, read, 9))).message
        assert repr(again) == repr(read), kind


def encode_received(message: ReceivedMessage) -> bytes:
    from pilotfish.teleop.session_record import _encode_received

    return _encode_received(message)


def test_replay_records_damaged_or_without_start_are_refused(recording: Path):
    settings = RobotSettings(lambda _: None)  # type: ignore[arg-type,return-value]
    records = list(read_session(recording).records())
    with pytest.raises(MalformedMessage, match="begin with a start"):
        replay_records(settings, records[1:])
    for channel in (START, RECEIVED, "robot/sensed"):
        with pytest.raises(MalformedMessage, match="bytes"):
            replay_records(settings, [records[0], (channel, 0, b"short")])


def test_disk_full_stops_the_recorder_and_not_the_mission(
    record: Record, skill: bytes, alignment_task: Task[Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    complete = record(tmp_path / "complete.mcap")
    written = 0

    def fill_disk(self: SessionWriter, *arguments: Any) -> None:
        nonlocal written
        written += 1
        if written > 400:
            with self._writing():
                raise OSError(28, "No space left on device")
        write(self, *arguments)

    write = SessionWriter.write
    monkeypatch.setattr(SessionWriter, "write", fill_disk)
    with SessionRecorder(tmp_path / "a.mcap") as recorder:
        result = run_mission(
            skill,
            alignment_task,
            situation_from_seed(alignment_task, "test", 0, 0),
            np.random.default_rng(0),
            MissionSettings(forward=BAD_LINK, backward=BAD_LINK, piece_steps=1),
            recorder=recorder,
        )
    assert recorder.failure is not None
    assert "No space left" in recorder.failure
    assert np.array_equal(result.targets, complete.targets)
    assert not (tmp_path / "a.mcap").exists()
    replay, session = replay_session(tmp_path / "a.mcap.part")
    assert (replay.difference, session.is_complete) == (None, False)


def test_recording_cut_anywhere_replays_identically(recording: Path, rng: np.random.Generator):
    content = recording.read_bytes()
    start = len(content) // 3
    for size in rng.integers(start, len(content), 3):
        recording.with_name("cut").write_bytes(content[:size])
        replay, session = replay_session(recording.with_name("cut"))
        assert (replay.difference, session.is_complete) == (None, False)
        assert replay.steps > 0


@pytest.mark.slow  # five processes, each of which imports MuJoCo
def test_killed_recorder_leaves_all_but_the_last_second(alignment_skill: Path, tmp_path: Path):
    """The process is killed at five different times of the mission; it states its time before each step."""
    program = Path(__file__).with_name("recorded_mission.py")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    for n in range(5):
        path = tmp_path / f"{n}.mcap"
        command = [sys.executable, str(program), str(alignment_skill / "skill"), str(path)]
        with subprocess.Popen(command, stdout=subprocess.PIPE, env=environment, text=True) as process:
            assert process.stdout is not None
            last = 0.0
            for line in process.stdout:
                last = float(line)
                if last > 1.0 + 0.7 * n:
                    process.send_signal(signal.SIGKILL)
                    break
            last = max([last, *(float(line) for line in process.stdout if line.endswith("\n"))])
        assert process.returncode == -signal.SIGKILL
        wait_for(path.with_name(f"{n}.mcap.part"))
        replay, session = replay_session(path.with_name(f"{n}.mcap.part"))
        assert (replay.difference, session.is_complete) == (None, False)
        assert last - replay.time_ns / 1e9 <= 1.0


def wait_for(path: Path) -> None:
    deadline = monotonic() + 5.0
    while not path.exists() and monotonic() < deadline:
        sleep(0.05)
