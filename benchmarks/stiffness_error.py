"""Is the estimated error of a frequency by the mesh ever far from the true one?

    python benchmarks/stiffness_error.py [name ...]

Each line is a body on a coarse mesh: the true errors of the first six frequencies, against a far
finer mesh that is graded towards clamp, edges and corners, and the estimated over the true ones.
Modes are paired by their shapes; "nan" is one that has no partner. Takes a minute.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial import cKDTree

from bladefem.data import ModeSet
from bladefem.fem.body import Body, assemble
from bladefem.fem.compat import MPI
from bladefem.fem.constraint import constrain
from bladefem.fem.modes import modes
from bladefem.fem.refinement import refine_uniformly
from bladefem.fem.stiffness_error import frequency_errors
from bladefem.scene.tables import Material
from geometry.mesh import Mesh

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "fem"))
from mixed import cut, row
from structured import box, straightened

STEEL = Material(nu=0.3)
FIRST = ("tetra", "hexahedron")
SECOND = ("tetra10", "hexahedron27", "wedge18", "pyramid14")
# size [m], cells of the fine mesh, cells of the coarse ones
BARS = {
    "bar": ((0.5, 0.1, 0.1), (12, 6, 6), [(3, 1, 1), (5, 1, 1), (10, 2, 2)]),
    "slim bar": ((0.3, 0.02, 0.02), (16, 4, 4), [(4, 1, 1), (8, 1, 1)]),
    "plate": ((0.2, 0.1, 0.01), (20, 16, 4), [(4, 2, 1), (8, 4, 1)]),
    "stub": ((0.1, 0.1, 0.06), (10, 8, 6), [(2, 2, 1), (4, 4, 2)]),
}
TWIST = (0.2, 0.006, 0.04)
# of two frequencies that count as one
EQUAL = 1e-3
MIN_MAC = 0.7


def towards_edges(size: tuple[float, ...]) -> Callable[[np.ndarray], np.ndarray]:
    """Smaller cells at the clamp and at all edges."""

    def places(x: np.ndarray) -> np.ndarray:
        y = x.copy()
        y[:, 0] = size[0] * (x[:, 0] / size[0]) ** 2.5
        for axis in range(1, len(size)):
            at = 2 * x[:, axis] / size[axis] - 1
            y[:, axis] = size[axis] / 2 * (1 + np.sign(at) * (1 - (1 - abs(at)) ** 1.7))
        return y

    return places


def of_one_shape(word: str, divisions: tuple[int, ...], size: tuple[float, ...]) -> Mesh:
    """A box of cells of one shape."""
    if word in ("wedge18", "pyramid14"):
        return cut(box(divisions, size, "hexahedron27"), divisions, lambda i, j: word[0])
    return box(divisions, size, word)


def graded(divisions: tuple[int, ...], size: tuple[float, ...]) -> Mesh:
    """The fine mesh of a box."""
    word = "quad9" if len(size) == 2 else "hexahedron27"
    return straightened(box(divisions, size, word, map=towards_edges(size)))


def bracket(n: int, word: str, power: float = 1.0, solid: bool = False) -> Mesh:
    """A square of 2 n x 2 n cells without one quarter; smaller cells at its corner by a power."""
    divisions, size = (2 * n, 2 * n), (0.2, 0.2)
    mesh = box((*divisions, n), (*size, 0.05), word) if solid else box(divisions, size, word)
    centre = mesh.points[mesh.bodies["blade"]].mean(axis=1)
    cells = mesh.bodies["blade"][(centre[:, :2] < 0.1).any(axis=1)]
    used, local = np.unique(cells, return_inverse=True)
    number = np.full(len(mesh.points), -1)
    number[used] = np.arange(len(used))
    points = mesh.points[used]
    at = points[:, :2] / 0.1 - 1
    points[:, :2] = 0.1 * (1 + np.sign(at) * abs(at) ** power)
    bodies = {"blade": local.reshape(cells.shape)}
    faces = {"clamp": number[mesh.faces["x0"]]}
    return straightened(replace(mesh, points=points, bodies=bodies, faces=faces))


def twisted(mesh: Mesh) -> Mesh:
    """A box of `TWIST` bent into a blade that leans and turns by 34 degrees."""
    span, y, z = mesh.points.T - np.array([[0.0], [TWIST[1] / 2], [TWIST[2] / 2]])
    cos, sin = np.cos(3 * span), np.sin(3 * span)
    places = [0.3 + span, y * cos - z * sin + 0.5 * span**2, y * sin + z * cos]
    return replace(mesh, points=np.stack(places, axis=1))


def cases() -> Iterator[tuple[str, Callable[[], Mesh], Callable[[], Mesh], str]]:
    """Name, mesh, fine mesh, and what the fine mesh is known by."""
    for name, (size, fine, coarse) in BARS.items():
        for divisions in coarse:
            for word in FIRST + SECOND:
                yield (
                    f"{name} {word} {divisions}",
                    lambda w=word, d=divisions, s=size: of_one_shape(w, d, s),
                    lambda f=fine, s=size: graded(f, s),
                    name,
                )
    flat = (0.5, 0.1)
    for word in ("triangle", "quad", "triangle6", "quad9"):
        for divisions in ((5, 1), (11, 3)):
            yield (
                f"strip {word} {divisions}",
                lambda w=word, d=divisions: box(d, flat, w),
                lambda: graded((24, 12), flat),
                "strip",
            )
        for n in (1, 2, 4):
            yield (
                f"L {word} {n}",
                lambda w=word, n=n: bracket(n, w),
                lambda: bracket(20, "quad9", 3.0),
                "L",
            )
    for word in ("tetra", "hexahedron", "tetra10", "hexahedron27"):
        for n in (1, 2):
            yield (
                f"solid L {word} {n}",
                lambda w=word, n=n: bracket(n, w, solid=True),
                lambda: bracket(6, "hexahedron27", 2.5, solid=True),
                "solid L",
            )
    for word in ("tetra10", "hexahedron27"):
        for divisions in ((4, 1, 2), (8, 1, 4)):
            yield (
                f"twisted {word} {divisions}",
                lambda w=word, d=divisions: twisted(box(d, TWIST, w)),
                lambda: twisted(graded((20, 3, 10), TWIST)),
                "twisted",
            )
    size, fine, _ = BARS["bar"]
    mixed = {
        "mixed": row,
        "mixed, halved": lambda: refine_uniformly(row()),
        "mixed, first order": lambda: refine_uniformly(row(order=1)),
    }
    for name, mesh in mixed.items():
        yield name, mesh, lambda: graded(fine, size), "bar"


def solved(mesh: Mesh, count: int) -> tuple[Body, ModeSet]:
    """A clamped body and its modes."""
    body = assemble(mesh, "blade", STEEL, MPI.COMM_SELF)
    return body, modes(constrain(body), count)


def paired(body: Body, found: ModeSet, fine: tuple[Body, ModeSet]) -> np.ndarray:
    """Frequencies [Hz] of the fine mesh of the modes found; NaN without a partner."""
    near = cKDTree(fine[0].mesh.points).query(body.mesh.points)[1]
    ours = found.shapes.reshape(len(found.shapes), -1)
    theirs = fine[1].shapes[:, near].reshape(len(fine[1].shapes), -1)
    sizes = np.outer((ours**2).sum(axis=1), (theirs**2).sum(axis=1))
    right = fine[1].frequencies
    match = ((ours @ theirs.T) ** 2 / sizes) @ (abs(right[:, None] / right - 1) < EQUAL)
    apart = abs(np.arange(len(ours))[:, None] - np.arange(len(theirs)))
    rows, columns = linear_sum_assignment(1e-3 * apart - match)
    return np.where(match[rows, columns] > MIN_MAC, right[columns], np.nan)


def main(names: list[str]) -> None:
    """The table."""
    finest: dict[str, tuple[Body, ModeSet]] = {}
    every: list[tuple[float, float, str]] = []
    for name, mesh, fine, known in cases():
        if names and not any(some in name for some in names):
            continue
        if known not in finest:
            finest[known] = solved(fine(), 9)
        body, found = solved(mesh(), 6)
        true = found.frequencies / paired(body, found, finest[known]) - 1
        share = frequency_errors(body, found) / true
        line = "  ".join(f"{100 * t:6.2f} {s:4.2f}" for t, s in zip(true, share, strict=True))
        print(f"{name:28s} {line}", flush=True)
        every += [(s, t, name) for s, t in zip(share, true, strict=True) if np.isfinite(s)]
    for largest in (np.inf, 0.3, 0.1, 0.03):
        some = sorted(case for case in every if case[1] < largest)
        (low, _, least), (high, _, most) = some[0], some[-1]
        head = f"true errors below {largest:.0%}: {len(some)}"
        print(f"{head}; {low:.2f} ({least}) to {high:.2f} ({most})")


if __name__ == "__main__":
    main(sys.argv[1:])
