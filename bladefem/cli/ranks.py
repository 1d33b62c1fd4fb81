"""Errors of a command as one sentence and an exit code, on one rank or on many: no rank waits for
ever for another. Ranks beyond the machine's cores wait without taking one from the others.
"""

from __future__ import annotations

import argparse
import errno
import os
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from typing import Any

from ..errors import InputError, NotSolvedError
from ..util.communicator import Communicator
from ..util.cores import VARIABLE, ranks_with_cores

# [s] that a failed rank waits for the others to fail as well
WAIT_FOR_RANKS_SECONDS = 10.0
# [s] after which a signal that got lost comes again
REPEAT_SECONDS = 0.1
# [s] between two looks of a rank without a core
IDLE_SECONDS = 0.05
# of the message by which such a rank learns the exit code
CODE_TAG = 1
# what an interrupted command keeps besides its finished stages
ALSO_KEPT = {"scatter": ", each finished wheel too"}


def communicator() -> Any:
    """All ranks when started by mpirun, else None, so that simple commands do not load MPI.

    Raises:
        InputError: started by mpirun, but mpi4py does not load.
    """
    if max(int(os.environ.get(name, 1)) for name in ("OMPI_COMM_WORLD_SIZE", "PMI_SIZE")) == 1:
        return None
    try:
        from mpi4py import MPI
    except ImportError as error:
        raise InputError(f"mpirun: mpi4py cannot be loaded ({error}); run ./setup.sh") from None
    return MPI.COMM_WORLD


def exit_code_of(action: Callable[[Any], None], options: argparse.Namespace) -> int:
    """The exit code of an action that gets the communicator; errors are reported on rank 0."""
    with _catch_signals() as stopped:
        return _run_guarded(action, stopped, ALSO_KEPT.get(getattr(options, "command", ""), ""))


def _run_guarded(action: Callable[[Any], None], stopped: list[int], also_kept: str) -> int:
    """The exit code of an action on the ranks that have cores of their own, which the others wait
    for.
    """
    comm = None
    try:
        comm = communicator()
        working = ranks_with_cores(comm) if comm else [0]
        if comm is None or len(working) == comm.size:
            return _run_on(comm, action, stopped, also_kept)
        part = comm.Split(0 if comm.rank in working else 1, comm.rank)
        if comm.rank not in working:
            return _wait_for_code(comm)
    except KeyboardInterrupt:
        return _stop_ranks(comm, stopped, also_kept)
    except InputError as error:
        return _print_error(comm, str(error), 2)
    if comm.rank == 0:
        print(
            f"bladefem: {comm.size} ranks, of which {len(working)} have a core and work; "
            f"the others wait ({VARIABLE}=1: all work)",
            file=sys.stderr,
            flush=True,
        )
    code = _run_on(part, partial(_after_petsc, action), stopped, also_kept)
    if comm.rank == 0:
        for rank in sorted(set(range(comm.size)) - set(working)):
            comm.send(code, rank, CODE_TAG)
    return code


def _after_petsc(action: Callable[[Any], None], comm: Any) -> None:
    """The action, once PETSc has started on its ranks: it would wait for all of them later."""
    from ..fem.petsc_start import start_petsc

    start_petsc(comm)
    action(comm)


def _wait_for_code(comm: Any) -> int:
    """The exit code of rank 0, waited for without taking a core from the ranks that work."""
    while not comm.Iprobe(source=0, tag=CODE_TAG):
        time.sleep(IDLE_SECONDS)
    return int(comm.recv(source=0, tag=CODE_TAG))


def _run_on(
    comm: Any,
    action: Callable[[Any], None],
    stopped: list[int],
    also_kept: str,
) -> int:
    """The exit code of an action on these ranks, all of which work."""
    try:
        meeting = comm.Dup() if comm else None
        action(comm)
        return _flush_output()
    except BrokenPipeError:
        return _flush_output()
    except KeyboardInterrupt:
        return _stop_ranks(comm, stopped, also_kept)
    except Exception as error:
        # a library made an error of its own out of the interrupt
        if stopped:
            return _stop_ranks(comm, stopped, also_kept)
        code, text = _error_sentence(error)
        if comm is None:
            return _print_error(None, text, code)
        if comm.rank == 0:
            _print_error(comm, text, code)
        if not _all_arrive(meeting):
            if comm.rank > 0:
                print(f"bladefem: rank {comm.rank} alone: {text}", file=sys.stderr, flush=True)
            comm.Abort(code)
        return code


