"""What holds for every test: a skip is a failure, and on several ranks each failure says which rank
it was on.
"""

from __future__ import annotations

import gc
import os
import pickle
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

RANK = int(os.environ.get("OMPI_COMM_WORLD_RANK", os.environ.get("PMI_RANK", 0)))
# Their tests take 10 s to a minute each. Begun first, none of them is what one worker does alone at
# the end while the others have nothing left.
LONG_FILES = frozenset(
    {
        "test_demos.py",
        # shares its wheel with the next one
        "test_mistuned_in_time.py",
        "test_mistuned_scene.py",
        "test_paper_demos.py",
        "test_scatter_on_ranks.py",
        "test_scatter_resumed.py",
        "test_shared_wheel.py",
        "test_walking_dampers.py",
    }
)
SIZE = int(os.environ.get("OMPI_COMM_WORLD_SIZE", os.environ.get("PMI_SIZE", 1)))


@pytest.hookimpl(trylast=True)
def pytest_configure(config: pytest.Config) -> None:
    """Only rank 0 writes the usual report."""
    if RANK > 0:
        config.pluginmanager.unregister(config.pluginmanager.getplugin("terminalreporter"))


def pytest_ignore_collect(collection_path: Path) -> bool | None:
    """On several ranks files without a collective test are not even imported: most of the time
    before the first test.
    """
    if SIZE == 1 or collection_path.suffix != ".py":
        return None
    return "mark.mpi" not in collection_path.read_text("utf-8") or None


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """The longest files first, the order within them and of the others as it was."""
    items.sort(key=lambda item: item.path.name not in LONG_FILES)


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """The other ranks tell their failures only."""
    if RANK > 0 and report.failed:
        print(f"\nrank {RANK}: {report.nodeid}\n{report.longreprtext}", file=sys.stderr, flush=True)


def _refuse_skip(report: pytest.TestReport | pytest.CollectReport) -> None:
    if report.skipped and not hasattr(report, "wasxfail"):
        report.outcome = "failed"
        report.longrepr = (
            f"{report.longrepr}\nA skipped test counts as failed: what it needs is part of the "
            "set-up."
        )


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item, call):
    """A test that skips itself fails."""
    outcome = yield
    _refuse_skip(outcome.get_result())


@pytest.hookimpl(hookwrapper=True)
def pytest_make_collect_report(collector):
    """A file that skips itself fails."""
    outcome = yield
    _refuse_skip(outcome.get_result())


@pytest.fixture(scope="session", autouse=True)
def _meshes_drawn_once(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """A mesh that several tests begin with is drawn once, for all workers.

    Drawing one takes a process and a second of CPU or more. That a mesh depends on nothing but its
    key is what `tests/io/test_stage_inputs.py` shows; tests of the drawing itself call
    `build_isolated` or `build_here`, which they have imported by now.
    """
    from bladefem.study.pipeline.stage_inputs import stage_key
    from geometry import isolated_process

    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "drawn_meshes"
    folder.mkdir(exist_ok=True)
    draw = isolated_process.build_isolated

    def drawn_once(scene):
        file = folder / stage_key("mesh", scene)
        if file.exists():
            return pickle.loads(file.read_bytes())
        mesh = draw(scene)
        # the other worker may draw the same one
        part = file.with_suffix(f".{os.getpid()}")
        part.write_bytes(pickle.dumps(mesh, pickle.HIGHEST_PROTOCOL))
        part.replace(file)
        return mesh

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(isolated_process, "build_isolated", drawn_once)
        yield


@pytest.fixture(autouse=SIZE > 1)
def _collect_together():
    """PETSc frees its objects collectively: all ranks do it at the same moment."""
    yield
    if SIZE > 1:
        gc.collect()
        from mpi4py import MPI

        MPI.COMM_WORLD.Barrier()
