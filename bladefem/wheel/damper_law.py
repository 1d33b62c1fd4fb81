"""What one damper does to its two blades, as a table: the cheap level of statistics.

Where one family of blade modes vibrates, the motion of a damper's contacts is a sum of its two
blades' amplitudes, w = alpha a_s + beta a_{s+1}, less what all other modes, the residual
flexibility and the damper give way to the contact forces. This small balance of one harmonic is
solved once for all pairs of amplitudes; since a shift of time changes nothing, these are three
numbers: the size of both, their ratio and the phase between them. Shapes and flexibility are those
of the tuned wheel in the nodal diameter of the engine order, so that the tuned wheel comes out
again.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage

from ..data import Elements, PortModel, RigidBody
from ..errors import InputError, NotSolvedError
from ..friction.aft import evaluate
from ..friction.law_table import select_elements
from ..reduction.assemble import folded_diameter
from ..util.arrays import ComplexArray, RealArray, RealOrComplex
from .law_kernel import GHOST_POINTS, evaluate_law
from .model import Pattern, Wheel
from .tuned import travelling_order

# of the table: sizes, ratios and phases of the two amplitudes
TABLE_SIZES, TABLE_RATIOS, TABLE_PHASES = 32, 13, 20
# Newton steps of one size, and the relative residual at its end
MAX_NEWTON_STEPS = 40
RESIDUAL_TOLERANCE = 1e-7
# share of the pairs that may stay unsolved
MAX_UNSOLVED_SHARE = 0.02
# halvings of a step
MAX_HALVINGS = 8
# real unknowns of the small balance
MOST_UNKNOWNS = 240


@dataclass(frozen=True)
class Family:
    """One family of modes of the tuned wheel, in coordinates a of the blade readings; N sectors."""

    # (N,) nodal diameters 0..N-1: circular frequency [rad/s], viscous damping [1/s], loss term
    # [1/s^2], reading of the mode and its shape at the probe over that reading
    omega: RealArray
    viscous: RealOrComplex
    hysteretic: RealArray
    reading: RealArray
    probe: ComplexArray
    # (N,) modal force of the first harmonic by diameter, over the reading
    force: ComplexArray
    # (m,) motion of the contacts of a damper by the blade before it and the one after it
    before: RealArray
    after: RealArray
    # (m, m) flexibility of everything else at the contacts [m/N]
    flexibility: ComplexArray
    # (q,) readings of the blade over the one that is followed, in the order's diameter
    readings: RealOrComplex
    # (q, q) what all other modes and the residual flexibility read for forces on the readings, at
    # the frequency of `flexibility`, without contacts
    reading_flexibility: ComplexArray
    # circular frequency of both [rad/s]
    at: float


@dataclass(frozen=True)
class DamperLaw:
    """Forces on the two blades for their amplitudes, as splines over log size, ratio and phase."""

    # (4, TABLE_SIZES, TABLE_RATIOS + 2 GHOST_POINTS, TABLE_PHASES) coefficients: force on the blade
    # before the damper, real and imaginary, then on the one after, over the size
    coefficients: RealArray
    # logarithm of the smallest size, and of one step
    first: float
    step: float

    def forces(self, before: np.ndarray, after: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Forces (2, k) complex on both blades, and their derivatives (k, 4, 4) by the real and
        imaginary parts of both amplitudes (k,).
        """
        out = np.empty((len(before), 4))
        derivative = np.empty((len(before), 4, 4))
        evaluate_law(self.coefficients, self.first, self.step, before, after, out, derivative)
        return (out[:, 0::2] + 1j * out[:, 1::2]).T, derivative


