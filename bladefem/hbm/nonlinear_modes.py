"""Nonlinear modes of blade and damper: frequency and damping against amplitude.

`bladefem.hbm.mode_equations` has the equations of extended periodic motion,
`bladefem.hbm.mode_path` the continuation, also where the branch turns back in amplitude.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from .mode_equations import (
    ModeFrame,
    mode_frame,
    mode_residual,
    mode_with_others,
    probe_amplitudes,
)
from .mode_newton import PathSpot
from .mode_path import MAX_ARCS, follow_mode
from .model import ReducedModel
from .validate_model import check_point

# unknowns of the dense factorisation
MAX_DENSE_UNKNOWNS = 6000


@dataclass(frozen=True)
class NonlinearMode:
    """The motion at one amplitude: converged, or the best that was found, with the reason."""

    # of the blade mode, first harmonic [m kg^1/2]
    amplitude: float
    # number of the blade mode, from 0
    mode: int
    # [rad/s]
    omega: float
    # share of critical damping by friction [1]
    zeta: float
    # (n, d, 2H+1) relative displacements [m]
    w: np.ndarray
    # (H+1, probes) complex amplitudes at the probes [m]
    probe: np.ndarray
    converged: bool
    reason: str
    iterations: int
    # relative to the size of the motion [1]
    residual: float
    # the amplitude turns back along the branch: the largest or smallest one nearby
    fold: bool = False


def nonlinear_mode(
    model: ReducedModel,
    amplitudes: Sequence[float],
    mode: int = 0,
    H: int = 3,
    samples: int = 128,
    start: NonlinearMode | None = None,
    arcs: int = MAX_ARCS,
) -> Iterator[NonlinearMode]:
    """Frequency and damping of one mode along its branch through growing amplitudes, begun at the
    linear mode with all contacts sticking that holds most of the blade mode.

    One motion for each amplitude; where the branch turns back before the next one, also the
    motions on the way round its folds, in the order of the branch. An amplitude that is not reached
    gives a motion that is not converged and says how far the branch was followed.

    Args:
        model: its excitation and its damping are left out of account.
        amplitudes: of the blade mode's first harmonic [m kg^1/2], above zero.
        mode: number of the blade mode in the nodal diameter of harmonic 1, from 0.
        start: a motion of this model, with these harmonics, to begin at in place of full stick.
        arcs: motions between two amplitudes after which the branch is given up there.

    Raises:
        InputError: amplitudes, mode, H or samples are out of range, or there are too many unknowns.
    """
    own = model.side(1).omega
    if not 0 <= mode < len(own) or not own[mode] > 0:
        raise InputError(f"mode {mode}: expected an elastic mode from 0 to {len(own) - 1}")
    check_point(model, float(own[mode]), max(H, *model.excitation, *model.normal), samples)
    unknowns = model.unknowns(H)
    if unknowns > MAX_DENSE_UNKNOWNS:
        raise InputError(
            f"{unknowns} unknowns: expected at most {MAX_DENSE_UNKNOWNS}, fewer harmonics or nodes"
        )
    for amplitude in amplitudes:
        if not 0 < amplitude < np.inf:
            raise InputError(f"amplitude {amplitude}: expected a positive number")
    frame = mode_frame(model, mode, H, samples)
    first = None if start is None else _as_spot(frame, start)
    for spot in follow_mode(frame, map(float, amplitudes), first, arcs):
        yield _as_mode(frame, spot)


def _as_spot(frame: ModeFrame, point: NonlinearMode) -> PathSpot:
    q = (point.w.ravel() - frame.still) / point.amplitude
    state = mode_residual(frame, point.w.ravel(), point.amplitude)
    s = float(np.log(point.amplitude))
    return PathSpot(q, s, state, point.converged, point.reason, 0, point.residual)


def _as_mode(frame: ModeFrame, spot: PathSpot) -> NonlinearMode:
    return NonlinearMode(
        spot.amplitude,
        frame.mode,
        spot.state.omega,
        spot.state.zeta,
        spot.state.w,
        probe_amplitudes(frame, spot.state, spot.amplitude),
        spot.converged,
        spot.reason,
        spot.iterations,
        spot.residual,
        spot.fold,
    )


def modal_damping(model: ReducedModel, points: Sequence[NonlinearMode]) -> np.ndarray:
    """(points,) damping of the modes of one branch by bodies and flow, over the motion of the blade
    mode [1/s]; friction damps the modes that follow it by Coriolis forces as well.
    """
    blades = model.blades(1)
    own = blades.viscous[-1]
    if blades.coupled is not None:
        own = own + np.diagonal(blades.coupled[-1]).real
    rates = [own + blades.hysteretic[-1] / p.omega for p in points]
    return np.array(
        [
            rate @ part + 2 * p.zeta * p.omega * (part.sum() - 1)
            for rate, part, p in zip(rates, _moving_parts(model, points), points, strict=True)
        ]
    )


def _moving_parts(model: ReducedModel, points: Sequence[NonlinearMode]) -> list[np.ndarray]:
    """Squared size of each mode over that of the blade mode, point by point (k,)."""
    blades = model.blades(1)
    return [abs(mode_with_others(blades, p.mode, p.omega, p.zeta)) ** 2 for p in points]


def force_at_resonance(model: ReducedModel, point: NonlinearMode) -> float:
    """Size of the modal force that keeps this motion up at its resonance, damping of the bodies
    included [N kg^-1/2].
    """
    (own,) = modal_damping(model, [point])
    return float((2 * point.zeta * point.omega + own) * point.omega * point.amplitude)


def modal_forces(model: ReducedModel, points: Sequence[NonlinearMode]) -> np.ndarray:
    """(points,) sizes of the model's excitation on the mode and on those that follow it
    [N kg^-1/2].
    """
    blades = model.blades(1)
    force = blades.shapes[-1, blades.load].conj().T @ model.loads(1)[1]
    return np.array(
        [abs(mode_with_others(blades, p.mode, p.omega, p.zeta).conj() @ force) for p in points]
    )
