"""Tables as they fit on a page: the columns that are read, without the round-off of zeros."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd

# below this share of the largest entry of a column or vector a number is round-off
ROUNDOFF_SHARE = 1e-12
# columns of a vector that share their scale
VECTOR_COLUMNS = ("force", "moment", "centre")
# table: names of its parts on the page and their columns, where all do not fit next to each other
PAGE_COLUMNS: dict[str, dict[str, tuple[str, ...]]] = {
    "contact/pressure": {
        "contact/pressure": (
            "load",
            "patch",
            "force",
            "area",
            "contact_share",
            "peak_pressure",
            "mean_pressure",
        ),
        "contact/resultants": (
            "load",
            "patch",
            *(f"{name}_{axis}" for name in ("force", "moment") for axis in "xyz"),
        ),
    },
    "response/influences": {
        "response/influence_table": (
            "parameter",
            "range_from",
            "low",
            "high",
            *(f"{name}_by_parameter" for name in ("load", "amplitude", "frequency")),
        ),
        "response/influences_at_ends": (
            "parameter",
            *(
                f"{name}_{end}{solved}"
                for name in ("load", "amplitude")
                for end in ("low", "high")
                for solved in ("", "_solved")
            ),
        ),
    },
    "response/summary": {
        "response/summary": (
            "mass",
            "load",
            "peak_frequency",
            "peak_amplitude",
            "lowest",
            "highest",
            "interval",
            "lower_amplitude",
            "reduction",
            "equivalent_damping",
            "alternating_stress",
            "stress_error",
            "mode_stress",
            "dissipated",
            "error",
            "points",
            "unconverged",
        ),
    },
}


def page_tables(name: str, table: pd.DataFrame) -> Iterator[tuple[str, pd.DataFrame]]:
    """Names and tables for the page; columns that are in no part are listed in ``attrs``."""
    clean = without_roundoff(table)
    parts = PAGE_COLUMNS.get(name)
    if parts is None:
        yield name, clean
        return
    chosen = {
        part: [column for column in columns if column in clean] for part, columns in parts.items()
    }
    used = {column for columns in chosen.values() for column in columns}
    left_out = [str(column) for column in clean if column not in used]
    keys = {"load", "patch"}
    for number, (part, columns) in enumerate(chosen.items()):
        if set(columns) <= keys:
            continue
        piece = clean[columns].copy()
        piece.attrs["left_out"] = [] if number else left_out
        yield part, piece


def without_roundoff(table: pd.DataFrame) -> pd.DataFrame:
    """The table with zeros where numbers are round-off of the largest of their column or vector.

    >>> without_roundoff(pd.DataFrame({"force_x": [30.0], "force_y": [7.6e-15]}))
       force_x  force_y
    0     30.0      0.0
    """
    clean = table.copy()
    groups = [[f"{name}_{axis}" for axis in "xyz"] for name in VECTOR_COLUMNS] + [list("xyz")]
    known = [[column for column in group if column in clean] for group in groups]
    alone = [
        [column]
        for column in clean.select_dtypes("floating")
        if not any(column in group for group in known)
    ]
    for group in (*known, *alone):
        if not group:
            continue
        values = clean[group].to_numpy(float)
        size = np.abs(values[np.isfinite(values)]).max(initial=0.0)
        clean[group] = np.where(np.abs(values) < ROUNDOFF_SHARE * size, 0.0, values)
    return clean
