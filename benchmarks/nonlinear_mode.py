"""Time of a nonlinear mode: a clamped beam on a joint of 100 contact nodes, 20 amplitudes from
sticking contacts to sliding ones.

    python benchmarks/nonlinear_mode.py [--harmonics 1 3] [--nodes 10]

The beam is steel, 200 x 40 x 10 mm, of eight-node bricks with incompatible modes (Wilson, Taylor
1973), clamped at one end; a square patch of its underside in the middle is pressed on rigid ground
by 2 MPa, with 40 N/mm^3 of tangential and normal contact stiffness and mu = 0.3. It bends in the
patch's plane, which slips from one edge on. The forced resonance predicted from the mode is
compared with the peak of the full balance.
"""

from __future__ import annotations

import argparse
import time
from itertools import product

import numpy as np

from bladefem.data import Elements
from bladefem.hbm.model import Damping, ReducedModel
from bladefem.hbm.nonlinear_modes import force_at_resonance, nonlinear_mode
from bladefem.hbm.peak import find_peak
from bladefem.reduction.matrices import port_model_from_matrices

# [Pa], [1], [kg/m^3]
YOUNG, POISSON, DENSITY = 210e9, 0.3, 7850.0
# [m]
LENGTH, WIDTH, THICKNESS = 0.2, 0.04, 0.01
# [N/m^3], [1], [Pa]
CONTACT_STIFFNESS, FRICTION, PRESSURE = 40e9, 0.3, 2e6
# across the tip [N]
FORCE = 200.0
# modes kept next to the residual flexibility
MODES = 20
AMPLITUDES = 20


def brick(size: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(24, 24) stiffness [N/m] and mass [kg] of a brick of given edges (3,) [m]."""
    corners = np.array(list(product((-1, 1), repeat=3)), dtype=float)
    lame = YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON))
    shear = YOUNG / (2 * (1 + POISSON))
    D = np.diag([2 * shear] * 3 + [shear] * 3)
    D[:3, :3] += lame
    K = np.zeros((33, 33))
    M = np.zeros((8, 8))
    volume = size.prod() / 8
    for point in product((-(3**-0.5), 3**-0.5), repeat=3):
        terms = (1 + corners * point) / 2
        slopes = np.zeros((11, 3))
        for c in range(3):
            others = np.prod(np.delete(terms, c, axis=1), axis=1)
            slopes[:8, c] = corners[:, c] / 2 * others
            # the incompatible mode 1 - xi^2
            slopes[8 + c, c] = -2 * point[c]
        slopes *= 2 / size
        B = np.zeros((6, 33))
        for c, (i, j) in enumerate(((1, 2), (2, 0), (0, 1))):
            B[c, c::3] = slopes[:, c]
            B[3 + c, i::3] = slopes[:, j]
            B[3 + c, j::3] = slopes[:, i]
        K += volume * B.T @ D @ B
        shape = terms.prod(axis=1)
        M += DENSITY * volume * np.outer(shape, shape)
    condensed = K[:24, :24] - K[:24, 24:] @ np.linalg.solve(K[24:, 24:], K[24:, :24])
    return condensed, np.kron(M, np.eye(3))


def beam(nodes: int) -> ReducedModel:
    """The beam on a patch of nodes x nodes contacts, excited at its tip across its length."""
    step = WIDTH / (nodes - 1)
    counts = np.array([round(LENGTH / step), nodes - 1, 1]) + 1
    size = np.array([LENGTH, WIDTH, THICKNESS]) / (counts - 1)
    number = np.arange(counts.prod()).reshape(counts)
    K = np.zeros((3 * number.size, 3 * number.size))
    M = np.zeros_like(K)
    stiffness, mass = brick(size)
    for i, j in product(range(counts[0] - 1), range(counts[1] - 1)):
        corners = number[i : i + 2, j : j + 2, :].ravel()
        dofs = (3 * corners[:, None] + np.arange(3)).ravel()
        K[np.ix_(dofs, dofs)] += stiffness
        M[np.ix_(dofs, dofs)] += mass
    free = np.arange(3 * number[1:].size) + 3 * number[0].size
    place = np.full(len(K), -1)
    place[free] = np.arange(len(free))
    first = (counts[0] - nodes) // 2
    patch = place[(3 * number[first : first + nodes, :, 0].ravel()[:, None] + [2, 0, 1]).ravel()]
    contact = np.zeros((len(patch), len(free)))
    contact[np.arange(len(patch)), patch] = 1.0
    # compression counts positive
    contact[::3] *= -1
    tip = place[3 * number[-1, nodes // 2, 0] + 1]
    ports = {"contact": contact, "load": [tip], "probe": [tip]}
    body = port_model_from_matrices(
        M[np.ix_(free, free)], K[np.ix_(free, free)], ports, count=MODES
    )
    area = step**2
    each = np.ones(nodes**2)
    elements = Elements(
        CONTACT_STIFFNESS * area * each,
        CONTACT_STIFFNESS * area * each,
        FRICTION * each,
        PRESSURE * area * each,
    )
    return ReducedModel((body,), elements, {1: np.array([FORCE])}, Damping(ratio=1e-3))


def measure(model: ReducedModel, harmonics: int) -> None:
    """One line of time and solved amplitudes, and the predicted resonance next to the balance's."""
    body = model.side(1)
    across = abs(body.shapes[body.ports["probe"], :3]).ravel()
    mode = int(np.argmax(across))
    tip = float(across[mode])
    wanted = np.geomspace(3e-6, 3e-3, AMPLITUDES) / tip
    begin = time.process_time()
    points = list(nonlinear_mode(model, list(wanted), mode, harmonics, 64))
    took = time.process_time() - begin
    solved = sum(p.converged for p in points)
    steps = sum(p.iterations for p in points)
    unknowns = points[0].w.size
    print(f"{unknowns} unknowns: {took:.1f} s of CPU, {solved} of {len(points)}, {steps} steps")
    for p in points:
        print(
            f"  {1e6 * abs(p.probe[1, 0]):8.1f} um  {p.omega / 2 / np.pi:8.2f} Hz  "
            f"{100 * p.zeta:6.3f} %  {p.iterations:3d} steps  {'' if p.converged else p.reason}"
        )
    modal = tip * abs(model.loads(1)[1][0])
    drive = np.array([force_at_resonance(model, p) for p in points])
    i = int(np.argmax(drive > modal))
    share = np.log(modal / drive[i - 1]) / np.log(drive[i] / drive[i - 1])
    heights = [float(np.linalg.norm(p.probe[1:, 0])) for p in points[i - 1 : i + 1]]
    predicted = heights[0] * (heights[1] / heights[0]) ** share
    omega = points[i - 1].omega + share * (points[i].omega - points[i - 1].omega)
    begin = time.process_time()
    peak = find_peak(model, omega, harmonics, 64)
    took = time.process_time() - begin
    print(
        f"  resonance by the mode {1e6 * predicted:.2f} um at {omega / 2 / np.pi:.3f} Hz, balance "
        f"{1e6 * peak.height:.2f} um at {peak.omega / 2 / np.pi:.3f} Hz ({took:.1f} s of CPU): "
        f"{100 * (predicted / peak.height - 1):+.2g} %"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--harmonics", type=int, nargs="+", default=[1, 3])
    parser.add_argument("--nodes", type=int, default=10, help="contacts along the patch's edge")
    options = parser.parse_args()
    model = beam(options.nodes)
    for harmonics in options.harmonics:
        measure(model, harmonics)


if __name__ == "__main__":
    main()
