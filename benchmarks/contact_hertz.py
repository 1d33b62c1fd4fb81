"""Accuracy of contact pressures: Hertz sphere and cylinder on four meshes, flat punch, choice of
traction functions.

    PYTHONPATH=. python benchmarks/contact_hertz.py            (about three minutes on one core)

Recorded results (relative errors; radius from the second moment of the pressure, edge from the
pressed area):

                                                  peak         L2     radius       edge
    cylinder, two bodies, h = a/5               0.37 %     7.19 %     0.50 %    10.00 %
    cylinder, two bodies, h = a/10              0.05 %     3.68 %     0.13 %     5.00 %
    cylinder, two bodies, h = a/20              0.00 %     1.83 %     0.02 %     2.50 %
    cylinder, two bodies, h = a/40              0.01 %     0.90 %     0.01 %     1.25 %
        order of L2 1.00
    sphere, one body, h = a/4                   1.28 %     5.18 %     0.12 %     6.04 %
    sphere, one body, h = a/6                   0.48 %     3.88 %     0.18 %     1.13 %
    sphere, one body, h = a/8                   0.21 %     1.75 %     0.00 %     1.63 %
    sphere, one body, h = a/10                  0.02 %     2.96 %     0.09 %     1.76 %
        order of L2 0.87
    sphere, steel on aluminium, h = a/10        0.01 %     2.97 %     0.09 %     1.76 %
    sphere, hat functions, h = a/10             0.23 %     6.80 %     0.75 %     3.37 %
        punch a/20: L2 1.27 % for x < 0.8 a, next to the edge 66.9 %
    sphere, third hat, two thirds dual, a/10    0.02 %     2.96 %     0.09 %     1.76 %
        the library's choice; punch a/20: L2 0.39 % for x < 0.8 a, next to the edge 11.5 %
    sphere, dual functions, h = a/10            0.17 %     4.81 %     0.29 %     4.24 %
        punch a/20: L2 0.38 % for x < 0.8 a, next to the edge 0.5 %
    sphere, mid-side nodes tied, h = a/10       0.77 %     4.69 %     0.28 %     4.24 %

The pressure falls to zero with an infinite slope, so its L2 error is of first order in h and jumps
with the place of the edge between two nodes: the area of a handful of nodes is what "edge" sees.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import scipy.sparse as sp

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "contact"))

import test_hertz as cases
from blocks import clamped, compliances, facing_blocks, flexibility, graded, stiffness

from bladefem.contact import mortar
from bladefem.contact.complementarity import solve_lcp
from bladefem.contact.patch import make_patch
from bladefem.fem import surface
from bladefem.fem.face_elements import LINEAR, traction_shape

ONE_BODY = ((2.1e11, None), (0.3, 0.0))
ERRORS = ("peak", "L2", "radius", "edge")
FAR = {"far": 6.0, "growth": 1.7}


def functions(share):
    """Traction functions with a share of the dual; 2/3 is the library's."""

    def chi(corners, points):
        hats = LINEAR[corners](points)[0]
        return (1 - share) * hats + share * (corners * hats - (1 - hats))

    return chi


def use(chi):
    """Put other traction functions in place."""
    surface.traction_shape = mortar.traction_shape = chi


