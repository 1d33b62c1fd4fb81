"""Studies of two fields, and of scattered inputs, as files: tables, a picture and a page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from ..scene.tables import Scene
from ..scene.units import newtons
from ..view.study_map import draw_band, draw_map
from .best_load import error_words
from .headlines import Headline
from .study import UNPRINTED, Variant, end_words, load_words, place_of_value, study_tables
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
    best, loads = _tables(names, variants)
    shape = len(values[0]), len(values[1])
    amplitude = np.full(shape[0] * shape[1], np.nan)
    load = np.full(shape[0] * shape[1], np.nan)
    amplitude[: len(best)] = best["peak_amplitude"]
    load[: len(best)] = best["load"]
    files = write_tables(best, folder / "study", f"best load for each {' and '.join(names)}")
    files += write_tables(loads, folder / "study_loads", "all loads of each value")
    picture = folder / "study.png"
    draw_map(amplitude.reshape(shape), load.reshape(shape), values, names, picture)
    top = best.loc[best["peak_amplitude"].idxmin()]
    numbers = [
        Headline(f"best {name}", str(top[name]), place_of_value(str(top[name]), one), "")
        for name, one in zip(names, values, strict=True)
    ]
    numbers.append(
        Headline(
            "resonance amplitude there",
            f"{1e6 * top['peak_amplitude']:.4g} µm",
            error_words(top),
            load_words(top["load"], loads),
        )
    )
    subject = f"study of {' and '.join(names)}"
    pages = _page(
        variants[0].scene, best, loads, picture, numbers, subject, folder, "response/study_map"
    )
    return best, [*files, picture, *pages]


def write_scatter(
    names: Sequence[str],
    variants: Sequence[Variant],
    folder: Path,
) -> tuple[pd.DataFrame, list[Path]]:
    """Write study, study_loads, study.png (a band over the loads) and the page; returns the table
    of the band and the files.
    """
    best, loads = _tables(tuple(names), variants)
    shared = shared_loads(loads)
    band = band_of(shared)
    files = write_tables(best, folder / "study", "best load of each sample")
    files += write_tables(loads, folder / "study_loads", "all loads of each sample")
    files += write_tables(band, folder / "study_band", "resonance amplitude over the samples")
    picture = folder / "study.png"
    draw_band(shared, picture, title=f"scatter of {', '.join(names)}")
    robust = band.loc[band["amplitude_90"].idxmin()]
    numbers = [
        Headline(
            "most robust load",
            newtons(robust["load"], 4),
            f"of {len(band)} loads under which all {len(variants)} samples were studied"
            f"{end_words(robust['load'], band)}",
            "smallest amplitude that 90 % of the samples stay below",
        ),
        Headline(
            "resonance amplitude there",
            f"{1e6 * robust['amplitude_50']:.4g} µm",
            f"80 % between {1e6 * robust['amplitude_10']:.4g} and "
            f"{1e6 * robust['amplitude_90']:.4g} µm",
            f"{1e6 * robust['smallest']:.4g} to {1e6 * robust['largest']:.4g} µm in all",
        ),
    ]
    subject = f"scatter of {', '.join(names)}"
    pages = _page(
        variants[0].scene, best, band, picture, numbers, subject, folder, "response/study_band"
    )
    return band, [*files, picture, *pages]


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
    """Smallest, 10 %, median, 90 % and largest resonance amplitude [m] of each load."""
    damped = loads[(loads["load"] > 0) & np.isfinite(loads["load"])]
    groups = damped.groupby("load")["peak_amplitude"]
    return pd.DataFrame(
        {
            "smallest": groups.min(),
            "amplitude_10": groups.quantile(0.1),
            "amplitude_50": groups.quantile(0.5),
            "amplitude_90": groups.quantile(0.9),
            "largest": groups.max(),
        }
    ).reset_index()


def _tables(
    names: tuple[str, ...], variants: Sequence[Variant]
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """As ``study_tables``, with a column for each field."""
    best, loads = study_tables(names[0], variants)
    best = best.drop(columns=[column for column in best if str(column).startswith(f"{names[0]} [")])
    texts = [variant.text.split("; ") for variant in variants]
    for number, name in enumerate(names):
        if name in best:
            best = best.drop(columns=name)
        best.insert(number + 1, name, [text[number] for text in texts])
    return best.drop(columns="value"), loads


def _page(
    scene: Scene,
    best: pd.DataFrame,
    second: pd.DataFrame,
    picture: Path,
    numbers: list[Headline],
    subject: str,
    folder: Path,
    figure: str,
) -> tuple[Path, Path]:
    tables = {
        "response/best_load_of_each_value": best.drop(columns=UNPRINTED, errors="ignore"),
        "response/all_loads": second.drop(columns=UNPRINTED, errors="ignore"),
    }
    return write_report(
        folder,
        scene,
        tables,
        {figure: picture},
        page=Page(numbers=numbers, stem="report_study", subject=subject),
    )
