"""Taking a run folder into use: one command at a time, and no results of another scene next to the
new ones.
"""

from __future__ import annotations

import fcntl
import json
import os
import shutil
from collections.abc import Callable, Container, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from ..errors import InputError, UnwritableError
from ..scene.fields import each_field, value_at
from ..scene.tables import Scene
from ..scene.toml import dump_scene, load_scene
from .folder_undo import (
    EARLIER_FOLDER,
    GIVEN_FIELDS_FILE,
    REPLACED_FOLDER,
    folder_state,
    forget_replaced,
    restore_folder,
)
from .own_results import (
    NAMED_MESH,
    RESULTS_FILE,
    SCENE_FILE,
    USER_FOLDER,
    note_results,
    result_states,
    return_user_files,
    save_user_files,
    written_results,
)
from .stage_cache import open_folder, write_text

# what belongs to the mesh alone
MESH_FILES = (NAMED_MESH, "mesh.vtu")
# of what is put away, and of the reasons for it: those that are named
NAMED_FILES = 3
NAMED_FIELDS = 3


@contextmanager
def lock_run_folder(
    folder: str | Path, tell: Callable[[str], None] | None = None
) -> Iterator[None]:
    """Keep a run folder for this process; the system gives it back when the process ends, however
    it ends. A command that ends by bad input, before any long work, leaves the folder as it was.

    Args:
        tell: takes a sentence about files of the user's that the command has overwritten, and where
            they are.

    Raises:
        InputError: another process holds it, or the folder cannot be written.
    """
    try:
        before = folder_state(folder)
    except OSError as error:
        # in a folder that may not be entered, or of a name that is too long
        raise InputError(
            f"folder {folder}: cannot be written ({error.strerror or error})"
        ) from None
    path = open_folder(folder) / ".lock"
    try:
        file = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    except OSError as error:
        raise InputError(f"folder {folder}: cannot be locked ({error.strerror or error})") from None
    try:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError(
                f"folder {folder}: another command works in it, expected one at a time; wait for "
                "it, or name another folder with -o"
            ) from None
        except OSError:
            # a file system without locks
            pass
        return_user_files(folder)
        states, written = result_states(folder), written_results(folder)
        save_user_files(folder)
        try:
            yield
        except InputError as error:
            # a full disk: the stages finished so far are kept, as after an interruption
            if not isinstance(error, UnwritableError) and restore_folder(before):
                # the command has said that they were moved away
                error.args = (f"{error}; the results that were moved are back",)
            raise
        finally:
            kept = return_user_files(folder)
            if kept and tell is not None:
                tell(
                    f"{', '.join(kept)} in {folder} came from elsewhere; bladefem has written "
                    f"{'a file of that name' if len(kept) == 1 else 'files of these names'}, and "
                    f"yours {'is' if len(kept) == 1 else 'are'} in {Path(folder) / USER_FOLDER}"
                )
            if Path(folder).is_dir() and result_states(folder) != states:
                note_results(folder, states, written)
            forget_replaced(folder)
    finally:
        os.close(file)


def take_folder(
    folder: str | Path,
    scene: Scene,
    same_mesh: Callable[[Scene, Scene], bool] | None = None,
    tell: Callable[[str], None] | None = None,
) -> str:
    """Write the scene into a run folder; results of another scene are put away into its folder
    "earlier".

    Stages stay: each knows by its hash whether it belongs to the scene. Folders inside with a scene
    of their own stay as well.

    Args:
        same_mesh: whether two scenes have the same mesh, whose files then stay; files of the mesh
            go with the other results when left out.
        tell: takes a sentence about what will be put away and why, before it is.

    Returns:
        a sentence about what was put away, or "".

    Raises:
        InputError: the folder cannot be written.
    """
    folder = open_folder(folder)
    file = folder / SCENE_FILE
    said = ""
    if file.is_file():
        held = _read(file)
        if held != scene:
            keep_mesh = same_mesh is not None and held is not None and same_mesh(held, scene)
            results = _results_in(folder, MESH_FILES if keep_mesh else ())
            if results and tell is not None:
                tell(_announcement(folder, results, _differing(held, scene)))
            said = _put_away(folder, results)
    write_text(file, dump_scene(scene))
    return said


