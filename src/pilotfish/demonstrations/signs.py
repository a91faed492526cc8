"""q and -q are one rotation: choosing the signs so that orientations can be averaged and differenced."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pilotfish.demonstrations.frame_views import refuse_disagreement
from pilotfish.demonstrations.layouts import Layout, Quantity
from pilotfish.demonstrations.numbers import finite_array
from pilotfish.demonstrations.recording import Demonstration
from pilotfish.errors import InvalidInput
from pilotfish.geometry import continuous
from pilotfish.types import Array, Float


def continuous_quaternions(x: object, layout: Layout) -> Float[Array, "T D"]:
    """The same recording with no sign flip of an orientation from one row to the next.

    Derivatives of an orientation change sign with it. For the door `demonstration`, which refuses flips.
    """
    points = np.array(finite_array(x, "x"))
    if points.ndim != 2 or points.shape[1] != layout.width:
        raise InvalidInput(
            f"x has shape {points.shape}, expected (T, {layout.width}): {', '.join(layout.names)}"
        )
    for columns in layout.quaternions:
        q = points[:, columns]
        signs = np.where(np.einsum("td,td->t", q, continuous(q)) < 0, -1.0, 1.0)
        for same in _with_derivatives(layout, columns):
            points[:, same] *= signs[:, None]
    return points


def consistent_quaternions(demonstrations: Sequence[Demonstration]) -> tuple[Demonstration, ...]:
    """The same demonstrations, each orientation with the sign in which it runs closest to the first's.

    Only whole demonstrations change sign, so each stays continuous. Frames are left as they are.
    """
    refuse_disagreement(demonstrations)
    first = demonstrations[0]
    return tuple(_with_signs_of(demo, first) for demo in demonstrations)


def opposed(q: Float[Array, "T 4"], reference: Float[Array, "S 4"]) -> bool:
    """Whether -q runs closer to the reference than q, both stretched to the same duration."""
    steps = np.linspace(0, len(reference) - 1, len(q)).round().astype(int)
    return bool(np.einsum("td,td->", q, reference[steps]) < 0)


def _with_signs_of(demo: Demonstration, first: Demonstration) -> Demonstration:
    x = demo.x.copy()
    for columns in demo.layout.quaternions:
        if opposed(demo.x[:, columns], first.x[:, columns]):
            for same in _with_derivatives(demo.layout, columns):
                x[:, same] *= -1
    x.setflags(write=False)
    return replace(demo, x=x)


def _with_derivatives(layout: Layout, columns: slice) -> list[slice]:
    """The columns of an orientation and of its derivatives."""
    parts = list(zip(layout.parts, layout.slices, strict=True))
    name = next(part.name for part, here in parts if here == columns)
    return [here for part, here in parts if part.name == name and part.quantity is Quantity.QUATERNION]
