"""What is kept: skills in files, named by the hash of their content (`save_skill`, `open_skill`), models that
grow with a stream (`save_stream`, `open_stream`), published recordings by name (`datasets`), a generated one,
and files that appear whole or not at all (`whole_file`).
"""

from pilotfish.files import whole_file
from pilotfish.store import datasets
from pilotfish.store.skills import content_hash, decode_skill, encode_skill, open_skill, save_skill
from pilotfish.store.streams import decode_stream, encode_stream, open_kept, open_stream, save_stream
from pilotfish.store.synthetic import synthetic_valve

__all__ = [
    "content_hash",
    "datasets",
    "decode_skill",
    "decode_stream",
    "encode_skill",
    "encode_stream",
    "open_kept",
    "open_skill",
    "open_stream",
    "save_skill",
    "save_stream",
    "synthetic_valve",
    "whole_file",
]
