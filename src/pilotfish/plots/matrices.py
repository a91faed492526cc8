"""Heat maps of the basis of semi-tied covariances, and of the correlation between covariances."""

from collections.abc import Sequence
from math import ceil

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.ticker import MaxNLocator

from pilotfish.demonstrations import Layout
from pilotfish.errors import InvalidInput
from pilotfish.gaussians.structures import SemiTiedCovariances, component_correlation
from pilotfish.models import Skill
from pilotfish.plots.style import SMALL_FONT, new_figure
from pilotfish.plots.validation import require_sequence, require_type
from pilotfish.types import Array, Float

MAX_LABELS = 40  # of more columns only some are labelled
MAX_COMPONENTS = 200


def basis_vectors(skill: Skill) -> Figure:
    """Plot the shared basis H of semi-tied covariances in each frame, one column per basis vector.

    H has no scale of its own: each vector is scaled so that its largest entry is 1.

    Args:
        skill: Skill with semi-tied covariances.

    Returns:
        The figure.

    Raises:
        InvalidInput: If the skill is not semi-tied.

    Source:
        Tanwani 2018, equation 4.17 and figure 4.2.
    """
    require_type("skill", skill, Skill)
    bases = [_basis(covariances, skill.provenance.structure) for covariances in skill.covariances]
    size = 1.6 + 0.24 * min(skill.width, MAX_LABELS)
    figure = new_figure(len(bases) * size + 2.0, size + 0.7)
    panels = figure.subplots(1, len(bases), squeeze=False)[0]
    for panel, H, name in zip(panels, bases, skill.frame_names, strict=True):
        image = _draw_matrix(panel, _normalise_columns(H), f"frame {name!r}")
        panel.set(xlabel="basis vector (first is 0)")
        _label_columns(panel, skill.layout.tangent, first=panel is panels[0])
    figure.colorbar(image, ax=list(panels), label="relative to the largest entry [1]", shrink=0.9)
    return figure


def _basis(covariances: object, structure: str) -> Float[Array, "D D"]:
    if not isinstance(covariances, SemiTiedCovariances):
        raise InvalidInput(
            f"the skill's covariances are {structure}, expected semi-tied: learn with SemiTied()"
        )
    return covariances.basis


def _normalise_columns(H: Float[Array, "D D"]) -> Float[Array, "D D"]:
    largest = np.take_along_axis(H, np.abs(H).argmax(axis=0)[None], axis=0)  # (1, D)
    return np.asarray(H / largest)


def _label_columns(panel: Axes, layout: Layout, *, first: bool) -> None:
    labelled = range(0, layout.width, ceil(layout.width / MAX_LABELS))
    names = [f"{layout.names[i]} [{layout.units[i]}]" if first else "" for i in labelled]
    panel.set_yticks(list(labelled), names, fontsize=SMALL_FONT)


def covariance_correlations(skills: Sequence[Skill]) -> Figure:
    """Plot the correlation between the covariances of states: a row per frame, a column per skill.

    Tying makes components more alike.

    Args:
        skills: Skills with the same frames.

    Returns:
        The figure.

    Raises:
        InvalidInput: If skills is empty, skills differ in frames, or there are too many states.

    Source:
        Tanwani 2018, equation 4.25.
    """
    _require_comparable(skills)
    names = skills[0].frame_names
    figure = new_figure(2.7 * len(skills) + 1.6, 3.1 * len(names) + 0.3)
    panels = figure.subplots(len(names), len(skills), squeeze=False)
    for p, name in enumerate(names):
        for panel, skill in zip(panels[p], skills, strict=True):
            matrix = component_correlation(skill.covariances[p].dense)
            image = _draw_matrix(panel, matrix, f"{skill.provenance.structure}\nframe {name!r}")
            panel.set(xlabel="state", ylabel="state")
    figure.colorbar(image, ax=panels.ravel().tolist(), label="correlation coefficient [1]", shrink=0.9)
    return figure


def _require_comparable(skills: Sequence[Skill]) -> None:
    require_sequence("skills", skills, Skill)
    if not skills:
        raise InvalidInput("skills is empty, expected at least one")
    if differing := {skill.frame_names for skill in skills} - {skills[0].frame_names}:
        raise InvalidInput(f"skills differ in frames: {skills[0].frame_names} and {differing.pop()}")
    if (most := max(skill.states for skill in skills)) > MAX_COMPONENTS:
        raise InvalidInput(f"there are {most} states, expected at most {MAX_COMPONENTS}")


def _draw_matrix(panel: Axes, matrix: Float[Array, "R C"], title: str) -> AxesImage:
    image = panel.imshow(matrix, cmap="RdBu_r", vmin=-1.0, vmax=1.0, aspect="equal", interpolation="nearest")
    panel.set_title(title, loc="left", fontsize="medium", fontweight="bold")
    panel.xaxis.set_major_locator(MaxNLocator(integer=True))
    panel.yaxis.set_major_locator(MaxNLocator(integer=True))
    return image
