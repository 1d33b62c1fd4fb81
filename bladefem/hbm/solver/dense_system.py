"""The derivative of a small balance as one matrix, formed in one compiled call:  1 + A C  among the
nodes that slip or lift off.

Where a damper walks the ramp of every node depends on the means of all: the system has all nodes,
and the terms  A f_s (b^T K x_0)  of the walk are part of it.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ...util.numba_options import KERNEL
from ..linear.contact_flexibility import apply_flexibility, form_matrices, select_nodes
from .newton_compiled import dense_jacobian, moving_nodes

# below the share of its stiffness by which any node moves
EVERY_NODE = -1.0


@njit(**KERNEL)
def dense_system(J, linear, d, sticks, walk, rates):
    """The numbers of the nodes in the system, dp/dw there (nodes, dK, dK), and the matrix of their
    displacements.

    Args:
        J: (n, d, K, d, K) derivative of the forces [N/m].
        linear: the `Condensed` bodies.
        sticks: share of a node's stiffness that dp/dw must exceed.
        walk: (m, z) motions along which the damper walks; (m, 0) where it rests in the mean.
        rates: (z, m, K) derivatives of the forces with its steps [N/m].
    """
    nodes, C = moving_nodes(J, linear.springs, d, EVERY_NODE if walk.shape[1] else sticks)
    M = dense_jacobian(form_matrices(select_nodes(linear.flex, nodes, d)), C)
    m = walk.shape[0]
    K = J.shape[2]
    for z in range(walk.shape[1]):
        moved = np.zeros((m, K))
        apply_flexibility(linear.flex, rates[z], moved)
        for i in range(m):
            reading = linear.springs[i] * walk[i, z]
            for j in range(m):
                for k in range(K):
                    M[j * K + k, i * K] += moved[j, k] * reading
    return nodes, C, M
