"""Record demonstrations, perform skills and operate the robot in physics, with films."""

from pilotfish.simulation.camera_execution import (
    CameraExecution,
    CameraObserver,
    CameraSimulation,
    marked_task,
    perform_from_camera,
)
from pilotfish.simulation.captions import caption_images
from pilotfish.simulation.execution import ExecutionResult, perform, plan_in_situation
from pilotfish.simulation.films import FilmRecorder, encode_film, film_strip, require_pillow, write_film
from pilotfish.simulation.marked_tasks import (
    MARKED_TASKS,
    CameraScene,
    MarkedFrame,
    MarkedTask,
    calibration,
    camera_scene,
)
from pilotfish.simulation.meshes import baxter_meshes
from pilotfish.simulation.mission import MissionResult, MissionSettings, run_mission
from pilotfish.simulation.mission_skill import MissionSkill, envelope_around_skill, mission_skill
from pilotfish.simulation.recording import (
    RecordedDemonstration,
    delay_observations,
    record,
    record_demonstrations,
    simulated_leader,
    situation_from_seed,
)
from pilotfish.simulation.robot_files import find_robot, robot_from_file, write_joint_trajectory
from pilotfish.simulation.selection import select_by_success
from pilotfish.simulation.session_recorder import SessionRecorder, changed_versions, replay_session
from pilotfish.simulation.study import (
    NOISE_FREE,
    OPERATORS,
    Condition,
    StudyRun,
    skill_name,
    study_conditions,
    study_runs,
)
from pilotfish.simulation.study_measures import perform_study_run
from pilotfish.simulation.study_skills import learn_study_skills
from pilotfish.simulation.study_statistics import ModeSummary, Ratio, paired_ratio, preferred_mode
from pilotfish.simulation.teleoperation import Link, TeleoperationResult, displace_view, teleoperate

__all__ = [
    "MARKED_TASKS",
    "NOISE_FREE",
    "OPERATORS",
    "CameraExecution",
    "CameraObserver",
    "CameraScene",
    "CameraSimulation",
    "Condition",
    "ExecutionResult",
    "FilmRecorder",
    "Link",
    "MarkedFrame",
    "MarkedTask",
    "MissionResult",
    "MissionSettings",
    "MissionSkill",
    "ModeSummary",
    "Ratio",
    "RecordedDemonstration",
    "SessionRecorder",
    "StudyRun",
    "TeleoperationResult",
    "baxter_meshes",
    "calibration",
    "camera_scene",
    "caption_images",
    "changed_versions",
    "delay_observations",
    "displace_view",
    "encode_film",
    "envelope_around_skill",
    "film_strip",
    "find_robot",
    "learn_study_skills",
    "marked_task",
    "mission_skill",
    "paired_ratio",
    "perform",
    "perform_from_camera",
    "perform_study_run",
    "plan_in_situation",
    "preferred_mode",
    "record",
    "record_demonstrations",
    "replay_session",
    "require_pillow",
    "robot_from_file",
    "run_mission",
    "select_by_success",
    "simulated_leader",
    "situation_from_seed",
    "skill_name",
    "study_conditions",
    "study_runs",
    "teleoperate",
    "write_film",
    "write_joint_trajectory",
]
