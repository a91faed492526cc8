"""Files of skills, online models, demonstrations, motions, situations and sessions; published data sets."""

from pilotfish.io import datasets
from pilotfish.io.assisted_skill_file import decode_assisted_skill, encode_assisted_skill
from pilotfish.io.atomic_writes import atomic_file
from pilotfish.io.demonstration_descriptions import restore_demonstration
from pilotfish.io.demonstration_folder import (
    read_demonstrations,
    require_replaceable,
    write_demonstrations,
)
from pilotfish.io.demonstration_sets import MAX_GROUP, GroupFiles, is_lerobot, list_groups, read_group
from pilotfish.io.folder_template import write_folder_template
from pilotfish.io.import_settings import (
    format_import_settings,
    read_import_settings,
    stated_import_settings,
)
from pilotfish.io.motions import normalise_quaternions, write_motion
from pilotfish.io.paths import is_folder, path_exists, read_file, resolve_path
from pilotfish.io.renames import make_folder
from pilotfish.io.session_file import SessionFile, SessionWriter, read_session
from pilotfish.io.session_records import SessionRecord
from pilotfish.io.situations import read_frames, read_start
from pilotfish.io.skill_file import content_hash, open_skill, save_skill
from pilotfish.io.stream_file import load_any, open_stream, save_stream
from pilotfish.io.synthetic import synthetic_valve

__all__ = [
    "MAX_GROUP",
    "GroupFiles",
    "SessionFile",
    "SessionRecord",
    "SessionWriter",
    "atomic_file",
    "content_hash",
    "datasets",
    "decode_assisted_skill",
    "encode_assisted_skill",
    "format_import_settings",
    "is_folder",
    "is_lerobot",
    "list_groups",
    "load_any",
    "make_folder",
    "normalise_quaternions",
    "open_skill",
    "open_stream",
    "path_exists",
    "read_demonstrations",
    "read_file",
    "read_frames",
    "read_group",
    "read_import_settings",
    "read_session",
    "read_start",
    "require_replaceable",
    "resolve_path",
    "restore_demonstration",
    "save_skill",
    "save_stream",
    "stated_import_settings",
    "synthetic_valve",
    "write_demonstrations",
    "write_folder_template",
    "write_motion",
]
