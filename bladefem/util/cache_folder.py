"""Where compiled code is kept: numba's kernels in a folder of these sources, and all of it among
the temporary files if the user's cache cannot be written.

numba looks at the file of a kernel alone, and would go on using one whose neighbour was edited. In
a container whose user has no home numba and dolfinx would end with an error of their own.
"""

from __future__ import annotations

import os
import stat
import sys
import tempfile
import zlib
from collections.abc import MutableMapping
from pathlib import Path

VARIABLE = "XDG_CACHE_HOME"
KERNELS = "NUMBA_CACHE_DIR"
PACKAGE = Path(__file__).resolve().parents[1]


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


def provide_kernel_folder(
    environment: MutableMapping[str, str] = os.environ, package: Path = PACKAGE
) -> None:
    """Name numba's folder after all sources that have kernels, unless it has a name already.

    Args:
        environment: after ``provide_cache_folder``.
        package: folder of the sources.
    """
    # numba has read its name when it was loaded
    if KERNELS in environment or "numba" in sys.modules:
        return
    cache = Path(environment.get(VARIABLE) or Path.home() / ".cache")
    environment[KERNELS] = str(cache / "bladefem" / f"kernels_{_sum_of_kernels(package):08x}")


def _sum_of_kernels(package: Path) -> int:
    """Check sum of all sources of a package that name numba."""
    total = 0
    for file in sorted(package.rglob("*.py")):
        text = file.read_bytes()
        if b"numba" in text:
            total = zlib.crc32(text, total)
    return total


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
