"""Temperatures of a mesh's nodes from places and temperatures of other programs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator
from scipy.spatial import QhullError

from geometry.mesh import Mesh

from ..errors import InputError
from ..scene.temperature_file import GivenTemperatures
from ..util.arrays import IntegerArray, RealArray
from . import shape_functions as shape

# a node outside of the given places takes the nearest one's temperature up to this distance, as a
# share of the mesh's size
MAX_DISTANCE = 0.05
# extent of the places over the mesh's size: more is a slip of the unit
MAX_EXTENT = 50.0
# difference of the two cut faces, of the range of temperatures
MAX_CUT_DIFFERENCE = 0.05


def mesh_temperatures(mesh: Mesh, given: GivenTemperatures) -> RealArray:
    """(n_points,) temperatures [K] from those of places in the axes of the user's own file, or of
    nodes of it.

    Nodes that no temperature is given for, such as those in the middle of edges, take what lies
    between the others of their cells; a body of another file takes the temperatures next to it.

    Raises:
        InputError: as `interpolate_temperatures`, a number that the mesh does not have, nodes
            without temperature, or a mesh without numbers.
    """
    if given.places is not None:
        # a sector is turned about its axis, so that +x is midway between its cut faces
        places = given.places if mesh.turn is None else given.places @ mesh.turn.T
        return interpolate_temperatures(mesh, places, given.values)
    nodes = np.asarray(given.nodes)
    if mesh.numbers is None:
        raise InputError(
            "temperature.file: it gives temperatures of nodes, but the mesh file's numbers are not "
            "known (its reader drops them, instances repeat them, or the mesh was refined), "
            "expected places x, y, z"
        )
    order = np.argsort(mesh.numbers, kind="stable")
    row = np.searchsorted(mesh.numbers, nodes, sorter=order)
    row = order[np.minimum(row, len(order) - 1)]
    unknown = mesh.numbers[row] != nodes
    if unknown.any():
        raise InputError(
            f"temperature.file: the mesh has no node {nodes[unknown][0]} "
            f"({unknown.sum()} of {len(unknown)} are unknown), expected the numbers of "
            "imported.file"
        )
    found = np.full(len(mesh.points), np.nan)
    found[row] = given.values
    found = _filled_cells(mesh, found)
    for name, cells in mesh.bodies.items():
        nodes = np.unique(cells)
        if (mesh.numbers[nodes] < 0).all():
            # of a file of its own, whose numbers are not those of the first
            alone = replace(mesh, bodies={name: cells}, pairs={})
            near = interpolate_temperatures(alone, mesh.points[row], given.values)
            found[nodes] = near[nodes]
    bodies = _body_nodes(mesh)
    missing = bodies[np.isnan(found[bodies])]
    if len(missing):
        named = mesh.numbers[missing[mesh.numbers[missing] >= 0]]
        which = f", such as {named[0]}" if len(named) else ""
        raise InputError(
            f"temperature.file: {len(missing)} nodes of the bodies have no temperature{which}, "
            "expected those of all corners of the cells at least"
        )
    # reference nodes and the like: nothing depends on them
    found[np.isnan(found)] = given.values[0]
    _check_cut(mesh, found)
    return found


def _filled_cells(mesh: Mesh, known: RealArray) -> RealArray:
    """Temperatures (n_points,), NaN where unknown, with those of nodes whose cells know enough
    others: by a polynomial of second order in the cell, or of first order where only few are known.
    """
    place = shape.reference_nodes(mesh.cell_type)
    first = np.column_stack([np.ones(len(place)), place])
    pairs = np.triu_indices(place.shape[1])
    second = np.column_stack([first, place[:, pairs[0]] * place[:, pairs[1]]])
    total = np.zeros(len(known))
    count = np.zeros(len(known))
    for cells in mesh.bodies.values():
        unknown = np.isnan(known[cells])
        for pattern in np.unique(unknown[unknown.any(axis=1)], axis=0):
            some = cells[(unknown == pattern).all(axis=1)]
            # a fit needs more values than coefficients
            basis = second if (~pattern).sum() > second.shape[1] else first
            if (~pattern).sum() < basis.shape[1]:
                continue
            weights = basis[pattern] @ np.linalg.pinv(basis[~pattern])
            np.add.at(total, some[:, pattern], known[some[:, ~pattern]] @ weights.T)
            np.add.at(count, some[:, pattern], 1.0)
    with np.errstate(invalid="ignore"):
        return np.where(np.isnan(known), total / count, known)


def _body_nodes(mesh: Mesh) -> IntegerArray:
    return np.unique(np.concatenate([cells.ravel() for cells in mesh.bodies.values()]))


def interpolate_temperatures(mesh: Mesh, places: RealArray, values: RealArray) -> RealArray:
    """(n_points,) temperatures [K], linear between the given places.

    Args:
        places: (k, 3) [m], in the axes of the mesh.
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
    # points that no body has, such as reference nodes of a deck, may lie anywhere
    stray = np.setdiff1d(np.arange(len(found)), _body_nodes(mesh))
    outside[stray] = False
    found[stray] = np.where(np.isnan(found[stray]), values[0], found[stray])
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
            "from all given places, expected places throughout the body, in the axes of the "
            "body's file and with the right units"
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
