"""Records that pass between the packages: frozen, plain arrays, each with its shape and unit.

Conventions. Harmonic motion is Re(q e^{j h Omega t}), h = 0..H; harmonic h of a tuned wheel excited
by engine order EO moves in nodal diameter n = h EO mod N, where the next blade carries the factor
e^{j n 2 pi / N}. Contact pairs: w = displacement of the blade minus displacement of the damper, in
the pair's frame (normal, t1, t2); the normal points out of the blade into the damper, so that
w_normal > 0 presses the two together. f is the contact force that the damper feels from the blade,
+f on the damper and -f on the blade, in the same frame.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from .errors import InputError
from .util.arrays import IntegerArray, RealArray, RealOrComplex


@dataclass(frozen=True, repr=False)
class ModeSet:
    """Normal modes of a body or of a cyclic sector in one nodal diameter, mass-normalised."""

    # (m,) [Hz]
    frequencies: RealArray
    # (m, n_points, 3) [kg^-1/2], complex where 0 < nodal_diameter < N/2
    shapes: RealOrComplex
    # None for a body without cyclic symmetry
    nodal_diameter: int | None
    # (m,) |K x - w^2 M x| / |K x|, the certificate
    residuals: RealArray

    def __repr__(self) -> str:
        """
        >>> ModeSet(np.array([220.9, 1236.6]), np.zeros((2, 3, 3)), None, np.zeros(2))
        <2 modes, 220.9 to 1236.6 Hz>
        """
        wave = "" if self.nodal_diameter is None else f", nodal diameter {self.nodal_diameter}"
        low, high = self.frequencies.min(), self.frequencies.max()
        return f"<{len(self.frequencies)} modes, {low:.6g} to {high:.6g} Hz{wave}>"


@dataclass(frozen=True)
class PortModel:
    """A linear body seen from its ports (contact, load and probe degrees of freedom) in one nodal
    diameter.

    Receptance at circular frequency w:  shapes diag(1/(omega^2 - w^2 + damping)) shapes^H +
    residual  [m/N].

    Raises:
        InputError: arrays that do not fit each other, numbers that are not finite, or a negative
            frequency or damping.
    """

    # (m,) [rad/s], ascending; 0 for rigid modes
    omega: RealArray
    # (p, m) mode values at the ports [kg^-1/2]
    shapes: RealOrComplex
    # (p, p) residual flexibility [m/N], Hermitian
    residual: RealOrComplex
    # "contact" (node-major: normal, t1, t2), "load", "probe"
    ports: dict[str, slice]
    nodal_diameter: int | None = None
    # (p,) displacement under the static loads (n = 0 only) [m]
    static_offset: RealOrComplex | None = None
    # (m,) or coupled (m, m) viscous modal damping, in addition to the model's [1/s]; its
    # skew-Hermitian part are gyroscopic and Coriolis forces
    damping: RealOrComplex | None = None
    # (m, m) forces of the displacements that have no energy, by unsymmetric stiffness [1/s^2]
    circulatory: RealOrComplex | None = None
    # a flow may feed modes: their damping may be negative
    self_excited: bool = False

    def __post_init__(self) -> None:
        p = len(self.residual)
        m = len(self.omega)
        wanted: dict[str, list[tuple[int, ...]]] = {
            "omega": [(m,)],
            "shapes": [(p, m)],
            "residual": [(p, p)],
            "damping": [(m,), (m, m)],
            "circulatory": [(m, m)],
        }
        for name, shapes in wanted.items():
            value = getattr(self, name)
            if value is None and name in ("damping", "circulatory"):
                continue
            if np.shape(value) not in shapes or not np.isfinite(value).all():
                raise InputError(
                    f"PortModel.{name} of shape {np.shape(value)}: expected finite numbers of "
                    f"shape {' or '.join(map(str, shapes))}"
                )
            fed = name == "damping" and self.self_excited
            if (name == "omega" or np.ndim(value) == 1) and not fed and np.any(value < 0):
                raise InputError(
                    f"PortModel.{name} from {np.min(value):.4g}: expected no negative number"
                )


@dataclass(frozen=True)
class SectorSpan:
    """What the modes of some nodal diameters of a cyclic sector span: m real vectors that serve all
    others.

    In diameter n of N sectors, a = 2 pi n / N, their matrices are A0 + cos(a) A1 + i sin(a) A2, and
    the ports move by (own + e^{ia} next) times their coordinates.
    """

    # (3, m, m) stiffness parts [N/m]
    stiffness: RealArray
    # (3, m, m) mass parts [kg]
    mass: RealArray
    # (p, m) of the ports
    own: RealArray
    # (p, m) what the next sector's motion adds
    next: RealArray


# contact pairs of a damper by what files, tables and pictures call its seats: "this" lies on
# seat_right of the blade, "next" on seat_left of the next one
SEATS = {"this": "right", "next": "left"}


@dataclass(frozen=True)
class Patch:
    """Matched contact nodes of one face pair: the carrier of pressure maps and friction
    elements.
    """

    # "this" or "next"
    name: str
    # (n, 3) on the blade side [m]
    points: RealArray
    # (n,) share of the face [m^2]
    area: RealArray
    # (n, 3, 3) rows: normal (out of the blade), t1, t2
    frame: RealArray
    # (nf, k) corner numbers into points, for pictures
    faces: IntegerArray
    # (n,) node numbers in the mesh
    blade_nodes: IntegerArray
    # (n, 3) where their forces act: centroids of the areas they represent [m]
    places: RealArray | None = None

    @property
    def seat(self) -> str:
        """What files, tables and pictures call it: "right" or "left"."""
        return SEATS.get(self.name, self.name)


@dataclass(frozen=True)
class PressureMap:
    """Quasi-static contact of one patch."""

    patch: Patch
    # (n,) normal force, pressing > 0 [N]
    force: RealArray
    # (n,) opening between the unpressed surfaces of the faces [m]; 0 where they press: how far the
    # interface layer is closed there follows from the force (contact.interface_law)
    gap: RealArray
    # max |force gap| over (max force, max gap): the proof of optimality
    complementarity: float
    # (n, tangents) static friction force [N], as `Elements.t0`; None: seated without friction
    traction: RealArray | None = None

    @property
    def pressure(self) -> np.ndarray:
        """(n,) [Pa]"""
        return self.force / self.patch.area


@dataclass(frozen=True)
class Elements:
    """Node-to-node friction elements, one a contact node."""

    # (n,) tangential stiffness [N/m]
    kt: RealArray
    # (n,) normal stiffness [N/m]; 0: the normal load is prescribed, N(t) = n0
    kn: RealArray
    # (n,) friction coefficient [1]
    mu: RealArray
    # (n,) static normal force [N]; negative means an initial gap of -n0/kn
    n0: RealArray
    # tangential directions: 1 (plane models) or 2
    tangents: int = 2
    # friction law of all nodes, or a tuple with one a node: an object or a name of the table; None:
    # Coulomb's, see `bladefem.friction.law_table`
    law: Any = None
    # (n, tangents) static friction force of the preload state [N]; none when None
    t0: RealArray | None = None

    @cached_property
    def table(self) -> RealArray:
        """(n, 4) kt, kn, mu, n0 of each element, as kernels take them.

        Raises:
            InputError: not finite, or negative where that means nothing.
        """
        columns = [np.asarray(part, dtype=float) for part in (self.kt, self.kn, self.mu, self.n0)]
        nodes = np.stack(np.broadcast_arrays(*columns), axis=1)
        if (nodes[:, :3] < 0).any() or not np.isfinite(nodes).all():
            raise InputError(
                "elements: kt, kn and mu must be finite and not negative, n0 must be finite"
            )
        return np.ascontiguousarray(nodes)

    @property
    def traction(self) -> np.ndarray:
        """(n, tangents) static friction force of the preload state [N]."""
        if self.t0 is None:
            return np.zeros((np.size(self.kt), self.tangents))
        return np.asarray(self.t0, dtype=float)


@dataclass(frozen=True)
class RigidBody:
    """A damper without deformation: q (d,) generalised displacements, contact displacement = B
    q.
    """

    # (d, d) [kg, kg m, kg m^2]
    mass: RealArray
    # (contact dofs, d) from q to displacements in the pairs' frames
    B: RealArray
    # (d,) static load [N, N m]
    load: RealArray = field(default_factory=lambda: np.zeros(0))
    # (d, d) skew-symmetric matrix of gyroscopic and Coriolis forces [N s/m, N s, N m s]; None
    # without
    gyroscopic: RealArray | None = None
