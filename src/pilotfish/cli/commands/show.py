"""pilotfish show: describe a skill file or a stream file."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pilotfish import models
from pilotfish.cli.options.demonstrations import training_demonstrations
from pilotfish.cli.output.figures import plot_skill, require_matplotlib, save_figure
from pilotfish.cli.output.results import (
    CommandResult,
    example_epilog,
    print_result,
    require_writable_file,
    write_all,
)
from pilotfish.cli.output.skill_descriptions import (
    format_columns,
    format_dynamics,
    format_regularisation,
    format_scales,
    relevance_blocks,
    relevance_to_json,
    skill_to_json,
    state_blocks,
)
from pilotfish.cli.output.tables import Table, key_value_table
from pilotfish.cli.stream.model_descriptions import online_model_rows, online_model_to_json
from pilotfish.errors import InvalidInput
from pilotfish.io import content_hash, load_any, make_folder
from pilotfish.models import Skill, online

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@click.command(epilog=example_epilog("pilotfish show valve.skill --plots valve-plots"))
@click.argument("skill", type=click.Path(path_type=Path))
@click.option("--plots", type=click.Path(path_type=Path), help="Folder to write plots of the skill to.")
@click.option(
    "--relevance",
    metavar="FOLDER",
    help="Demonstrations that the skill was learned from, to compute the relevance of each frame.",
)
@click.option("--force", is_flag=True, help="Replace existing plots.")
@print_result
def show(skill: Path, plots: Path | None, relevance: str | None, force: bool) -> CommandResult:
    """Describe the file SKILL: its states, durations, frames, columns and provenance.

    SKILL may also be a stream file; its model is converted to a skill.
    """
    if plots:
        require_matplotlib()
    loaded = load_any(skill)
    blocks, data = _describe(loaded)
    data = {"file": str(skill), **data}
    model = loaded if isinstance(loaded, Skill) else online.to_skill(loaded)
    frame_relevance = _compute_relevance(model, relevance) if relevance else None
    if frame_relevance:
        data |= relevance_to_json(frame_relevance)
        blocks += relevance_blocks(frame_relevance)
    if not plots:
        return CommandResult(blocks, data)
    figures, failures = plot_skill(model, frame_relevance)
    files = _save_figures(figures, plots, skill, force)
    data |= {"plots": files, "not_plotted": failures}
    blocks.append("\n".join([*files, *(f"not plotted: {n}: {reason}" for n, reason in failures.items())]))
    return CommandResult(blocks, data, exit_code=int(not files))


def _describe(loaded: Skill | online.OnlineModel) -> tuple[list[str | Table], dict[str, Any]]:
    if isinstance(loaded, Skill):
        digest = content_hash(loaded)
        blocks = [*state_blocks(loaded), key_value_table(_skill_rows(loaded, digest))]
        return blocks, {"content_hash": digest, **skill_to_json(loaded)}
    skill = online.to_skill(loaded)
    rows = [
        *online_model_rows(loaded),
        ("dynamics", format_dynamics(skill)),
        ("file", "online model: `pilotfish stream --resume` continues it, --skill writes the skill"),
    ]
    data = skill_to_json(skill) | {"stream": online_model_to_json(loaded, skill)}
    return [*state_blocks(skill), key_value_table(rows)], data


def _compute_relevance(skill: Skill, folder: str) -> models.FrameRelevance:
    if len(skill.frame_names) < 2:
        raise InvalidInput(
            f"the skill has one frame, {skill.frame_names[0]!r}, expected at least two; omit --relevance"
        )
    return models.relevance(skill, training_demonstrations(skill, folder))


def _skill_rows(skill: Skill, digest: str) -> list[tuple[str, str]]:
    provenance = skill.provenance
    status = "converged" if provenance.converged else "not converged"
    is_streamed = not provenance.data  # without demonstrations, EM and log-likelihood
    fitted = f"{provenance.log_likelihood:.6g}, {provenance.iterations} iterations, {status}"
    data_hash = "" if is_streamed else f", sha256 {provenance.data}"
    rows = [
        ("columns", f"{format_columns(skill.layout)}, every {skill.period:g} s"),
        ("demonstrations", ", ".join(provenance.demonstrations)),
        ("datapoints", f"{provenance.datapoints}{data_hash}"),
        ("dynamics", format_dynamics(skill)),
        ("covariances", provenance.structure),
        ("scales", format_scales(skill)),
        ("regularisation", format_regularisation(skill)),
        ("log-likelihood", "" if is_streamed else fitted),
        ("library", provenance.library),
        ("note", provenance.note),
        ("content hash", digest),
    ]
    return [row for row in rows if row[1]]


def _save_figures(figures: "dict[str, Figure]", folder: Path, skill: Path, force: bool) -> list[str]:
    """Write figures to a folder, which is created unless there are none, and return their paths."""
    if not figures:
        return []
    make_folder(folder)
    files = {folder / f"{name}.png": figure for name, figure in figures.items()}
    require_writable_file(*files, force=force, inputs=[skill])
    write_all(*(partial(save_figure, figure, path, overwrite=force) for path, figure in files.items()))
    return [str(path) for path in files]
