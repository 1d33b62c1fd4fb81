"""Mode shapes for a page with script: the skin once, each shape in 16-bit numbers."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from typing import Any

import numpy as np

from bladefem.data import ModeSet
from geometry.mesh import Mesh

from .mesh import view_of
from .modes import best_phase, mode_title, moving, scale_of
from .skin import skin

# triangles that a browser still turns smoothly
MOST_TRIANGLES = 60_000
LARGEST = 32767


def live_shapes(
    mesh: Mesh,
    modes: ModeSet,
    families: Sequence[str] = (),
    count: int = 4,
) -> dict[str, Any] | None:
    """Skin and shapes, for ``page.js``; None where the skin has too many triangles for a page.

    The displacement at phase phi is Re(shape e^{j phi}), at phi = 0 the largest real part.

    Args:
        mesh: the sector or body.
        modes: shapes on the nodes of ``mesh``.
        families: names of the modes, where known.
        count: how many of them.
    """
    shown = range(min(count, len(modes.frequencies)))
    if not shown:
        return None
    surface = skin(moving(mesh, modes.shapes[0]), coarse=True)
    if len(surface.triangles) > MOST_TRIANGLES:
        return None
    found = []
    for i in shown:
        shape = modes.shapes[i] * best_phase(modes.shapes[i])
        drawn = scale_of(mesh, shape) * shape[surface.nodes]
        found.append(
            {
                "title": mode_title(modes, i, families[i] if i < len(families) else ""),
                **_packed_shape(drawn),
            }
        )
    return {
        "kind": "shape",
        "points": _pack_numbers(surface.points, np.float32),
        "triangles": _pack_numbers(surface.triangles, np.uint32),
        "modes": found,
        "eye": [float(x) for x in view_of(mesh)],
        "up": [1.0, 0.0, 0.0],
    }


def _packed_shape(drawn: np.ndarray) -> dict[str, Any]:
    """Real and imaginary displacement as drawn [m], in shares of their largest component."""
    largest = float(max(np.abs(drawn.real).max(), np.abs(drawn.imag).max(), 1e-300))
    parts = {
        "scale": largest / LARGEST,
        "real": _pack_numbers(drawn.real * LARGEST / largest, np.int16),
    }
    if np.iscomplexobj(drawn) and np.abs(drawn.imag).max() > 1e-6 * largest:
        parts["imaginary"] = _pack_numbers(drawn.imag * LARGEST / largest, np.int16)
    return parts


def _pack_numbers(values: np.ndarray, kind: type) -> str:
    """Little-endian numbers in base64; whole ones rounded."""
    array = np.round(values) if np.issubdtype(kind, np.integer) else values
    return base64.b64encode(np.ascontiguousarray(array, dtype=kind).tobytes()).decode()
