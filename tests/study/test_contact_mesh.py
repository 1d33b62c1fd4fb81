"""What the nodes of the contact mesh leave of an amplitude, against a closed form."""

import numpy as np
import pytest

from bladefem.data import Elements
from bladefem.hbm.model import ReducedModel
from bladefem.hbm.peak import find_peak
from bladefem.hbm.solution import size
from bladefem.reduction.matrices import port_model_from_matrices
from bladefem.study.adaptive.contact_mesh import halved_change
from bladefem.study.adaptive.family import Family, Member
from bladefem.study.adaptive.settings import Settings

# of each of two seats
NODES = 24
# damping of the mass, and relative stiffness of contacts that too few points have too much, times
# their number
DAMPING, EXCESS = 0.02, 1.5


def stiffness(points: float) -> float:
    """Of the mass with so many points a seat: its own, and that of its contacts, which stick."""
    return 1.0 + 0.5 * (1 + EXCESS / points)


def height(points: float) -> float:
    """Largest amplitude of a mass under a unit force."""
    return 1 / (DAMPING * np.sqrt(stiffness(points) - DAMPING**2 / 4))


def built(settings: Settings) -> Member:
    points = min(settings.points or NODES, NODES)
    count = 2 * points
    ports = {"contact": [0, 1, 2] * count, "load": [0], "probe": [0]}
    body = port_model_from_matrices(np.eye(3), np.eye(3), ports, C=DAMPING * np.eye(3))
    kt = (stiffness(points) - 1) / count
    parts = Elements(*(np.full(count, x) for x in (kt, kt, 0.5, 1e6)), tangents=2)
    model = ReducedModel((body,), parts, {1: np.array([1.0])})
    return Member(model, np.repeat(np.arange(count), NODES // points))


@pytest.mark.parametrize(
    ("points", "half", "share"),
    [(None, 12, 1.0), (24, 12, 1.0), (12, 6, 0.5), (8, 4, 1 / 3)],
)
def test_few_points_tell_what_all_nodes_leave(points, half, share):
    """Without that half as many points as nodes reported half of their error."""
    used = points or NODES
    family, settings = Family(built, 1), Settings(1, 1, 64, "rigid", points)
    top = find_peak(built(settings).model, np.sqrt(stiffness(used)), 1, 64, tolerance=1e-4)
    assert size(top.solution) == pytest.approx(height(used), rel=1e-4)
    told = halved_change(family, settings, top.solution)
    assert told == pytest.approx(share * abs(height(half) / height(used) - 1), rel=0.02)
    # as the balance compares points with all nodes
    balance = abs(height(NODES) / height(used) - 1)
    truth = abs(height(np.inf) / height(used) - 1)
    assert 0.85 * truth < balance + told < 1.3 * truth


@pytest.mark.parametrize("points", [6, 3, 1])
def test_points_that_four_times_as_many_judge_need_no_more(points):
    family, settings = Family(built, 1), Settings(1, 1, 64, "rigid", points)
    top = find_peak(built(settings).model, np.sqrt(stiffness(points)), 1, 64, tolerance=1e-4)
    assert np.isnan(halved_change(family, settings, top.solution))
    judged = abs(height(4 * points) / height(points) - 1)
    assert judged > 0.5 * abs(height(np.inf) / height(points) - 1)
