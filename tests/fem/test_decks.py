"""Meshes as other programs write them, against CalculiX on the same mesh (ccx_decks.json,
``python benchmarks/fem_decks.py``).

Hexahedra of 20 nodes are solved with 27, which hold the displacements of the original cells and
more: their frequencies lie at or below CalculiX's. So do wedges of 18 nodes, but for the mass of
CalculiX's, whose nine points leave it inexact (test_mixed_cells.py).
"""

import json
from dataclasses import replace
from pathlib import Path

import decks
import meshio
import numpy as np
import pytest
from structured import box, sector

from bladefem.errors import InputError
from bladefem.fem.body import assemble
from bladefem.fem.constraint import at_diameter, constrain, transformation
from bladefem.fem.modes import modes
from bladefem.fem.refinement import refine_uniformly
from bladefem.fem.temperature_field import mesh_temperatures
from bladefem.scene.tables import Material
from bladefem.scene.temperature_file import GivenTemperatures
from geometry.export import write_msh
from geometry.imported import read_mesh
from geometry.profile import turn_about_axis
from geometry.raw_mesh import read_raw
from geometry.session import gmsh_session
from geometry.topology import facet_nodes

GOLDEN = json.loads((Path(__file__).parent / "ccx_decks.json").read_text())
CAE_NAMES = {"clamp": "Root Nodes", "cyclic_low": "LOW-SIDE", "cyclic_high": "HIGH-SIDE"}
RENAMED = ["clamp = root nodes", "cyclic_low = Low-Side", "cyclic_high = HIGH-SIDE"]


def agrees(file, case, higher, lower, **how):
    """Frequencies between (1 - lower) and (1 + higher) times CalculiX's."""
    mesh = read_mesh(file, sectors=decks.SECTORS, **how)
    quadrature = "ccx" if case in ("c3d10", "c3d4") else "exact"
    t = transformation(assemble(mesh, "blade", Material(), quadrature=quadrature), "clamp", True)
    for n, theirs in GOLDEN[case].items():
        ratio = modes(at_diameter(t, int(n)), 6).frequencies / theirs
        assert ratio.max() < 1 + higher and ratio.min() > 1 - lower, (n, ratio - 1)
    return mesh


def test_c3d20_with_node_sets_only(tmp_path):
    """CalculiX' own way: blanks in names, node sets for everything, two lines an element."""
    deck = decks.flat_deck(decks.model("c3d20"), CAE_NAMES)
    (tmp_path / "a.inp").write_text("\n".join(deck))
    mesh = agrees(tmp_path / "a.inp", "c3d20", 1e-6, 1e-2, names=RENAMED)
    assert mesh.cell_type == "hexahedron27" and mesh.faces["cyclic_low"].shape[1] == 9


def test_reduced_integration_of_calculix_is_within_one_per_cent(tmp_path):
    """Reduced integration is softer on a coarse mesh; elements here are integrated fully."""
    deck = decks.flat_deck(decks.model("c3d20"), {}, "C3D20R")
    (tmp_path / "a.inp").write_text("\n".join(deck))
    agrees(tmp_path / "a.inp", "c3d20r", 1e-2, 1e-2)


def test_wedges_and_hexahedra(tmp_path):
    deck = decks.flat_deck(decks.model("c3d15_c3d20"), {})
    (tmp_path / "a.inp").write_text("\n".join(deck))
    mesh = agrees(tmp_path / "a.inp", "c3d15_c3d20", 3e-4, 1.2e-3)
    assert mesh.cell_type == "tetra10" and "solved as they are" in mesh.report["notes"][0]


