"""Equations of a nonlinear mode at a given amplitude: residual, frequency and damping, derivatives.

Extended periodic motion (Krack 2015, doi:10.1016/j.compstruc.2015.03.008): a free motion is made
periodic by an artificial negative damping -2 zeta omega M. With the amplitude a of one blade mode
given, its own equation tells both unknowns,

    omega^2 = omega_r^2 + Re(phi_r^H f_1) / a,      2 zeta omega^2 = Im(phi_r^H f_1) / a,

and all other modes answer the contact forces through a flexibility without that mode, which is
regular at the resonance: w_1 = phi_r a - G' f_1. zeta is the damping of friction alone.

Coriolis forces, which do no work, couple the mode with the others: these follow it, which changes
phi_r, and add to its own equation. Both unknowns then stand on both sides of that.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from ..errors import InputError
from ..friction.fourier import to_complex, to_real
from .linear.bodies import Stack, gyroscopic_part
from .linear.condensation import condense
from .linear.contact_flexibility import flexibility_of_mean
from .linear.woodbury import bodies_of
from .model import SKEW_ROUNDING_SHARE, ReducedModel
from .solver.residual import contact_forces

# rounds in which frequency and damping are found where Coriolis forces couple the modes, and their
# relative change at the end
COUPLED_ROUNDS = 60
COUPLED_CHANGE = 1e-14
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
    # (S, k, k) Coriolis forces of the blade's modes and of the damper's [1/s]; None without
    coriolis: np.ndarray | None = None
    damper_coriolis: np.ndarray | None = None
    # on the way to a motion (`mode_detour`): of the contacts' alternating forces that act, and the
    # damping ratio that all modes but this one in harmonic 1 have
    share: float = 1.0
    lent: float = 0.0

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
class _Following:
    """How the other modes follow the mode in harmonic 1, at one frequency and damping."""

    # (m,) motion of the contacts with the mode, and forces of the contacts as the mode feels them
    shape: np.ndarray
    reading: np.ndarray
    # what the other modes' answer adds to the squared frequency [1/s^2]
    added: complex


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
    theirs = _lossless_coupling(bodies[1]) if len(bodies) > 1 else None
    if model.circulatory:
        raise InputError("unsymmetric stiffness: expected a symmetric one for nonlinear modes")
    # any frequency tells the mean; the mode's own is a resonance
    still = condense(_unloaded(model), OFF_RESONANCE * float(model.side(1).omega[mode]), H)
    shape = model.blades(H).shapes[_of(model.blades(H), 1)][model.blades(H).contact][:, mode]
    mean = flexibility_of_mean(still.condensed.flex)
    # what has a loss is damping, and left out
    ours = coriolis_part(bodies[0])
    stuck0 = still.stuck[0].real
    return ModeFrame(model, mode, H, samples, bodies, shape, mean, stuck0, ours, theirs)


def _lossless_coupling(damper: Stack) -> np.ndarray | None:
    """`coriolis_part` of a damper.

    Raises:
        InputError: damping couples its modes.
    """
    found = coriolis_part(damper)
    if damper.coupled is None:
        return None
    loss = damper.coupled if found is None else damper.coupled - found
    if abs(loss).max() > SKEW_ROUNDING_SHARE * abs(damper.coupled).max():
        raise InputError("damping that couples modes: expected modal damping of a damper")
    return found


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
    for i, body in enumerate(frame.bodies):
        shapes = body.shapes[_of(body, h)][body.contact]
        inverse = _inverse(frame, i, h, omega, zeta)
        residual = body.residual[_of_residual(body, h)][body.contact, body.contact]
        G = G + shapes @ inverse @ shapes.conj().T + residual
    return G


def _inverse(frame: ModeFrame, i: int, h: int, omega: float, zeta: float) -> np.ndarray:
    """(k, k) inverse modal impedance of a body in harmonic h; zero for the mode itself in harmonic
    1.
    """
    body = frame.bodies[i]
    w = h * omega
    own = body.omega[_of(body, h)]
    Z = own**2 - w**2 - 2j * zeta * omega * w
    if frame.lent:
        Z = Z + 2j * frame.lent * own * w
    kept = np.ones(len(Z), dtype=bool)
    if i == 0 and h == 1:
        kept[frame.mode] = False
    found = np.zeros((len(Z), len(Z)), dtype=complex)
    coriolis = frame.damper_coriolis if i else frame.coriolis
    if coriolis is None:
        found[kept, kept] = 1 / Z[kept]
        return found
    full = np.diag(Z) + 1j * w * coriolis[_of(body, h)]
    some = np.ix_(kept, kept)
    found[some] = np.linalg.inv(full[some])
    return found


def _followed(frame: ModeFrame, omega: float, zeta: float) -> _Following:
    """Without Coriolis forces they do not."""
    if frame.coriolis is None:
        return _Following(frame.shape, frame.shape.conj(), 0.0)
    body = frame.bodies[0]
    shapes = body.shapes[_of(body, 1)][body.contact]
    coupling = 1j * omega * frame.coriolis[_of(body, 1)]
    inverse = _inverse(frame, 0, 1, omega, zeta)
    following = inverse @ coupling[:, frame.mode]
    felt = coupling[frame.mode] @ inverse
    return _Following(
        frame.shape - shapes @ following,
        frame.shape.conj() - felt @ shapes.conj().T,
        complex(coupling[frame.mode, frame.mode] - coupling[frame.mode] @ following),
    )


def _of_residual(stack: Stack, h: int) -> int:
    return min(h, len(stack.residual) - 1)


def mode_with_others(blades: Stack, mode: int, omega: float, zeta: float) -> np.ndarray:
    """(k,) amplitudes of the blade's modes in harmonic 1 that follow one of amplitude 1 through
    Coriolis forces.
    """
    coriolis = coriolis_part(blades)
    found = np.zeros(blades.omega.shape[1], dtype=complex)
    found[mode] = 1.0
    if coriolis is None:
        return found
    own = _of(blades, 1)
    others = np.arange(len(found)) != mode
    Z = 1j * omega * coriolis[own]
    Z = Z + np.diag(blades.omega[own] ** 2 - omega**2 - 2j * zeta * omega**2)
    found[others] = -np.linalg.solve(Z[np.ix_(others, others)], Z[others, mode])
    return found


def coriolis_part(blades: Stack) -> np.ndarray | None:
    """(S, k, k) what couples the modes without a loss [1/s]; None without."""
    if blades.coupled is None:
        return None
    found = gyroscopic_part(blades.coupled)
    return found if found.any() else None


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
    jacobian = forces.jacobian
    if frame.share != 1.0:
        load[:, :, 1:] *= frame.share
        jacobian = jacobian.copy()
        jacobian[:, :, 1:] *= frame.share
    f = to_complex(load.reshape(-1, shape[2]))
    omega, zeta = _frequency(frame, f[:, 1], amplitude)
    motion = to_complex(w.reshape(-1, shape[2]))
    r = motion.copy()
    springs = model.springs.ravel()
    # the mean as in the balance, w = stuck - A p
    p = f[:, 0].real - springs * motion[:, 0].real
    r[:, 0] = motion[:, 0].real - frame.stuck0 + frame.A0 @ p
    r += _moved(frame, f, omega, zeta, amplitude)
    return ModeState(w, f, jacobian, omega, zeta, to_real(r).ravel())


def _frequency(
    frame: ModeFrame,
    f: np.ndarray,
    amplitude: float,
) -> tuple[float, float]:
    """Frequency [rad/s] and damping [1] that close the mode's own equation."""
    own = frame.bodies[0].omega[_of(frame.bodies[0], 1)][frame.mode] ** 2
    if frame.coriolis is None:
        return _from_squared(own, own + frame.shape.conj() @ f / amplitude)
    omega, zeta = float(np.sqrt(own)), 0.0
    for _ in range(COUPLED_ROUNDS):
        before = omega, zeta
        rest = _followed(frame, omega, zeta)
        omega, zeta = _from_squared(own, own + rest.added + rest.reading @ f / amplitude)
        if abs(omega / before[0] - 1) + abs(zeta - before[1]) < COUPLED_CHANGE:
            break
    return omega, zeta


