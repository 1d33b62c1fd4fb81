"""Sentences of a report: the answer first, and how far it can be trusted."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pandas as pd

from bladefem.contact.interface_elements import gives_stiffness, mean_roughness
from bladefem.contact.rough_layer import RANGE, SOURCE, decay_length, rough_stiffness
from bladefem.scene.kinds import kind_named
from bladefem.scene.tables import Scene
from bladefem.scene.units import show

from ..scene.units import newtons
from ..util.counted import counted
from ..view.optimum import at_band_end
from ..view.response import FOLLOWED, MARCHED
from .best_load import certainty, flat_range, lowest_found, lowest_resonance, of_same_damper
from .damping import damping_there
from .response_points import LINEAR

# of the resonance frequency: farther off, an engine order does not drive it
OFF_RESONANCE = 0.1
# methods of points that no balance was solved for
NOT_BALANCED = (LINEAR, MARCHED, FOLLOWED)
# title of what is given where no optimum is named
LOWEST_FOUND = "lowest resonance amplitude found"
# relative difference below which a load was itself studied; own loads are rounded to four digits
SAME_LOAD_TOLERANCE = 1e-3


class ResponseAnswer(NamedTuple):
    """What the engineer asked for."""

    # what, value, remark
    numbers: list[tuple[str, str, str]]
    cautions: list[str]


def response_answer(
    summary: pd.DataFrame | None,
    points: pd.DataFrame | None = None,
    own: pd.DataFrame | None = None,
    masses: pd.DataFrame | None = None,
    searched: pd.DataFrame | None = None,
) -> ResponseAnswer:
    """The best load and what it brings; no optimum is named where the data cannot carry it.

    Args:
        summary: one row a load: load [N] (0: free blade, inf: full stick), peak_frequency [Hz],
            peak_amplitude [m], optionally mass [kg], dissipated or dissipated_energy [J],
            friction_damping [1], reduction (free over damped amplitude), unconverged (number of
            points).
        points: response table, for the check that the peak lies inside the band.
        own: one row: mass [kg] of the damper, its speed [rad/s], the load [N] of a seat by that
            mass alone.
        masses: one row a load where friction takes part in the seating: load [N] and the mass [kg]
            that makes it, with its range lightest to heaviest.
        searched: one row a mass, what the exact search for the best load found
            (``best_load.best_load_table``); without it the best of the loads studied is named.
    """
    if summary is None or summary.empty:
        return ResponseAnswer([], [])
    finite = summary[(summary["load"] > 0) & np.isfinite(summary["load"])]
    if finite.empty:
        return ResponseAnswer([], ["No damper load was studied."])
    best, by_search, against = lowest_resonance(summary, points, searched)
    remark = mass_of(best) or (flat_range(best) if by_search else best_of_studied(finite))
    doubts = cautions(finite, best, points, by_search)
    if against:
        row = lowest_found(best, summary)
        lowest = (
            LOWEST_FOUND,
            f"{1e6 * row['peak_amplitude']:.4g} µm",
            f"at {newtons(row['load'], 4)} and {row['peak_frequency']:.5g} Hz",
        )
        said = [f"No optimum load is named: {reason}." for reason in against]
        unknown = ("optimum normal load per seat", "not determined", against[0])
        return ResponseAnswer([unknown, lowest], [*said, *doubts])
    # one load alone has no optimum, whatever the number of masses
    alone = not by_search and finite["load"].nunique() == 1
    title = "normal load per seat" if alone else "optimum normal load per seat"
    numbers = _optimum_numbers(summary, best, points, title, remark)
    return ResponseAnswer(
        [*numbers, *stress(summary, best), *own_mass(finite, best, own, masses)],
        doubts,
    )


def _optimum_numbers(
    summary: pd.DataFrame,
    best: pd.Series,
    points: pd.DataFrame | None,
    title: str,
    remark: str,
) -> list[tuple[str, str, str]]:
    """The best load, under a title, and the resonance there: what, value, remark."""
    numbers = [
        (title, newtons(best["load"], 4), remark),
        (
            "resonance amplitude there",
            f"{1e6 * best['peak_amplitude']:.4g} µm",
            ", ".join(filter(None, [reduction(summary, best), certainty(best)])),
        ),
        *history_range(best),
        (
            "resonance frequency there",
            f"{best['peak_frequency']:.5g} Hz",
            linear_limits_text(of_same_damper(summary, best)),
        ),
        *damping_there(summary, best, points),
    ]
    if np.isfinite(best.get("friction_damping", np.nan)):
        numbers.append(
            (
                "friction damping ratio there",
                f"{100 * best['friction_damping']:.3g} %",
                energy(best),
            )
        )
    elif energy(best):
        numbers.append(("friction work per cycle there", energy(best).split(" of ")[0], ""))
    return numbers


def best_of_studied(finite: pd.DataFrame) -> str:
    """Words that the load is the best of those studied, which is not the optimum."""
    return f"best of {len(finite)} loads studied" if len(finite) > 1 else ""


def history_range(best: pd.Series) -> list[tuple[str, str, str]]:
    """How far the loading history may move the answer."""
    if not np.isfinite(best.get("lowest", np.nan)):
        return []
    remark = {
        "point": "it does not depend on it",
        "monotone": "certified: the response is monotone in the friction forces left",
        "sampled": "sampled: it may be wider",
    }
    return [
        (
            "range there by the loading history",
            f"{1e6 * best['lowest']:.4g} to {1e6 * best['highest']:.4g} µm",
            remark.get(best["interval"], best["interval"]),
        )
    ]


def stress(summary: pd.DataFrame, best: pd.Series) -> list[tuple[str, str, str]]:
    """What the amplitude means for the blade."""
    if not np.isfinite(best.get("alternating_stress", np.nan)):
        return []
    free = summary.loc[summary["load"] == 0]
    remark = ""
    if len(free) and "mode_stress" in free:
        remark = f"; {1e-6 * free['mode_stress'].iloc[0]:.3g} MPa of the mode without damper"
    return [
        (
            "alternating stress there",
            f"{1e-6 * best['alternating_stress']:.3g} MPa",
            f"largest von Mises stress of all modes, harmonics and damper forces{remark}",
        )
    ]


def own_mass(
    finite: pd.DataFrame,
    best: pd.Series,
    own: pd.DataFrame | None,
    masses: pd.DataFrame | None = None,
) -> list[tuple[str, str, str]]:
    """What the damper does as it is, pressed by its own mass, and which mass would press it
    best.
    """
    if own is None or "mass" in finite or len(finite) < 2:
        return []
    mass, speed, load = own[["mass", "speed", "load"]].iloc[0]
    table = finite.sort_values("load")
    there = "outside the loads studied"
    studied = table[np.isclose(table["load"], load, rtol=SAME_LOAD_TOLERANCE)]
    if len(studied):
        there = f"resonance amplitude {1e6 * studied['peak_amplitude'].iloc[0]:.4g} µm there"
    elif table["load"].iloc[0] <= load <= table["load"].iloc[-1]:
        between = np.interp(np.log(load), np.log(table["load"]), np.log(table["peak_amplitude"]))
        there = (
            f"resonance amplitude about {1e6 * np.exp(between):.3g} µm, between the loads studied"
        )
    return [
        (
            "load of a seat by the damper's own mass",
            newtons(load, 4),
            f"{1e3 * mass:.3g} g at {speed * 30 / np.pi:.5g} rpm; {there}",
        ),
        ("mass that makes the optimum load", *best_mass(best, mass / load, masses)),
    ]


def assumed_stiffness(scene: Scene, pressed: pd.DataFrame | None = None) -> list[str]:
    """A caution where the scene gives no contact stiffness: what is taken, and from where.

    Args:
        pressed: the table "contact/pressure".
    """
    if gives_stiffness(scene.contact):
        return []
    roughness = mean_roughness(scene.contact)
    known = "ground seats" if scene.contact.roughness is None else "contact.roughness"
    at_one = 1e-9 * rough_stiffness(1e6, roughness)
    there = ""
    if pressed is not None:
        mean = pressed["mean_pressure"].to_numpy(float)
        low, high = (1e-9 * rough_stiffness(p, roughness) for p in (mean.min(), mean.max()))
        there = f" and {low:.0f} to {high:.0f} N/mm^3 at the mean pressures of the loads studied"
    return [
        "The scene gives no contact stiffness: it is taken from the roughness, Ra "
        f"{show(roughness, 'm')} on each face ({known}), as normal stiffness = pressure / "
        f"{show(decay_length(roughness), 'm')}, {at_one:.0f} N/mm^3 at 1 MPa{there} "
        f"({SOURCE}). Published values lie within a factor of {RANGE:g} on each side. Give "
        "contact.kt_area or contact.roughness; docs/contact.md lists measurements."
    ]


def best_mass(
    best: pd.Series,
    each: float,
    masses: pd.DataFrame | None,
) -> tuple[str, str]:
    """The mass for the best load, with its band where friction takes part in the seating.

    Args:
        each: mass for each newton on a seat [kg/N].
    """
    if masses is None or not (masses["load"] == best["load"]).any():
        return f"{1e3 * each * best['load']:.3g} g", "at the same speed"
    row = masses.loc[masses["load"] == best["load"]].iloc[0]
    return (
        f"{1e3 * row['mass']:.3g} g",
        f"at the same speed; {1e3 * row['lightest']:.3g} to {1e3 * row['heaviest']:.3g} g over all "
        "friction forces that could be left in the seats",
    )


def wrong_speed(scene: Scene, summary: pd.DataFrame | None) -> list[str]:
    """A caution where the engine order, at the scene's speed, excites far from the resonances that
    were studied.
    """
    if summary is None or kind_named(scene.kind).is_plane or not scene.operation.speed > 0:
        return []
    if scene.excitation.engine_order == 0:
        return []
    excited = scene.excitation.engine_order * scene.operation.speed / (2 * np.pi)
    peaks = summary["peak_frequency"]
    if (1 - OFF_RESONANCE) * peaks.min() <= excited <= (1 + OFF_RESONANCE) * peaks.max():
        return []
    rpm = scene.operation.speed * 30 / np.pi
    return [
        f"At {rpm:.5g} rpm engine order {scene.excitation.engine_order} excites at {excited:.5g} "
        "Hz and does not meet these resonances: with the stiffness of this speed they belong to "
        f"{rpm * peaks.min() / excited:.4g} to {rpm * peaks.max() / excited:.4g} rpm. 'bladefem "
        "modes --campbell' shows where they cross."
    ]


def mass_of(best: pd.Series) -> str:
    """ "with a damper of 12.5 g"."""
    return f"with a damper of {1e3 * best['mass']:.4g} g" if "mass" in best else ""


def reduction(summary: pd.DataFrame, best: pd.Series) -> str:
    """How far the optimum is below the free blade."""
    free = summary.loc[summary["load"] == 0, "peak_amplitude"]
    if len(free):
        share = 1 - best["peak_amplitude"] / free.iloc[0]
        return f"{100 * share:.1f} % below the free blade's {1e6 * free.iloc[0]:.4g} µm"
    if "reduction" in best:
        return f"{best['reduction']:.3g} times smaller than the free blade's"
    return ""


def linear_limits_text(summary: pd.DataFrame) -> str:
    """Resonance frequencies of the free and the stuck blade."""
    ends = [summary.loc[summary["load"] == load, "peak_frequency"] for load in (0.0, np.inf)]
    words = ("free", "in full stick")
    return ", ".join(
        f"{end.iloc[0]:.5g} Hz {word}" for end, word in zip(ends, words, strict=True) if len(end)
    )


def energy(best: pd.Series) -> str:
    """Friction work at the optimum."""
    work = best.get("dissipated_energy", best.get("dissipated", np.nan))
    return f"{1e3 * work:.3g} mJ of friction work per cycle" if np.isfinite(work) else ""


def cautions(
    finite: pd.DataFrame,
    best: pd.Series,
    points: pd.DataFrame | None,
    exact: bool = False,
) -> list[str]:
    """Why the answer may not be the optimum.

    Args:
        exact: the best load was searched for, and need not be one of those studied.
    """
    found = []
    loads = finite["load"].nunique()
    if loads == 1:
        found.append(
            "Only one load was studied: whether it is the optimum is not known; give more "
            "study.loads."
        )
    ends = (finite["load"].min(), finite["load"].max())
    if loads > 1 and not exact and best["load"] in ends:
        end = "smallest" if best["load"] == finite["load"].min() else "largest"
        found.append(
            f"The best load is the {end} one studied: the true optimum may lie beyond it; widen "
            "study.loads."
        )
    if best.get("unconverged", 0) > 0:
        found.append(
            "The curve of the best load has points that did not converge: its peak may be missed."
        )
    cut = cut_peaks(finite, points)
    if cut:
        named = ", ".join(newtons(load, 4) for load in cut)
        found.append(
            f"For {len(cut)} of {len(finite)} loads ({named}) the highest point lies at the end of "
            "the frequency band, so that no resonance was seen; widen study.band."
        )
    return found


def cut_peaks(finite: pd.DataFrame, points: pd.DataFrame | None) -> list[float]:
    """Loads whose highest point is the first or last of its curve."""
    if points is None or points.empty:
        return []
    return list(finite.loc[at_band_end(finite, points), "load"])


def reliability(points: pd.DataFrame | None) -> tuple[list[str], pd.DataFrame]:
    """Sentences on convergence, and a row for each load with points that failed or needed a
    fallback.

    Args:
        points: response table: load [N], frequency [Hz], converged, method, residual, iterations,
            optionally reason.
    """
    points = None if points is None else points[~points["method"].isin(NOT_BALANCED)]
    if points is None or points.empty:
        return [], pd.DataFrame()
    good = points["converged"].astype(bool)
    usual = points.loc[good, "method"].mode()
    usual = usual.iloc[0] if len(usual) else ""
    fallback = good & (points["method"] != usual)
    worst = points.loc[good, "residual"].max() if good.any() else np.nan
    text = [
        f"{int(good.sum())} of {len(points)} points converged; the largest accepted residual is "
        f"{worst:.1e}."
    ]
    if (~good).any():
        text.append(
            f"{counted(int((~good).sum()), 'point')} did NOT converge: marked by crosses in the "
            "charts, and without part in any peak or optimum."
        )
    if fallback.any():
        used = points.loc[fallback, "method"].value_counts()
        text.append(
            f"{counted(int(fallback.sum()), 'point')} not reached by {usual}, found by a fallback: "
            + ", ".join(f"{name} ({count})" for name, count in used.items())
            + "."
        )
    return text, doubtful_loads(points, good, fallback)


def doubtful_loads(
    points: pd.DataFrame,
    good: pd.Series,
    fallback: pd.Series,
) -> pd.DataFrame:
    """One row a load that has unconverged points or fallbacks."""
    rows = []
    for load, part in points.groupby("load"):
        bad = part[~good[part.index]]
        if bad.empty and not fallback[part.index].any():
            continue
        where = (
            f"{bad['frequency'].min():.5g} to {bad['frequency'].max():.5g} Hz" if len(bad) else ""
        )
        reasons = "; ".join(map(str, bad["reason"].unique())) if "reason" in bad else ""
        rows.append(
            {
                "load": load,
                "points": len(part),
                "not converged": len(bad),
                "where": where,
                "by fallback": int(fallback[part.index].sum()),
                "worst residual": part["residual"].max(),
                **({"reason": reasons} if reasons else {}),
            }
        )
    return pd.DataFrame(rows)
