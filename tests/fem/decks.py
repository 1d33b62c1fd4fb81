"""Foreign decks written by hand, with the quirks of the programs that write them; the meshes behind
them are solved by CalculiX too (``benchmarks/fem_decks.py``).
"""

from dataclasses import dataclass, replace

import mixed
import numpy as np
from structured import box, sector

from bladefem.fem.refinement import refine_uniformly
from geometry.topology import EDGES, FAMILY, facet_nodes
from geometry.whole_cells import own_cells

SECTORS = 12
ABAQUS = {
    "tetra": "C3D4",
    "tetra10": "C3D10",
    "hexahedron": "C3D8",
    "hexahedron20": "C3D20",
    "wedge": "C3D6",
    "wedge15": "C3D15",
}
# corner pairs of the mid-side nodes as Abaqus, Ansys and Nastran's hexahedra number them
ABAQUS_EDGES = {
    "tetra": [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)],
    "hexahedron": [
        *[(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4)],
        *[(0, 4), (1, 5), (2, 6), (3, 7)],
    ],
    "wedge": [(0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)],
}


@dataclass(frozen=True)
class Model:
    """A sector as blocks of cells in gmsh's node order, with named node sets."""

    points: np.ndarray
    blocks: list
    node_sets: dict
    faces: dict


def model(kind, divisions=None):
    """ "c3d20", "c3d15_c3d20" (every second column of hexahedra cut in wedges), "c3d10" or
    "c3d4"; ``divisions`` are those of hexahedra.
    """
    if kind in ("c3d10", "c3d4"):
        mesh = sector(SECTORS, (4, 3, 2), "tetra10", bump=0.2, straight=kind == "c3d4")
        cells = mesh.bodies["blade"]
        if kind == "c3d4":
            return _model(mesh, [("tetra", cells[:, :4])])
        return _model(mesh, [("tetra10", cells)])
    divisions = divisions or ((5, 4, 2) if kind == "c3d20" else (9, 6, 4))
    mesh = sector(SECTORS, divisions, "hexahedron27", bump=0.1)
    cells = mesh.bodies["blade"]
    if kind == "c3d20":
        return _model(mesh, [("hexahedron20", cells[:, :20])])
    # whole columns across the wheel's width: triangles never meet quadrilaterals
    i, j, _ = np.unravel_index(np.arange(len(cells)), divisions)
    cut = (i + j) % 2 == 0
    wedges = np.vstack([_wedges(cells[cut], half) for half in ((0, 1, 2), (0, 2, 3))])
    return _model(mesh, [("hexahedron20", cells[~cut][:, :20]), ("wedge15", wedges)])


def promoted(m):
    """Straight tetrahedra of 10 nodes from those of 4."""
    (_, cells) = m.blocks[0]
    ends = np.sort(cells[:, np.array(EDGES["tetra"])].reshape(-1, 2), axis=1)
    edges, number = np.unique(ends, axis=0, return_inverse=True)
    points = np.vstack([m.points, m.points[edges].mean(axis=1)])
    middle = len(m.points) + number.reshape(len(cells), 6)
    sets = {}
    for name, nodes in m.node_sets.items():
        on_edges = np.flatnonzero(np.isin(edges, nodes).all(axis=1))
        sets[name] = np.concatenate([nodes, len(m.points) + on_edges])
    return Model(points, [("tetra10", np.hstack([cells, middle]))], sets, m.faces)


def _wedges(cells, half):
    """One half (bottom corners a, b, c) of hexahedra of 27 nodes as wedges of 15."""
    corners = [*half, *(i + 4 for i in half)]
    row = {frozenset(pair): 8 + i for i, pair in enumerate(EDGES["hexahedron"])}
    # the diagonals' nodes are the centres of the bottom and the top
    row |= {frozenset((0, 2)): 20, frozenset((4, 6)): 25}
    middle = [row[frozenset((corners[a], corners[b]))] for a, b in EDGES["wedge"]]
    return cells[:, [*corners, *middle]]


def _model(mesh, blocks):
    """Only the nodes that the cells use."""
    used = np.unique(np.concatenate([cells.ravel() for _, cells in blocks]))
    number = np.full(len(mesh.points), -1)
    number[used] = np.arange(len(used))
    sets = {}
    for name in ("clamp", "cyclic_low", "cyclic_high"):
        nodes = number[np.unique(mesh.faces[name])]
        sets[name] = nodes[nodes >= 0]
    return Model(
        mesh.points[used], [(word, number[cells]) for word, cells in blocks], sets, mesh.faces
    )


