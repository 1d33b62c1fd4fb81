"""A response curve with the error that was estimated at some of its points."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ...hbm.solution import Solution
from .settings import Settings


@dataclass(frozen=True)
class CheckedCurve:
    """A curve whose settings were checked at some of its points."""

    # with the error estimated at the resonance
    settings: Settings
    # sorted by frequency
    points: list[Solution]
    # circular frequency of the checked points to the estimated relative error
    errors: dict[float, float]
    # what the sweep could not do, in sentences
    notes: tuple[str, ...] = ()
    # parts of the error of the resonance by what richer models change (settings.DIRECTIONS); empty
    # where they are not known one by one
    parts: Mapping[str, float] = field(default_factory=dict)


def checked_points(curve: CheckedCurve) -> np.ndarray:
    """(k,) bool: which points were checked themselves."""
    return np.array([p.omega in curve.errors for p in curve.points])


def estimated_errors(curve: CheckedCurve) -> np.ndarray:
    """(k,) estimated relative error of each point: linear in frequency between the checked ones,
    held beyond them.

    Unknown (infinite) at points that were not solved, and where the nearest checked one tells
    nothing.
    """
    at = np.array(sorted(curve.errors))
    known_errors = np.array([curve.errors[w] for w in at])
    omegas = np.array([p.omega for p in curve.points])
    if not np.isfinite(known_errors).any():
        return np.full(len(omegas), np.inf)
    blind = ~np.isfinite(known_errors[abs(omegas[:, None] - at).argmin(axis=1)])
    between = np.interp(
        omegas, at[np.isfinite(known_errors)], known_errors[np.isfinite(known_errors)]
    )
    return np.where(blind | [not p.converged for p in curve.points], np.inf, between)
