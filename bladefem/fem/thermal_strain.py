"""Thermal strain of a body at its temperatures, as a function of forms."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..scene.material_table import expands_by_axes
from .body import Body
from .compat import dolfinx, ufl
from .temperature import (
    cell_temperatures,
    evaluate_materials,
    form_coefficient,
    material_numbers,
    strain_at,
    strain_tensor_at,
)


def has_thermal_strain(body: Body) -> bool:
    """Some of the body is not at reference temperature."""
    return body.heat is not None and body.heat.strains


def thermal_strain(body: Body, degree: int) -> Any:
    """(dim, dim) thermal strain [1] at the quadrature points of a degree, as a function of forms; 0
    without temperatures.
    """
    domain = body.space.mesh
    heat = body.heat
    temperature = cell_temperatures(body.mesh, body.material, domain, heat, degree)
    if heat is None or temperature is None or not heat.strains:
        return dolfinx.fem.Constant(domain, 0.0) * ufl.Identity(body.dim)
    owner = material_numbers(body.mesh, body.material, domain)
    if not any(expands_by_axes(material) for material in body.material.values()):
        values = evaluate_materials(
            body.material, owner, temperature, lambda m, t: strain_at(m, heat, np.asarray(t))
        )
        return form_coefficient(domain, values, degree) * ufl.Identity(body.dim)
    tensors = evaluate_materials(
        body.material,
        owner,
        temperature,
        lambda m, t: strain_tensor_at(m, heat, np.asarray(t), body.dim),
    )
    axes = range(body.dim)
    parts = {
        (i, j): form_coefficient(domain, tensors[..., i, j], degree)
        for i in axes
        for j in axes
        if i <= j
    }
    return ufl.as_tensor([[parts[min(i, j), max(i, j)] for j in axes] for i in axes])
