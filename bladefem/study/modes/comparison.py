"""Modes for a report: MAC between runs and meshes, names of mode families, participation, effective
mass.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from bladefem.data import ModeSet
from geometry.mesh import Mesh

from ...errors import InputError
from .mesh_transfer import nodal_volumes, transfer_fields

ORDINALS = ("first", "second", "third", "fourth", "fifth")
# Roots of cos(b) cosh(b) = -1, the clamped-free beam (Blevins, Formulas for Natural Frequency,
# Table 8-1).
BEAM_ROOTS = (
    1.875104068711961,
    4.694091132974175,
    7.854757438237613,
    10.995540734875467,
    14.137168391046471,
)
RADIAL_SLICES = 16


def mac(
    a: ModeSet,
    b: ModeSet,
    mesh: Mesh | None = None,
    other: Mesh | None = None,
) -> np.ndarray:
    """Modal assurance criterion between the modes of two runs, (modes of a, modes of b), 1 for
    equal shapes.

    |a^H W b|^2 / (a^H W a)(b^H W b), W the nodes' shares of the volume (Allemang and Brown, IMAC
    1982); independent of the phase of complex modes.

    Args:
        a, b: mode sets.
        mesh: the mesh of ``a``; without it all nodes weigh the same.
        other: the mesh of ``b`` when it is another one; its shapes are interpolated onto ``mesh``.
    """
    shapes = b.shapes
    if other is not None:
        if mesh is None:
            raise InputError("mac: expected the meshes of both mode sets, only one was given")
        shapes = transfer_fields(other, shapes, mesh.points)
    weight = np.ones(a.shapes.shape[1]) if mesh is None else nodal_volumes(mesh)
    return mac_of(a.shapes, shapes, weight)


def mac_of(
    a: np.ndarray,
    b: np.ndarray,
    weight: np.ndarray,
) -> np.ndarray:
    """(p, q) MAC of fields (p, n, 3) and (q, n, 3) with weights (n,)."""
    product = np.einsum("pni,n,qni->pq", a.conj(), weight, b, optimize=True)
    length = [np.einsum("pni,n,pni->p", x.conj(), weight, x, optimize=True).real for x in (a, b)]
    scale = np.outer(*length)
    return np.divide(np.abs(product) ** 2, scale, out=np.zeros(product.shape), where=scale > 0)


def blade_root(mesh: Mesh) -> float:
    """Height x [m] where the bending part starts: of a wheel the foot of the aerofoil, else the
    clamped face.
    """
    sides = _heights(mesh, ("pressure_side", "suction_side"))
    if sides.size and (_is_wheel(mesh) or "clamp" not in mesh.faces):
        return float(sides.min())
    if "clamp" in mesh.faces:
        return float(mesh.points[mesh.faces["clamp"].ravel(), 0].max())
    return float(mesh.points[:, 0].min())


def naming_root(mesh: Mesh) -> float:
    """Height x [m] above which modes are named: that of ``blade_root``; of a wheel whose mesh names
    no side of the aerofoil the outer end of the platform's seats, where it names these: down to
    the bore the motion is no clamped beam's.
    """
    seats = _heights(mesh, ("seat_left", "seat_right"))
    if (
        _is_wheel(mesh)
        and seats.size
        and not _heights(mesh, ("pressure_side", "suction_side")).size
    ):
        return float(seats.max())
    return blade_root(mesh)


def _is_wheel(mesh: Mesh) -> bool:
    return mesh.sector is not None and mesh.sector.count > 0


def _heights(mesh: Mesh, names: Sequence[str]) -> np.ndarray:
    """(n,) x [m] of the nodes of those of the faces that the mesh names."""
    faces = [mesh.faces[name].ravel() for name in names if name in mesh.faces]
    return np.concatenate([mesh.points[face, 0] for face in faces]) if faces else np.zeros(0)


def beam_function(order: int, s: np.ndarray) -> np.ndarray:
    """Bending shape of the clamped-free beam, order counted from 0, s = 0 at the root and 1 at the
    tip.
    """
    b = BEAM_ROOTS[order]
    ratio = (np.cosh(b) + np.cos(b)) / (np.sinh(b) + np.sin(b))
    return np.cosh(b * s) - np.cos(b * s) - ratio * (np.sinh(b * s) - np.sin(b * s))


def section_axes(points: np.ndarray, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Centre (n, 3) and thin direction (n, 3) of the section at each point, from slices along the
    span.
    """
    edges = np.linspace(0.0, 1.0, RADIAL_SLICES + 1)
    slices = np.clip(np.digitize(s, edges) - 1, 0, RADIAL_SLICES - 1)
    height = []
    centre = []
    angle = []
    for k in np.unique(slices):
        part = points[slices == k]
        values, vectors = np.linalg.eigh(np.cov(part[:, 1:].T) if len(part) > 2 else np.eye(2))
        if values[1] > 1.0001 * values[0]:
            height.append(s[slices == k].mean())
            centre.append(0.5 * (part.max(axis=0) + part.min(axis=0)))
            angle.append(np.arctan2(vectors[1, 0], vectors[0, 0]))
    # round or square: no thin direction
    if not height:
        thin = np.tile([0.0, 1.0, 0.0], (len(points), 1))
        return np.tile(points.mean(axis=0), (len(points), 1)), thin
    turn = np.interp(s, height, np.unwrap(angle, period=np.pi))
    middle = np.stack([np.interp(s, height, c) for c in np.array(centre).T], axis=1)
    return middle, np.stack([np.zeros_like(turn), np.cos(turn), np.sin(turn)], axis=1)


