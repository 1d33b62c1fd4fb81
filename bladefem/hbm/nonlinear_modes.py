"""Nonlinear modes of blade and damper: frequency and damping against amplitude.

Extended periodic motion (Krack 2015, doi:10.1016/j.compstruc.2015.03.008): a free motion is made
periodic by an artificial negative damping -2 zeta omega M. With the amplitude a of one blade mode
given, its own equation tells both unknowns,

    omega^2 = omega_r^2 + Re(phi_r^H f_1) / a,      2 zeta omega^2 = Im(phi_r^H f_1) / a,

and all other modes answer the contact forces through a flexibility without that mode, which is
regular at the resonance: w_1 = phi_r a - G' f_1. zeta is the damping of friction alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import linalg

from ..errors import InputError
from ..friction.fourier import to_complex, to_real
from ..util.newton import halve_step, iterate_newton
from .linear.bodies import Stack
from .linear.condensation import condense
from .linear.contact_flexibility import flexibility_of_mean
from .linear.woodbury import bodies_of
from .model import ReducedModel
from .solver.residual import contact_forces
from .validate_model import check_point

# Newton steps of one amplitude
MAX_NEWTON_STEPS = 40
# step of the amplitude after one that fails, over that one
STEP_REDUCTION = 0.25
# step in the logarithm of the amplitude below which the branch is given up
SHORTEST_STEP = 1e-3
# extrapolation from two motions, over the step between them
FARTHEST_PREDICTION = 2.0
# step share below which the search direction is given up
SHORTEST_STEP_SHARE = 2.0**-10
# relative step of frequency and damping in differences of the flexibility
DIFFERENCE_STEP = 1e-7
# residual of the motion, relative to its size
RESIDUAL_TOLERANCE = 1e-10
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


def nonlinear_mode(
    model: ReducedModel,
    amplitudes: Sequence[float],
    mode: int = 0,
    H: int = 3,
    samples: int = 128,
) -> Iterator[NonlinearMode]:
    """Frequency and damping of one mode at growing amplitudes, each started from those before and
    the first from the linear mode with all contacts sticking that holds most of the blade mode.

    Steps of the amplitude shorten where Newton fails; a motion that is not found says how far the
    branch was followed.

    Args:
        model: its excitation and its damping are left out of account.
        amplitudes: of the blade mode's first harmonic [m kg^1/2], above zero.
        mode: number of the blade mode in the nodal diameter of harmonic 1, from 0.

    Raises:
        InputError: amplitudes, mode, H or samples are out of range, or there are too many unknowns.
    """
    own = model.side(1).omega
    if not 0 <= mode < len(own) or not own[mode] > 0:
        raise InputError(f"mode {mode}: expected an elastic mode from 0 to {len(own) - 1}")
    check_point(model, float(own[mode]), max(H, *model.excitation, *model.normal), samples)
    unknowns = model.springs.size * (2 * H + 1)
    if unknowns > MAX_DENSE_UNKNOWNS:
        raise InputError(
            f"{unknowns} unknowns: expected at most {MAX_DENSE_UNKNOWNS}, fewer harmonics or nodes"
        )
    frame = _frame(model, mode, H, samples)
    track = _Track()
    for amplitude in amplitudes:
        if not 0 < amplitude < np.inf:
            raise InputError(f"amplitude {amplitude}: expected a positive number")
        found, track = _followed(frame, float(amplitude), track)
        yield found


def force_at_resonance(model: ReducedModel, point: NonlinearMode) -> float:
    """Size of the modal force that keeps this motion up at its resonance, damping of the bodies
    included [N kg^-1/2].
    """
    blades = model.blades(1)
    own = blades.viscous[-1][point.mode] + blades.hysteretic[-1][point.mode] / point.omega
    return float((2 * point.zeta * point.omega + own) * point.omega * point.amplitude)


def mode_response(
    model: ReducedModel,
    points: Sequence[NonlinearMode],
    omegas: np.ndarray,
) -> np.ndarray:
    """(k, points) drive over the modal force at circular frequencies: 1 where that amplitude
    answers the model's excitation.

    The single nonlinear mode's equation |omega_n^2 - Omega^2 + 2i zeta omega_n Omega| a = |phi^H
    F|; the forced response is the contour 1.
    """
    blades = model.blades(1)
    force = blades.shapes[-1, blades.load].conj().T @ model.loads(1)[1]
    found = np.empty((len(omegas), len(points)))
    for i, p in enumerate(points):
        own = blades.viscous[-1][p.mode] * omegas + blades.hysteretic[-1][p.mode]
        Z = p.omega**2 - omegas**2 + 1j * (2 * p.zeta * p.omega * omegas + own)
        found[:, i] = abs(Z) * p.amplitude / abs(force[p.mode])
    return found


@dataclass(frozen=True)
class _Frame:
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


@dataclass(frozen=True)
class _Track:
    """The end of the branch followed so far."""

    # converged motions, the last two at most, in the order they were found
    known: tuple[NonlinearMode, ...] = ()
    # no step from the last of them was short enough
    ended: bool = False


def _followed(
    frame: _Frame,
    amplitude: float,
    track: _Track,
) -> tuple[NonlinearMode, _Track]:
    """The motion at an amplitude, by steps from the last one known that shorten where Newton fails
    and lengthen where it converges; else from full stick.
    """
    first = _solve(frame, amplitude, _predicted(frame, amplitude, track.known))
    if first.converged or not track.known:
        return first, _continued(track, first)
    if not track.ended:
        track = _stepped(frame, amplitude, track)
        if not track.ended:
            return track.known[-1], track
    stuck = _solve(frame, amplitude, _predicted(frame, amplitude, ()))
    if stuck.converged:
        return stuck, _Track((stuck,))
    reached = track.known[-1].amplitude
    reason = f"not followed beyond an amplitude of {reached:.4g}: {first.reason}"
    return replace(first, reason=reason), track


def _stepped(
    frame: _Frame,
    amplitude: float,
    track: _Track,
) -> _Track:
    """The branch up to an amplitude, or to where the shortest step fails."""
    whole = np.log(amplitude / track.known[-1].amplitude)
    # shares of the way, in the logarithm of the amplitude
    done, step = 0.0, STEP_REDUCTION
    start = track.known[-1].amplitude
    while done < 1 and step * abs(whole) > SHORTEST_STEP:
        share = min(done + step, 1.0)
        near = amplitude if share == 1 else float(start * np.exp(share * whole))
        point = _solve(frame, near, _predicted(frame, near, track.known))
        if point.converged:
            track = _continued(track, point)
            done, step = share, 2 * step
        else:
            step *= STEP_REDUCTION
    return replace(track, ended=done < 1)


def _continued(track: _Track, point: NonlinearMode) -> _Track:
    if not point.converged:
        return track
    return _Track((*track.known[-1:], point))


def _solve(
    frame: _Frame,
    amplitude: float,
    start: np.ndarray,
) -> NonlinearMode:
    """Newton from displacements (n d (2H+1),)."""
    run = iterate_newton(
        _residual(frame, start, amplitude),
        lambda state: float(np.linalg.norm(state.r) / np.linalg.norm(state.w)),
        lambda state: _line_search(frame, state, amplitude),
        RESIDUAL_TOLERANCE,
        MAX_NEWTON_STEPS,
    )
    state = run.state
    return NonlinearMode(
        amplitude,
        frame.mode,
        state.omega,
        state.zeta,
        state.w,
        _probe(frame, state, amplitude),
        run.converged,
        run.reason,
        run.iterations,
        run.error,
    )


@dataclass(frozen=True)
class _State:
    """Displacements (n, d, K), forces beyond the preload (m, H+1), frequency, damping, residual."""

    w: np.ndarray
    f: np.ndarray
    dfdw: np.ndarray
    omega: float
    zeta: float
    r: np.ndarray


def _frame(
    model: ReducedModel,
    mode: int,
    H: int,
    samples: int,
) -> _Frame:
    bodies = bodies_of(model, H)
    if any(body.coupled is not None for body in bodies):
        raise InputError("damping that couples modes: expected modal damping for nonlinear modes")
    if model.circulatory:
        raise InputError("unsymmetric stiffness: expected a symmetric one for nonlinear modes")
    still = condense(_unloaded(model), float(model.side(1).omega[mode]), H)
    shape = model.blades(H).shapes[_of(model.blades(H), 1)][model.blades(H).contact][:, mode]
    mean = flexibility_of_mean(still.condensed.flex)
    return _Frame(model, mode, H, samples, bodies, shape, mean, still.stuck[0].real)


def _unloaded(model: ReducedModel) -> ReducedModel:
    """The model with its static forces alone."""
    load = np.zeros(len(model.loads(0)[0]))
    return replace(model, excitation={0: load} if model.coupled else {})


def _of(stack: Stack, h: int) -> int:
    """Row of a harmonic in a stack that may serve all of them."""
    return min(h, len(stack.omega) - 1)


def _flexibility(
    frame: _Frame,
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


def _residual(
    frame: _Frame,
    x: np.ndarray,
    amplitude: float,
) -> _State:
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
    return _State(w, f, forces.jacobian, omega, zeta, to_real(r).ravel())


def _frequency(
    frame: _Frame,
    f: np.ndarray,
    amplitude: float,
) -> tuple[float, float]:
    """Frequency [rad/s] and damping [1] that close the mode's own equation."""
    own = frame.bodies[0].omega[_of(frame.bodies[0], 1)][frame.mode] ** 2
    drive = frame.shape.conj() @ f / amplitude
    squared = max(own + drive.real, 0.01 * own)
    return float(np.sqrt(squared)), float(drive.imag / (2 * squared))


