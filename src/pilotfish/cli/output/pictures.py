"""Pictures in files; matplotlib is an extra, asked for only here."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import click

from pilotfish.errors import InvalidInput, SkillError
from pilotfish.gaussians.structures import SemiTiedCovariances
from pilotfish.io import atomic_file
from pilotfish.models import FrameRelevance, Skill

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DOTS_PER_INCH = 150
FIGURE_SUFFIXES = (".png", ".svg", ".pdf")
SkillFigures = tuple[dict[str, "Figure"], dict[str, str]]  # by name; and of those left out, the reason
HORIZON_FACTOR = 1.5  # how much longer than all mean durations together the forward variable is drawn


def require_matplotlib() -> None:
    """Raises: SkillError, when pictures cannot be drawn here. To be asked before the work, not after it."""
    try:
        import matplotlib  # noqa: F401
    except ImportError as error:
        raise SkillError(f"pictures need {error.name}: pip install 'pilotfish[plots]'") from error


def validate_figure_path(_: click.Context, parameter: click.Parameter, path: Path | None) -> Path | None:
    """A path that ends in a kind of picture.    Raises: click.BadParameter."""
    if path and path.suffix.lower() not in FIGURE_SUFFIXES:
        expected = ", ".join(FIGURE_SUFFIXES)
        raise click.BadParameter(
            f"{path} ends in {path.suffix!r}, expected one of {expected}", param=parameter
        )
    return path


def save_figure(figure: "Figure", path: Path, *, overwrite: bool) -> None:
    """Write the picture to a file whose ending says its kind.

    Raises: InvalidInput, when the disk refuses, or the file exists and overwrite is False.
    """
    with atomic_file(path, overwrite=overwrite) as part:
        figure.savefig(part, dpi=DOTS_PER_INCH)


def skill_figures(skill: Skill, frame_relevance: FrameRelevance | None = None) -> SkillFigures:
    """The pictures that suit the skill, by name; and those that could not be drawn, with the reason."""
    from pilotfish import plots  # needs matplotlib

    plot_functions: dict[str, Callable[[], Figure]] = {"deviations": lambda: plots.state_deviations(skill)}
    if (durations := skill.dynamics.durations) is not None:
        horizon = int(HORIZON_FACTOR * durations.means.sum()) + 1
        plot_functions["states"] = lambda: plots.state_graph(skill)
        plot_functions["occupancy"] = lambda: plots.forward_variable(skill, horizon=horizon)
    if frame_relevance:
        plot_functions["relevance"] = lambda: plots.frame_relevance(frame_relevance)
    if all(isinstance(c, SemiTiedCovariances) for c in skill.covariances):
        plot_functions["basis"] = lambda: plots.basis_vectors(skill)
    drawn: dict[str, Figure] = {}
    failures: dict[str, str] = {}
    for name, draw in plot_functions.items():
        try:
            drawn[name] = draw()
        except InvalidInput as error:  # too many states for its colours, say
            failures[name] = str(error)
    return drawn, failures
