"""Assistance while the robot is at rest: follow the operator again from where the robot is."""

from dataclasses import replace

import numpy as np

from pilotfish.assistance.assistant import Assistant, AssistedSkill, assisted_skill
from pilotfish.assistance.coordinates import pose_width, scalar_columns
from pilotfish.assistance.occupancy import resume_filter
from pilotfish.assistance.values import AssistanceState
from pilotfish.demonstrations import Layout, world_frame
from pilotfish.errors import InvalidInput
from pilotfish.gaussians.structures import DenseCovariances
from pilotfish.models import MixtureWeights, Provenance, Skill
from pilotfish.types import Array, Float
from pilotfish.validation import finite_array, require_type

WIDE, ONE_STEP = 1e3, 0.1  # m or rad, s


def rest_target(assistant: Assistant, state: AssistanceState, pose: Float[Array, " D"]) -> AssistanceState:
    """Return the state with the target at rest at a pose; a later step moves it from there by a blend.

    A plan and a fixture end. The filter keeps what it recognised; after a plan, the state that the plan had
    reached.

    Args:
        assistant: Skills and settings.
        state: State of the step before.
        pose: Pose and scalars of the robot.

    Raises:
        InvalidInput: If pose does not have the columns of the assistant, or is not finite.
    """
    require_type(assistant, "assistant", Assistant, "make_assistant([assisted_skill(skill)]) makes one")
    require_type(state, "state", AssistanceState, "initial_state makes one")
    pose = finite_array(pose, "pose", (assistant.layout.width,)).copy()
    skill, now, joint = assistant.skills[state.skill], state.memory.filter, state.joint
    if state.plan is not None:
        now = resume_filter(skill.tables, int(state.plan.states[state.plan.row]))
        joint = resume_filter(skill.joint_tables, None) if skill.joint_tables else None
    columns = scalar_columns(assistant.layout)
    memory = replace(
        state.memory,
        filter=now,
        pose=pose,
        desired=pose,
        velocity=np.zeros(assistant.layout.tangent.width),
        held_values=pose[columns].copy(),
        held_commands=state.memory.command[columns].copy(),
        is_following=False,
    )
    return replace(
        state,
        memory=memory,
        mode="direct",
        plan=None,
        cart=None,
        joint=joint,
        tracked=None,
    )


def misalignment(assistant: Assistant, state: AssistanceState) -> tuple[float, float]:
    """Return distance [m] and angle [rad] between the target and the desired pose at the last change.

    After one step from `rest_target`, these say how far the operator's command is from the robot.

    Args:
        assistant: Skills and settings.
        state: State after the step.

    Raises:
        InvalidInput: If an argument has another type.
    """
    require_type(assistant, "assistant", Assistant, "make_assistant([assisted_skill(skill)]) makes one")
    require_type(state, "state", AssistanceState, "initial_state makes one")
    offset = state.memory.offset
    return float(np.linalg.norm(offset[:3])), float(np.linalg.norm(offset[3 : pose_width(assistant.layout)]))


def direct_skill(layout: Layout) -> AssistedSkill:
    """Return a skill for direct control only: one state of no precision in the frame of the world.

    Args:
        layout: Columns of a pose with scalars.

    Raises:
        InvalidInput: If layout is something else.
    """
    require_type(layout, "layout", Layout, "pose_layout() makes one")
    mean = np.zeros((1, 1, layout.width))
    for columns in (*layout.quaternions, *layout.unit_quaternions):
        mean[0, 0, columns.start] = 1.0
    if not mean.any():
        raise InvalidInput(f"layout has {', '.join(layout.names)}, expected a position and an orientation")
    covariances = DenseCovariances(WIDE**2 * np.eye(layout.tangent.width)[None])
    provenance = Provenance((), 0, "", "dense", np.nan, 0, True, "", "direct control")
    dynamics, names = MixtureWeights(np.ones(1)), (world_frame(layout.width).name,)
    skill = Skill(dynamics, mean, (covariances,), layout, ONE_STEP, names, provenance)
    return assisted_skill(skill)