def _jacobian(
    frame: _Frame,
    state: _State,
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
    frame: _Frame,
    state: _State,
    amplitude: float,
) -> np.ndarray:
    """The part by omega and zeta: two columns of differences times the rows of phi^H df / a."""
    n, d, _K = state.w.shape
    first = state.dfdw[:, :, 1] - 1j * state.dfdw[:, :, 2]
    shape = frame.shape.conj().reshape(n, d, 1, 1)
    drive = (shape * first).sum(axis=1).ravel() / amplitude
    by_omega = drive.real / (2 * state.omega)
    by_zeta = drive.imag / (2 * state.omega**2) - state.zeta / state.omega**2 * drive.real
    here = _flexed(frame, state.f, state.omega, state.zeta)
    step = DIFFERENCE_STEP * state.omega
    faster = _flexed(frame, state.f, state.omega + step, state.zeta)
    damped = _flexed(frame, state.f, state.omega, state.zeta + DIFFERENCE_STEP)
    columns = [
        to_real((faster - here) / step).ravel(),
        to_real((damped - here) / DIFFERENCE_STEP).ravel(),
    ]
    return np.column_stack(columns) @ np.vstack([by_omega, by_zeta])


def _flexed(
    frame: _Frame,
    f: np.ndarray,
    omega: float,
    zeta: float,
) -> np.ndarray:
    """(m, H+1) moving displacements by forces, without the mode itself."""
    out = np.zeros_like(f)
    for h in range(1, frame.H + 1):
        out[:, h] = _flexibility(frame, h, omega, zeta) @ f[:, h]
    return out


