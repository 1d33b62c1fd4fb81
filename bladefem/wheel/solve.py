"""One frequency, a sweep and the resonance peak of a mistuned wheel with its dampers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ..data import Elements
from ..errors import InputError, NotSolvedError
from ..friction.fourier import to_complex, to_real
from ..hbm.solver.newton import DEFAULT_OPTIONS, Options
from ..hbm.solver.walking import WALK_SAMPLES
from ..util.arrays import ComplexArray, RealArray
from .flexibility import WheelFlexibility, wheel_flexibility
from .model import Pattern, Wheel, pattern_elements
from .newton import WheelBalance, WheelNewton, evaluate_wheel, full_newton, newton_wheel
from .tuned import tuned_displacements
from .walking import WheelWalk, slipping_dampers, unheld_motions

TUNED_PATTERN = Pattern()
# modal damping ratios within which a solved neighbour is the best start: resonances of a mistuned
# wheel are that narrow
NEIGHBOUR_HALF_WIDTHS = 0.5
# relative distance at which it is the same point, with other settings
SAME_FREQUENCY = 1e-6
# of the load homotopy: first share of the excitation, first and last factor to the next one, and
# points before it is given up
FIRST_LOAD_SHARE = 0.02
FIRST_LOAD_FACTOR = 2.0
LAST_LOAD_FACTOR = 1.01
HOMOTOPY_POINTS = 60
# rounds in which it is found which dampers walk; a residual above this share of the largest marks
# those that are undecided, where they are no more than this
WALK_ROUNDS = 10
UNDECIDED_SHARE = 0.3
MOST_UNDECIDED = 2


@dataclass(frozen=True)
class WheelSolution:
    """A point of the wheel's response: converged, or the best that was found, with the reason."""

    # [rad/s]
    omega: float
    samples: int
    # (N, n, d, K) relative displacements: mean, cos 1, sin 1, ... [m]
    w: RealArray
    # (N, n, d, K) contact forces, with the preload in the mean of the normal ones [N]
    f: RealArray
    # (N, H+1, probes) complex amplitudes, Re(q e^{i h omega t}) [m]
    probe: ComplexArray
    converged: bool
    reason: str
    # "newton", or what reached the point
    method: str
    iterations: int
    products: int
    # over the size of the motion [1]
    residual: float
    # (N, n, 3) shares of stick, slip and separation in a period
    shares: RealArray
    # (N,) friction work of each damper in a period [J]
    dissipated: RealArray
    # dampers that walk, whose mean of w along their motions is the step a period; None: none does
    walk: WheelWalk | None = None

    @property
    def drift(self) -> RealArray:
        """(N,) how fast each damper walks, of the contact that goes on fastest [m/s]."""
        if self.walk is None:
            return np.zeros(len(self.w))
        ramp = self.walk.ramp(self.walk.steps(self.w)).reshape(len(self.w), -1, self.walk.tangents)
        return np.asarray(np.linalg.norm(ramp, axis=2).max(axis=1) * self.frequency)

    @property
    def frequency(self) -> float:
        """[Hz]"""
        return self.omega / (2 * np.pi)

    def size(self, probe: int = 0) -> np.ndarray:
        """(N,) root of the sum of squares of the moving harmonics of each blade [m]."""
        return np.linalg.norm(self.probe[:, 1:, probe], axis=1)


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
    _check_point(wheel, omega, H, samples, pattern)
    flex = wheel_flexibility(wheel, omega, H, pattern)
    elements = pattern_elements(wheel, pattern)
    stuck = _shaped(wheel, linear_motion(wheel, flex, "contact"))
    first = wheel.first_forces(pattern, elements)
    balance = WheelBalance(
        wheel, flex, elements, first, stuck, samples, most_products=most_products
    )
    motions = unheld_motions(wheel)
    if motions.shape[2]:
        found = _walking(balance, motions, start, options)
        if found is not None:
            return _solution(*found)
    end, method = _attempts(balance, start, options)
    return _solution(balance, end, method)


