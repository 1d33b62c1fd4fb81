"""The law of the interface layer between two contact faces: asperities and surface films, as thin
springs on top of the bodies' own elasticity.

One law serves the seating, the friction elements, full stick and tables of states. Per point, with
closure c = how far the faces have approached each other since they first touched,

    f(c) = k c                           linear,
    f(c) = F (exp(k c / F) - 1)          stiffening: df/dc = k (1 + f / F),

and f = 0 where the faces are apart (c < 0). k tends to infinity for rigid faces. That the stiffness
of rough faces grows in proportion to the pressure, is measured and follows from their roughness:
Lorenz, Persson, J. Phys.: Condens. Matter 21, 015003 (2009), DOI 10.1088/0953-8984/21/1/015003.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import InputError


@dataclass(frozen=True)
class InterfaceLaw:
    """Normal stiffness of the layer at each contact point.

    Raises:
        InputError: a stiffness or a doubling force that is not above zero.
    """

    # (n,) stiffness at first touch [N/m]; infinite for rigid faces
    stiffness: np.ndarray
    # (n,) force at which the stiffness has doubled [N]; infinite for a linear layer
    doubling: np.ndarray

    def __post_init__(self) -> None:
        for name, meaning in (("stiffness", "N/m"), ("doubling", "N")):
            value = getattr(self, name)
            # also refuses NaN
            if not np.all(value > 0):
                worst = np.asarray(value)[~(np.asarray(value) > 0)].flat[0]
                raise InputError(
                    f"InterfaceLaw.{name} = {worst:g} {meaning}: expected a positive value, so "
                    "that the force of the layer grows with its closure"
                )


def rigid_faces(count: int) -> InterfaceLaw:
    """No layer: all that yields are the bodies."""
    return InterfaceLaw(np.full(count, np.inf), np.full(count, np.inf))


def force_of(law: InterfaceLaw, closure: np.ndarray) -> np.ndarray:
    """(n,) normal force [N] at a closure (n,) [m]; zero where the faces are apart."""
    pressed = np.maximum(closure, 0.0)
    # what rigid faces that just touch press with is not known from their closure: NaN
    with np.errstate(invalid="ignore"):
        linear = law.stiffness * pressed
    finite = np.isfinite(law.doubling)
    scale = np.where(finite, law.doubling, 1.0)
    return np.where(finite, scale * np.expm1(linear / scale), linear)


def closure_of(law: InterfaceLaw, force: np.ndarray) -> np.ndarray:
    """(n,) closure [m] at a pressing force (n,) [N]: the inverse of ``force_of``."""
    finite = np.isfinite(law.doubling)
    scale = np.where(finite, law.doubling, 1.0)
    return np.where(finite, scale * np.log1p(force / scale), force) / law.stiffness


def stiffness_at(law: InterfaceLaw, force: np.ndarray) -> np.ndarray:
    """(n,) tangent stiffness df/dc [N/m] at a pressing force (n,) [N]."""
    return law.stiffness * (1.0 + force / law.doubling)


def compliance_at(law: InterfaceLaw, force: np.ndarray) -> np.ndarray:
    """(n,) tangent compliance dc/df [m/N] at a pressing force (n,) [N]; zero for rigid faces."""
    return 1.0 / stiffness_at(law, force)
