"""``--help`` of a script whose first cell is prose, as the demos are written."""

from __future__ import annotations

import sys
from pathlib import Path

from .first_rank import is_first_rank

# of a cell of prose, and of any other, in scripts of cells
PROSE = "# %% [markdown]"
CELL = "# %%"
USAGE = (
    "\nIt takes no arguments. BLADEFEM_COARSE=1 in the environment takes the coarse settings of "
    "the tests where the demo has some."
)


def help_and_exit(script: str) -> None:
    """Where the command line asks for help, print the first cell of prose and end with code 0; of
    several ranks one prints.

    Args:
        script: path of the script, its ``__file__``.

    Raises:
        SystemExit: help was asked for.
    """
    if not {"-h", "--help"} & set(sys.argv[1:]):
        return
    if not is_first_rank():
        raise SystemExit
    lines = Path(script).read_text(encoding="utf-8").splitlines()
    first = lines.index(PROSE) + 1
    end = next(i for i in range(first, len(lines)) if lines[i].startswith(CELL))
    print("\n".join(line.removeprefix("#").removeprefix(" ") for line in lines[first:end]).strip())
    print(USAGE)
    raise SystemExit