def _walking(
    balance: WheelBalance,
    motions: np.ndarray,
    start: WheelSolution | None,
    options: Options,
) -> tuple[WheelBalance, WheelNewton, str] | None:
    """The solution in which exactly those dampers walk on which no contact sticks, and its balance,
    without fallbacks also where it did not converge; None where none does, or it is not found.
    """
    wheel = balance.wheel
    H = balance.stuck.shape[3] // 2
    if balance.samples == 0:
        balance = replace(balance, samples=WALK_SAMPLES * (H + 1))
    near = start is not None and start.converged and start.walk is not None
    if near and start is not None and start.walk is not None:
        w, walks = _fitted(start.w, wheel, H), start.walk.dampers
    else:
        known = start is not None and start.converged
        first = (
            _fitted(start.w, wheel, H)
            if known and start is not None
            else _tuned(wheel, balance.flex.omega, H, balance.samples)
        )
        held = _held(balance, options, first)
        if held is None:
            return None
        w, walks = held.state.w, slipping_dampers(held.state.forces.shares)
    if not walks.any():
        return None
    tried: list[WheelNewton] = []
    own = balance
    # first by full steps: a line search takes long where a damper should walk and does not
    attempts = [(full_newton, walks), (newton_wheel, walks)]
    if not walks.all():
        attempts.append((newton_wheel, np.ones_like(walks)))
    for attempt, first_walks in attempts:
        rounds = _walking_rounds(balance, motions, w, first_walks, options, attempt)
        if rounds is None:
            return None
        own, end = rounds
        tried.append(end)
        if end.converged:
            break
    if not tried[-1].converged and options.fallbacks:
        # dampers that slip throughout have no other balance: to look for one takes longest
        return None
    end = replace(
        tried[-1],
        iterations=sum(one.iterations for one in tried),
        products=sum(one.products for one in tried),
    )
    return own, end, "newton, walking"


def _walking_rounds(
    balance: WheelBalance,
    motions: np.ndarray,
    w: np.ndarray,
    walks: np.ndarray,
    options: Options,
    attempt: Callable[[WheelBalance, np.ndarray, Options], WheelNewton],
) -> tuple[WheelBalance, WheelNewton] | None:
    """The balance in which exactly those dampers walk on which no contact sticks, and where Newton
    ended in it, with the cost of all rounds; None where none walks in the end.

    Args:
        w: (N, n, d, K) displacements to begin with.
        walks: (N,) dampers that walk to begin with, some of them.
        attempt: Newton's method.
    """
    wheel = balance.wheel
    iterations = products = 0
    tried: list[np.ndarray] = []
    while True:
        tried.append(walks)
        walk = WheelWalk(motions, wheel.springs, wheel.elements.tangents, walks)
        own = replace(balance, walk=walk)
        end = attempt(own, w, options)
        iterations += end.iterations
        products += end.products
        end = replace(end, iterations=iterations, products=products)
        if end.converged:
            slips = slipping_dampers(end.state.forces.shares)
            if (slips == walks).all():
                return own, end
            # those that stick again begin where they are
            turned = walks & ~slips
            walks = slips
        else:
            turned = undecided_dampers(end.state.residual)
            walks = walks ^ turned
        if end.converged and not walks.any():
            return None
        known = not walks.any() or any((walks == one).all() for one in tried)
        if len(tried) == WALK_ROUNDS or known:
            why = "it is not decided which dampers walk" if end.converged else end.reason
            return own, replace(end, converged=False, reason=why)
        w = replace(walk, dampers=turned).without_steps(end.state.w)


def undecided_dampers(residual: np.ndarray) -> np.ndarray:
    """(N,) True where a residual (N, n, d, K) is left after Newton's method with given dampers that
    walk. One that rests and should walk, or walks and should rest, has no balance and keeps its
    residual alone, while all others are solved; none where more than a few have it.
    """
    sizes = np.linalg.norm(residual.reshape(len(residual), -1), axis=1)
    large = sizes > UNDECIDED_SHARE * sizes.max()
    few = np.isfinite(sizes).all() and np.count_nonzero(large) <= MOST_UNDECIDED
    return large if few else np.zeros(len(sizes), dtype=bool)


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
        ("newton from the tuned wheel", lambda: _tuned(wheel, omega, H, balance.samples)),
        ("newton from full stick", lambda: balance.stuck),
    ]
    if wheel.coupled and options.fallbacks:
        starts.append(("newton from held means", lambda: _held_motion(balance, options)))
    if start is not None:
        fitted = _fitted(start.w, wheel, H)
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
        tried.append((_homotopy(balance, options), "load homotopy"))
    end, method = min(tried, key=lambda t: (not t[0].converged, t[0].state.error))
    iterations = sum(t[0].iterations for t in tried)
    products = sum(t[0].products for t in tried)
    return replace(end, iterations=iterations, products=products), method


