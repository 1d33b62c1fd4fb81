"""bladefem look FILE: what a mesh file holds, on the terminal, as a picture, as a scene to start
from.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from geometry.look import is_drawing

from ..errors import InputError
from ..util.communicator import Communicator
from .commands import make_folder_of, refuse_picture
from .tables import plain_table

if TYPE_CHECKING:
    from geometry.look import Look

# faces in the table
MAX_LISTED_FACES = 24


def add_look(sub: argparse.ArgumentParser) -> None:
    """The command's arguments."""
    sub.add_argument("file", help="mesh or STEP file, such as sector.inp, .cdb, .bdf, .msh, .step")
    sub.add_argument("--view", metavar="PNG", help="draw the numbered faces into this file")
    sub.add_argument(
        "--scene",
        metavar="TOML",
        nargs="?",
        const="",
        help="write a scene to start from (default: next to the mesh file)",
    )


def look(options: argparse.Namespace, comm: Communicator | None) -> None:
    """Print, draw and write what was asked for; rank 0 alone."""
    from geometry.look import look_at, starting_scene

    if comm is not None and comm.rank:
        return
    target = None
    if options.scene is not None:
        target = Path(options.scene or Path(options.file).with_suffix(".toml"))
        if target.exists():
            raise InputError(f"--scene {target}: the file is there already, expected another name")
        make_folder_of(target, "--scene")
    if options.view is not None:
        refuse_picture(options.view)
    found = look_at(options.file)
    print(describe_look(found))
    if options.view is not None:
        from ..view.look import draw_look

        draw_look(found, options.view)
        print(f"picture: {options.view}")
    if target is not None:
        target.write_text(starting_scene(found, target.parent), encoding="utf-8")
        print(f"scene: {target}")


def describe_look(found: Look) -> str:
    """Everything in words and tables; lengths in the file's unit, those of a drawing in metres."""
    lines = _of_drawing(found) if is_drawing(found.file) else _of_mesh(found)
    if found.cut is not None:
        lines.append(
            f"cut faces: {' + '.join(found.cut.low)} -> {' + '.join(found.cut.high)}, "
            f"{found.cut.sectors} sectors about {found.cut.axis}"
        )
    else:
        lines.append(
            "cut faces: none found, as no face lies on another one after a turn of one sector "
            "about x, y or z"
        )
    # of a drawing they are its faces, which are listed below
    sets = [] if is_drawing(found.file) else [[n, what] for n, what in found.sets.items()]
    faces = [
        [
            face.name,
            str(face.facets),
            f"{face.area:.5g}",
            " ".join(f"{v:.4g}" for v in face.centre),
            "plane" if face.plane else "curved",
        ]
        for face in found.faces[:MAX_LISTED_FACES]
    ]
    if sets:
        lines += [plain_table(sets, ["set", "holds"]), ""]
    else:
        lines += [""] if is_drawing(found.file) else ["no named sets", ""]
    lines.append(plain_table(faces, ["face", "facets", "area", "centre", "shape"]))
    if len(found.faces) > MAX_LISTED_FACES:
        lines.append(f"and {len(found.faces) - MAX_LISTED_FACES} smaller faces")
    if found.alike:
        guessed = ", ".join(f"{new} = {old}" for new, old in found.alike.items())
        lines += ["", f"by their names: {guessed} (guessed)"]
    if found.missing:
        lines += ["", "not in the file:", *(f"  {sentence}" for sentence in found.missing)]
    return "\n".join(lines)


def _of_drawing(found: Look) -> list[str]:
    """Solids and size of a STEP file."""
    size = 1e3 * (found.box[1] - found.box[0])
    count = f"{len(found.bodies)} solid{'s' if len(found.bodies) > 1 else ''}"
    return [
        f"{count}, {size[0]:.6g} x {size[1]:.6g} x {size[2]:.6g} mm; centres in m, areas in m^2"
    ]


def _of_mesh(found: Look) -> list[str]:
    """Cells, bodies and size of a mesh."""
    size = found.box[1] - found.box[0]
    cells = ", ".join(f"{count} {word}" for word, count in found.cells.items())
    return [
        f"cells: {cells}",
        f"bodies: {len(found.bodies)} of {', '.join(map(str, found.bodies[:8]))} solid cells",
        f"size: {size[0]:.6g} x {size[1]:.6g} x {size[2]:.6g} in the file's unit; scale = "
        f"{found.scale:g} makes it {found.scale * size.max():.4g} m long (guessed)",
        *found.raw.notes,
    ]
