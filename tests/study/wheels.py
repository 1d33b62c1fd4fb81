"""Small wheels for the studies: a ring sector with a bump, as `Bodies` takes it."""

from dataclasses import replace

import numpy as np

from bladefem.fem import shape_functions as shape
from bladefem.scene.tables import Excitation, Operation, Scene
from bladefem.study.pipeline.bodies import Bodies
from geometry.mesh import Mesh, Pair, Sector


def ring(count=6, divisions=(3, 2, 1), inner=0.1, outer=0.25, width=0.03, bump=0.2):
    """A sector of a ring in P2 hexahedra, clamped at the bore, thicker towards one side."""
    theta = 2 * np.pi / count
    n = 2 * np.array(divisions)
    grid = np.stack(np.meshgrid(*[np.arange(k + 1) for k in n], indexing="ij"), -1).reshape(-1, 3)
    number = np.arange(len(grid)).reshape(n + 1)
    local = np.rint(2 * shape.reference_nodes("hexahedron27")).astype(int)
    first = 2 * np.stack(
        np.meshgrid(*[np.arange(k) for k in divisions], indexing="ij"), -1
    ).reshape(-1, 3)
    cells = number[tuple(np.moveaxis(first[:, None] + local, -1, 0))]
    r, part = inner + (outer - inner) * grid[:, 0] / n[0], grid[:, 1] / n[1]
    z = (
        width
        * grid[:, 2]
        / n[2]
        * (1 + bump * np.sin(7 * r / outer) * (0.3 + np.sin(np.pi * part) ** 2 * part))
    )
    points = np.stack([r * np.cos(part * theta), r * np.sin(part * theta), z], 1)
    rotation = np.array(
        [[np.cos(theta), -np.sin(theta), 0], [np.sin(theta), np.cos(theta), 0], [0, 0, 1.0]]
    )
    low, high = number[:, 0].ravel(), number[:, -1].ravel()
    faces = {"clamp": _quads(number[0]), "tip": _quads(number[-1])}
    faces |= {"cyclic_low": _quads(number[:, 0]), "cyclic_high": _quads(number[:, -1])}
    return Mesh(
        points,
        "hexahedron27",
        {"blade": cells},
        faces,
        {"tip_mid": number[-1, n[1] // 2, :1].ravel()},
        {"cyclic": Pair("cyclic_low", "cyclic_high", np.stack([low, high]), rotation, np.zeros(3))},
        Sector(count, rotation, np.zeros(3)),
    )


def _quads(number):
    """9-node facets of a grid of nodes."""
    local = np.rint(2 * shape.reference_nodes("quad9")).astype(int)
    a, b = (np.arange(0, k - 1, 2) for k in number.shape)
    first = np.stack(np.meshgrid(a, b, indexing="ij"), -1).reshape(-1, 2)
    return number[tuple(np.moveaxis(first[:, None] + local, -1, 0))]


def bodies(speed=0.0, order=2, comm=None, **keys):
    """The ring under rotation, excited at its tip along the axis."""
    scene = replace(
        Scene(kind="imported"),
        operation=Operation(speed=speed, damping=0.002),
        excitation=Excitation(engine_order=order, force=2.0, direction=(0.0, 0.0, 1.0)),
    )
    return Bodies(scene, ring(**keys), comm)
