"""Recordings are made once for each state of the code and each choice of settings."""

from concurrent.futures import ThreadPoolExecutor
from threading import Barrier

import numpy as np
import pytest
import recordings
from recordings import cached_recording, code_hash

import pilotfish as pf
from pilotfish.demonstrations import position_layout


@pytest.fixture
def made(tmp_path, monkeypatch):
    """Use an empty folder and return the settings of each recording that was made."""
    monkeypatch.setattr(recordings, "FOLDER", tmp_path / "deep" / "recordings")
    return []


@pytest.fixture
def ask(made, tmp_path, rng):
    """Return a function that asks for a demonstration, made with new numbers each time."""
    script = tmp_path / "script.py"
    script.write_text("pass")

    def make(settings):
        made.append(settings)
        return [pf.demonstration(rng.normal(size=(5, 3)), 0.1, position_layout(3), name=settings)]

    return lambda settings, file=script: cached_recording(str(file), settings, lambda: make(settings))[0]


def test_cached_recording_same_code_is_recorded_once(ask, made):
    first, again = ask("seed 0"), ask("seed 0")
    assert made == ["seed 0"]
    np.testing.assert_array_equal(first.x, again.x)
    assert first.name == again.name == "seed 0"


def test_cached_recording_other_settings_are_recorded_again(ask, made, tmp_path):
    first, other = ask("seed 0"), ask("seed 1")
    changed = tmp_path / "changed.py"
    changed.write_text("pass # changed")
    third = ask("seed 0", changed)
    assert made == ["seed 0", "seed 1", "seed 0"]
    assert not np.array_equal(first.x, other.x)
    assert not np.array_equal(first.x, third.x)


def test_code_hash_changed_file_differs(tmp_path, monkeypatch):
    script, package = tmp_path / "script.py", tmp_path / "package"
    script.write_text("pass")
    (package / "deep").mkdir(parents=True)
    monkeypatch.setattr(recordings.pf, "__path__", [str(package)])
    hashes = []
    for name in ("deep/a.py", "deep/a.so", "notes.txt"):
        (package / name).write_text("x = 1")
        code_hash.cache_clear()
        hashes.append(code_hash(script))
    code_hash.cache_clear()
    assert hashes[0] != hashes[1] == hashes[2]


def test_cached_recording_concurrent_processes_agree(tmp_path, monkeypatch, rng):
    monkeypatch.setattr(recordings, "FOLDER", tmp_path / "recordings")
    together = Barrier(2, timeout=10.0)
    script = tmp_path / "script.py"
    script.write_text("pass")
    paths = list(rng.normal(size=(2, 5, 3)))

    def make():
        together.wait()
        return [pf.demonstration(paths.pop(), 0.1, position_layout(3))]

    with ThreadPoolExecutor(2) as pool:
        first, second = pool.map(lambda _: cached_recording(str(script), "", make)[0], range(2))
    assert paths == []
    np.testing.assert_array_equal(first.x, second.x)


def test_cached_recording_unwritable_folder_fails(ask, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(recordings, "FOLDER", tmp_path / "file")
    with pytest.raises(OSError, match="file"):
        ask("seed 0")
