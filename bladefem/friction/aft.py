"""Contact forces of all elements for periodic relative motion: harmonics, Jacobian, states and
dissipated energy.

Signs (data.py): w is blade minus damper in (normal, t1, t2); the blade feels -f. The normal force
is max(0, n0 + kn w_n), the tangential one a return map of kt w onto |f| <= mu times it, or what a
law of one's own says (`bladefem.friction.law`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from bladefem.data import Elements
from bladefem.errors import InputError
from bladefem.friction.coulomb_2d_plain import plain_batch
from bladefem.friction.fourier import harmonics_of
from bladefem.friction.kernel_1d import jenkins_batch
from bladefem.friction.law_table import forgets_position, groups_by_law, select_elements
from bladefem.friction.periodic_law import LawForces, periodic_forces
from bladefem.friction.simd.kernel_2d import disc_batch
from bladefem.friction.states import GROSS_SLIP, PARTIAL_SLIP, SEPARATED, STICK
from bladefem.friction.trigonometric_tables import derivative_patterns, trigonometric_tables
from bladefem.friction.walking_1d import walking_batch

PRECISIONS = {"double": np.float64, "single": np.float32}
PERIODIC = "periodic"


@dataclass(frozen=True)
class Motion:
    """Periodic relative motion of n elements in d = 1 + tangents directions, and the loads
    prescribed with it.
    """

    # (n, d, K) coefficients [mean, cos 1, sin 1, ...] [m]
    w: np.ndarray
    # (n, tangents) how far the tangential motion goes on in each period [m]
    walk: np.ndarray
    # (n, samples) prescribed part of the normal load [N]; (n, 0) where the constant n0 is it
    load: np.ndarray

    def of_elements(self, rows: np.ndarray) -> Motion:
        """The motion of some of the elements."""
        return Motion(self.w[rows], self.walk[rows], self.load[rows])


@dataclass(frozen=True)
class Sampling:
    """How the forces over a period are taken."""

    # instants of a period
    samples: int
    # with the derivatives of the forces by the motion
    jacobian: bool
    # most periods that are marched until a force is periodic
    cycles: int
    # in which the derivatives of 2-D elements are summed, a key of PRECISIONS
    precision: str
    # of 2-D elements, a key of KERNELS_2D
    kernel: str


def _vector_kernel(nodes: np.ndarray, motion: Motion, sampling: Sampling) -> LawForces:
    """Coulomb forces of 2-D elements with the table nodes (n, 4)."""
    n, d, K = motion.w.shape
    H = harmonics_of(motion.w)
    tab = trigonometric_tables(H, sampling.samples)
    rows = derivative_patterns(H, sampling.samples, PRECISIONS[sampling.precision])
    found = _empty_forces(n, d, K)
    J = np.empty((n, d, K, d * K) if sampling.jacobian else (n, 0, 0, 0))
    disc_batch(
        motion.w,
        motion.walk,
        motion.load,
        nodes,
        tab,
        rows,
        sampling.cycles,
        found.f,
        J,
        found.shares,
        found.cycles,
    )
    return replace(found, dfdw=J.reshape(n, d, K, d, K)) if sampling.jacobian else found


def _plain_kernel(nodes: np.ndarray, motion: Motion, sampling: Sampling) -> LawForces:
    """Coulomb forces of 2-D elements with the table nodes (n, 4), by the plain kernel."""
    n, d, K = motion.w.shape
    tab = trigonometric_tables(harmonics_of(motion.w), sampling.samples)
    found = _empty_forces(n, d, K)
    J = np.empty((n, d, K, d * K))
    plain_batch(
        motion.w,
        motion.walk,
        motion.load,
        nodes,
        tab,
        sampling.cycles,
        found.f,
        J,
        found.shares,
        found.cycles,
    )
    return replace(found, dfdw=J.reshape(n, d, K, d, K)) if sampling.jacobian else found


def _line_kernel(nodes: np.ndarray, motion: Motion, sampling: Sampling) -> LawForces:
    """Coulomb forces of 1-D elements with the table nodes (n, 4)."""
    n, d, K = motion.w.shape
    tab = trigonometric_tables(harmonics_of(motion.w), sampling.samples)
    found = _empty_forces(n, d, K)
    J = np.empty((n, d, K, d, K))
    if np.any(motion.walk):
        walking_batch(
            motion.w,
            np.ascontiguousarray(motion.walk[:, 0]),
            motion.load,
            nodes,
            tab,
            sampling.cycles,
            sampling.jacobian,
            found.f,
            J,
            found.shares,
            found.cycles,
        )
    else:
        jenkins_batch(motion.w, motion.load, nodes, tab, found.f, J, found.shares)
    return replace(found, dfdw=J) if sampling.jacobian else found


def _empty_forces(n: int, d: int, K: int) -> LawForces:
    """For kernels to fill; two periods where a kernel marches none."""
    return LawForces(np.empty((n, d, K)), None, np.empty((n, 3)), np.full(n, 2))


# of 2-D elements
KERNELS_2D = {"vector": _vector_kernel, "plain": _plain_kernel}


@dataclass(frozen=True)
class Forces:
    """Contact forces of n nodes with d = 1 + tangents directions; K = 2H+1 coefficients [mean, cos
    1, sin 1, ...].
    """

    # (n, d, K) [N]
    f: np.ndarray
    # (n, d, K, d, K) [N/m]
    dfdw: np.ndarray | None
    # (n, 3) share of the cycle in stick, slip and separation [1]
    shares: np.ndarray
    # (n,) energy a cycle [J]
    dissipated: np.ndarray
    # (n,) periods marched until the force was periodic
    cycles: np.ndarray
    converged: bool
    reason: str

    @property
    def state(self) -> np.ndarray:
        """(n,) SEPARATED, STICK, PARTIAL_SLIP (at most half of the contact time) or GROSS_SLIP."""
        return contact_states(self.shares)

    @property
    def jacobian(self) -> np.ndarray:
        """``dfdw`` of forces that were evaluated with it."""
        if self.dfdw is None:
            raise RuntimeError("the contact forces were evaluated without their Jacobian")
        return self.dfdw


def evaluate(
    elements: Elements,
    w: np.ndarray,
    samples: int,
    jacobian: bool = True,
    *,
    load: np.ndarray | None = None,
    cycles: int = 4000,
    precision: str = "double",
    kernel: str = "vector",
    walk: np.ndarray | None = None,
) -> Forces:
    """Harmonics of the contact forces, sampled; the error falls as samples^-2.

    ``Forces.converged`` is False, with the reason, when a 2-D element was not periodic after
    ``cycles`` periods or the motion is not finite.

    Args:
        w: (n, d, 2H+1) coefficients of the relative motion [m].
        samples: instants of a period at which the forces are taken.
        load: (n, samples) prescribed part of the normal load N(t) [N] in place of the constant n0.
        precision: that in which the derivative of 2-D elements is summed: "single" is faster and
            leaves about 1e-7 of it in error, which is enough for Newton; forces are the same.
        kernel: that of 2-D elements: "vector", or "plain", the readable definition of it, some 50
            times as slow and always in double precision.
        walk: (n, tangents) how far the tangential motion goes on in each period [m]; the mean
            displacement that way then has no influence.

    Raises:
        InputError: shapes that do not fit, or too few samples (at least 4H+4).
    """
    w, nodes = check_motion(elements, w)
    if precision not in PRECISIONS:
        raise InputError(f"precision {precision!r}: expected one of {', '.join(PRECISIONS)}")
    if kernel not in KERNELS_2D:
        raise InputError(f"kernel {kernel!r}: expected one of {', '.join(KERNELS_2D)}")
    prescribed = _prescribed_load(load, len(w), samples)
    motion = Motion(w, _checked_walk(elements, walk), prescribed)
    sampling = Sampling(samples, jacobian, cycles, precision, kernel)
    if elements.law is None:
        found = _coulomb_forces(nodes, motion, sampling)
    else:
        found = _forces_by_law(elements, motion, sampling)
    reason = convergence_reason(found.f, found.cycles, f"were not periodic after {cycles} cycles")
    return Forces(
        found.f,
        found.dfdw,
        found.shares,
        dissipated_energy(found.f, w) + np.sum(found.f[:, 1:, 0] * motion.walk, axis=1),
        np.abs(found.cycles),
        reason == PERIODIC,
        reason,
    )


def _coulomb_forces(nodes: np.ndarray, motion: Motion, sampling: Sampling) -> LawForces:
    """Forces of Coulomb elements with the table nodes (n, 4), by the kernel of their directions."""
    kernel = _line_kernel if motion.w.shape[1] == 2 else KERNELS_2D[sampling.kernel]
    return kernel(nodes, motion, sampling)


def _checked_walk(elements: Elements, walk: np.ndarray | None) -> np.ndarray:
    """(n, tangents) the motion that goes on in each period, zeros for none."""
    shape = (len(np.atleast_1d(elements.kt)), elements.tangents)
    if walk is None:
        return np.zeros(shape)
    if not forgets_position(elements) and np.any(walk):
        raise InputError("walk: expected friction laws whose force does not depend on the position")
    if np.shape(walk) != shape or not np.all(np.isfinite(walk)):
        raise InputError(
            f"walk: expected {shape} finite displacements a period, one row an element"
        )
    return np.ascontiguousarray(walk, dtype=float)


def _forces_by_law(elements: Elements, motion: Motion, sampling: Sampling) -> LawForces:
    """Forces of elements of several laws, law after law; Coulomb's by its kernels."""
    n, d, K = motion.w.shape
    # raises where the samples are too few
    trigonometric_tables(harmonics_of(motion.w), sampling.samples)
    dfdw = np.empty((n, d, K, d, K)) if sampling.jacobian else None
    found = replace(_empty_forces(n, d, K), dfdw=dfdw)
    for law, rows in groups_by_law(elements):
        some = replace(select_elements(elements, rows), law=None)
        own = motion.of_elements(rows)
        if law is None:
            part = _coulomb_forces(some.table, own, sampling)
        else:
            part = periodic_forces(
                law,
                some,
                own.w,
                sampling.samples,
                load=own.load if own.load.shape[1] else None,
                jacobian=sampling.jacobian,
                cycles=sampling.cycles,
                walk=own.walk,
            )
        found.f[rows] = part.f
        found.shares[rows] = part.shares
        found.cycles[rows] = part.cycles
        if dfdw is not None:
            dfdw[rows] = part.dfdw
    return found


