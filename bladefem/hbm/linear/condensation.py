"""The linear bodies at one frequency, condensed to the contact, with and without the contact
springs.

With f the contact forces of harmonic h (beyond the preload) the bodies say  w = free - G f + B q,
B^H f = g, where q are motions without stiffness (harmonic 0 only). Writing f = K w + p, K the
springs of full stick, gives the form that the balance uses,  w = stuck - A p: here p vanishes at
every node that sticks, and needs no unknowns there.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...data import RigidBody
from ...errors import NotSolvedError
from ...friction.fourier import to_real
from ...util.arrays import ComplexArray, RealArray
from ..model import ReducedModel
from ..solver.balance_residual import Condensed, motion_scale
from .bodies import gyroscopic_part, modal_flexibility, rigid_modes
from .circulation import joined_circulation, mean_modal_flexibility, with_circulation
from .condensation_compiled import linear_part, unsprung_flexibility
from .contact_flexibility import form_matrices
from .mean_motion import motions_without_stiffness
from .packed_bodies import Bodies, prepared_bodies

# distance to a frequency at which a free damper circles, and by how much gyroscopic forces are
# changed there, relative: the answer changes about as much. At a hundredth of it contacts that slip
# are so much stiffer than the damper that Newton's method stalls
CIRCLING_SHARE = 1e-5
# of the highest frequency, those below which are rounding
ROUNDING_SHARE = 1e-9


@dataclass(frozen=True)
class Linear:
    """Flexibilities of the contact at one frequency, m = nodes * directions, complex amplitudes of
    e^{i h omega t}.
    """

    omega: float
    # (m,) K [N/m]
    springs: np.ndarray
    # what does not depend on the frequency
    bodies: Bodies
    # flexibilities of the modes, see `linear_part`
    modal: tuple[np.ndarray, np.ndarray]
    # flexibility with springs and full stick, as compiled loops take them
    condensed: Condensed
    # (H+1, m) relative displacement without contact forces [m]
    free: np.ndarray
    # (H+1, m) relative displacement in full stick [m]
    stuck: ComplexArray
    # (m, r) motions without stiffness of harmonic 0, scaled to B^T K B = 1
    B: RealArray
    # (r,) loads on these motions
    g: RealArray
    # (r0, r) the same motions in the rigid coordinates of blade, then damper
    rigid: RealArray

    @cached_property
    def A(self) -> np.ndarray:
        """(H+1, m, m) flexibility with contact springs [m/N]."""
        return form_matrices(self.condensed.flex)

    @cached_property
    def G(self) -> np.ndarray:
        """(H+1, m, m) flexibility without contact springs and rigid motions [m/N]."""
        return unsprung_flexibility(self.bodies, *self.modal)

    def modal_part(self, first: int, last: int) -> np.ndarray:
        """(H+1, k), or (H+1, k, k) where damping couples modes: flexibilities of the k modes from
        `first` on, those of the blades before those of the damper [s^2].
        """
        single, coupled = self.modal
        return coupled[:, first:last, first:last] if len(coupled) else single[:, first:last]


def condense(
    model: ReducedModel,
    omega: float,
    harmonics: int,
) -> Linear:
    """Flexibilities of harmonics 0..H at circular frequency omega [rad/s].

    Raises:
        NotSolvedError: a resonance without damping is hit exactly.
    """
    springs = model.springs.ravel()
    bodies = prepared_bodies(model, harmonics)
    B, g, rigid = motions_without_stiffness(model)
    if model.circulatory:
        bodies = with_circulation(bodies, model, omega, harmonics)
    bodies = _beside_circling(model, bodies, omega, harmonics)
    try:
        # a whole number would be compiled for anew
        modal, condensed, free, stuck = linear_part(float(omega), bodies, springs, harmonics)
    except (ZeroDivisionError, np.linalg.LinAlgError):
        raise _exact_resonance(model, omega, harmonics) from None
    if not (np.isfinite(stuck).all() and np.isfinite(free).all()):
        raise _exact_resonance(model, omega, harmonics)
    linear = Linear(omega, springs, bodies, modal, condensed, free, stuck, B, g, rigid)
    return _with_circulating_mean(model, linear) if model.circulatory else linear


def _beside_circling(model: ReducedModel, bodies: Bodies, omega: float, harmonics: int) -> Bodies:
    """The bodies with other gyroscopic forces on the damper where a harmonic comes closer than
    CIRCLING_SHARE to a frequency at which it circles freely.

    A damper of any mass circles with twice the speed of the frame. Its flexibility is infinite
    there, while on its contacts it moves as it does next to that frequency.
    """
    circling = circling_frequencies(model)
    ratios = omega * np.arange(1, harmonics + 1)[:, None] / circling
    hit = ratios[abs(ratios - 1) < CIRCLING_SHARE]
    if not len(hit):
        return bodies
    first = model.blades(harmonics).omega.shape[1]
    coupled = bodies.coupled.copy()
    coupled[:, first:, first:] *= (1 + CIRCLING_SHARE) * hit[0]
    return bodies._replace(coupled=coupled)


def circling_frequencies(model: ReducedModel) -> np.ndarray:
    """(k,) circular frequencies of a free damper's rigid motions by gyroscopic forces [rad/s]."""
    return model.once("circling", lambda: _circling_frequencies(model))


