"""Is the body's mesh fine enough? By how much its estimated error changes a resonance.

The blade's elements are too stiff. What displacements of third order say about that
(`fem.stiffness_error`) softens the modes of the reduced model, and the resonance is looked for
again: the change of its amplitude is the estimate. It holds what the modes carry: the shape of the
motion at the seats against that at the probe, on which friction acts, and the excited mode's share
in the force.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...data import ModeSet, Patch, PortModel
from ...hbm.linear_resonances import free_resonances
from ...hbm.model import ReducedModel
from ...hbm.solution import Solution, lifts_off, mostly_lifts_off, size
from ...hbm.solve import free_response
from ..adaptive.changed_peak import changed_peak
from ..adaptive.family import Family, family_member
from ..adaptive.settings import Settings
from .assemble_model import LoadCase
from .bodies import Bodies
from .ports import blade_ports
from .reduced_sector import Reduced

# deviation of the modes seen by the reduction from those of the stage, beyond which they are not
# the same ones
SAME_MODES = 0.05
# relative accuracy of the resonance amplitude
PEAK_TOLERANCE = 2e-3
# relative change of a resonance amplitude from which it may be that of another maximum
DOUBTFUL_CHANGE = 0.03


@dataclass(frozen=True)
class SofterBody:
    """All models of a load case on the body less the error of its stiffness."""

    family: Callable[[LoadCase], Family]
    # frequency of the excited mode over that as meshed
    ratio: float
    # the body less half of that error
    half: SofterBody | None = None


@dataclass(frozen=True)
class ModeErrors:
    """The estimated error of the stiffness, in the modes of one nodal diameter."""

    # key of Reduced.sector
    diameter: int
    # (p, m) the modes at the ports [kg^-1/2]
    shapes: np.ndarray
    # (m, m) Hermitian [1/s^2]
    energies: np.ndarray


def mode_errors(
    bodies: Bodies,
    patches: Sequence[Patch],
    modes: ModeSet,
) -> ModeErrors:
    """Errors by the mesh of the modes that the excitation meets."""
    from ...fem.stiffness_error import stiffness_error

    ports = blade_ports(bodies.mesh, list(patches), bodies.scene.excitation)
    dim = bodies.mesh.dimension
    fields = modes.shapes[:, :, :dim]
    seen = ports.matrix.T @ fields.reshape(len(fields), -1).T
    squares = (2 * np.pi * modes.frequencies) ** 2
    energies = stiffness_error(bodies.still_blade, fields, squares, bodies.state)
    return ModeErrors(modes.nodal_diameter or 0, np.asarray(seen), energies)


def softened_sector(reduced: Reduced, errors: ModeErrors) -> Reduced | None:
    """The sector less the error of its stiffness; None where the reduction has other modes, or the
    error is as large as the stiffness.
    """
    model = reduced.sector.get(errors.diameter)
    if model is None or (model.damping is not None and model.damping.ndim == 1):
        return None
    softer = _softened_model(model, errors)
    if softer is None:
        return None
    return replace(reduced, sector={**reduced.sector, errors.diameter: softer})


def _softened_model(model: PortModel, errors: ModeErrors) -> PortModel | None:
    count = min(len(model.omega), len(errors.energies))
    kept = model.shapes[:, :count]
    # ports of readings may follow
    rows = min(len(kept), len(errors.shapes))
    seen = errors.shapes[:rows, :count]
    # modes are known up to a phase, and equal ones up to a rotation
    turn, *_ = np.linalg.lstsq(seen, kept[:rows], rcond=None)
    missed = np.linalg.norm(seen @ turn - kept[:rows]) / np.linalg.norm(kept[:rows])
    if missed > SAME_MODES:
        return None
    left, _, right = np.linalg.svd(turn)
    turn = left @ right
    energies = turn.conj().T @ errors.energies[:count, :count] @ turn
    stiffness = np.diag(model.omega[:count] ** 2) - (energies + energies.conj().T) / 2
    squares, vectors = np.linalg.eigh(stiffness)
    if squares[0] <= 0:
        return None
    if np.isrealobj(model.shapes):
        vectors = vectors.real
    omega = model.omega.copy()
    omega[:count] = np.sqrt(squares)
    shapes = model.shapes.copy()
    shapes[:, :count] = kept @ vectors
    damping = model.damping
    if damping is not None:
        turn = np.eye(len(omega), dtype=vectors.dtype)
        turn[:count, :count] = vectors
        damping = turn.conj().T @ damping @ turn
    return replace(model, omega=omega, shapes=shapes, damping=damping)


def frequency_ratio(
    reduced: Reduced,
    softer: Reduced,
    errors: ModeErrors,
    mode: int,
) -> float:
    """Frequency of the excited mode (1 = lowest), softened over as meshed."""
    before = reduced.sector[errors.diameter].omega
    after = softer.sector[errors.diameter].omega
    row = min(mode, len(before)) - 1
    return float(after[row] / before[row])


def softened_change(
    softer: SofterBody,
    models: Family,
    case: LoadCase,
    settings: Settings,
    top: Solution,
    mode: int,
) -> float:
    """Relative change of a resonance amplitude on the softened body. Where that was not solved and
    contacts lift off, that of the blade without damper; else inf.

    Where most contacts lift off, many motions exist side by side, and a flat top has several
    maxima: the search may end on another one. Of the whole change and twice that by half of the
    error the smaller one counts there. Of the shipped wedge under 18 N, a tenth, a quarter, a half
    and three quarters of the error change the resonance by 0.3, 0.9, 1.7 and 2.6 %, all of it by
    24 %.

    Args:
        models: of the body as meshed.
        settings, top: of the resonance, and its highest point.
        mode: that is excited (1 = lowest).
    """
    whole = _change_on(softer, case, settings, top)
    known = [whole]
    doubtful = mostly_lifts_off(top) or (whole is not None and whole > DOUBTFUL_CHANGE)
    if doubtful and softer.half is not None:
        half = _change_on(softer.half, case, settings, top)
        known.append(None if half is None else 2 * half)
    changes = [change for change in known if change is not None]
    if changes:
        return min(changes)
    if not lifts_off(top):
        return np.inf
    # a damper that comes off holds little: the motion is nearly that of the free blade
    model = family_member(softer.family(case), settings).model
    meshed = family_member(models, settings).model
    return abs(_free_height(model, mode) / _free_height(meshed, mode) - 1)


def _change_on(
    softer: SofterBody,
    case: LoadCase,
    settings: Settings,
    top: Solution,
) -> float | None:
    """Relative change of a resonance amplitude; None where it was not solved."""
    model = family_member(softer.family(case), settings).model
    # fallbacks for a damper that comes off take longer than the whole curve, mostly in vain
    firm = not mostly_lifts_off(top)
    peak = changed_peak(model, settings, top, top.omega * softer.ratio, PEAK_TOLERANCE, firm)
    return None if peak is None else abs(peak.height / size(top) - 1)


def _free_height(model: ReducedModel, mode: int) -> float:
    """Amplitude of the blade without damper at its natural frequency [m]."""
    return float(abs(free_response(model, free_resonances(model)[mode - 1])[1, 0]))
