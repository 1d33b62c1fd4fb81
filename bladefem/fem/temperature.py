"""Temperatures of the nodes: properties of the materials in the cells, and thermal strain.

The temperature varies in a cell as its shape functions say. Properties are those of the quadrature
points; where all nodes are equally hot, one value a cell serves.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from geometry.mesh import Mesh

from ..errors import InputError
from ..scene.material_table import expands_by_axes, property_at
from ..scene.tables import Material
from ..util.arrays import IntegerArray, RealArray
from . import shape_functions as shape
from .compat import cell_dofs, dolfinx, quadrature_space, scalar_space


@dataclass(frozen=True)
class Temperatures:
    """How hot a mesh is."""

    # (n_points,) [K]
    nodal: RealArray
    # [K] without thermal strain
    reference: float

    @cached_property
    def varies(self) -> bool:
        """Nodes differ."""
        return bool(np.ptp(self.nodal) > 0)

    @cached_property
    def strains(self) -> bool:
        """Some node is not at reference temperature."""
        return bool((self.nodal != self.reference).any())


def crystal_rotation(angles: tuple[float, float, float]) -> RealArray:
    """(3, 3) whose columns are the crystal's axes in the blade's axes."""
    total = np.eye(3)
    for axis, angle in enumerate(angles):
        a, b = (axis + 1) % 3, (axis + 2) % 3
        turn = np.eye(3)
        turn[a, a] = turn[b, b] = np.cos(angle)
        turn[a, b], turn[b, a] = -np.sin(angle), np.sin(angle)
        total = total @ turn
    return total


def material_numbers(
    mesh: Mesh,
    materials: dict[str, Material],
    domain: Any,
) -> IntegerArray:
    """Number of the material of each cell of this rank."""
    owner = np.repeat(np.arange(len(materials)), [len(mesh.bodies[n]) for n in materials])
    return owner[np.asarray(domain.topology.original_cell_index)]


def cell_temperatures(
    mesh: Mesh,
    materials: dict[str, Material],
    domain: Any,
    heat: Temperatures | None,
    degree: int,
) -> RealArray | None:
    """Temperatures [K] of the cells of this rank: (nc,) where all nodes are equally hot, else
    (nc, q) at the quadrature points of a degree; None without temperatures.
    """
    if heat is None:
        return None
    origin = np.asarray(domain.topology.original_cell_index)
    if not heat.varies:
        return np.full(len(origin), heat.nodal[0])
    cells = np.concatenate([mesh.bodies[name] for name in materials])[origin]
    _, points = quadrature_space(domain, degree)
    values, _ = shape.tabulate(mesh.cell_type, points)
    return np.asarray(heat.nodal[cells] @ values.T)


def point_temperatures(
    heat: Temperatures | None, cells: IntegerArray, values: RealArray
) -> RealArray | None:
    """(nc, q) temperatures [K] of cells (nc, k) where the shape functions have values (q, k)."""
    return None if heat is None else np.asarray(heat.nodal[cells] @ values.T)


def evaluate_materials(
    materials: dict[str, Material],
    owner: IntegerArray,
    temperature: RealArray | None,
    compute: Callable[[Material, RealArray | None], RealArray],
) -> RealArray:
    """(nc, ...) values that ``compute`` gives for the material and temperatures of each cell.

    Args:
        compute: from temperatures (...) to values (..., *axes of one point); without temperatures
            to those of one point.
    """
    found = [
        (owner == i, compute(material, None if temperature is None else temperature[owner == i]))
        for i, material in enumerate(materials.values())
    ]
    before = 0 if temperature is None else temperature.ndim
    size = owner.shape if temperature is None else temperature.shape
    out = np.empty((*size, *found[0][1].shape[before:]))
    for mine, part in found:
        out[mine] = part
    return out


def form_coefficient(
    domain: Any,
    values: RealArray,
    degree: int,
) -> Any:
    """A function of forms from one value a cell (nc,) or from values at the quadrature points of a
    degree (nc, q); the compiled form stays the same for every material.
    """
    space = scalar_space(domain) if values.ndim == 1 else quadrature_space(domain, degree)[0]
    function = dolfinx.fem.Function(space)
    rows = cell_dofs(space)
    function.x.array[rows if values.ndim == 2 else rows[:, 0]] = values
    return function


def density_at(material: Material, temperature: RealArray | None) -> RealArray:
    """Density [kg/m^3] at temperatures (...) [K]."""
    rho = property_at(material, "rho", temperature)
    return rho if temperature is None else np.broadcast_to(rho, temperature.shape)


def strain_at(
    material: Material,
    heat: Temperatures,
    temperature: RealArray,
) -> RealArray:
    """(...) thermal strain [1], the same in all directions, at temperatures (...) [K].

    Raises:
        InputError: the material's expansion is not known.
    """
    expansion = property_at(material, "expansion", temperature)
    if not np.isfinite(expansion).all():
        raise InputError("material: its expansion is missing, expected it with a temperature")
    strain = expansion * (temperature - heat.reference)
    return np.broadcast_to(strain, temperature.shape)


def strain_tensor_at(
    material: Material,
    heat: Temperatures,
    temperature: RealArray,
    dim: int,
) -> RealArray:
    """(..., dim, dim) thermal strain [1] in the blade's axes at temperatures (...) [K].

    Raises:
        InputError: the material's expansion is not known, or that of axes in a plane mesh.
    """
    temperature = np.asarray(temperature)
    if not expands_by_axes(material):
        return strain_at(material, heat, temperature)[..., None, None] * np.eye(dim)
    if dim == 2:
        raise InputError(
            "material.expansion_axes: a plane mesh has no axes of a crystal, expected expansion"
        )
    axes = crystal_rotation(material.angles)
    own = property_at(material, "expansion_axes", temperature)
    own = own * (temperature - heat.reference)[..., None]
    return np.asarray((axes * own[..., None, :]) @ axes.T)
