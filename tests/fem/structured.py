"""Small structured meshes as plain arrays: boxes, ring sectors and whole rings, any element type,
no mesher.
"""

from itertools import product

import numpy as np

from bladefem.fem import shape_functions as shape
from bladefem.fem.loads import surface_load
from geometry.mesh import Mesh, Pair, Sector

# six tetrahedra of a cube along one diagonal; corners in gmsh's order
SIX = [(0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)]
TWO = [(0, 1, 2), (0, 2, 3)]


def box(divisions, size, cell_type="tetra10", body="blade", origin=None, map=None, depth=1.0):
    """A rectangle or box [0, size] with faces x0, x1, y0, ...; ``map`` bends the corner and middle
    nodes (x -> x).
    """
    d = len(divisions)
    cube = "hexahedron" if d == 3 else "quad"
    corner = shape.reference_nodes(cube).astype(int)
    simple = shape.SHAPES[cell_type][0]
    parts = {"tetra": SIX, "triangle": TWO}.get(simple, [tuple(range(len(corner)))])
    lattice = shape.reference_nodes(cell_type)
    linear, _ = shape.tabulate(simple, lattice)
    grid = []
    for cell in product(*[range(n) for n in divisions]):
        for part in parts:
            grid.append(linear @ (corner[list(part)] + np.array(cell)))  # node places in grid units
    key = np.rint(2 * np.array(grid)).astype(int).reshape(-1, d)
    unique, inverse = np.unique(key, axis=0, return_inverse=True)
    cells = inverse.reshape(len(grid), len(lattice))
    points = np.zeros((len(unique), 3))
    points[:, :d] = unique / 2 / np.array(divisions) * np.array(size) + (
        0 if origin is None else np.array(origin)
    )
    faces = {
        f"{'xyz'[i]}{side}": _face(cells, unique, cell_type, i, 2 * side * divisions[i])
        for i in range(d)
        for side in (0, 1)
    }
    points = points if map is None else map(points)
    return Mesh(points, cell_type, {body: cells}, {**faces, "clamp": faces["x0"]}, depth=depth)


def _face(cells, key, cell_type, axis, value):
    """Facets whose corners lie on a grid plane."""
    facet_type = shape.FACET_OF[cell_type]
    at = shape.reference_nodes(cell_type)
    out = []
    for side in _facets(cell_type):
        corner = at[list(side)]
        reference = (
            shape.tabulate(shape.SHAPES[facet_type][0], shape.reference_nodes(facet_type))[0]
            @ corner
        )
        local = [int(abs(at - x).sum(1).argmin()) for x in reference]
        hit = (key[cells[:, list(side)], axis] == value).all(1)
        out.append(cells[hit][:, local])
    return np.concatenate(out)


def _facets(cell_type):
    return {
        "triangle": [(0, 1), (1, 2), (2, 0)],
        "quad": [(0, 1), (1, 2), (2, 3), (3, 0)],
        "tetra": [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)],
        "hexahedron": [
            (0, 3, 2, 1),
            (0, 1, 5, 4),
            (0, 4, 7, 3),
            (1, 2, 6, 5),
            (2, 3, 7, 6),
            (4, 5, 6, 7),
        ],
    }[shape.SHAPES[cell_type][0]]


def turn(angle, axis=2):
    """(3, 3) rotation about a coordinate axis."""
    a, b = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[a, a] = matrix[b, b] = np.cos(angle)
    matrix[a, b], matrix[b, a] = -np.sin(angle), np.sin(angle)
    return matrix


def pair(mesh, master, slave, rotation, shift=(0.0, 0.0, 0.0)):
    """Nodes of two faces matched under a motion."""
    low, high = np.unique(mesh.faces[master]), np.unique(mesh.faces[slave])
    image = mesh.points[low] @ rotation.T + shift
    near = np.linalg.norm(image[:, None] - mesh.points[high][None], axis=2).argmin(1)
    return Pair(master, slave, np.stack([low, high[near]]), rotation, np.array(shift, float))