def abaqus_cells(word, cells):
    """Cells in Abaqus' node order, numbered from 1."""
    family = FAMILY[word]
    k = {"tetra": 4, "hexahedron": 8, "wedge": 6}[family]
    if cells.shape[1] == k:
        return cells + 1
    row = {frozenset(pair): i for i, pair in enumerate(EDGES[family])}
    return cells[:, [*range(k), *(k + row[frozenset(p)] for p in ABAQUS_EDGES[family])]] + 1


def node_lines(points, end=""):
    return [f"{i:8d}, {x:.13e}, {y:.13e},{z:.13e}{end}" for i, (x, y, z) in enumerate(points, 1)]


def element_lines(cells, first=1, wrap=16):
    """Element lines of at most 16 numbers, as Abaqus reads them."""
    lines = []
    for number, cell in enumerate(cells.tolist(), first):
        values = [number, *cell]
        rows = [values[i : i + wrap] for i in range(0, len(values), wrap)]
        lines += [", ".join(map(str, row)) + "," * (row is not rows[-1]) for row in rows]
    return lines


def set_lines(nodes):
    values = (np.sort(nodes) + 1).tolist()
    return [", ".join(map(str, values[i : i + 10])) for i in range(0, len(values), 10)]


def flat_deck(m, names, element_type=None):
    """Nodes, elements and node sets of a model; ``names`` are those of the sets in the file."""
    lines = ["*HEADING", "a sector", "*NODE, NSET=NALL", *node_lines(m.points)]
    first = 1
    for word, cells in m.blocks:
        kind = element_type or ABAQUS[word]
        lines += [f"*ELEMENT, TYPE={kind}, ELSET=EALL"]
        lines += element_lines(abaqus_cells(word, cells), first)
        first += len(cells)
    for name, nodes in m.node_sets.items():
        lines += [f"*NSET,NSET={names.get(name, name)}", *set_lines(nodes)]
    return lines


def ccx_job(m, diameters, count, element_type=None):
    """A deck that CalculiX solves: every frequency comes twice, the slave face is not clamped."""
    m = Model(
        m.points,
        m.blocks,
        m.node_sets | {"clamp": np.setdiff1d(m.node_sets["clamp"], m.node_sets["cyclic_high"])},
        m.faces,
    )
    return "\n".join(
        [
            *flat_deck(m, {}, element_type),
            *["*MATERIAL, NAME=STEEL", "*ELASTIC", "2.1e11, 0.3", "*DENSITY", "7850."],
            *["*SOLID SECTION, ELSET=EALL, MATERIAL=STEEL", "*BOUNDARY", "clamp, 1, 3"],
            *["*SURFACE, NAME=SLAVE, TYPE=NODE", "cyclic_high"],
            *["*SURFACE, NAME=MASTER, TYPE=NODE", "cyclic_low"],
            *["*TIE, NAME=CUT, CYCLIC SYMMETRY", "SLAVE, MASTER"],
            f"*CYCLIC SYMMETRY MODEL, N={SECTORS}, NGRAPH=1, TIE=CUT",
            *["0, 0, 0, 0, 0, 1", "*STEP", "*FREQUENCY", str(2 * count)],
            f"*SELECT CYCLIC SYMMETRY MODES, NMIN={diameters[0]}, NMAX={diameters[-1]}",
            "*END STEP\n",
        ]
    )


# CMSX-4 like cubic crystal, and nine constants of no symmetry; angles of the axes [rad]
CRYSTALS = {
    "cubic": {"E": 1.28e11, "nu": 0.38, "G": 1.3e11, "rho": 8700.0, "angles": (0.2, -0.35, 0.6)},
    "orthotropic": {
        "orthotropic": (2.0e11, 1.2e11, 0.8e11, 0.28, 0.22, 0.31, 0.7e11, 0.5e11, 0.4e11),
        "rho": 8200.0,
        "angles": (0.5, 0.1, -0.3),
    },
}


def crystal_job(m, constants, axes, rho, count):
    """A clamped bar of an orthotropic solid for CalculiX; ``axes`` (3, 3) are its own axes in
    columns.
    """
    E1, E2, E3, nu12, nu13, nu23, G12, G13, G23 = constants
    first = [f"{v:.15g}" for v in (E1, E2, E3, nu12, nu13, nu23, G12, G13)]
    return "\n".join(
        [
            *flat_deck(m, {}),
            *["*ORIENTATION, NAME=OR, SYSTEM=RECTANGULAR"],
            ", ".join(f"{v:.15f}" for v in [*axes[:, 0], *axes[:, 1]]),
            *["*MATERIAL, NAME=CRYSTAL", "*ELASTIC, TYPE=ENGINEERING CONSTANTS"],
            *[", ".join(first), f"{G23:.15g}", "*DENSITY", f"{rho}"],
            "*SOLID SECTION, ELSET=EALL, MATERIAL=CRYSTAL, ORIENTATION=OR",
            *["*BOUNDARY", "clamp, 1, 3", "*STEP", "*FREQUENCY", str(count), "*END STEP\n"],
        ]
    )


