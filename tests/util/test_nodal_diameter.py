"""Engine orders fold to nodal diameters."""

import numpy as np
import pytest

from bladefem.util.nodal_diameter import excited_diameter


@pytest.mark.parametrize(
    ("order", "sectors", "diameter"),
    [(6, 36, 6), (30, 36, 6), (36, 36, 0), (18, 36, 18), (43, 36, 7), (0, 12, 0), (3, 5, 2)],
)
def test_engine_orders_fold_to_nodal_diameters(order, sectors, diameter):
    assert excited_diameter(order, sectors) == diameter


@pytest.mark.parametrize("sectors", [1, 2, 7, 12])
def test_it_is_the_distance_from_a_multiple_of_the_sectors(sectors):
    """Of one order and of several at once, counted out."""
    orders = np.arange(60)
    counted = [min(abs(k - m * sectors) for m in range(61)) for k in range(60)]
    assert excited_diameter(orders, sectors).tolist() == counted
    assert [excited_diameter(k, sectors) for k in range(60)] == counted