def test_c3d10_with_element_surfaces_and_includes(tmp_path):
    """Byte order mark, CRLF, comments, continued keyword lines, *Include, faces as *Surface."""
    m = decks.model("c3d10")
    (tmp_path / "mesh").mkdir()
    (tmp_path / "mesh" / "nodes.inc").write_text("\r\n".join(decks.node_lines(m.points, ",")))
    lines = [
        *[
            "** exported",
            "*Heading",
            "",
            " *NODE ,",
            "  NSET=all",
            "*Include, input=mesh/nodes.inc",
        ],
        "*Element,type=C3D10 ,ELSET = Solid",
        *decks.element_lines(decks.abaqus_cells(*m.blocks[0]), wrap=8),
        "",
        *(line for name in m.node_sets for line in decks.surface_lines(m, name)),
        *["*Boundary", "clamp, 1, 3", "*Step", "*Frequency", "10", "*End Step", ""],
    ]
    # nodes are data of the keyword before *Include
    lines = [line for line in lines if line not in (" *NODE ,", "  NSET=all")]
    text = (tmp_path / "mesh" / "nodes.inc").read_text()
    (tmp_path / "mesh" / "nodes.inc").write_text(f"*Node, nset=all\r\n{text}")
    (tmp_path / "a.inp").write_bytes(b"\xef\xbb\xbf" + "\r\n".join(lines).encode())
    agrees(tmp_path / "a.inp", "c3d10", 1e-6, 1e-6)


def test_linear_tetrahedra_on_request_only(tmp_path):
    deck = decks.flat_deck(decks.model("c3d4"), {})
    (tmp_path / "a.inp").write_text("\n".join(deck))
    with pytest.raises(InputError, match=r"tetrahedra of first order .* imported\.linear"):
        read_mesh(tmp_path / "a.inp", sectors=decks.SECTORS)
    mesh = agrees(tmp_path / "a.inp", "c3d4", 1e-6, 1e-6, linear="promote")
    assert "promoted to second order" in mesh.report["notes"][0]
    kept = read_mesh(tmp_path / "a.inp", sectors=decks.SECTORS, linear="keep")
    assert kept.cell_type == "tetra" and "far too stiff" in kept.report["notes"][0]


def test_parts_and_instances_of_cae(tmp_path):
    """An assembly: the part lies elsewhere and is moved, sets of the assembly name an instance,
    springs and a reference point are left out.
    """
    m = decks.model("c3d10")
    lines = ["*Heading", "** Job name: a", "*Part, name=Blade-Part"]
    lines += ["*Node", *decks.node_lines(m.points - [0.0, 0.5, 0.0])]
    lines += ["*Element, type=C3D10"]
    lines += decks.element_lines(decks.abaqus_cells(*m.blocks[0]))
    lines += ["*Elset, elset=SET-1, generate", f" 1, {len(m.blocks[0][1])}, 1"]
    lines += ["*Solid Section, elset=SET-1, material=Steel", ",", "*End Part", "**"]
    lines += ["*Assembly, name=Assembly", "*Instance, name=Blade-1, part=Blade-Part"]
    lines += ["0., 0.5, 0.", "*End Instance", "*Node", "900001, 0., 0., 0."]
    lines += ["*Element, type=SPRING1, elset=Ground", "900001, 900001"]
    for name, nodes in m.node_sets.items():
        lines += [f"*Nset, nset={name}, instance=Blade-1", *decks.set_lines(nodes)]
    lines += ["*End Assembly", "*Material, name=Steel", "*Elastic", "2.1e+11, 0.3"]
    (tmp_path / "a.inp").write_text("\n".join(lines))
    mesh = agrees(tmp_path / "a.inp", "c3d10", 1e-6, 1e-6)
    assert "1 elements of type SPRING1 were left out" in mesh.report["notes"]
    assert set(mesh.parts) == {"set-1"}