# thermal expansion along the axes of the orthotropic crystal [1/K]
EXPANSIONS = (1.6e-5, 0.9e-5, -0.4e-5)


def heated_crystal_job(m, constants, axes, rho, hot, count):
    """The bar of the orthotropic solid for CalculiX, unevenly heated, which expands along its axes;
    then its modes about that state.
    """
    lines = crystal_job(m, constants, axes, rho, count).splitlines()
    step = lines.index("*STEP")
    spread = [f"*EXPANSION, TYPE=ORTHO, ZERO={REFERENCE}", ", ".join(map(str, EXPANSIONS))]
    density = lines.index("*DENSITY")
    return "\n".join(
        [
            *lines[:density],
            *spread,
            *lines[density:step],
            *["*INITIAL CONDITIONS, TYPE=TEMPERATURE", f"NALL, {REFERENCE}"],
            *["*STEP", "*STATIC", "*TEMPERATURE"],
            *[f"{i}, {T:.12e}" for i, T in enumerate(hot, 1)],
            *["*NODE PRINT, NSET=NALL", "U", "*END STEP"],
            *["*STEP, PERTURBATION", "*FREQUENCY", str(count), "*END STEP\n"],
        ]
    )


def bar():
    """A clamped bar of 10-node tetrahedra, its mesh and its model."""
    mesh = box((8, 2, 2), (0.12, 0.03, 0.02), "tetra10")
    return mesh, Model(
        mesh.points,
        [("tetra10", mesh.bodies["blade"])],
        {"clamp": np.unique(mesh.faces["clamp"])},
        mesh.faces,
    )


# about its axis [rad/s], and the modes that are coupled
TURNING_SPEED = 800.0
TURNING_MODES = 12


def turning_bar():
    """A nearly square bar along z, held at its foot, that turns about its axis."""
    return box((2, 2, 4), (0.02, 0.021, 0.2), "tetra10", origin=(-0.01, -0.0105, 0.0))


def turning_job(material):
    """Its frequencies without and with Coriolis forces for CalculiX."""
    mesh = turning_bar()
    foot = {"foot": np.unique(mesh.faces["z0"])}
    model = Model(mesh.points, [("tetra10", mesh.bodies["blade"])], foot, mesh.faces)
    pull = ["*DLOAD", f"EALL, CENTRIF, {TURNING_SPEED**2:.12e}, 0., 0., 0., 0., 0., 1."]
    return "\n".join(
        [
            *flat_deck(model, {}),
            *["*BOUNDARY", "foot, 1, 3", "*MATERIAL, NAME=M", "*ELASTIC"],
            *[f"{material.E:.6e}, {material.nu}", "*DENSITY", f"{material.rho:.6e}"],
            "*SOLID SECTION, ELSET=EALL, MATERIAL=M",
            *["*STEP", "*STATIC", *pull, "*END STEP"],
            *["*STEP, PERTURBATION", "*FREQUENCY, STORAGE=YES", str(TURNING_MODES), "*END STEP"],
            *["*STEP, PERTURBATION", "*COMPLEX FREQUENCY, CORIOLIS", str(TURNING_MODES)],
            *[*pull, "*END STEP\n"],
        ]
    )


# reference temperature [K], and rows of temperature [K]: E, nu, expansion, density
REFERENCE = 293.15
ROWS = {
    293.15: (2.1e11, 0.30, 1.10e-5, 8200.0),
    600.0: (1.9e11, 0.31, 1.25e-5, 8150.0),
    1000.0: (1.5e11, 0.34, 1.50e-5, 8050.0),
}


def heat_table():
    """The rows as texts of a scene."""
    return tuple(
        f"{T} K: E={E} Pa; nu={nu}; expansion={a} 1/K; rho={rho} kg/m^3"
        for T, (E, nu, a, rho) in ROWS.items()
    )


def temperature(points):
    """(n,) [K] of places: hot at one end and on one side."""
    x, y = points[:, 0] / 0.12, points[:, 1] / 0.03
    return 300.0 + 500.0 * x**2 + 150.0 * y * (1 - 0.5 * x)


