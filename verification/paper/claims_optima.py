"""Claims about Fig. 17: resonance frequency and amplitude over the normal load, for four
dampers.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from itertools import pairwise
from pathlib import Path

import numpy as np

from bladefem.hbm.model import ReducedModel
from bladefem.view.paper import draw_peaks
from verification.paper.blades import Peak, judge, load_curve, optimum

from .claim import Claim, verdict
from .claims_blades import BANDS, LOADS, MASSES, SCENES, dips, model_of
from .claims_loop import loop_points
from .claims_response import slip_share

# normal load of a seat [N]
WANTED = np.geomspace(0.5, 500, 16)
# mass of the scene's damper [kg]
OWN = 0.06
# harmonics and samples by mode: five times the frequency of mode 1 is that of mode 2, and with
# three harmonics its least amplitudes come out up to 11 % too high
BALANCE = {1: (9, 512), 2: (3, 128)}
MICRO = 1e6
# contact, mode, mass of the damper [kg]
Key = tuple[str, int, float]


def optima(folder: Path) -> Iterator[Claim]:
    """Fig. 17: both modes, four masses, two contact stiffnesses."""
    # load [N], frequency [Hz], amplitude [m], share of slip [1]
    tables: dict[Key, np.ndarray] = {}
    # optimum load [N] and amplitude there [m]
    least: dict[Key, tuple[float, float]] = {}
    # first harmonic there by the exact integration [m]
    exact: dict[Key, float] = {}
    for contact, mode in BANDS:
        for mass in MASSES:
            key = contact, mode, mass
            made = _maker(contact, mass)
            found = list(
                load_curve(((x, made(x)) for x in WANTED), BANDS[contact, mode], *BALANCE[mode])
            )
            tables[key] = np.array(
                [
                    (x, p.frequency, p.amplitude, slip_share(p.solution, made(x).elements))
                    for x, p in found
                ]
            )
            load, lowest = _finest(made, key, tables[key])
            least[key] = load, lowest.amplitude
            if (contact, mode) == ("stiff", 1):
                exact[key] = _in_time(made(load), lowest)
        loop = _loop_tops() if (contact, mode) == ("soft", 2) else None
        draw_peaks(
            {m: tables[contact, mode, m] for m in MASSES},
            folder / f"fig_17_{contact}_{mode}.png",
            f"mode {mode}, {contact} contact",
            {m: least[contact, mode, m] for m in MASSES},
            loop,
        )
    for contact, mode in BANDS:
        keys = [(contact, mode, m) for m in MASSES]
        yield _masses(contact, mode, [least[k] for k in keys], [exact.get(k) for k in keys])
    yield _always(tables, least)
    yield from _narrow(tables)
    yield _jump(tables["stiff", 2, OWN], least["stiff", 2, OWN][0])
    for contact in SCENES:
        one, two = (least[contact, mode, OWN][0] for mode in (1, 2))
        far = tables[contact, 1, OWN][0, 2] / tables[contact, 2, OWN][0, 2]
        yield Claim(
            "Sect. 5.2",
            f"the optimum load of mode 1 is much smaller than that of mode 2 ({contact} contact)",
            f"60 g: {one:.2f} N in mode 1, {two:.2f} N in mode 2; under {WANTED[0]:g} N the same "
            f"force moves the tip {far:.0f} times as far in mode 1",
            verdict(one < two / 2, one < two),
        )


def _maker(contact: str, mass: float) -> Callable[[float], ReducedModel]:
    return lambda load: model_of(contact, load, mass)


def _finest(
    made: Callable[[float], ReducedModel], key: Key, table: np.ndarray
) -> tuple[float, Peak]:
    """Optimum load [N] and the resonance there, near the lowest point of a table."""
    contact, mode, _ = key
    best = int(np.argmin(table[:, 2]))
    span = table[max(best - 1, 0), 0], table[min(best + 1, len(table) - 1), 0]
    return optimum(made, span, BANDS[contact, mode], *BALANCE[mode])


def _in_time(model: ReducedModel, found: Peak) -> float:
    """First harmonic [m] at the frequency of a resonance by the exact integration; NaN where that
    does not close.
    """
    exact, tip, _system = judge(model, found.frequency)
    return float(abs(tip[1])) if exact.converged else np.nan


def _loop_tops() -> np.ndarray:
    """(loads, 3) load [N], frequency [Hz] and amplitude [m] of the highest point that the paper's
    loop accepts.
    """
    found = ((load, loop_points(load, "march")) for load in LOADS)
    return np.array(
        [(load, *points[:, np.argmax(points[1])]) for load, points in found if points.size]
    )


def _masses(
    contact: str,
    mode: int,
    found: list[tuple[float, float]],
    exact: list[float | None],
) -> Claim:
    smaller = all(a[1] > b[1] for a, b in pairwise(found))
    larger = all(a[0] < b[0] for a, b in pairwise(found))
    return Claim(
        f"Fig. 17{'b' if mode == 1 else 'd'}",
        f"a heavier damper has a larger optimum load and a smaller least amplitude (mode {mode}, "
        f"{contact} contact)",
        "; ".join(
            f"{1e3 * m:.0f} g {MICRO * h:.4g} µm at {x:.3g} N"
            + ("" if e is None else f" (exact integration: {MICRO * e:.4g} µm)")
            for m, (x, h), e in zip(MASSES, found, exact, strict=True)
        ),
        verdict(smaller and larger, smaller or larger),
        (f"fig_17_{contact}_{mode}.png",),
        f"Resonance of mode {mode} over the normal load, {contact} contact. Stars: optimum loads."
        + (
            " Crosses: the paper's loop, 60 g, the highest of its points of Fig. 15."
            if (contact, mode) == ("soft", 2)
            else ""
        ),
    )


def _always(tables: Mapping[Key, np.ndarray], least: Mapping[Key, tuple[float, float]]) -> Claim:
    ends = {key: table[[0, -1], 2] / least[key][1] for key, table in tables.items()}
    inside = sum(
        WANTED[0] < x < WANTED[-1] and ends[key].min() > 1.05 for key, (x, _) in least.items()
    )
    single = sum(dips(list(table[:, 2])) for table in tables.values())
    depth = [1 / e.min() for e in ends.values()]
    return Claim(
        "Fig. 17b, d",
        "there is always an optimum load",
        f"in {inside} of {len(least)} cases (modes, masses, stiffnesses); it leaves "
        f"{min(depth):.2f} to {max(depth):.2f} of the lower of the amplitudes at {WANTED[0]:g} and "
        f"{WANTED[-1]:g} N; the curve has no second dip in {single} cases",
        verdict(inside == len(least), inside > 0),
    )


def _narrow(tables: Mapping[Key, np.ndarray]) -> Iterator[Claim]:
    """The last paragraph of Sect. 5.2: how many times the load grows from mostly slip to mostly
    stick.
    """
    for contact in SCENES:
        wide = {(mode, m): _range(tables[contact, mode, m]) for mode in (1, 2) for m in MASSES}
        light = [all(wide[mode, a] < wide[mode, b] for a, b in pairwise(MASSES)) for mode in (1, 2)]
        slow = [wide[1, m] < wide[2, m] for m in MASSES]
        reported = "; ".join(
            f"mode {mode} " + ", ".join(f"{wide[mode, m]:.1f}" for m in MASSES) for mode in (1, 2)
        )
        yield Claim(
            "Sect. 5.2",
            "the less inertia (low frequency, light damper), the narrower the range of loads from "
            f"slip to stick ({contact} contact)",
            "load at which the points slip a quarter of the time over that with three quarters, "
            f"{', '.join(f'{1e3 * m:.0f}' for m in MASSES)} g: {reported}",
            verdict(all(light) and all(slow), all(light) or all(slow)),
        )


def _range(table: np.ndarray) -> float:
    """Ratio of two loads: where points slip a quarter and three quarters of the time."""
    falling = np.minimum.accumulate(table[:, 3])
    quarter, most = np.interp([-0.25, -0.75], -falling, np.log(table[:, 0]))
    return float(np.exp(quarter - most))


def _jump(table: np.ndarray, best: float) -> Claim:
    steps = np.abs(np.diff(table[:, 1]))
    jump = int(np.argmax(steps))
    (a, f), (b, g) = table[jump : jump + 2, :2]
    return Claim(
        "Fig. 17a, c",
        "the resonance frequency jumps near the optimum load",
        f"stiff contact, 60 g: from {f:.0f} Hz at {a:.1f} N to {g:.0f} Hz at {b:.1f} N, {best:.1f} "
        "N being the optimum; no state jumps: the response has a sharp and a broad peak, and the "
        "higher one changes",
        verdict(False, steps[jump] > 0.5 * np.ptp(table[:, 1]) and a / 1.5 < best < 1.5 * b),
    )
