"""Error of a natural frequency that was found on several meshes, and the limit that they go to.

Conforming elements give frequencies from above. Two extrapolations say how far: the larger one
counts.

The error by displacements of third order (`fem.stiffness_error`) is known on every mesh. What is
missing is its scale, the true error over the estimated one, and the meshes tell it: frequencies
against estimated errors lie on a line whose slope it is. This holds where meshes are not alike, and
where corners leave no order that sizes a factor of two apart would show.

The size of the elements, as they really are: with three meshes f(h) = f + C h^p goes through all
(Roache, J. Fluids Eng. 116 (1994), doi:10.1115/1.2910291); with more it is fitted by least squares,
and what is left is the scatter of the meshes (Eca and Hoekstra, J. Comput. Phys. 262 (2014),
doi:10.1016/j.jcp.2014.01.006). Where the values do not fall into line, where the order is none
that the elements can have, or where it leaves far less than the estimate, ``reason`` says so and
there is no limit. A fit over such sizes sees the smooth part of a shape first: orders of 3.5 and
3.8 were found for a plane blade whose corners allow 1.1.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from scipy.optimize import brentq, minimize_scalar

# order that is looked for
MAX_ORDER = 12.0
# orders that frequencies can have: from sharp re-entrant edges to 4 for P2, and some scatter
PLAUSIBLE_ORDERS = (1.0, 4.5)
# error over change where no order is believed and no other error is known (Roache's safety factor
# for two meshes)
UNTRUSTED_FACTOR = 3.0
# scatter over trend from which there is no trend
MAX_SCATTER = 0.5
# MAC of the same mode on two meshes
MIN_MAC = 0.8
# true error over the estimated one: it is 0.36 to 1.45 where the error is below 3 %
# (`benchmarks/stiffness_error.py`). Never taken below the first, so that scatter does not lower an
# estimate which stands alone
SCALES = (1.0, 3.0)
# where estimated errors differ by less than this share of the largest, their line shows no slope
MIN_SPREAD = 0.2
# the scale then
UNKNOWN_SCALE = 1.25
# fitted error over the estimated one below which an order is not believed; smooth shapes are
# estimated at up to 2.3 times their error
MIN_AGREEMENT = 0.4


def richardson(h: np.ndarray, f: np.ndarray) -> tuple[float, float]:
    """Limit and order from three meshes, coarse to fine.

    Returns:
        the limit, and the order; where the values do not fall into line the finest value and NaN.
    """
    first = f[0] - f[1]
    second = f[1] - f[2]
    if first * second <= 0:
        return float(f[2]), np.nan
    wanted = first / second

    def miss(p: float) -> float:
        return (h[0] ** p - h[1] ** p) / (h[1] ** p - h[2] ** p) - wanted

    if miss(0.05) * miss(MAX_ORDER) >= 0:
        return float(f[2]), np.nan
    p = brentq(miss, 0.05, MAX_ORDER)
    return float(f[2] - second * h[2] ** p / (h[1] ** p - h[2] ** p)), float(p)


def fitted_order(h: np.ndarray, f: np.ndarray) -> tuple[float, float, float]:
    """Limit, order and scatter (standard deviation) of f + C h^p by least squares.

    Returns:
        the finest value and NaN where the values have no trend, or three of them do not fall into
        line.
    """
    if len(f) < 3:
        return float(f[-1]), np.nan, 0.0
    if len(f) == 3:
        return *richardson(h, f), 0.0

    def fit(p: float) -> tuple[np.ndarray, float]:
        A = np.stack([np.ones(len(h)), h**p], axis=1)
        x = np.linalg.lstsq(A, f, rcond=None)[0]
        return x, float(np.sum((A @ x - f) ** 2))

    coarse = np.linspace(0.25, MAX_ORDER, 48)
    start = coarse[np.argmin([fit(p)[1] for p in coarse])]
    p = minimize_scalar(
        lambda p: fit(p)[1], bounds=(max(start - 0.5, 0.05), start + 0.5), method="bounded"
    ).x
    (limit, slope), left = fit(p)
    scatter = float(np.sqrt(left / (len(f) - 3)))
    if scatter > MAX_SCATTER * abs(slope) * (h.max() ** p - h.min() ** p):
        return float(f[-1]), np.nan, scatter
    return float(limit), float(p), scatter


def scaled_error(f: np.ndarray, estimated: np.ndarray) -> float:
    """Error of the last frequency, from the estimated errors, scaled by what the meshes changed.

    Args:
        f: (meshes,) frequencies, coarse to fine.
        estimated: (meshes,) their errors [1].
    """
    x = f * estimated
    scale = UNKNOWN_SCALE
    if np.ptp(x) > MIN_SPREAD * x.max():
        centred = x - x.mean()
        scale = float(np.clip(centred @ f / (centred @ centred), *SCALES))
    return scale * float(estimated[-1])


def convergence_summary(points: pd.DataFrame) -> pd.DataFrame:
    """One row a mode: the error of its frequency on the finest mesh, order and limit.

    Args:
        points: rows and columns as in `mesh_convergence.Convergence`.
    """
    keys = [key for key in ("nodal_diameter", "mode") if key in points]
    rows = []
    for _, line in points.groupby(keys):
        line = line.sort_values("size", ascending=False)
        rows.append({**{name: int(line[name].iloc[0]) for name in keys}, **_mode_summary(line)})
    return pd.DataFrame(rows)


def _mode_summary(line: pd.DataFrame) -> dict[str, float | str]:
    """Of one mode, coarse to fine."""
    f = line["frequency"].to_numpy()
    if f[-1] == 0:
        nothing = {"frequency": 0.0, "limit": 0.0, "order": np.nan, "error": 0.0, "scatter": 0.0}
        return {**nothing, "reason": "a rigid mode, of frequency 0 on any mesh"}
    estimated = line["estimated"].to_numpy()
    same = line["mac"].min() >= MIN_MAC
    known = bool(np.isfinite(estimated).all())
    limit, order, scatter = fitted_order(line["size"].to_numpy() / line["size"].iloc[-1], f)
    fitted = abs(f[-1] / limit - 1) + scatter / f[-1]
    # frequencies of other modes tell no scale
    scaled = 0.0
    if known:
        scaled = scaled_error(f, estimated) if same else float(estimated[-1])
    reason = _order_doubt(order, line["mac"].min(), len(f))
    if not reason and fitted < MIN_AGREEMENT * scaled:
        reason = f"order {order:.1f} leaves far less than the estimate"
    if reason:
        # a change that the sizes do not explain may come again
        change = np.ptp(f[-2:] if len(f) <= 3 else f[-3:]) / f[-1]
        fitted = change if known and same else UNTRUSTED_FACTOR * change
    # any of the frequencies is a bound
    lowest = f[-1] / f.min() - 1 if same else 0.0
    return {
        "frequency": f[-1],
        "limit": np.nan if reason else limit,
        "order": order,
        "error": max(fitted, scaled, lowest),
        "scatter": scatter / f[-1],
        "reason": reason,
    }


def _order_doubt(order: float, mac: float, meshes: int) -> str:
    """Why an order is not believed."""
    if mac < MIN_MAC:
        return f"the shapes of two meshes differ, MAC {mac:.2f}"
    if meshes < 3:
        return "two meshes show no order"
    if np.isnan(order):
        return "the frequencies do not fall into line"
    if not PLAUSIBLE_ORDERS[0] <= order <= PLAUSIBLE_ORDERS[1]:
        low, high = PLAUSIBLE_ORDERS
        return f"order {order:.1f} is not plausible for such elements, expected {low:g} to {high:g}"
    return ""