def tied(n):
    """The sphere with mid-side nodes of the seat tied to the mean of their corners, corners loaded
    only.
    """
    a, R = cases.A, cases.RADIUS
    x, depth = graded(a / n, 1.2 * a, 6 * a, 1.7), graded(a / n, 0.5 * a, 6 * a, 1.7)
    mesh = facing_blocks(x, depth, x)
    patch, cells = make_patch(mesh, "this"), mesh.bodies["blade"]
    points, face = mesh.points[: cells.max() + 1], mesh.faces["seat_right"]
    mid, ends = np.unique(face[:, 3:].ravel(), return_index=True)
    ends = face[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)[ends]
    keep = np.setdiff1d(np.arange(len(points)), mid)
    number = np.full(len(points), -1)
    number[keep] = np.arange(len(keep))
    T = sp.coo_matrix(
        (
            np.r_[np.ones(len(keep)), np.full(2 * len(mid), 0.5)],
            (np.r_[keep, mid, mid], np.r_[number[keep], number[ends[:, 0]], number[ends[:, 1]]]),
        )
    )
    T = sp.kron(T, sp.identity(3), format="csr")
    hold = clamped(points)
    hold = hold[number[hold // 3] >= 0]
    r = np.linalg.norm(patch.points[:, :2], axis=1)
    near = np.flatnonzero(r < 1.4 * a)
    r, area, row = r[near], patch.area[near], number[patch.blade_nodes[near]] * 3 + 2
    P = sp.csc_matrix(
        (np.ones(len(near)), (row, np.arange(len(near)))), shape=(T.shape[1], len(near))
    )
    C = flexibility(
        (T.T @ stiffness(points, cells, 2.1e11, 0.3) @ T).tocsr(),
        number[hold // 3] * 3 + hold % 3,
        P,
    )
    e = cases.modulus(*ONE_BODY)
    force, peak = e * a**3 / (3 * R), 2 * e * a / (np.pi * R)
    s = solve_lcp(C, r**2 / (2 * R), -np.ones((len(C), 1)), [-force])
    p, exact = s.force / area, peak * np.sqrt(np.clip(1 - (r / a) ** 2, 0, None))
    return {
        "peak": abs(p.max() / peak - 1),
        "L2": np.sqrt(area @ (p - exact) ** 2 / (area @ exact**2)),
        "radius": abs(np.sqrt(s.force @ r**2 / force * 2.5) / a - 1),
        "edge": abs(np.sqrt(4 * area[s.active].sum() / np.pi) / a - 1),
    }


def punch(n):
    """L2 error of a plane flat punch for x < 0.8 a, and the largest error of the nodes next to the
    edge node.
    """
    a = cases.A
    x, depth = graded(a / n, a, 30 * a), graded(a / n, 0.5 * a, 30 * a)
    mesh = facing_blocks(x, depth)
    face = mesh.faces["seat_right"]
    mesh.faces["seat_right"] = face[(mesh.points[face][:, :, 0] <= a * (1 + 1e-9)).all(axis=1)]
    patch = make_patch(mesh, "this")
    C = sum(compliances(mesh, patch, *ONE_BODY, clamped))
    s = solve_lcp(C, np.zeros(len(C)), -np.ones((len(C), 1)), [-0.5])
    order = np.argsort(patch.points[:, 0])[:-1]
    exact = 1 / (np.pi * np.sqrt(a**2 - patch.points[order, 0] ** 2))
    p, area, inner = (
        (s.force / patch.area)[order],
        patch.area[order],
        patch.points[order, 0] < 0.8 * a,
    )
    L2 = np.sqrt(area[inner] @ (p - exact)[inner] ** 2 / (area[inner] @ exact[inner] ** 2))
    return L2, np.abs(p / exact - 1)[-3:].max()


def line(name, e):
    print(f"{name:44s}" + "".join(f"{100 * e[k]:9.2f} %" for k in ERRORS), flush=True)


def orders(name, sizes, found):
    slopes = [
        -np.polyfit(np.log(sizes), np.log([e[k] for e in found]), 1)[0] for k in ("L2", "edge")
    ]
    print(f"{name}: observed order of L2 {slopes[0]:.2f}, of the edge {slopes[1]:.2f}")


def main():
    print(f"{'':44s}" + "".join(f"{k:>11s}" for k in ERRORS))
    sizes = (5, 10, 20, 40)
    found = [cases.hertz(n, 2, *cases.STEEL, far=40.0) for n in sizes]
    for n, e in zip(sizes, found, strict=True):
        line(f"cylinder, two bodies, h = a/{n}", e)
    orders("cylinder", sizes, found)
    sizes = (4, 6, 8, 10)
    found = [cases.hertz(n, 3, *ONE_BODY, **FAR) for n in sizes]
    for n, e in zip(sizes, found, strict=True):
        line(f"sphere, one body, h = a/{n}", e)
    orders("sphere", sizes, found)
    line(
        "sphere, steel on aluminium, h = a/10",
        cases.hertz(10, 3, (2.1e11, 0.7e11), (0.3, 0.33), **FAR),
    )
    for name, share in (
        ("hat functions", 0.0),
        ("third hat, two thirds dual", 2 / 3),
        ("dual functions", 1.0),
    ):
        use(functions(share))
        line(f"sphere, {name}, h = a/10", cases.hertz(10, 3, *ONE_BODY, **FAR))
        inner, edge = punch(20)
        print(
            f"    punch a/20: L2 {100 * inner:.2f} % for x < 0.8 a, next to the edge "
            f"{100 * edge:.1f} %"
        )
    use(traction_shape)
    line("sphere, mid-side nodes tied, h = a/10", tied(10))


if __name__ == "__main__":
    main()