def _line_search(
    frame: _Frame,
    state: _State,
    amplitude: float,
) -> _State | None:
    """The first halving of the Newton step that lowers the residual, or None."""
    step = linalg.solve(_jacobian(frame, state, amplitude), state.r, overwrite_a=True)
    x = state.w.ravel()
    before = np.linalg.norm(state.r)
    return halve_step(
        lambda share: _residual(frame, x - share * step, amplitude),
        lambda trial, share: bool(np.linalg.norm(trial.r) <= (1 - 1e-4 * share) * before),
        SHORTEST_STEP_SHARE,
    )


def _predicted(
    frame: _Frame,
    amplitude: float,
    known: tuple[NonlinearMode, ...],
) -> np.ndarray:
    """Displacements on the line through the motions known, each over its amplitude, against the
    logarithm of the amplitude; the stuck mode's without any.
    """
    if not known:
        n, d = frame.model.springs.shape
        motion = np.zeros((n * d, frame.H + 1), dtype=complex)
        motion[:, 1] = _stuck_mode(frame) * amplitude
        return to_real(motion).ravel()
    last = known[-1].w / known[-1].amplitude
    if len(known) > 1:
        before = known[-2].w / known[-2].amplitude
        span = np.log(known[-1].amplitude / known[-2].amplitude)
        share = np.log(amplitude / known[-1].amplitude) / span
        if 0 < share <= FARTHEST_PREDICTION:
            last = last + share * (last - before)
    return (amplitude * last).ravel()


def _stuck_mode(frame: _Frame) -> np.ndarray:
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


def _probe(
    frame: _Frame,
    state: _State,
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
