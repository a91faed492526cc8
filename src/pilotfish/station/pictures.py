"""Pictures in files; matplotlib is an extra, asked for only here."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import click

from pilotfish.errors import InvalidInput, SkillError
from pilotfish.files import whole_file
from pilotfish.gaussians import SemiTiedCovariances
from pilotfish.models import FrameRelevance, SemiMarkovChain, Skill

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DOTS_PER_INCH = 150
KINDS = (".png", ".svg", ".pdf")
Drawn = tuple[dict[str, "Figure"], dict[str, str]]  # by name; and of those left out, the reason
PATIENCE = 1.5  # how much longer than all mean durations together the forward variable is drawn


def require_matplotlib() -> None:
    """Raises: SkillError, when pictures cannot be drawn here. To be asked before the work, not after it."""
    try:
        import matplotlib  # noqa: F401
    except ImportError as error:
        raise SkillError(f"pictures need {error.name}: pip install 'pilotfish[plots]'") from error


def a_picture(_: click.Context, parameter: click.Parameter, path: Path | None) -> Path | None:
    """A path that ends in a kind of picture.    Raises: click.BadParameter."""
    if path and path.suffix.lower() not in KINDS:
        expected = ", ".join(KINDS)
        raise click.BadParameter(
            f"{path} ends in {path.suffix!r}, expected one of {expected}", param=parameter
        )
    return path


def save_picture(figure: "Figure", path: Path, *, overwrite: bool) -> None:
    """Write the picture to a file whose ending says its kind.

    Raises: InvalidInput, when the disk refuses, or the file exists and overwrite is False.
    """
    with whole_file(path, overwrite=overwrite) as part:
        figure.savefig(part, dpi=DOTS_PER_INCH)


def skill_pictures(skill: Skill, relevant: FrameRelevance | None = None) -> Drawn:
    """The pictures that suit the skill, by name; and those that could not be drawn, with the reason."""
    from pilotfish import plots  # needs matplotlib

    drawings: dict[str, Callable[[], Figure]] = {"deviations": lambda: plots.deviations(skill)}
    if isinstance(chain := skill.dynamics, SemiMarkovChain):
        horizon = int(PATIENCE * chain.durations.means.sum()) + 1
        drawings["states"] = lambda: plots.state_graph(skill)
        drawings["occupancy"] = lambda: plots.forward_variable(skill, horizon=horizon)
    if relevant:
        drawings["relevance"] = lambda: plots.frame_relevance(relevant)
    if all(isinstance(c, SemiTiedCovariances) for c in skill.covariances):
        drawings["basis"] = lambda: plots.basis_vectors(skill)
    drawn: dict[str, Figure] = {}
    left_out: dict[str, str] = {}
    for name, draw in drawings.items():
        try:
            drawn[name] = draw()
        except InvalidInput as error:  # too many states for its colours, say
            left_out[name] = str(error)
    return drawn, left_out
