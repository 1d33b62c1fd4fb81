"""Equations of a nonlinear mode at a given amplitude: residual, frequency and damping, derivatives.

Extended periodic motion (Krack 2015, doi:10.1016/j.compstruc.2015.03.008): a free motion is made
periodic by an artificial negative damping -2 zeta omega M. With the amplitude a of one blade mode
given, its own equation tells both unknowns,

    omega^2 = omega_r^2 + Re(phi_r^H f_1) / a,      2 zeta omega^2 = Im(phi_r^H f_1) / a,

and all other modes answer the contact forces through a flexibility without that mode, which is
regular at the resonance: w_1 = phi_r a - G' f_1. zeta is the damping of friction alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from ..errors import InputError
from ..friction.fourier import to_complex, to_real
from .linear.bodies import Stack
from .linear.condensation import condense
from .linear.contact_flexibility import flexibility_of_mean
from .linear.woodbury import bodies_of
from .model import ReducedModel
from .solver.residual import contact_forces

# relative step of frequency and damping in differences of the flexibility
DIFFERENCE_STEP = 1e-7
# frequency at which the mean is condensed, over the mode's own: no multiple of it is a resonance
OFF_RESONANCE = 0.7320508


@dataclass(frozen=True)
class ModeFrame:
    """What one mode's equations need at all amplitudes."""

    model: ReducedModel
    mode: int
    H: int
    samples: int
    bodies: tuple[Stack, ...]
    # (m,) of the mode in harmonic 1
    shape: np.ndarray
    # (m, m) and (m,) of the mean
    A0: np.ndarray
    stuck0: np.ndarray

    @property
    def still(self) -> np.ndarray:
        """(N,) displacements without motion, all contacts sticking."""
        mean = np.zeros((len(self.stuck0), self.H + 1), dtype=complex)
        mean[:, 0] = self.stuck0
        return to_real(mean).ravel()

    @property
    def moving(self) -> np.ndarray:
        """(N,) True for harmonics above the mean."""
        return np.tile(np.arange(2 * self.H + 1) > 0, len(self.stuck0))


@dataclass(frozen=True)
class ModeState:
    """Displacements (n, d, K), forces beyond the preload (m, H+1), frequency, damping, residual."""

    w: np.ndarray
    f: np.ndarray
    dfdw: np.ndarray
    omega: float
    zeta: float
    r: np.ndarray


def mode_frame(
    model: ReducedModel,
    mode: int,
    H: int,
    samples: int,
) -> ModeFrame:
    bodies = bodies_of(model, H)
    if any(body.coupled is not None for body in bodies):
        raise InputError("damping that couples modes: expected modal damping for nonlinear modes")
    if model.circulatory:
        raise InputError("unsymmetric stiffness: expected a symmetric one for nonlinear modes")
    # any frequency tells the mean; the mode's own is a resonance
    still = condense(_unloaded(model), OFF_RESONANCE * float(model.side(1).omega[mode]), H)
    shape = model.blades(H).shapes[_of(model.blades(H), 1)][model.blades(H).contact][:, mode]
    mean = flexibility_of_mean(still.condensed.flex)
    return ModeFrame(model, mode, H, samples, bodies, shape, mean, still.stuck[0].real)


def _unloaded(model: ReducedModel) -> ReducedModel:
    """The model with its static forces alone."""
    load = np.zeros(len(model.loads(0)[0]))
    return replace(model, excitation={0: load} if model.coupled else {})


def _of(stack: Stack, h: int) -> int:
    """Row of a harmonic in a stack that may serve all of them."""
    return min(h, len(stack.omega) - 1)


