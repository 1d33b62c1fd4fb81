"""Programs that tests start by themselves, alone or on several ranks."""

from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Sequence
from pathlib import Path

MPI_VARIABLES = ("OMPI_", "PMIX_", "PRTE_", "ORTE_", "PMI_")
# Tests run beside others, one on each core: ranks that wait leave theirs to them. Two ranks that draw
# a mesh and find its modes took 22 s of CPU without it, 9 s with it.
WAITING = {"OMPI_MCA_mpi_yield_when_idle": "1"}
USER_SETTINGS = ("OMPI_ALLOW", "OMPI_MCA_mpi_yield", "OMPI_MCA_btl")


def clean_environment() -> dict[str, str]:
    """The environment without what tells a process that it is a rank: mpirun refuses to start
    inside one.
    """
    return {
        name: value
        for name, value in os.environ.items()
        if not name.startswith(MPI_VARIABLES) or name.startswith(USER_SETTINGS)
    }


def on_ranks(ranks: int, command: Sequence[str]) -> list[str]:
    """The command on some ranks, as a process of its own on one."""
    if ranks == 1:
        return list(command)
    return ["mpirun", "--oversubscribe", "--bind-to", "none", "-n", str(ranks), *command]


def run_on_ranks(
    ranks: int,
    command: Sequence[str],
    *,
    timeout: float,
    cwd: Path | None = None,
    variables: dict[str, str] | None = None,
) -> subprocess.CompletedProcess[str]:
    """What the command printed on some ranks, and its return code.

    It runs in a session of its own, which is killed as a whole when the time is up: the ranks of an
    mpirun that was killed alone would keep its pipes open, and reading them would never end.

    Args:
        timeout: [s].
        variables: of the environment, on top of the clean one.

    Raises:
        subprocess.TimeoutExpired: with what was printed up to then.
    """
    whole = on_ranks(ranks, command)
    with subprocess.Popen(
        whole,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=cwd,
        env={**clean_environment(), **WAITING, **(variables or {})},
        start_new_session=True,
    ) as process:
        try:
            out, error = process.communicate(timeout=timeout)
        except BaseException as reason:
            _kill_session(process.pid)
            out, error = process.communicate()
            if isinstance(reason, subprocess.TimeoutExpired):
                raise subprocess.TimeoutExpired(whole, timeout, out, error) from None
            raise
    return subprocess.CompletedProcess(whole, process.returncode, out, error)


def _kill_session(session: int) -> None:
    """Kill every process of a session: mpirun puts each rank into a group of its own."""
    for entry in Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        try:
            # after the name in brackets: state, parent, group, session
            fields = (entry / "stat").read_text().rpartition(")")[2].split()
            if int(fields[3]) == session:
                os.kill(int(entry.name), signal.SIGKILL)
        except (OSError, IndexError):
            # ended in the meantime
            continue