def family_of_modes(wheel: Wheel, omega: float, mode: int = 0) -> Family:
    """The family of one mode of the order's nodal diameter: in all others the mode whose blade
    moves most alike.

    Args:
        omega: circular frequency at which everything else gives way [rad/s].
        mode: number of the mode, from 0.

    Raises:
        InputError: the forces are no travelling wave of one harmonic, or the blades have no
            readings.
    """
    order = travelling_order(wheel)
    if order is None or set(wheel.excitation) != {1}:
        raise InputError(
            "damper law: expected one engine order, statistics of other forces take the whole wheel"
        )
    count = wheel.count
    own, _ = folded_diameter(1, order, count)
    pattern = _blade_shapes(wheel.sectors[own])[:, mode]
    ports = wheel.sectors[own].ports
    readings = wheel.sectors[own].shapes[ports["blade"], mode] if "blade" in ports else np.zeros(0)
    if not len(readings):
        raise InputError("damper law: expected the port 'blade' in the wheel's sectors")
    read = int(np.argmax(abs(readings)))
    rows = []
    for d in range(count):
        body, mirrored = wheel.wave(d)
        rows.append(_mode_of(wheel, body, pattern, read, mirrored))
    values = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    force = np.fft.fft(wheel.excitation[1], axis=0)
    theta = 2 * np.pi * np.arange(count) / count
    before, after = _blade_motions(values["contact"], theta, order)
    body, mirrored = wheel.wave(order)
    left_out = int(values["number"][order])
    G = _everything_else(wheel, body, left_out, omega, mirrored)
    return Family(
        values["omega"],
        values["viscous"],
        values["hysteretic"],
        values["reading"],
        values["probe"],
        (values["load"].conj() * force).sum(axis=1),
        before,
        after,
        G,
        (readings.conj() if mirrored else readings) / abs(readings[read]),
        _other_modes(wheel, body, ports["blade"], left_out, omega, mirrored),
        omega,
    )


def _blade_shapes(body: PortModel) -> np.ndarray:
    """(rows, modes) shapes at the blade's readings and at the probe, each mode of length 1."""
    rows = [body.shapes[body.ports[name]] for name in ("blade", "probe") if name in body.ports]
    shapes = np.concatenate(rows)
    return shapes / np.maximum(np.linalg.norm(shapes, axis=0), np.finfo(float).tiny)


def _mode_of(
    wheel: Wheel,
    body: PortModel,
    pattern: np.ndarray,
    read: int,
    mirrored: bool,
) -> dict[str, np.ndarray]:
    """The mode of one diameter that moves the blade like a pattern, its shapes over one reading."""
    everything = np.arange(len(body.residual))
    blade = everything[body.ports["blade"]]
    number = int(np.argmax(abs(pattern.conj() @ _blade_shapes(body))))
    shape = body.shapes[:, number].conj() if mirrored else body.shapes[:, number]
    shape = shape / shape[blade[read]]
    viscous = np.broadcast_to(wheel.damping.viscous(body.omega), body.omega.shape)[number]
    if body.damping is not None:
        viscous = viscous + _own_damping(body, mirrored)[number]
    omega = body.omega[number]
    return {
        "number": np.array(number),
        "omega": np.array(omega),
        "viscous": np.array(viscous),
        "hysteretic": np.array(wheel.damping.structural * omega**2),
        "reading": np.array(abs(body.shapes[blade[read], number])),
        "contact": shape[everything[body.ports["contact"]][wheel.rows]],
        "load": shape[everything[body.ports["load"]]],
        "probe": np.array(shape[everything[body.ports["probe"]][0]]),
    }


def _own_damping(body: PortModel, mirrored: bool) -> np.ndarray:
    """(m,) damping of each mode by itself [1/s]; imaginary where Coriolis forces move its wave."""
    if body.damping is None:
        return np.zeros(len(body.omega))
    own = body.damping if body.damping.ndim == 1 else np.diag(body.damping)
    return own.conj() if mirrored else own


