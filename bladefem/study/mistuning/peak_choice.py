"""The peak of a wheel with one pattern, by as many harmonics and samples as its error asks for."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...hbm.solver.newton import Options
from ...scene.tables import Scene
from ...wheel.local_peak import LocalBalances, LocalPeak, find_local_peak
from ...wheel.model import Pattern, Wheel
from ...wheel.pattern_peak import PatternPeak
from ...wheel.resonance import Respond, WheelPeak, find_wheel_peak
from ...wheel.solution import WheelSolution
from ...wheel.solve import solve_wheel
from ...wheel.statistics import wheel_respond
from ..pipeline.curve import Curve

# harmonics of the engine order beyond which the indicator asks for no more
MOST_HARMONICS = 15
# harmonics that judge the error at least where one is excited: a higher one may meet a lightly
# damped mode, of which the next one alone knows nothing
JUDGING_HARMONICS = 7
# flexibility products of one point up to which all points of a search may be solved like it
MOST_SEARCH_PRODUCTS = 400
# Newton iterations and products of a balance with free means, one of many wheels: one that is not
# found takes as long as it may, and those of the shipped wheel under 77 N take 500 products
MOST_WALKING_ITERATIONS = 25
MOST_WALKING_PRODUCTS = 1500
# products of one attempt at the richer balance with free means that judges a peak: that of the
# shipped wheel under 77 N takes 1900, and one that is not found 7000 to stall
MOST_JUDGING_PRODUCTS = 3000
# relative error of a peak's height by the search over frequencies
SEARCH_TOLERANCE = 0.01


@dataclass(frozen=True)
class SearchedWheel:
    """A wheel with one pattern, and how its peak is searched."""

    # with held means, and with free ones where these are searched too
    wheel: Wheel
    free: Wheel | None
    pattern: Pattern
    # of the scene's engine order, among those of the common period of all orders
    harmonic: int
    options: Options

    @property
    def without_fallbacks(self) -> Options:
        """The options of balances that start from one nearby: what Newton does not reach from there
        nothing else is likely to.
        """
        return replace(self.options, fallbacks=False)


def in_common_period(respond: Respond, harmonic: int) -> Respond:
    """What a wheel answers at a circular frequency of its own engine order, from what it answers at
    that of the common period of all orders.
    """
    return lambda omega: respond(omega / harmonic)


@dataclass(frozen=True)
class ChosenPeak:
    """A peak with the harmonics and samples that were taken for it."""

    # with held means
    held: WheelPeak
    # there, in harmonics of the common period
    held_solution: WheelSolution
    harmonics: int
    samples: int
    # estimated relative error of the height by harmonics and samples: its change by
    # `judging_balances`; NaN: not solved
    truncation: float
    # with free means; None where they were not asked for, or no balance was found
    free: LocalPeak | None = None

    @property
    def peak(self) -> WheelPeak:
        """The highest point, with free means where these are known."""
        return self.held if self.free is None else self.free.peak

    @property
    def solution(self) -> WheelSolution:
        """At the peak."""
        return self.held_solution if self.free is None else self.free.solution


def first_balance(wheel: Wheel, curve: Curve, harmonic: int) -> tuple[int, int]:
    """Harmonics and samples of the common period that the settings of a curve mean."""
    settings = curve.settings
    H = max(harmonic * settings.harmonics, *wheel.excitation)
    return H, max(harmonic * settings.samples, 8 * (H + 1))


def wanted_truncation(scene: Scene) -> float | None:
    """Estimated error by harmonics and samples above which a wheel takes more of them; None: those
    that the scene gives are kept.
    """
    return scene.accuracy / 2 if scene.model.harmonics is None else None


def chosen_peak(
    searched: SearchedWheel,
    grid: np.ndarray,
    first: tuple[int, int],
    wanted: float | None,
    most: int = MOST_HARMONICS,
) -> ChosenPeak:
    """The peak with as many harmonics and samples as its error asks for.

    Args:
        grid: (k,) circular frequencies of the scene's engine order to look at first [rad/s].
        first: harmonics and samples of the common period to begin with.
        wanted: estimated error by harmonics and samples above which there are more of them; None:
            those given are kept.
        most: harmonics of the engine order.
    """
    H, samples = first
    limit = most * searched.harmonic
    while True:
        held, solution = _peak_with_held_means(searched, grid, H, samples)
        found = ChosenPeak(held, solution, H, samples, float("nan"))
        if searched.free is not None:
            options = searched.without_fallbacks
            balances = LocalBalances(searched.free, searched.pattern, H, samples, options, solution)
            found = replace(found, free=local_peak(balances, held, searched.harmonic))
        judged = _judged(searched, found, wanted, limit)
        # of NaN nothing says that richer settings are solved
        if not _asks_for_more(judged, wanted, limit):
            change = judged.change
            if found.free is not None and not judged.free:
                change = with_free_change(change, found.free.change)
            return replace(found, truncation=change)
        H, samples = judged.harmonics, judged.samples


def pattern_peak(
    searched: SearchedWheel, grid: np.ndarray, balance: tuple[int, int]
) -> PatternPeak:
    """The highest blade by given harmonics and samples, with held means over the band and with free
    ones round its peaks.

    Args:
        grid: (k,) circular frequencies of the scene's engine order to look at first [rad/s].
        balance: harmonics and samples of the common period.
    """
    pattern, harmonic, free = searched.pattern, searched.harmonic, searched.free
    held = LocalBalances(searched.wheel, pattern, *balance, searched.options)
    first = find_wheel_peak(in_common_period(held, harmonic), grid, SEARCH_TOLERANCE)
    near = held.points[first.omega / harmonic]
    if free is None or not near.converged:
        return PatternPeak(first, asked=free is not None)
    options = replace(searched.without_fallbacks, iterations=MOST_WALKING_ITERATIONS)
    walking = LocalBalances(free, pattern, *balance, options, near, MOST_WALKING_PRODUCTS)
    again = local_peak(walking, first, harmonic)
    # the resonance may be higher beyond a point that was not solved
    known = again is not None and again.peak.closed_in
    return PatternPeak(first, again if known else None, True)


def local_peak(
    balances: LocalBalances,
    first: WheelPeak,
    harmonic: int,
    blades: np.ndarray | None = None,
) -> LocalPeak | None:
    """`find_local_peak` in circular frequencies of the scene's engine order."""
    found = find_local_peak(balances, _scaled(first, 1 / harmonic), SEARCH_TOLERANCE, blades)
    return None if found is None else replace(found, peak=_scaled(found.peak, harmonic))


