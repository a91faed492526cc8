"""All targets of the fuzzer, and their shares of the mutants."""

from collections.abc import Callable, Sequence

from fuzzing import (
    public_functions,
    targets_cli,
    targets_demonstrations,
    targets_kernels,
    targets_sessions,
    targets_teleop,
)
from fuzzing.containers import container_writer, edit_container, parse_container
from fuzzing.seeds import skills, streams
from fuzzing.soundness import use_skill, use_stream
from fuzzing.target import Target
from pilotfish.io.container_format import SKILL_FORMAT, STREAM_FORMAT
from pilotfish.io.skill_file import decode_skill, encode_skill
from pilotfish.io.stream_file import decode_stream, encode_stream


def _skill_target() -> Target:
    bases = [parse_container(encode_skill(skill)) for skill in skills()]
    return Target(bases, edit_container, container_writer(SKILL_FORMAT), decode_skill, use_skill)


def _stream_target() -> Target:
    bases = [parse_container(encode_stream(model)) for model in streams()]
    return Target(bases, edit_container, container_writer(STREAM_FORMAT), decode_stream, use_stream)


# Function that makes each target, and its share of the mutants.
TARGETS: dict[str, tuple[Callable[[], Target], float]] = {
    "skill": (_skill_target, 5.0),
    "stream": (_stream_target, 4.0),
    **targets_demonstrations.TARGETS,
    **targets_sessions.TARGETS,
    **targets_cli.TARGETS,
    **public_functions.TARGETS,
    **targets_kernels.TARGETS,
    **targets_teleop.TARGETS,
}

# Patterns of targets that are run together in the suite.
GROUPS = {
    "skills and streams": ("skill", "stream", "stream lines"),
    "recordings": ("manifest.*", "csv", "npz", "folder", "session", "*.mat", "*.np[yz]"),
    "command line": ("frames.*", "start.*", "via*", "only", "structure", "states", "mesh cache"),
    "teleoperation": ("messages", "datagrams"),
    "functions": ("*()", "kernels"),
}


def shares(mutants: int, names: Sequence[str] = ()) -> dict[str, int]:
    """Return the number of mutants of each target, for a total."""
    chosen = names or tuple(TARGETS)
    total = sum(TARGETS[name][1] for name in chosen)
    return {name: max(1, round(mutants * TARGETS[name][1] / total)) for name in chosen}
