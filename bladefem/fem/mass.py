"""The mass matrix of a body, made whole when it is asked for: of one direction it has a third of
the entries, and modes of a wheel need no others.
"""

from __future__ import annotations

from dataclasses import dataclass

from .compat import PETSc, repeat_components


@dataclass
class Mass:
    """Mass [kg], whole, or of one direction as long as nobody needs more."""

    # displacement components of a node
    dim: int
    # (n, n), n nodes, the same for each direction
    of_one_direction: PETSc.Mat | None = None
    # (dim*n, dim*n), block size dim
    whole: PETSc.Mat | None = None

    def matrix(self) -> PETSc.Mat:
        """The whole matrix (collective where it is not there yet)."""
        if self.whole is None:
            assert self.of_one_direction is not None
            self.whole = repeat_components(self.of_one_direction, self.dim)
            # destroyed
            self.of_one_direction = None
        return self.whole
