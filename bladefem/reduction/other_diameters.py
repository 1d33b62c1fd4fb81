"""A cyclic sector in nodal diameters that were not reduced: from what the modes of those that were
span.

Its matrices in diameter n are A0 + cos(a) A1 + i sin(a) A2, a = 2 pi n / N, so that their
projections on one space serve all n: modes are those of a small pencil (Galerkin). What the space
misses of the static flexibility is local, and is taken from the nearest diameter that was reduced.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy import linalg

from ..data import PortModel, SectorSpan
from ..util.arrays import ComplexArray, RealArray

# of a stiffness that rounding leaves of a rigid motion
RIGID_SHARE = 1e-9


def spanned_models(
    span: SectorSpan,
    known: Mapping[int, PortModel],
    sectors: int,
    count: int,
) -> dict[int, PortModel]:
    """The sector in all nodal diameters 0..N/2: those known as they are, the others from the span;
    without damping of their own.

    Args:
        known: with as many modes as there are, none rigid; at least one.
        count: modes kept of each of the others.
    """
    missed = {n: _missed_flexibility(span, body, n, sectors) for n, body in known.items()}
    found = {}
    for n in range(sectors // 2 + 1):
        if n in known:
            found[n] = known[n]
            continue
        near = min(known, key=lambda other: abs(other - n))
        lam, shapes = _spanned_modes(span, n, sectors)
        high = shapes[:, count:]
        residual = missed[near] + (high / lam[count:]) @ high.conj().T
        found[n] = PortModel(
            np.sqrt(lam[:count]),
            shapes[:, :count],
            (residual + residual.conj().T) / 2,
            known[near].ports,
            n,
        )
    return found


def has_rigid_motion(known: Mapping[int, PortModel]) -> bool:
    """Some nodal diameter has a mode that nothing holds."""
    return any((body.omega <= RIGID_SHARE * body.omega.max()).any() for body in known.values())


def _missed_flexibility(
    span: SectorSpan,
    body: PortModel,
    n: int,
    sectors: int,
) -> ComplexArray:
    """(p, p) static flexibility of a nodal diameter less what the span has of it [m/N]."""
    lam, shapes = _spanned_modes(span, n, sectors)
    whole = body.residual + (body.shapes / body.omega**2) @ body.shapes.conj().T
    return np.asarray(whole - (shapes / lam) @ shapes.conj().T)


def _spanned_modes(
    span: SectorSpan,
    n: int,
    sectors: int,
) -> tuple[RealArray, ComplexArray]:
    """(m,) squared circular frequencies and (p, m) shapes at the ports of the span's modes."""
    angle = 2 * np.pi * n / sectors
    K, M = (
        parts[0] + np.cos(angle) * parts[1] + 1j * np.sin(angle) * parts[2]
        for parts in (span.stiffness, span.mass)
    )
    lam, Z = linalg.eigh((K + K.conj().T) / 2, (M + M.conj().T) / 2)
    return lam, (span.own + np.exp(1j * angle) * span.next) @ Z
