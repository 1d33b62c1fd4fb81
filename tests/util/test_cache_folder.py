"""Folders for compiled code: of these sources, and where the user's cache cannot be written."""

import os
import sys
import tempfile
from pathlib import Path

from bladefem.util.cache_folder import (
    KERNELS,
    VARIABLE,
    provide_cache_folder,
    provide_kernel_folder,
)


def test_kernels_are_kept_with_the_sources_that_they_were_compiled_from(tmp_path, monkeypatch):
    """numba itself goes on using a kernel whose neighbour, which it calls, was edited."""
    monkeypatch.delitem(sys.modules, "numba", raising=False)
    (tmp_path / "inner").mkdir()
    neighbour = tmp_path / "inner" / "neighbour.py"
    neighbour.write_text("from numba import njit\n")
    plain = tmp_path / "plain.py"
    plain.write_text("x = 1\n")

    def folder():
        environment = {VARIABLE: "/cache"}
        provide_kernel_folder(environment, tmp_path)
        return environment[KERNELS]

    first = folder()
    assert first.startswith("/cache/bladefem/")
    plain.write_text("x = 2\n")
    assert folder() == first
    neighbour.write_text("from numba import njit, prange\n")
    assert folder() != first
    named = {VARIABLE: "/cache", KERNELS: "/own"}
    provide_kernel_folder(named, tmp_path)
    assert named[KERNELS] == "/own"


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
