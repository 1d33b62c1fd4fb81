"""The demos as executed notebooks: python docs/make_notebooks.py [name ...], into notebooks/.

A demo is a script of prose and code in cells; jupytext reads it, nbclient runs it. Set
BLADEFEM_COARSE=1 for the coarse setting of the tests.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import jupytext
import nbformat
from nbclient import NotebookClient

HERE = Path(__file__).resolve().parents[1]
DEMOS = HERE / "demos"
# of a cell [s]
LONGEST = 1800


def make_notebook(demo: Path, folder: Path) -> Path:
    """Run a demo as a notebook and write it with its output.

    Raises:
        nbclient.exceptions.CellExecutionError: a cell of the demo raised.
    """
    notebook = jupytext.read(demo)
    # a notebook does not know its own file, from which demos find the scenes
    where = nbformat.v4.new_code_cell(f"__file__ = {os.path.relpath(demo, HERE)!r}")
    where.metadata["tags"] = ["remove-cell"]
    notebook.cells.insert(0, where)
    notebook.metadata["kernelspec"] = {
        "name": "python3",
        "display_name": "Python 3",
        "language": "python",
    }
    client = NotebookClient(notebook, timeout=LONGEST, resources={"metadata": {"path": str(HERE)}})
    client.execute()
    file = folder / f"{demo.stem}.ipynb"
    nbformat.write(notebook, file)
    return file


def main(names: list[str], folder: Path = HERE / "notebooks") -> int:
    """Make the notebooks of some demos, or of all; exit code 2 where one is not known."""
    known = {demo.stem: demo for demo in sorted(DEMOS.glob("*.py"))}
    unknown = [name for name in names if name not in known]
    if unknown:
        print(f"unknown demo {unknown[0]!r}: expected one of {', '.join(known)}", file=sys.stderr)
        return 2
    folder.mkdir(exist_ok=True)
    for name in names or known:
        file = make_notebook(known[name], folder)
        print(file.relative_to(HERE) if file.is_relative_to(HERE) else file, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