@pytest.mark.parametrize("kind, linear", [("c3d20", "refuse"), ("c3d4", "promote")])
def test_temperatures_by_the_numbers_of_the_deck(kind, linear, tmp_path):
    """Exact on the nodes of the file, whose numbers start at 1001 here, and between them on those that
    the reader adds.
    """
    model = decks.model(kind)
    lines = []
    for line in decks.flat_deck(model, {}):
        head, *rest = line.split(",")
        if line.startswith("*"):
            of_nodes = line.upper().startswith(("*NODE", "*NSET"))
            of_cells = line.upper().startswith("*ELEMENT")
        elif of_nodes:
            tags = [v for v in line.split(",") if v.strip()]
            many = len(tags) if lines_of_sets(lines) else 1
            line = ",".join([str(int(v) + 1000) for v in tags[:many]] + tags[many:])
        elif of_cells:
            line = ",".join(v if not v.strip() else str(int(v) + 1000) for v in line.split(","))
        lines.append(line)
    (tmp_path / "a.inp").write_text("\n".join(lines))
    mesh = read_mesh(tmp_path / "a.inp", sectors=decks.SECTORS, linear=linear)

    def field(x):
        # the sector is turned about z when it is read
        return 400.0 + 300.0 * x[:, 2] + 800.0 * (x[:, 0] ** 2 + x[:, 1] ** 2)

    nodes = np.arange(1001, 1001 + len(model.points))
    given = GivenTemperatures(field(model.points), None, nodes)
    found = mesh_temperatures(mesh, given)
    own = mesh.numbers >= 0
    np.testing.assert_allclose(found[own], field(mesh.points[own]), rtol=1e-9)
    assert own.sum() == len(model.points) < len(mesh.points)
    np.testing.assert_allclose(found, field(mesh.points), atol=2.0)
    with pytest.raises(InputError, match="or the mesh was refined"):
        mesh_temperatures(refine_uniformly(mesh), given)
    with pytest.raises(
        InputError, match=r"nodes of the bodies have no temperature, such as 1\d\d\d"
    ):
        mesh_temperatures(mesh, GivenTemperatures(given.values[:9], None, nodes[:9]))
    with pytest.raises(InputError, match="has no node 5"):
        mesh_temperatures(mesh, GivenTemperatures(field(model.points), None, nodes - 996))


def lines_of_sets(lines):
    """The last keyword is one of node sets."""
    return next(x for x in reversed(lines) if x.startswith("*")).upper().startswith("*NSET")


def test_a_deck_in_sixteen_bit_text_agrees_with_calculix(tmp_path):
    deck = decks.flat_deck(decks.model("c3d10"), {})
    (tmp_path / "a.inp").write_bytes("\n".join(deck).encode("utf-16"))
    agrees(tmp_path / "a.inp", "c3d10", 1e-6, 1e-6)


def cdb_lines(m, names):
    """CDWRITE of SOLID186: wedges are hexahedra with repeated nodes."""
    lines = ["/PREP7", "ET,        1,186", f"NBLOCK,6,SOLID,{len(m.points)},{len(m.points)}"]
    lines += ["(3i9,6e21.13e3)"]
    for i, x in enumerate(m.points, 1):
        lines.append(f"{i:9d}{0:9d}{0:9d}" + "".join(f"{v:21.13e}" for v in x))
    count = sum(len(cells) for _, cells in m.blocks)
    lines += ["N,R5.3,LOC,       -1,", f"EBLOCK,19,SOLID,{count},{count}", "(19i9)"]
    wedge = [0, 1, 2, 2, 3, 4, 5, 5, 6, 7, 2, 8, 9, 10, 5, 11, 12, 13, 14, 14]
    number = 0
    for word, cells in m.blocks:
        for cell in decks.abaqus_cells(word, cells):
            number += 1
            nodes = cell if word == "hexahedron20" else cell[wedge]
            head = [1, 1, 1, 1, 0, 0, 0, 0, 20, 0, number]
            lines.append("".join(f"{v:9d}" for v in [*head, *nodes[:8]]))
            lines.append("".join(f"{v:9d}" for v in nodes[8:]))
    lines.append(f"{-1:9d}")
    for name, nodes in m.node_sets.items():
        lines += [f"CMBLOCK,{names.get(name, name).upper()},NODE,{len(nodes):8d}", "(8i10)"]
        tags = np.sort(nodes) + 1
        lines += ["".join(f"{v:10d}" for v in tags[i : i + 8]) for i in range(0, len(tags), 8)]
    return [*lines, "FINISH"]


def test_ansys_hexahedra_and_wedges_with_node_components(tmp_path):
    m = decks.model("c3d15_c3d20")
    (tmp_path / "a.cdb").write_text("\n".join(cdb_lines(m, {"clamp": "N_BORE"})) + "\n")
    agrees(tmp_path / "a.cdb", "c3d15_c3d20", 3e-4, 1.2e-3, names=["clamp = n_bore"])


