"""pilotfish show: what a skill file holds."""

from pathlib import Path

import click

from pilotfish import models
from pilotfish.errors import InvalidInput
from pilotfish.models import Skill
from pilotfish.station.answers import Answer, answering, example, plain_table, require_new
from pilotfish.station.descriptions import (
    columns_text,
    relevance_facts,
    relevance_table,
    skill_facts,
    states_table,
    time_text,
)
from pilotfish.station.pictures import Drawn, require_matplotlib, save_picture, skill_pictures
from pilotfish.station.sources import as_learned
from pilotfish.store import content_hash, open_skill


@click.command(epilog=example("pilotfish show valve.skill --pictures valve-pictures"))
@click.argument("skill", type=click.Path(path_type=Path))
@click.option("--pictures", type=click.Path(path_type=Path), help="A folder to draw the skill in.")
@click.option(
    "--relevance",
    metavar="FOLDER",
    help="The recordings that it was learned from: tells how much each frame matters at each state.",
)
@click.option("--force", is_flag=True, help="Replace pictures that are there already.")
@answering
def show(skill: Path, pictures: Path | None, relevance: str | None, force: bool) -> Answer:
    """Show what the file SKILL holds: states, durations, frames, columns, where it comes from."""
    if pictures:
        require_matplotlib()
    opened = open_skill(skill)
    name = content_hash(opened)
    facts = {"file": str(skill), "content": name, **skill_facts(opened)}
    text = f"{states_table(opened)}\n\n{plain_table(_rows(opened, name))}"
    relevant = _relevance(opened, relevance) if relevance else None
    if relevant:
        facts |= relevance_facts(relevant)
        text += f"\n\n{relevance_table(relevant)}"
    if pictures:
        files, left_out = _draw(skill_pictures(opened, relevant), skill, pictures, force)
        facts |= {"pictures": files, "not_drawn": left_out}
        text += "\n\n" + "\n".join([*files, *(f"not drawn: {n}: {why}" for n, why in left_out.items())])
        return Answer(text, facts, code=int(not files))
    return Answer(text, facts)


def _relevance(skill: Skill, folder: str) -> models.FrameRelevance:
    if len(skill.frame_names) < 2:
        raise InvalidInput(
            f"the skill has one frame, {skill.frame_names[0]!r}, expected several to tell which of them "
            "matter; leave --relevance out"
        )
    return models.relevance(skill, as_learned(skill, folder))


def _rows(skill: Skill, name: str) -> list[tuple[str, str]]:
    provenance = skill.provenance
    ended = "converged" if provenance.converged else "not converged"
    rows = [
        ("columns", f"{columns_text(skill.layout)}, every {skill.period:g} s"),
        ("demonstrations", ", ".join(provenance.demonstrations)),
        ("datapoints", f"{provenance.datapoints}, sha256 {provenance.data}"),
        ("time", time_text(skill)),
        ("covariances", f"{provenance.structure}, regularisation {provenance.regularisation:g}"),
        ("log-likelihood", f"{provenance.log_likelihood:.6g}, {provenance.iterations} iterations, {ended}"),
        ("learned with", provenance.library),
        ("note", provenance.note),
        ("content", name),
    ]
    return [row for row in rows if row[1]]


def _draw(drawn: Drawn, file: Path, folder: Path, force: bool) -> tuple[list[str], dict[str, str]]:
    """The pictures written, and those that were left out with the reason; no folder when all were."""
    figures, left_out = drawn
    if not figures:
        return [], left_out
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InvalidInput(f"{folder} cannot be made: {error.strerror}; choose another folder") from error
    files = {folder / f"{name}.png": figure for name, figure in figures.items()}
    require_new(*files, force=force, inputs=[file])
    for path, figure in files.items():
        save_picture(figure, path)
    return [str(path) for path in files], left_out
