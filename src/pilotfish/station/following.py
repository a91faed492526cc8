"""A skill where things stand, as a linear controller can follow it: as it is, or on a flat map of it."""

from dataclasses import dataclass

import numpy as np

from pilotfish.control import Feedback, Motion, Reference, double_integrator, track
from pilotfish.demonstrations import Layout, Quantity
from pilotfish.errors import InvalidInput
from pilotfish.geometry import angle
from pilotfish.models import AdaptedSkill, Skill
from pilotfish.planning import Chart, ViaPoint, chart, on_chart
from pilotfish.types import Array, Float
from pilotfish.validation import short_list

MOST_WORK = 2**34  # squared steps times states of a plan that nobody asked the length of: some seconds


@dataclass(frozen=True, slots=True, eq=False)
class Setting:
    """The adapted skill, and its flat map where orientations are on S^3.

    Plans and controllers have the columns of flat: rotation vectors [rad] from the map's base, which is the
    mean of the states' orientations, in the place of those orientations; and the rates of these [rad/s].
    """

    adapted: AdaptedSkill
    map: Chart | None

    @property
    def flat(self) -> AdaptedSkill:
        return self.map.skill if self.map else self.adapted

    def inward(self, x: Float[Array, "*B D"]) -> Float[Array, "*B E"]:
        return self.map.inward(x) if self.map else x

    def outward(self, y: Float[Array, "*B E"]) -> Float[Array, "*B D"]:
        return self.map.outward(y) if self.map else y

    def wishes(self, points: tuple[ViaPoint, ...]) -> list[ViaPoint]:
        """Via-points as plans want them.    Raises: InvalidInput, when one cannot be on the map."""
        return [on_chart(point, self.map) if self.map else point for point in points]


def setting(adapted: AdaptedSkill) -> Setting:
    """Raises: InvalidInput, when the columns are not coordinates followed by the derivative of each."""
    coordinates_with_speeds(adapted.layout)
    return Setting(adapted, chart(adapted) if adapted.layout.turns else None)


def followed(
    here: Setting, reference: Reference, start: Float[Array, " E"], effort: float
) -> tuple[Feedback, Motion]:
    """The controller of a plan in flat columns, and the motion that it makes, in the skill's own.

    The motion's inputs are those of the controller: of an orientation on S^3, the acceleration of its
    rotation vector on the map [rad/s^2].
    """
    axes = coordinates_with_speeds(here.adapted.layout)
    feedback = track(double_integrator(axes, here.adapted.period), reference, effort)
    motion = feedback.rollout(start)
    return feedback, Motion(here.outward(motion.x), motion.u, motion.period)


def coordinates_with_speeds(layout: Layout) -> int:
    """How many coordinates there are, when each has its derivative in the second half.

    An orientation on S^3 has three: its deviations, and its angular velocity in body axes.
    Raises: InvalidInput, when the columns are others: a double integrator cannot follow them.
    """
    flat = layout.tangent
    half = flat.width // 2
    here = [part for part, columns in zip(flat.parts, flat.slices, strict=True) if columns.stop <= half]
    there = flat.parts[len(here) :]
    if [(p.name, p.size, p.derivative + 1) for p in here] != [(p.name, p.size, p.derivative) for p in there]:
        fix = (
            "learn from a recording that has both"
            if any(part.derivative for part in flat.parts)
            else "learn it again with them: pf.with_derivatives, or pilotfish learn --speeds"
        )
        raise InvalidInput(
            f"the columns are {short_list(layout.names)}, expected coordinates, then the derivative of each; "
            f"{fix}"
        )
    return half


def steps_shown(skill: Skill) -> int:
    """How many steps a demonstration had on average.

    Raises: InvalidInput, when the skill does not say so.
    """
    shown = skill.provenance
    if not shown.demonstrations or shown.datapoints < 2 * len(shown.demonstrations):
        raise InvalidInput("the skill does not say how long its demonstrations were; say --horizon")
    steps = round(shown.datapoints / len(shown.demonstrations))
    if steps**2 * skill.states > MOST_WORK:
        raise InvalidInput(
            f"the skill says that its demonstrations had {steps} steps on average, which would take long to "
            "plan; say how many with --horizon"
        )
    return steps


def gaps(layout: Layout, here: slice, x: Float[Array, "T D"], y: Float[Array, "*#T D"]) -> Float[Array, " T"]:
    """How far points are apart in the columns of one part: in its unit, orientations in degrees."""
    if turns(layout, here):
        return np.asarray(np.degrees(angle(x[:, here], y[..., here])))
    return np.asarray(np.linalg.norm(x[:, here] - y[..., here], axis=1))


def turns(layout: Layout, here: slice) -> bool:
    """Whether the columns are an orientation, on S^3 or as four numbers."""
    parts = zip(layout.parts, layout.slices, strict=True)
    kinds = (Quantity.QUATERNION, Quantity.ORIENTATION)
    return any(p.quantity in kinds and not p.derivative and columns == here for p, columns in parts)


def unit_of_gaps(layout: Layout, here: slice) -> str:
    return "deg" if turns(layout, here) else layout.units[here.start]
