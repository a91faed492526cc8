"""A flat map of a skill with orientations on S^3, in which plans are made and followed as on R^n."""

from dataclasses import dataclass, replace

import numpy as np

from pilotfish.demonstrations import Layout, Quantity
from pilotfish.errors import InvalidInput, require_kind
from pilotfish.geometry import (
    conjugate,
    exp,
    inverse_right_jacobian,
    inverse_right_jacobian_change,
    karcher_mean,
    log,
    multiply,
    normalise,
    right_jacobian,
    tangent_slices,
)
from pilotfish.models import AdaptedSkill
from pilotfish.types import Array, Float
from pilotfish.validation import numeric_array


@dataclass(frozen=True, slots=True, eq=False)
class Chart:
    """Orientations as rotation vectors [rad] from a base, angular velocities as the rates of these [rad/s].

    skill is the adapted skill in these columns, an ordinary one: plan and track it as any other. Other
    columns are what they were. curved is the skill on S^3, bases a unit quaternion for each orientation.
    """

    skill: AdaptedSkill
    curved: AdaptedSkill
    bases: Float[Array, "R 4"]

    def inward(self, x: Float[Array, "*B D"]) -> Float[Array, "*B E"]:
        """Points of the curved skill as the flat one has them; of q and -q, that nearer to a state's mean."""
        rows = x.reshape(-1, x.shape[-1])
        flat = _flat_columns(rows, self.curved.layout)
        for turn, base in zip(_turns(self.curved.layout), self.bases, strict=True):
            means = multiply(base, exp(0.5 * self.skill.means[:, turn.vector]))
            v = _vectors(base, _signed(rows[:, turn.quaternion], means))
            flat[:, turn.vector] = v
            if turn.speed and turn.rate:
                flat[:, turn.rate] = _times(inverse_right_jacobian(v), rows[:, turn.speed])
        return flat.reshape(*x.shape[:-1], flat.shape[1])

    def outward(self, y: Float[Array, "*B E"]) -> Float[Array, "*B D"]:
        """Points of the flat skill, say of a tracked motion, as poses of the world."""
        rows = y.reshape(-1, y.shape[-1])
        x = np.zeros((len(rows), self.curved.layout.width))
        for here, there, turn in tangent_slices(x.shape[1], self.curved.layout.turns):
            if not turn:
                x[:, here] = rows[:, there]
        for part, base in zip(_turns(self.curved.layout), self.bases, strict=True):
            v = rows[:, part.vector]
            x[:, part.quaternion] = multiply(base, exp(0.5 * v))
            if part.speed and part.rate:
                x[:, part.speed] = _times(right_jacobian(v), rows[:, part.rate])
        return x.reshape(*y.shape[:-1], x.shape[1])


@dataclass(frozen=True, slots=True)
class _Turn:
    """Where an orientation and its angular velocity are, in points and in their flat image."""

    quaternion: slice
    vector: slice
    speed: slice | None
    rate: slice | None


def chart(model: AdaptedSkill, *, at: Float[Array, " D"] | None = None) -> Chart:
    """The adapted skill on a flat map: means by the logarithm, covariances by the map's exact differential.

    The base is the pose given, or the Karcher mean of the states' means: the farther from it, the more the
    map distorts, so that a steady push there is a slightly uneven one of the body. States farther than half
    a turn from the base lie beyond it on the map, next to those that they are nearest to; a skill that goes
    once round or more is not continuous on any map.
    Raises: InvalidInput, when the skill has no orientation on S^3, or at is no pose of its layout.
    Source: Zeestraten et al. 2017, IEEE RA-L 2(3), section V, for tracking in a tangent space; the
    differential, and with it the coupling of turns and their speeds, is exact where they transport.
    """
    require_kind("model", model, AdaptedSkill, "pf.adapt(skill, frames) makes one of a skill")
    turns = _turns(model.layout)
    if not turns:
        raise InvalidInput("the skill has no orientation on S^3, it is flat already: plan it as it is")
    q = np.stack([model.means[:, turn.quaternion] for turn in turns])
    bases = _bases(q, turns, at, model.layout)
    means = _flat_columns(model.means, model.layout)
    M = np.zeros((*means.shape, means.shape[1])) + np.eye(means.shape[1])
    for turn, base, orientations in zip(turns, bases, q, strict=True):
        v = _vectors(base, _linked(orientations, base))
        J = inverse_right_jacobian(v)
        means[:, turn.vector], M[:, turn.vector, turn.vector] = v, J
        if turn.speed and turn.rate:
            speeds = model.means[:, turn.speed]
            means[:, turn.rate], M[:, turn.rate, turn.rate] = _times(J, speeds), J
            M[:, turn.rate, turn.vector] = inverse_right_jacobian_change(v, speeds) @ J
    carried = M @ model.covariances @ M.transpose(0, 2, 1)
    covariances = 0.5 * (carried + carried.transpose(0, 2, 1))
    flat = replace(model, means=means, covariances=covariances, layout=model.layout.tangent)
    return Chart(flat, model, bases)


