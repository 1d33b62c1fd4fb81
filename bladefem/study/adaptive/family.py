"""The models of one load case, from poor to rich: what the choice picks from.

A family turns settings into a model, and knows which contact nodes of the finest model each of its
elements represents, so that the displacements of one member start the next. ``family_of`` makes one
from a rich model alone, by leaving out modes and by joining contact nodes; scenes make theirs in
``pipeline``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, lru_cache, partial

import numpy as np

from ...data import Elements, PortModel, RigidBody
from ...friction.law_table import merged_laws
from ...hbm.model import ReducedModel, in_series, softened_layer
from ...reduction.assemble import change_each, recombine_contact
from ...reduction.truncate import truncate_modes
from .settings import Settings

SHARED_HARMONICS = (1, 7, 15, 31, 63)


@dataclass(frozen=True)
class Member:
    """A model, and how its contact points relate to the finest ones."""

    model: ReducedModel
    # (finest nodes,) number of the element that represents each node of the finest model
    groups: np.ndarray


@dataclass(frozen=True)
class Family:
    """Settings to models."""

    build: Callable[[Settings], Member]
    # most modes that can be had without a new reduction
    modes: int
    # most harmonics that the sides are known for
    harmonics: int = 99
    # damper models that can be had
    dampers: tuple[str, ...] = ()
    # of some settings, the model with the bodies of a class of disturbances of its travelling wave
    # (hbm.other_diameters); None where they are not known
    disturbed: Callable[[Settings, int], ReducedModel] | None = None


def family_member(family: Family, settings: Settings) -> Member:
    """The model of some settings; what does not change the model (samples, errors) is not looked
    at.
    """
    plain = replace(settings, error=None, chosen=(), samples=0, softened=False)
    member = family.build(plain)
    if not settings.softened:
        return member
    return replace(member, model=softened_layer(member.model))


def same_equations(family: Family, one: Settings, other: Settings) -> bool:
    """Two settings give the same model, harmonics and samples: what differs, this family lacks."""
    return (
        one.harmonics == other.harmonics
        and one.samples == other.samples
        and family_member(family, one).model is family_member(family, other).model
    )


def lowest_harmonics(family: Family, settings: Settings) -> int:
    """Highest harmonic of the excitation and of prescribed normal loads: no balance has fewer."""
    model = family_member(family, settings).model
    return max((1, *model.excitation, *model.normal))


def with_excited_harmonics(family: Family, settings: Settings) -> Settings:
    """The settings with all harmonics that are excited, where the choice may take more.

    Samples follow where they are open: at least eight in the period of the highest harmonic.
    """
    lowest = lowest_harmonics(family, settings)
    if lowest <= settings.harmonics or "harmonics" not in settings.chosen:
        return settings
    samples = settings.samples
    if "samples" in settings.chosen:
        samples = max(samples, 8 * (lowest + 1))
    return replace(settings, harmonics=lowest, samples=samples)


def carried_displacements(
    w: np.ndarray,
    old: Member,
    new: Member,
    H: int,
) -> np.ndarray:
    """Displacements (n, d, K) of one member as a start (m, d', 2H+1) for another.

    Each new element takes the mean over the finest nodes that it represents; a normal direction
    that the old model did not have starts at zero.
    """
    fine = w[old.groups]
    size = np.bincount(new.groups)
    mean = np.zeros((len(size), *w.shape[1:]))
    np.add.at(mean, new.groups, fine / size[new.groups][:, None, None])
    d = new.model.directions
    kept = min(w.shape[2], 2 * H + 1)
    result = np.zeros((len(size), d, 2 * H + 1))
    both = min(d, w.shape[1])
    result[:, d - both :, :kept] = mean[:, w.shape[1] - both :, :kept]
    return result


def coarsened_elements(
    model: ReducedModel,
    groups: np.ndarray,
    pick: np.ndarray | None = None,
) -> ReducedModel:
    """The model with contact nodes joined into elements.

    Stiffnesses add up; the normal force is the sum over the pressed nodes, or the gap that the mean
    must close.

    Args:
        groups: (n,) number of the element of each node, 0 .. m-1.
        pick: (m, n) from the nodes' motion to the elements' (``contact.joined_points``); the mean,
            weighted by stiffness, when left out.
    """
    m = int(groups.max()) + 1
    if m == len(groups):
        return model
    elements = joined_elements(model.elements, groups)
    means = _means(model.elements, groups)
    pick = means if pick is None else pick
    dofs = np.kron(pick, np.eye(elements.tangents + (not model.tangential)))
    damper: RigidBody | tuple[PortModel, ...] | None = model.damper
    if isinstance(damper, RigidBody):
        damper = replace(damper, B=dofs @ damper.B)
    elif damper is not None:
        damper = tuple(recombine_contact(body, dofs) for body in damper)
    normal = {
        h: np.bincount(groups, f.real, m) + 1j * np.bincount(groups, f.imag, m)
        for h, f in model.normal.items()
    }
    # what elements leave of their layer to the bodies stays with each of them
    sides = change_each(partial(recombine_contact, selection=dofs), softened_layer(model).sides)
    series = None if model.series is None else means**2 @ model.series
    if series is not None:
        sides = change_each(partial(in_series, compliance=series), sides)
    return replace(
        model,
        sides=sides,
        elements=elements,
        damper=damper,
        normal=normal,
        series=series,
        start=None if model.start is None else _totals(model.start, groups),
        closing=None if model.closing is None else pick @ model.closing,
    )


def joined_elements(e: Elements, groups: np.ndarray) -> Elements:
    """The elements of ``coarsened_elements``."""
    m = int(groups.max()) + 1
    if m == len(groups):
        return e

    def total(x: np.ndarray) -> np.ndarray:
        return np.bincount(groups, x, m)

    pressed = total(np.maximum(e.n0, 0.0))
    limit = total(e.mu * np.maximum(e.n0, 0.0))
    return replace(
        e,
        kt=total(e.kt),
        kn=total(e.kn),
        t0=None if e.t0 is None else _totals(e.t0, groups),
        n0=np.where(pressed > 0, pressed, total(e.n0)),
        mu=np.where(
            pressed > 0, limit / np.where(pressed > 0, pressed, 1.0), _means(e, groups) @ e.mu
        ),
        law=merged_laws(e, groups),
    )


def _totals(traction: np.ndarray, groups: np.ndarray) -> np.ndarray:
    """(m, tangents) friction forces of the elements from those (n, tangents) of their nodes."""
    return np.column_stack([np.bincount(groups, column) for column in traction.T])


def _means(e: Elements, groups: np.ndarray) -> np.ndarray:
    """(m, n) from the nodes' motion to the elements', weighted by stiffness."""
    weight = np.where(np.bincount(groups, e.kt)[groups] > 0, e.kt, 1.0)
    pick = np.zeros((int(groups.max()) + 1, len(groups)))
    pick[groups, np.arange(len(groups))] = weight / np.bincount(groups, weight)[groups]
    return pick


def family_of(rich: ReducedModel, patches: Sequence[int] | None = None) -> Family:
    """The family below a rich model: fewer modes, and contact nodes joined in their order on each
    patch.

    Args:
        patches: number of contact nodes of each patch, in order; two equal halves when left out.
    """
    n = len(rich.elements.kt)
    sizes = list(patches or (n // 2, n - n // 2))

    @cache
    def side(h: int, modes: int) -> PortModel:
        return truncate_modes(rich.sides[h], min(modes, len(rich.sides[h].omega)))

    @lru_cache(maxsize=8)
    def thinned(
        modes: int,
        points: int | None,
        harmonics: int,
    ) -> Member:
        groups = _runs(sizes, points)
        few = replace(
            rich, sides=tuple(side(h, modes) for h in range(min(harmonics + 1, len(rich.sides))))
        )
        return Member(coarsened_elements(few, groups), groups)

    def build(settings: Settings) -> Member:
        return thinned(settings.modes, settings.points, shared_harmonics(settings.harmonics))

    return Family(
        build,
        max(len(s.omega) for s in rich.sides),
        len(rich.sides) - 1 if len(rich.sides) > 1 else 99,
    )


def shared_harmonics(harmonics: int) -> int:
    """Harmonics of the model that serves several numbers of them: what a model keeps for itself is
    made once.
    """
    return next((most for most in SHARED_HARMONICS if harmonics <= most), harmonics)


def _runs(sizes: Sequence[int], points: int | None) -> np.ndarray:
    """Groups of neighbours, as equal as can be, at most `points` on each patch."""
    groups = []
    start = 0
    for size in sizes:
        count = size if points is None else min(points, size)
        groups.append(start + np.arange(size) * count // size)
        start += count
    return np.concatenate(groups)
