"""Plain NumPy twins of the compiled linear part: condensation harmonic by harmonic with the whole
matrices, the dense Jacobian as matrix products, the error of a state, works by the modes of each
body.
"""

from dataclasses import dataclass

import numpy as np

from bladefem.data import RigidBody
from bladefem.friction.fourier import to_complex
from bladefem.hbm.linear.bodies import (
    modal_amplitudes,
    modal_flexibility,
    port_motion,
    receptance_block,
)
from bladefem.hbm.linear.mean_motion import motions_without_stiffness, with_springs
from bladefem.hbm.solution import Work, blade_motion


@dataclass
class PlainLinear:
    """As `bladefem.hbm.linear.condensation.Linear`."""

    springs: np.ndarray
    G: np.ndarray
    free: np.ndarray
    A: np.ndarray
    stuck: np.ndarray
    B: np.ndarray
    g: np.ndarray


def plain_condense(model, omega, H):
    """Flexibilities (H+1, m, m) without and with springs, motions (H+1, m) without contact forces
    and in full stick.
    """
    springs = model.springs.ravel()
    orders = omega * np.arange(H + 1)
    blades = model.blades(H)
    flexible = modal_flexibility(blades, orders)
    G = receptance_block(blades, flexible, blades.contact, blades.contact)
    force = np.zeros((H + 1, blades.shapes.shape[1]), dtype=complex)
    force[:, blades.load] = model.loads(H)
    free = port_motion(blades, modal_amplitudes(blades, flexible, force), force, blades.contact)
    if isinstance(model.damper, RigidBody):
        B = model.damper.B[model.rows]
        G[1:] -= (B @ np.linalg.solve(model.damper.mass, B.T)) / orders[1:, None, None] ** 2
    elif model.damper is not None:
        damper = model.elastic_damper(H)
        G += receptance_block(
            damper, modal_flexibility(damper, orders), damper.contact, damper.contact
        )
    B, g, _ = motions_without_stiffness(model)
    both = np.concatenate([G, free[:, :, None]], axis=2)
    solved = np.linalg.solve(G * springs + np.eye(len(springs)), both)
    A = solved[:, :, :-1].copy()
    stuck = solved[:, :, -1].copy()
    A[0], stuck[0] = with_springs(G[0].real, free[0].real, springs, B, g)
    if not model.coupled:
        for part in (G, free, A, stuck):
            part[0] = 0.0
        B = B[:, :0]
        g = g[:0]
    return PlainLinear(springs, G, free, A, stuck, B, g)


def plain_jacobian(A, change):
    """(a K, a K) real matrix of  p -> A p  times `change` (nodes, dK, dK), for a = nodes * d
    dofs.
    """
    nodes, size = change.shape[:2]
    H = A.shape[0] - 1
    a = A.shape[1]
    d = a // nodes
    K = 2 * H + 1
    # (K, nodes, d, dK)
    rows = change.reshape(nodes, d, K, size).transpose(2, 0, 1, 3)
    rows = np.concatenate([rows[:1].astype(complex), rows[1::2] - 1j * rows[2::2]])
    # (H+1, nodes, a, d)
    blocks = A.reshape(H + 1, a, nodes, d).transpose(0, 2, 1, 3)
    product = (blocks @ rows).transpose(0, 2, 1, 3).reshape(H + 1, a, nodes * size)
    J = np.empty((a, K, nodes * size))
    J[:, 0] = product[0].real
    J[:, 1::2] = product[1:].real.transpose(1, 0, 2)
    J[:, 2::2] = -product[1:].imag.transpose(1, 0, 2)
    return J.reshape(a * K, nodes * size)


def plain_error(linear, w, f, preload):
    """Residual (H+1, m) of the balance at w (m, K) under forces f (m, K), and its error in both
    forms.
    """
    motion = to_complex(w).T
    load = to_complex(f).T
    load[0] -= preload
    p = load - linear.springs * motion
    r = motion - linear.stuck + (linear.A @ p[:, :, None])[:, :, 0]
    with_springs = np.linalg.norm(r) / np.linalg.norm(motion)
    bare = r.copy()
    bare[1:] += (linear.G[1:] @ (linear.springs * r[1:])[:, :, None])[:, :, 0]
    scale = max(np.linalg.norm(linear.free), np.linalg.norm(linear.stuck))
    return r, max(with_springs, np.linalg.norm(bare) / scale)


def dissipated_work(
    stack,
    w,
    modal,
):
    """(k,) work lost in the modes in one cycle of each circular frequency [J]."""
    w = w[:, None]
    loss = np.sum((w * stack.viscous + np.sign(w) * stack.hysteretic) * abs(modal) ** 2, axis=1)
    if stack.coupled is not None:
        loss = (
            loss
            + w[:, 0]
            * np.sum(modal.conj() * (stack.coupled @ modal[:, :, None])[:, :, 0], axis=1).real
        )
    return np.pi * loss


def plain_works(model, omega, w, f, dissipated):
    """Works of a period for displacements and forces beyond the preload (n, d, K)."""
    force = to_complex(f.reshape(-1, f.shape[2])).T
    relative = to_complex(w.reshape(-1, w.shape[2])).T
    orders = np.arange(len(force))
    blades, ports, modal = blade_motion(model, omega, force)
    lost = orders @ dissipated_work(blades, omega * orders, modal)
    damper = model.elastic_damper(len(force) - 1)
    if damper is not None:
        at_ports = np.zeros((len(force), damper.shapes.shape[1]), dtype=complex)
        at_ports[:, damper.contact] = force
        moved = modal_amplitudes(damper, modal_flexibility(damper, omega * orders), at_ports)
        lost += orders @ dissipated_work(damper, omega * orders, moved)
    loaded = port_motion(blades, modal, ports, blades.load)

    def work(force, moved):
        return float(np.pi * np.sum(orders[:, None] * (force * (1j * moved).conj()).real))

    return Work(work(ports[:, blades.load], loaded), float(lost), work(force, relative), dissipated)
