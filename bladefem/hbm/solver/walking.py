"""Whether a free damper walks, and along which motions.

A motion without stiffness that no normal spring resists is left to friction. As long as one contact
on it never slips, that contact remembers where the damper is: the mean position is found from the
balance of the mean forces, and the damper does not walk. Where every contact on it slips the mean
position has no influence; the mean forces are then in balance at one step a period
(`bladefem.hbm.solver.residual`). Which of the two it is depends on the solution: both are tried,
the more likely one first.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...friction.law_table import forgets_position
from ..linear.condensation import with_mean
from ..linear.mean_motion import motions_without_stiffness, with_springs
from ..model import ReducedModel
from .residual import Balance, State, walk_steps

# share of the contact springs below which a motion is not resisted: by the normal ones, whose
# directions come from a mesh, and by nodes that stick
UNRESISTED_NORMAL = 1e-10
UNRESISTED_STICK = 1e-12
# Of what the contacts could carry: mean load that the springs of the regularisation may take where
# every contact slips, and where one that sticks shares it with them by its stiffness
CARRIED_SHARE = 1e-6
CARRIED_SHARE_IN_STICK = 1e-4
# springs over the contact stiffness that hold the damper where neither state is found at once
HOLDING_SHARE = 1e-3
# samples for each harmonic where transitions were to be located exactly: the walk is sampled
WALK_SAMPLES = 64


def tangential_motions(model: ReducedModel) -> np.ndarray:
    """(m, z) motions without stiffness that no normal contact spring resists, scaled to b^T K b =
    1.
    """
    return model.once("tangential motions", lambda: _tangential_motions(model))


def _tangential_motions(model: ReducedModel) -> np.ndarray:
    B, _, _ = motions_without_stiffness(model)
    n, d = model.springs.shape
    first = d - model.elements.tangents
    normal = np.zeros((n, d), dtype=bool)
    normal[:, :first] = True
    return unresisted(B, model.springs.ravel(), normal.ravel(), UNRESISTED_NORMAL)


def unresisted(
    B: np.ndarray,
    springs: np.ndarray,
    rows: np.ndarray,
    share: float,
) -> np.ndarray:
    """(m, *) the part of the motions B (m, r) that the springs of some rows resist by less than
    this share.
    """
    if not B.shape[1] or not np.any(rows):
        return B
    resisted = B[rows].T @ (springs[rows, None] * B[rows])
    values, vectors = np.linalg.eigh(resisted)
    left = B @ vectors[:, values <= share]
    # not by rounding either: a contact that sticks must not walk
    left[rows] = 0.0
    return left


def walking_motions(balance: Balance, shares: np.ndarray) -> np.ndarray | None:
    """(m, z) motions along which every contact slips, from the shares (n, 3) of stick, slip and
    separation; None where there is none.
    """
    return _walking_motions(balance.model, shares)


def _walking_motions(model: ReducedModel, shares: np.ndarray) -> np.ndarray | None:
    free = tangential_motions(model)
    sticks = (shares[:, 1] == 0.0) & (shares[:, 2] == 0.0)
    rows = np.repeat(sticks, model.directions)
    found = unresisted(free, model.springs.ravel(), rows, UNRESISTED_STICK)
    return found if found.shape[1] else None


def may_walk(model: ReducedModel) -> bool:
    """True if the damper has a motion that only friction resists, by laws that let it walk."""
    return forgets_position(model.elements) and tangential_motions(model).shape[1] > 0


def walk_fault(balance: Balance, state: State) -> str:
    """Why a solved state is none: the damper does not walk and the mean forces are not in balance,
    or it walks and a contact sticks. Empty where all is well.
    """
    if not balance.linear.B.shape[1]:
        return ""
    if balance.walk is None:
        carried = carried_share(balance, state)
        return rest_fault(balance.model, state.forces.shares, carried)
    shares = state.forces.shares
    sticks = (shares[:, 1] == 0.0) & (shares[:, 2] == 0.0)
    moved = abs(balance.walk).reshape(*balance.model.springs.shape, -1).sum(axis=(1, 2))
    if np.any(sticks & (moved > 1e-9 * moved.max())):
        return "a contact sticks while the damper walks"
    return ""


def rest_fault(model: ReducedModel, shares: np.ndarray, carried: float) -> str:
    """Why a damper does not rest at a solved state, or nothing.

    Args:
        shares: (n, 3) of stick, slip and separation.
        carried: as `carried_share` tells it.
    """
    free = may_walk(model) and _walking_motions(model, shares) is not None
    if carried > (CARRIED_SHARE if free else CARRIED_SHARE_IN_STICK):
        return f"friction leaves {carried:.1e} of the contact forces on a damper that may walk"
    return ""


def carried_share(balance: Balance, state: State) -> float:
    """Mean load on the springs of the regularisation, over what the contacts could carry [1]."""
    linear = balance.linear
    load = state.forces.f.copy()
    load[:, :, 0] -= balance.model.preload.reshape(load.shape[:2])
    flat = load.reshape(-1, load.shape[2])
    push = linear.B.T @ flat[:, 0] - linear.g
    most = abs(linear.B).T @ np.linalg.norm(flat, axis=1)
    return float(np.linalg.norm(push) / max(np.linalg.norm(most), np.finfo(float).tiny))


def drift_speed(balance: Balance, w: np.ndarray) -> float:
    """Step a period times frequency, of the contact that moves most [m/s]."""
    if balance.walk is None:
        return 0.0
    steps = walk_steps(balance, w)
    ramp = (balance.walking @ steps).reshape(w.shape[:2])
    return float(np.linalg.norm(ramp, axis=1).max() * balance.linear.omega / (2 * np.pi))


def without_step(balance: Balance, w: np.ndarray) -> np.ndarray:
    """w (n, d, K) with a walk of zero along the motions of the balance."""
    steps = walk_steps(balance, w)
    still = w.copy()
    still[:, :, 0] -= (balance.walking @ steps).reshape(w.shape[:2])
    return still


def held_balance(balance: Balance) -> Balance:
    """The balance with springs on the mean of the free motions: where Newton starts if it is lost
    without them.
    """
    linear = balance.linear
    A, stuck = with_springs(
        linear.bodies.mean_G, linear.free[0].real, linear.springs, linear.B, linear.g, HOLDING_SHARE
    )
    return replace(balance, linear=with_mean(linear, A, stuck), walk=None)


def sampled_walk(balance: Balance) -> Balance:
    """The balance with samples, which the ramp of a walk needs."""
    if balance.samples:
        return balance
    return replace(balance, samples=WALK_SAMPLES * len(balance.linear.stuck))
