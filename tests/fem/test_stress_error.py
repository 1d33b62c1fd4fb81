"""The estimated error of a recovered stress, against the ring under outer pressure (Lame)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from structured import box

from bladefem.fem.body import assemble
from bladefem.fem.stress import nodal_stress, von_mises
from bladefem.fem.stress_error import free_normals, mesh_error
from bladefem.scene.tables import Material

INNER, OUTER = 0.001, 0.01
STEEL = Material(nu=0.3)
PRESSURE = 1e6


def ring(cells):
    """A quarter ring of triangles, graded towards its bore, and the exact displacements in it."""
    mesh = box(cells, (1.0, 1.0), "triangle6")
    radius = INNER * (OUTER / INNER) ** mesh.points[:, 0]
    angle = np.pi / 2 * mesh.points[:, 1]
    direction = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    mesh = replace(mesh, points=radius[:, None] * direction)
    body = assemble(mesh, "blade", STEEL, None)
    scale = -PRESSURE * OUTER**2 / (OUTER**2 - INNER**2) / STEEL.E
    outwards = scale * ((1 - STEEL.nu) * radius + (1 + STEEL.nu) * INNER**2 / radius)
    return body, (outwards[:, None] * direction)[:, :2]


@pytest.mark.parametrize(
    ("cells", "useful"), [((3, 2), 0.5), ((4, 4), 0.2), ((8, 4), 0.2), ((16, 12), 0.03)]
)
def test_error_at_the_bore_is_not_below_half_of_the_true_one_and_useful(cells, useful):
    """The stress at the bore is 2 p R^2 / (R^2 - r^2), round the whole of it."""
    body, u = ring(cells)
    exact = 2 * PRESSURE * OUTER**2 / (OUTER**2 - INNER**2)
    recovered = nodal_stress(body, u)
    touched = np.hypot(*body.mesh.points[:, :2].T) > 1.001 * INNER
    bore = np.flatnonzero(~touched)
    touched |= body.mesh.points[:, :2].min(axis=1) < 1e-9
    for node in bore[[0, len(bore) // 3, len(bore) // 2]]:
        true = abs(von_mises(recovered[node]) / exact - 1)
        found = mesh_error(body, u, recovered, node, touched)
        assert 0.5 * true <= found <= useful


def test_free_normals_are_those_of_the_curved_bore():
    body, _ = ring((6, 6))
    points = body.mesh.points[:, :2]
    radius = np.hypot(*points.T)
    touched = radius > 1.001 * INNER
    bore = np.flatnonzero(~touched & (points.min(axis=1) > 1e-3 * INNER))
    for node in bore:
        normals = free_normals(body, node, touched)
        assert 1 <= len(normals) <= 2
        # edges are parabolas through three points of the arc
        np.testing.assert_allclose(abs(normals @ points[node]) / INNER, 1, atol=1e-3)
    # of the nodes at one radius, none on a straight edge: rounding decides among them
    off_edges = points.min(axis=1) > 1e-3 * INNER
    inside = int(np.argmin(np.where(off_edges, abs(radius - 0.004), np.inf)))
    assert len(free_normals(body, inside, np.zeros(len(points), bool))) == 0
