"""Which value of a studied field is the best, as far as the estimated errors separate the values.

Tables have one row a value, or a pair of values: peak_amplitude [m], error [1] (NaN: not estimated,
inf: unknown), and a column of texts for each field.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from ..util.percent import percent
from .headlines import NOT_DETERMINED, Headline

SPEED = "operation.speed"


def within_errors(table: pd.DataFrame) -> pd.DataFrame:
    """The rows whose amplitudes less their estimated errors are no more than the smallest amplitude
    with its own, the row of that one among them.
    """
    amplitude = table["peak_amplitude"]
    # what is not estimated separates nothing and joins nothing
    error = table["error"].fillna(0.0)
    best = amplitude.idxmin()
    lowest = amplitude * (1 - error).clip(lower=0.0)
    return table[lowest <= amplitude[best] * (1 + error[best])]


def value_headlines(
    table: pd.DataFrame, columns: Mapping[str, str], studied: Mapping[str, Sequence[str]]
) -> list[Headline]:
    """The best value of each field, or that the errors leave it open.

    Args:
        table: see the head of this file.
        columns: name of a field to its column of texts.
        studied: name of a field to the values of it that were run, in their order.
    """
    best = table.loc[table["peak_amplitude"].idxmin()]
    near = within_errors(table)
    found = []
    for name, column in columns.items():
        values = list(dict.fromkeys(map(str, near[column])))
        if len(values) > 1:
            found.append(
                Headline(
                    f"best {name}",
                    NOT_DETERMINED,
                    f"the estimated errors do not separate {_listed(values)}",
                    f"smallest amplitude with {best[column]}",
                )
            )
            continue
        place = place_of_value(str(best[column]), studied[name])
        found.append(Headline(f"best {name}", str(best[column]), place, ""))
    return found


def worst_speed_headlines(
    table: pd.DataFrame, column: str, values: Sequence[str]
) -> list[Headline]:
    """The value whose largest amplitude over the speeds is the smallest, each under the load of its
    own damper; nothing with one speed or one value, and values that lack a speed do not count.

    Args:
        table: a row a value and speed: own_amplitude [m], own_error [1] (see the head of this
            file), texts of the value and of operation.speed.
        column: the one of the texts of the value, its dotted name.
        values: texts of all values, in their order.
    """
    speeds = table[SPEED].nunique()
    whole = table.groupby(column)["own_amplitude"].transform("count") == speeds
    rows = [_worst_speed(own) for _, own in table[whole].groupby(column, sort=False)]
    if speeds < 2 or len(rows) < 2:
        return []
    worst = pd.DataFrame(rows)
    studied = [value for value in values if value in set(worst[column])]
    [found] = value_headlines(worst, {column: column}, {column: studied})
    each = "; ".join(
        f"{row[column]}: {1e6 * row['peak_amplitude']:.4g} µm {_error_text(row['error'])}, "
        f"at {row[SPEED]}"
        for _, row in worst.iterrows()
    )
    what = f"best {column} for all speeds, under the damper's own load"
    return [found._replace(what=what, remark=f"largest amplitudes: {each}")]


def _worst_speed(rows: pd.DataFrame) -> pd.Series:
    """The speed at which one value has its largest amplitude, with an error that covers the others:
    one of them may be the largest as well.
    """
    amplitude, error = rows["own_amplitude"], rows["own_error"].fillna(0.0)
    largest = rows.loc[amplitude.idxmax()]
    top = largest["own_amplitude"]
    above = (amplitude * (1 + error)).max() / top - 1
    below = 1 - (amplitude * (1 - error)).max() / top
    return pd.Series({**largest, "peak_amplitude": top, "error": max(above, below)})


def _error_text(error: float) -> str:
    return f"± {percent(error)}" if np.isfinite(error) else "(error unknown)"


def best_value_lines(headlines: Sequence[Headline]) -> str:
    """The same for a terminal, a line a field."""
    return "\n".join(
        f"{one.what}: {one.value}: {one.uncertainty}; {one.remark}"
        if one.value == NOT_DETERMINED
        else f"{one.what}: {one.value}, {one.uncertainty}"
        for one in headlines
    )


def are_determined(headlines: Sequence[Headline]) -> bool:
    """Whether the errors leave no value open."""
    return all(one.value != NOT_DETERMINED for one in headlines)


def place_of_value(best: str, values: Sequence[str]) -> str:
    """How many values were studied, and whether the best is at an end of them.

    >>> place_of_value("50 deg", ["40 deg", "50 deg", "60 deg"])
    'best of 3 values'
    >>> place_of_value("60 deg", ["40 deg", "50 deg", "60 deg"])
    'best of 3 values, the last: better ones may lie beyond'
    >>> place_of_value("60 deg", ["60 deg"])
    'the only value studied'
    """
    if len(values) == 1:
        return "the only value studied"
    words = f"best of {len(values)} values"
    # words such as "coupled" have no order
    ordered = all(value.lstrip("+-.")[:1].isdigit() for value in values)
    if not ordered or best not in (values[0], values[-1]):
        return words
    end = "first" if best == values[0] else "last"
    return f"{words}, the {end}: better ones may lie beyond"


def _listed(values: Sequence[str]) -> str:
    """ "0.2, 0.3 and 0.4"."""
    return f"{', '.join(values[:-1])} and {values[-1]}"
