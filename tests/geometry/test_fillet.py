"""The fillet that is drawn where a scene leaves its radius open."""

from dataclasses import replace

import pytest

from bladefem.errors import InputError
from geometry.fillet import with_fillet
from geometry.parameters import Aerofoil, Disc, MeshSize, Platform, Shank, Wedge
from geometry.sector_check import check_sector

PARTS = (Platform(), Shank(), Disc(), Wedge())


def radius(blade=None, platform=None, **size):
    parts = (platform or PARTS[0], *PARTS[1:])
    return with_fillet(blade or Aerofoil(), *parts, MeshSize(**size)).fillet


def test_default_is_a_share_of_the_root_thickness():
    """0.3 of 14 % of 50 mm."""
    assert radius() == pytest.approx(0.3 * 0.14 * 50e-3)
    assert radius(Aerofoil(fillet=1e-3)) == 1e-3
    assert radius(Aerofoil(fillet=0.0)) == 0.0


def test_large_elements_see_a_sharp_edge():
    """A factor on all sizes changes nothing: refinement studies have one shape."""
    assert radius(size=4.1e-3) > 0
    assert radius(size=4.3e-3) == 0
    assert radius(size=4.1e-3, scale=3.0) == radius(size=4.1e-3, scale=0.5) == radius()


def test_fillet_stays_on_the_platform():
    """Less platform, less fillet: the largest that is not refused."""
    shorter = replace(PARTS[0], length=57.5e-3)
    found = radius(platform=shorter)
    assert 0.6e-3 < found < 2.1e-3
    check_sector(Aerofoil(fillet=found), shorter, *PARTS[1:])
    with pytest.raises(InputError, match="overhangs the platform axially"):
        check_sector(Aerofoil(fillet=found + 1e-5), shorter, *PARTS[1:])
    # less than a third of the wanted radius would be left
    assert radius(platform=replace(PARTS[0], length=55.5e-3)) == 0
