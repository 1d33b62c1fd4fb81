"""What the balance knows: linear sides seen from their ports, friction elements between them,
forces on them.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any, TypeVar

import numpy as np

from ..data import Elements, PortModel, RigidBody
from ..errors import InputError
from ..friction.fourier import synthesis, to_real
from ..reduction.assemble import change_each
from .linear.bodies import Damping, Stack, stack_bodies
from .validate_model import check_model, port_size

Result = TypeVar("Result")
# Hermitian part of modal damping, relative, that is rounding
SKEW_ROUNDING_SHARE = 1e-9


@dataclass(frozen=True)
class ReducedModel:
    """Blades and damper reduced to the contact, in the pair coordinates of `bladefem.data`.

    Harmonic 0 is counted from the preload state, in which node i carries the normal force max(n0_i,
    0) and the friction force t0_i (elements.t0, none by default); static offsets of the sides are
    part of that state, not of this model. A node that never slips carries the friction force
    kt w + t0, or kt w + start where its history left another one; nodes that slip within the period
    forget it. From plain matrices:

    >>> import numpy as np
    >>> from bladefem.data import Elements
    >>> from bladefem.hbm.solve import solve
    >>> from bladefem.hbm.model import ReducedModel
    >>> from bladefem.reduction.matrices import port_model_from_matrices
    >>> M, K = np.eye(2), np.array([[2.0, -1.0], [-1.0, 1.0]])
    >>> ports = {"contact": np.array([0]), "load": np.array([1]), "probe": np.array([1])}
    >>> side = port_model_from_matrices(M, K, ports, C=0.02 * K)
    >>> one = np.ones(1)
    >>> damper = Elements(kt=one, kn=0 * one, mu=0.5 * one, n0=one, tangents=1)
    >>> model = ReducedModel((side,), damper, {1: np.ones(1)})
    >>> solve(model, omega=0.7, H=7, samples=256).converged
    True

    Raises:
        InputError: contact dofs, elements, loads and bodies do not fit each other, or are no
            numbers.
    """

    # blade side of harmonic h = 0, 1, ...; one alone serves all harmonics
    sides: tuple[PortModel, ...]
    elements: Elements
    # harmonic to complex amplitudes on the load port [N]; 0: a static load
    excitation: Mapping[int, np.ndarray]
    damping: Damping = field(default_factory=Damping)
    # None: the other side of each contact is fixed
    damper: RigidBody | tuple[PortModel, ...] | None = None
    damper_damping: Damping = field(default_factory=Damping)
    # Whether the mean displacements take part in the balance. Uncoupled, the contacts vibrate about
    # the preload state, whose static solution is left as it is; mean forces that friction raises
    # are reported and do not act back.
    coupled: bool = True
    # Prescribed part of the normal load in addition to n0 and kn w_n: harmonic >= 1 to complex
    # amplitudes of the nodes [N].
    normal: Mapping[int, np.ndarray] = field(default_factory=dict)
    # (nodes, 1 + tangents) compliance of stiff interface layers that the residual flexibility of
    # the sides already has [m/N] (contact.numerical_stiffness); None: the elements have it all
    series: np.ndarray | None = None
    # (nodes, tangents) friction force at zero displacement from which the friction law starts [N]:
    # what the loading history left in nodes that never slip; elements.t0 when None
    start: np.ndarray | None = None
    # (nodes,) closing of the contacts beyond their displacement, added before the friction law is
    # evaluated [m]: faces that a vibration pushes apart press as before
    # (study.adaptive.layer_change); none when None
    closing: np.ndarray | None = None
    # (nodes,) length over which the layer's stiffness grows by e [m], infinite where it is linear
    # (contact.equivalent_layer): marches follow its law (hbm.stiffening_layer), balances and
    # verdicts its tangent at rest; None: all take the tangent
    decay: np.ndarray | None = None

    def __post_init__(self) -> None:
        parts: dict[str, Any] = {
            name: np.asarray(getattr(self.elements, name), dtype=float)
            for name in ("kt", "kn", "mu", "n0")
        }
        if any(value.ndim != 1 for value in parts.values()):
            raise InputError(
                "elements: expected kt, kn, mu and n0 as arrays with one number for each contact "
                "node"
            )
        if any(value is not getattr(self.elements, name) for name, value in parts.items()):
            object.__setattr__(self, "elements", replace(self.elements, **parts))
        check_model(self)

    @cached_property
    def tangential(self) -> bool:
        """The port carries no normal displacements."""
        return port_size(self.sides[0], "contact") == len(self.elements.kt) * self.elements.tangents

    @cached_property
    def damped(self) -> bool:
        """The blades lose work by themselves."""
        own = self.damping
        return any(np.any(x) for x in (own.ratio, own.structural, own.mass, own.stiffness)) or any(
            side.damping is not None and _has_loss(side.damping) for side in self.sides
        )

    @cached_property
    def circulatory(self) -> bool:
        """Displacements raise forces that have no energy: some stiffness is unsymmetric."""
        bodies = self.sides + (self.damper if isinstance(self.damper, tuple) else ())
        return any(body.circulatory is not None for body in bodies)

    @cached_property
    def directions(self) -> int:
        """Displacements of a node that enter the balance: the normal one does where some kn > 0."""
        return self.elements.tangents + bool(np.any(self.elements.kn > 0))

    @property
    def loads_prescribed(self) -> bool:
        """Normal loads do not follow the motion: then each motion is the only one at its frequency,
        without folds.
        """
        return self.directions == self.elements.tangents

    @cached_property
    def rows(self) -> np.ndarray:
        """(nodes directions,) rows of the contact port that enter the balance."""
        rows = np.arange(port_size(self.sides[0], "contact")).reshape(len(self.elements.kt), -1)
        return rows[:, rows.shape[1] - self.directions :].ravel()

    @cached_property
    def springs(self) -> np.ndarray:
        """(nodes, directions) stiffness of the contact in full stick [N/m]."""
        tangents = np.repeat(self.elements.kt[:, None], self.elements.tangents, axis=1)
        return tangents if self.loads_prescribed else np.column_stack([self.elements.kn, tangents])

    def unknowns(self, H: int) -> int:
        """Real unknowns of the balance with harmonics 0..H."""
        return int(self.springs.size) * (2 * H + 1)

    @cached_property
    def preload(self) -> np.ndarray:
        """(nodes directions,) contact forces in the preload state [N]."""
        force = np.zeros((len(self.elements.kt), self.directions))
        first = self.directions - self.elements.tangents
        if first:
            force[:, 0] = np.maximum(self.elements.n0, 0.0)
        force[:, first:] = self.elements.traction
        return force.ravel()

    @cached_property
    def offset(self) -> np.ndarray:
        """(nodes directions,) mean displacement that is added before the friction law is evaluated
        [m].

        The law starts its march from kt w, so kt (w + start / kt) makes it start from start + kt w.
        The slider moves along with it: nodes that slip carry the same force with and without it.
        """
        start = self.elements.traction if self.start is None else self.start
        kt = np.asarray(self.elements.kt, dtype=float)[:, None]
        moved = np.zeros((len(kt), self.directions))
        first = self.directions - self.elements.tangents
        moved[:, first:] = np.divide(start, kt, out=np.zeros_like(start), where=kt > 0)
        if first and self.closing is not None:
            moved[:, 0] = self.closing
        return moved.ravel()

    @cached_property
    def compression(self) -> float:
        """Size of what the preload presses the contact springs together [m]; above zero."""
        springs = self.springs.ravel()
        pressed = np.divide(
            self.preload, springs, out=np.zeros_like(self.preload), where=springs > 0
        )
        return float(max(np.linalg.norm(pressed), np.finfo(float).tiny))

    @cached_property
    def table(self) -> np.ndarray:
        """(nodes, 4) kt, kn, mu, n0 of the elements, for kernels."""
        e = self.elements
        return np.column_stack([e.kt, e.kn, e.mu, e.n0]).astype(float)

    def normal_load(self, H: int) -> np.ndarray:
        """(nodes, 2H+1) coefficients of the prescribed normal load n0 + N(t) [N]."""
        load = np.zeros((len(self.elements.n0), H + 1), dtype=complex)
        load[:, 0] = self.elements.n0
        for h, amplitudes in self.normal.items():
            if h <= H:
                load[:, h] = amplitudes
        return to_real(load)

    def normal_series(self, samples: int) -> np.ndarray:
        """(nodes, samples) the same at the samples; (nodes, 0) where it is constant or samples is
        0.
        """
        if not self.normal or not samples:
            return np.zeros((len(self.elements.n0), 0))
        H = max(self.normal)
        return self.normal_load(H) @ synthesis(H, samples).T

    def side(self, h: int) -> PortModel:
        """The blade side of harmonic h."""
        return _first(self.sides, h, "sides")[-1]

    def blades(self, H: int) -> Stack:
        """The blade side of harmonics 0..H."""
        return self._stack("sides", H, self.damping)

    def elastic_damper(self, H: int) -> Stack | None:
        """The damper of harmonics 0..H, where it is elastic."""
        return (
            self._stack("damper", H, self.damper_damping)
            if isinstance(self.damper, tuple)
            else None
        )

    def loads(self, H: int) -> np.ndarray:
        """(H+1, loads) excitation [N]."""
        force = np.zeros((H + 1, port_size(self.sides[0], "load")), dtype=complex)
        for h, amplitudes in self.excitation.items():
            if h <= H:
                force[h] = amplitudes
        return force

    def _stack(
        self,
        name: str,
        H: int,
        damping: Damping,
    ) -> Stack:
        bodies = _first(getattr(self, name), H, name)
        return self.once(("stack", name, len(bodies)), lambda: self._made(name, bodies, damping))

    def _made(
        self,
        name: str,
        bodies: tuple[PortModel, ...],
        damping: Damping,
    ) -> Stack:
        """The stack, which is the beginning of a larger one where that is there already."""
        larger = (
            stack
            for key, stack in self._kept.items()
            if isinstance(key, tuple) and key[:2] == ("stack", name) and key[2] > len(bodies)
        )
        found = next(larger, None)
        return (
            stack_bodies(bodies, damping, self.rows) if found is None else found.first(len(bodies))
        )

    def once(
        self,
        key: Hashable,
        make: Callable[[], Result],
    ) -> Result:
        """What `make` returns, kept with this model: what does not depend on the frequency is made
        once.
        """
        if key not in self._kept:
            self._kept[key] = make()
        return self._kept[key]

    @cached_property
    def _kept(self) -> dict[Hashable, Any]:
        return {}


def require_rigid_damper(model: ReducedModel) -> RigidBody:
    """The damper of a model whose damper is rigid.

    Raises:
        InputError: an elastic damper, or none.
    """
    if not isinstance(model.damper, RigidBody):
        raise InputError("model.damper: expected a rigid body")
    return model.damper


def in_series(side: PortModel, compliance: np.ndarray) -> PortModel:
    """A side with more compliance (nodes, 1 + tangents) [m/N] at its contact nodes."""
    residual = side.residual.copy(order="K")
    rows = np.arange(len(residual))[side.ports["contact"]]
    residual[rows, rows] += compliance.ravel()
    return replace(side, residual=residual)


def softened_layer(model: ReducedModel) -> ReducedModel:
    """The model whose layer is as soft as its elements: nothing of it is left to the bodies."""
    series = model.series
    if series is None:
        return model

    def make() -> ReducedModel:
        sides = change_each(partial(in_series, compliance=-series), model.sides)
        return replace(model, sides=sides, series=None)

    return model.once("softened layer", make)


def _has_loss(damping: np.ndarray) -> bool:
    """Some motion loses work: Coriolis forces alone, skew-Hermitian, take none."""
    if damping.ndim == 1:
        return bool(damping.any())
    return bool(abs(damping + damping.conj().T).max() > SKEW_ROUNDING_SHARE * abs(damping).max())


def _first(
    models: tuple[PortModel, ...],
    H: int,
    name: str,
) -> tuple[PortModel, ...]:
    if len(models) == 1:
        return models
    if H >= len(models):
        raise InputError(
            f"{name}: {len(models)} models given, expected one for harmonic {H}, or one for all "
            "harmonics"
        )
    return models[: H + 1]
