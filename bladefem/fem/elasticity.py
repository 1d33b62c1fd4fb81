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
from ..scene.tables import Material
from .compat import cell_dofs, dolfinx, scalar_space, ufl

# stress from strain, both (dim, dim) expressions of ufl
Law = Callable[[Any], Any]
VOIGT_PAIRS = ((0, 0), (1, 1), (2, 2), (1, 2), (2, 0), (0, 1))


def is_isotropic(material: Material) -> bool:
    """Two constants describe the material."""
    return material.G is None and material.orthotropic is None


def lame_parameters(
    material: Material,
    dim: int,
    plane: str,
) -> tuple[float, float]:
    """Lame's lambda [Pa] (its plane-stress substitute where asked) and shear modulus [Pa]."""
    E = material.E
    nu = material.nu
    mu = E / (2 * (1 + nu))
    lam = E * nu / ((1 + nu) * (1 - 2 * nu))
    if dim == 2 and plane == "stress":
        lam = 2 * mu * lam / (lam + 2 * mu)
    return lam, mu


def stiffness(material: Material) -> np.ndarray:
    """(6, 6) stresses of unit strains in the blade's axes [Pa].

    Raises:
        InputError: constants of a material that would give off energy.
    """
    flexibility = _material_flexibility(material)
    size = np.sqrt(np.abs(flexibility.diagonal()))
    if not np.linalg.eigvalsh(flexibility / np.outer(size, size)).min() > 0:
        raise InputError(
            "material: its elastic constants are not those of a stable material (a strain would "
            "give off energy), expected smaller Poisson's ratios"
        )
    return _turn_stiffness(np.linalg.inv(flexibility), crystal_rotation(material.angles))


def crystal_rotation(angles: tuple[float, float, float]) -> np.ndarray:
    """(3, 3) whose columns are the crystal's axes in the blade's axes."""
    total = np.eye(3)
    for axis, angle in enumerate(angles):
        a, b = (axis + 1) % 3, (axis + 2) % 3
        turn = np.eye(3)
        turn[a, a] = turn[b, b] = np.cos(angle)
        turn[a, b], turn[b, a] = -np.sin(angle), np.sin(angle)
        total = total @ turn
    return total


def elastic_law(
    mesh: Mesh,
    materials: dict[str, Material],
    domain: Any,
    plane: str,
) -> Law:
    """Stress from strain in every cell of this rank.

    Args:
        materials: one a body of the mesh, in the order of the cells of ``domain``.

    Raises:
        InputError: a plane mesh of an anisotropic material.
    """
    dim = mesh.dimension
    owner = material_numbers(mesh, materials, domain)
    if all(is_isotropic(material) for material in materials.values()):
        values = np.array(
            [lame_parameters(material, dim, plane) for material in materials.values()]
        )
        lam, mu = (cellwise_constant(domain, column[owner]) for column in values.T)
        return lambda strain: lam * ufl.tr(strain) * ufl.Identity(dim) + 2 * mu * strain
    if dim == 2:
        raise InputError(
            "material: a plane mesh needs an isotropic material, expected E and nu without G, "
            "orthotropic and angles"
        )
    matrices = np.array([stiffness(material) for material in materials.values()])
    C = np.empty((6, 6), dtype=object)
    for i in range(6):
        for j in range(i, 6):
            C[i, j] = C[j, i] = cellwise_constant(domain, matrices[owner, i, j])

    def law(strain: Any) -> Any:
        e = [strain[a, b] * (1 if a == b else 2) for a, b in VOIGT_PAIRS]
        s = [sum(C[i, j] * e[j] for j in range(6)) for i in range(6)]
        return ufl.as_tensor([[s[0], s[5], s[4]], [s[5], s[1], s[3]], [s[4], s[3], s[2]]])

    return law


def stress_of(
    material: Material,
    strain: np.ndarray,
    plane: str,
) -> np.ndarray:
    """(..., dim, dim) stress [Pa] of strains (..., dim, dim)."""
    dim = strain.shape[-1]
    if is_isotropic(material):
        lam, mu = lame_parameters(material, dim, plane)
        trace = np.trace(strain, axis1=-2, axis2=-1)
        return 2 * mu * strain + lam * trace[..., None, None] * np.eye(dim)
    e = np.stack([strain[..., a, b] * (1 if a == b else 2) for a, b in VOIGT_PAIRS], axis=-1)
    s = e @ stiffness(material)
    stress = np.empty_like(strain)
    for i, (a, b) in enumerate(VOIGT_PAIRS):
        stress[..., a, b] = stress[..., b, a] = s[..., i]
    return stress


def material_numbers(
    mesh: Mesh,
    materials: dict[str, Material],
    domain: Any,
) -> np.ndarray:
    """Number of the material of each cell of this rank."""
    owner = np.repeat(np.arange(len(materials)), [len(mesh.bodies[n]) for n in materials])
    return owner[np.asarray(domain.topology.original_cell_index)]


def cellwise_constant(domain: Any, values: np.ndarray) -> Any:
    """One value a cell of this rank; the compiled form stays the same for every material."""
    function = dolfinx.fem.Function(scalar_space(domain))
    function.x.array[cell_dofs(function.function_space)[:, 0]] = values
    return function


def _material_flexibility(material: Material) -> np.ndarray:
    """(6, 6) strains of unit stresses in the material's own axes [1/Pa]."""
    if material.orthotropic is None:
        shear = material.E / (2 * (1 + material.nu)) if material.G is None else material.G
        E: tuple[float, ...] = (material.E,) * 3
        nu: tuple[float, ...] = (material.nu,) * 3
        G: tuple[float, ...] = (shear,) * 3
    else:
        E = material.orthotropic[:3]
        nu = material.orthotropic[3:6]
        G = material.orthotropic[6:]
    if min(*E, *G) <= 0:
        raise InputError("material: its moduli must be positive, expected E and G above 0 Pa")
    S = np.diag([1 / E[0], 1 / E[1], 1 / E[2], 1 / G[2], 1 / G[1], 1 / G[0]])
    S[0, 1] = S[1, 0] = -nu[0] / E[0]
    S[0, 2] = S[2, 0] = -nu[1] / E[0]
    S[1, 2] = S[2, 1] = -nu[2] / E[1]
    return S


def _turn_stiffness(C: np.ndarray, R: np.ndarray) -> np.ndarray:
    """The same stiffness in axes in which the material's own are the columns of R."""
    full = np.empty((3, 3, 3, 3))
    for i, (a, b) in enumerate(VOIGT_PAIRS):
        for j, (c, d) in enumerate(VOIGT_PAIRS):
            full[a, b, c, d] = full[b, a, c, d] = full[a, b, d, c] = full[b, a, d, c] = C[i, j]
    turned = np.einsum("ia,jb,kc,ld,abcd->ijkl", R, R, R, R, full, optimize=True)
    return np.array([[turned[a, b, c, d] for c, d in VOIGT_PAIRS] for a, b in VOIGT_PAIRS])
