"""Demos as notebooks: executed, with their output and without an error."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

MISSING = "./run notebooks plain_matrices installs what this needs"
for package in ("ipykernel", "jupytext", "nbclient"):
    pytest.importorskip(package, reason=MISSING)
nbformat = pytest.importorskip("nbformat", reason=MISSING)

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def maker():
    """The script of the pages' folder, which is no package."""
    spec = importlib.util.spec_from_file_location(
        "make_notebooks", ROOT / "docs" / "make_notebooks.py"
    )
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def notebook(maker, tmp_path_factory):
    folder = tmp_path_factory.mktemp("notebooks")
    assert maker.main(["plain_matrices"], folder) == 0
    return nbformat.read(folder / "plain_matrices.ipynb", as_version=4)


def test_every_code_cell_ran_and_none_raised(notebook):
    nbformat.validate(notebook)
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert [cell.execution_count for cell in cells] == list(range(1, len(cells) + 1))
    kinds = {output.output_type for cell in cells for output in cell.outputs}
    assert kinds == {"stream"}


def test_the_demos_prose_and_last_number_are_in_it(notebook):
    prose = [cell.source for cell in notebook.cells if cell.cell_type == "markdown"]
    assert prose[0].startswith("# A friction damper on matrices of your own")
    printed = notebook.cells[-1].outputs[-1].text
    assert float(printed.split(":")[-1]) == pytest.approx(3.8433283, rel=5e-3)


def test_a_cell_that_raises_stops_the_notebook(maker, tmp_path):
    from nbclient.exceptions import CellExecutionError

    demo = maker.DEMOS / "plain_matrices.py"
    broken = tmp_path / "broken.py"
    broken.write_text(demo.read_text("utf-8").replace("K = np.array", "K = no_such_name"), "utf-8")
    with pytest.raises(CellExecutionError, match="no_such_name"):
        maker.make_notebook(broken, tmp_path)
    assert not (tmp_path / "broken.ipynb").exists()


def test_an_unknown_demo_is_refused(maker, tmp_path, capsys):
    assert maker.main(["plain_matrix"], tmp_path) == 2
    assert "unknown demo 'plain_matrix': expected one of" in capsys.readouterr().err