def sector(
    count,
    divisions=(3, 2, 1),
    cell_type="tetra10",
    inner=0.1,
    outer=0.25,
    width=0.03,
    axis=2,
    sense=1,
    bump=0.0,
    straight=False,
    slide=0.0,
):
    """One of ``count`` equal parts of a ring about an axis; ``bump`` makes the sector asymmetric,
    ``slide`` moves the nodes of the high cut face in their plane so that they match no more.
    """
    theta = 2 * np.pi / count * sense

    def bend(x):
        r, a, z = x[:, 0], x[:, 1] * theta, x[:, 2]
        along, across = (r - inner) / (outer - inner), z / width
        r = r + slide * x[:, 1] * (outer - inner) * np.sin(np.pi * along) * (0.4 + across)
        z = z + slide * x[:, 1] * width * np.sin(np.pi * across) * along
        z = z * (1 + bump * np.sin(7 * r / outer) * (0.3 + np.sin(np.pi * x[:, 1]) ** 2 * x[:, 1]))
        return np.roll(np.stack([r * np.cos(a), r * np.sin(a), z], 1), axis - 2, axis=1)

    d = len(divisions)
    mesh = box(
        divisions,
        (outer - inner, 1.0, width)[:d],
        cell_type,
        origin=(inner, 0.0, 0.0)[:d],
        map=bend,
    )
    if straight:
        mesh = straightened(mesh)
    faces = {**mesh.faces, "cyclic_low": mesh.faces["y0"], "cyclic_high": mesh.faces["y1"]}
    mesh = Mesh(mesh.points, cell_type, mesh.bodies, faces)
    rotation = turn(theta, axis)
    cyclic = pair(mesh, "cyclic_low", "cyclic_high", rotation)
    if slide:
        cyclic = Pair("cyclic_low", "cyclic_high", np.zeros((2, 0), int), rotation, np.zeros(3))
    return Mesh(
        mesh.points,
        cell_type,
        mesh.bodies,
        faces,
        pairs={"cyclic": cyclic},
        sector=Sector(count, rotation, np.zeros(3)),
    )


def straightened(mesh):
    """Middle nodes put half-way between their corners."""
    points = mesh.points.copy()
    linear, _ = shape.tabulate(
        shape.SHAPES[mesh.cell_type][0], shape.reference_nodes(mesh.cell_type)
    )
    for cells in mesh.bodies.values():
        points[cells] = np.einsum("qk,ckg->cqg", linear, points[cells[:, : linear.shape[1]]])
    return Mesh(
        points,
        mesh.cell_type,
        mesh.bodies,
        mesh.faces,
        mesh.nodes,
        mesh.pairs,
        mesh.sector,
        mesh.depth,
    )


def wheel(mesh):
    """All sectors of a mesh joined: the full 360 degrees, and (sectors, n_points) numbers of the
    copies.
    """
    count, pairs = mesh.sector.count, mesh.pairs["cyclic"].nodes
    n = len(mesh.points)
    number = np.arange(count * n).reshape(count, n)
    for s in range(count):
        number[(s + 1) % count, pairs[0]] = number[
            s, pairs[1]
        ]  # the next sector's low face is my high face
    number[0, pairs[0]] = number[count - 1, pairs[1]]
    used, dense = np.unique(number, return_inverse=True)
    dense = dense.reshape(number.shape)
    points = np.empty((len(used), 3))
    x = mesh.points
    for s in range(count):
        points[dense[s]] = x @ np.linalg.matrix_power(mesh.sector.rotation, s).T
    bodies = {
        name: np.concatenate([dense[s][cells] for s in range(count)])
        for name, cells in mesh.bodies.items()
    }
    faces = {
        name: np.concatenate([dense[s][face] for s in range(count)])
        for name, face in mesh.faces.items()
        if not name.startswith("cyclic")
    }
    return Mesh(points, mesh.cell_type, bodies, faces), dense


def face_areas(body, face):
    """(n_points,) integral of each node's shape function over a face [m^2]."""
    traction = np.eye(body.dim)[0]
    return surface_load(body, face, traction=traction).reshape(-1, body.dim)[:, 0]