def _from_squared(own: float, squared: complex) -> tuple[float, float]:
    """Frequency and damping of omega^2 (1 + 2i zeta), which is kept from falling far below the
    mode's own.
    """
    real = max(squared.real, 0.01 * own)
    return float(np.sqrt(real)), float(squared.imag / (2 * real))


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
    reading = _followed(frame, state.omega, state.zeta).reading.reshape(n, d, 1, 1)
    drive = (reading * first).sum(axis=1).ravel() / amplitude
    rows = _of_drive(frame, state, amplitude) @ np.vstack([drive.real, drive.imag])
    return _frequency_columns(frame, state, amplitude) @ rows


def _of_drive(frame: ModeFrame, state: ModeState, amplitude: float) -> np.ndarray:
    """(2, 2) changes of omega and zeta by the real and the imaginary part of what the forces add to
    the squared frequency.
    """
    omega, zeta = state.omega, state.zeta
    changes = np.array([[2 * omega, 0.0], [4 * zeta * omega, 2 * omega**2]])
    if frame.coriolis is not None:
        here = _squared_by_others(frame, state.f[:, 1], omega, zeta, amplitude)
        step = DIFFERENCE_STEP * omega
        faster = _squared_by_others(frame, state.f[:, 1], omega + step, zeta, amplitude)
        damped = _squared_by_others(frame, state.f[:, 1], omega, zeta + DIFFERENCE_STEP, amplitude)
        by_omega, by_zeta = (faster - here) / step, (damped - here) / DIFFERENCE_STEP
        changes -= np.array([[by_omega.real, by_zeta.real], [by_omega.imag, by_zeta.imag]])
    return np.linalg.inv(changes)