def _blade_motions(
    contact: np.ndarray,
    theta: np.ndarray,
    order: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Real alpha and beta (m,) with contact = alpha + beta e^{i theta}: exact at the order's
    diameter where that is not 0 or N/2, in the least squares with its neighbours there.
    """
    count = len(theta)
    near = [order] if 0 < 2 * order % count else [order - 1, order, order + 1]
    system = []
    right = []
    for d in near:
        turn = np.exp(1j * theta[d % count])
        system += [[1.0, turn.real], [0.0, turn.imag]]
        right += [contact[d % count].real, contact[d % count].imag]
    found, _, _, _ = np.linalg.lstsq(np.array(system), np.array(right), rcond=None)
    return found[0], found[1]


def _everything_else(
    wheel: Wheel,
    body: PortModel,
    left_out: int,
    omega: float,
    mirrored: bool,
) -> np.ndarray:
    """(m, m) flexibility at the contacts of all modes but one, and of the damper [m/N]."""
    rows = np.arange(len(body.residual))[body.ports["contact"]][wheel.rows]
    G = _other_modes(wheel, body, rows, left_out, omega, mirrored)
    damper = wheel.damper
    if isinstance(damper, RigidBody):
        B = damper.B[wheel.rows]
        return G - B @ np.linalg.solve(damper.mass, B.T) / omega**2
    if damper is not None:
        own = np.arange(len(damper.residual))[damper.ports["contact"]][wheel.rows]
        law = wheel.damper_damping.viscous(damper.omega)
        Z = damper.omega**2 - omega**2 + 1j * omega * law
        shapes = damper.shapes[own]
        return G + (shapes / Z) @ shapes.conj().T + damper.residual[np.ix_(own, own)]
    return G


def _other_modes(
    wheel: Wheel,
    body: PortModel,
    rows: slice | np.ndarray,
    left_out: int,
    omega: float,
    mirrored: bool,
) -> np.ndarray:
    """(m, m) flexibility of all modes but one, without damper, at some rows of the ports [m/N]."""
    own = wheel.damping.viscous(body.omega) + _own_damping(body, mirrored)
    Z = body.omega**2 - omega**2 + 1j * omega * own
    others = np.arange(len(Z)) != left_out
    shapes = body.shapes[rows][:, others]
    residual = body.residual[rows][:, rows]
    if mirrored:
        # the conjugate wave, in time as before
        shapes, residual = shapes.conj(), residual.conj()
    return (shapes / Z[others]) @ shapes.conj().T + residual


def damper_law(
    wheel: Wheel,
    family: Family,
    sizes: tuple[float, float],
    samples: int,
    elements: Elements | None = None,
) -> DamperLaw:
    """The table of one damper.

    Args:
        sizes: smallest and largest root of the sum of squares of the two amplitudes.
        elements: of the damper; those of the wheel when left out.

    Raises:
        InputError: too many contact nodes.
        NotSolvedError: the small balance has no solution somewhere.
    """
    if 2 * len(family.before) > MOST_UNKNOWNS:
        raise InputError(
            f"damper law: {2 * len(family.before)} unknowns, expected at most {MOST_UNKNOWNS}: "
            "fewer contact points (contact.points)"
        )
    e = select_elements(elements or wheel.elements, np.arange(wheel.nodes))
    log_size = np.log(np.geomspace(sizes[0], sizes[1], TABLE_SIZES))
    ratio = np.linspace(0, np.pi / 2, TABLE_RATIOS)
    phase = 2 * np.pi * np.arange(TABLE_PHASES) / TABLE_PHASES
    first, second = np.meshgrid(ratio, phase, indexing="ij")
    a1 = np.cos(first).ravel().astype(complex)
    a2 = (np.sin(first) * np.exp(1j * second)).ravel()
    imposed = np.outer(a1, family.before) + np.outer(a2, family.after)
    table = np.empty((4, TABLE_SIZES, TABLE_RATIOS, TABLE_PHASES))
    stuck = _stuck_motion(wheel, family, imposed)
    motion = stuck
    for i, size in enumerate(np.exp(log_size)):
        motion, force = _one_size(wheel, e, family, size, imposed, (motion, stuck), samples)
        pair = np.array([force @ family.before, force @ family.after])
        parts = [pair[0].real, pair[0].imag, pair[1].real, pair[1].imag]
        table[:, i] = np.array(parts).reshape(4, TABLE_RATIOS, TABLE_PHASES)
    return DamperLaw(_spline(table), float(log_size[0]), float(log_size[1] - log_size[0]))


def _one_size(
    wheel: Wheel,
    e: Elements,
    family: Family,
    size: float,
    imposed: np.ndarray,
    starts: tuple[np.ndarray, np.ndarray],
    samples: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Motions and forces (B, m) over the size, from the last size's motions, from full stick and
    from the neighbours' in phase; the few that stay unsolved take the mean of these.

    Raises:
        NotSolvedError: more than a few have no solution.
    """
    w, force, error = _small_balance(wheel, e, family, size * imposed, size * starts[0], samples)
    for attempt in range(3):
        lost = np.flatnonzero(error > RESIDUAL_TOLERANCE)
        if not len(lost):
            break
        begin = size * starts[1] if attempt == 0 else _next_in_phase(w, (1, -1)[attempt - 1])
        again, forces, errors = _small_balance(
            wheel, e, family, size * imposed[lost], begin[lost], samples
        )
        better = errors <= RESIDUAL_TOLERANCE
        w[lost[better]] = again[better]
        force[lost[better]] = forces[better]
        error[lost[better]] = errors[better]
    lost = np.flatnonzero(error > RESIDUAL_TOLERANCE)
    if len(lost) > MAX_UNSOLVED_SHARE * len(w):
        raise NotSolvedError(
            f"damper law: no solution for {len(lost)} of {len(w)} pairs of amplitudes, the best "
            f"with residual {error[lost].min():.1e}"
        )
    for values in (w, force):
        mean = 0.5 * (_next_in_phase(values, 1) + _next_in_phase(values, -1))
        values[lost] = mean[lost]
    return w / size, force / size


def _next_in_phase(values: np.ndarray, shift: int) -> np.ndarray:
    """(B, m) values of the neighbour in phase."""
    whole = values.reshape(TABLE_RATIOS, TABLE_PHASES, -1)
    return np.roll(whole, shift, axis=1).reshape(values.shape)


def _spline(table: np.ndarray) -> np.ndarray:
    """Coefficients of cubic splines; ratios continue beyond their ends by symmetry.

    A negative ratio is the second amplitude with the opposite sign; beyond a right angle the first
    one has it, which is both forces and the phase turned by half a period.
    """
    half = np.roll(table, TABLE_PHASES // 2, axis=3)
    low = half[:, :, GHOST_POINTS:0:-1]
    high = -half[:, :, -2 : -2 - GHOST_POINTS : -1]
    whole = np.concatenate([low, table, high], axis=2)
    whole = ndimage.spline_filter1d(whole, 3, axis=1, mode="mirror")
    whole = ndimage.spline_filter1d(whole, 3, axis=2, mode="mirror")
    return np.ascontiguousarray(ndimage.spline_filter1d(whole, 3, axis=3, mode="grid-wrap"))


def _stuck_motion(
    wheel: Wheel,
    family: Family,
    imposed: np.ndarray,
) -> np.ndarray:
    """(B, m) motions with all contacts sticking."""
    springs = wheel.springs.ravel()
    return np.linalg.solve(np.eye(len(springs)) + family.flexibility * springs, imposed.T).T


def _small_balance(
    wheel: Wheel,
    e: Elements,
    family: Family,
    imposed: np.ndarray,
    start: np.ndarray,
    samples: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Motions and forces (B, m) of  w - imposed + G f(w) = 0, all pairs of amplitudes at once, and
    the residual of each over the size of what is imposed.
    """
    turned = _real_map(family.flexibility)
    size = np.linalg.norm(imposed, axis=1)
    w = start.copy()
    force, change = _contact(wheel, e, w, samples)
    error = np.linalg.norm(w - imposed + force @ family.flexibility.T, axis=1) / size
    for _ in range(MAX_NEWTON_STEPS):
        open_pairs = np.flatnonzero(error > RESIDUAL_TOLERANCE)
        if not len(open_pairs):
            break
        now = w[open_pairs]
        r = now - imposed[open_pairs] + force[open_pairs] @ family.flexibility.T
        step = _newton_steps(turned, change[open_pairs], r)
        share = np.ones(len(open_pairs))
        for _ in range(MAX_HALVINGS):
            trial = now - share[:, None] * step
            forces, changes = _contact(wheel, e, trial, samples)
            r = trial - imposed[open_pairs] + forces @ family.flexibility.T
            errors = np.linalg.norm(r, axis=1) / size[open_pairs]
            worse = errors > error[open_pairs]
            if not worse.any():
                break
            share = np.where(worse, 0.5 * share, share)
        w[open_pairs], force[open_pairs], change[open_pairs] = trial, forces, changes
        error[open_pairs] = errors
    return w, force, error


def _newton_steps(
    turned: np.ndarray,
    change: np.ndarray,
    r: np.ndarray,
) -> np.ndarray:
    """(B, m) Newton steps for residuals r, by dense real matrices.

    Args:
        turned: (2m, 2m) the flexibility as a real map.
        change: (B, n, 2d, 2d) derivatives of the forces at the nodes.
    """
    total, nodes, width, _ = change.shape
    split = turned.reshape(-1, nodes, width)
    J = np.einsum("inc,bnck->bink", split, change).reshape(total, len(turned), -1)
    J[:, np.arange(len(turned)), np.arange(len(turned))] += 1.0
    right = np.stack([r.real, -r.imag], axis=2).reshape(total, -1, 1)
    x = np.linalg.solve(J, right).reshape(total, -1, 2)
    return x[..., 0] - 1j * x[..., 1]


def _contact(
    wheel: Wheel,
    e: Elements,
    w: np.ndarray,
    samples: int,
) -> tuple[np.ndarray, np.ndarray]:
    """First harmonics of the forces (B, m) of a damper, and derivatives (B, n, 2d, 2d) by cosine
    and sine.
    """
    total, m = w.shape
    n, d = wheel.nodes, wheel.directions
    many = select_elements(e, np.tile(np.arange(n), total))
    missing = 1 + many.tangents - d
    flat = np.zeros((total * n, missing + d, 3))
    whole = wheel.all_elements
    offset = wheel.offset(whole, wheel.first_forces(Pattern(), whole))
    flat[:, missing:, 0] = np.tile(offset[0], (total, 1))
    flat[:, missing:, 1] = w.real.reshape(-1, d)
    flat[:, missing:, 2] = -w.imag.reshape(-1, d)
    found = evaluate(many, flat, samples, True, precision="single")
    f = found.f[:, missing:].reshape(total, m, 3)
    change = found.jacobian[:, missing:, 1:, missing:, 1:].reshape(total, n, 2 * d, 2 * d)
    return f[:, :, 1] - 1j * f[:, :, 2], change


def _real_map(G: np.ndarray) -> np.ndarray:
    """(2m, 2m) a complex map on interleaved cosines and sines, q = c - i s."""
    out = np.empty((len(G), 2, len(G), 2))
    out[:, 0, :, 0] = G.real
    out[:, 0, :, 1] = G.imag
    out[:, 1, :, 0] = -G.imag
    out[:, 1, :, 1] = G.real
    return out.reshape(2 * len(G), -1)


def scaled_elements(wheel: Wheel, name: str, factor: float) -> Elements:
    """Elements of one damper with another friction coefficient, stiffness or normal load."""
    e = wheel.elements
    if name == "friction":
        return replace(e, mu=factor * e.mu)
    if name == "stiffness":
        kt, kn = (wheel.scaled_stiffness(name, factor)[: len(e.kt)] for name in ("kt", "kn"))
        return replace(e, kt=kt, kn=kn)
    return replace(e, n0=factor * e.n0, t0=None if e.t0 is None else factor * e.t0)
