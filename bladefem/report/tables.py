"""Tables for people: columns with titles and units, written as CSV, Markdown and LaTeX."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from bladefem.io.stage_cache import write_table, write_text

from ..scene.units import RPM, plain_number


class Column(NamedTuple):
    """How a column of SI numbers is shown."""

    title: str
    # SI, as stored; "" for words and plain numbers
    unit: str = ""
    # unit in the table, the SI unit when empty
    shown: str = ""
    # from SI to the shown unit
    factor: float = 1.0
    digits: int = 5
    # what stands for an infinite value; its sign when empty
    infinite: str = ""


# an end of an interval that a sample is too small to have
OPEN_END = "-"
# an error that no estimate bounds, infinite in CSV
UNBOUNDED = "unknown"
COLUMNS = {
    "load": Column("normal load", "N"),
    "load_low": Column("load, low end", "N"),
    "load_high": Column("load, high end", "N"),
    "frequency": Column("frequency", "Hz"),
    "engine_order": Column("engine order"),
    "amplitude": Column("amplitude", "m", "µm", 1e6),
    "searched_amplitude": Column("highest balance by the search", "m", "µm", 1e6),
    "tuned_amplitude": Column("tuned wheel", "m", "µm", 1e6),
    "tuned_amplitude_balance": Column("by the balance of all blades", "m", "µm", 1e6),
    "tuned_amplitude_sector": Column("by the sector's response", "m", "µm", 1e6),
    "amplification_known": Column("amplification known"),
    "tuned_amplitude_held": Column("the same, dampers held in the mean", "m", "µm", 1e6),
    "free_change": Column("free means change amplifications by", "1", "%", 100.0, 2),
    "kept_held": Column("wheels with held means"),
    "highest_amplitude": Column("highest blade", "m", "µm", 1e6),
    "highest_amplitude_held": Column("the same, dampers held in the mean", "m", "µm", 1e6),
    "highest_amplitude_low": Column("from", "m", "µm", 1e6),
    "highest_amplitude_high": Column("to", "m", "µm", 1e6, infinite=OPEN_END),
    "highest_blade": Column("its number"),
    "amplification": Column("over the tuned wheel", "1", digits=4),
    "amplification_free": Column("the same without dampers", "1", digits=4),
    "deviation": Column("deviation of frequency", "1", "%", 100.0, 3),
    "blade": Column("blade"),
    "wheels": Column("wheels"),
    "wheel": Column("wheel"),
    "seed": Column("seed of the draws"),
    "solved_by": Column("solved by"),
    "calibration": Column("law multiplied by"),
    "law_error": Column("law off the whole wheel by", "1", "%", 100.0, 2),
    "truncation": Column("harmonics leave", "1", "%", 100.0, 2),
    "worst": Column("worst wheel", "1", digits=4),
    **{
        f"p{share}{end}": Column(f"{share} %{title}", "1", digits=4, infinite=OPEN_END)
        for share in (50, 95, 99)
        for end, title in (("", " of wheels below"), ("_low", " from"), ("_high", " to"))
    },
    # of the influences: values now, and at both ends of a parameter's range by the derivative and
    # solved again
    **{
        f"{name}_{end}": Column(f"{name}{words}", unit, shown, factor)
        for name, unit, shown, factor in (
            ("load", "N", "", 1.0),
            ("amplitude", "m", "µm", 1e6),
            ("frequency", "Hz", "", 1.0),
        )
        for end, words in (
            ("now", " now"),
            ("low_solved", ", low end, solved"),
            ("high_solved", ", high end, solved"),
        )
    },
    **{
        f"{name}_{end}": Column(f"{name}, {end} end", unit, shown, factor)
        for name, unit, shown, factor in (
            ("amplitude", "m", "µm", 1e6),
            ("frequency", "Hz", "", 1.0),
        )
        for end in ("low", "high")
    },
    **{
        f"{name}_by_parameter": Column(f"{name}, logarithmic derivative", "1", digits=3)
        for name in ("load", "amplitude", "frequency")
    },
    "mass": Column("damper mass", "kg", "g", 1e3),
    "mode_frequency": Column("resonance by the mode", "Hz"),
    "mode_amplitude": Column("amplitude by the mode", "m", "µm", 1e6),
    "detached_amplitude": Column("highest detached motion by the mode", "m", "µm", 1e6),
    "balance_frequency": Column("resonance by the balance", "Hz"),
    "balance_amplitude": Column("amplitude by the balance", "m", "µm", 1e6),
    "off": Column("off the balance", "1", "%", 100.0, 2),
    "balance_error": Column("estimated error of the balance", "1", "%", 100.0, 2, UNBOUNDED),
    "off_reading": Column("off the reading", "1", "%", 100.0, 2),
    "most_friction": Column("largest friction damping", "1", "%", 100.0, 3),
    "own_damping": Column("damping of the blade", "1", "%", 100.0, 3),
    "frequency_shift": Column("frequency shift by the flow", "1", "%", 100.0, 3),
    "flow_damping": Column("damping by the flow", "1", "%", 100.0, 3),
    "net_damping": Column("with that of the blade", "1", "%", 100.0, 3),
    "limit_cycle": Column("limit cycle", "m", "µm", 1e6),
    "flutter_amplitude": Column("grows from", "m", "µm", 1e6),
    "parameter": Column("parameter"),
    "over_scene": Column("over the scene's", "1", digits=4),
    "factor_low": Column("factor from", "1", digits=4),
    "factor_high": Column("factor to", "1", digits=4),
    "fitted_field": Column("field"),
    "fitted_value": Column("value", digits=4),
    "fitted_low": Column("95 % interval from", digits=3),
    "fitted_high": Column("to", digits=3),
    "fitted_unit": Column("unit"),
    "mesh_shift": Column("mesh apart", "1", "%", 100.0, 2),
    "log_half_by_readings": Column("± by the readings", "1", "%", 100.0, 2),
    "log_half_by_model": Column("± by what the model leaves out", "1", "%", 100.0, 2),
    "determined": Column("determined by the readings"),
    "excitation_force": Column("force", "N"),
    "measured_amplitude": Column("measured", "m", "µm", 1e6),
    "scene_amplitude": Column("by the scene's contact", "m", "µm", 1e6),
    "fitted_amplitude": Column("by the fitted contact", "m", "µm", 1e6),
    "drive": Column("force at resonance over the scene's", "1", digits=4),
    "fold": Column("turns back in amplitude"),
    "peak_frequency": Column("resonance", "Hz"),
    "peak_amplitude": Column("resonance amplitude", "m", "µm", 1e6),
    "frictionless": Column("mass without friction", "kg", "g", 1e3),
    "lightest": Column("lightest by friction", "kg", "g", 1e3),
    "heaviest": Column("heaviest by friction", "kg", "g", 1e3),
    "lowest": Column("lowest by history", "m", "µm", 1e6),
    "highest": Column("highest by history", "m", "µm", 1e6),
    "interval": Column("range by history is"),
    "dissipated_energy": Column("friction work per cycle", "J", "mJ", 1e3, 4),
    "dissipated": Column("friction work per cycle", "J", "mJ", 1e3, 4),
    "friction_damping": Column("friction damping", "1", "%", 100.0, 3),
    "equivalent_damping": Column("equivalent damping ratio", "1", "%", 100.0, 3),
    "reduction": Column("free over damped", "1", digits=4),
    "motions": Column("motions there"),
    "reached": Column("reached by"),
    "residual": Column("residual", "1", digits=2),
    "phase": Column("phase", "rad", "deg", 180 / np.pi, 4),
    "imbalance": Column("energy imbalance", "1", digits=2),
    "slipping": Column("slipping elements"),
    "drift": Column("walk of the damper", "m/s", "µm/s", 1e6),
    "harmonics": Column("harmonics"),
    "points": Column("points"),
    "unconverged": Column("not converged"),
    "nodal_diameter": Column("nodal diameter"),
    "mode": Column("mode"),
    "family": Column("family"),
    "mac": Column("MAC", "1", digits=3),
    "aerofoil_share": Column("aerofoil's share", "1", "%", 100.0, 3),
    "speed": Column("speed", "rad/s", "rpm", RPM),
    "speed_at_resonance": Column("speed at resonance", "rad/s", "rpm", RPM),
    **{name: Column(name, "Hz") for name in ("forward", "backward", "limit", "natural", "given")},
    "peaked": Column("a maximum"),
    "largest": Column("largest displacement", "m", "µm", 1e6),
    "alternating_stress": Column("alternating stress", "Pa", "MPa", 1e-6, 4),
    "stress_error": Column("error of the stress by the mesh", "1", "%", 100.0, 2),
    "mode_stress": Column("stress of the excited mode alone", "Pa", "MPa", 1e-6, 4),
    "mean_stress": Column("mean stress", "Pa", "MPa", 1e-6, 4),
    "allowed_stress": Column("allowed amplitude", "Pa", "MPa", 1e-6, 4),
    "utilisation": Column("utilisation", "1", digits=3),
    "tuned_utilisation": Column("utilisation of the tuned wheel", "1", digits=3),
    "p95_utilisation": Column("95 % of wheels below", "1", digits=3),
    "p95_utilisation_low": Column("from", "1", digits=3, infinite=OPEN_END),
    "p95_utilisation_high": Column("to", "1", digits=3, infinite=OPEN_END),
    "stress_margin": Column("stress could grow by", "1", digits=3),
    "utilisation_bound": Column("with upper ends", "1", digits=3, infinite=OPEN_END),
    "von_mises": Column("von Mises", "Pa", "MPa", 1e-6, 4),
    "von_mises_gauss": Column("von Mises at Gauss points", "Pa", "MPa", 1e-6, 4),
    "principal": Column("largest principal", "Pa", "MPa", 1e-6, 4),
    "pressing": Column("smallest principal", "Pa", "MPa", 1e-6, 4),
    "frequency_of_partner": Column("frequency of partner", "Hz"),
    "dofs": Column("degrees of freedom", digits=9),
    "size": Column("element size", "m", "mm", 1e3, 4),
    "estimated": Column("estimated on this mesh alone", "1", "%", 100.0, 2),
    "scatter": Column("scatter of meshes", "1", "%", 100.0, 2),
    "order": Column("observed order", "1", digits=3),
    "sum": Column("sum of shares", "1", "%", 100.0, 4),
    "excitation": Column("excitation", "Hz"),
    "margin": Column("margin", "1", "%", 100.0, 3),
    "patch": Column("seat"),
    "force": Column("normal force", "N"),
    "area": Column("area", "m^2", "mm²", 1e6),
    "pressure": Column("pressure", "Pa", "MPa", 1e-6, 4),
    "peak_pressure": Column("peak pressure", "Pa", "MPa", 1e-6, 4),
    "mean_pressure": Column("mean pressure", "Pa", "MPa", 1e-6, 4),
    "middle_pressure": Column("pressure in the middle", "Pa", "MPa", 1e-6),
    "middle_pressure_exact": Column("closed form", "Pa", "MPa", 1e-6),
    "pressure_exact": Column("closed form", "Pa", "MPa", 1e-6),
    "contact_radius": Column("contact radius", "m", "mm", 1e3),
    "radius": Column("radius", "m", "mm", 1e3),
    "contact_radius_exact": Column("closed form", "m", "mm", 1e3),
    "approach": Column("approach", "m", "µm", 1e6),
    "approach_exact": Column("of half spaces", "m", "µm", 1e6),
    "pressure_error": Column("pressure's L2 error", "1", "%", 100.0, 2),
    "contact_share": Column("share pressed", "1", "%", 100.0, 3),
    "displacement": Column("relative displacement", "m", "µm", 1e6),
    "smallest_amplitude": Column("smallest resonance amplitude", "m", "µm", 1e6),
    "largest_amplitude": Column("largest resonance amplitude", "m", "µm", 1e6),
    "given_by": Column("resonance given by"),
    "amplitude_10": Column("10 % below", "m", "µm", 1e6),
    "amplitude_50": Column("median amplitude", "m", "µm", 1e6),
    "amplitude_90": Column("90 % below", "m", "µm", 1e6),
    "gap": Column("gap", "m", "µm", 1e6, 3),
    **{name: Column(name, "m", "mm", 1e3) for name in "xyz"},
    "work": Column("friction work an area", "J/m^2"),
    "mu": Column("friction coefficient"),
    "kt": Column("k_t", "N/m"),
    "kn": Column("k_n", "N/m"),
    "n0": Column("static normal force", "N"),
    "free_static_force": Column("free static friction", "N", digits=4),
    **{
        f"{name}{t}": Column(f"{title}{t.replace('_', ' ')}", unit, digits=4)
        for t in ("", "_t1", "_t2")
        for name, title, unit in (
            ("k_ad", "K_ad", "N/m"),
            ("c_ad", "C_ad", "N s/m"),
            ("f_c0", "F_c0", "N"),
        )
    },
    "wear_per_hour": Column("wear in an hour", "m", "µm", 1e6, 4),
    "wear_volume": Column("worn in an hour", "m^3", "mm³", 1e9, 4),
    "mean_wear": Column("mean depth in an hour", "m", "µm", 1e6, 4),
    "largest_wear": Column("largest depth in an hour", "m", "µm", 1e6, 4),
    **{name: Column(f"share of {name}") for name in ("stick", "slip", "separated")},
    **{f"centre_{name}": Column(f"centre {name}", "m", "mm", 1e3) for name in "xyz"},
    **{f"force_{name}": Column(f"force {name}", "N") for name in "xyz"},
    **{f"moment_{name}": Column(f"moment {name}", "N m", digits=4) for name in "xyz"},
    "complementarity": Column("complementarity", "1", digits=2),
    "time": Column("time", "s", digits=3),
    "error": Column("estimated error", "1", "%", 100.0, 2, UNBOUNDED),
    "error_to_reference": Column("error against the reference", "1", "%", 100.0, 2),
    "error_frequency": Column("error of the frequency", "1", "%", 100.0, 2),
    "error_phasor": Column("error of the worst phasor", "1", "%", 100.0, 2),
    "reference_error": Column("error of the reference", "1", "%", 100.0, 2),
    "given_error": Column("error of the given mesh", "1", "%", 100.0, 2),
    "frequency_error": Column("estimated error of the resonance", "1", "%", 100.0, 2),
    "compared": Column("compared by the search"),
    "tolerance": Column("tolerance of the search", "1", "%", 100.0, 2),
    "tolerated_from": Column("within the accuracy from", "N", digits=3),
    "tolerated_to": Column("within the accuracy up to", "N", digits=3),
    "lowest_searched": Column("searched from", "N", digits=3),
    "highest_searched": Column("searched up to", "N", digits=3),
    "input_work": Column("work of the excitation per cycle", "J", "mJ", 1e3, 4),
    "free_frequency": Column("without damper", "Hz"),
    "own_load": Column("damper's own load", "N", "N", 1.0, 4),
    "own_frequency": Column("resonance under it", "Hz", "Hz", 1.0, 5),
    "own_amplitude": Column("its amplitude", "m", "µm", 1e6),
    "own_error": Column("its estimated error", "1", "%", 100.0, 2, UNBOUNDED),
    "free_amplitude": Column("amplitude without damper", "m", "µm", 1e6),
    "lower_amplitude": Column("lower motion there", "m", "µm", 1e6, 2),
    "halved": Column("change with half the contact points", "1", "%", 100.0, 2),
    "body_mesh": Column("change by the error of the body's mesh", "1", "%", 100.0, 2),
    "layer_law": Column("change by the law of the layer", "1", "%", 100.0, 2),
    "estimated_error": Column("estimated error", "1", "%", 100.0, 2, UNBOUNDED),
    "tolerated_error": Column("tolerated error", "1", "%", 100.0, 3),
    "error_checked": Column("error checked here"),
    "stability": Column("stability"),
    "multiplier": Column("largest Floquet multiplier", "1", digits=6),
    "bifurcation": Column("lost its stability by"),
    "branch": Column("piece between folds"),
    "effective_mass": Column("effective mass", "kg", digits=4),
    "share": Column("share", "1", "%", 100.0, 3),
    "factor": Column("participation", "kg^1/2", digits=4),
}


def units_of(table: pd.DataFrame) -> dict[str, str]:
    """SI units of the known columns, for CSV heads."""
    return {
        name: COLUMNS[name].unit
        for name in table
        if name in COLUMNS and COLUMNS[name].unit not in ("", "1")
    }


def readable_texts(table: pd.DataFrame) -> pd.DataFrame:
    """The table as text: titles with units in the head, numbers rounded and in the unit that
    people use.
    """
    columns = {name: COLUMNS.get(name, Column(_words(str(name)))) for name in table}
    return pd.DataFrame(
        {
            column_head(column): [cell_text(value, column) for value in table[name]]
            for name, column in columns.items()
        }
    )


def _words(name: str) -> str:
    """Underscores are spaces, but in fields of a scene, "plane.damper_mass"."""
    return name if "." in name else name.replace("_", " ")


def column_head(column: Column) -> str:
    """ "resonance amplitude [µm]"."""
    unit = column.shown or column.unit
    return f"{column.title} [{unit}]" if unit and unit != "1" else column.title


def cell_text(value: Any, column: Column) -> str:
    """One entry: words as people say them, numbers in the shown unit."""
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if isinstance(value, int | np.integer) and column.factor == 1.0:
        return str(value)
    if not isinstance(value, float | int | np.floating | np.integer):
        return "" if value is None else str(value)
    if np.isinf(value):
        return column.infinite or ("∞" if value > 0 else "-∞")
    return "" if np.isnan(value) else plain_number(float(value * column.factor), column.digits)


def is_number(text: str) -> bool:
    """Whether a cell is aligned to the right."""
    try:
        float(text.replace("∞", "inf"))
    except ValueError:
        return text in ("", OPEN_END, UNBOUNDED)
    return True


def numeric_columns(table: pd.DataFrame) -> list[bool]:
    """Which columns of a readable table hold numbers only."""
    return [all(map(is_number, table[name])) for name in table]


def to_markdown(table: pd.DataFrame) -> str:
    """A GitHub table with units in the head; numbers to the right."""
    text = readable_texts(table)
    lines = [
        text.columns,
        ["---:" if n else "---" for n in numeric_columns(text)],
        *text.itertuples(index=False),
    ]
    return (
        "\n".join(
            "| " + " | ".join(str(c).replace("|", "\\|") for c in line) + " |" for line in lines
        )
        + "\n"
    )


def to_latex(table: pd.DataFrame, caption: str = "") -> str:
    """A booktabs tabular in a table float, with units in the head."""
    text = readable_texts(table)
    rows = [" & ".join(map(escape_latex, row)) + r" \\" for row in text.itertuples(index=False)]
    align = "".join("r" if n else "l" for n in numeric_columns(text))
    lines = [
        r"\begin{table}",
        r"  \centering",
        *([rf"  \caption{{{escape_latex(caption)}}}"] if caption else []),
        rf"  \begin{{tabular}}{{{align}}}",
        r"    \toprule",
        "    " + " & ".join(map(escape_latex, text.columns)) + r" \\",
        r"    \midrule",
        *("    " + row for row in rows),
        r"    \bottomrule",
        r"  \end{tabular}",
        r"\end{table}",
    ]
    return "\n".join(lines) + "\n"


LATEX_ESCAPES = {
    "\\": r"\textbackslash{}",
    "%": r"\%",
    "&": r"\&",
    "_": r"\_",
    "#": r"\#",
    "$": r"\$",
    "{": r"\{",
    "}": r"\}",
    "^": r"\textasciicircum{}",
    "~": r"\textasciitilde{}",
    "∞": r"$\infty$",
    "µ": r"\textmu{}",
    "²": r"$^2$",
    "³": r"$^3$",
}


def escape_latex(text: object) -> str:
    """Text that LaTeX prints as it is."""
    return "".join(LATEX_ESCAPES.get(letter, letter) for letter in str(text))


def write_tables(
    table: pd.DataFrame,
    stem: str | Path,
    caption: str = "",
    formats: Iterable[str] = ("csv", "md", "tex"),
) -> list[Path]:
    """Write ``stem``.csv (SI, full digits), .md and .tex (readable units); returns the files."""
    writers = {
        "csv": lambda file: write_table(file, table, units_of(table)),
        "md": lambda file: write_text(file, to_markdown(table)),
        "tex": lambda file: write_text(file, to_latex(table, caption)),
    }
    Path(stem).parent.mkdir(parents=True, exist_ok=True)
    return [writers[kind](Path(stem).with_name(f"{Path(stem).name}.{kind}")) for kind in formats]