def convergence_reason(
    f: np.ndarray,
    used: np.ndarray,
    failure: str,
) -> str:
    """PERIODIC, or the failure of the elements with used < 0, or that forces f are not finite."""
    failed = int(np.count_nonzero(used < 0))
    if failed:
        return f"{failed} of {len(used)} elements {failure}"
    return (
        PERIODIC if np.isfinite(f).all() else "the motion or the force of an element is not finite"
    )


def dissipated_energy(f: np.ndarray, w: np.ndarray) -> np.ndarray:
    """(n,) work of the tangential forces f (n, d, K) on w (n, d, K) in one cycle [J], exact for
    these harmonics.
    """
    h = np.arange(1, f.shape[2] // 2 + 1)
    c = f[:, 1:, 1::2]
    s = f[:, 1:, 2::2]
    return np.pi * np.einsum("ndh,h->n", c * w[:, 1:, 2::2] - s * w[:, 1:, 1::2], h)


def contact_states(shares: np.ndarray) -> np.ndarray:
    """(n,) state codes from the shares (n, 3) of stick, slip and separation."""
    stick = shares[:, 0]
    slip = shares[:, 1]
    code = np.where(
        slip > 0.5 * (stick + slip), GROSS_SLIP, np.where(slip > 0, PARTIAL_SLIP, STICK)
    )
    return np.where(stick + slip > 1e-12, code, SEPARATED)


def check_motion(elements: Elements, w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """w (n, d, K) and the table (n, 4) of kt, kn, mu, n0, which fit each other; raises InputError
    where they do not.
    """
    w = np.ascontiguousarray(w, dtype=float)
    n = np.size(elements.kt)
    d = 1 + elements.tangents
    if d not in (2, 3):
        raise InputError(f"elements: tangents is {elements.tangents}, expected 1 or 2")
    if w.ndim != 3 or w.shape[:2] != (n, d):
        raise InputError(
            f"w: shape {w.shape} does not fit {n} elements of {d} directions, expected ({n}, {d}, "
            "2H+1)"
        )
    return w, elements.table


def _prescribed_load(
    load: np.ndarray | None,
    n: int,
    samples: int,
) -> np.ndarray:
    """(n, samples) prescribed loads, or (n, 0) for none."""
    if load is None:
        return np.zeros((n, 0))
    if np.shape(load) != (n, samples):
        raise InputError(
            f"load: shape {np.shape(load)}, expected ({n}, {samples}), one row an element"
        )
    return finite_load(load)


def finite_load(load: np.ndarray) -> np.ndarray:
    """A prescribed load; raises InputError where it is not finite."""
    load = np.ascontiguousarray(load, dtype=float)
    if not np.isfinite(load).all():
        raise InputError("load: contains values that are not finite")
    return load
