"""What the assistance knows: skills prepared for it, and its settings."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from pilotfish.assistance.authority import Gate
from pilotfish.assistance.coordinates import coordinate_layout, coordinate_skill
from pilotfish.assistance.limits import Limits
from pilotfish.assistance.literal import require_joint
from pilotfish.assistance.mapping import OperatorMapping
from pilotfish.assistance.occupancy import occupancy_tables
from pilotfish.assistance.operator_noise import OperatorNoise
from pilotfish.assistance.virtual_fixture import VirtualFixture
from pilotfish.demonstrations import Layout
from pilotfish.errors import InvalidInput
from pilotfish.kernels import AssistanceSettings, OccupancyTables
from pilotfish.models import Skill
from pilotfish.types import Array, Float
from pilotfish.validation import require_number, require_type, shorten_repr

MIN_CONTROL_COST, MAX_CONTROL_COST = 1e-12, 1e12


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class AssistedSkill:
    """A skill prepared for assistance.

    Attributes:
        skill: Skill of coordinates, with orientations on S^3.
        layout: Columns of the original skill, to which frames may belong.
        tables: Filter of its states.
        gate: Where assistance has authority.
        switches: Scalar columns that take two values.
        levels: Lowest and highest value of each of them.
        joint: Joint skill of the literal variant; None selects the carried one.
        joint_tables: Filter of the states of the joint skill.
        fixture: Virtual fixture of the mode "fixture"; None if there is none.
    """

    skill: Skill
    layout: Layout
    tables: OccupancyTables
    gate: Gate
    switches: tuple[int, ...]
    levels: Float[Array, "2 S"]
    joint: Skill | None
    joint_tables: OccupancyTables | None
    fixture: VirtualFixture | None

    @property
    def can_plan(self) -> bool:
        """Whether the skill has an order in time, so that it can be continued autonomously."""
        return self.skill.dynamics.has_time_order


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Assistant:
    """Skills and settings of `step_assistance`; `make_assistant` checks them.

    Attributes:
        skills: Prepared skills, at least one, of the same coordinates.
        mapping: Scale and offset from hand to robot.
        noise: Imprecision of the operator.
        limits: Limits of the target.
        control_cost: r of the LQR of the literal variant.
        settings: All these for the kernel, with each skill.
    """

    skills: tuple[AssistedSkill, ...]
    mapping: OperatorMapping = field(default_factory=OperatorMapping)
    noise: OperatorNoise = field(default_factory=OperatorNoise)
    limits: Limits = field(default_factory=Limits)
    control_cost: float = 0.01
    settings: tuple[AssistanceSettings, ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "settings", tuple(_settings(self, skill) for skill in self.skills))

    @property
    def layout(self) -> Layout:
        """Columns of commands and targets."""
        return self.skills[0].skill.layout


def _settings(assistant: Assistant, skill: AssistedSkill) -> AssistanceSettings:
    """Return the settings of a step with a skill."""
    limits = assistant.limits
    return AssistanceSettings(
        assistant.noise.deviations(assistant.layout) ** 2,
        limits.lower,
        limits.upper,
        skill.gate.full,
        skill.gate.none,
        limits.speed,
        limits.acceleration,
        limits.angular_speed,
        limits.angular_acceleration,
        skill.skill.period,
    )


def assisted_skill(
    skill: Skill,
    *,
    gate: Gate | None = None,
    joint_skill: Skill | None = None,
    fixture: VirtualFixture | None = None,
) -> AssistedSkill:
    """Create a skill prepared for assistance.

    Args:
        skill: Learned skill of a pose with scalars, with or without derivatives, flat or on S^3.
        gate: Where assistance has authority, from `calibrate_gate`; None takes `Gate()`.
        joint_skill: Skill learned from `joint_demonstration` of the same demonstrations. Shared control then
            follows equations 6.4-6.9 (`literal`); None is `carried`.
        fixture: Virtual fixture from `learn_virtual_fixture` of the same demonstrations, which makes the mode
            "fixture" possible.

    Raises:
        InvalidInput: If the columns are not a pose with scalars, or a number is not finite.
        NotPositiveDefinite: If a covariance is singular.

    Example:
        >>> rng = np.random.default_rng(0)
        >>> skill = pf.learn(pf.io.synthetic_valve(rng), states=5, rng=rng).skill
        >>> pf.assistance.assisted_skill(skill).skill.width
        7
    """
    coordinates = coordinate_skill(skill)
    require_type(gate, "gate", (Gate, type(None)), "Gate() or calibrate_gate(...) makes one")
    if joint_skill is not None:
        require_joint(joint_skill)
        if joint_skill.frame_names != skill.frame_names:
            raise InvalidInput(
                f"joint_skill has the frames {list(joint_skill.frame_names)}, expected those of the skill, "
                f"{list(skill.frame_names)}"
            )
    if fixture is not None:
        _require_same_task(fixture, coordinates)
    switches, levels = _switching_scalars(skill, coordinates.layout)
    return AssistedSkill(
        coordinates,
        skill.layout,
        occupancy_tables(skill.dynamics),
        gate or Gate(),
        switches,
        levels,
        joint_skill,
        occupancy_tables(joint_skill.dynamics) if joint_skill else None,
        fixture,
    )


def make_assistant(
    skills: Sequence[AssistedSkill],
    *,
    mapping: OperatorMapping | None = None,
    noise: OperatorNoise | None = None,
    limits: Limits | None = None,
    control_cost: float = 0.01,
) -> Assistant:
    """Create an assistant from prepared skills and settings.

    Args:
        skills: Prepared skills; a command names one by its index.
        mapping: Scale and offset from hand to robot; None is one to one.
        noise: Imprecision of the operator; None is 1 cm and 0.05 rad.
        limits: Limits of the target; None is 0.5 m/s and 2 rad/s.
        control_cost: r of the LQR of the literal variant.

    Raises:
        InvalidInput: If skills is empty, or two have different coordinates.
    """
    require_type(skills, "skills", Sequence, "pass a list: [assisted_skill(skill)]")
    if not skills:
        raise InvalidInput("skills is empty, expected at least one; pass [assisted_skill(skill)]")
    for n, skill in enumerate(skills):
        require_type(skill, f"skills[{n}]", AssistedSkill, "assisted_skill(skill) makes one")
        if skill.skill.layout != skills[0].skill.layout:
            raise InvalidInput(
                f"skills[{n}] has the columns {', '.join(skill.skill.layout.names)}, expected those of the "
                f"first, {', '.join(skills[0].skill.layout.names)}"
            )
    require_number(control_cost, "control_cost", MIN_CONTROL_COST, MAX_CONTROL_COST)
    for name, value, kind in (
        ("mapping", mapping, OperatorMapping),
        ("noise", noise, OperatorNoise),
        ("limits", limits, Limits),
    ):
        require_type(value, name, (kind, type(None)), f"{kind.__name__}() makes one")
    return Assistant(
        tuple(skills),
        mapping or OperatorMapping(),
        noise or OperatorNoise(),
        limits or Limits(),
        control_cost,
    )


def _require_same_task(fixture: VirtualFixture, coordinates: Skill) -> None:
    """Raise InvalidInput unless a virtual fixture has the columns and the frames of a skill."""
    require_type(fixture, "fixture", VirtualFixture, "create one with learn_virtual_fixture")
    if fixture.layout.names != coordinates.layout.names:
        raise InvalidInput(
            f"fixture has the columns {', '.join(fixture.layout.names)}, expected those of the skill, "
            f"{', '.join(coordinates.layout.names)}"
        )
    if sorted(fixture.skill.frame_names) != sorted(coordinates.frame_names):
        raise InvalidInput(
            f"fixture has the frames {list(fixture.skill.frame_names)}, expected those of the skill, "
            f"{list(coordinates.frame_names)}"
        )


def _switching_scalars(skill: Skill, layout: Layout) -> tuple[tuple[int, ...], Float[Array, "2 S"]]:
    """Return the scalar columns that take two values, among the coordinates, and the values."""
    coordinates_layout = coordinate_layout(skill.layout)
    if skill.demonstrated is None:
        return (), np.empty((2, 0))
    names = [coordinates_layout.names.index(name) for name in skill.demonstrated.switches]
    columns = np.array(skill.layout.coordinates)[names].astype(int)
    return tuple(names), np.stack([skill.demonstrated.lowest[columns], skill.demonstrated.highest[columns]])