def _scaled(peak: WheelPeak, factor: float) -> WheelPeak:
    """A peak with all frequencies times a factor."""
    return replace(peak, omega=factor * peak.omega, omegas=factor * peak.omegas)


@dataclass(frozen=True)
class Judged:
    """What a richer balance changes at a peak."""

    harmonics: int
    samples: int
    # relative, of the highest blade; NaN: not solved
    change: float
    # flexibility products of its point
    products: int
    # by balances with free means
    free: bool = False


def _asks_for_more(judged: Judged, wanted: float | None, most: int) -> bool:
    """A search with the richer balance is wanted, and affordable."""
    return (
        wanted is not None
        and judged.change > wanted
        and judged.harmonics <= most
        and judged.products <= MOST_SEARCH_PRODUCTS
    )


def richer_balance(wheel: Wheel, H: int, samples: int) -> tuple[int, int]:
    """Harmonics and samples that tell what the present ones leave: at least twice as many, and with
    the next odd multiple of the highest excited harmonic, which friction excites most.
    """
    top = max(wheel.excitation)
    more = max(2 * H + 1, top * (2 * (H // top) + 1))
    return more, max(2 * samples, 8 * (more + 1))


def _peak_with_held_means(
    searched: SearchedWheel, grid: np.ndarray, H: int, samples: int
) -> tuple[WheelPeak, WheelSolution]:
    """The peak and its solution."""
    wheel, pattern, options = searched.wheel, searched.pattern, searched.options
    respond = wheel_respond(wheel, pattern, H, samples, options)
    peak = find_wheel_peak(in_common_period(respond, searched.harmonic), grid, SEARCH_TOLERANCE)
    omega = peak.omega / searched.harmonic
    return peak, solve_wheel(wheel, omega, H, samples, pattern=pattern, options=options)


def _judged(searched: SearchedWheel, found: ChosenPeak, wanted: float | None, most: int) -> Judged:
    """What richer harmonics and samples change at a peak: with free means where it has these, since
    how far dampers walk depends on the high harmonics, or with held ones where this is not solved.
    """
    pattern, present = searched.pattern, (found.harmonics, found.samples)
    if searched.free is not None and found.free is not None:
        walking = LocalBalances(
            searched.free,
            pattern,
            *present,
            searched.without_fallbacks,
            most_products=MOST_JUDGING_PRODUCTS,
        )
        judged = _judged_by(walking, found.solution, wanted, most)
        if np.isfinite(judged.change):
            return replace(judged, free=True)
    held = LocalBalances(searched.wheel, pattern, *present, searched.options)
    return _judged_by(held, found.held_solution, wanted, most)


def with_free_change(truncation: float, change: float) -> float:
    """Estimated error of an amplitude with free means by harmonics and samples.

    The whole of what free means change is taken for what more harmonics may change of it. On the
    shipped wheel under 77 N three harmonics leave 0.9 %, where held means leave 0.1 % and free ones
    change 1.8 %; in 36 cases of twelve lumped blades the estimate is 0.88 of the error or more.

    Args:
        truncation: relative error with held means.
        change: relative change by free means.
    """
    return truncation + abs(change)


def _judged_by(
    balances: LocalBalances,
    solution: WheelSolution,
    wanted: float | None,
    most: int,
) -> Judged:
    """What the last one of `judging_balances` changes at a peak, or the first one that asks for a
    search of its own; NaN where one before it is not solved.

    Args:
        balances: with the harmonics and samples of the solution.
        solution: at the peak.
        wanted, most: as for `chosen_peak`, in harmonics of the common period.
    """
    present = balances.harmonics, balances.samples
    found = Judged(*present, 0.0, 0)
    point = solution
    for number, more in enumerate(judging_balances(balances.wheel, *present)):
        products = 0
        if point.converged:
            # where the poorer balance is no start for the richer one nothing else is likely to be
            options = balances.options
            own = options if number == 0 else replace(options, fallbacks=False)
            point = solve_wheel(
                balances.wheel,
                solution.omega,
                *more,
                pattern=balances.pattern,
                start=point,
                options=own,
                most_products=balances.most_products,
            )
            products = point.products
        change = abs(point.size().max() / solution.size().max() - 1)
        found = Judged(*more, float(change) if point.converged else float("nan"), products)
        if _asks_for_more(found, wanted, most):
            break
    return found


def judging_balances(wheel: Wheel, H: int, samples: int) -> list[tuple[int, int]]:
    """Harmonics and samples that judge the present ones, each started from the one before: the next
    richer ones, and JUDGING_HARMONICS where harmonic 1 alone is excited and these are more.
    """
    found = [richer_balance(wheel, H, samples)]
    if set(wheel.excitation) == {1} and found[0][0] < JUDGING_HARMONICS:
        found.append((JUDGING_HARMONICS, max(found[0][1], 32 * (JUDGING_HARMONICS + 1))))
    return found
