"""The modes of one nodal diameter at any speed: small matrices that stand for the body.

The basis is the modes at three speeds, and for the Coriolis forces the static answer to those of
each mode shown: modes that are left out move a wave by the sum of c_k / (lambda_k - lambda), of
which the static answer holds all but what Kantorovich's inequality bounds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np
import pandas as pd
from scipy.linalg import eigh

from ...data import ModeSet
from ...fem.body import Body
from ...fem.constraint import (
    Constrained,
    Transformation,
    at_diameter,
    expand_to_mesh,
    restrict_load,
)
from ...fem.flexibility import compliance, flexible
from ...fem.gyroscopic import coriolis_loads, own_rows, project_coriolis, waves
from ...fem.linalg import apply_block, hermitian_part, inner_products, release
from ...util.arrays import ComplexArray, RealArray

# largest squared ratio of a frequency to the lowest one left out that the bound is taken for
MAX_RATIO = 0.99
# of the largest eigenvalue of the mass matrix: a direction that the basis has already
DEPENDENT = 1e-11


@dataclass(frozen=True)
class SpeedModel:
    """Small matrices of one nodal diameter (None: no wheel); m vectors in the basis."""

    nodal_diameter: int | None
    # modes shown
    shown: int
    # modes of each of the three speeds
    count: int
    # (3,) squared speeds of the modes [rad^2/s^2]
    squares: RealArray
    # (m, m) stiffness at these, mass, Coriolis matrix for 1 rad/s
    K: tuple[ComplexArray, ...]
    M: ComplexArray
    g: ComplexArray
    # +1 where the sectors are counted in the sense of the rotation, else -1
    sense: int
    # rigid motions without stiffness at all speeds
    rigid: int = 0

    def table(self, speeds: Sequence[float]) -> pd.DataFrame:
        """One row a mode and speed [rad/s].

        Returns:
            columns nodal_diameter (wheels), mode, speed [rad/s], frequency [Hz] without Coriolis
            forces, forward and backward [Hz] with them, error [1]: how far the frequency moves when
            the middle speed's modes are left out, a pessimistic measure of what the basis misses.
        """
        frames = []
        for speed in speeds:
            f, forward, backward = self.waves_at(speed)
            values = {
                "frequency": f,
                "forward": forward,
                "backward": backward,
                "error": self._errors(speed, f, forward, backward),
            }
            mode = np.arange(1, self.shown + 1)
            frames.append(pd.DataFrame({"mode": mode, "speed": float(speed), **values}))
        table = pd.concat(frames, ignore_index=True)
        if self.nodal_diameter is not None:
            table.insert(0, "nodal_diameter", self.nodal_diameter)
        return table

    def waves_at(
        self, speed: float, chosen: np.ndarray | slice = slice(None)
    ) -> tuple[RealArray, RealArray, RealArray]:
        """Frequencies [Hz] (shown,) without Coriolis forces, and of forward and backward waves.

        Args:
            speed: [rad/s].
            chosen: vectors of the basis to take; all when left out.
        """
        f, Z = self._modes_at(speed, chosen)
        g = self.g[chosen][:, chosen]
        found = waves(
            ModeSet(f, np.zeros((len(f), 0, 3)), self.nodal_diameter, np.zeros(len(f))),
            Z.conj().T @ g @ Z,
            speed,
            self.sense,
        )
        few = slice(0, self.shown)
        return f[few], found.forward[few], found.backward[few]

    def _modes_at(self, speed: float, chosen: np.ndarray | slice) -> tuple[RealArray, ComplexArray]:
        """All frequencies [Hz] of the basis and their vectors."""
        weights = _lagrange_weights(self.squares, speed**2)
        K = reduce(np.add, [weight * part for weight, part in zip(weights, self.K, strict=True)])
        f, Z = _basis_frequencies(K[chosen][:, chosen], self.M[chosen][:, chosen])
        # in the small matrices they have a frequency of rounding, which orders would cross
        f[: self.rigid] = 0.0
        return f, Z

    def _errors(
        self, speed: float, f: RealArray, forward: RealArray, backward: RealArray
    ) -> RealArray:
        """(shown,) the sum of two: how far the frequency moves without the modes of the middle
        speed, a pessimistic measure, and what the Coriolis basis may leave out of the worse wave.
        """
        count, size = self.count, len(self.M)
        outer = np.r_[0:count, 2 * count : size]
        rough, _ = self._modes_at(speed, outer)
        _, *plain = self.waves_at(speed, np.arange(3 * count))
        all_known, _ = self._modes_at(speed, slice(None))
        ratio = np.minimum((f / all_known[count - 1]) ** 2, MAX_RATIO)
        # of the part by modes that are left out, by Kantorovich's inequality
        missing = ratio**2 / (4 * (1 - ratio))
        split = np.zeros_like(f)
        for wave, less in zip((forward, backward), plain, strict=True):
            # the answers' own Coriolis forces are of the next order in the split of the waves
            share = missing + _over(abs(wave - f), f)
            split = np.maximum(split, share * abs(wave - less))
        return _over(abs(rough[: self.shown] - f) + split, f)


def speed_model(
    bodies: Sequence[Body],
    frame: Transformation,
    sets: Sequence[ModeSet],
    squares: RealArray,
    shown: int,
    axis: tuple[float, float, float],
    sense: int,
) -> SpeedModel:
    """The model of one nodal diameter from its modes at three speeds (collective).

    Args:
        bodies: the body with its stiffness at each of the three speeds.
        frame: the constraints of the middle one.
        sets: modes at the three speeds, as many of each.
        squares: (3,) squared speeds [rad^2/s^2].
        shown: modes whose Coriolis forces the basis answers.
    """
    body = bodies[0]
    con = at_diameter(frame, sets[1].nodal_diameter)
    answers = _coriolis_answers(con, sets[1].shapes[:shown], axis)
    shapes = np.concatenate([*(s.shapes for s in sets), answers])
    X = own_rows(body, shapes)
    K = tuple(hermitian_part(inner_products(body.comm, X, apply_block(at.K, X))) for at in bodies)
    M = hermitian_part(inner_products(body.comm, X, apply_block(body.mass, X)))
    g = project_coriolis(body, X, axis)
    count = len(sets[0].frequencies)
    rigid = min(int(np.count_nonzero(at.frequencies == 0)) for at in sets)
    return SpeedModel(sets[0].nodal_diameter, shown, count, squares, K, M, g, sense, rigid)


def _coriolis_answers(
    con: Constrained, shapes: np.ndarray, axis: tuple[float, float, float]
) -> np.ndarray:
    """(k, n_points, 3) static displacements by the Coriolis forces of fields, each of mass 1.

    Fields without such forces, as along the axis, have no answer: k may be less than their number.
    """
    flex = flexible(con)
    loads = coriolis_loads(con.body, shapes, axis)
    solved = compliance(flex, restrict_load(con, loads))
    release(con.K, flex.factor)
    mass = inner_products(con.body.comm, solved, apply_block(con.M, solved)).diagonal().real
    moved = mass > DEPENDENT * max(mass.max(initial=0.0), np.finfo(float).tiny)
    fields = expand_to_mesh(con, solved[:, moved] / np.sqrt(mass[moved])).transpose(2, 0, 1)
    out = np.zeros((*fields.shape[:2], 3), fields.dtype)
    out[:, :, : con.body.dim] = fields
    return out


def _over(part: RealArray, whole: RealArray) -> RealArray:
    """The ratio, zero where the whole is: of rigid modes."""
    return np.divide(part, whole, out=np.zeros_like(whole), where=whole > 0)


def _basis_frequencies(K: np.ndarray, M: np.ndarray) -> tuple[RealArray, ComplexArray]:
    """Frequencies [Hz] and vectors in a basis that may nearly depend on itself."""
    size, Q = np.linalg.eigh(M)
    keep = size > DEPENDENT * size[-1]
    W = Q[:, keep] / np.sqrt(size[keep])
    lam, Z = eigh(hermitian_part(W.conj().T @ K @ W))
    return np.sqrt(np.maximum(lam, 0)) / (2 * np.pi), W @ Z


def _lagrange_weights(nodes: np.ndarray, s: float) -> list[float]:
    """Weights of the values at the nodes for the value at s."""
    return [float(np.prod([(s - b) / (a - b) for b in nodes if b != a])) for a in nodes]