def _held(
    balance: WheelBalance, options: Options, first: np.ndarray | None = None
) -> WheelNewton | None:
    """The wheel whose means stay in the preload state, from its full stick or a first motion:
    dampers that slip throughout drift far on nearly no force, which hides the way to the solution.
    """
    key = "held means"
    wheel = balance.wheel
    if key not in wheel.kept:
        wheel.kept[key] = replace(wheel, coupled=False)
    flex = replace(balance.flex, coupled=False)
    stuck = balance.stuck.copy()
    stuck[..., 0] = 0.0
    held = replace(balance, wheel=wheel.kept[key], flex=flex, stuck=stuck)
    starts = [stuck]
    if first is not None:
        starts.insert(0, first * (np.arange(first.shape[3]) > 0))
    for w in starts:
        end = newton_wheel(held, w, replace(options, fallbacks=False))
        if end.converged:
            return end
    return None


def _held_motion(balance: WheelBalance, options: Options) -> np.ndarray | None:
    """Displacements of `_held`, or None."""
    end = _held(balance, options)
    return None if end is None else end.state.w


def _tuned(
    wheel: Wheel,
    omega: float,
    H: int,
    samples: int,
) -> np.ndarray | None:
    """Displacements of the tuned wheel, or None."""
    try:
        return tuned_displacements(wheel, omega, H, samples)
    except NotSolvedError:
        return None


def stuck_wheel(
    wheel: Wheel,
    omega: float,
    H: int = 1,
    pattern: Pattern = TUNED_PATTERN,
) -> np.ndarray:
    """(N, H+1, probes) amplitudes with all contacts closed and sticking [m]."""
    _check_point(wheel, omega, H, 1, pattern)
    flex = wheel_flexibility(wheel, omega, H, pattern)
    return linear_motion(wheel, flex, "probe").swapaxes(1, 2)


def free_wheel(
    wheel: Wheel,
    omega: float,
    H: int = 1,
    pattern: Pattern = TUNED_PATTERN,
) -> np.ndarray:
    """(N, H+1, probes) amplitudes without contact forces [m]."""
    blades = replace(pattern, elements=None, damper_mass=None, start=None)
    return stuck_wheel(without_contact(wheel), omega, H, blades)


def without_contact(wheel: Wheel) -> Wheel:
    """The wheel with elements that carry nothing, and no damper; made once."""
    if "free" not in wheel.kept:
        e = wheel.elements
        nothing = np.zeros(len(e.kt))
        open_contacts = Elements(nothing, nothing, nothing, nothing, e.tangents)
        wheel.kept["free"] = replace(wheel, elements=open_contacts, damper=None)
    return wheel.kept["free"]


def linear_motion(
    wheel: Wheel,
    flex: WheelFlexibility,
    port: str,
) -> np.ndarray:
    """(N, rows, H+1) motion of a port by the excitation, all contacts sticking [m]."""
    return flex.motion(excitation_forces(wheel, flex), getattr(flex.parts, port), flex.parts.load)


def excitation_forces(wheel: Wheel, flex: WheelFlexibility) -> np.ndarray:
    """(N, loads, H+1) amplitudes of the excitation on all blades [N]."""
    harmonics = flex.T.shape[1]
    parts = flex.parts
    force = np.zeros((wheel.count, parts.load.stop - parts.load.start, harmonics), dtype=complex)
    for h, amplitudes in wheel.excitation.items():
        if h < harmonics:
            force[:, :, h] = amplitudes
    return force


def deviation_forces(
    wheel: Wheel,
    pattern: Pattern,
    point: WheelSolution,
) -> np.ndarray:
    """(N, q, H+1) forces of the blades' deviations on the port "blade" at a solved point; see
    `Pattern`.
    """
    flex = wheel_flexibility(wheel, point.omega, point.probe.shape[1] - 1, pattern)
    count = wheel.count
    beyond = point.f - wheel.springs[:, :, None] * point.w
    beyond[..., 0] -= wheel.preload(pattern_elements(wheel, pattern))
    forces = to_complex(beyond.reshape(count, -1, beyond.shape[3]))
    blade = flex.parts.blade
    if not len(flex.factors):
        return np.zeros((count, blade.stop - blade.start, forces.shape[2]), dtype=complex)
    readings = flex.motion(excitation_forces(wheel, flex), flex.deviating, flex.parts.load)
    readings = readings - flex.motion(forces, flex.deviating, flex.parts.contact)
    found = -np.einsum("hnij,njh->nih", flex.E, readings)
    # what the dampers' own deviations do comes by the contacts
    return found[:, : blade.stop - blade.start]


