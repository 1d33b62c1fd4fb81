"""What is refused of an imported geometry before its file is read."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from bladefem.errors import InputError

from .raw_mesh import SUFFIX_READERS
from .renaming import read_names

STEP_SUFFIXES = (".step", ".stp")


def check_imported(imported: Any) -> None:
    """Refuse unknown kinds of files, and names given to its groups that cannot be read.

    Args:
        imported: the table of that name of a scene.

    Raises:
        InputError: what is wrong, in one sentence.
    """
    suffix = Path(imported.file).suffix.lower()
    if suffix not in (*SUFFIX_READERS, *STEP_SUFFIXES):
        raise InputError(
            f"imported.file = {imported.file!r}: unknown kind of mesh; known are "
            f"{', '.join(sorted((*SUFFIX_READERS, *STEP_SUFFIXES)))}"
        )
    read_names(imported.names or ())
