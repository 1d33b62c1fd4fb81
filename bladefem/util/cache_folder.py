"""Where compiled code is kept if the user's cache cannot be written.

numba's kernels and dolfinx's forms are kept there. In a container whose user has no home both would
end with an error of their own.
"""

from __future__ import annotations

import os
import stat
import tempfile
from collections.abc import MutableMapping
from pathlib import Path

VARIABLE = "XDG_CACHE_HOME"


def provide_cache_folder(environment: MutableMapping[str, str] = os.environ) -> None:
    """Name a folder of this user among the temporary files, which later processes find again."""
    try:
        home = Path.home()
    except RuntimeError:
        # of a user that the system does not know; dolfinx asks for it in any case
        environment["HOME"] = _temporary_folder()
        home = Path(environment["HOME"])
    if not _is_writable(Path(environment.get(VARIABLE) or home / ".cache")):
        environment[VARIABLE] = _temporary_folder()


def _is_writable(folder: Path) -> bool:
    """Whether a folder can be written, or made and then be written."""
    # unlike Path.exists it takes what may not be looked at for missing
    there = next((path for path in (folder, *folder.parents) if os.path.exists(path)), None)
    return there is not None and os.access(there, os.W_OK | os.X_OK)


def _temporary_folder() -> str:
    """A folder that nobody else can write, since what is kept in it is run; a new one where another
    user has taken its name.
    """
    path = os.path.join(tempfile.gettempdir(), f"bladefem_cache_{os.getuid()}")
    try:
        os.makedirs(path, 0o700, exist_ok=True)
        found = os.lstat(path)
        if found.st_uid == os.getuid() and stat.S_IMODE(found.st_mode) == 0o700:
            return path
    except OSError:
        pass
    return tempfile.mkdtemp(prefix="bladefem_cache_")
