"""What a least-squares fit of logarithms knows: 95 % intervals from the sensitivities, and the
parameters that the data leave open, alone or together.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..util.arrays import BooleanArray, RealArray

# half width of the 95 % interval of a logarithm from which a parameter counts as unknown: times 2
UNKNOWN_LOG_HALF_WIDTH = np.log(2.0)
# widest interval that is reported
MAX_LOG_HALF_WIDTH = 50.0
# of the size of the best seen direction: below it the data are blind
BLIND_SHARE = 1e-12
# lower and upper
SIDES = (-1.0, 1.0)
# to find where the data begin to change
HALVINGS = 8
# share of a direction that the data do not see from which a parameter takes part in it
PART_OF_DIRECTION = 0.3


@dataclass(frozen=True)
class Product:
    """Of two parameters that the data do not tell apart their product, which they determine."""

    names: tuple[str, str]
    # half width of the 95 % interval of its logarithm
    half: float


@dataclass(frozen=True)
class Knowledge:
    """What a fit is worth, of p parameters."""

    # (p,) half widths of the 95 % intervals of the logarithms; MAX_LOG_HALF_WIDTH where the data
    # are blind
    half: RealArray
    # (p, 2) lower and upper ends of the parameters; 0 or infinite on a side on which nothing in the
    # data changes
    intervals: RealArray
    # parameters that the data leave open, alone or together
    open: list[tuple[str, ...]]
    # determined within a factor of two, of two open parameters
    products: tuple[Product, ...] = ()

    @property
    def known(self) -> BooleanArray:
        """(p,) determined within a factor of two on both sides."""
        low, high = self.intervals.T
        return (self.half < UNKNOWN_LOG_HALF_WIDTH) & (low > 0) & np.isfinite(high)

    def widened(self, shifts: RealArray, names: Sequence[str]) -> Knowledge:
        """With errors of the model that all readings share.

        Args:
            shifts: (k, p) of the logarithms by each of k errors.
            names: of the parameters.
        """
        by = abs(shifts).sum(axis=0)
        half = np.minimum(self.half + by, MAX_LOG_HALF_WIDTH)
        ends = self.intervals * np.exp(np.outer(np.minimum(by, MAX_LOG_HALF_WIDTH), SIDES))
        # beyond what is reported nothing is known on either side
        ends[half >= MAX_LOG_HALF_WIDTH] = 0.0, np.inf
        products = (
            replace(one, half=one.half + float(abs(shifts @ _both(one.names, names)).sum()))
            for one in self.products
        )
        known = tuple(one for one in products if one.half < UNKNOWN_LOG_HALF_WIDTH)
        wide = replace(self, half=half, intervals=ends, products=known)
        named = {name for one in self.open for name in one}
        lost = [n for n, k in zip(names, wide.known, strict=True) if not k and n not in named]
        return replace(wide, open=[*self.open, *((name,) for name in lost)])

    def sentence(self, what: str) -> str:
        """What the data leave open, in words.

        Args:
            what: whose parameters they are.
        """
        if not self.open:
            return f"the data determine all parameters of the {what}"
        parts = [one[0] if len(one) == 1 else f"{' and '.join(one)} apart" for one in self.open]
        return f"the data do not determine {', '.join(parts)}: within a factor of two at best"


def what_is_known(
    x: np.ndarray,
    misfit: Callable[[np.ndarray], np.ndarray],
    J: np.ndarray,
    names: Sequence[str],
) -> Knowledge:
    """Intervals round the end of a fit, and what they leave open.

    Args:
        x: (p,) logarithms at the end of the fit.
        misfit: logarithms to deviations (k,) over the stated errors of measurement [1].
        J: (k, p) their derivatives there.
    """
    deviations = misfit(x)
    half = half_widths(J, deviations)
    found = open_directions(J, deviations, names)
    ends = np.exp(np.column_stack([x - half, x + half]))
    least = _quantile(J, deviations) ** 2 + np.sum(deviations**2)

    def seen(i: int, shift: float) -> bool:
        """Whether the data change with one parameter alone."""
        moved = x.copy()
        moved[i] += shift
        return bool(np.sum(misfit(moved) ** 2) > least)

    # slopes do not see a side on which nothing changes, as friction above what moves
    for i, name in enumerate(names):
        if not all(seen(i, sign * UNKNOWN_LOG_HALF_WIDTH) for sign in SIDES):
            if not any(name in one for one in found):
                found.append((name,))
            ends[i] = np.exp(x[i] + np.array([_reach(partial(seen, i), sign) for sign in SIDES]))
    return Knowledge(half, ends, found, _known_products(J, deviations, names, found))


def _both(pair: tuple[str, str], names: Sequence[str]) -> RealArray:
    """(p,) one at the two parameters whose logarithms add, else zero."""
    return np.array([float(name in pair) for name in names])


def _known_products(
    J: np.ndarray,
    misfit: np.ndarray,
    names: Sequence[str],
    open_ones: Sequence[tuple[str, ...]],
) -> tuple[Product, ...]:
    """The products of pairs of open parameters that the data determine within a factor of two."""
    sizes, V = _directions(J)
    if not sizes.max() > 0:
        return ()
    slope = V / np.maximum(sizes, BLIND_SHARE * sizes.max())
    found = []
    for one in open_ones:
        if len(one) == 2:
            pair = (one[0], one[1])
            deviation = float(np.linalg.norm(_both(pair, names) @ slope))
            found.append(Product(pair, _quantile(J, misfit) * deviation))
    return tuple(one for one in found if one.half < UNKNOWN_LOG_HALF_WIDTH)


def _reach(seen: Callable[[float], bool], sign: float) -> float:
    """Shift of a logarithm from which the data change, by doubling and halving; infinite where they
    do not.
    """
    inside, outside = 0.0, UNKNOWN_LOG_HALF_WIDTH
    while not seen(sign * outside):
        inside, outside = outside, 2 * outside
        if outside > MAX_LOG_HALF_WIDTH:
            return sign * np.inf
    for _ in range(HALVINGS):
        middle = (inside + outside) / 2
        inside, outside = (inside, middle) if seen(sign * middle) else (middle, outside)
    return sign * outside


def half_widths(J: np.ndarray, misfit: np.ndarray) -> np.ndarray:
    """(p,) half widths of the 95 % intervals of the logarithms; MAX_LOG_HALF_WIDTH where the data
    are blind.

    The scatter is that of the misfit, but at least that of the stated errors of measurement.

    Args:
        J: (k, p) derivatives of the misfit.
        misfit: (k,) over the stated errors of measurement [1].
    """
    sizes, V = _directions(J)
    if not sizes.max() > 0:
        return np.full(len(sizes), MAX_LOG_HALF_WIDTH)
    variance = ((V / np.maximum(sizes, BLIND_SHARE * sizes.max())) ** 2).sum(axis=1)
    return np.minimum(_quantile(J, misfit) * np.sqrt(variance), MAX_LOG_HALF_WIDTH)


def open_directions(
    J: np.ndarray, misfit: np.ndarray, names: Sequence[str]
) -> list[tuple[str, ...]]:
    """Parameters that the data do not determine: each alone, or several of which only a
    combination is known; the arguments are those of `half_widths`.
    """
    sizes, V = _directions(J)
    found = []
    for size, direction in zip(sizes, V.T, strict=True):
        if size * UNKNOWN_LOG_HALF_WIDTH < _quantile(J, misfit):
            part = abs(direction) > PART_OF_DIRECTION
            found.append(tuple(name for name, takes in zip(names, part, strict=True) if takes))
    return found


def _directions(J: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(p,) sizes and (p, p) columns of the directions in which the data see the parameters."""
    missing = max(J.shape[1] - J.shape[0], 0)
    _, sizes, V = np.linalg.svd(np.vstack([J, np.zeros((missing, J.shape[1]))]))
    return sizes, V.T


def _quantile(J: np.ndarray, misfit: np.ndarray) -> float:
    """Half width of an interval over the standard deviation by the stated errors."""
    # slow to load, and all commands load this module
    from scipy.stats import t

    freedom = max(len(misfit) - J.shape[1], 1)
    scatter = max(1.0, float(np.sum(misfit**2)) / freedom)
    return float(t.ppf(0.975, freedom) * np.sqrt(scatter))