@pytest.mark.parametrize("suffix", ["bdf", "vtu"])
def test_nastran_and_vtk(suffix, tmp_path):
    """Faces as shells with properties; as cell blocks without names in .vtu, so only read there."""
    m = decks.model("c3d10")
    blocks = [(w, decks.abaqus_cells(w, c) - 1) for w, c in m.blocks]
    marks = [np.ones(len(blocks[0][1]), int)]
    for i, nodes in enumerate(m.node_sets.values(), 2):
        face = decks.facets_on(m, nodes)
        blocks.append(("triangle6", face))
        marks.append(np.full(len(face), i))
    data = {"nastran:ref": marks} if suffix == "bdf" else {}
    meshio.write(tmp_path / f"a.{suffix}", meshio.Mesh(m.points, blocks, cell_data=data))
    if suffix == "bdf":
        names = [f"{name} = pid_{i}" for i, name in enumerate(m.node_sets, 2)]
        # eight characters a number
        agrees(tmp_path / "a.bdf", "c3d10", 1e-4, 1e-4, names=names)
    else:
        mesh = read_mesh(tmp_path / "a.vtu")
        assert mesh.bodies["blade"].shape == m.blocks[0][1].shape


def test_sector_and_damper_in_two_files(tmp_path):
    """The damper of the second file is a body of its own and leaves the blade's modes alone."""
    m = decks.model("c3d10")
    (tmp_path / "a.inp").write_text("\n".join(decks.flat_deck(m, {})))
    block = decks.flat_deck(decks.Model(m.points + [1.0, 0, 0], m.blocks, {}, {}), {})
    (tmp_path / "b.inp").write_text("\n".join(block))
    more = [f"damper = {tmp_path / 'b.inp'}"]
    mesh = agrees(tmp_path / "a.inp", "c3d10", 1e-6, 1e-6, more=more)
    assert mesh.bodies["damper"].shape == mesh.bodies["blade"].shape


def test_a_damper_of_another_file_is_as_hot_as_what_it_touches(tmp_path):
    """Numbers are those of the first file; a body far from all given nodes is refused."""
    bar, m = decks.bar()
    (tmp_path / "a.inp").write_text("\n".join(decks.flat_deck(m, {})))
    given = GivenTemperatures(400.0 + 1000.0 * m.points[:, 0], None, 1 + np.arange(len(m.points)))
    low = np.ptp(m.points[:, 2])
    for lift, fits in ((0.2 * low, True), (9 * low, False)):
        small = m.points * [0.5, 0.5, 0.1] + [0.03, 0.0, lift]
        block = decks.flat_deck(decks.Model(small, m.blocks, {}, {}), {})
        (tmp_path / "b.inp").write_text("\n".join(block))
        mesh = read_mesh(tmp_path / "a.inp", more=[f"damper = {tmp_path / 'b.inp'}"])
        if not fits:
            with pytest.raises(InputError, match="away from all given places"):
                mesh_temperatures(mesh, given)
            continue
        found = mesh_temperatures(mesh, given)
        np.testing.assert_allclose(found, 400.0 + 1000.0 * mesh.points[:, 0], rtol=1e-9)
    assert bar.cell_type == mesh.cell_type


@pytest.mark.parametrize("axis", [(0.0, 0.0, 1.0), (1.0, 0.0, 0.0)])
def test_places_of_temperatures_are_in_the_axes_of_the_file(axis, tmp_path):
    """A sector 17 degrees off x, or about x, is as hot by the places of its nodes as by their
    numbers; the reader turns it to x and z. The field, equal on the cut faces, has 80 K over a
    sector.
    """
    drawn = sector(12)
    off = turn_about_axis(np.deg2rad(17.0))
    if axis[0]:
        off = np.array([[0, 0, 1.0], [1, 0, 0], [0, 1, 0]]) @ off
    mesh = replace(drawn, points=drawn.points @ off.T)
    write_msh(mesh, tmp_path / "a.msh")
    raw = read_raw(tmp_path / "a.msh")
    count = drawn.sector.count
    x, y, _ = (raw.points @ off).T
    heat = 600.0 + 1000.0 * np.hypot(x, y) + 40.0 * np.cos(count * np.arctan2(y, x))
    found = read_mesh(tmp_path / "a.msh", sectors=count, axis=axis)
    by_place = mesh_temperatures(found, GivenTemperatures(heat, raw.points, None))
    by_number = mesh_temperatures(found, GivenTemperatures(heat, None, raw.numbers))
    assert found.turn is not None and np.ptp(by_number) > 80.0
    np.testing.assert_allclose(by_place, by_number, atol=1e-6)


