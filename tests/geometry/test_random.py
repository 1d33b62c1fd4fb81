"""Random parameter sets give a valid mesh or one line that names a field;
benchmarks/random_geometry.py does 200.
"""

import re
from dataclasses import replace

import numpy as np
import pytest

from bladefem.errors import InputError
from geometry.parameters import Aerofoil, Disc, MeshSize, Plane, Platform, Shank, Wedge
from geometry.plane import plane_blades
from geometry.sampling import anywhere, around
from geometry.sector import wedge_sector

TABLES = (Aerofoil, Platform, Shank, Disc, Wedge)
FIELD = re.compile(r"(aerofoil|platform|shank|disc|damper|mesh|plane)\b")


def valid_or_named(build):
    """True for a mesh."""
    try:
        mesh = build()
    except InputError as error:
        assert FIELD.search(str(error)) and "\n" not in str(error)
        return False
    assert mesh.report["min scaled jacobian"] > 0
    for pair in mesh.pairs.values():
        image = mesh.points[pair.nodes[0]] @ pair.rotation.T + pair.shift
        np.testing.assert_allclose(
            mesh.points[pair.nodes[1]], image, atol=1e-12 * np.abs(mesh.points).max()
        )
    return True


@pytest.mark.parametrize("number", range(6))
def test_sectors_round_the_defaults(number):
    rng = np.random.default_rng((7, number))
    aerofoil, platform, shank, disc, wedge = (around(t(), rng, 0.1) for t in TABLES)
    shank = replace(shank, length=min(shank.length, disc.width, platform.length))
    valid_or_named(
        lambda: wedge_sector(aerofoil, platform, shank, disc, wedge, MeshSize(size=8e-3))
    )


@pytest.mark.parametrize("number", range(6))
def test_sectors_anywhere_in_the_ranges(number):
    rng = np.random.default_rng((8, number))
    valid_or_named(lambda: wedge_sector(*(anywhere(t, rng) for t in TABLES), MeshSize()))


def test_plane_blades():
    rng = np.random.default_rng(9)
    assert any(
        [
            valid_or_named(lambda: plane_blades(around(Plane(), rng, 0.2), MeshSize()))
            for _ in range(12)
        ]
    )
