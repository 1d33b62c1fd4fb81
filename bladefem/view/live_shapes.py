"""Mode shapes and motions for a page with script: the skin once, each shape in 16-bit numbers."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bladefem.data import ModeSet
from bladefem.util.arrays import ComplexArray, IntegerArray, RealArray
from geometry.mesh import Mesh

from .mesh import view_of
from .modes import best_phase, mode_title, moving_bodies, scale_of
from .motion import amplitude_of, drawn_factor, extreme_phase
from .skin import skin

# triangles that a browser still turns smoothly
MOST_TRIANGLES = 60_000
LARGEST_INT16 = 32767
# of the largest displacement: harmonics below it are not seen in the picture
HARMONIC_SHARE = 0.005
# modes that a page shows in motion
LIVE_SHAPES = 4


def live_shapes(
    mesh: Mesh,
    modes: ModeSet,
    families: Sequence[str] = (),
) -> dict[str, Any] | None:
    """Skin and shapes, for ``page.js``; None where the skin has too many triangles for a page.

    The displacement at phase phi is Re(shape e^{j phi}), at phi = 0 the largest real part.

    Args:
        mesh: the sector or body.
        modes: shapes on the nodes of ``mesh``.
        families: names of the modes, where known.
    """
    shown = range(min(LIVE_SHAPES, len(modes.frequencies)))
    if not shown:
        return None
    surface = skin(moving_bodies(mesh, modes.shapes[0]), coarse=True)
    if len(surface.triangles) > MOST_TRIANGLES:
        return None
    found = []
    for i in shown:
        shape = modes.shapes[i] * best_phase(modes.shapes[i])
        drawn = scale_of(mesh, shape) * shape[surface.nodes]
        found.append(
            {
                "title": mode_title(modes, i, families[i] if i < len(families) else ""),
                "harmonics": [{"order": 1, **packed_shape(drawn)}],
            }
        )
    return {
        "kind": "shape",
        "choice": "mode",
        "points": pack_numbers(surface.points, np.float32),
        "triangles": pack_numbers(surface.triangles, np.uint32),
        "modes": found,
        "eye": [float(x) for x in view_of(mesh)],
        "up": [1.0, 0.0, 0.0],
    }


def live_motion(
    mesh: Mesh,
    motions: Mapping[str, ComplexArray],
) -> dict[str, Any] | None:
    """Skin and motions of several harmonics, for ``page.js``; None where the skin has too many
    triangles for a page.

    The displacement at phase phi is Re(sum over h of U_h e^{j h phi}).

    Args:
        mesh: the sector or body.
        motions: title -> (H, n_points, dim) complex displacements of harmonics 1..H [m].
    """
    first = next(iter(motions.values()), None)
    if first is None:
        return None
    surface = skin(moving_bodies(mesh, amplitude_of(first)), coarse=True)
    if len(surface.triangles) > MOST_TRIANGLES:
        return None
    return {
        "kind": "shape",
        "choice": "load",
        "points": pack_numbers(surface.points, np.float32),
        "triangles": pack_numbers(surface.triangles, np.uint32),
        "modes": [
            {"title": title, **_packed_motion(mesh, motion, surface.nodes)}
            for title, motion in motions.items()
        ],
        "eye": [float(x) for x in view_of(mesh)],
        "up": [1.0, 0.0, 0.0],
    }


def _packed_motion(mesh: Mesh, motion: ComplexArray, nodes: IntegerArray) -> dict[str, Any]:
    """Harmonics as drawn, the largest amplitude of a node [µm], and the phase to begin with."""
    amplitude = amplitude_of(motion)
    factor = drawn_factor(mesh, motion)
    sizes = np.abs(motion).max(axis=(1, 2))
    kept = np.flatnonzero(sizes > HARMONIC_SHARE * sizes.max(initial=0.0))
    packed = [
        {"order": int(h) + 1, **packed_shape(factor * _solid(motion[h])[nodes])} for h in kept
    ]
    return {
        "amplitude": 1e6 * float(amplitude.max(initial=0.0)),
        "start": round(np.degrees(extreme_phase(motion)) / 5) * 5 % 360,
        "harmonics": packed,
    }


def _solid(field: ComplexArray) -> ComplexArray:
    """(n, 3) of a field that may be plane."""
    return np.pad(field, ((0, 0), (0, 3 - field.shape[1])))


def packed_shape(drawn: ComplexArray | RealArray) -> dict[str, Any]:
    """Real and imaginary displacement as drawn [m], in shares of their largest component."""
    largest = float(max(np.abs(drawn.real).max(), np.abs(drawn.imag).max(), 1e-300))
    parts = {
        "scale": largest / LARGEST_INT16,
        "real": pack_numbers(drawn.real * LARGEST_INT16 / largest, np.int16),
    }
    if np.iscomplexobj(drawn) and np.abs(drawn.imag).max() > 1e-6 * largest:
        parts["imaginary"] = pack_numbers(drawn.imag * LARGEST_INT16 / largest, np.int16)
    return parts


def pack_numbers(values: np.ndarray, kind: type) -> str:
    """Little-endian numbers in base64; whole ones rounded."""
    array = np.round(values) if np.issubdtype(kind, np.integer) else values
    return base64.b64encode(np.ascontiguousarray(array, dtype=kind).tobytes()).decode()