def pure_shapes(
    mesh: Mesh,
    nodes: np.ndarray,
    root: float,
    orders: int = 4,
) -> dict[str, np.ndarray]:
    """Names and fields (n, 3) of ideal blade motions on ``nodes``: flap, edge, torsion, stretch of
    a clamped beam.

    Flap moves each section along its thin direction, edge along its chord; both turn with the twist
    of the blade.
    """
    points = mesh.points[nodes]
    s = np.clip((points[:, 0] - root) / max(np.ptp(points[:, 0]), 1e-300), 0.0, 1.0)
    radial = np.array([1.0, 0.0, 0.0])
    if mesh.dimension == 2:
        middle = points
        thin = np.tile([0.0, 1.0, 0.0], (len(points), 1))
    else:
        middle, thin = section_axes(points, s)
    chord = np.cross(thin, radial)
    shapes = {}
    for k in range(orders):
        bend = beam_function(k, s)[:, None]
        turn = np.sin((k + 0.5) * np.pi * s)[:, None]
        shapes[f"{ORDINALS[k]} flap"] = bend * thin
        shapes[f"{ORDINALS[k]} stretch"] = turn * radial
        if mesh.dimension == 3:
            shapes[f"{ORDINALS[k]} edge"] = bend * chord
            shapes[f"{ORDINALS[k]} torsion"] = turn * np.cross(radial, points - middle)
    return shapes


@dataclass(frozen=True)
class FamilyReferences:
    """The motions that modes of a mesh are named after; see `family_table`."""

    # one a reference
    names: list[str]
    # (r, n, 3) on the nodes of the aerofoil
    shapes: np.ndarray
    # (n,) numbers of these nodes
    nodes: np.ndarray
    # (n_points,) shares of the mesh's volume [m^3]
    volumes: np.ndarray
    # of modes that are not the aerofoil's
    below: str


def family_references(
    mesh: Mesh,
    clamped: ModeSet | None = None,
    root: float | None = None,
) -> FamilyReferences:
    """What serves all mode sets of a mesh; arguments as of `family_table`."""
    root = naming_root(mesh) if root is None else root
    nodes = np.unique(mesh.bodies.get("blade", np.concatenate(list(mesh.bodies.values()))))
    nodes = nodes[mesh.points[nodes, 0] >= root]
    pure = pure_shapes(mesh, nodes, root)
    below = "disc" if _is_wheel(mesh) else "foot"
    own = FamilyReferences(
        list(pure), np.stack(list(pure.values())), nodes, nodal_volumes(mesh), below
    )
    if clamped is None:
        return own
    found = name_modes(clamped, own)["family"]
    return replace(
        own,
        names=[*own.names, *(name.removesuffix(", coupled") for name in found)],
        shapes=np.concatenate([own.shapes, clamped.shapes[:, nodes]]),
    )


def family_table(
    modes: ModeSet,
    mesh: Mesh,
    clamped: ModeSet | None = None,
    root: float | None = None,
) -> pd.DataFrame:
    """Names of the modes: one row a mode with frequency [Hz], family, MAC against it, and the
    aerofoil's share.

    A mode is called after the mode of the clamped blade (itself named so) or the pure motion that
    it is closest to by MAC on the aerofoil; "..., coupled" when another mode of that name is
    closer, "mixed" when no MAC reaches 0.3, "disc" ("foot" of a single blade) when the aerofoil
    carries less than a tenth of the motion. Where the platform gives way, modes that the clamp
    mixes come apart, and the pure motion is the closer one.

    Args:
        modes: shapes on the nodes of ``mesh``.
        mesh: sector or blade.
        clamped: modes of the blade clamped at its root, on the same nodes, as references next to
            pure motions.
        root: height x of the aerofoil's root [m]; found from the named faces when left out.
    """
    return name_modes(modes, family_references(mesh, clamped, root))


def name_modes(modes: ModeSet, references: FamilyReferences) -> pd.DataFrame:
    """`family_table` of one of several mode sets of a mesh."""
    names, nodes, volumes = references.names, references.nodes, references.volumes
    match = mac_of(modes.shapes[:, nodes], references.shapes, volumes[nodes])
    match[:, [name == "mixed" for name in names]] = 0.0
    energy = volumes * np.square(np.abs(modes.shapes)).sum(axis=2)
    share = energy[:, nodes].sum(axis=1) / np.maximum(energy.sum(axis=1), 1e-300)
    below = references.below
    return pd.DataFrame(
        {
            "mode": np.arange(1, len(match) + 1),
            "frequency": modes.frequencies,
            "family": family_names(match, names, share, below),
            "mac": match.max(axis=1),
            "aerofoil_share": share,
        }
    )


def family_names(
    match: np.ndarray,
    names: Sequence[str],
    share: np.ndarray,
    below: str,
) -> list[str]:
    """Names of the modes from the MAC (modes, references), the references' names and the aerofoil's
    share.
    """
    best = match.max(axis=1)
    own = [names[k] for k in match.argmax(axis=1)]
    own = [
        below if share[i] < 0.1 else name if best[i] >= 0.3 else "mixed"
        for i, name in enumerate(own)
    ]
    closer = [
        any(other == name and best[k] > best[i] for k, other in enumerate(own))
        for i, name in enumerate(own)
    ]
    return [
        f"{name}, coupled" if again and name not in ("mixed", below) else name
        for name, again in zip(own, closer, strict=True)
    ]


def rigid_motion(points: np.ndarray, direction: str) -> np.ndarray:
    """(n, 3) unit translation "x" or unit rotation "rx" about the origin."""
    axis = np.eye(3)["xyz".index(direction[-1])]
    return np.cross(axis, points) if direction.startswith("r") else np.tile(axis, (len(points), 1))
