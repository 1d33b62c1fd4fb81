"""What blades see of the modes of their ring, against the matrix of all of them."""

from dataclasses import replace

import numpy as np
import pytest
from models import bouncing

from bladefem.hbm.ring_contacts import in_places, places_of_directions
from bladefem.hbm.ring_readings import displacements, modal_forces, ring_readings
from bladefem.hbm.sector_modes import sector_modes


@pytest.mark.parametrize("blades", [1, 2, 3, 4, 5])
def test_modes_sorted_by_how_they_turn_are_read_as_by_the_matrix(blades):
    alone = bouncing()
    body = alone.sides[0]
    phases = np.exp(2j * np.pi / blades * np.arange(2 * blades + 1))
    # the second and the third mode are seen with the phase of the wave, and with its opposite
    sides = tuple(
        replace(body, shapes=body.shapes * np.array([1.0, phase, phase.conjugate()]))
        for phase in phases
    )
    system = sector_modes(alone if blades == 1 else replace(alone, sides=sides))
    assert system.blades == blades
    places = places_of_directions(1, 3)
    readings = ring_readings(system, places)
    # of r blades the nodal diameters 0 to r/2, those between with two modes
    assert len(readings.parts) == blades
    rng = np.random.default_rng(0)
    q = rng.standard_normal(len(system.stiffness))
    seen = (system.contact @ q).reshape(blades, -1)
    assert displacements(readings, q) == pytest.approx(
        in_places(seen, places), rel=1e-12, abs=1e-15
    )
    forces = rng.standard_normal((blades, 3))
    found = modal_forces(readings, in_places(forces, places))
    assert found == pytest.approx(system.contact.T @ forces.ravel(), rel=1e-12, abs=1e-15)
