"""Linear elasticity: isotropic, cubic and orthotropic with an orientation, for forms and for
arrays.

Stresses and strains in six components are ordered xx, yy, zz, yz, zx, xy with engineering shear.
A cubic crystal has three constants (E along its edges, nu, G), an orthotropic solid nine. Its axes
are those of the blade (x radial, z along the engine) turned by ``material.angles`` about x, then
about the new y, then about the new z.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from geometry.mesh import Mesh

from ..errors import InputError
from ..scene.material_table import property_at
from ..scene.tables import Material
from .compat import ufl
from .temperature import (
    Temperatures,
    cell_temperatures,
    crystal_rotation,
    evaluate_materials,
    form_coefficient,
    material_numbers,
)

# stress from strain, both (dim, dim) expressions of ufl
Law = Callable[[Any], Any]
# axes of the six components in Voigt's order, of stiffness matrices: shear yz, zx, xy; stresses
# are written in the order of stress.OUTPUT_PAIRS
STIFFNESS_PAIRS = ((0, 0), (1, 1), (2, 2), (1, 2), (2, 0), (0, 1))


def is_isotropic(material: Material) -> bool:
    """Two constants describe the material."""
    return material.G is None and material.orthotropic is None


def lame_parameters(
    material: Material,
    dim: int,
    plane: str,
    temperature: np.ndarray | None = None,
) -> np.ndarray:
    """(..., 2) Lame's lambda [Pa] (its plane-stress substitute where asked) and shear modulus [Pa],
    at temperatures (...) [K].
    """
    E = property_at(material, "E", temperature)
    nu = property_at(material, "nu", temperature)
    mu = E / (2 * (1 + nu))
    lam = E * nu / ((1 + nu) * (1 - 2 * nu))
    if dim == 2 and plane == "stress":
        lam = 2 * mu * lam / (lam + 2 * mu)
    return np.stack([lam, mu], axis=-1)


def stiffness(material: Material, temperature: np.ndarray | None = None) -> np.ndarray:
    """(..., 6, 6) stresses of unit strains in the blade's axes [Pa], at temperatures (...) [K].

    Raises:
        InputError: constants of a material that would give off energy.
    """
    flexibility = _material_flexibility(material, temperature)
    size = np.sqrt(np.abs(np.diagonal(flexibility, axis1=-2, axis2=-1)))
    scaled = flexibility / (size[..., :, None] * size[..., None, :])
    # a rank may have no cells of a material, and then no temperatures of it
    if not (np.linalg.eigvalsh(scaled) > 0).all():
        raise InputError(
            "material: its elastic constants are not those of a stable material (a strain would "
            "give off energy), expected smaller Poisson's ratios"
        )
    return _turn_stiffness(np.linalg.inv(flexibility), crystal_rotation(material.angles))


def elastic_law(
    mesh: Mesh,
    materials: dict[str, Material],
    domain: Any,
    plane: str,
    heat: Temperatures | None = None,
    degree: int = 0,
) -> Law:
    """Stress from strain in every cell of this rank.

    Args:
        materials: one a body of the mesh, in the order of the cells of ``domain``.
        degree: of the quadrature, where temperatures vary.

    Raises:
        InputError: a plane mesh of an anisotropic material.
    """
    dim = mesh.dimension
    owner = material_numbers(mesh, materials, domain)
    temperature = cell_temperatures(mesh, materials, domain, heat, degree)
    if all(is_isotropic(material) for material in materials.values()):
        values = evaluate_materials(
            materials,
            owner,
            temperature,
            lambda m, t: _with_point_axes(lame_parameters(m, dim, plane, t), t, 1),
        )
        lam, mu = (form_coefficient(domain, values[..., i], degree) for i in range(2))
        return lambda strain: lam * ufl.tr(strain) * ufl.Identity(dim) + 2 * mu * strain
    if dim == 2:
        raise InputError(
            "material: a plane mesh needs an isotropic material, expected E and nu without G, "
            "orthotropic and angles"
        )
    matrices = evaluate_materials(
        materials, owner, temperature, lambda m, t: _with_point_axes(stiffness(m, t), t, 2)
    )
    C = np.empty((6, 6), dtype=object)
    for i in range(6):
        for j in range(i, 6):
            C[i, j] = C[j, i] = form_coefficient(domain, matrices[..., i, j], degree)

    def law(strain: Any) -> Any:
        e = [strain[a, b] * (1 if a == b else 2) for a, b in STIFFNESS_PAIRS]
        s = [sum(C[i, j] * e[j] for j in range(6)) for i in range(6)]
        return ufl.as_tensor([[s[0], s[5], s[4]], [s[5], s[1], s[3]], [s[4], s[3], s[2]]])

    return law


def stress_of(
    material: Material,
    strain: np.ndarray,
    plane: str,
    temperature: np.ndarray | None = None,
) -> np.ndarray:
    """(..., dim, dim) stress [Pa] of strains (..., dim, dim), at temperatures [K] that broadcast
    with (...).
    """
    dim = strain.shape[-1]
    if is_isotropic(material):
        constants = lame_parameters(material, dim, plane, temperature)[..., None, None, :]
        trace = np.trace(strain, axis1=-2, axis2=-1)[..., None, None]
        return 2 * constants[..., 1] * strain + constants[..., 0] * trace * np.eye(dim)
    e = np.stack([strain[..., a, b] * (1 if a == b else 2) for a, b in STIFFNESS_PAIRS], axis=-1)
    C = stiffness(material, temperature)
    s = e @ C if C.ndim == 2 else (e[..., None, :] @ C)[..., 0, :]
    stress = np.empty_like(strain)
    for i, (a, b) in enumerate(STIFFNESS_PAIRS):
        stress[..., a, b] = stress[..., b, a] = s[..., i]
    return stress


def _with_point_axes(values: np.ndarray, temperature: np.ndarray | None, axes: int) -> np.ndarray:
    """Values repeated at each temperature: the axes of the temperatures, then their own last
    ``axes``.
    """
    if temperature is None:
        return values
    return np.broadcast_to(values, (*temperature.shape, *values.shape[values.ndim - axes :]))


def _material_flexibility(material: Material, temperature: np.ndarray | None) -> np.ndarray:
    """(..., 6, 6) strains of unit stresses in the material's own axes [1/Pa]."""
    E, nu, G = _engineering_constants(material, temperature)
    if (E <= 0).any() or (G <= 0).any():
        raise InputError("material: its moduli must be positive, expected E and G above 0 Pa")
    S = np.zeros((*E.shape[:-1], 6, 6))
    for i in range(3):
        S[..., i, i] = 1 / E[..., i]
        S[..., 3 + i, 3 + i] = 1 / G[..., 2 - i]
    for row, (i, j) in enumerate(((0, 1), (0, 2), (1, 2))):
        S[..., i, j] = S[..., j, i] = -nu[..., row] / E[..., i]
    return S


