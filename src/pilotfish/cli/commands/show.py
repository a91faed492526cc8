"""pilotfish show: what a skill file holds."""

from functools import partial
from pathlib import Path
from typing import Any

import click

from pilotfish import models
from pilotfish.cli.options.sources import training_demonstrations
from pilotfish.cli.output.answers import (
    CommandResult,
    example_epilog,
    format_key_values,
    print_result,
    require_writable_file,
    write_all,
)
from pilotfish.cli.output.descriptions import (
    format_columns,
    format_dynamics,
    format_relevance,
    format_states,
    relevance_to_json,
    skill_to_json,
)
from pilotfish.cli.output.pictures import SkillFigures, require_matplotlib, save_figure, skill_figures
from pilotfish.cli.stream.descriptions import described, online_model_facts
from pilotfish.errors import InvalidInput
from pilotfish.io import content_hash, load_any, make_folder
from pilotfish.models import Skill, online


@click.command(epilog=example_epilog("pilotfish show valve.skill --plots valve-pictures"))
@click.argument("skill", type=click.Path(path_type=Path))
@click.option("--plots", type=click.Path(path_type=Path), help="A folder to draw the skill in.")
@click.option(
    "--relevance",
    metavar="FOLDER",
    help="The recordings that it was learned from: tells how much each frame matters at each state.",
)
@click.option("--force", is_flag=True, help="Replace pictures that are there already.")
@print_result
def show(skill: Path, plots: Path | None, relevance: str | None, force: bool) -> CommandResult:
    """Show what the file SKILL holds: states, durations, frames, columns, where it comes from.

    SKILL may also be a stream file: what it reads out as is shown.
    """
    if plots:
        require_matplotlib()
    loaded = load_any(skill)
    skill_shown = loaded if isinstance(loaded, Skill) else online.to_skill(loaded)
    facts, text = _describe(loaded, skill_shown)
    facts = {"file": str(skill), **facts}
    frame_relevance = _compute_relevance(skill_shown, relevance) if relevance else None
    if frame_relevance:
        facts |= relevance_to_json(frame_relevance)
        text += f"\n\n{format_relevance(frame_relevance)}"
    if plots:
        files, failures = _save_figures(skill_figures(skill_shown, frame_relevance), skill, plots, force)
        facts |= {"plots": files, "not_plotted": failures}
        text += "\n\n" + "\n".join([*files, *(f"not plotted: {n}: {why}" for n, why in failures.items())])
        return CommandResult(text, facts, exit_code=int(not files))
    return CommandResult(text, facts)


def _describe(loaded: Skill | online.OnlineModel, skill: Skill) -> tuple[dict[str, Any], str]:
    """What is to be told of what was kept, and of the skill that it is or reads out as."""
    if isinstance(loaded, Skill):
        name = content_hash(skill)
        facts = {"content_hash": name, **skill_to_json(skill)}
        return facts, f"{format_states(skill)}\n\n{format_key_values(_skill_rows(skill, name))}"
    rows = [
        ("time", format_dynamics(skill)),
        (
            "file",
            "a growing model: `pilotfish stream --resume` goes on with it, --skill writes the skill",
        ),
    ]
    return skill_to_json(skill) | {"stream": online_model_facts(loaded, skill)}, described(
        loaded, skill, rows
    )


def _compute_relevance(skill: Skill, folder: str) -> models.FrameRelevance:
    if len(skill.frame_names) < 2:
        raise InvalidInput(
            f"the skill has one frame, {skill.frame_names[0]!r}, expected several to tell which of them "
            "matter; leave --relevance out"
        )
    return models.relevance(skill, training_demonstrations(skill, folder))


def _skill_rows(skill: Skill, name: str) -> list[tuple[str, str]]:
    provenance = skill.provenance
    status = "converged" if provenance.converged else "not converged"
    streamed = not provenance.data  # nothing is known then of recordings, and no likelihood was raised
    fitted = f"{provenance.log_likelihood:.6g}, {provenance.iterations} iterations, {status}"
    regularised = f"{provenance.structure}, regularisation {provenance.regularisation:g}"
    rows = [
        ("columns", f"{format_columns(skill.layout)}, every {skill.period:g} s"),
        ("demonstrations", ", ".join(provenance.demonstrations)),
        ("datapoints", f"{provenance.datapoints}" + (f", sha256 {provenance.data}" if not streamed else "")),
        ("time", format_dynamics(skill)),
        ("covariances", provenance.structure if streamed else regularised),
        ("log-likelihood", "" if streamed else fitted),
        ("learned with", provenance.library),
        ("note", provenance.note),
        ("content hash", name),
    ]
    return [row for row in rows if row[1]]


def _save_figures(
    drawn: SkillFigures, file: Path, folder: Path, force: bool
) -> tuple[list[str], dict[str, str]]:
    """The pictures written, and those that were left out with the reason; no folder when all were."""
    figures, failures = drawn
    if not figures:
        return [], failures
    make_folder(folder)
    files = {folder / f"{name}.png": figure for name, figure in figures.items()}
    require_writable_file(*files, force=force, inputs=[file])
    write_all(*(partial(save_figure, figure, path, overwrite=force) for path, figure in files.items()))
    return [str(path) for path in files], failures
