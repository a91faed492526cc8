"""Every decoder with valid inputs, edits of them, and what must hold of what it accepts."""

from collections.abc import Callable, Sequence

from fuzzing import public_functions, targets_demonstrations, targets_kernels, targets_station
from fuzzing.headed import edit_headed, headed_writer, taken_apart
from fuzzing.seeds import skills, streams
from fuzzing.soundness import use_skill, use_stream
from fuzzing.target import Target
from pilotfish.store import decode_skill, decode_stream, encode_skill, encode_stream
from pilotfish.store.headed_files import SKILL, STREAM


def _skill_target() -> Target:
    bases = [taken_apart(encode_skill(skill)) for skill in skills()]
    return Target(bases, edit_headed, headed_writer(SKILL), decode_skill, use_skill)


def _stream_target() -> Target:
    bases = [taken_apart(encode_stream(model)) for model in streams()]
    return Target(bases, edit_headed, headed_writer(STREAM), decode_stream, use_stream)


# How a target is made, and its share of the mutants.
TARGETS: dict[str, tuple[Callable[[], Target], float]] = {
    "skill": (_skill_target, 5.0),
    "stream": (_stream_target, 4.0),
    **targets_demonstrations.TARGETS,
    **targets_station.TARGETS,
    **public_functions.TARGETS,
    **targets_kernels.TARGETS,
}

# Patterns of targets that are run together in the suite.
GROUPS = {
    "skills and streams": ("skill", "stream", "stream lines"),
    "recordings": ("manifest.*", "csv", "npz", "folder", "*.mat", "*.np[yz]"),
    "command line": ("frames.*", "start.*", "via*", "only", "structure", "states", "mesh cache"),
    "functions": ("*()", "kernels"),
}


def shares(mutants: int, names: Sequence[str] = ()) -> dict[str, int]:
    """How many mutants each target gets of so many in all."""
    chosen = names or tuple(TARGETS)
    total = sum(TARGETS[name][1] for name in chosen)
    return {name: max(1, round(mutants * TARGETS[name][1] / total)) for name in chosen}
