"""A skill where the objects stand now: the product of what every frame says (3.33-3.37, 4.26-4.27)."""

from collections.abc import Sequence

import numpy as np

from pilotfish.demonstrations import Frame, Layout, MovingFrame
from pilotfish.errors import InvalidInput, require_kind
from pilotfish.gaussians import Gaussian, product, transform
from pilotfish.models.signs import agreeing
from pilotfish.models.skill import AdaptedSkill, Skill
from pilotfish.types import Array, Float


def adapt(skill: Skill, frames: Sequence[Frame | MovingFrame]) -> AdaptedSkill:
    """The skill in the world, for objects whose frames stand as given, in any order.

    Each state's Gaussians are carried into the world by their frames and multiplied; a state is then precise
    where any frame was. Quaternion means are brought back to unit length; a frame may give q or -q.
    Raises: InvalidInput, when a frame is missing, unknown, moving, singular or of another width.
    Source: Tanwani 2018, equations 3.33-3.37, with the inner inverse that (3.34) leaves out.
    """
    require_kind("skill", skill, Skill, "a fit holds one: fit.skill")
    ordered = agreeing(_matched(skill, frames), skill)
    states = [
        product(
            [
                transform(Gaussian(skill.means[p, k], skill.covariances[p].dense[k]), f.A, f.b)
                for p, f in enumerate(ordered)
            ]
        )
        for k in range(skill.states)
    ]
    means = _unit_quaternions(np.stack([g.mean for g in states]), skill.layout)
    return AdaptedSkill(
        skill.dynamics, means, np.stack([g.covariance for g in states]), skill.layout, skill.period
    )


def _matched(skill: Skill, frames: Sequence[Frame | MovingFrame]) -> list[Frame]:
    """The frames in the skill's order, checked."""
    fix = "give a list of frames, say a demonstration's .frames"
    require_kind("frames", frames, Sequence, fix)
    for frame in frames:
        require_kind("a frame", frame, (Frame, MovingFrame), fix)
    if moving := [frame.name for frame in frames if isinstance(frame, MovingFrame)]:
        raise InvalidInput(f"frame {moving[0]!r} moves; adapt to where it stands at a step, frame.at(t)")
    standing = [frame for frame in frames if isinstance(frame, Frame)]
    named = {frame.name: frame for frame in standing}
    if sorted(named) != sorted(skill.frame_names) or len(frames) != len(skill.frame_names):
        raise InvalidInput(
            f"frames {[f.name for f in frames]} were given, the skill knows {list(skill.frame_names)}; "
            "give each of these once"
        )
    for frame in standing:
        if frame.b.shape != (skill.width,):
            raise InvalidInput(
                f"frame {frame.name!r} has {len(frame.b)} columns, the skill has {skill.width}"
            )
        if not (np.isfinite(frame.A).all() and np.isfinite(frame.b).all()):
            raise InvalidInput(f"frame {frame.name!r} holds values that are not finite")
        if (condition := float(np.linalg.cond(frame.A))) > 1e12:
            raise InvalidInput(
                f"frame {frame.name!r} is singular: the condition number of A is {condition:.3g}"
            )
    return [named[name] for name in skill.frame_names]


def _unit_quaternions(means: Float[Array, "K D"], layout: Layout) -> Float[Array, "K D"]:
    means = means.copy()
    for columns in layout.quaternions:
        norms = np.linalg.norm(means[:, columns], axis=1, keepdims=True)
        if (norms < 0.1).any():
            k = int(norms.argmin())
            raise InvalidInput(
                f"the frames disagree about the orientation of state {k}: the fused quaternion has norm "
                f"{norms.min():.3g}; make the quaternions of demonstrations and frames consistent in sign"
            )
        means[:, columns] /= norms
    return means
