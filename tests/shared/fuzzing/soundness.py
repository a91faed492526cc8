"""Checks of every value that a decoder accepts: finite, bounded, printable and usable."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from enum import Enum
from math import isinf
from typing import Any

import numpy as np

from pilotfish.cli.output.motion_notes import end_notes
from pilotfish.cli.output.results import CommandResult
from pilotfish.cli.output.skill_descriptions import (
    format_columns,
    format_dynamics,
    skill_to_json,
    state_blocks,
)
from pilotfish.cli.output.tables import key_value_table
from pilotfish.cli.stream.model_descriptions import online_model_rows, online_model_to_json
from pilotfish.demonstrations import Frame, add_derivatives, frame, views
from pilotfish.errors import SkillError
from pilotfish.io.skill_file import decode_skill, encode_skill
from pilotfish.io.stream_file import decode_stream, encode_stream
from pilotfish.models import AdaptedSkill, Skill, adapt, online
from pilotfish.planning import motion_notes, plan, plan_states, reproduce

MAX_ARRAY_SIZE = 2**22  # numbers in one array that a small file may lead to
MAX_TEXT_LENGTH = 10**4
MAX_COUNT = 2**63


class InvariantViolation(AssertionError):
    """Raised when an accepted value is out of bounds."""


def require_sound(value: Any, place: str = "value") -> None:
    """Check that every array in a value is finite and bounded, every text printable, every number bounded."""
    if isinstance(value, np.ndarray):
        _require_sound_array(value, place)
    elif isinstance(value, str):
        if not value.isprintable() or len(value) > MAX_TEXT_LENGTH:
            raise InvariantViolation(f"{place} is {value[:60]!r} of {len(value)} characters")
    elif isinstance(value, bool | Enum) or value is None:
        return
    elif isinstance(value, int):
        if abs(value) > MAX_COUNT:
            raise InvariantViolation(f"{place} is an integer of {value.bit_length()} bits")
    elif isinstance(value, float):
        if isinf(value):
            raise InvariantViolation(f"{place} is {value}")
    elif is_dataclass(value):
        for field in fields(value):
            require_sound(getattr(value, field.name), f"{place}.{field.name}")
    elif isinstance(value, Mapping):
        for key, item in value.items():
            require_sound(key, f"a key of {place}")
            require_sound(item, f"{place}[{key!r}]")
    elif isinstance(value, list | tuple):
        for n, item in enumerate(value):
            require_sound(item, f"{place}[{n}]")


def _require_sound_array(array: np.ndarray, place: str) -> None:
    if array.size > MAX_ARRAY_SIZE:
        raise InvariantViolation(f"{place} has shape {array.shape}")
    if array.dtype.kind not in "fiub":
        raise InvariantViolation(f"{place} holds {array.dtype}")
    if array.dtype.kind == "f" and not np.isfinite(array).all():
        raise InvariantViolation(f"{place} holds numbers that are not finite")


def require_sound_text(text: str, place: str) -> None:
    """Check that a text is printable except for line breaks, and can be written as UTF-8."""
    if not all(line.isprintable() for line in text.split("\n")):
        raise InvariantViolation(f"{place} has characters that are not printable")
    text.encode()


def use_skill(skill: Skill, thorough: bool) -> None:
    """Describe a skill; if thorough, also write it, adapt it and reproduce a few steps."""
    require_sound(skill, "skill")
    require_sound_text(CommandResult(state_blocks(skill), {}).to_text(), "the table of states")
    require_sound_text(format_columns(skill.layout) + format_dynamics(skill), "the columns")
    require_sound_text(json.dumps(skill_to_json(skill), allow_nan=False), "the facts")
    if not thorough:
        return
    data = encode_skill(skill)
    if encode_skill(decode_skill(data)) != data:
        raise InvariantViolation("the skill that is read differs from the one that was written")
    try:
        use_in_frames(skill, identity_frames(skill))
    except SkillError as error:
        require_sound_refusal(error)


def identity_frames(skill: Skill) -> list[Frame]:
    return [frame(name, np.eye(skill.width), np.zeros(skill.width)) for name in skill.frame_names]


def mean_of_first_state(adapted: AdaptedSkill) -> np.ndarray:
    """Return the mean of the most probable first state."""
    no_observation = np.empty((0, adapted.states))
    (initial,) = adapted.dynamics.filtered_state_probs(no_observation, 1)
    return np.array(adapted.means[int(initial.argmax())])


def use_in_frames(skill: Skill, frames: Sequence[Frame]) -> None:
    """Adapt a skill to frames, plan a few steps and roll them out."""
    adapted = adapt(skill, frames)
    require_sound(adapted, "adapted skill")
    start = mean_of_first_state(adapted)
    if not adapted.layout.orientation_starts:
        require_sound(plan_states(adapted, start, horizon=12), "states")
        require_sound(plan(adapted, start, horizon=12), "reference")
    result = reproduce(skill, frames, start, horizon=12, control_cost=9.0)
    require_sound([result.adapted, result.states, result.reference, result.motion], "reproduction")
    require_sound([*end_notes(adapted, 0), *motion_notes(skill, result, frames)], "notes")


def use_stream(model: online.OnlineModel, thorough: bool) -> None:
    """Describe a model; if thorough, also write it and continue it."""
    require_sound(model, "model")
    if model.clusters:
        skill = online.to_skill(model)
        use_skill(skill, False)
        require_sound_text(key_value_table(online_model_rows(model)).to_text(), "the description")
        require_sound_text(json.dumps(online_model_to_json(model, skill), allow_nan=False), "the facts")
    if not thorough:
        return
    data = encode_stream(model)
    if encode_stream(decode_stream(data)) != data:
        raise InvariantViolation("the model that is read differs from the one that was written")
    try:
        x = np.random.default_rng(0).normal(size=(5, len(model.frame_names), model.layout.width))
        after, _ = online.observe_stream(model, x)
        require_sound(after, "model after more datapoints")
    except SkillError as error:
        require_sound_refusal(error)


def use_demonstrations(demos: Any, thorough: bool) -> None:
    """Check demonstrations; if thorough, also their derivatives and views."""
    require_sound(demos, "demonstrations")
    if not thorough:
        return
    try:
        require_sound(views([add_derivatives(demo) for demo in demos]), "views")
    except SkillError as error:
        require_sound_refusal(error)


def require_sound_refusal(error: Exception, message: str | None = None) -> None:
    """Check that a refusal is one printable line of at most 500 characters, and not caused by MemoryError."""
    text = str(error) if message is None else message
    if not text or not text.isprintable() or len(text) > 500:
        raise InvariantViolation(f"the message has {len(text)} characters: {text[:200]!r}") from error
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, MemoryError):
            raise InvariantViolation(f"memory ran out: {text}") from error
        cause = cause.__cause__ or cause.__context__
