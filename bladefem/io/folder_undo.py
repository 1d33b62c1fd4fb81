"""Putting a run folder back as it was, where a command ends by bad input before any long work."""

from __future__ import annotations

import shutil
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from .own_results import RESULTS_FILE, SCENE_FILE, move_user_files

# results of the scene before, put away by a command, and what that name held until then
EARLIER_FOLDER = "earlier"
REPLACED_FOLDER = ".earlier"
# the fields of the scene that the user gave
GIVEN_FIELDS_FILE = "given.json"
# of stored stages the one that is no long work: what is bad in a mesh is found right after it
SHORT_STAGE = "mesh.npz"


@dataclass(frozen=True)
class FolderState:
    """What is in a run folder before a command."""

    folder: Path
    # the folder and those above it that are not there, innermost first
    missing: tuple[Path, ...]
    # at its top, and stored stages, also those of folders inside
    files: frozenset[Path]
    # content of the files that a command overwrites at once
    texts: dict[Path, bytes]
    # inode of what was put away before, None where nothing was
    earlier: int | None


def folder_state(folder: str | Path) -> FolderState:
    """The state of a folder that may not be there yet."""
    path = Path(folder)
    above = [one for one in (path, *path.parents) if not one.exists()]
    texts = {}
    for name in (SCENE_FILE, GIVEN_FIELDS_FILE):
        with suppress(OSError):
            texts[path / name] = (path / name).read_bytes()
    return FolderState(
        path, tuple(above), frozenset(_files(path)), texts, _inode(path / EARLIER_FOLDER)
    )


def restore_folder(before: FolderState) -> bool:
    """Remove what is new and bring back what was put away; nothing where long work was done, whose
    stages are worth more than a clean folder.

    Returns:
        whether results came back.
    """
    folder = before.folder
    new = _files(folder) - before.files
    stages = {path for path in new if path.parent != folder}
    if any(path.name != SHORT_STAGE for path in stages):
        return False
    put_away = False
    # what cannot be removed or moved stays: the sentence about the input matters more
    with suppress(OSError):
        earlier = folder / EARLIER_FOLDER
        put_away = _inode(earlier) not in (None, before.earlier)
        for path in new:
            path.unlink()
        if put_away:
            for path in earlier.iterdir():
                if path.name == RESULTS_FILE:
                    path.unlink()
                else:
                    path.rename(folder / path.name)
            earlier.rmdir()
            if (folder / REPLACED_FOLDER).is_dir():
                (folder / REPLACED_FOLDER).rename(earlier)
        for path, text in before.texts.items():
            path.write_bytes(text)
        for inner in {path.parent for path in stages} | {path.parent.parent for path in stages}:
            _remove_empty(inner)
        for path in before.missing:
            _remove_empty(path)
        return put_away
    return False


def forget_replaced(folder: str | Path) -> None:
    """Remove for good what the put-away results have replaced, but for what bladefem did not
    write.
    """
    replaced = Path(folder) / REPLACED_FOLDER
    if replaced.is_dir():
        move_user_files(replaced, Path(folder) / EARLIER_FOLDER)
        shutil.rmtree(replaced, ignore_errors=True)


def _files(folder: Path) -> set[Path]:
    """Files at the top of a folder, and stored stages in it and in the folders inside."""
    patterns = ("*", "stages/*", "*/stages/*")
    return {path for some in patterns for path in folder.glob(some) if path.is_file()}


def _inode(path: Path) -> int | None:
    try:
        return path.stat().st_ino
    except OSError:
        return None


def _remove_empty(folder: Path) -> None:
    with suppress(OSError):
        folder.rmdir()
