"""Which files of a run folder bladefem wrote. Others are the user's: they stay where they are when
results are put away, and a command that writes a file of the same name leaves them in a folder of
their own.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import TypeAlias

from ..errors import InputError
from .stage_cache import write_text

# size and time of change [ns]: a file that was changed since is no longer the one that was written
FileState: TypeAlias = tuple[int, int]

SCENE_FILE = "scene.toml"
# not all .msh are results: a mesh of the user's own may lie in the folder
NAMED_MESH = "named_mesh.msh"
RESULT_SUFFIXES = (
    ".csv",
    ".gif",
    ".html",
    ".json",
    ".md",
    ".nc",
    ".png",
    ".svg",
    ".tex",
    ".txt",
    ".vtu",
)
# state of each result when the command ended that wrote it
RESULTS_FILE = ".results.json"
# copies of the user's files while a command runs
SAVED_FOLDER = ".saved"
# where they are after it has written files of the same names
USER_FOLDER = "not_from_bladefem"


def written_results(folder: str | Path) -> set[str]:
    """Names of the results at the top of a folder that bladefem wrote; by their suffixes in a run
    folder of an older program, which did not note them.
    """
    now = result_states(folder)
    noted = _noted(Path(folder))
    if noted is None:
        return set(now) if (Path(folder) / SCENE_FILE).is_file() else set()
    return {name for name, state in now.items() if noted.get(name) == state}


def result_states(folder: str | Path) -> dict[str, FileState]:
    """Name to state of the files at the top of a folder that look like results."""
    return {path.name: _state(path) for path in _results(Path(folder))}


def note_results(folder: str | Path, before: dict[str, FileState], written: set[str]) -> None:
    """Note what a command wrote, with what is left of earlier ones.

    Args:
        before: `result_states` when the command began.
        written: `written_results` then.
    """
    now = result_states(folder)
    ours = {name: now[name] for name in now if name in written or before.get(name) != now[name]}
    # a command that could not write its results has said so already
    with suppress(InputError):
        write_text(Path(folder) / RESULTS_FILE, json.dumps(ours, indent=1) + "\n")


def save_user_files(folder: str | Path) -> None:
    """Copy the user's files that a command may overwrite."""
    folder = Path(folder)
    own = [path for path in _results(folder) if path.name not in written_results(folder)]
    if own:
        (folder / SAVED_FOLDER).mkdir(exist_ok=True)
    for path in own:
        shutil.copy2(path, folder / SAVED_FOLDER / path.name)


def return_user_files(folder: str | Path) -> list[str]:
    """Put copies of overwritten files into USER_FOLDER, also those that a killed command left.

    Returns:
        the names of these.
    """
    folder = Path(folder)
    saved = folder / SAVED_FOLDER
    kept = []
    for copy in sorted(saved.iterdir()) if saved.is_dir() else ():
        there = folder / copy.name
        if there.is_file() and _state(there) == _state(copy):
            continue
        (folder / USER_FOLDER).mkdir(exist_ok=True)
        copy.replace(_free_name(folder / USER_FOLDER / copy.name))
        kept.append(copy.name)
    shutil.rmtree(saved, ignore_errors=True)
    return kept


def move_user_files(source: Path, target: Path) -> None:
    """Move all that bladefem did not write from a folder of put-away results into another."""
    ours = written_results(source) | {SCENE_FILE, RESULTS_FILE}
    for path in list(source.iterdir()):
        if path.name not in ours:
            target.mkdir(exist_ok=True)
            path.rename(_free_name(target / path.name))


def _results(folder: Path) -> Iterator[Path]:
    for path in folder.iterdir() if folder.is_dir() else ():
        named = path.suffix in RESULT_SUFFIXES or path.name == NAMED_MESH
        if named and not path.name.startswith(".") and path.is_file():
            yield path


def _noted(folder: Path) -> dict[str, FileState] | None:
    try:
        noted = json.loads((folder / RESULTS_FILE).read_text())
        return {str(name): (int(size), int(time)) for name, (size, time) in noted.items()}
    except (OSError, ValueError, AttributeError, TypeError):
        return None


def _state(path: Path) -> FileState:
    found = path.stat()
    return found.st_size, found.st_mtime_ns


def _free_name(path: Path) -> Path:
    """The path, with a number where it is taken."""
    number, found = 2, path
    while found.exists():
        found = path.with_name(f"{path.stem}_{number}{path.suffix}")
        number += 1
    return found