def _turns(layout: Layout) -> tuple[_Turn, ...]:
    parts = list(zip(layout.parts, layout.slices, layout.tangent.slices, strict=True))
    found = []
    for part, here, there in parts:
        if part.quantity is Quantity.ORIENTATION:
            rates = [entry for entry in parts if entry[0].name == part.name and entry[0].derivative]
            if any(rate.derivative > 1 or rate.size != there.stop - there.start for rate, _, _ in rates):
                raise InvalidInput(
                    f"part {part.name!r} has derivatives other than an angular velocity of three columns; "
                    "expected those of pf.on_sphere or pf.with_derivatives"
                )
            speed, rate = (rates[0][1], rates[0][2]) if rates else (None, None)
            found.append(_Turn(here, there, speed, rate))
    return tuple(found)


def _bases(
    q: Float[Array, "R K 4"], turns: tuple[_Turn, ...], at: Float[Array, " D"] | None, layout: Layout
) -> Float[Array, "R 4"]:
    if at is None:
        return np.stack([karcher_mean(means, np.ones(len(means)), (0,)) for means in q])
    require_kind("at", at, np.ndarray, "give np.array(pose)")
    at = numeric_array(at, "at")
    if at.shape != (layout.width,) or not np.isfinite(at).all():
        raise InvalidInput(
            f"at is {at.tolist()}, expected {layout.width} finite numbers: {', '.join(layout.names)}"
        )
    return normalise(np.stack([at[turn.quaternion] for turn in turns]))


def _flat_columns(x: Float[Array, "N D"], layout: Layout) -> Float[Array, "N E"]:
    """What is no orientation, in its place; zeros where rotation vectors go."""
    flat = np.zeros((len(x), layout.tangent.width))
    for here, there, turn in tangent_slices(layout.width, layout.turns):
        if not turn:
            flat[:, there] = x[:, here]
    return flat


def _vectors(base: Float[Array, " 4"], q: Float[Array, "N 4"]) -> Float[Array, "N 3"]:
    """Rotation vectors from the base to q, up to 2 pi long: signs of q count."""
    return 2.0 * log(multiply(conjugate(base), q))


def _times(matrices: Float[Array, "N 3 3"], vectors: Float[Array, "N 3"]) -> Float[Array, "N 3"]:
    return np.asarray(np.einsum("nij,nj->ni", matrices, vectors))


def _signed(q: Float[Array, "N 4"], means: Float[Array, "K 4"]) -> Float[Array, "N 4"]:
    """Each q with the sign of the mean that it is nearest to, whatever the sign."""
    dots = q @ means.T
    nearest = np.take_along_axis(dots, np.abs(dots).argmax(axis=1)[:, None], axis=1)
    return np.asarray(np.where(nearest < 0.0, -q, q))


def _linked(q: Float[Array, "K 4"], base: Float[Array, " 4"]) -> Float[Array, "K 4"]:
    """The same orientations, each on the half of S^3 of the nearest one signed before; the base is first."""
    signed, left = base[None], q
    order = np.arange(len(q))
    placed = np.empty_like(q)
    while len(left):
        n = int(np.abs(left @ signed.T).max(axis=1).argmax())
        placed[order[n]] = _signed(left[n : n + 1], signed)[0]
        signed = np.vstack([signed, placed[order[n]]])
        left, order = np.delete(left, n, axis=0), np.delete(order, n)
    return placed