def _engineering_constants(
    material: Material, temperature: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(..., 3) of E1, E2, E3; nu12, nu13, nu23; G12, G13, G23."""
    if material.orthotropic is not None:
        nine = property_at(material, "orthotropic", temperature)
        return nine[..., :3], nine[..., 3:6], nine[..., 6:]
    E = property_at(material, "E", temperature)
    nu = property_at(material, "nu", temperature)
    G = E / (2 * (1 + nu)) if material.G is None else property_at(material, "G", temperature)
    E, nu, G = np.broadcast_arrays(E, nu, G)
    thrice = np.ones(3)
    return E[..., None] * thrice, nu[..., None] * thrice, G[..., None] * thrice


def _turn_stiffness(C: np.ndarray, R: np.ndarray) -> np.ndarray:
    """(..., 6, 6) stiffness C [Pa] turned from the material's axes, which are the columns of R."""
    full = np.empty((*C.shape[:-2], 3, 3, 3, 3))
    for i, (a, b) in enumerate(STIFFNESS_PAIRS):
        for j, (c, d) in enumerate(STIFFNESS_PAIRS):
            for k, m in ((a, b), (b, a)):
                full[..., k, m, c, d] = full[..., k, m, d, c] = C[..., i, j]
    turned = np.einsum("ia,jb,kc,ld,...abcd->...ijkl", R, R, R, R, full, optimize=True)
    rows = [
        np.stack([turned[..., a, b, c, d] for c, d in STIFFNESS_PAIRS], -1)
        for a, b in STIFFNESS_PAIRS
    ]
    return np.stack(rows, axis=-2)
