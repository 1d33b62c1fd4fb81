"""Compiling for longer than two seconds is said once, on one rank."""

from types import SimpleNamespace

import numba
import pytest
from numba.core import event

from bladefem.util import compile_notice
from bladefem.util.compile_notice import COMPILATION, NOTICE, CompileNotice, announce_compilation

# what numba says of a compilation
KERNEL = SimpleNamespace(
    data={"dispatcher": SimpleNamespace(py_func=SimpleNamespace(__module__="bladefem.hbm.kernel"))}
)


@pytest.mark.parametrize(
    ("moments", "said"),
    [
        # begin and end of two short compilations, far apart
        ([("start", 0.0), ("end", 0.9), ("start", 50.0), ("end", 50.9)], 0),
        # three that take 2.7 s together, then a fourth one
        ([(what, t) for k in range(4) for what, t in (("start", 9 * k), ("end", 9 * k + 0.9))], 1),
        # one that asks for another before it ends
        ([("start", 0.0), ("start", 2.5), ("end", 3.0), ("end", 4.0)], 1),
    ],
)
def test_the_time_of_compilations_is_summed(moments, said):
    lines = []
    clock = [0.0]
    notice = CompileNotice(lines.append, lambda: clock[0])
    for what, clock[0] in moments:
        (notice.on_start if what == "start" else notice.on_end)(KERNEL)
    assert lines == [NOTICE] * said


def test_a_loop_that_numba_takes_out_of_a_function_is_no_kernel_of_ours():
    """Its compilation has no Python function."""
    loop = SimpleNamespace(data={"dispatcher": SimpleNamespace(py_func=None)})
    lines = []
    notice = CompileNotice(lines.append, iter([0.0, 9.0]).__next__)
    notice.on_start(loop)
    notice.on_end(loop)
    assert not lines


@pytest.mark.parametrize(
    ("rank", "module", "said"),
    [("0", "bladefem.kernels", 1), ("1", "bladefem.kernels", 0), ("0", "users_script", 0)],
)
def test_numba_tells_of_its_compilations(rank, module, said, monkeypatch, capsys):
    """Those of kernels, not of functions that users compile themselves."""
    monkeypatch.setenv("OMPI_COMM_WORLD_RANK", rank)
    monkeypatch.setattr(compile_notice, "SILENT_SECONDS", -1.0)
    added = []
    with monkeypatch.context() as patch:
        patch.setattr(event, "register", lambda kind, one: added.append((kind, one)))
        announce_compilation()
    assert [kind for kind, _ in added] == [COMPILATION] * (rank == "0")
    # the notice of this process, registered when kernels were imported, would speak as well
    monkeypatch.setitem(event._registered, COMPILATION, [])
    for each in added:
        event.register(*each)

    def compiled(x):
        return x + 1

    compiled.__module__ = module
    numba.njit(compiled)(1)
    for each in added:
        event.unregister(*each)
    assert capsys.readouterr().err.count(NOTICE) == said
