"""Stiff layers where most contacts lift off: the balance takes a softer one, and the resonance is
followed from there to that of the layer itself; what it changes counts in the reported error.

A split layer leaves a negative compliance to the bodies (``contact.numerical_stiffness``). Where
contacts lift off, Newton's method seldom gets from few harmonics to more with it, and takes up to
twenty times as long as without.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ...errors import NotSolvedError
from ...hbm.model import ReducedModel, in_series
from ...hbm.peak import Peak, find_peak
from ...hbm.solution import Solution, mostly_lifts_off
from ...hbm.solve import solve_near
from ...reduction.assemble import change_each
from .band_sweep import solver_options
from .family import Family, family_member
from .peak_errors import peak_from
from .resonance_choice import LIFTING_POINTS
from .settings import DAMPER_MODELS, Settings

# harmonics at most of the models that follow the resonance; they have LIFTING_POINTS contact points
PATH_HARMONICS = 15
# harmonics of the balance at first, where some contacts keep closed: with PATH_HARMONICS it takes
# four times as long for 2.6 % of the amplitude. Where all lift off it needs those
FIRST_HARMONICS = 7
# elements on the way over those of the balance: 0.2 of the bodies' stiffness. With no stiffer ones
# a step took 28 s that takes 1 s with these
PATH_STIFFNESS_RATIO = 4.0
# compliances in series, over those of the elements, with which harmonics are added
SOFTENINGS = (0.0, 1.0, 2.0)
# of the way, which is linear in the layer's compliance: its first step, and the shortest one
FIRST_STEP_SHARE = 0.2
SHORTEST_STEP_SHARE = 0.02
# the next step over one that was solved, and over one that was not
LONGER_STEP = 1.5
SHORTER_STEP = 1.0 / 3.0
# points from its end on next to which a resonance is looked for
TRIED_BACK = 2
# Newton steps of a point on it
PATH_STEPS = 15
# relative accuracy of its heights
PATH_ACCURACY = 0.01
# of the way: what is left beyond it is extrapolated
ENOUGH_OF_THE_WAY = 0.5


@dataclass(frozen=True)
class StiffLayerChange:
    """Change of a resonance from the softer layer to the layer itself."""

    # estimated relative error of the amplitude: what the heights on the way are found to where it
    # was solved to its end, else the change that is not known; inf where less than half of the way
    # was solved
    error: float
    # relative, of the frequency, with its sign; NaN there
    frequency: float
    # the same of the amplitude; NaN where the way was not solved to its end
    height: float = np.nan


def softened_where_lifting(family: Family, settings: Settings, top: Solution) -> Settings:
    """The settings with a softer layer where that is split, and at least half of the contacts lift
    off at the resonance.
    """
    split = family_member(family, settings).model.series is not None
    return replace(settings, softened=True) if split and mostly_lifts_off(top) else settings


def settings_of_stiff_layer(family: Family, settings: Settings, top: Solution) -> Settings:
    """Settings with PATH_HARMONICS and an elastic damper where a stiff layer is softened and all
    contacts lift off, with FIRST_HARMONICS where some keep closed; the same as before where these
    are given.

    A rigid damper that bounces is 3 % wrong with all stiff layers on the shipped wedge, and leaves
    no room for the rest.

    Args:
        top: the highest point of a sweep with these settings.
    """
    if not settings.softened:
        return settings
    bounces = top.states["lift"] == len(top.w)
    more = min(PATH_HARMONICS if bounces else FIRST_HARMONICS, settings.most)
    richer = settings
    if "harmonics" in settings.chosen and settings.harmonics < more:
        richer = _with_harmonics(richer, more)
    if bounces and "damper" in settings.chosen and DAMPER_MODELS[-1] in family.dampers:
        richer = replace(richer, damper=DAMPER_MODELS[-1])
    return richer


def climbed_to(
    family: Family,
    settings: Settings,
    top: Solution,
    wanted: Settings,
    accuracy: float,
) -> Solution | None:
    """The resonance with other settings, of more harmonics and perhaps an elastic damper; None
    where it was not found.

    Where harmonics are not solved one after the other, they are added with a layer of half the
    stiffness or less: with rigid faces under 80 N on the shipped wedge neither 7 nor 15 harmonics
    are solved from the resonance with three.

    Args:
        settings, top: of the resonance that is known, and its highest point.
    """
    ways = (_climbed(family, settings, top, wanted, accuracy, more) for more in SOFTENINGS)
    return next((found for found in ways if found is not None), None)


def _with_harmonics(settings: Settings, harmonics: int) -> Settings:
    """So many harmonics, and the samples that they need where these are not given; 0 samples are
    located exactly.
    """
    samples = settings.samples
    if samples and "samples" in settings.chosen:
        samples = max(samples, 8 * (harmonics + 1))
    return replace(settings, harmonics=harmonics, samples=samples)


def _climbed(
    family: Family,
    settings: Settings,
    top: Solution,
    wanted: Settings,
    accuracy: float,
    softening: float,
) -> Solution | None:
    """The resonance with more and more harmonics, found with so many times the compliance of the
    elements in series; None where one of these was not found.
    """
    most = wanted.harmonics
    steps = [(softening, H) for H in (3, 7) if settings.harmonics <= H < most]
    last = [(softening, most), (0.0, most)] if softening else [(0.0, most)]
    for more, H in [*steps, *last]:
        step = _with_harmonics(replace(wanted, samples=settings.samples), H)
        model = softer_model(family_member(family, step).model, more)
        peak = _peak_on_the_way(model, step, top, accuracy)
        if peak is None:
            return None
        top = peak.solution
    return top


def softer_model(model: ReducedModel, softening: float) -> ReducedModel:
    """The model with so many times the compliance of its elements in series with them. Also with
    none it counts as split: Newton lowers the step first.
    """
    e = model.elements
    own = np.column_stack([e.kn, *[e.kt] * e.tangents])
    more = softening * np.divide(1.0, own, out=np.zeros_like(own), where=own > 0)
    sides = change_each(partial(in_series, compliance=more), model.sides)
    return replace(model, sides=sides, series=more)


def stiff_layer_change(
    family: Family,
    settings: Settings,
    top: Solution,
    accuracy: float,
) -> StiffLayerChange:
    """How a resonance moves from the softer layer to the layer itself.

    The way is solved at the frequency of the softer layer's resonance, from its end the resonance
    is found; where that is not yet the layer itself, the way goes on from there. Where it ends
    before, the largest change seen is taken to go on in proportion to the layer's compliance.

    Args:
        settings, top: of the resonance, and its highest point.
    """
    few = settings.points
    points = LIFTING_POINTS if few is None else min(few, LIFTING_POINTS)
    small = replace(
        settings, harmonics=min(settings.harmonics, PATH_HARMONICS), points=points, error=None
    )
    try:
        base = peak_from(family, settings, top, small, accuracy, fallbacks=False)
    except NotSolvedError:
        return StiffLayerChange(np.inf, np.nan)
    layer = family_member(family, replace(small, softened=False)).model
    solved, peak = 0.0, base
    changes = []
    begun = -1.0
    # ways that lead hardly farther are the last ones
    while solved < 1.0 and solved >= begun + FIRST_STEP_SHARE:
        begun = solved
        way = _way_to_the_layer(layer, small, solved, peak.solution, accuracy)
        # where no resonance is found at its end, next to an earlier point there may be one
        for share, point in way[: -1 - TRIED_BACK : -1]:
            found = _peak_on_the_way(stiffened_model(layer, share), small, point, accuracy)
            if found is not None:
                solved, peak = share, found
                changes.append(found.height / base.height - 1)
                break
    if solved < ENOUGH_OF_THE_WAY:
        return StiffLayerChange(np.inf, np.nan)
    shift = peak.omega / base.omega - 1
    if solved == 1.0:
        return StiffLayerChange(PATH_ACCURACY, shift, changes[-1])
    largest = max(map(abs, changes))
    return StiffLayerChange(PATH_ACCURACY + largest / solved, shift / solved)


def _way_to_the_layer(
    layer: ReducedModel,
    settings: Settings,
    share: float,
    point: Solution,
    accuracy: float,
) -> list[tuple[float, Solution]]:
    """The points that are solved on the way to the layer itself, at the frequency of a point, each
    with the share of the way where it is.

    Each point starts on the line through the last two. Resonances on the way take six times as long
    on the shipped wedge, since flat tops have points beside them that are not solved.

    Args:
        share, point: of the way, and the point there that it goes on from.
    """
    options = replace(solver_options(accuracy), fallbacks=False, iterations=PATH_STEPS)
    step = FIRST_STEP_SHARE
    rate = np.zeros_like(point.w)
    way = []
    while share < 1.0 and step >= SHORTEST_STEP_SHARE:
        target = min(1.0, share + step)
        ahead = replace(point, w=point.w + (target - share) * rate)
        model = stiffened_model(layer, target)
        H, samples = settings.harmonics, settings.samples
        found = solve_near(model, point.omega, H, samples, ahead, options)
        if found.converged:
            rate = (found.w - point.w) / (target - share)
            share, point, step = target, found, LONGER_STEP * step
            way.append((share, point))
        else:
            step = SHORTER_STEP * (target - share)
    return way


def _peak_on_the_way(
    model: ReducedModel,
    settings: Settings,
    near: Solution,
    accuracy: float,
) -> Peak | None:
    """The resonance next to one with a somewhat softer layer; None where it is not solved."""
    options = replace(solver_options(accuracy), fallbacks=False, iterations=PATH_STEPS)
    try:
        return find_peak(
            model,
            near.omega,
            settings.harmonics,
            settings.samples,
            near=near,
            tolerance=PATH_ACCURACY,
            enough=PATH_ACCURACY,
            options=options,
        )
    except NotSolvedError:
        return None


def stiffened_model(split: ReducedModel, share: float) -> ReducedModel:
    """A split model whose layer is, by a share in its compliance, on the way from the stiffness of
    its elements (0) to the layer itself (1); with stiffer elements, where the layer is.
    """
    if split.series is None:
        return split
    e = split.elements
    own = np.column_stack([e.kn, *[e.kt] * e.tangents])
    # none where the normal load is prescribed
    springs = own > 0
    compliance = np.divide(1.0, own, out=np.zeros_like(own), where=springs)
    wanted = compliance + share * split.series
    stiffer = compliance / PATH_STIFFNESS_RATIO
    elements = np.maximum(wanted, stiffer)
    left = np.where(springs, wanted - elements, 0.0)
    stiffness = np.divide(1.0, elements, out=np.zeros_like(own), where=springs)
    ratio = np.divide(stiffness[:, 0], e.kn, out=np.ones_like(e.kn), where=e.kn > 0)
    return replace(
        split,
        # an open node keeps its gap, a pressed one its force
        elements=replace(
            e,
            kn=stiffness[:, 0],
            kt=stiffness[:, 1],
            n0=np.where(e.n0 > 0, e.n0, ratio * e.n0),
        ),
        sides=change_each(partial(in_series, compliance=left - split.series), split.sides),
        series=left,
    )
