"""Aerodynamic influence between blades: damping and frequency shift of each nodal diameter,
flutter, and the limit cycle that friction leaves.

A blade mode of mass 1 in nodal diameter d feels -c_d q, c_d a complex stiffness [1/s^2]: its real
part shifts the squared frequency, its imaginary part over 2 omega^2 is a damping ratio, negative
where the flow feeds the motion. Away from the mode's own frequency the imaginary part acts as a
viscous force does, Im(c_d) / omega times the velocity. Influence coefficients L_k are the forces on
a blade by the motion of the blade k places ahead: c_d = sum_k L_k e^{j 2 pi d k / N}.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..data import PortModel
from ..errors import InputError
from ..hbm.nonlinear_modes import NonlinearMode


@dataclass(frozen=True)
class LimitCycle:
    """A free motion that neither grows nor decays."""

    # of the mode [m kg^1/2]
    amplitude: float
    # [rad/s]
    omega: float
    # (probes,) size of the first harmonic at each [m]
    probe: np.ndarray
    # larger motions decay and smaller ones grow
    stable: bool


def with_flow(body: PortModel, influence: np.ndarray) -> PortModel:
    """A sector in one nodal diameter with the forces of the flow on its modes.

    Args:
        influence: (m,) complex aerodynamic stiffness of each mode [1/s^2]; zero for rigid ones.

    Raises:
        InputError: the flow leaves a mode no stiffness.
    """
    if not np.any(influence):
        return body
    squared = body.omega**2 + influence.real
    if (squared[influence != 0] <= 0).any():
        raise InputError(
            "influence: the aerodynamic stiffness leaves a mode no stiffness of its own, expected "
            "a smaller frequency shift"
        )
    rate = np.divide(influence.imag, body.omega, out=np.zeros_like(squared), where=body.omega > 0)
    own = np.zeros(len(rate)) if body.damping is None else body.damping
    damping = own + (rate if own.ndim == 1 else np.diag(rate))
    return replace(
        body, omega=np.sqrt(squared), damping=damping, self_excited=bool((rate < 0).any())
    )


def limit_cycles(points: Sequence[NonlinearMode], damping: float) -> list[LimitCycle]:
    """Amplitudes at which friction's damping balances what else there is, between the points.

    Where the branch runs back in amplitude, between two folds, no cycle is stable.

    Args:
        points: of one nonlinear mode, in the order of its branch.
        damping: share of critical damping of bodies and flow together, negative for flutter.

    Raises:
        InputError: friction cannot hold the motion at any of the amplitudes: flutter.
    """
    known = [p for p in points if p.converged]
    total = np.array([p.zeta for p in known]) + damping
    if len(known) < 2:
        raise InputError(f"points: {len(known)} converged amplitudes, expected at least 2")
    if (total < 0).all():
        raise InputError(
            f"aerodynamic damping {100 * damping:.3g} %: flutter, friction holds "
            f"{100 * max(p.zeta for p in known):.3g} % at most, expected less negative damping"
        )
    found = []
    for i in np.flatnonzero(np.sign(total[1:]) != np.sign(total[:-1])):
        share = total[i] / (total[i] - total[i + 1])
        a, b = known[i], known[i + 1]
        # straight in the logarithm of the amplitude
        amplitude = a.amplitude * (b.amplitude / a.amplitude) ** share
        omega = a.omega + share * (b.omega - a.omega)
        seen = [abs(p.probe[1]) / p.amplitude for p in (a, b)]
        probe = amplitude * (seen[0] + share * (seen[1] - seen[0]))
        stable = bool(total[i + 1] > total[i] and b.amplitude > a.amplitude)
        found.append(LimitCycle(float(amplitude), float(omega), probe, stable))
    return found