def _squared_by_others(
    frame: ModeFrame, f: np.ndarray, omega: float, zeta: float, amplitude: float
) -> complex:
    """What forces and the other modes add to the squared frequency [1/s^2]."""
    rest = _followed(frame, omega, zeta)
    return complex(rest.added + rest.reading @ f / amplitude)


def amplitude_derivative(
    frame: ModeFrame,
    state: ModeState,
    amplitude: float,
) -> np.ndarray:
    """(N,) derivative of the residual by the amplitude at given displacements."""
    rest = _followed(frame, state.omega, state.zeta)
    drive = -(rest.reading @ state.f[:, 1]) / amplitude**2
    direct = np.zeros((len(frame.shape), frame.H + 1), dtype=complex)
    direct[:, 1] = -rest.shape
    change = _of_drive(frame, state, amplitude) @ np.array([drive.real, drive.imag])
    return to_real(direct).ravel() + _frequency_columns(frame, state, amplitude) @ change


def _frequency_columns(frame: ModeFrame, state: ModeState, amplitude: float) -> np.ndarray:
    """(N, 2) derivatives of the residual by omega and zeta, by differences."""
    here = _moved(frame, state.f, state.omega, state.zeta, amplitude)
    step = DIFFERENCE_STEP * state.omega
    faster = _moved(frame, state.f, state.omega + step, state.zeta, amplitude)
    damped = _moved(frame, state.f, state.omega, state.zeta + DIFFERENCE_STEP, amplitude)
    columns = [
        to_real((faster - here) / step).ravel(),
        to_real((damped - here) / DIFFERENCE_STEP).ravel(),
    ]
    return np.column_stack(columns)


def _moved(
    frame: ModeFrame,
    f: np.ndarray,
    omega: float,
    zeta: float,
    amplitude: float,
) -> np.ndarray:
    """(m, H+1) moving displacements by forces, without the mode, less those with the mode."""
    rest = _followed(frame, omega, zeta)
    out = np.zeros_like(f)
    for h in range(1, frame.H + 1):
        out[:, h] = _flexibility(frame, h, omega, zeta) @ f[:, h]
    out[:, 1] -= rest.shape * amplitude
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


def nearest_mode(frame: ModeFrame, omega: float) -> tuple[int, int, float] | None:
    """Harmonic, number and relative distance of the blade's mode that a multiple of a frequency
    comes nearest to, the mode itself left out; None where there is no other.
    """
    found = []
    for h in range(1, frame.H + 1):
        own = frame.bodies[0].omega[_of(frame.bodies[0], h)]
        others = (own > 0) & ~((h == 1) & (np.arange(len(own)) == frame.mode))
        off = h * omega / own[others] - 1
        found += [(h, int(k), float(x)) for k, x in zip(np.flatnonzero(others), off, strict=True)]
    return min(found, key=lambda one: abs(one[2]), default=None)


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
        force = -(blades.shapes[s][blades.contact].conj().T @ state.f[:, h])
        if h == 1 and frame.coriolis is not None:
            force = force - 1j * state.omega * frame.coriolis[s][:, frame.mode] * amplitude
        modal = _inverse(frame, 0, h, state.omega, state.zeta) @ force
        if h == 1:
            modal[frame.mode] = amplitude
        residual = blades.residual[_of_residual(blades, h)][blades.probe, blades.contact]
        out[h] = blades.shapes[s][blades.probe] @ modal - residual @ state.f[:, h]
    return out
