"""Plain text tables for the terminal."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

__all__ = ["frequencies", "mesh_quality", "plain", "resolved_scene", "summary"]


def plain(rows: Sequence[Sequence[object]], head: Sequence[str] = ()) -> str:
    """Columns side by side: the first to the left, numbers to the right."""
    cells = [[str(c) for c in row] for row in ([head, *rows] if head else rows)]
    if not cells:
        return ""
    widths = [max(len(row[i]) for row in cells) for i in range(len(cells[0]))]
    right = [all(_is_number(row[i]) for row in cells[bool(head):]) for i in range(len(widths))]
    lines = ["  ".join(c.rjust(w) if r else c.ljust(w) for c, w, r in zip(row, widths, right, strict=True)).rstrip()
             for row in cells]
    if head:
        lines.insert(1, "-" * max(map(len, lines)))
    return "\n".join(lines)


def resolved_scene(rows: Sequence[Any]) -> str:
    """Every value of a scene; what the user gave carries a star."""
    lines = [[row.name, row.value, "" if row.is_default else "*", row.help] for row in rows]
    return plain(lines, ["field", "value", "given", "meaning"])


def mesh_quality(mesh: Any) -> str:
    """Sizes of bodies and faces, then what the mesher reports."""
    rows = [["points", len(mesh.points)]]
    rows += [[f"body {name}, cells", len(cells)] for name, cells in mesh.bodies.items()]
    rows += [[f"face {name}, cells", len(cells)] for name, cells in mesh.faces.items()]
    rows += [[f"pair {name}, matched nodes", pair.nodes.shape[1]] for name, pair in mesh.pairs.items()]
    rows += [[name, f"{value:.4g}" if isinstance(value, float) else value] for name, value in mesh.report.items()]
    return plain(rows, ["mesh", "value"])


def frequencies(sets: Sequence[Any]) -> str:
    """Natural frequencies, a row for each nodal diameter."""
    count = max(len(s.frequencies) for s in sets)
    head = ["nodal diameter", *(f"f{i + 1} [Hz]" for i in range(count)), "residual"]
    rows = []
    for s in sets:
        name = "none" if s.nodal_diameter is None else s.nodal_diameter
        values = [f"{f:.2f}" for f in s.frequencies]
        rows.append([name, *values, *[""] * (count - len(values)), f"{max(s.residuals):.1e}"])
    return plain(rows, head)


def summary(run: Any, folder: Path) -> str:
    """Messages of the run and where the time went."""
    total = sum(run.timings.values())
    rows = [[name, f"{t:.2f}", f"{100 * t / total if total else 0:.0f}"] for name, t in run.timings.items()]
    parts = [*run.messages, "", plain([*rows, ["total", f"{total:.2f}", "100"]], ["stage", "time [s]", "share [%]"]),
             f"results: {folder}"]
    return "\n".join(parts)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return text == ""
    return True