def _circling_frequencies(model: ReducedModel) -> np.ndarray:
    if isinstance(model.damper, RigidBody):
        _, coupled = rigid_modes(model.damper, model.rows)
    else:
        damper = model.elastic_damper(0)
        if damper is None or damper.coupled is None:
            return np.zeros(0)
        rigid = damper.omega[0] == 0
        coupled = damper.coupled[0][np.ix_(rigid, rigid)]
    if coupled is None or not len(coupled):
        return np.zeros(0)
    found = np.linalg.eigvalsh(-1j * gyroscopic_part(coupled))
    return found[found > ROUNDING_SHARE * found.max()]


def _with_circulating_mean(model: ReducedModel, linear: Linear) -> Linear:
    """The modes of the mean are coupled as well, which is nothing that damping does."""
    bodies = linear.bodies
    flexible = mean_modal_flexibility(
        bodies.own[0], joined_circulation(model, len(linear.free) - 1)[0]
    )
    single, coupled = linear.modal
    coupled[0] = flexible
    free = linear.free.copy()
    free[0] = bodies.direct[0] + bodies.contact[0] @ (flexible @ bodies.push[0])
    return _with_motion(replace(linear, modal=(single, coupled)), free, linear.stuck)


def own_flexibility(linear: Linear) -> ComplexArray:
    """(m,) diagonal of G in harmonic 1: displacement of each contact degree of freedom by a unit
    force on itself without contact springs [m/N]. G is not formed.
    """
    bodies = linear.bodies
    _, _, rest, basis, added = linear.condensed.bare
    if len(added):
        return np.diagonal(rest) + np.sum((basis @ added[1]) * basis, axis=1)
    shapes = bodies.contact[min(1, len(bodies.contact) - 1)]
    modal, coupled = linear.modal
    moved = shapes @ coupled[1] if len(coupled) else shapes * modal[1]
    rest = bodies.residual[min(1, len(bodies.residual) - 1)]
    return np.diagonal(rest) + np.sum(moved * shapes.conj(), axis=1)


def scale_loads(linear: Linear, factor: float) -> Linear:
    """The condensed bodies under a multiple of all loads."""
    return _with_motion(
        replace(linear, g=factor * linear.g), factor * linear.free, factor * linear.stuck
    )


def truncate_harmonics(linear: Linear, H: int) -> Linear:
    """The first harmonics 0..H alone."""
    few = slice(0, H + 1)
    condensed = linear.condensed
    A, mean, R, U, T = condensed.flex
    fewer = condensed._replace(
        flex=(A[few], mean, R, U, T[few]),
        bare=(*condensed.bare[:4], condensed.bare[4][few]),
        G=condensed.G[few],
        modal=condensed.modal[few],
    )
    modal = linear.modal[0][few], linear.modal[1][few]
    less = replace(linear, modal=modal, condensed=fewer)
    return _with_motion(less, linear.free[few], linear.stuck[few])


def with_mean(
    linear: Linear,
    A: np.ndarray,
    stuck: np.ndarray,
) -> Linear:
    """The condensed bodies with another mean: flexibility with springs (m, m) and displacement in
    full stick (m,).
    """
    matrices, mean, R, U, T = linear.condensed.flex
    if len(matrices):
        matrices = np.concatenate([A[None], matrices[1:]])
    else:
        mean = np.ascontiguousarray(A.real)
    condensed = linear.condensed._replace(flex=(matrices, mean, R, U, T))
    motion = np.concatenate([stuck[None], linear.stuck[1:]])
    return _with_motion(replace(linear, condensed=condensed), linear.free, motion)


def _with_motion(
    linear: Linear,
    free: np.ndarray,
    stuck: np.ndarray,
) -> Linear:
    """The condensed bodies with other motions without contact forces and in full stick."""
    still = to_real(free.T)
    motion = to_real(stuck.T)
    scale, least = motion_scale(still, motion, linear.bodies.compression)
    condensed = linear.condensed._replace(stuck=motion, scale=scale, least=least)
    return replace(linear, condensed=condensed, free=free, stuck=stuck)


def _exact_resonance(
    model: ReducedModel,
    omega: float,
    harmonics: int,
) -> NotSolvedError:
    """The error with the frequency of the mode that is hit, where it is one of the blades."""
    try:
        modal_flexibility(model.blades(harmonics), omega * np.arange(harmonics + 1))
    except NotSolvedError as error:
        return error
    return NotSolvedError(
        "contact flexibility is singular: a resonance without damping is hit exactly"
    )
