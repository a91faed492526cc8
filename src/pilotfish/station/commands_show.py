"""pilotfish show: what a skill file holds."""

from functools import partial
from pathlib import Path
from typing import Any

import click

from pilotfish import models
from pilotfish.errors import InvalidInput
from pilotfish.files import make_folder
from pilotfish.models import Skill, online
from pilotfish.station.answers import Answer, answering, example, plain_table, require_new, write_each
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
from pilotfish.station.stream_descriptions import described, model_facts
from pilotfish.store import content_hash, open_kept


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
    """Show what the file SKILL holds: states, durations, frames, columns, where it comes from.

    SKILL may also be a stream file: what it reads out as is shown.
    """
    if pictures:
        require_matplotlib()
    kept = open_kept(skill)
    opened = kept if isinstance(kept, Skill) else online.read_out(kept)
    facts, text = _told(kept, opened)
    facts = {"file": str(skill), **facts}
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


def _told(kept: Skill | online.OnlineModel, skill: Skill) -> tuple[dict[str, Any], str]:
    """What is to be told of what was kept, and of the skill that it is or reads out as."""
    if isinstance(kept, Skill):
        name = content_hash(skill)
        facts = {"content": name, **skill_facts(skill)}
        return facts, f"{states_table(skill)}\n\n{plain_table(_rows(skill, name))}"
    rows = [
        ("time", time_text(skill)),
        (
            "file",
            "a growing model: `pilotfish stream --resume` goes on with it, --skill writes the skill",
        ),
    ]
    return skill_facts(skill) | {"stream": model_facts(kept, skill)}, described(kept, skill, rows)


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
    streamed = not provenance.data  # nothing is known then of recordings, and no likelihood was raised
    fitted = f"{provenance.log_likelihood:.6g}, {provenance.iterations} iterations, {ended}"
    regularised = f"{provenance.structure}, regularisation {provenance.regularisation:g}"
    rows = [
        ("columns", f"{columns_text(skill.layout)}, every {skill.period:g} s"),
        ("demonstrations", ", ".join(provenance.demonstrations)),
        ("datapoints", f"{provenance.datapoints}" + (f", sha256 {provenance.data}" if not streamed else "")),
        ("time", time_text(skill)),
        ("covariances", provenance.structure if streamed else regularised),
        ("log-likelihood", "" if streamed else fitted),
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
    make_folder(folder)
    files = {folder / f"{name}.png": figure for name, figure in figures.items()}
    require_new(*files, force=force, inputs=[file])
    write_each(*(partial(save_picture, figure, path, overwrite=force) for path, figure in files.items()))
    return [str(path) for path in files], left_out
