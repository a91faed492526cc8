"""Files of skills, streams, demonstrations, motions and situations; published data sets; atomic writes."""

from pilotfish.io import datasets
from pilotfish.io.atomic_files import atomic_file
from pilotfish.io.atomic_folders import atomic_folder
from pilotfish.io.folders import read_demonstrations, require_replaceable, write_demonstrations
from pilotfish.io.motions import (
    coordinate_parts,
    end_notes,
    normalise_quaternions,
    reaches_final_state,
    round_time,
    start_notes,
    write_motion,
)
from pilotfish.io.paths import (
    MAX_FILE_BYTES,
    is_file,
    is_folder,
    is_link,
    open_regular_file,
    path_exists,
    read_file,
    resolve_path,
)
from pilotfish.io.published_archives import (
    read_chicken_dance_npz,
    read_letters_npz,
    read_mocap6_labels_npz,
    read_mocap6_npz,
)
from pilotfish.io.published_arrays import read_helloworld_npy, read_robotasks_npy
from pilotfish.io.published_matlab import read_valve_mat, read_zshape_mat
from pilotfish.io.renaming import make_folder
from pilotfish.io.situations import mean_of_first_state, read_frames, read_start
from pilotfish.io.skill_file import content_hash, decode_skill, encode_skill, open_skill, save_skill
from pilotfish.io.stream_file import decode_stream, encode_stream, load_any, open_stream, save_stream
from pilotfish.io.synthetic import synthetic_valve

__all__ = [
    "MAX_FILE_BYTES",
    "atomic_file",
    "atomic_folder",
    "content_hash",
    "coordinate_parts",
    "datasets",
    "decode_skill",
    "decode_stream",
    "encode_skill",
    "encode_stream",
    "end_notes",
    "is_file",
    "is_folder",
    "is_link",
    "load_any",
    "make_folder",
    "mean_of_first_state",
    "normalise_quaternions",
    "open_regular_file",
    "open_skill",
    "open_stream",
    "path_exists",
    "reaches_final_state",
    "read_chicken_dance_npz",
    "read_demonstrations",
    "read_file",
    "read_frames",
    "read_helloworld_npy",
    "read_letters_npz",
    "read_mocap6_labels_npz",
    "read_mocap6_npz",
    "read_robotasks_npy",
    "read_start",
    "read_valve_mat",
    "read_zshape_mat",
    "require_replaceable",
    "resolve_path",
    "round_time",
    "save_skill",
    "save_stream",
    "start_notes",
    "synthetic_valve",
    "write_demonstrations",
    "write_motion",
]
