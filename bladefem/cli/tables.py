"""Plain text tables for the terminal."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import pi
from typing import TYPE_CHECKING, Any

from geometry.quality import quality_rows

from ..scene.units import show
from ..util.message import Message, by_level

if TYPE_CHECKING:
    import pandas as pd

    from geometry.mesh import Mesh

    from ..data import ModeSet, PortModel, PressureMap
    from ..study.modes.survey import Survey
    from ..study.pipeline.linear_limits import Limit
    from ..study.pipeline.reduced_sector import Reduced
    from ..study.pipeline.run_records import Response, Run, SolvedRun


# letters of the line below a head; help texts in a last column are longer
MAX_RULE_WIDTH = 150


def plain_table(rows: Sequence[Sequence[object]], head: Sequence[str] = ()) -> str:
    """Columns side by side: the first to the left, numbers to the right."""
    cells = [[str(c) for c in row] for row in ([head, *rows] if head else rows)]
    if not cells:
        return ""
    widths = [max(len(row[i]) for row in cells) for i in range(len(cells[0]))]
    right = [all(_is_number(row[i]) for row in cells[bool(head) :]) for i in range(len(widths))]
    lines = [
        "  ".join(
            c.rjust(w) if r else c.ljust(w) for c, w, r in zip(row, widths, right, strict=True)
        ).rstrip()
        for row in cells
    ]
    if head:
        lines.insert(1, "-" * min(max(map(len, lines)), MAX_RULE_WIDTH))
    return "\n".join(lines)


def frame_table(table: pd.DataFrame) -> str:
    """A pandas table of texts, titles at the head."""
    return plain_table(table.to_numpy().tolist(), list(table.columns))


def resolved_scene(rows: Sequence[Any]) -> str:
    """Every value of a scene; what the user gave carries a star."""
    lines = [[row.name, row.value, "" if row.is_default else "*", row.help] for row in rows]
    return plain_table(lines, ["field", "value", "given", "meaning"])


def mesh_quality(mesh: Mesh) -> str:
    """Sizes of bodies and faces, then what the mesher reports."""
    rows: list[Sequence[object]] = [["nodes", len(mesh.points)]]
    rows += [[f"body {name}, cells", len(cells)] for name, cells in mesh.bodies.items()]
    rows += [[f"volume {name}, cells", len(part)] for name, part in mesh.parts.items()]
    rows += [[f"face {name}, cells", len(cells)] for name, cells in mesh.faces.items()]
    rows += [row for row in quality_rows(mesh) if row[0] not in ("elements", "nodes")]
    return plain_table(rows, ["mesh", "value"])


def frequency_table(sets: Sequence[ModeSet]) -> str:
    """Natural frequencies, a row for each nodal diameter."""
    count = max(len(s.frequencies) for s in sets)
    head = ["nodal diameter", *(f"f{i + 1} [Hz]" for i in range(count)), "residual"]
    rows = []
    for s in sets:
        name = "none" if s.nodal_diameter is None else s.nodal_diameter
        values = [f"{f:.2f}" for f in s.frequencies]
        rows.append([name, *values, *[""] * (count - len(values)), f"{max(s.residuals):.1e}"])
    return plain_table(rows, head)


def reduction_table(reduced: Reduced) -> str:
    """Size of the reduced bodies: a row for each nodal diameter of the blade, one for the
    damper.
    """

    def row(name: str, body: PortModel) -> list[object]:
        return [name, len(body.omega), f"{body.omega.max() / (2 * pi):.1f}", body.shapes.shape[0]]

    rows = [
        row(f"sector, nodal diameter {n}" if reduced.sectors else "blade", body)
        for n, body in reduced.sector.items()
    ]
    return plain_table(
        [*rows, row("damper", reduced.damper)], ["body", "modes", "highest [Hz]", "port dofs"]
    )


def survey_tables(found: Survey) -> str:
    """Frequencies, and the short tables of what was asked for in addition."""
    parts = [frequency_table(found.run.modes)]
    if found.campbell is not None:
        parts.append(_crossing_table(found.campbell.crossings))
    if found.convergence is not None:
        parts.append(_convergence_table(found.convergence.summary))
    if found.answer is not None:
        columns = ["mode", "frequency", "amplitude", "phase", "largest", "peaked"]
        parts.append(report_table(found.answer.resonances[columns]))
    if found.mac is not None:
        rows = [[i + 1, row.argmax() + 1, f"{row.max():.4f}"] for i, row in enumerate(found.mac)]
        parts.append(plain_table(rows, ["mode", "mode of the other run", "MAC"]))
    return "\n\n".join(parts)


def _crossing_table(crossings: pd.DataFrame) -> str:
    """Where engine orders cross modes in the Campbell diagram."""
    if crossings.empty:
        return "no engine order crosses a mode in this range of speeds"
    rows = [
        [row.engine_order, row.mode, f"{row.frequency:.2f}", f"{30 * row.speed / pi:.1f}"]
        for row in crossings.itertuples()
    ]
    return plain_table(rows, ["engine order", "mode", "crossing [Hz]", "speed [rpm]"])


def _convergence_table(summary: pd.DataFrame) -> str:
    """Frequencies on the finest mesh and their limit; those of a user's own mesh come first."""
    given = "given" in summary
    rows = [
        [
            row.mode,
            *([f"{row.given:.2f}", f"{100 * row.given_error:.3f}"] if given else []),
            f"{row.frequency:.2f}",
            "" if row.reason else f"{row.limit:.2f}",
            "" if row.reason else f"{row.order:.2f}",
            f"{100 * row.error:.3f}",
            row.reason,
        ]
        for row in summary.itertuples()
    ]
    head = ["mode", *(["as given [Hz]", "its error [%]"] if given else []), "finest [Hz]"]
    return plain_table(rows, [*head, "limit [Hz]", "order", "error [%]", "why no limit"])


