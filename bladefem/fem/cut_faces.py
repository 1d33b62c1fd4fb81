"""Cut faces of a sector whose nodes do not match, tied by a mortar.

The high face repeats the motion of the low one in the mean: over the overlap of both faces

    integral of N_s (u_high - R u_low) = 0   for each shape function N_s of the high face,

so that u_high = D^-1 M R u_low with the high face's mass D and the coupling M. A linear field is
repeated exactly where both faces lie on one surface; where they are discretised differently on a
curved one, the smallest correction makes rigid motions exact. Source: Puso and Laursen, DOI
10.1016/j.cma.2003.10.010.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from geometry.mesh import Mesh, Pair

from ..errors import InputError
from ..util.arrays import BooleanArray, IntegerArray, RealArray
from .face_elements import corner_count, face_shape_functions
from .face_overlap import Overlap, face_overlap
from .surface import surface_quadrature

# part of the high face that the low one must cover
COVERED_PART = 0.99
# shares of motion below this part of the largest one in their row are left out
SMALLEST_SHARE = 1e-3


@dataclass(frozen=True)
class CutTie:
    """How the high cut face follows the low one, each in its own axes."""

    # (m,) nodes of the low face
    low: IntegerArray
    # (s,) nodes of the high face
    high: IntegerArray
    # (s, m) shares of the low nodes' motion in that of the high ones
    share: RealArray
    # (s, s) mass of the high face, unit density [m^2]
    mass: RealArray
    # (m, 3) places of the low nodes [m]
    places: RealArray


def tie_cut_faces(mesh: Mesh) -> CutTie:
    """The tie of a pair of cut faces.

    Raises:
        InputError: faces that share nodes or do not lie on each other.
    """
    pair = mesh.pairs["cyclic"]
    faces = mesh.faces[pair.master], mesh.faces[pair.slave]
    low, high = (np.unique(face) for face in faces)
    if np.intersect1d(low, high).size:
        raise InputError("the cut faces share nodes (a solid hub on the axis), expected a bore")
    overlap = face_overlap(mesh, "cyclic")
    mass, coupling, covered = _integrals(mesh, overlap, low, high)
    if covered < COVERED_PART:
        raise InputError(
            f"faces '{pair.master}' and '{pair.slave}' do not match and lie on each other with "
            f"{covered:.1%} of their area only, expected cut faces of one shape"
        )
    share = np.asarray(np.linalg.solve(mass, coupling), np.float64)
    share = _exact_for_rigid_motions(mesh, pair, low, high, share)
    return CutTie(low, high, share, mass, mesh.points[low])


def repeated_motion(tie: CutTie, count: int, free: BooleanArray) -> sp.csr_matrix:
    """(n_points, n_points) each high node from the low ones; nodes that are held do not move, and
    the others follow in the mean without them.

    Args:
        count: nodes of the mesh.
        free: (n_points,) nodes that are not held.
    """
    moving = free[tie.high]
    share = tie.share[moving]
    if not moving.all():
        mass = tie.mass[moving]
        held = mass[:, ~moving] @ tie.share[~moving]
        share = share + np.linalg.solve(mass[:, moving], held)
    follows = free[tie.low]
    block = _short_rows(share[:, follows], tie.places[follows]).tocoo()
    rows, columns = tie.high[moving][block.row], tie.low[follows][block.col]
    return sp.csr_matrix((block.data, (rows, columns)), shape=(count, count))


def _short_rows(share: RealArray, places: RealArray) -> sp.csr_matrix:
    """The shares (s, m) without small ones, which fall off along the face but never end: the kept
    ones of a row are corrected so that linear and quadratic fields are repeated as before.

    Args:
        places: (m, 3) of the columns [m].
    """
    if not share.size:
        return sp.csr_matrix(share.shape)
    # of a row with one column
    least = 1e-3 * float(np.ptp(places, axis=0).max())
    rows = []
    for row in share:
        kept = np.flatnonzero(np.abs(row) > SMALLEST_SHARE * np.abs(row).max())
        centre = places[kept].mean(axis=0)
        x = (places - centre) / max(float(np.abs(places[kept] - centre).max()), least)
        fields = np.column_stack(
            [np.ones(len(x)), x, *(x[:, [i]] * x[:, i:] for i in range(x.shape[1]))]
        )
        lost = row @ fields - row[kept] @ fields[kept]
        rows.append((kept, row[kept] + lost @ np.linalg.pinv(fields[kept], rcond=1e-8)))
    ends = np.cumsum([0, *(len(kept) for kept, _ in rows)])
    columns, values = (np.concatenate([row[i] for row in rows]) for i in range(2))
    return sp.csr_matrix((values, columns, ends), shape=share.shape)


def _integrals(
    mesh: Mesh,
    overlap: Overlap,
    low: IntegerArray,
    high: IntegerArray,
) -> tuple[RealArray, RealArray, float]:
    """Mass of the high face, its coupling with the low one [m^2], and the part of the smaller face
    that is covered.
    """
    values = []
    nodes = []
    for side, (faces, at) in enumerate(
        zip((overlap.master, overlap.slave), overlap.at, strict=True)
    ):
        s, q, d = at.shape
        k = faces.shape[1]
        corners = corner_count(mesh.dimension, k)
        found, _ = face_shape_functions(k, corners, at.reshape(-1, d))
        values.append(found.reshape(s, q, k))
        nodes.append(faces[overlap.face[:, side]])
    of_low = np.searchsorted(low, nodes[0])
    of_high = np.searchsorted(high, nodes[1])
    mass = np.zeros((len(high), len(high)))
    coupling = np.zeros((len(high), len(low)))
    weighted = values[1] * overlap.weight[:, :, None]
    block = np.einsum("sqi,sqj->sij", weighted, values[1])
    np.add.at(mass, (of_high[:, :, None], of_high[:, None, :]), block)
    block = np.einsum("sqi,sqj->sij", weighted, values[0])
    np.add.at(coupling, (of_high[:, :, None], of_low[:, None, :]), block)
    return mass, coupling, float(overlap.weight.sum() / _largest_area(mesh, overlap))


def _largest_area(mesh: Mesh, overlap: Overlap) -> float:
    """Area of the larger face [m^2]."""
    return max(
        float(np.linalg.norm(surface_quadrature(mesh, faces)[0], axis=2).sum())
        for faces in (overlap.master, overlap.slave)
    )


def _exact_for_rigid_motions(
    mesh: Mesh,
    pair: Pair,
    low: IntegerArray,
    high: IntegerArray,
    share: RealArray,
) -> RealArray:
    """The shares with the smallest correction that repeats linear fields of the low nodes."""
    ours = mesh.points[low]
    centre = ours.mean(axis=0)
    size = np.abs(ours - centre).max()
    theirs = (mesh.points[high] - pair.shift) @ pair.rotation
    fields = np.column_stack([np.ones(len(low)), (ours - centre) / size])
    wanted = np.column_stack([np.ones(len(high)), (theirs - centre) / size])
    # a plane face gives no field across it
    return share + (wanted - share @ fields) @ np.linalg.pinv(fields, rcond=1e-8)