@pytest.mark.parametrize(
    "lines, words",
    [
        (["*NODE", "1, 0, x, 0"], r"line 2: '1, 0, x, 0' is no node"),
        (["*NODE", "1, 0, 0, 0", "*ELEMENT, TYPE=C3D4", "1, 1, 2, 3, 4"], "node 2, which is not"),
        (["*ELEMENT, TYPE=C3D4", "1, 1, 2, 3"], r"line 2: element 1 has 3 nodes, expected 4"),
        (["*INCLUDE, INPUT=none.inp"], r"line 1: \*INCLUDE, INPUT=none.inp: there is no such file"),
        (["*INCLUDE, INPUT=a.inp"], "goes in circles"),
        (["*NSET, NSET=a", "b"], r"line 2: there is no node set 'b'"),
        (["*INSTANCE, NAME=a, PART=b"], "line 1: .*part 'b' that is not there"),
        (["*NODE", "1, 0, 0, 0", "*ELEMENT, TYPE=B31", "1, 1, 1"], "cells are missing"),
        (["*NODE, SYSTEM=X", "1, 0, 0, 0"], r"line 1: \*NODE, SYSTEM=X: expected R, C or S"),
        (["*NODE", "1, 0, 0, 0", "*NGEN", "1, 9, 2"], r"line 3: \*NGEN is not followed"),
        (["*ELEMENT, TYPE=C3D4, INPUT=b.txt"], r"line 1: \*ELEMENT with INPUT is not followed"),
        (["*NODE", "1, 0, 0, nan", "*NSET, NSET=a, GENERATE", "1, x"], "line 4: '1, x'"),
    ],
)
def test_what_cannot_be_used_is_one_sentence(lines, words, tmp_path):
    (tmp_path / "a.inp").write_text("\n".join(lines))
    with pytest.raises(InputError, match=words) as caught:
        read_mesh(tmp_path / "a.inp")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("last", ["Abaqus", "VTK"])
def test_hexahedra_of_27_nodes_with_their_middles_where_programs_list_them(last, tmp_path):
    """Abaqus' node 21 is in the middle of the cell, 22 to 27 in those of the faces S1 to S6; VTK
    lists -x +x -y +y -z +z and the cell.
    """
    mesh = sector(decks.SECTORS, (3, 2, 2), "hexahedron27", bump=0.2)
    cells = mesh.bodies["blade"]
    # gmsh lists the faces z = 0, y = 0, x = 0, x = 1, y = 1, z = 1 of the unit cell, then the cell
    order = {"Abaqus": [26, 20, 25, 21, 23, 24, 22], "VTK": [22, 23, 21, 24, 20, 25, 26]}[last]
    outer = decks.abaqus_cells("hexahedron20", cells[:, :20])
    whole = np.hstack([outer, cells[:, order] + 1])
    lines = ["*NODE", *decks.node_lines(mesh.points), "*ELEMENT, TYPE=C3D27"]
    (tmp_path / "a.inp").write_text("\n".join([*lines, *decks.element_lines(whole)]))
    raw = read_raw(tmp_path / "a.inp")
    np.testing.assert_array_equal(raw.blocks[0][1], cells)


@pytest.mark.parametrize("system", ["C", "S"])
def test_nodes_in_cylindrical_and_spherical_coordinates(system, tmp_path):
    """*NODE, SYSTEM=C: radius, angle in degrees, z; S: radius, angle, angle above the x-y plane."""
    m = decks.model("c3d10")
    radius, angle = np.hypot(*m.points[:, :2].T), np.degrees(np.arctan2(*m.points[:, 1::-1].T))
    given = [radius, angle, m.points[:, 2]]
    if system == "S":
        far = np.linalg.norm(m.points, axis=1)
        given = [far, angle, np.degrees(np.arcsin(m.points[:, 2] / far))]
    lines = decks.flat_deck(replace(m, points=np.column_stack(given)), {})
    lines[lines.index("*NODE, NSET=NALL")] += f", SYSTEM={system}"
    (tmp_path / "a.inp").write_text("\n".join(lines))
    np.testing.assert_allclose(read_raw(tmp_path / "a.inp").points, m.points, atol=1e-12)


@pytest.mark.parametrize(
    "card",
    ["GRID,7,3,1.,90.,0.", "GRID           7       3", "GRDSET,,3", f"GRID*   {7:16d}{3:16d}"],
)
def test_bulk_data_in_other_coordinates_are_refused(card, tmp_path):
    (tmp_path / "a.bdf").write_text(f"BEGIN BULK\n{card}\nENDDATA\n")
    with pytest.raises(InputError, match=r"line 2: coordinates in the system 3, expected the"):
        read_raw(tmp_path / "a.bdf")


