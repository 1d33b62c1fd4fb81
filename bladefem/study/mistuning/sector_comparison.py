"""The tuned wheel by the balance of all blades against the response of its one sector, whose
harmonics, folds and stability are judged, by marches in time where these are needed.

Both are the same wheel. Where they differ by more than the error of the response the harmonics that
many wheels can afford, or held mean displacements, do not describe how the dampers move.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...wheel.model import Wheel
from ...wheel.statistics import Amplification
from ...wheel.tuned import travelling_order
from ..pipeline.curve import Curve


@dataclass(frozen=True)
class SectorComparison:
    """Resonance amplitudes of the tuned wheel [m]."""

    # by the balance of all blades
    balance: float
    # of the sector's response; NaN where that is the response to other forces
    sector: float
    # within the error of the latter, or not compared
    agrees: bool


def compared_with_sector(
    wheel: Wheel,
    curve: Curve,
    height: float,
    accuracy: float,
) -> SectorComparison:
    """Compare the tuned wheel's highest peak with the resonance of a curve.

    Args:
        height: of that peak, on the wheel under the load of the curve [m].
        accuracy: relative, of what is asked for; comes on top of the curve's own error.
    """
    if set(wheel.excitation) != {1} or travelling_order(wheel) is None:
        return SectorComparison(height, float("nan"), True)
    sector = curve.peak_amplitude
    apart = abs(height / sector - 1)
    return SectorComparison(height, sector, not apart > accuracy + (curve.error or 0.0))


def comparison_words(compared: SectorComparison) -> str:
    """What both give, and that it is too far apart."""
    return (
        f"the balance of all blades gives {1e6 * compared.balance:.4g} um for the tuned wheel and "
        f"the sector's own response {1e6 * compared.sector:.4g} um, farther apart than its error: "
        "the harmonics of the balance, or the mean displacements that it holds, do not describe "
        "how the dampers move"
    )


def with_comparison(found: Amplification, compared: SectorComparison) -> Amplification:
    """Statistics of one load; where both do not agree the tuned amplitude is the sector's."""
    tuned = found.tuned if compared.agrees else np.array([compared.sector])
    return replace(
        found,
        tuned=tuned,
        peak=tuned[:, None] * found.factor,
        tuned_balance=np.array([compared.balance]),
        tuned_sector=np.array([compared.sector]),
        agrees=np.array([compared.agrees]),
    )
