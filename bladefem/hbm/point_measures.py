"""What every solved point reports of its contacts, compiled: numbers of states, and the load on the
springs that choose the mean position of a damper on which every contact slips.
"""

from __future__ import annotations

import numpy as np
from numba import njit

# share of a period below which a contact is not counted as closed, or as open
ROUNDING_SHARE = 1e-12


@njit(cache=True, error_model="numpy")
def count_states(shares):
    """(4,) nodes that stick, slip, lift off, are open (`friction.states.NODE_STATES`), from the
    shares (n, 3) of stick, slip and separation.
    """
    counts = np.zeros(4, np.int64)
    for i in range(shares.shape[0]):
        if shares[i, 0] + shares[i, 1] <= ROUNDING_SHARE:
            counts[3] += 1
        elif shares[i, 2] > ROUNDING_SHARE:
            counts[2] += 1
        else:
            counts[1 if shares[i, 1] > 0.0 else 0] += 1
    return counts


@njit(cache=True, error_model="numpy")
def carried_load(B, g, load):
    """Load on the springs of the regularisation over what the contacts could carry, both on the
    motions without stiffness B (m, r) under the loads g (r,), for contact forces (m, K) [N]; 0
    without such motions.
    """
    held = 0.0
    carried = 0.0
    for a in range(B.shape[1]):
        push = -g[a]
        most = 0.0
        for i in range(B.shape[0]):
            push += B[i, a] * load[i, 0]
            total = 0.0
            for k in range(load.shape[1]):
                total += load[i, k] * load[i, k]
            most += abs(B[i, a]) * np.sqrt(total)
        held += push**2
        carried += most**2
    return np.sqrt(held) / max(np.sqrt(carried), 1e-300)
