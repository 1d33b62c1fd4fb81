"""One coarse sector for all tests of this folder."""

import pytest

from geometry.parameters import Aerofoil, Disc, MeshSize, Platform, Shank, Wedge
from geometry.sector import wedge_sector


@pytest.fixture(scope="session")
def coarse_sector():
    """Default wedge sector with large elements, about 6000 nodes."""
    size = MeshSize(size=7e-3)
    return wedge_sector(Aerofoil(), Platform(), Shank(), Disc(), Wedge(), size)