def _error_sentence(error: Exception) -> tuple[int, str]:
    """Exit code and text: one sentence for what a user can mend, the whole traceback for our own
    mistakes.
    """
    if isinstance(error, InputError):
        return 2, str(error)
    if isinstance(error, NotSolvedError):
        return 1, f"not solved: {error}"
    if isinstance(error, UnicodeEncodeError) and error.encoding == sys.getfilesystemencoding():
        return 2, (
            f"'{error.object}': the names of files are in {error.encoding.upper()} in this locale, "
            "which lacks some of these letters; expected a locale with UTF-8, such as "
            "LC_ALL=C.UTF-8"
        )
    if _is_unwritable(error):
        return 2, f"cannot be written ({error}); finished stages are kept, the same command goes on"
    if isinstance(error, MemoryError):
        return 1, f"not solved: out of memory ({error}); a coarser mesh.size needs less"
    if (
        isinstance(error, ModuleNotFoundError)
        and (error.name or "").partition(".")[0] in _INSTALLED
    ):
        return 2, f"{error.name} is not installed; run ./setup.sh"
    return 1, "this is a mistake in the program, please report it:\n" + "".join(
        traceback.format_exception(error)
    )


def _is_unwritable(error: Exception) -> bool:
    """A full disk, or a place that takes no file: no library says so in words of this program."""
    # HDF5 has the system's words in its own error, without its number
    full = os.strerror(errno.ENOSPC) in str(error)
    return full or (isinstance(error, OSError) and error.errno in UNWRITABLE)


# what the system says of a file that cannot be written
UNWRITABLE = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EACCES, errno.EISDIR)

_INSTALLED = {
    "dolfinx",
    "petsc4py",
    "slepc4py",
    "mpi4py",
    "gmsh",
    "pyvista",
    "matplotlib",
    "numba",
    "xarray",
    "h5py",
    "h5netcdf",
    "pandas",
    "tqdm",
    "meshio",
    "jinja2",
    "scipy",
    "numpy",
}


@contextmanager
def _catch_signals() -> Iterator[list[int]]:
    """The signals that came; a batch system's SIGTERM cleans up like Ctrl-C, to which background
    jobs stay deaf.
    """
    stopped = []
    before = {}

    def stop(number: int, _: Any) -> None:
        stopped.append(number)
        raise KeyboardInterrupt

    def repeat(unraisable: Any) -> None:
        """Python drops what is raised while it takes an object down: the signal is sent again, and
        objects that the interrupt left half made go without a traceback.
        """
        if not stopped:
            usual(unraisable)
        elif issubclass(unraisable.exc_type, KeyboardInterrupt):
            threading.Timer(REPEAT_SECONDS, os.kill, (os.getpid(), stopped[0])).start()

    usual = sys.unraisablehook
    sys.unraisablehook = repeat
    # only a main thread may
    with suppress(ValueError):
        for number in (signal.SIGTERM, signal.SIGINT):
            if number == signal.SIGTERM or signal.getsignal(number) is signal.default_int_handler:
                before[number] = signal.signal(number, stop)
    try:
        yield stopped
    finally:
        sys.unraisablehook = usual
        for number, handler in before.items():
            signal.signal(number, handler)


def _stop_ranks(comm: Communicator | None, signals: list[int], also_kept: str) -> int:
    """Ctrl-C, or the end that a batch system asks for: 128 plus the signal's number, as shells have
    it.
    """
    ended = signal.SIGTERM in signals
    return _print_error(
        comm,
        f"{'ended by SIGTERM' if ended else 'interrupted'}; finished stages are kept{also_kept}; "
        "the same command goes on after them",
        143 if ended else 130,
    )


def _print_error(
    comm: Communicator | None,
    text: str,
    code: int,
) -> int:
    if comm is None or comm.rank == 0:
        print(f"bladefem: {text}", file=sys.stderr, flush=True)
    return code


def _all_arrive(meeting: Any) -> bool:
    """Whether every rank failed as well; else one of them waits in a collective call that will
    never come.
    """
    request = meeting.Ibarrier()
    deadline = time.monotonic() + WAIT_FOR_RANKS_SECONDS
    while not request.Test():
        if time.monotonic() > deadline:
            return False
        time.sleep(0.01)
    return True


def _flush_output() -> int:
    """A reader that closes the pipe early (| head) is no error."""
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return 0
