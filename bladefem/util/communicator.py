"""What the package needs of an MPI communicator, so that only its finite elements know MPI."""

from __future__ import annotations

from typing import Any, Protocol


class Communicator(Protocol):
    """Ranks that work together; mpi4py's communicators are such ones."""

    @property
    def rank(self) -> int:
        """Number of this one."""

    @property
    def size(self) -> int:
        """How many there are."""

    def bcast(self, obj: Any, root: int = 0) -> Any:
        """What one rank has, on all of them."""

    def gather(self, sendobj: Any, root: int = 0) -> list[Any] | None:
        """What each rank has, on one of them; None on the others."""

    def allgather(self, sendobj: Any) -> list[Any]:
        """What each rank has, on all of them."""

    def allreduce(self, sendobj: Any, op: Any = ...) -> Any:
        """The sum of what the ranks have, or what ``op`` makes of it, on all of them."""