def pressure_table(maps: Mapping[float, Sequence[PressureMap]]) -> str:
    """Force and pressure of each seat, for each load."""
    rows = []
    for load, seats in maps.items():
        for seat in seats:
            share = seat.patch.area[seat.force > 0].sum() / seat.patch.area.sum()
            rows.append(
                [
                    show(load, "N"),
                    seat.patch.seat,
                    len(seat.force),
                    f"{seat.force.sum():.6g}",
                    f"{seat.pressure.max() / 1e6:.4g}",
                    f"{100 * share:.1f}",
                    f"{seat.complementarity:.1e}",
                ]
            )
    return plain_table(
        rows, ["load", "seat", "nodes", "force [N]", "peak [MPa]", "pressed [%]", "complementarity"]
    )


def response_tables(response: Response) -> str:
    """Resonance against load, and what damping is gained over no damper; in the units of the
    report. No best load is named where the report names none.
    """
    import pandas as pd

    from ..study.pipeline.curve import load_of
    from ..study.pipeline.design_table import design_table

    curves = response.curves
    rows = pd.DataFrame(design_table(curves, response.limits))
    rows = rows[[name for name in SUMMARY_COLUMNS if name in rows]]
    rows.insert(
        0, "seat load", ["no damper", *map(load_of, curves), *map(_stuck, response.limits[1:])]
    )
    return f"{report_table(rows)}\n{_best_load_line(response)}"


def _stuck(limit: Limit) -> str:
    """ "full stick", with the damper's mass where several are studied."""
    return "full stick" + ("" if limit.mass is None else f" of {1e3 * limit.mass:.4g} g")


def _best_load_line(response: Response) -> str:
    from ..report.best_load import lowest_of_response
    from ..study.pipeline.curve import load_of

    curves = response.curves
    lowest = min(curves, key=lambda c: c.peak_amplitude)
    against = lowest_of_response(response).against
    if against:
        return (
            f"best load: not determined: {against[0]}; {load_of(lowest)} has the lowest of "
            "these amplitudes"
        )
    best = lowest if response.best_found is None else curves[response.best_curve]
    words = "best of these loads" if response.best_found is None else "best load, by search"
    gain = response.free_peak[1] / best.peak_amplitude
    beside = "" if best is lowest else f"; {load_of(lowest)} has the lowest of these amplitudes"
    return f"{words}: {load_of(best)}, amplitude divided by {gain:.3g}{beside}"


