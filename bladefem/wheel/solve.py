"""One frequency of a mistuned wheel with its dampers: attempts in turn until one converges."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..friction.fourier import to_complex, to_real
from ..hbm.solver.newton import DEFAULT_OPTIONS, Options
from .check_point import check_point
from .first_motions import held_motion, tuned_motion
from .flexibility import wheel_flexibility
from .linear_motion import linear_motion
from .load_homotopy import load_homotopy
from .model import TUNED_PATTERN, Pattern, Wheel, pattern_elements
from .newton import WheelBalance, WheelNewton, newton_wheel
from .solution import WheelSolution, fitted_displacements
from .walking import unheld_motions
from .walking_search import solve_walking

# modal damping ratios within which a solved neighbour is the best start: resonances of a mistuned
# wheel are that narrow
NEIGHBOUR_HALF_WIDTHS = 0.5
# relative distance at which it is the same point, with other settings
SAME_FREQUENCY = 1e-6


def solve_wheel(
    wheel: Wheel,
    omega: float,
    H: int = 3,
    samples: int = 128,
    *,
    pattern: Pattern = TUNED_PATTERN,
    start: WheelSolution | None = None,
    options: Options = DEFAULT_OPTIONS,
    most_products: int | None = None,
) -> WheelSolution:
    """The periodic response of all blades at circular frequency omega [rad/s].

    Args:
        samples: time samples a period; 0 locates the transitions of 1-D elements exactly.
        pattern: what differs from blade to blade.
        start: a solved neighbour; the tuned wheel when left out, or full stick.
        most_products: flexibility products after which an attempt is given up; None: as many as it
            takes.

    Returns:
        a WheelSolution whose `converged` and `reason` must be read.

    Raises:
        InputError: frequency, harmonics, pattern or start do not fit.
        NotSolvedError: a resonance without damping is hit exactly.
    """
    check_point(wheel, omega, H, samples, pattern)
    flex = wheel_flexibility(wheel, omega, H, pattern)
    elements = pattern_elements(wheel, pattern)
    stuck = _shaped(wheel, linear_motion(wheel, flex, "contact"))
    first = wheel.first_forces(pattern, elements)
    balance = WheelBalance(
        wheel, flex, elements, first, stuck, samples, most_products=most_products
    )
    motions = unheld_motions(wheel)
    if motions.shape[2]:
        found = solve_walking(balance, motions, start, options)
        if found is not None:
            return _solution(*found)
    end, method = _attempts(balance, start, options)
    return _solution(balance, end, method)


def _starts(
    balance: WheelBalance,
    start: WheelSolution | None,
    options: Options,
) -> list[tuple[str, Callable[[], np.ndarray | None]]]:
    """Names of the attempts and what gives the motion that Newton starts from (None: nothing), the
    likeliest first; motions are computed when their turn comes.
    """
    wheel = balance.wheel
    H = balance.stuck.shape[3] // 2
    omega = balance.flex.omega
    starts: list[tuple[str, Callable[[], np.ndarray | None]]] = [
        ("newton from the tuned wheel", lambda: tuned_motion(wheel, omega, H, balance.samples)),
        ("newton from full stick", lambda: balance.stuck),
    ]
    if wheel.coupled and options.fallbacks:
        starts.append(("newton from held means", lambda: held_motion(balance, options)))
    if start is not None:
        fitted = fitted_displacements(start.w, wheel, H)
        near = max(NEIGHBOUR_HALF_WIDTHS * np.max(wheel.damping.ratio), SAME_FREQUENCY)
        close = abs(start.omega / omega - 1) < near
        starts.insert(0 if close else len(starts), ("newton", lambda: fitted))
    return starts


def _attempts(
    balance: WheelBalance,
    start: WheelSolution | None,
    options: Options,
) -> tuple[WheelNewton, str]:
    """The first attempt that converges, or the best one, with the cost of all."""
    tried: list[tuple[WheelNewton, str]] = []
    for name, first_motion in _starts(balance, start, options):
        begin = first_motion()
        if begin is None:
            continue
        tried.append((newton_wheel(balance, begin, options), name))
        if tried[-1][0].converged or not options.fallbacks:
            break
    if not tried[-1][0].converged and options.fallbacks:
        tried.append((load_homotopy(balance, options), "load homotopy"))
    end, method = min(tried, key=lambda t: (not t[0].converged, t[0].state.error))
    iterations = sum(t[0].iterations for t in tried)
    products = sum(t[0].products for t in tried)
    return replace(end, iterations=iterations, products=products), method


def _solution(
    balance: WheelBalance,
    end: WheelNewton,
    method: str,
) -> WheelSolution:
    wheel = balance.wheel
    flex = balance.flex
    state = end.state
    p = state.forces.p
    forces = to_complex(p.reshape(wheel.count, -1, p.shape[3]))
    parts = flex.parts
    probe = linear_motion(wheel, flex, "probe") - flex.motion(forces, parts.probe, parts.contact)
    return WheelSolution(
        flex.omega,
        balance.samples,
        state.w,
        state.forces.f,
        probe.swapaxes(1, 2),
        end.converged,
        end.reason,
        method,
        end.iterations,
        end.products,
        state.error,
        state.forces.shares,
        state.forces.dissipated.sum(axis=1),
        balance.walk,
    )


def _shaped(wheel: Wheel, q: np.ndarray) -> np.ndarray:
    """(N, m, H+1) amplitudes as real coefficients (N, n, d, K)."""
    return to_real(q).reshape(wheel.count, wheel.nodes, wheel.directions, -1)
