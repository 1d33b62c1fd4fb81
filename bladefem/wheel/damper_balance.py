"""The balance of one damper whose two blades move as imposed, many pairs of blades at once:

    w_1 + G_1 f_1(w) = imposed,    w_h + G_h f_h(w) = 0  for h = 2..H,

relative displacements w of the contacts and forces f on the blades by harmonics, and the
flexibility G of everything but the family of modes that is imposed. Mean displacements stay in the
preload state. Newton with dense matrices.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..data import Elements
from ..friction.aft import evaluate
from ..friction.law_table import select_elements
from ..util.arrays import BooleanArray, ComplexArray, RealArray
from .family import ModeFamily
from .model import Pattern, Wheel

# Newton steps, and the relative residual at the end
MAX_NEWTON_STEPS = 40
RESIDUAL_TOLERANCE = 1e-7
# halvings of a step
MAX_HALVINGS = 8
# of the largest motion imposed on a pair: a smaller one is rounding, of two blades that move alike,
# and residuals are measured by this share of it
NEGLIGIBLE_MOTION = 1e-9


@dataclass(frozen=True)
class DamperMotion:
    """Balances of one damper for B pairs of blade motions; m contact displacements."""

    # (B, m, H) complex displacements [m] and forces [N]
    displacement: ComplexArray
    force: ComplexArray
    # (B,) residual over the size of what is imposed, at least NEGLIGIBLE_MOTION of the largest
    residual: RealArray

    @property
    def solved(self) -> BooleanArray:
        """(B,) True where the residual is small enough."""
        return self.residual <= RESIDUAL_TOLERANCE

    def part(self, chosen: np.ndarray) -> DamperMotion:
        """Some of the pairs."""
        return DamperMotion(self.displacement[chosen], self.force[chosen], self.residual[chosen])

    def improved(self, places: np.ndarray, better: DamperMotion) -> DamperMotion:
        """With other balances of the pairs with some numbers."""
        displacement, force, residual = (
            self.displacement.copy(),
            self.force.copy(),
            self.residual.copy(),
        )
        displacement[places] = better.displacement
        force[places] = better.force
        residual[places] = better.residual
        return DamperMotion(displacement, force, residual)


def stuck_displacements(wheel: Wheel, family: ModeFamily, imposed: np.ndarray) -> ComplexArray:
    """(B, m, H) displacements with all contacts sticking, for imposed ones (B, m) [m]."""
    springs = wheel.springs.ravel()
    first = np.linalg.solve(np.eye(len(springs)) + family.flexibility[0] * springs, imposed.T).T
    return with_harmonics(first[:, :, None], len(family.flexibility))


def with_harmonics(displacement: np.ndarray, harmonics: int) -> ComplexArray:
    """Displacements (B, m, any) with zeros for the harmonics that are missing."""
    total, m, known = displacement.shape
    return np.concatenate(
        [displacement, np.zeros((total, m, harmonics - known), dtype=complex)], axis=2
    )


def solve_damper(
    wheel: Wheel,
    e: Elements,
    family: ModeFamily,
    imposed: np.ndarray,
    start: np.ndarray,
    samples: int,
) -> DamperMotion:
    """The balances of one damper, by Newton with steps halved where the residual grows.

    Args:
        e: friction elements of the damper.
        imposed: (B, m) relative displacements of the contacts by the family of modes [m].
        start: (B, m, H) displacements to start from.
    """
    H = len(family.flexibility)
    maps = [_real_map(G) for G in family.flexibility]
    scale = np.linalg.norm(imposed, axis=1)
    scale = np.maximum(scale, max(NEGLIGIBLE_MOTION * scale.max(), np.finfo(float).tiny))
    first = with_harmonics(imposed[:, :, None], H)
    w = start.copy()
    force, change = _contact(wheel, e, w, samples)
    residual = _residual(family, w, force, first)
    error = _error(residual, scale)
    for _ in range(MAX_NEWTON_STEPS):
        open_pairs = np.flatnonzero(error > RESIDUAL_TOLERANCE)
        if not len(open_pairs):
            break
        now = w[open_pairs]
        step = _newton_steps(maps, change[open_pairs], residual[open_pairs])
        share = np.ones(len(open_pairs))
        for _ in range(MAX_HALVINGS):
            trial = now - share[:, None, None] * step
            forces, changes = _contact(wheel, e, trial, samples)
            r = _residual(family, trial, forces, first[open_pairs])
            errors = _error(r, scale[open_pairs])
            worse = errors > error[open_pairs]
            if not worse.any():
                break
            share = np.where(worse, 0.5 * share, share)
        w[open_pairs], force[open_pairs], change[open_pairs] = trial, forces, changes
        residual[open_pairs], error[open_pairs] = r, errors
    return DamperMotion(w, force, error)


def _residual(
    family: ModeFamily,
    w: np.ndarray,
    force: np.ndarray,
    imposed: np.ndarray,
) -> np.ndarray:
    """(B, m, H) displacements that are left over [m]."""
    moved = np.einsum("hij,bjh->bih", family.flexibility, force)
    return np.asarray(w + moved - imposed)


def _error(residual: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """(B,) sizes of residuals over those of what is imposed."""
    return np.asarray(np.linalg.norm(residual, axis=(1, 2)) / scale)


def _newton_steps(
    maps: list[np.ndarray],
    change: np.ndarray,
    residual: np.ndarray,
) -> np.ndarray:
    """(B, m, H) Newton steps, by dense real matrices.

    Args:
        maps: (2m, 2m) of each harmonic: its flexibility as a real map.
        change: (B, n, d, 2H, 2dH) derivatives of the forces at the nodes, by cosine and sine of
            each harmonic.
        residual: (B, m, H).
    """
    total, nodes, d, width, columns = change.shape
    m = nodes * d
    J = np.empty((total, m, width, nodes, columns))
    for h, turned in enumerate(maps):
        own = change[:, :, :, 2 * h : 2 * h + 2].reshape(total, nodes, 2 * d, columns)
        split = turned.reshape(2 * m, nodes, 2 * d).swapaxes(0, 1)
        part = (split @ own).reshape(total, nodes, m, 2, columns)
        J[:, :, 2 * h : 2 * h + 2] = part.transpose(0, 2, 3, 1, 4)
    J = J.reshape(total, m * width, m * width)
    unknowns = np.arange(m * width)
    J[:, unknowns, unknowns] += 1.0
    right = np.stack([residual.real, -residual.imag], axis=3).reshape(total, -1, 1)
    x = np.linalg.solve(J, right).reshape(*residual.shape, 2)
    return x[..., 0] - 1j * x[..., 1]


def _contact(
    wheel: Wheel,
    e: Elements,
    w: np.ndarray,
    samples: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Forces (B, m, H) of a damper, and derivatives (B, n, d, 2H, 2dH) by cosine and sine of each
    harmonic.
    """
    total, m, H = w.shape
    n, d = wheel.nodes, wheel.directions
    many = select_elements(e, np.tile(np.arange(n), total))
    missing = 1 + many.tangents - d
    flat = np.zeros((total * n, missing + d, 2 * H + 1))
    whole = wheel.all_elements
    offset = wheel.offset(whole, wheel.first_forces(Pattern(), whole))
    flat[:, missing:, 0] = np.tile(offset[0], (total, 1))
    flat[:, missing:, 1::2] = w.real.reshape(-1, d, H)
    flat[:, missing:, 2::2] = -w.imag.reshape(-1, d, H)
    found = evaluate(many, flat, samples, True, precision="single")
    f = found.f[:, missing:].reshape(total, m, 2 * H + 1)
    change = found.jacobian[:, missing:, 1:, missing:, 1:]
    return f[:, :, 1::2] - 1j * f[:, :, 2::2], change.reshape(total, n, d, 2 * H, 2 * d * H)


def _real_map(G: np.ndarray) -> np.ndarray:
    """(2m, 2m) a complex map on interleaved cosines and sines, q = c - i s."""
    out = np.empty((len(G), 2, len(G), 2))
    out[:, 0, :, 0] = G.real
    out[:, 0, :, 1] = G.imag
    out[:, 1, :, 0] = -G.imag
    out[:, 1, :, 1] = G.real
    return out.reshape(2 * len(G), -1)