SUMMARY_COLUMNS = (
    "peak_frequency",
    "peak_amplitude",
    "lowest",
    "highest",
    "interval",
    "reduction",
    "dissipated",
    "error",
    "points",
    "unconverged",
)


def side_by_side(name: str, best: pd.DataFrame) -> str:
    """The best load of each value of a field; the files hold more columns."""
    columns = [
        "value",
        "free_frequency",
        "load",
        *(c for c in SUMMARY_COLUMNS if c in best and c not in ("dissipated", "points")),
        *(c for c in ("own_load", "own_amplitude") if c in best),
    ]
    return report_table(best[columns].rename(columns={"value": name}))


def report_table(rows: pd.DataFrame) -> str:
    """A pandas table of SI columns, in the units of the report."""
    from ..report.tables import readable_texts

    return frame_table(readable_texts(rows))


def run_summary(run: Run, page: str | None = "report.html") -> str:
    """Where the time went, what the run has to say, warnings last, and where the results are.

    Args:
        page: of the run's folder, named where it is there; None names none.
    """
    total = sum(run.timings.values())
    rows = [
        [name, f"{t:.2f}", f"{100 * t / total if total else 0:.0f}"]
        for name, t in run.timings.items()
    ]
    table = plain_table(
        [*rows, ["total", f"{total:.2f}", "100"]], ["stage", "time [s]", "share [%]"]
    )
    file = None if run.folder is None or page is None else run.folder / page
    written = file is not None and file.is_file()
    report = f"report: {file}\n" if written else ""
    said = message_lists(run.messages, page if written else None)
    return "\n\n".join([table, *said, f"{report}results: {run.folder}"])


def message_lists(messages: Iterable[str], page: str | None = None) -> list[str]:
    """What a run or a command on top of one has to say: a list with a title for each level.

    Args:
        page: has the details, which are then left out here; without one they are printed.

    >>> from bladefem.util.message import warning
    >>> message_lists([warning("some points are not solved"), "the best load is 80 N"])
    ['information:\\n  - the best load is 80 N', 'warnings:\\n  - some points are not solved']
    """
    said = by_level(messages)
    lists = [
        "\n".join([f"{title}:", *(_list_entry(one, page is None) for one in said[level])])
        for title, level in MESSAGE_TITLES.items()
        if said[level]
    ]
    if page is not None and any(one.detail for entries in said.values() for one in entries):
        lists.append(f"figures and reasons of each: {page}")
    return lists


def _list_entry(message: Message, detailed: bool) -> str:
    """A message as an entry of a list, what to do about it on a line of its own."""
    lines = [f"  - {message}"]
    if message.advice:
        lines.append(f"    what to do: {message.advice}")
    if message.detail and detailed:
        lines.append(f"    details: {message.detail}")
    return "\n".join(lines)


# what a run says, by level; what the reader has to know is last, next to the prompt
MESSAGE_TITLES = {
    "kept": "timing",
    "method": "method",
    "information": "information",
    "warnings": "warning",
}


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return text == ""
    return True


def run_table(run: SolvedRun) -> str:
    """What a run of a blade with its damper ends with."""
    return response_tables(run.response)


def mass_table(run: Any) -> str:
    """What a run of a mass on its foundation ends with."""
    from ..report.tables import readable_texts
    from ..report.zmass import motion_table

    return frame_table(readable_texts(motion_table(run.motions)))


def pair_table(run: Any) -> str:
    """What a run of a verification pair ends with."""
    from ..report.pair import pair_summary
    from ..report.tables import readable_texts

    return frame_table(readable_texts(pair_summary(run.states)))
