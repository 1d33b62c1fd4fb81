"""Wheels drawn at random: deviations of blades and dampers by a scrambled Sobol sequence, the same
for every load and on every rank.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..errors import InputError
from ..util.arrays import RealArray
from .model import Pattern, Wheel, pattern_elements

# standard deviations beyond which nothing is drawn: parts outside are sorted out
MAX_DEVIATIONS = 3.0


@dataclass(frozen=True)
class Scatter:
    """Relative standard deviations of normal distributions, cut at three of them.

    Raises:
        InputError: a deviation is negative, or so large that a part could lose its sign.
    """

    # of the blades, in the unit of the pattern that is made from them: frequency or stiffness
    blades: float = 0.02
    # of the friction coefficient, contact stiffness and normal load of each damper
    friction: float = 0.0
    stiffness: float = 0.0
    load: float = 0.0
    # of the mass of each damper: its inertia, and the normal load that its mass makes
    mass: float = 0.0
    # largest share of Coulomb's limit that the loading history leaves in a damper's contacts
    # beyond the wheel's own friction forces; uniform in the circle of that size, its direction the
    # same in all contacts of a damper
    traction: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        if not 0 <= self.traction <= 1:
            raise InputError(f"scatter.traction {self.traction}: expected a share from 0 to 1")
        for name in ("blades", "friction", "stiffness", "load", "mass"):
            value = getattr(self, name)
            if not 0 <= value * MAX_DEVIATIONS < 1:
                raise InputError(
                    f"scatter.{name} {value}: expected a relative standard deviation from 0 to "
                    f"{1 / MAX_DEVIATIONS:.2f}"
                )


@dataclass(frozen=True)
class Draws:
    """Random deviations of W wheels of N sectors."""

    # (W, N) relative deviations of the blades, in the unit of their pattern
    blades: RealArray
    # (W, N) factors of each damper's friction coefficient, contact stiffness, normal load and mass
    friction: RealArray
    stiffness: RealArray
    load: RealArray
    mass: RealArray
    # (W, N, 2) friction forces over Coulomb's limit, along both directions
    traction: RealArray

    def factors(self, scatter: Scatter) -> dict[str, RealArray]:
        """The factors (W, N) of those parameters of a damper that scatter."""
        scattered = {
            "friction": scatter.friction,
            "stiffness": scatter.stiffness,
            "load": max(scatter.load, scatter.mass),
            "mass": scatter.mass,
        }
        return {name: getattr(self, name) for name, size in scattered.items() if size > 0}


def drawn_deviations(count: int, scatter: Scatter, wheels: int) -> Draws:
    """Deviations of all sectors; a parameter's draws do not depend on which others scatter.

    The load of a damper is its centrifugal force: it grows with the damper's mass.
    """
    # of each sector: blade, four of its damper, and two of its friction forces
    uniform = _uniform_sample(wheels, 7 * count, scatter.seed).reshape(wheels, 7, count)
    normal = _cut_normal(uniform[:, :5])
    sizes = (scatter.friction, scatter.stiffness, scatter.load, scatter.mass)
    friction, stiffness, load, mass = (1 + size * normal[:, 1 + i] for i, size in enumerate(sizes))
    # uniform in a circle
    radius = scatter.traction * np.sqrt(uniform[:, 5])
    angle = 2 * np.pi * uniform[:, 6]
    traction = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=2)
    blades = scatter.blades * normal[:, 0]
    return Draws(blades, friction, stiffness, load * mass, mass, traction)


def drawn_patterns(
    wheel: Wheel,
    scatter: Scatter,
    wheels: int,
    blade_pattern: Callable[[np.ndarray], Pattern],
) -> list[Pattern]:
    """Patterns of some wheels.

    Args:
        blade_pattern: a pattern from relative deviations (N,) of the blades.
    """
    draws = drawn_deviations(wheel.count, scatter, wheels)
    patterns = []
    for i, deviation in enumerate(draws.blades):
        pattern = blade_pattern(deviation)
        factors = {name: value[i] for name, value in draws.factors(scatter).items()}
        if factors:
            pattern = with_dampers(wheel, pattern, factors)
        if scatter.traction > 0:
            pattern = with_tractions(wheel, pattern, draws.traction[i])
        patterns.append(pattern)
    return patterns


def with_dampers(
    wheel: Wheel,
    pattern: Pattern,
    factors: Mapping[str, np.ndarray],
) -> Pattern:
    """A pattern whose dampers differ.

    Args:
        factors: "friction", "stiffness", "load" and "mass" to factors (N,) of each damper; mass is
            inertia alone, the load that it makes is given by "load".
    """
    ones = np.ones(wheel.count)
    friction, stiffness, load = (
        np.repeat(factors.get(name, ones), wheel.nodes)
        for name in ("friction", "stiffness", "load")
    )
    e = wheel.all_elements
    elements = replace(
        e,
        mu=friction * e.mu,
        kt=wheel.scaled_stiffness("kt", stiffness),
        kn=wheel.scaled_stiffness("kn", stiffness),
        n0=load * e.n0,
        t0=None if e.t0 is None else load[:, None] * e.t0,
    )
    start = None
    if wheel.start is not None:
        start = load[:, None] * wheel.first_forces(pattern, e)
    heavier = factors["mass"] - 1 if "mass" in factors else None
    return replace(pattern, elements=elements, damper_mass=heavier, start=start)


def with_tractions(
    wheel: Wheel,
    pattern: Pattern,
    traction: np.ndarray,
) -> Pattern:
    """A pattern whose friction law starts from other forces, which contacts keep that never slip:
    those of the wheel and a share (N, 2) of Coulomb's limit of each damper, at that limit at most.
    """
    elements = pattern_elements(wheel, pattern)
    limit = (elements.mu * np.maximum(elements.n0, 0.0))[:, None]
    more = np.repeat(traction[:, : elements.tangents], wheel.nodes, axis=0)
    start = wheel.first_forces(pattern, elements) + limit * more
    size = np.linalg.norm(start, axis=1, keepdims=True)
    beyond = np.divide(limit, size, out=np.ones_like(size), where=size > limit)
    return replace(pattern, start=beyond * start)


def _uniform_sample(
    wheels: int,
    columns: int,
    seed: int,
) -> np.ndarray:
    """(wheels, columns) between 0 and 1, spread evenly."""
    # slow to load, and all commands load this module
    from scipy.stats import qmc

    sequence = qmc.Sobol(columns, scramble=True, seed=seed)
    power = int(np.ceil(np.log2(max(wheels, 2))))
    return sequence.random_base2(power)[:wheels]


def _cut_normal(uniform: np.ndarray) -> np.ndarray:
    """Uniform numbers as those of the normal distribution, cut off."""
    from scipy.stats import norm

    low = norm.cdf(-MAX_DEVIATIONS)
    return norm.ppf(low + (1 - 2 * low) * uniform)
