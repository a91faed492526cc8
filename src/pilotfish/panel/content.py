"""Content of the page: demonstrations, a skill, and the situations that it can begin with."""

from collections.abc import Sequence
from dataclasses import dataclass

from pilotfish.demonstrations import Demonstration, Frame, Layout, world_frame
from pilotfish.errors import InvalidInput
from pilotfish.models import Skill
from pilotfish.panel.spatial_columns import position_part
from pilotfish.validation import require_type, short_list, shorten_repr

WORLD = "world"  # name of the frame of the world
MAX_DEMONSTRATIONS = 100  # drawn at once


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class Situation:
    """Frames of all objects at one time.

    Attributes:
        name: Where it comes from, such as the name of a demonstration.
        frames: One fixed frame per object.
    """

    name: str
    frames: tuple[Frame, ...]


@shorten_repr
@dataclass(frozen=True, slots=True, eq=False)
class ViewContent:
    """What the page displays; `view_content` checks it.

    Attributes:
        demonstrations: Demonstrations, in the columns of the skill if there is one.
        skill: Skill; None to display demonstrations only.
        layout: Columns of both.
        situations: Situations to begin with, at least one.
    """

    demonstrations: tuple[Demonstration, ...]
    skill: Skill | None
    layout: Layout
    situations: tuple[Situation, ...]


def view_content(
    demonstrations: Sequence[Demonstration] = (),
    skill: Skill | None = None,
    frames: Sequence[Frame] | None = None,
) -> ViewContent:
    """Check demonstrations and a skill, and find the situations that the page can begin with.

    Args:
        demonstrations: At most 100 demonstrations, in the columns and with the frames of the skill.
        skill: Skill to reproduce; None displays the demonstrations only.
        frames: Frames of a further situation, which comes first.

    Returns:
        The content. Without demonstrations and frames, the objects are in the middle of where they were in
        the demonstrations of the skill.

    Raises:
        InvalidInput: If columns or frames differ, a position to draw is missing, or the skill does not state
            where its objects were.
    """
    require_type(demonstrations, "demonstrations", Sequence, "pass a list of demonstrations")
    for demo in demonstrations:
        require_type(demo, "a demonstration", Demonstration, "io.read_demonstrations reads some")
    if skill is not None:
        require_type(skill, "skill", Skill, "a fit holds one: fit.skill")
    if len(demonstrations) > MAX_DEMONSTRATIONS:
        raise InvalidInput(
            f"there are {len(demonstrations)} demonstrations, expected at most {MAX_DEMONSTRATIONS} to draw; "
            "select some of them"
        )
    if skill is None and not demonstrations:
        raise InvalidInput("demonstrations and skill are missing, expected one of them; pass a skill")
    layout = skill.layout if skill else demonstrations[0].layout
    position_part(layout)
    names = skill.frame_names if skill else tuple(frame.name for frame in demonstrations[0].frames)
    for demo in demonstrations:
        _require_match(demo, layout, names if skill else None)
    given = [] if frames is None else [Situation("given frames", _validate_frames(frames, layout, names))]
    found = [Situation(_label(m, demo), _first_frames(demo)) for m, demo in enumerate(demonstrations)]
    situations = (*given, *found) or (_middle_situation(skill),)
    return ViewContent(tuple(demonstrations), skill, layout, situations)


def is_fixed(frame: Frame) -> bool:
    """Return whether a frame is that of the world, which nobody can move.

    Args:
        frame: Frame of an object.
    """
    return frame.is_world and frame.name == WORLD


def _label(number: int, demo: Demonstration) -> str:
    """Return a label that is different for each demonstration."""
    return f"{number}: {demo.name}" if demo.name else f"{number}"


def _first_frames(demo: Demonstration) -> tuple[Frame, ...]:
    """Return the frames of a demonstration; those that move, at the first step."""
    return tuple(frame.at(0) for frame in demo.frames)


def _require_match(demo: Demonstration, layout: Layout, names: Sequence[str] | None) -> None:
    """Check that a demonstration has the columns, and the frames of a skill if there is one."""
    if demo.layout != layout:
        raise InvalidInput(
            f"demonstration {demo.name!r} has the columns {short_list(demo.layout.names)}, expected "
            f"{short_list(layout.names)}; display it on its own"
        )
    found = [frame.name for frame in demo.frames]
    if names is not None and sorted(found) != sorted(names):
        raise InvalidInput(
            f"demonstration {demo.name!r} has the frames {short_list(found)}, expected those of the skill: "
            f"{short_list(names)}; name the demonstrations that the skill was learned from"
        )


def _validate_frames(frames: object, layout: Layout, names: Sequence[str]) -> tuple[Frame, ...]:
    require_type(frames, "frames", Sequence, "pass a list of frames")
    assert isinstance(frames, Sequence)
    for frame in frames:
        require_type(frame, "a frame", Frame, "a moving frame at a step is frame.at(t)")
    found = [frame.name for frame in frames]
    if sorted(found) != sorted(names):
        raise InvalidInput(f"the frames are {short_list(found)}, expected each of {short_list(names)} once")
    return tuple(frame.validate(1, layout.width) for frame in frames)


def _middle_situation(skill: Skill | None) -> Situation:
    """Return the situation in the middle of the demonstrations of a skill."""
    assert skill is not None
    if skill.demonstrated is not None:
        ranges = skill.demonstrated.frames
        middles = zip(skill.frame_names, ranges.orientations, ranges.lowest, ranges.highest, strict=True)
        frames = tuple(Frame(name, A, 0.5 * (low + high)) for name, A, low, high in middles)
        return Situation("middle of the demonstrations", frames)
    if skill.frame_names == (WORLD,):
        return Situation(WORLD, (world_frame(skill.width),))
    raise InvalidInput(
        f"the skill does not state where its frames {short_list(skill.frame_names)} were, expected frames; "
        "pass them, or demonstrations"
    )