def _flexibility(
    frame: ModeFrame,
    h: int,
    omega: float,
    zeta: float,
) -> np.ndarray:
    """(m, m) flexibility of both bodies in harmonic h, in harmonic 1 without the mode itself."""
    G: np.ndarray = np.zeros(())
    w = h * omega
    for i, body in enumerate(frame.bodies):
        s = _of(body, h)
        shapes = body.shapes[s][body.contact]
        Z = body.omega[s] ** 2 - w**2 - 2j * zeta * omega * w
        if i == 0 and h == 1:
            # left out
            Z[frame.mode] = np.inf
        inverse = 1 / Z
        residual = body.residual[_of_residual(body, h)][body.contact, body.contact]
        G = G + (shapes * inverse) @ shapes.conj().T + residual
    return G


def _of_residual(stack: Stack, h: int) -> int:
    return min(h, len(stack.residual) - 1)


def mode_residual(
    frame: ModeFrame,
    x: np.ndarray,
    amplitude: float,
) -> ModeState:
    """Residual of  w - phi a + G' f  for the displacements x."""
    model = frame.model
    shape = (*model.springs.shape, 2 * frame.H + 1)
    w = x.reshape(shape)
    forces = contact_forces(model, w, frame.samples)
    load = forces.f.copy()
    load[:, :, 0] -= model.preload.reshape(shape[:2])
    f = to_complex(load.reshape(-1, shape[2]))
    omega, zeta = _frequency(frame, f[:, 1], amplitude)
    motion = to_complex(w.reshape(-1, shape[2]))
    r = motion.copy()
    springs = model.springs.ravel()
    # the mean as in the balance, w = stuck - A p
    p = f[:, 0].real - springs * motion[:, 0].real
    r[:, 0] = motion[:, 0].real - frame.stuck0 + frame.A0 @ p
    r += _flexed(frame, f, omega, zeta)
    r[:, 1] -= frame.shape * amplitude
    return ModeState(w, f, forces.jacobian, omega, zeta, to_real(r).ravel())


def _frequency(
    frame: ModeFrame,
    f: np.ndarray,
    amplitude: float,
) -> tuple[float, float]:
    """Frequency [rad/s] and damping [1] that close the mode's own equation."""
    own = frame.bodies[0].omega[_of(frame.bodies[0], 1)][frame.mode] ** 2
    drive = frame.shape.conj() @ f / amplitude
    squared = max(own + drive.real, 0.01 * own)
    return float(np.sqrt(squared)), float(drive.imag / (2 * squared))


def mode_jacobian(
    frame: ModeFrame,
    state: ModeState,
    amplitude: float,
) -> np.ndarray:
    """(N, N) derivative of the residual: of the forces exactly, of frequency and damping through
    differences of the flexibility.
    """
    n, d, K = state.w.shape
    m = n * d
    change = state.dfdw.reshape(n, d * K, d * K)
    J = np.zeros((m, K, n, d * K))
    springs = frame.model.springs
    rows = change.reshape(n, d, K, d * K)
    # mean
    mean = rows[:, :, 0].copy()
    for c in range(d):
        mean[:, c, c * K] -= springs[:, c]
    J[:, 0] = np.einsum("inc,nck->ink", frame.A0.reshape(m, n, d), mean)
    for h in range(1, frame.H + 1):
        G = _flexibility(frame, h, state.omega, state.zeta).reshape(m, n, d)
        part = rows[:, :, 2 * h - 1] - 1j * rows[:, :, 2 * h]
        moved = np.einsum("inc,nck->ink", G, part)
        J[:, 2 * h - 1] = moved.real
        J[:, 2 * h] = -moved.imag
    J = J.reshape(m * K, m * K)
    J[np.diag_indices_from(J)] += 1.0
    J += _through_frequency(frame, state, amplitude)
    return J


def _through_frequency(
    frame: ModeFrame,
    state: ModeState,
    amplitude: float,
) -> np.ndarray:
    """The part by omega and zeta: two columns of differences times the rows of phi^H df / a."""
    n, d, _K = state.w.shape
    first = state.dfdw[:, :, 1] - 1j * state.dfdw[:, :, 2]
    shape = frame.shape.conj().reshape(n, d, 1, 1)
    drive = (shape * first).sum(axis=1).ravel() / amplitude
    by_omega = drive.real / (2 * state.omega)
    by_zeta = drive.imag / (2 * state.omega**2) - state.zeta / state.omega**2 * drive.real
    return _frequency_columns(frame, state) @ np.vstack([by_omega, by_zeta])