def test_a_reader_that_leaves_the_program(tmp_path, monkeypatch):
    """meshio ends the process on some files; here that is a sentence like any other."""
    (tmp_path / "a.vtu").write_text("<nothing>")
    with pytest.raises(InputError, match=r"a\.vtu': cannot be read as \.vtu"):
        read_mesh(tmp_path / "a.vtu")


def test_cells_that_do_not_fit(tmp_path):
    """Two tetrahedra that share an edge but not the node in its middle: dolfinx would crash."""
    m = decks.model("c3d10")
    cells = m.blocks[0][1].copy()
    cells[5, 4] = len(m.points)
    points = np.vstack([m.points, m.points[m.blocks[0][1][5, 4]]])
    (tmp_path / "a.inp").write_text(
        "\n".join(decks.flat_deck(decks.Model(points, [("tetra10", cells)], {}, {}), {}))
    )
    with pytest.raises(InputError, match="that do not fit"):
        read_mesh(tmp_path / "a.inp")


@pytest.mark.parametrize("corner", [False, True])
def test_a_wrong_node_in_the_middle_of_an_edge(corner, tmp_path):
    """One number of one element is another one: memory of the finite elements broke on it."""
    m = decks.model("c3d10")
    ((word, cells),) = m.blocks
    cells = cells.copy()
    # the middle of a boundary edge, which this cell has alone
    ends = np.sort(cells[:, :4][:, [[0, 1], [1, 2], [2, 0], [3, 0], [2, 3], [1, 3]]].reshape(-1, 2))
    _, number, count = np.unique(ends, axis=0, return_inverse=True, return_counts=True)
    alone = np.flatnonzero(count[number.ravel()] == 1)[0]
    cells[alone // 6, 4 + alone % 6] = cells[-1, 0] if corner else cells[-1, 5]
    wrong = decks.Model(m.points, [(word, cells)], m.node_sets, m.faces)
    (tmp_path / "a.inp").write_text("\n".join(decks.flat_deck(wrong, {})))
    with pytest.raises(InputError, match="in the middle of two edges, or at a corner too"):
        read_mesh(tmp_path / "a.inp", sectors=decks.SECTORS)


def test_a_deck_that_gmsh_writes(tmp_path):
    """Its surface and line elements are element sets too, and its names have no node sets."""
    with gmsh_session() as gmsh:
        gmsh.model.occ.addBox(0, 0, 0, 0.2, 0.05, 0.03)
        gmsh.model.occ.synchronize()
        ends = {}
        for _, tag in gmsh.model.getEntities(2):
            ends[round(gmsh.model.occ.getCenterOfMass(2, tag)[0], 6)] = tag
        gmsh.model.addPhysicalGroup(2, [ends[0.0]], name="clamp")
        gmsh.model.addPhysicalGroup(2, [ends[0.2]], name="tip_mid")
        gmsh.model.addPhysicalGroup(3, [1], name="blade")
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.03)
        gmsh.option.setNumber("Mesh.SaveAll", 1)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(2)
        gmsh.write(str(tmp_path / "a.inp"))
    mesh = read_mesh(tmp_path / "a.inp")
    assert set(mesh.faces) >= {"clamp", "tip_mid"} and mesh.cell_type == "tetra10"
    found = modes(constrain(assemble(mesh, "blade", Material())), 1).frequencies[0]
    # Euler and Bernoulli, stiffened by nothing: the shear of a beam with span over height of 6.7
    beam = 1.8751**2 * np.sqrt(2.1e11 * 0.03**2 / 12 / 7850) / 0.2**2 / (2 * np.pi)
    assert 0.97 * beam < found < 1.01 * beam


