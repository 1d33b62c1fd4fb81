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


def _vector_kernel(w, ramp, load, nodes, samples, precision, cycles, jacobian, F, shares, used):
    """Fill forces, shares and cycles of 2-D elements; returns their Jacobian (n, d, K, d K)."""
    n, d, K = w.shape
    H = harmonics_of(w)
    J = np.empty((n, d, K, d * K) if jacobian else (n, 0, 0, 0))
    rows = derivative_patterns(H, samples, PRECISIONS[precision])
    tab = trigonometric_tables(H, samples)
    disc_batch(w, ramp, load, nodes, tab, rows, cycles, F, J, shares, used)
    return J


def _plain_kernel(w, ramp, load, nodes, samples, precision, cycles, jacobian, F, shares, used):
    """Fill forces, shares and cycles of 2-D elements by the plain kernel; returns their Jacobian
    (n, d, K, d K).
    """
    n, d, K = w.shape
    J = np.empty((n, d, K, d * K))
    tab = trigonometric_tables(harmonics_of(w), samples)
    plain_batch(w, ramp, load, nodes, tab, cycles, F, J, shares, used)
    return J


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
    n, d, K = w.shape
    if kernel not in KERNELS_2D:
        raise InputError(f"kernel {kernel!r}: expected one of {', '.join(KERNELS_2D)}")
    load = _prescribed_load(load, n, samples)
    ramp = _checked_walk(elements, walk)
    if elements.law is not None:
        return _evaluate_laws(elements, w, samples, jacobian, load, cycles, precision, kernel, ramp)
    tab = trigonometric_tables(harmonics_of(w), samples)
    F = np.empty((n, d, K))
    shares = np.empty((n, 3))
    used = np.full(n, 2)
    if d == 2:
        J = np.empty((n, d, K, d, K))
        if np.any(ramp):
            along = np.ascontiguousarray(ramp[:, 0])
            walking_batch(w, along, load, nodes, tab, cycles, jacobian, F, J, shares, used)
        else:
            jenkins_batch(w, load, nodes, tab, F, J, shares)
    else:
        J = KERNELS_2D[kernel](
            w, ramp, load, nodes, samples, precision, cycles, jacobian, F, shares, used
        )
    derivative = J.reshape(n, d, K, d, K) if jacobian else None
    return _forces_of(F, derivative, w, ramp, shares, used, cycles)


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


def _evaluate_laws(
    elements: Elements,
    w: np.ndarray,
    samples: int,
    jacobian: bool,
    load: np.ndarray,
    cycles: int,
    precision: str,
    kernel: str,
    ramp: np.ndarray,
) -> Forces:
    """Harmonics of the contact forces of elements of several laws, law after law; Coulomb's by its
    kernels.
    """
    n, d, K = w.shape
    # raises where the samples are too few
    trigonometric_tables(harmonics_of(w), samples)
    F = np.empty((n, d, K))
    J = np.empty((n, d, K, d, K)) if jacobian else None
    shares = np.empty((n, 3))
    used = np.full(n, 2)
    for law, rows in groups_by_law(elements):
        some = replace(select_elements(elements, rows), law=None)
        prescribed = load[rows] if load.shape[1] else None
        part: Forces | LawForces
        if law is None:
            part = evaluate(
                some,
                w[rows],
                samples,
                jacobian,
                load=prescribed,
                cycles=cycles,
                precision=precision,
                kernel=kernel,
                walk=ramp[rows],
            )
            used[rows] = part.cycles if part.converged else -part.cycles
        else:
            part = periodic_forces(
                law,
                some,
                w[rows],
                samples,
                load=prescribed,
                jacobian=jacobian,
                cycles=cycles,
                walk=ramp[rows],
            )
            used[rows] = part.cycles
        F[rows] = part.f
        shares[rows] = part.shares
        if J is not None:
            J[rows] = part.dfdw
    return _forces_of(F, J, w, ramp, shares, used, cycles)


def _forces_of(
    F: np.ndarray,
    J: np.ndarray | None,
    w: np.ndarray,
    ramp: np.ndarray,
    shares: np.ndarray,
    used: np.ndarray,
    cycles: int,
) -> Forces:
    """The result, with states, works and the reason from harmonics (n, d, K), shares of the period
    (n, 3) and periods (n,), below zero where the state was not periodic.
    """
    reason = convergence_reason(F, used, f"were not periodic after {cycles} cycles")
    return Forces(
        F,
        J,
        shares,
        dissipated_energy(F, w) + np.sum(F[:, 1:, 0] * ramp, axis=1),
        np.abs(used),
        reason == PERIODIC,
        reason,
    )


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