def borrow_stages(source: str | Path, target: str | Path) -> None:
    """Link the stored stages of one run folder into another that has none of these names.

    Links cost no space; a stage that does not belong to the other scene is computed again and
    replaces its link there.
    """
    to = open_folder(Path(target) / "stages")
    for stage in (Path(source) / "stages").glob("*.npz"):
        if not (to / stage.name).exists():
            try:
                os.link(stage, to / stage.name)
            except OSError:
                # a file system without links
                shutil.copyfile(stage, to / stage.name)


def keep_given(folder: str | Path, names: Iterable[str]) -> None:
    """Remember which fields of the folder's scene the user gave, for the report.

    Args:
        names: dotted, "aerofoil.span"; added to those already known where the scene came from the
            folder itself.
    """
    write_text(Path(folder) / GIVEN_FIELDS_FILE, json.dumps(sorted(names), indent=1) + "\n")


def given_fields(folder: str | Path) -> list[str] | None:
    """Dotted names of the fields that the user gave; None where the folder does not know."""
    try:
        names = json.loads((Path(folder) / GIVEN_FIELDS_FILE).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return [str(name) for name in names] if isinstance(names, list) else None


def _read(file: Path) -> Scene | None:
    """The scene of a file; None for one that an older program wrote and that is not readable."""
    try:
        return load_scene(file)
    except InputError:
        return None


def _differing(one: Scene | None, other: Scene) -> list[str]:
    """Dotted names of the fields in which two scenes differ; none where one is not readable."""
    if one is None:
        return []
    return [
        field.name
        for field in each_field()
        if value_at(one, field.name) != value_at(other, field.name)
    ]


def _announcement(folder: Path, results: Sequence[Path], fields: Sequence[str]) -> str:
    """What will be put away, why, what stays, and what else can be done."""
    names = sorted(path.name for path in results)
    more = f" and {len(names) - NAMED_FILES} more" if len(names) > NAMED_FILES else ""
    verb = "is" if len(names) == 1 else "are"
    why = ""
    if fields:
        others = f" and {len(fields) - NAMED_FIELDS} more" if len(fields) > NAMED_FIELDS else ""
        why = f", which differs in {', '.join(fields[:NAMED_FIELDS])}{others}"
    return (
        f"{folder} holds results of another scene{why}: {', '.join(names[:NAMED_FILES])}{more} "
        f"{verb} moved to {folder / EARLIER_FOLDER}, since tables and reports have one scene; "
        "stored stages stay, and those that do not depend on it are not computed again; another "
        "folder, -o, keeps both"
    )


def _results_in(folder: Path, kept: Container[str]) -> list[Path]:
    """Results of bladefem's in a folder other than the kept files."""
    return [folder / name for name in sorted(written_results(folder)) if name not in kept]


def _put_away(folder: Path, results: Sequence[Path]) -> str:
    """Move results, with the scene that they belong to."""
    if not results:
        return ""
    earlier = folder / EARLIER_FOLDER
    try:
        forget_replaced(folder)
        if earlier.is_dir():
            earlier.rename(folder / REPLACED_FOLDER)
        earlier.mkdir()
        if (folder / RESULTS_FILE).is_file():
            shutil.copy2(folder / RESULTS_FILE, earlier / RESULTS_FILE)
        for path in [*results, folder / SCENE_FILE]:
            path.rename(earlier / path.name)
    except OSError as error:
        raise InputError(
            f"folder {earlier}: results of another scene cannot be moved there "
            f"({error.strerror or error})"
        ) from None
    return (
        f"{folder} holds results of another scene: {len(results)} file{'s'[: len(results) > 1]} "
        f"moved to {earlier}"
    )
