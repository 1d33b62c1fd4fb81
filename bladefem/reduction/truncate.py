"""Fewer modes without a new reduction: what a mode left out gives statically goes into the residual
flexibility.
"""

from __future__ import annotations

from dataclasses import replace

from ..data import PortModel


def truncate_modes(body: PortModel, count: int) -> PortModel:
    """The body with its lowest `count` modes; exactly what a Rubin reduction with `count`
    modes would give.
    """
    if count >= len(body.omega):
        return body
    left_out = slice(max(count, int((body.omega == 0).sum())), None)
    high = body.shapes[:, left_out]
    omega = body.omega[left_out]
    kept = slice(left_out.start)
    damping = None if body.damping is None else body.damping[(kept,) * body.damping.ndim]
    return replace(
        body,
        omega=body.omega[kept],
        shapes=body.shapes[:, kept],
        residual=body.residual + (high / omega**2) @ high.conj().T,
        damping=damping,
        circulatory=None if body.circulatory is None else body.circulatory[kept, kept],
    )
