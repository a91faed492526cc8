"""Skills at the robot: the mission, the pieces as they arrive, and the assistant that uses them."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from pilotfish.assistance import (
    Assistant,
    AssistedSkill,
    direct_skill,
    initial_state,
    make_assistant,
)
from pilotfish.demonstrations import Frame, frame_from_pose, world_frame
from pilotfish.errors import SkillError
from pilotfish.geometry import Pose
from pilotfish.teleop.errors import UnsuitableSkill
from pilotfish.teleop.messages import Mission, ReceivedMessage, SkillPiece, SkillState
from pilotfish.teleop.robot_site import RobotSite, Scene, Skills
from pilotfish.teleop.robot_values import UNIT_TOLERANCE, RobotSettings, RobotState
from pilotfish.teleop.session import MOVING
from pilotfish.teleop.skill_transfer import add_piece, expect_skills
from pilotfish.types import Array, Float

Poses = Mapping[str, Pose]


def receive_skills(
    settings: RobotSettings, site: RobotSite, received: tuple[ReceivedMessage, ...]
) -> RobotSite:
    """Return the state after missions and pieces of the holder.

    A new mission is accepted while the robot does not move.

    Args:
        settings: Settings.
        site: State before.
        received: Messages of authenticated peers.
    """
    for each in received:
        if each.sender != site.control.holder:
            continue
        skills = site.skills
        if isinstance(each.message, Mission):
            if each.message.number > skills.mission.number and site.control.state not in MOVING:
                store = expect_skills(skills.store, each.message.skills)
                site = _with_direct_control(site, settings, each.message)
                site = replace(site, skills=replace(site.skills, store=store))
        elif isinstance(each.message, SkillPiece) and not _has_wrong_hash(skills, each.message):
            store = add_piece(skills.store, each.message, lambda data: _prepare_skill(settings, data))
            site = replace(site, skills=replace(skills, store=store))
    return site


def _has_wrong_hash(skills: Skills, piece: SkillPiece) -> bool:
    """Return whether the skill of a piece arrived with another content; a new mission asks for it again."""
    return skills.store.status(piece.hash).state is SkillState.WRONG_HASH


def _with_direct_control(site: RobotSite, settings: RobotSettings, mission: Mission) -> RobotSite:
    """Return the state with a mission whose skills are not prepared yet."""
    assistant = make_assistant([direct_skill(settings.layout)], limits=settings.limits)
    world, pose = (world_frame(assistant.layout.width),), site.motion.target.pose
    motion = replace(site.motion, assistance=initial_state(assistant, pose, world, world), last=None)
    skills = replace(site.skills, mission=mission, assistant=assistant, prepared={})
    return replace(site, skills=skills, motion=motion)


def _prepare_skill(settings: RobotSettings, data: bytes) -> AssistedSkill:
    """Return the skill in some bytes, or raise SkillError."""
    skill, expected = settings.decode_skill(data), direct_skill(settings.layout).skill.layout
    if skill.skill.layout != expected:
        raise UnsuitableSkill(
            f"the skill has the columns {', '.join(skill.skill.layout.names)}, expected "
            f"{', '.join(expected.names)}"
        )
    return skill


def prepare_skills(site: RobotSite) -> RobotSite:
    """Return the state with every skill in the assistant that arrived and whose objects are perceived.

    Args:
        site: State with the scene of this step.
    """
    skills = site.skills
    for name in skills.mission.skills:
        skill = skills.store.skill(name)
        if name in skills.prepared or skill is None or not _perceives(site.scene, skill):
            continue
        assistant = replace(skills.assistant, skills=(*skills.assistant.skills, skill))
        prepared = {**skills.prepared, name: len(assistant.skills) - 1}
        site = replace(site, skills=replace(skills, assistant=assistant, prepared=prepared))
        skills = site.skills
    return site


def _perceives(scene: Scene, skill: AssistedSkill) -> bool:
    """Return whether every frame of a skill is perceived, and the skill can be adapted to them."""
    if scene.actual is None or scene.reported is None:
        return False
    names = {frame.name for frame in scene.actual} & {frame.name for frame in scene.reported}
    return set(skill.skill.frame_names) <= names


def update_scene(assistant: Assistant, scene: Scene, robot: RobotState, time_ns: int) -> Scene:
    """Return the frames at the robot; the same objects while no pose changes.

    Args:
        assistant: Assistant, whose columns the frames have.
        scene: Scene of the step before.
        robot: What the robot senses.
        time_ns: Time of this step [ns].
    """
    before, reported = scene.state, robot.reported or robot.frames
    actual_frames, reported_frames = scene.actual, scene.reported
    if not _same_poses(before.frames, robot.frames) or (scene.actual is None) != (robot.frames is None):
        actual_frames = make_frames(assistant, robot.frames)
    if not _same_poses(before.reported or before.frames, reported) or (scene.reported is None) != (
        reported is None
    ):
        reported_frames = make_frames(assistant, reported)
    perceived = scene.perceived if actual_frames is None else time_ns
    return Scene(actual_frames, reported_frames, robot, perceived)


def make_frames(assistant: Assistant, poses: Poses | None) -> tuple[Frame, ...] | None:
    """Return frames of poses, and the frame of the world; None if the poses are stale or impossible.

    Args:
        assistant: Assistant, whose columns the frames have.
        poses: Pose of each object.
    """
    if poses is None or not all(_is_unit(pose.quaternion) for pose in poses.values()):
        return None
    layout = assistant.layout
    try:
        frames = [frame_from_pose(name, layout, pose) for name, pose in poses.items()]
    except SkillError:
        return None
    return (*frames, world_frame(layout.width))


def _is_unit(quaternion: Float[Array, " 4"]) -> bool:
    return abs(float(np.sqrt(quaternion @ quaternion)) - 1.0) < UNIT_TOLERANCE


def _same_poses(before: Poses | None, now: Poses | None) -> bool:
    if before is None or now is None:
        return before is now
    if before is now:
        return True
    return before.keys() == now.keys() and all(
        (before[name].position == now[name].position).all()
        and (before[name].quaternion == now[name].quaternion).all()
        for name in now
    )
