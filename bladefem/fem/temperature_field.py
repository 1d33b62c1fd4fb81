"""Temperatures of a mesh's nodes from places and temperatures of other programs."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator
from scipy.spatial import QhullError

from geometry.mesh import Mesh

from ..errors import InputError
from ..util.arrays import RealArray

# a node outside of the given places takes the nearest one's temperature up to this distance, as a
# share of the mesh's size
MAX_DISTANCE = 0.05
# extent of the places over the mesh's size: more is a slip of the unit
MAX_EXTENT = 50.0
# difference of the two cut faces, of the range of temperatures
MAX_CUT_DIFFERENCE = 0.05


def interpolate_temperatures(mesh: Mesh, places: RealArray, values: RealArray) -> RealArray:
    """(n_points,) temperatures [K], linear between the given places.

    Args:
        places: (k, 3) [m].
        values: (k,) [K].

    Raises:
        InputError: the places span no volume (no area of a plane mesh), a node is far from all of
            them, or the two cut faces of a sector differ.
    """
    d = mesh.dimension
    x = mesh.points[:, :d]
    # cells round the origin of the places: Delaunay's own tolerances are absolute
    size = float(np.ptp(x, axis=0).max())
    origin = x.mean(axis=0)
    given = (places[:, :d] - origin) / size
    at = (x - origin) / size
    if np.ptp(given, axis=0).max() > MAX_EXTENT:
        raise InputError(
            f"temperature.file: its places extend over {np.ptp(places, axis=0).max():.3g} m, the "
            f"mesh over {size:.3g} m, expected about the same; are the units of x, y, z right?"
        )
    try:
        found = LinearNDInterpolator(given, values)(at)
    except (QhullError, ValueError):
        kind = "an area" if d == 2 else "a volume"
        raise InputError(
            f"temperature.file: its {len(values)} places do not span {kind}, expected places "
            "throughout the body"
        ) from None
    outside = np.isnan(found)
    if outside.any():
        found[outside] = _nearest(mesh.points[outside], at[outside], given, values, size)
    _check_cut(mesh, found)
    return np.asarray(found)


def _nearest(
    nodes: RealArray,
    at: RealArray,
    given: RealArray,
    values: RealArray,
    size: float,
) -> RealArray:
    """Temperatures [K] of the nearest given places, which must not be far.

    Args:
        nodes: (m, 3) [m], for the message.
        at, given: nodes (m, d) and places (k, d) over the mesh's size [m].
    """
    nearest = NearestNDInterpolator(given, values)
    distance, _ = nearest.tree.query(at)
    if distance.max() > MAX_DISTANCE:
        node = np.array2string(nodes[distance.argmax()], precision=4)
        raise InputError(
            f"temperature.file: the node at {node} m is {1e3 * size * distance.max():.3g} mm away "
            "from all given places, expected places throughout the body, in the mesh's axes and "
            "with the right units"
        )
    return np.asarray(nearest(at))


def _check_cut(mesh: Mesh, temperature: RealArray) -> None:
    """Nodes of the two cut faces are the same places of neighbouring sectors."""
    if "cyclic" not in mesh.pairs or not mesh.pairs["cyclic"].nodes.size:
        return
    low, high = mesh.pairs["cyclic"].nodes
    largest = np.abs(temperature[low] - temperature[high]).max()
    if largest > MAX_CUT_DIFFERENCE * max(np.ptp(temperature), 1.0):
        raise InputError(
            f"temperature.file: the two cut faces of the sector differ by up to {largest:.3g} K, "
            "expected the same temperatures, since all sectors are equally hot"
        )