def test_hexahedra_pyramids_and_tetrahedra_in_one_deck(tmp_path):
    """One cell of a bar of hexahedra as five pyramids about its centre, and two tetrahedra where its
    sixth face is free; promoted to second order, with a byte order mark. All become tetrahedra,
    which are stiffer than hexahedra: measured 1.5 %.
    """
    mesh = box((4, 2, 2), (0.2, 0.05, 0.05), "hexahedron")
    cells = mesh.bodies["blade"]
    free = {tuple(sorted(face)) for face in mesh.faces["z0"].tolist()}
    sides = [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
    number = next(
        i
        for i, cell in enumerate(cells)
        if tuple(sorted(cell[[0, 1, 2, 3]].tolist())) in free
        or tuple(sorted(cell[[0, 1, 5, 4]].tolist())) in free
    )
    cell = cells[number]
    centre = len(mesh.points)
    points = np.vstack([mesh.points, mesh.points[cell].mean(axis=0)])
    pyramids = []
    tetrahedra = []
    for face in sides:
        a, b, c, d = cell[list(face)].tolist()
        if tuple(sorted((a, b, c, d))) in free:
            tetrahedra += [[a, b, c, centre], [a, c, d, centre]]
        else:
            pyramids.append([a, b, c, d, centre])
    assert (len(pyramids), len(tetrahedra)) == (5, 2)
    blocks = [("C3D8", cells), ("C3D8", np.delete(cells, number, axis=0))]
    blocks += [("C3D5", np.array(pyramids)), ("C3D4", np.array(tetrahedra))]
    found = []
    for chosen in (blocks[:1], blocks[1:]):
        lines = ["*NODE", *decks.node_lines(points)]
        for first, (kind, some) in enumerate(chosen, 1):
            lines += [f"*ELEMENT, TYPE={kind}", *decks.element_lines(some + 1, 1000 * first)]
        lines += ["*NSET, NSET=clamp", *decks.set_lines(np.unique(mesh.faces["x0"]))]
        file = tmp_path / f"{len(chosen)}.inp"
        file.write_bytes("\ufeff".encode() + "\n".join(lines).encode())
        body = assemble(read_mesh(file, linear="promote"), "blade", Material())
        found.append(modes(constrain(body), 4).frequencies)
    np.testing.assert_allclose(found[1], found[0], rtol=0.02)


def test_sets_of_elements_that_are_left_out(tmp_path):
    """Another set may name the set of a beam; one range of a set that fills the memory is a slip."""
    lines = decks.flat_deck(decks.model("c3d10"), {})
    lines += ["*ELEMENT, TYPE=B31, ELSET=WIRES", "9001, 1, 2", "*ELSET, ELSET=ALL", "WIRES, EALL"]
    (tmp_path / "a.inp").write_text("\n".join(lines))
    assert "1 elements of type B31 were left out" in read_raw(tmp_path / "a.inp").notes
    (tmp_path / "b.inp").write_text(
        "\n".join([*lines, "*NSET, NSET=N, GENERATE", "1, 999999999999"])
    )
    with pytest.raises(InputError, match="expected at most 50000000"):
        read_raw(tmp_path / "b.inp")


@pytest.mark.parametrize("suffix", ["inp", "bdf", "vtu"])
def test_garbled_decks_are_one_sentence(suffix, tmp_path):
    """Cut off, with lines exchanged, and with letters changed."""
    m = decks.model("c3d10")
    file = tmp_path / f"whole.{suffix}"
    if suffix == "inp":
        file.write_text("\n".join(decks.flat_deck(m, {})))
    else:
        meshio.write(file, meshio.Mesh(m.points, [("tetra10", m.blocks[0][1])]))
    text = file.read_text()
    rng = np.random.default_rng(0)
    refused = 0
    for number in range(30):
        garbled = list(text[: rng.integers(len(text))] if number % 3 == 0 else text)
        for place in rng.integers(len(garbled), size=number):
            garbled[place] = chr(rng.integers(32, 127))
        other = tmp_path / f"{number}.{suffix}"
        other.write_text("".join(garbled))
        try:
            read_mesh(other)
        except InputError as error:
            refused += 1
            assert "\n" not in str(error) and len(str(error)) < 600
    assert refused > 15


def test_quadratic_facets_are_whole():
    """Facets of hexahedra of 27 nodes hold their centre, those of 10-node tetrahedra 6 nodes."""
    assert {len(f) for f in facet_nodes("hexahedron27")} == {9}
    assert {len(f) for f in facet_nodes("hexahedron")} == {4}
    assert {len(f) for f in facet_nodes("wedge18")} == {6, 9}
    assert {len(f) for f in facet_nodes("tetra10")} == {6}