def heated_job(m, hot, count, uniform=None, nlgeom=False):
    """A bar for CalculiX, clamped at the end and at the node set ``far``, heated, then its modes
    about that state.
    """
    n = len(m.points)
    hot = hot if uniform is None else np.full(n, uniform)
    return "\n".join(
        [
            *flat_deck(m, {}),
            *["*MATERIAL, NAME=HOT", "*ELASTIC"],
            *[f"{E}, {nu}, {T}" for T, (E, nu, _, _) in ROWS.items()],
            f"*EXPANSION, ZERO={REFERENCE}",
            *[f"{a}, {T}" for T, (_, _, a, _) in ROWS.items()],
            "*DENSITY",
            *[f"{rho}, {T}" for T, (*_, rho) in ROWS.items()],
            "*SOLID SECTION, ELSET=EALL, MATERIAL=HOT",
            *["*INITIAL CONDITIONS, TYPE=TEMPERATURE", f"NALL, {REFERENCE}"],
            *["*BOUNDARY", "clamp, 1, 3", "far, 1, 3"],
            *[f"*STEP{', NLGEOM' * nlgeom}", "*STATIC", "*TEMPERATURE"],
            *[f"{i}, {T:.12e}" for i, T in enumerate(hot, 1)],
            *["*NODE PRINT, NSET=NALL", "U", "*END STEP"],
            *["*STEP, PERTURBATION", "*FREQUENCY", str(count), "*END STEP\n"],
        ]
    )


def surface_lines(m, name):
    """A surface made of labelled element faces, through internal element sets as CAE writes
    them.
    """
    labels = {
        "tetra": [(0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)],
    }["tetra"]
    (word, cells) = m.blocks[0]
    inside = np.isin(cells[:, :4], m.node_sets[name])
    lines = []
    members = []
    for i, corners in enumerate(labels, 1):
        rows = np.flatnonzero(inside[:, corners].all(axis=1))
        if len(rows):
            lines += [f"*Elset, elset=_{name}_S{i}, internal", *set_lines(rows)]
            members.append(f"_{name}_S{i}, S{i}")
    return [*lines, f"*Surface, type=ELEMENT, name={name}", *members]


def facets_on(m, nodes):
    """Facets of the first block whose nodes are all in a set."""
    word, cells = m.blocks[0]
    every = cells[:, np.array(facet_nodes(word))].reshape(-1, len(facet_nodes(word)[0]))
    return every[np.isin(every, nodes).all(axis=1)]


# corners of the faces that a pressure P1, P2, ... is on in CalculiX
PRESSED_FACES = {
    "hexahedron": [
        *[(0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)]
    ],
    "wedge": [(0, 1, 2), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)],
}
PRESSURE = 1e6


def pressed_mesh(halvings):
    """An open sector of hexahedra and wedges, clamped at its bore, in halves."""
    divisions = (4, 3, 2)
    cubes = sector(SECTORS, divisions, "hexahedron27", bump=0.1)
    mesh = mixed.cut(cubes, divisions, lambda i, j: "hw"[(i + j) % 2])
    mesh = replace(mesh, pairs={}, sector=None)
    for _ in range(halvings):
        mesh = refine_uniformly(mesh)
    return mesh


def serendipity_blocks(mesh):
    """Hexahedra and wedges of a mixed mesh as C3D20 and C3D15 on the same nodes."""
    return [
        ("hexahedron20", own.cells[:, :20])
        if own.word == "hexahedron27"
        else ("wedge15", own.cells[:, :15])
        for own in own_cells(mesh, ("blade",))
    ]


def halved_model(mesh, halvings):
    """A sector of hexahedra and wedges in halves, for CalculiX."""
    for _ in range(halvings):
        mesh = refine_uniformly(mesh)
    return _model(mesh, serendipity_blocks(mesh))


def pressed_job(mesh):
    """The nodes of C3D20 and C3D15 in the same places, and a deck of them under pressure outside."""
    blocks = serendipity_blocks(mesh)
    used = np.unique(np.concatenate([cells.ravel() for _, cells in blocks]))
    number = np.full(len(mesh.points), -1)
    number[used] = np.arange(len(used))
    clamp, outside = (number[np.intersect1d(mesh.faces[name], used)] for name in ("clamp", "x1"))
    m = Model(mesh.points[used], [(w, number[c]) for w, c in blocks], {"clamp": clamp}, {})
    loads = []
    first = 1
    for word, cells in m.blocks:
        for i, corners in enumerate(PRESSED_FACES[FAMILY[word]], 1):
            rows = np.flatnonzero(np.isin(cells[:, corners], outside).all(axis=1))
            loads += [f"{first + row}, P{i}, {PRESSURE}" for row in rows]
        first += len(cells)
    lines = [
        *flat_deck(m, {}),
        *["*MATERIAL, NAME=STEEL", "*ELASTIC", "2.1e11, 0.3"],
        *["*SOLID SECTION, ELSET=EALL, MATERIAL=STEEL", "*BOUNDARY", "clamp, 1, 3"],
        *["*STEP", "*STATIC", "*DLOAD", *loads],
        *["*NODE FILE", "U", "*EL FILE", "S", "*END STEP\n"],
    ]
    return used, "\n".join(lines)
