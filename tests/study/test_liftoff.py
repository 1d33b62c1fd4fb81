"""A failure under a light load says that the damper lifts off, with the load and the two lengths
that tell it.
"""

import numpy as np
import pytest

from bladefem.data import Elements, PortModel
from bladefem.errors import NotSolvedError
from bladefem.hbm.model import Damping, ReducedModel
from bladefem.study.pipeline.assemble_model import LoadCase
from bladefem.study.pipeline.liftoff import naming_the_load, seat_travel

OMEGA, RATIO, FORCE = 1000.0, 1e-3, 2.0
SHAPES = np.array(
    [[0.5, 0.1, 0.0], [0.4, 0.2, 0.1]]
)  # (normal, t1, t2) of two points in the only mode


def case_of(load: float, kn: float) -> tuple[LoadCase, ReducedModel]:
    elements = Elements(np.full(2, 1e6), np.full(2, kn), np.full(2, 0.3), np.full(2, load))
    ports = {"contact": slice(0, 6), "load": slice(6, 7), "probe": slice(7, 8)}
    side = PortModel(
        np.array([OMEGA]), np.r_[SHAPES.ravel(), 1.0, 1.0][:, None], np.zeros((8, 8)), ports
    )
    model = ReducedModel((side,), elements, {1: np.array([FORCE + 0j])}, Damping(ratio=RATIO))
    return LoadCase(load, elements, None), model


def test_travel_of_the_seats_is_that_of_the_mode():
    """One mode at its resonance: F phi_load phi_normal / (2 zeta omega^2)."""
    _, model = case_of(10.0, 1e6)
    assert seat_travel(model, 1, FORCE) == pytest.approx(
        FORCE * 0.5 / (2 * RATIO * OMEGA**2), rel=1e-12
    )
    assert seat_travel(case_of(10.0, 0.0)[1], 1, FORCE) == 0


@pytest.mark.parametrize(("load", "lifts"), [(1e-3, True), (1e5, False)])
def test_failures_name_the_load(load, lifts):
    case, model = case_of(load, 1e6)
    with (
        pytest.raises(
            NotSolvedError, match=r"study\.loads = .*N: .*line search stalled"
        ) as reported,
        naming_the_load(case, model, 1, FORCE),
    ):
        raise NotSolvedError("line search stalled")
    assert ("lifts off" in str(reported.value)) == lifts
    assert ("expected a larger load" in str(reported.value)) == lifts


@pytest.mark.parametrize(("band", "beside"), [((1.0, 2.0), True), ((150.0, 170.0), False)])
def test_a_band_without_the_resonance_is_named(band, beside):
    """The only resonance without damper is at 1000 rad/s = 159.15 Hz; the load is not to blame."""
    case, model = case_of(1e-3, 1e6)
    with (
        pytest.raises(NotSolvedError, match="search found no maximum") as reported,
        naming_the_load(case, model, 1, FORCE, band),
    ):
        raise NotSolvedError("search found no maximum")
    said = str(reported.value)
    assert ("study.band = 1 Hz, 2 Hz" in said and "159.15 Hz without damper" in said) == beside
    assert ("lifts off" in said) != beside
