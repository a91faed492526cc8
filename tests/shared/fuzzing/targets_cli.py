"""Targets of the command line: situation files, texts of options, lines of a stream, the cache of meshes."""

from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

import click
import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import save

from fuzzing.edits import edit_tree, json_text, toml_text
from fuzzing.edits_of_text import edit_bytes, edit_text
from fuzzing.seeds import lines, skills, valve_demonstrations
from fuzzing.soundness import (
    identity_frames,
    mean_of_first_state,
    require_sound,
    require_sound_refusal,
    use_in_frames,
)
from fuzzing.target import Target
from fuzzing.targets_demonstrations import Arrays, CorruptedBytes, corrupted, edit_arrays, edit_or_corrupt
from pilotfish.cli.commands.learn import learn as learn_command
from pilotfish.cli.options.candidates import parse_candidates
from pilotfish.cli.options.demonstrations import select_demonstrations, validate_selection
from pilotfish.cli.options.structures import StructureType
from pilotfish.cli.options.via_points import (
    ViaPointType,
    to_via_points,
    via_point_errors,
    via_point_notes,
    via_point_rows,
)
from pilotfish.cli.stream import lines as stream_lines
from pilotfish.demonstrations import frame_from_pose
from pilotfish.errors import InvalidInput, SkillError
from pilotfish.geometry import pose
from pilotfish.io.situations import read_frames, read_start
from pilotfish.models import adapt
from pilotfish.planning import reproduce
from pilotfish.simulation import meshes

POSES = {"frame 0": [0.1, 0.2, 0.3], "frame 1": [0.4, 0.1, 0.0]}
QUATERNION = [0.9659258262890683, 0.0, 0.0, 0.25881904510252074]


def _written(value: CorruptedBytes, folder: Path, toml: bool) -> Path:
    text = toml_text(value[0]) if toml else json_text(value[0])
    file = folder / ("now.toml" if toml else "now.json")
    file.write_bytes(corrupted(text.encode("utf-8", "surrogatepass"), value[1]))
    return file


def _frames(number: int, toml: bool) -> Callable[[], Target]:
    """Return a target of frames files; skill 2 has quaternions, skill 3 has orientations on S^3."""

    def make() -> Target:
        skill, folder = skills()[number], Path(mkdtemp(prefix="fuzz-"))
        posed = [{"name": n, "position": p, "quaternion": QUATERNION} for n, p in POSES.items()]
        posed[0]["name"], posed[1]["name"] = skill.frame_names
        given = [
            frame_from_pose(n, skill.layout, pose(p, QUATERNION))
            for n, p in zip(skill.frame_names, POSES.values(), strict=True)
        ]
        matrices = [{"name": f.name, "A": f.A.tolist(), "b": f.b.tolist()} for f in given]
        small = [{"name": f.name, "A": f.A[:7, :7].tolist(), "b": f.b[:7].tolist()} for f in given]
        trees = [{"frames": posed}, {"frames": matrices}, {"frames": small}] + ([] if toml else [posed])

        def use(value: Any, thorough: bool) -> None:
            require_sound(value, "frames")
            if thorough:
                _attempt(lambda: use_in_frames(skill, value))

        return Target(
            [(tree, ()) for tree in trees],
            edit_or_corrupt(edit_tree),
            lambda value: _written(value, folder, toml),
            lambda path: read_frames(path, skill),
            use,
        )

    return make


def _attempt(work: Callable[[], None]) -> None:
    try:
        work()
    except SkillError as error:
        require_sound_refusal(error)


def _starts() -> Target:
    skill, folder = skills()[2], Path(mkdtemp(prefix="fuzz-"))
    frames = identity_frames(skill)
    adapted = adapt(skill, frames)
    start = mean_of_first_state(adapted)
    trees = [{"x": start.tolist()}, {"position": [0.1, 0.2, 0.3], "orientation": QUATERNION}]
    trees.append({"position": [0.1, 0.2, 0.3], "quaternion": QUATERNION})

    def use(value: Any, thorough: bool) -> None:
        require_sound(value, "start")
        if thorough:
            _attempt(lambda: require_sound(reproduce(skill, frames, value, horizon=8).reference, "plan"))

    return Target(
        [(tree, ()) for tree in trees],
        edit_or_corrupt(edit_tree),
        lambda value: _written(value, folder, False),
        lambda path: read_start(path, adapted),
        use,
    )


# ---------------------------------------------------------------------------------------------- option texts

VIA_POINTS = (
    "position=.4,.1,.3@.4s+-.001",
    "position z=.3@.2s+-.001",
    "position'=.1,0,.3@0+-1",
    "orientation=1,0,0,0@.4s+-2deg",
    "orientation w=.5@.1s+-.1",
)