def _homotopy(balance: WheelBalance, options: Options) -> WheelNewton:
    """The excitation raised step by step from nearly stuck to its own, on a secant."""
    iterations = 0
    products = 0
    share = FIRST_LOAD_SHARE
    factor = FIRST_LOAD_FACTOR
    path: list[tuple[float, np.ndarray]] = []
    end: WheelNewton | None = None
    for _ in range(HOMOTOPY_POINTS):
        part = replace(balance, stuck=share * balance.stuck)
        end = newton_wheel(part, _predicted(path, share, part.stuck), options)
        iterations += end.iterations
        products += end.products
        if end.converged:
            if share == 1.0:
                break
            path = [*path[-1:], (share, end.state.w)]
            factor = factor**1.5
        else:
            factor = factor**0.4
        if factor < LAST_LOAD_FACTOR:
            break
        share = min(1.0, factor * (path[-1][0] if path else FIRST_LOAD_SHARE / FIRST_LOAD_FACTOR))
    # HOMOTOPY_POINTS is at least one
    assert end is not None
    if share < 1.0:
        state = evaluate_wheel(balance, end.state.w)
        reason = f"the load homotopy stopped at {share:.3g} of the excitation: {end.reason}"
        end = replace(end, state=state, converged=False, reason=reason)
    return replace(end, iterations=iterations, products=products)


def _predicted(
    path: list[tuple[float, np.ndarray]],
    share: float,
    stuck: np.ndarray,
) -> np.ndarray:
    """Displacements on the secant of the path; proportional or stuck where it has no two points."""
    if not path:
        return stuck
    last, w = path[-1]
    if len(path) == 1:
        return share / last * w
    before, v = path[0]
    return w + (share - last) / (last - before) * (w - v)


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


def _fitted(
    w: np.ndarray,
    wheel: Wheel,
    H: int,
) -> np.ndarray:
    """Displacements with harmonics cut or filled up with zeros.

    Raises:
        InputError: they belong to another wheel.
    """
    if w.shape[:3] != (wheel.count, wheel.nodes, wheel.directions):
        raise InputError("start: expected a solution of a wheel with the same contacts")
    size = 2 * H + 1
    out = np.zeros((*w.shape[:3], size))
    common = min(size, w.shape[3])
    out[..., :common] = w[..., :common]
    return out


def _check_point(
    wheel: Wheel,
    omega: float,
    H: int,
    samples: int,
    pattern: Pattern,
) -> None:
    if not 0 < omega < np.inf:
        raise InputError(f"omega {omega}: expected a positive circular frequency")
    highest = max(wheel.excitation, default=1)
    if max(highest, 1) > H:
        raise InputError(f"H {H}: expected at least {highest}, the highest excited harmonic")
    if samples == 0 and wheel.elements.tangents > 1:
        raise InputError("samples 0: expected samples above 0 for elements with two tangents")
    for name in ("stiffness", "mass"):
        value = getattr(pattern, name)
        if value is None:
            continue
        blade = wheel.sectors[0].ports.get("blade")
        q = 0 if blade is None else len(range(*blade.indices(len(wheel.sectors[0].residual))))
        if np.shape(value) != (wheel.count, q, q):
            raise InputError(
                f"pattern.{name} of shape {np.shape(value)}: expected ({wheel.count}, {q}, {q}), "
                "one square matrix of the port 'blade' for each sector"
            )
        if not np.isfinite(value).all():
            raise InputError(f"pattern.{name}: expected finite numbers")
    _check_dampers(wheel, pattern)


def _check_dampers(wheel: Wheel, pattern: Pattern) -> None:
    mass = pattern.damper_mass
    if mass is not None and (np.shape(mass) != (wheel.count,) or not (np.array(mass) > -1).all()):
        raise InputError(
            f"pattern.damper_mass: expected {wheel.count} relative deviations above -1, one a "
            "damper"
        )
    wanted = (wheel.count * wheel.nodes, wheel.elements.tangents)
    if pattern.start is not None and np.shape(pattern.start) != wanted:
        raise InputError(
            f"pattern.start of shape {np.shape(pattern.start)}: expected {wanted}, forces of the "
            "friction elements of all dampers"
        )
