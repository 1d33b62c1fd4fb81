"""Studies of two fields, and of scattered inputs, as files: tables, a picture and a page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from ..scene.units import newtons
from ..view.study_map import LEAST_FOR_SHARES, draw_band, draw_map
from .best_load import error_words
from .best_value import SPEED, are_determined, value_headlines, worst_speed_headlines
from .headlines import Headline
from .study import (
    UNPRINTED,
    Variant,
    end_words,
    load_words,
    own_headlines,
    study_tables,
    unfinished_headlines,
    warnings_of_all,
    with_texts,
    write_value_tables,
)
from .tables import write_tables
from .write import Page, write_report


def write_map(
    names: tuple[str, str],
    values: tuple[Sequence[str], Sequence[str]],
    variants: Sequence[Variant],
    folder: Path,
) -> tuple[pd.DataFrame, list[Path]]:
    """Write study, study_loads, study.png and the page; returns the table and the files.

    Args:
        names: dotted names of both fields.
        values: of the first and of the second field, as written.
        variants: those that are solved so far, in the order of the second field within the first.
    """
    best, loads = study_tables(variants)
    caption = f"best load for each {' and '.join(names)}"
    files = write_value_tables(best, names, variants, folder / "study", caption)
    files += write_value_tables(
        loads, names, variants, folder / "study_loads", "all loads of each value"
    )
    own = own_headlines(best)
    best = with_texts(best, names, variants)
    picture = folder / "study.png"
    draw_map(best, values, names, picture)
    top = best.loc[best["peak_amplitude"].idxmin()]
    numbers = best_pair(names, values, best)
    there = "resonance amplitude there"
    numbers.append(
        Headline(
            there if are_determined(numbers) else "smallest resonance amplitude",
            f"{1e6 * top['peak_amplitude']:.4g} µm",
            error_words(top),
            load_words(top["load"], loads),
        )
    )
    numbers += [*own, *_all_speeds(names, values, best)]
    loads = with_texts(loads, names, variants)
    numbers = unfinished_headlines(len(variants), len(values[0]) * len(values[1])) + numbers
    pages = _page(names, variants, (best, loads), picture, numbers, folder, "response/study_map")
    return best, [*files, picture, *pages]


def _all_speeds(
    names: tuple[str, str], values: tuple[Sequence[str], Sequence[str]], best: pd.DataFrame
) -> list[Headline]:
    """The value that does for all speeds, where one of the fields is the speed and the damper is
    studied under its own load.
    """
    if SPEED not in names or "own_amplitude" not in best:
        return []
    other = 1 - names.index(SPEED)
    return worst_speed_headlines(best, names[other], values[other])


def best_pair(
    names: tuple[str, str], values: tuple[Sequence[str], Sequence[str]], best: pd.DataFrame
) -> list[Headline]:
    """The best value of each of both fields, where the errors separate it from the others; values
    whose runs are not finished do not count as studied.
    """
    studied = {
        name: [text for text in texts if text in set(best[name])]
        for name, texts in zip(names, values, strict=True)
    }
    return value_headlines(best, {name: name for name in names}, studied)


def write_scatter(
    names: Sequence[str],
    variants: Sequence[Variant],
    folder: Path,
    planned: int = 0,
) -> tuple[pd.DataFrame, list[Path]]:
    """Write study, study_loads, study.png (a band over the loads) and the page; returns the table
    of the band and the files.

    Args:
        names: dotted names of the scattered fields.
        variants: the samples that are solved so far.
        planned: samples asked for, where there may be more.
    """
    best, loads = study_tables(variants)
    shared = shared_loads(loads)
    band = band_of(shared)
    files = write_value_tables(best, names, variants, folder / "study", "best load of each sample")
    files += write_value_tables(
        loads, names, variants, folder / "study_loads", "all loads of each sample"
    )
    files += write_tables(band, folder / "study_band", "resonance amplitude over the samples")
    picture = folder / "study.png"
    draw_band(shared, picture, title=f"scatter of {', '.join(names)}")
    numbers = unfinished_headlines(len(variants), planned) + _robust_numbers(band, len(variants))
    best = with_texts(best, names, variants)
    pages = _page(names, variants, (best, band), picture, numbers, folder, "response/study_band")
    return band, [*files, picture, *pages]


def _robust_numbers(band: pd.DataFrame, samples: int) -> list[Headline]:
    """The load whose highest samples are lowest, and the amplitudes there: all samples where they
    are too few for a share of them.
    """
    shares = "amplitude_90" in band
    robust = band.loc[band["amplitude_90" if shares else "largest_amplitude"].idxmin()]
    every = f"{1e6 * robust['smallest_amplitude']:.4g} to {1e6 * robust['largest_amplitude']:.4g}"
    few = f"{samples} samples, of which no shares are reported: that takes {LEAST_FOR_SHARES}"
    return [
        Headline(
            "most robust load",
            newtons(robust["load"], 4),
            f"of {len(band)} loads under which all {samples} samples were studied"
            f"{end_words(robust['load'], band)}",
            f"smallest amplitude that {'90 % of the' if shares else 'all'} samples stay below",
        ),
        Headline(
            "resonance amplitude there",
            f"{1e6 * robust['amplitude_50']:.4g} µm",
            f"80 % between {1e6 * robust['amplitude_10']:.4g} and "
            f"{1e6 * robust['amplitude_90']:.4g} µm",
            f"{every} µm in all",
        )
        if shares
        else Headline("resonance amplitude there", f"{every} µm", "smallest and largest", few),
    ]


def shared_loads(loads: pd.DataFrame) -> pd.DataFrame:
    """The rows of loads that every sample has.

    Each run also studies the best load that it found and the one of its damper's own mass. Where
    these differ from sample to sample a load has one sample, whose amplitude is no band.

    Args:
        loads: one row a load of each sample: value (the sample as written), load [N].
    """
    samples = loads.groupby("load")["value"].transform("nunique")
    return loads[samples == loads["value"].nunique()]


def band_of(loads: pd.DataFrame) -> pd.DataFrame:
    """Smallest and largest resonance amplitude [m] of each load, and 10 %, median and 90 % of them
    where the samples are enough for such shares.
    """
    damped = loads[(loads["load"] > 0) & np.isfinite(loads["load"])]
    groups = damped.groupby("load")["peak_amplitude"]
    columns = {"smallest_amplitude": groups.min()}
    if groups.size().min() >= LEAST_FOR_SHARES:
        columns |= {f"amplitude_{share}": groups.quantile(share / 100) for share in (10, 50, 90)}
    return pd.DataFrame({**columns, "largest_amplitude": groups.max()}).reset_index()


def _page(
    names: Sequence[str],
    variants: Sequence[Variant],
    tables: tuple[pd.DataFrame, pd.DataFrame],
    picture: Path,
    numbers: list[Headline],
    folder: Path,
    figure: str,
) -> tuple[Path, Path]:
    best, second = (one.drop(columns=UNPRINTED, errors="ignore") for one in tables)
    kind, joint = ("scatter", ", ") if figure.endswith("band") else ("study", " and ")
    # the second table of a scatter is its band
    entry = "response/band" if kind == "scatter" else "response/all_loads"
    return write_report(
        folder,
        variants[0].scene,
        {"response/best_load_of_each_value": best, entry: second},
        {figure: picture},
        warnings_of_all(names, variants),
        page=Page(
            numbers=numbers,
            stem="report_study",
            subject=f"{kind} of {joint.join(names)}",
        ),
    )
