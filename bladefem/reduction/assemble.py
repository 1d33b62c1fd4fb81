"""From one sector to the pair coordinates of a damper: harmonic h of engine order EO in nodal
diameter h EO mod N.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import pi

import numpy as np
from scipy.linalg import block_diag

from ..data import PortModel
from ..errors import InputError
from ..util.nodal_diameter import excited_diameter


def folded_diameter(
    harmonic: int,
    engine_order: int,
    sectors: int,
) -> tuple[int, bool]:
    """Nodal diameter 0..N/2 in which a harmonic moves, and whether the conjugate of that diameter's
    modes is meant.
    """
    order = harmonic * engine_order
    return excited_diameter(order, sectors), 2 * (order % sectors) > sectors


def pair_model(
    body: PortModel,
    following: slice | np.ndarray,
    phase: float,
) -> PortModel:
    """The body whose contact rows `following` belong to the next blade, which moves e^{j phase}
    times as this one.

    Args:
        following: rows of the contact port (counted from its start) on the patch "next".
        phase: interblade phase angle of the harmonic [rad].
    """
    factor = np.ones(len(body.residual), dtype=complex)
    factor[np.arange(len(factor))[body.ports["contact"]][following]] = np.exp(1j * phase)
    # in phase or in antiphase: stay real, half the work
    if abs(factor.imag).max() < 1e-14:
        factor = factor.real.round()
    offset = None if body.static_offset is None else (factor * body.static_offset).real
    return replace(
        body,
        shapes=factor[:, None] * body.shapes,
        static_offset=offset,
        residual=factor[:, None] * body.residual * factor.conj(),
    )


def standing_model(body: PortModel) -> PortModel:
    """The real model of a nodal diameter that is its own mirror image, 0 or N/2, from that of a
    neighbouring one which stands for it: each mode turned to where it is most nearly real.
    """
    if not np.iscomplexobj(body.shapes):
        return body
    turn = np.exp(-0.5j * np.angle((body.shapes**2).sum(axis=0)))

    def turned(matrix: np.ndarray | None) -> np.ndarray | None:
        if matrix is None or matrix.ndim == 1:
            return matrix
        return (turn.conj()[:, None] * matrix * turn).real

    return replace(
        body,
        shapes=(body.shapes * turn).real,
        residual=body.residual.real,
        damping=turned(body.damping),
        circulatory=turned(body.circulatory),
    )


def pair_models(
    body: PortModel,
    following: slice | np.ndarray,
    phase: float,
    harmonics: int,
) -> tuple[PortModel, ...]:
    """One model a harmonic 0..`harmonics` for blades clamped at their roots, one for all where they
    move in step.
    """
    return tuple(
        pair_model(body, following, h * phase) for h in range(harmonics + 1 if phase else 1)
    )


def wheel_models(
    sector: Mapping[int, PortModel],
    following: slice | np.ndarray,
    engine_order: int,
    sectors: int,
    harmonics: int,
    shift: int = 0,
) -> tuple[PortModel, ...]:
    """One model a harmonic 0..`harmonics` for a tuned wheel; harmonics that move in the same
    diameter share one.

    Args:
        sector: nodal diameter 0..N/2 to the sector's model in it.
        shift: harmonic h moves in diameter h EO + shift: a class of disturbances of the wave
            (`bladefem.hbm.other_diameters`).

    Raises:
        InputError: a harmonic falls into a nodal diameter that is not given.
    """
    diameters = [(h * engine_order + shift) % sectors for h in range(harmonics + 1)]
    models = {}
    for h, diameter in enumerate(diameters):
        n, mirrored = folded_diameter(1, diameter, sectors)
        if n not in sector:
            raise InputError(
                f"harmonic {h} of engine order {engine_order} needs the modes of nodal diameter {n}"
            )
        if diameter not in models:
            body = conjugate_wave(sector[n]) if mirrored else sector[n]
            models[diameter] = pair_model(body, following, 2 * pi * diameter / sectors)
    return tuple(models[diameter] for diameter in diameters)


def change_each(
    change: Callable[[PortModel], PortModel], bodies: Sequence[PortModel]
) -> tuple[PortModel, ...]:
    """Changed bodies; one that stands for several harmonics is changed once and stays one."""
    changed = {id(body): change(body) for body in {id(body): body for body in bodies}.values()}
    return tuple(changed[id(body)] for body in bodies)


def join_bodies(bodies: tuple[PortModel, ...]) -> PortModel:
    """Several bodies side by side as one: ports of the same name follow each other in the order of
    the bodies.
    """
    starts = np.cumsum([0] + [len(body.residual) for body in bodies])
    order = []
    ports = {}
    start = 0
    for name in dict.fromkeys(name for body in bodies for name in body.ports):
        rows = np.concatenate(
            [
                begin + np.arange(len(body.residual))[body.ports[name]]
                for begin, body in zip(starts, bodies, strict=False)
                if name in body.ports
            ]
        )
        order.append(rows)
        ports[name] = slice(start, start := start + len(rows))
    order = np.concatenate(order)
    damping = None
    if any(body.damping is not None for body in bodies):
        damping = block_diag(*map(_damping_matrix, bodies))
    circulatory = None
    if any(body.circulatory is not None for body in bodies):
        circulatory = block_diag(*map(_circulatory_matrix, bodies))
    return PortModel(
        np.concatenate([body.omega for body in bodies]),
        block_diag(*(body.shapes for body in bodies))[order],
        block_diag(*(body.residual for body in bodies))[np.ix_(order, order)],
        ports,
        bodies[0].nodal_diameter,
        damping=damping,
        circulatory=circulatory,
    )


def recombine_contact(body: PortModel, selection: np.ndarray) -> PortModel:
    """The body with other contact degrees of freedom: selection (k, contact dofs) times the present
    ones.

    With two blades joined as one body a row (1, -1) makes their relative displacement a contact.
    """
    rows = np.arange(len(body.residual))
    ports = {}
    start = 0
    for name, part in body.ports.items():
        count = len(selection) if name == "contact" else len(rows[part])
        ports[name] = slice(start, start := start + count)
    T = np.zeros((start, len(rows)))
    for name, part in body.ports.items():
        T[ports[name], rows[part]] = selection if name == "contact" else np.eye(len(rows[part]))
    offset = None if body.static_offset is None else T @ body.static_offset
    return replace(
        body,
        shapes=_real_times(T, body.shapes),
        residual=_real_times(T, _real_times(T, body.residual).T).T,
        ports=ports,
        static_offset=offset,
    )


def _real_times(T: np.ndarray, A: np.ndarray) -> np.ndarray:
    """T A of a real T (k, n) and a complex or real A (n, m), which a product of two complex ones
    would take twice the operations for.
    """
    if not np.iscomplexobj(A):
        return T @ A
    return (T @ np.ascontiguousarray(A).view(float)).view(complex)


def _damping_matrix(body: PortModel) -> np.ndarray:
    if body.damping is None:
        return np.zeros((len(body.omega),) * 2)
    return np.diag(body.damping) if body.damping.ndim == 1 else body.damping


def _circulatory_matrix(body: PortModel) -> np.ndarray:
    return np.zeros((len(body.omega),) * 2) if body.circulatory is None else body.circulatory


def conjugate_wave(body: PortModel) -> PortModel:
    """The body in nodal diameter -n: everything conjugate."""
    return replace(
        body,
        shapes=body.shapes.conj(),
        residual=body.residual.conj(),
        damping=None if body.damping is None else body.damping.conj(),
        circulatory=None if body.circulatory is None else body.circulatory.conj(),
    )
