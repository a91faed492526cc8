"""What is kept: skills in files, named by the hash of their content (`save_skill`, `open_skill`), published
recordings by name (`datasets`), a generated one, and files that appear whole or not at all (`whole_file`).
"""

from pilotfish.store import datasets
from pilotfish.store.skills import content_hash, decode_skill, encode_skill, open_skill, save_skill
from pilotfish.store.synthetic import synthetic_valve
from pilotfish.store.whole_files import whole_file

__all__ = [
    "content_hash",
    "datasets",
    "decode_skill",
    "encode_skill",
    "open_skill",
    "save_skill",
    "synthetic_valve",
    "whole_file",
]
