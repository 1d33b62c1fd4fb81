"""Small writers of foreign files, so that the readers are tested on text that another program would
write.
"""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np

TO_ABAQUS = {"tetra10": [0, 1, 2, 3, 4, 5, 6, 7, 9, 8]}


def write_inp(mesh, file):
    """Abaqus: one part of C3D10, bodies as ELSET, faces as NSET."""
    lines = ["*HEADING", "*NODE"]
    lines += [f"{i + 1}, {x:.15g}, {y:.15g}, {z:.15g}" for i, (x, y, z) in enumerate(mesh.points)]
    number = 0
    for name, cells in mesh.bodies.items():
        lines.append(f"*ELEMENT, TYPE=C3D10, ELSET={name}")
        for cell in cells[:, TO_ABAQUS["tetra10"]] + 1:
            number += 1
            lines.append(", ".join(map(str, [number, *cell])))
    for name, faces in mesh.faces.items():
        lines.append(f"*NSET, NSET={name.upper()}")
        nodes = np.unique(faces) + 1
        lines += [", ".join(map(str, nodes[i : i + 10])) for i in range(0, len(nodes), 10)]
    file.write_text("\n".join(lines) + "\n")


def write_cdb(mesh, file):
    """Ansys archive with SOLID187, element components for the bodies, node components for the
    faces.
    """
    n, count = len(mesh.points), sum(len(c) for c in mesh.bodies.values())
    lines = ["/PREP7", f"NBLOCK,6,SOLID,{n},{n}", "(3i9,6e21.13e3)"]
    lines += [
        f"{i + 1:9d}{0:9d}{0:9d}" + "".join(f"{v:21.13e}" for v in x)
        for i, x in enumerate(mesh.points)
    ]
    lines += ["N,R5.3,LOC,       -1,", f"EBLOCK,19,SOLID,{count},{count}", "(19i9)"]
    number, members = 0, {}
    for name, cells in mesh.bodies.items():
        members[name] = (number + 1, number + len(cells))
        for cell in cells[:, TO_ABAQUS["tetra10"]] + 1:
            number += 1
            head = [1, 1, 1, 1, 0, 0, 0, 0, 10, 0, number]
            lines.append("".join(f"{v:9d}" for v in [*head, *cell[:8]]))
            lines.append("".join(f"{v:9d}" for v in cell[8:]))
    lines.append(f"{-1:9d}")
    for name, (low, high) in members.items():
        lines += [
            f"CMBLOCK,{name.upper():8s},ELEM,{2:8d}  ! element component",
            "(8i10)",
            f"{low:10d}{-high:10d}",
        ]
    for name, faces in mesh.faces.items():
        nodes = np.unique(faces) + 1
        lines += [f"CMBLOCK,{name.upper()},NODE,{len(nodes):8d}", "(8i10)"]
        lines += ["".join(f"{v:10d}" for v in nodes[i : i + 8]) for i in range(0, len(nodes), 8)]
    file.write_text("\n".join([*lines, "FINISH"]) + "\n")


def write_bdf(mesh, file):
    """Nastran bulk data as a preprocessor exports it: case control first, nodes in long fields,
    CTETRA and, for the faces, CTRIA6 shells over two lines; names in comments only.

    Returns the property of each body and face.
    """
    lines = ["$ exported", "SOL 103", "CEND", "METHOD = 1", "BEGIN BULK", "EIGRL,1,,,10"]
    for i, (x, y, z) in enumerate(mesh.points, 1):
        lines.append(f"GRID*   {i:16d}{'':16s}{x:16.9E}{y:16.9E}*")
        lines.append(f"*       {z:16.9E}")
    groups = [("CTETRA", "PSOLID", n, c[:, TO_ABAQUS["tetra10"]]) for n, c in mesh.bodies.items()]
    groups += [("CTRIA6", "PSHELL", name, facets) for name, facets in mesh.faces.items()]
    number, properties = 0, {}
    for pid, (card, kind, name, cells) in enumerate(groups, 1):
        properties[name] = pid
        lines += [f"$ {name}", f"{kind:8s}{pid:8d}{1:8d}"]
        for cell in (cells + 1).tolist():
            number += 1
            words = [f"{v:8d}" for v in (number, pid, *cell)]
            lines.append(f"{card:8s}" + "".join(words[:8]) + "+" * (len(words) > 8))
            lines += ["+       " + "".join(words[8:])] * (len(words) > 8)
    file.write_text("\n".join([*lines, "MAT1    1       2.1+11          0.3", "ENDDATA"]) + "\n")
    return properties


def write_step(file, kind, names):
    """STEP file in millimetres of a "block", a "disc" segment, one of 30 or 180 degrees in two pieces ("split", "half"), "two" blocks or a "hollow" one;
    names[solid] lists that solid's faces, in order.

    In a process of its own: reading a STEP file changes the unit in which OpenCASCADE writes the
    next one.
    """
    root = Path(__file__).parents[2]
    subprocess.run(
        [sys.executable, __file__, str(file), kind],
        check=True,
        cwd=root,
        stdout=subprocess.DEVNULL,
        env={**os.environ, "PYTHONPATH": str(root)},
    )
    text = file.read_text()
    record = "BREP_WITH_VOIDS('" if kind == "hollow" else "MANIFOLD_SOLID_BREP('"
    for solid, faces in names.items():
        text = text.replace(f"{record}',", f"{record}{solid}',", 1)
        for face in faces:
            text = text.replace("ADVANCED_FACE('',", f"ADVANCED_FACE('{face}',", 1)
    file.write_text(text)


def draw_step(file, kind):
    """The process of write_step."""
    from geometry.draw import draw_prism
    from geometry.parameters import Disc
    from geometry.sector import disc_segment
    from geometry.session import gmsh_session

    with gmsh_session() as gmsh:
        if kind == "disc":
            disc_segment(gmsh, Disc(), np.pi / Disc().sectors)
        elif kind in ("split", "half"):
            angle = np.pi / 6 if kind == "split" else np.pi
            # faces of both pieces stay apart
            gmsh.option.setNumber("Geometry.OCCUnionUnify", 0)
            ends = []
            for z, height in ((0.0, 0.02), (0.02, 0.03)):
                outer, inner = (
                    gmsh.model.occ.addCylinder(0, 0, z, 0, 0, height, r, angle=angle)
                    for r in (0.2, 0.08)
                )
                ends.append(gmsh.model.occ.cut([(3, outer)], [(3, inner)])[0])
            gmsh.model.occ.fuse(*ends)
        elif kind in ("two", "hollow"):
            large = gmsh.model.occ.addBox(0, 0, 0, 0.03, 0.04, 0.05)
            place = 0.06 if kind == "two" else 0.01
            small = gmsh.model.occ.addBox(place, 0.01, 0.01, 0.01, 0.01, 0.02)
            if kind == "hollow":
                gmsh.model.occ.cut([(3, large)], [(3, small)])
        else:
            draw_prism(
                gmsh, np.array([[0.1, -0.01], [0.2, -0.01], [0.2, 0.01], [0.1, 0.01]]), 0.0, 0.03
            )
        gmsh.model.occ.dilate(gmsh.model.occ.getEntities(3), 0, 0, 0, 1e3, 1e3, 1e3)
        gmsh.model.occ.synchronize()
        gmsh.write(file)


if __name__ == "__main__":
    draw_step(*sys.argv[1:])
