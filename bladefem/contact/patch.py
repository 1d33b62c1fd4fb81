"""Contact patches: the corner nodes of matched faces, their areas, frames, and the port vectors of
the two bodies.

The traction of a patch is p = sum f_i / A_i chi_i over its corner nodes, A_i the integral of chi_i,
turned into consistent loads of the elements' own shape functions; the displacement that belongs to
f_i is the chi_i-weighted mean. One matrix P serves both (u_port = P^T u, nodal forces = P f), so
the element stiffness is left alone.

chi is a third of the hat function and two thirds of its dual function: of four choices the most
accurate on a Hertz sphere and under a flat punch (docs/contact.md, benchmarks/contact_hertz.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from geometry.mesh import Mesh

from ..data import Patch
from ..errors import InputError
from ..fem.face_elements import corner_count, face_quadrature, face_shape_functions
from ..fem.surface import FaceRule, outward_signs, surface_quadrature, tangent_frames
from .mortar import mortar_faces, mortar_patch


def make_patch(mesh: Mesh, pair: str) -> Patch:
    """The contact patch of a matched pair of faces, seen from the blade.

    Args:
        mesh: with the pair of that name; its master is the blade's face. A pair without matched
            nodes (m = 0) is taken as non-matching: both sides are then integrated over the faces'
            overlap (mortar.py).
        pair: "this", "next", or another name in mesh.pairs; it becomes the patch's name.

    Returns:
        Patch. Frames: the normal points out of the master body; t2 is the engine axis z laid into
        the face (for plane meshes exactly z); t1 = normal x t2, which on an underplatform seat runs
        towards +y: up the slope on seat_right. Where the normal is within 25 degrees of z, t2 is
        the y axis laid into the face instead.

    Raises:
        InputError: unknown pair, or a patch without matched faces.
    """
    if pair not in mesh.pairs:
        raise InputError(
            f"contact pair '{pair}' is not in the mesh; it has "
            f"{', '.join(sorted(mesh.pairs)) or 'none'}"
        )
    patch = _matched_patch(mesh, pair) if mesh.pairs[pair].nodes.size else mortar_patch(mesh, pair)
    return replace(patch, places=patch_means(patch, mesh).T @ mesh.points)


def _matched_patch(mesh: Mesh, pair: str) -> Patch:
    """The patch of faces that match."""
    faces, _ = patch_faces(mesh, pair)
    corners = corner_count(mesh.dimension, faces.shape[1])
    nodes, numbers = np.unique(faces[:, :corners], return_inverse=True)
    weighted, hats = surface_quadrature(mesh, faces)
    normals = np.zeros((len(nodes), 3))
    area = np.zeros(len(nodes))
    numbers = numbers.reshape(-1, corners)
    sign = outward_signs(mesh, faces, weighted.sum(axis=1))
    for k in range(corners):
        np.add.at(
            normals, numbers[:, k], np.einsum("fqi,q->fi", weighted, hats[:, k]) * sign[:, None]
        )
        np.add.at(area, numbers[:, k], np.linalg.norm(weighted, axis=2) @ hats[:, k])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return Patch(
        pair,
        mesh.points[nodes],
        area,
        tangent_frames(normals, mesh.dimension),
        numbers,
        nodes,
    )


def patch_faces(mesh: Mesh, pair: str) -> tuple[np.ndarray, np.ndarray]:
    """The master's faces (nf, k) whose nodes are all matched, and a table (n_points,) from master
    to slave nodes.
    """
    p = mesh.pairs[pair]
    slave = np.full(len(mesh.points), -1)
    slave[p.nodes[0]] = p.nodes[1]
    faces = mesh.faces[p.master]
    faces = faces[(slave[faces] >= 0).all(axis=1)]
    if len(faces) == 0:
        raise InputError(
            f"contact pair '{pair}' has no matched faces between '{p.master}' and '{p.slave}'"
        )
    return faces, slave


def normal_ports(patches: Sequence[Patch], mesh: Mesh) -> np.ndarray:
    """Numbers of the normal degrees of freedom among the ports of port_matrix, (sum of nodes,)."""
    return np.arange(sum(len(p.area) for p in patches)) * mesh.dimension


def port_matrix(
    patches: Sequence[Patch],
    mesh: Mesh,
    side: str = "blade",
) -> sp.csc_matrix:
    """Port vectors of the patches on one of the two bodies, in the pairs' frames.

    Args:
        patches: in the order of the ports; each named after its pair.
        mesh: that the patches were made from.
        side: "blade" (masters) or "damper" (slaves; the frames turned by the pair's rotation).

    Returns:
        P (dimension * n_points, ports): nodal forces = P f with f in N, u_port = P^T u; ports are
        node-major (normal, t1, t2), or (normal, t1) in a plane mesh. Uniform pressure f_i = p A_i
        gives the elements' consistent loads, and a linear displacement is measured at the centre of
        each chi.
    """
    return sp.hstack([_patch_ports(patch, mesh, side) for patch in patches], format="csc")


def patch_means(
    patch: Patch,
    mesh: Mesh,
    side: str = "blade",
) -> sp.csr_matrix:
    """W (n_points, n): W^T v are the chi-weighted means of a field v given at the mesh's nodes.

    Initial gaps must be averaged by it too: at a corner or edge of the patch the mean is not the
    value at the node.
    """
    rule = _side_rule(patch, mesh, side)
    blocks = np.einsum("fqk,fqm->fmk", rule.traction, rule.shape)
    rows = np.repeat(rule.nodes[:, :, None], blocks.shape[2], axis=2)
    columns = np.repeat(rule.columns[:, None, :], blocks.shape[1], axis=1)
    W = sp.coo_matrix(
        (blocks.ravel(), (rows.ravel(), columns.ravel())), shape=(len(mesh.points), len(patch.area))
    )
    return W.tocsr() @ sp.diags(1 / patch.area)


def initial_gap(patch: Patch, mesh: Mesh) -> np.ndarray:
    """(n,) normal distance of the two faces as meshed [m], chi-weighted means: crowned and rounded
    faces included.
    """
    pair = mesh.pairs[patch.name]
    d = mesh.dimension
    blade, damper = (
        _patch_ports(patch, mesh, side)[:, ::d].T @ place[:, :d].ravel()
        for side, place in (("blade", mesh.points), ("damper", mesh.points - pair.shift))
    )
    return damper - blade


def rigid_ports(
    patches: Sequence[Patch],
    mesh: Mesh,
    origin: np.ndarray,
) -> np.ndarray:
    """B (ports, d): displacement at the damper-side ports for unit rigid motions about `origin`
    (3,) [m].

    d = 6 (x, y, z, rotations about x, y, z) for solids, 3 (x, y, rotation about z) in the plane.
    Moments taken with B^T balance those of the elastic body exactly, which r x f with the nodes'
    own places would not at the patch's edge.
    """
    motions = rigid_motions(mesh, origin)
    return port_matrix(patches, mesh, "damper").T @ motions.reshape(-1, motions.shape[2])


def rigid_motions(mesh: Mesh, origin: np.ndarray) -> np.ndarray:
    """(n_points, dim, d) displacements of all nodes by the motions of `rigid_ports`."""
    d = mesh.dimension
    r = mesh.points - np.asarray(origin)
    turns = [np.cross(axis, r) for axis in np.eye(3)[:3] if d == 3 or axis[2]]
    moves = [np.tile(axis, (len(r), 1)) for axis in np.eye(3)[:d]] + turns
    return np.stack(moves, axis=2)[:, :d]


def _patch_ports(
    patch: Patch,
    mesh: Mesh,
    side: str,
) -> sp.csc_matrix:
    """Port vectors of one patch (dimension * n_points, dimension * n), with the master's own frame
    at each point.
    """
    d = mesh.dimension
    rule = _side_rule(patch, mesh, side)
    frame = tangent_frames(rule.normal.reshape(-1, 3), d, patch.frame[:, 0])
    if side != "blade":
        frame = frame @ mesh.pairs[patch.name].rotation.T
    frame = frame[:, :d, :d].reshape(*rule.normal.shape[:2], d, d)
    blocks = np.einsum("fqk,fqm,fqai->fmika", rule.traction, rule.shape, frame, optimize=True)
    rows = (rule.nodes[:, :, None] * d + np.arange(d)).reshape(len(blocks), -1)
    columns = (rule.columns[:, :, None] * d + np.arange(d)).reshape(len(blocks), -1)
    size = (d * len(mesh.points), d * len(patch.area))
    P = sp.coo_matrix(
        (
            blocks.ravel(),
            (
                np.repeat(rows, columns.shape[1], axis=1).ravel(),
                np.tile(columns, (1, rows.shape[1])).ravel(),
            ),
        ),
        shape=size,
    )
    return (P.tocsr() @ sp.diags(np.repeat(1 / patch.area, d))).tocsc()


def _side_rule(
    patch: Patch,
    mesh: Mesh,
    side: str,
) -> FaceRule:
    """The quadrature rule of the patch on one of its sides."""
    if not mesh.pairs[patch.name].nodes.size:
        return mortar_faces(patch, mesh, side)
    faces, slave = patch_faces(mesh, patch.name)
    weighted, chi = surface_quadrature(mesh, faces)
    corners = chi.shape[1]
    size = np.linalg.norm(weighted, axis=2)
    N, _ = face_shape_functions(faces.shape[1], corners, face_quadrature(corners)[0])
    sign = outward_signs(mesh, faces, weighted.sum(axis=1))
    return FaceRule(
        faces if side == "blade" else slave[faces],
        patch.faces,
        np.broadcast_to(N, (len(faces), *N.shape)),
        size[:, :, None] * chi,
        weighted * (sign[:, None] / size)[:, :, None],
    )