def _via_points(number: int) -> Callable[[], Target]:
    def make() -> Target:
        skill = skills()[number]
        frames = identity_frames(skill)
        adapted = adapt(skill, frames)
        start = mean_of_first_state(adapted)

        def read(text: str) -> Any:
            option = ViaPointType().convert(text, None, None)
            return option, to_via_points([option], adapted.layout)

        def use(value: Any, thorough: bool) -> None:
            require_sound(value, "via-point")
            _attempt(lambda: _use_via_points(value))

        def _use_via_points(value: Any) -> None:
            option, points = value
            result = reproduce(skill, frames, start, horizon=10, via_points=points, control_cost=9.0)
            require_sound(result.reference, "reference through a via-point")
            require_sound(result.motion, "motion through a via-point")
            errors = via_point_errors(points, [option], adapted.layout, result.motion)
            require_sound([errors, via_point_notes(errors, [option]), via_point_rows(errors, [option])])

        marks = ("=", "@", "+-", "deg", "s", ",", " ", "'", ".", "position", "orientation", "e", "-")
        return Target(VIA_POINTS, edit_text(marks), lambda text: text, read, use)

    return make


def _only() -> Target:
    demos = lines()
    option = next(p for p in learn_command.params if p.name == "only")
    context = click.Context(learn_command)

    def read(text: str) -> Any:
        return select_demonstrations(demos, validate_selection(context, option, text))

    def use(value: Any, thorough: bool) -> None:
        assert all(any(demo is known for known in demos) for demo in value)

    return Target(("0-2", "0,2", "1", "", "0-1,2"), edit_text(("-", ",", " ", "0", "1")), str, read, use)


def _structures() -> Target:
    names = (
        "full",
        "semi-tied:0.5",
        "mfa:2",
        "hddc:0.4",
        "hddc:2",
        "emllt:20",
        "mlt:2",
        "mppca:1",
        "diagonal",
    )

    def read(text: str) -> Any:
        return StructureType().convert(text, None, None)

    def use(value: Any, thorough: bool) -> None:
        require_sound(value)
        require_sound(value.label)

    return Target(names, edit_text((":", "-", ".", "mfa", "hddc")), str, read, use)


def _candidates() -> Target:
    texts = ("3:6;full,diagonal;viterbi", "3,5,7:9;semi-tied:0.5,mfa:1;markov,mixture", "2;hddc:.9;gamma")

    def read(text: str) -> Any:
        states, structures, durations = [*text.split(";", 2), "", ""][:3]
        return parse_candidates(states, structures, durations)

    def use(value: Any, thorough: bool) -> None:
        require_sound([(one.states, one.label) for one in value])

    return Target(texts, edit_text((":", ",", ";", "-", ".", "mfa", "99999")), str, read, use)


# ---------------------------------------------------------------------------------------------- streams


def _stream_lines() -> Target:
    demo = valve_demonstrations()[0]
    rows = "\n".join(",".join(f"{v:.6g}" for v in row) for row in demo.x.tolist())
    blanks = rows.replace(",", " ")
    bases = [
        (",".join(demo.layout.names) + "\n" + rows + "\n").encode(),
        blanks.encode(),
        (rows[:400] + "\n\n# a remark\n" + rows[400:]).encode(),
        b"1\n2\n3\n",
        b"a,b\n1,2\n\n3,4\r\n5,6",
    ]

    def read(data: bytes) -> Any:
        size = 1 + len(data) % 700
        arriving = (data[n : n + size] for n in range(0, len(data), size))
        found = list(stream_lines.parse_lines(stream_lines.split_lines(arriving, lambda: 0), None))
        width = next((p.width for p in found if isinstance(p, stream_lines.ColumnHeader)), 0)
        return width, found

    def use(value: Any, thorough: bool) -> None:
        width, found = value
        for event in found:
            if isinstance(event, stream_lines.RejectedLine):
                require_sound_refusal(InvalidInput(event.reason), event.reason)
            elif isinstance(event, np.ndarray):
                require_sound(event, "rows")
                assert event.shape[1] == width, f"a row of {event.shape[1]} among those of {width}"

    return Target(bases, edit_bytes, lambda data: data, read, use)


def _meshes() -> Target:
    file = Path(mkdtemp(prefix="fuzz-")) / "kept"
    arrays: Arrays = {
        "0.torso.vertices": np.random.default_rng(0).normal(size=(4, 3)),
        "0.torso.faces": np.array([[0, 1, 2], [1, 2, 3]], dtype=np.int32),
        "0.torso.rgba": np.array([0.5, 0.5, 0.5, 1.0]),
    }

    def write(value: CorruptedBytes) -> Path:
        try:
            content = save({k: np.ascontiguousarray(v) for k, v in value[0].items()})
        except (SafetensorError, KeyError, ValueError, TypeError):  # kinds of numbers that safetensors lacks
            content = b""
        content = corrupted(content, value[1])
        file.write_bytes(sha256(content).digest() + content)
        return file

    def use(value: Any, thorough: bool) -> None:
        for surface in value or ():
            require_sound(surface, "surface")
            assert surface.faces.size == 0 or surface.faces.max() < len(surface.vertices)

    return Target([(arrays, ())], edit_or_corrupt(edit_arrays, 0.3), write, meshes._read_cache, use)


TARGETS: dict[str, tuple[Callable[[], Target], float]] = {
    "frames.json": (_frames(2, False), 2.0),
    "frames.toml": (_frames(3, True), 1.0),
    "start.json": (_starts, 2.0),
    "via": (_via_points(2), 2.0),
    "via on S3": (_via_points(3), 1.0),
    "only": (_only, 2.0),
    "structure": (_structures, 2.0),
    "states": (_candidates, 2.0),
    "stream lines": (_stream_lines, 3.0),
    "mesh cache": (_meshes, 1.0),
}
