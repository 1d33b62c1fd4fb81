"""The number that is signed: alternating stress over the amplitude that the material lasts at the
mean stress there (Haigh's diagram).

The mean stress is that of rotation, as von Mises stress with the sign of its trace (signed von
Mises: compression counts as negative), the alternating one the largest von Mises stress that the
whole damped motion reaches in a period. A utilisation of one is the limit.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..errors import InputError
from ..scene.tables import Fatigue
from ..scene.units import parse, show
from ..util.arrays import RealArray

# places of the table
WORST_PLACES = 10
# of the model's size: a place nearer to a worse one is the same
SAME_PLACE = 0.01
# of Haigh's diagram [Pa], as of the two ends of Goodman's line
LEAST_STRESS, LARGEST_STRESS = 1e5, 1e11


@dataclass(frozen=True)
class HaighDiagram:
    """Stress amplitudes that last, by mean stress; straight in between."""

    # (k,) mean stress [Pa], ascending
    mean: RealArray
    # (k,) largest amplitude there [Pa]
    amplitude: RealArray

    def allowed(self, mean: np.ndarray) -> np.ndarray:
        """Largest amplitude [Pa] at mean stresses [Pa]; NaN outside of the diagram."""
        inside = (mean >= self.mean[0]) & (mean <= self.mean[-1])
        return np.where(inside, np.interp(mean, self.mean, self.amplitude), np.nan)


@dataclass(frozen=True)
class Utilisation:
    """How much of what the material lasts is used, at the nodes of a blade."""

    # (n, 3) [m]
    points: RealArray
    # (n,) [Pa]
    alternating: RealArray
    # (n,) [Pa], negative in compression
    mean: RealArray
    # (n,) alternating stress over the allowed one; infinite where none is allowed, NaN outside of
    # the diagram
    used: RealArray

    @property
    def worst(self) -> int:
        """The node that is used most."""
        return int(np.nanargmax(self.used))

    def worst_places(self, count: int = WORST_PLACES) -> list[int]:
        """Nodes that are used most, each the worst of its surroundings."""
        apart = SAME_PLACE * float(np.ptp(self.points, axis=0).max())
        found: list[int] = []
        for node in np.argsort(-np.nan_to_num(self.used, nan=-1.0), kind="stable"):
            if len(found) == count or np.isnan(self.used[node]):
                break
            away = np.linalg.norm(self.points[found] - self.points[node], axis=1)
            if away.min(initial=np.inf) > apart:
                found.append(int(node))
        return found


def haigh_diagram(table: Fatigue) -> HaighDiagram | None:
    """The diagram that a scene gives; None where it gives none.

    Goodman's line falls from the endurance limit without mean stress to zero at the ultimate
    strength; under compression the limit stays, which is safe.

    Raises:
        InputError: only one of the two values, both forms at once, or a table that cannot be read.
    """
    if table.haigh is not None:
        if table.endurance is not None or table.ultimate is not None:
            raise InputError(
                "fatigue.haigh: takes the place of fatigue.endurance and fatigue.ultimate, "
                "expected only one of the two"
            )
        return _read_diagram(table.haigh)
    if table.endurance is None and table.ultimate is None:
        return None
    if table.endurance is None or table.ultimate is None:
        missing, given = "endurance", "ultimate"
        if table.endurance is not None:
            missing, given = given, missing
        raise InputError(
            f"fatigue.{missing}: expected with fatigue.{given}, the other end of Goodman's line, "
            "and left out"
        )
    if table.endurance > table.ultimate:
        raise InputError(
            f"fatigue.endurance = {show(table.endurance, 'Pa')}: expected at most "
            f"fatigue.ultimate = {show(table.ultimate, 'Pa')}"
        )
    mean = np.array([-table.ultimate, 0.0, table.ultimate])
    return HaighDiagram(mean, np.array([table.endurance, table.endurance, 0.0]))


def _read_diagram(texts: tuple[str, ...]) -> HaighDiagram:
    """From texts such as "200 MPa: 150 MPa", mean stress and amplitude."""
    rows = []
    for text in texts:
        mean, colon, amplitude = text.partition(":")
        if not colon:
            raise InputError(
                f"fatigue.haigh = {text!r}: expected mean stress and amplitude, such as "
                '"200 MPa: 150 MPa"'
            )
        rows.append([parse(value.strip(), "Pa", "fatigue.haigh") for value in (mean, amplitude)])
    if len(rows) < 2:
        raise InputError(f"fatigue.haigh: {len(rows)} mean stress, expected at least two")
    for (lower, _), (following, _) in pairwise(rows):
        if not following > lower:
            raise InputError(
                f"fatigue.haigh: {show(following, 'Pa')} after {show(lower, 'Pa')}, expected "
                "rising mean stresses"
            )
    for value in (value for row in rows for value in row):
        # a number without a unit is in pascals
        if value != 0 and not LEAST_STRESS <= abs(value) <= LARGEST_STRESS:
            raise InputError(
                f"fatigue.haigh: {show(value, 'Pa')}, expected 0, or a size from "
                f"{show(LEAST_STRESS, 'Pa')} to {show(LARGEST_STRESS, 'Pa')}"
            )
    lowest = min(amplitude for _, amplitude in rows)
    if lowest < 0:
        raise InputError(
            f"fatigue.haigh: an amplitude of {show(lowest, 'Pa')}, expected none below 0"
        )
    table = np.array(rows)
    return HaighDiagram(table[:, 0], table[:, 1])


def fatigue_utilisation(
    diagram: HaighDiagram,
    points: np.ndarray,
    alternating: np.ndarray,
    mean: np.ndarray,
) -> Utilisation:
    """Alternating stress over the allowed one at all nodes.

    Args:
        points: (n, 3) [m].
        alternating, mean: (n,) [Pa].

    Raises:
        InputError: the diagram does not reach the mean stress of a node; it names the place.
    """
    outside = (mean < diagram.mean[0]) | (mean > diagram.mean[-1])
    if outside.any():
        low, high = (show(end, "Pa") for end in (diagram.mean[0], diagram.mean[-1]))
        node = int(np.flatnonzero(outside)[np.abs(mean[outside]).argmax()])
        place = ", ".join(f"{1e3 * x:.1f}" for x in points[node])
        raise InputError(
            f"fatigue: the mean stress is {show(float(mean[node]), 'Pa')} at ({place}) mm, the "
            f"diagram has {low} to {high}; expected one that reaches it"
        )
    allowed = diagram.allowed(mean)
    used = np.where(alternating > 0, np.inf, 0.0)
    np.divide(alternating, allowed, out=used, where=allowed > 0)
    return Utilisation(points, alternating, mean, used)
