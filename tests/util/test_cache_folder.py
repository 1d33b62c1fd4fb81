"""A folder for compiled code where the user's cache cannot be written."""

import os
import tempfile
from pathlib import Path

from bladefem.util.cache_folder import VARIABLE, provide_cache_folder


def test_a_cache_that_can_be_written_stays(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    environment = {}
    provide_cache_folder(environment)
    assert environment == {}


def test_a_user_without_home_gets_a_folder_of_his_own(tmp_path, monkeypatch):
    """The same one again; where its name is taken by what others can write, a new one."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    # of the superuser everything can be written
    monkeypatch.setattr(os, "access", lambda path, mode: str(path).startswith(str(tmp_path)))
    monkeypatch.setenv("HOME", "/nonexistent")
    found = []
    for mode in (0o700, 0o777):
        environment = {}
        provide_cache_folder(environment)
        folder = Path(environment[VARIABLE])
        assert folder.parent == tmp_path and folder.stat().st_mode & 0o777 == 0o700
        found.append(folder)
        folder.chmod(mode)
    assert found[0] == found[1]
    environment = {}
    provide_cache_folder(environment)
    assert environment[VARIABLE] != str(found[0])


def test_a_user_whom_the_system_does_not_know(tmp_path, monkeypatch):
    def no_home():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(Path, "home", no_home)
    environment = {}
    provide_cache_folder(environment)
    assert Path(environment["HOME"]).is_dir()