def amplitude_derivative(
    frame: ModeFrame,
    state: ModeState,
    amplitude: float,
) -> np.ndarray:
    """(N,) derivative of the residual by the amplitude at given displacements."""
    own = frame.bodies[0].omega[_of(frame.bodies[0], 1)][frame.mode] ** 2
    by_omega = -(state.omega**2 - own) / (2 * state.omega * amplitude)
    by_zeta = -state.zeta / amplitude - 2 * state.zeta * by_omega / state.omega
    direct = np.zeros((len(frame.shape), frame.H + 1), dtype=complex)
    direct[:, 1] = -frame.shape
    through = _frequency_columns(frame, state) @ np.array([by_omega, by_zeta])
    return to_real(direct).ravel() + through


def _frequency_columns(frame: ModeFrame, state: ModeState) -> np.ndarray:
    """(N, 2) derivatives of the residual by omega and zeta, by differences."""
    here = _flexed(frame, state.f, state.omega, state.zeta)
    step = DIFFERENCE_STEP * state.omega
    faster = _flexed(frame, state.f, state.omega + step, state.zeta)
    damped = _flexed(frame, state.f, state.omega, state.zeta + DIFFERENCE_STEP)
    columns = [
        to_real((faster - here) / step).ravel(),
        to_real((damped - here) / DIFFERENCE_STEP).ravel(),
    ]
    return np.column_stack(columns)


def _flexed(
    frame: ModeFrame,
    f: np.ndarray,
    omega: float,
    zeta: float,
) -> np.ndarray:
    """(m, H+1) moving displacements by forces, without the mode itself."""
    out = np.zeros_like(f)
    for h in range(1, frame.H + 1):
        out[:, h] = _flexibility(frame, h, omega, zeta) @ f[:, h]
    return out


def stuck_mode(frame: ModeFrame) -> np.ndarray:
    """(m,) relative displacement in the linear mode with all contacts sticking that holds most of
    the blade mode, whose amplitude is 1.
    """
    shapes, squared = [], []
    residual: np.ndarray = np.zeros(())
    for body in frame.bodies:
        s = _of(body, 1)
        shapes.append(body.shapes[s][body.contact])
        squared.append(body.omega[s] ** 2)
        residual = residual + body.residual[_of_residual(body, 1)][body.contact, body.contact]
    Phi = np.hstack(shapes)
    springs = frame.model.springs.ravel()
    # displacements of the springs by those of the modes: the residual flexibility is in series
    held = np.linalg.solve(np.eye(len(Phi)) + residual * springs, Phi)
    stiffness = np.diag(np.concatenate(squared)) + Phi.conj().T @ (springs[:, None] * held)
    _, vectors = linalg.eigh(stiffness)
    found = vectors[:, np.argmax(abs(vectors[frame.mode]))]
    return held @ (found / found[frame.mode])


def probe_amplitudes(
    frame: ModeFrame,
    state: ModeState,
    amplitude: float,
) -> np.ndarray:
    """(H+1, probes) moving amplitudes of the blade."""
    blades = frame.bodies[0]
    out = np.zeros((frame.H + 1, blades.probe.stop - blades.probe.start), dtype=complex)
    for h in range(1, frame.H + 1):
        s = _of(blades, h)
        w = h * state.omega
        Z = blades.omega[s] ** 2 - w**2 - 2j * state.zeta * state.omega * w
        modal = -(blades.shapes[s][blades.contact].conj().T @ state.f[:, h])
        modal = modal / Z
        if h == 1:
            modal[frame.mode] = amplitude
        residual = blades.residual[_of_residual(blades, h)][blades.probe, blades.contact]
        out[h] = blades.shapes[s][blades.probe] @ modal - residual @ state.f[:, h]
    return out
