"""Shared control as printed: regression from the operator's pose to the pose in each object's frame.

A demonstration is augmented with a copy of its pose that no frame moves, (6.1):

    xi = [xi_I; xi_O],    A_j = blkdiag(I, R_j, E_j),    b_j = [0; p_j; 0].

A skill learned from it has joint Gaussians of input and output in every frame. Given the input, Gaussian
mixture regression in each frame (6.5, 6.6, 6.8, 6.9) gives N(mu_j, Sigma_j), and their product the desired
pose (6.3), which an infinite-horizon LQR with the weight Sigma^-1 tracks.

Two things differ from the text, which would not work otherwise. The weights h_i (6.7) are the filtered
probabilities given all inputs so far, in place of those of one step with the initial probabilities. And the
input part, equal in all frames, is counted once: its marginal is that of the first frame. The product (6.3)
has its inner inverse.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pilotfish.assistance.coordinates import SPATIAL_AXES
from pilotfish.demonstrations import Demonstration, Frame, Layout, MovingFrame, demonstration, to_sphere
from pilotfish.errors import InvalidInput
from pilotfish.gaussians import (
    ConditionalGaussians,
    RiemannianGaussian,
    conditional_gaussians,
    regress_with_responsibilities,
)
from pilotfish.models import Skill
from pilotfish.types import Array, Float
from pilotfish.validation import require_type, shorten_repr

INPUT = "operator "  # prefix of the names of the input parts


def joint_demonstration(demo: Demonstration) -> Demonstration:
    """Return a demonstration augmented by the pose that the operator commands, which no frame moves (6.1).

    Args:
        demo: Demonstration of a pose; derivatives and scalars are dropped, orientations are put on S^3.

    Raises:
        InvalidInput: If the columns are not a pose.
    """
    require_type(demo, "demo", Demonstration, "create one with pf.demonstration")
    sphere = to_sphere(demo) if demo.layout.quaternions else demo
    parts = _pose_parts(sphere.layout)
    D = parts.width
    names = tuple(replace(part, name=INPUT + part.name) for part in parts.parts)
    layout = Layout(names + parts.parts)
    x = np.hstack([sphere.x[:, :D], sphere.x[:, :D]])
    frames = [_joint_frame(frame, D) for frame in sphere.frames]
    return demonstration(x, demo.period, layout, frames, demo.name)


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class LiteralSituation:
    """A joint skill in the actual frames.

    Attributes:
        conditionals: In each frame, the outputs given the inputs, in the world.
        width: Number of columns of the input.
    """

    conditionals: tuple[ConditionalGaussians, ...]
    width: int

    def log_likelihoods(self, x: Float[Array, " D"]) -> Float[Array, " K"]:
        """Return the log-density of a command under the one input marginal of each state.

        Args:
            x: Command; scalars after the pose do not count.
        """
        return np.asarray(self.conditionals[0].log_input_densities(x[None, : self.width])[0])

    def correct(
        self, x: Float[Array, " D"], probabilities: Float[Array, " K"]
    ) -> tuple[Float[Array, " D"], Float[Array, "E E"]]:
        """Return the product over frames of the regressions, with the scalars of the command.

        Args:
            x: Command; scalars after the pose pass unchanged.
            probabilities: Filtered probability of each state.
        """
        gaussians = []
        for conditional in self.conditionals:
            result = regress_with_responsibilities(conditional, x[None, : self.width], probabilities[None])
            starts = conditional.output_orientation_starts
            gaussians.append(RiemannianGaussian(result.means[0], result.covariances[0], starts))
        desired = RiemannianGaussian.product(gaussians)
        return np.concatenate([desired.mean, x[self.width :]]), desired.covariance


def literal_situation(skill: Skill, frames: Sequence[Frame]) -> LiteralSituation:
    """Place a joint skill in the actual frames.

    Args:
        skill: Skill learned from demonstrations of `joint_demonstration`.
        frames: Frames of the coordinates of the original skill.

    Raises:
        InvalidInput: If the skill is not a joint one, or a frame is missing.
        NotPositiveDefinite: If the inputs of a state have a singular covariance.
    """
    require_joint(skill)
    width = skill.width // 2
    by_name = {frame.name: frame for frame in frames}
    if missing := [name for name in skill.frame_names if name not in by_name]:
        raise InvalidInput(f"frame {missing[0]!r} is missing, expected {list(skill.frame_names)}")
    starts, conditionals = skill.layout.orientation_starts, []
    for p, name in enumerate(skill.frame_names):
        frame = _joint_frame(by_name[name], width)
        assert isinstance(frame, Frame)
        M = frame.tangent_map(skill.layout)
        means = skill.means[p] @ frame.A.T + frame.b
        covariances = M @ skill.covariances[p].dense @ M.T
        conditionals.append(conditional_gaussians(means, covariances, np.arange(width), starts))
    return LiteralSituation(tuple(conditionals), width)


def require_joint(skill: Skill) -> None:
    """Raise InvalidInput unless a skill has the columns of a joint demonstration.

    Args:
        skill: Learned skill.
    """
    require_type(skill, "joint_skill", Skill, "learn it from joint_demonstration of each demonstration")
    parts = skill.layout.parts
    half = len(parts) // 2
    expected = [INPUT + part.name for part in parts[half:]]
    if len(parts) % 2 or [part.name for part in parts[:half]] != expected:
        raise InvalidInput(
            f"the joint skill has the columns {', '.join(skill.layout.names)}, expected those of the "
            "operator and the same again; learn it from joint_demonstration of each demonstration"
        )


def _pose_parts(layout: Layout) -> Layout:
    kept, width = [], SPATIAL_AXES + 4 * len(layout.orientation_starts)
    for part, columns in zip(layout.parts, layout.slices, strict=True):
        if columns.stop <= width:
            kept.append(part)
    return Layout(tuple(kept))


def _joint_frame(frame: Frame | MovingFrame, D: int) -> Frame | MovingFrame:
    """Return the frame that moves the output part only."""
    A = np.zeros((*frame.A.shape[:-2], 2 * D, 2 * D)) + np.eye(2 * D)
    A[..., D:, D:] = frame.A[..., :D, :D]
    b = np.concatenate([np.zeros((*frame.b.shape[:-1], D)), frame.b[..., :D]], axis=-1)
    return replace(frame, A=A, b=b)
