"""Figures in files; matplotlib is an extra and is imported only when a figure is drawn."""

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
HORIZON_FACTOR = 1.5  # horizon of the forward variable, in sums of all mean durations


def require_matplotlib() -> None:
    """Raise SkillError, with the command that installs it, if matplotlib cannot be imported."""
    try:
        import matplotlib  # noqa: F401
    except ImportError as error:
        raise SkillError(f"plots need {error.name}: pip install '.[plots]' in the clone") from error


def validate_figure_path(_: click.Context, parameter: click.Parameter, path: Path | None) -> Path | None:
    """Return a path with the suffix of a figure, or raise click.BadParameter."""
    if path and path.suffix.lower() not in FIGURE_SUFFIXES:
        expected = ", ".join(FIGURE_SUFFIXES)
        raise click.BadParameter(
            f"{path} ends in {path.suffix!r}, expected one of {expected}", param=parameter
        )
    return path


def save_figure(figure: "Figure", path: Path, *, overwrite: bool) -> None:
    """Write a figure to a file in the format of its suffix.

    Args:
        figure: Figure to write.
        path: File to write.
        overwrite: Whether an existing file is replaced.

    Raises:
        InvalidInput: If the file cannot be written, or exists and overwrite is False.
    """
    with atomic_file(path, overwrite=overwrite) as part:
        figure.savefig(part, dpi=DOTS_PER_INCH)


def plot_skill(
    skill: Skill, frame_relevance: FrameRelevance | None = None
) -> tuple[dict[str, "Figure"], dict[str, str]]:
    """Draw every figure that suits a skill.

    Args:
        skill: Skill to draw.
        frame_relevance: Relevance of its frames; None leaves out its figure.

    Returns:
        The figures by name, and for each figure that could not be drawn its name and the reason.
    """
    from pilotfish import plots

    plot_functions: dict[str, Callable[[], Figure]] = {"deviations": lambda: plots.state_deviations(skill)}
    if (durations := skill.dynamics.durations) is not None:
        horizon = int(HORIZON_FACTOR * durations.means.sum()) + 1
        plot_functions["states"] = lambda: plots.state_graph(skill)
        plot_functions["forward-variable"] = lambda: plots.forward_variable(skill, horizon=horizon)
    if frame_relevance:
        plot_functions["relevance"] = lambda: plots.frame_relevance(frame_relevance)
    if all(isinstance(c, SemiTiedCovariances) for c in skill.covariances):
        plot_functions["basis"] = lambda: plots.basis_vectors(skill)
    figures: dict[str, Figure] = {}
    failures: dict[str, str] = {}
    for name, plot in plot_functions.items():
        try:
            figures[name] = plot()
        except InvalidInput as error:  # such as more states than colours
            failures[name] = str(error)
    return figures, failures
