"""How much too stiff a mesh makes a body, seen by its modes.

The stiffness of a mode falls when the mesh may move in more ways. Here they are the displacements
of third order that the cells leave out (`cubic_functions`): what they take off while the nodes stay
where they are is the energy of a linear problem

    a(e, w) = omega^2 m(u, w) - a(u, w)      for all w of third order,

a hierarchical estimate (Bank and Smith 1993, doi:10.1137/0730048). The displacements are conforming
and held where the body is, so that a(e, e) is never above the true error of omega^2, however
stretched or distorted the cells; what is left out is made good by a factor. Nothing is recovered
from the stress: a field that is linear and continuous can still be wrong, like torsion of a bar
with one element across, whose free sides it loads.

As a bilinear form in the modes it says more than the error of their frequencies: subtracted from
the diagonal stiffness of the reduced model, it gives one whose deviation is the dual-weighted error
of any linear quantity that the modes carry, since Q(u) - Q(u_h) = a(u - u_h, z - z_h) with the dual
solution z (Becker and Rannacher 2001, doi:10.1017/S0962492901000010).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from geometry.topology import FAMILY
from geometry.whole_cells import OwnCells

from ..data import ModeSet
from ..errors import NotSolvedError
from ..scene.tables import Material
from ..util.arrays import BooleanArray, RealArray
from .body import Body
from .cell_functions import few_points, order_of, tabulate
from .cubic_functions import cubic_functions, functions_on, number_functions
from .elasticity import stress_of
from .rotating_forms import in_mesh_numbering
from .steady_state import SteadyState
from .stress import solved_cells
from .supports import POLAR_DIRECTIONS, held_directions
from .temperature import density_at, point_temperatures, strain_tensor_at

# true error over the energy, by the order of the cells. Of second order it is 1 to 1.5 for smooth
# shapes, 1.5 to 2 at clamps, 2.3 at re-entrant corners and up to 2.6 in cells as long as a wave; of
# first order 0.9 to 1.3 (`benchmarks/stiffness_error.py`)
FACTORS = {1: 1.3, 2: 2.0}
# of the stiffness: larger errors are reported as this
LARGEST_SHARE = 0.9
# energy that a step of the conjugate gradients adds, over that found, at which they end
TOLERANCE = 0.01
# the shipped sector takes 7; the functions are few in each cell, so that finer meshes take no more
MAX_STEPS = 500
# functions of third order at a time
FUNCTIONS_PER_BLOCK = 30_000
# of the matrices of cells, beyond which each step computes them again
MAX_BYTES_KEPT = 2e9


def stiffness_error(
    body: Body,
    shapes: np.ndarray,
    squares: RealArray,
    state: SteadyState | None = None,
) -> np.ndarray:
    """(m, m) Hermitian energies of the error, a(e_i, e_j), in the units of the modes' stiffness.

    For one mode of unit mass it is the estimated error of omega^2.

    Args:
        body: at rest.
        shapes: (m, n_points, dim or 3) displacements, real or complex.
        squares: (m,) of their circular frequencies [1/s^2]; 0 for static ones without load.
        state: about which they vibrate; None for the body at rest.
    """
    m = len(shapes)
    u = np.moveaxis(np.asarray(shapes)[:, :, : body.dim], 0, 2)
    squares = np.asarray(squares, float)
    if np.iscomplexobj(u):
        # real and imaginary parts as fields of their own
        u = np.concatenate([u.real, u.imag], axis=2)
        squares = np.concatenate([squares, squares])
    own = solved_cells(body)
    numbers = number_functions(own)
    blocks = [
        block
        for some, signs in zip(own, numbers.of_cells, strict=True)
        for block in _blocks_of(body, some, signs, state)
    ]
    pinned = _pinned(body, numbers.corners)
    force = sum(block.gather.T @ _unbalanced(block, u, squares) for block in blocks)
    force = np.where(pinned[:, :, None], 0.0, force.reshape(*pinned.shape, -1))
    energies = _energies(_Operator(blocks, pinned), force)
    if len(squares) > m:
        sums = energies[:m, :m] + energies[m:, m:]
        energies = sums + 1j * (energies[:m, m:] - energies[m:, :m])
    return FACTORS[max(order_of(some.word) for some in own)] * energies


def frequency_errors(body: Body, modes: ModeSet, state: SteadyState | None = None) -> np.ndarray:
    """(m,) estimated relative errors of the frequencies; NaN of rigid modes."""
    squares = (2 * np.pi * modes.frequencies) ** 2
    energies = stiffness_error(body, modes.shapes, squares, state).diagonal().real
    share = energies / np.where(squares > 0, squares, np.nan)
    return 1 / np.sqrt(1 - np.minimum(share, LARGEST_SHARE)) - 1


@dataclass(frozen=True)
class _Block:
    """Some cells of one shape and material."""

    body: Body
    material: Material
    state: SteadyState | None
    # meshio's
    word: str
    # (nc, k) nodes
    cells: np.ndarray
    # (nc * f, functions of the body) signs of the f functions of third order in each cell
    gather: sp.csr_matrix


class _Operator:
    """The stiffness of the functions of third order, by the matrices of cells."""

    def __init__(self, blocks: Sequence[_Block], pinned: BooleanArray) -> None:
        self.blocks = blocks
        self.free = ~pinned[:, :, None]
        self.matrices: list[np.ndarray] = []
        size = sum(block.gather.shape[0] ** 2 / len(block.cells) for block in blocks)
        keep = 4 * size * pinned.shape[1] ** 2 < MAX_BYTES_KEPT
        diagonal = np.zeros(pinned.shape)
        for block in blocks:
            matrix = _stiffness(block)
            own = np.einsum("cii->ci", matrix).reshape(-1, pinned.shape[1])
            diagonal += abs(block.gather).T @ own
            if keep:
                self.matrices.append(matrix)
        # functions along an edge that is held everywhere keep the cells' stiffness too
        self.scale = self.free / diagonal[:, :, None]

    def product(self, x: RealArray) -> RealArray:
        """(functions, dim, fields) forces of displacements."""
        functions, dim, fields = x.shape
        total = np.zeros((functions, dim * fields))
        for i, block in enumerate(self.blocks):
            matrix = self.matrices[i] if self.matrices else _stiffness(block)
            local = (block.gather @ x.reshape(functions, -1)).reshape(len(matrix), -1, fields)
            forces = matrix @ local.astype(matrix.dtype)
            total += block.gather.T @ forces.reshape(-1, dim * fields)
        return np.asarray(total.reshape(x.shape) * self.free)


def _energies(operator: _Operator, force: RealArray) -> RealArray:
    """(fields, fields) e_i . A e_j of the solutions e of A e = force (functions, dim, fields), by
    conjugate gradients that the diagonal scales.

    Raises:
        NotSolvedError: they came to no end; what they found until then would be too small.
    """
    solution = np.zeros_like(force)
    rest = force
    scaled = operator.scale * rest
    direction = scaled
    slope = (rest * scaled).sum(axis=(0, 1))
    found = np.zeros_like(slope)
    for _ in range(MAX_STEPS):
        image = operator.product(direction)
        step = _ratio(slope, (direction * image).sum(axis=(0, 1)))
        solution = solution + step * direction
        rest = rest - step * image
        found = found + step * slope
        if (step * slope <= TOLERANCE * found).all():
            break
        scaled = operator.scale * rest
        before = slope
        slope = (rest * scaled).sum(axis=(0, 1))
        direction = scaled + _ratio(slope, before) * direction
    else:
        raise NotSolvedError(
            f"estimated error of the mesh: {MAX_STEPS} conjugate gradients still add more than "
            f"{100 * TOLERANCE:g} % each; cells are far too distorted"
        )
    fields = force.shape[2]
    energies = solution.reshape(-1, fields).T @ (force - rest).reshape(-1, fields)
    return np.asarray(energies + energies.T) / 2


def _ratio(above: RealArray, below: RealArray) -> RealArray:
    """Quotients; 0 where nothing is left to divide by."""
    return np.divide(above, below, out=np.zeros_like(above), where=below > 0)


def _blocks_of(
    body: Body, own: OwnCells, signs: sp.csr_matrix, state: SteadyState | None
) -> Iterator[_Block]:
    """Cells of one shape and material, some at a time."""
    functions = signs.shape[0] // len(own.cells)
    count = len(own.cells) * functions // FUNCTIONS_PER_BLOCK + 1
    for some in np.array_split(np.arange(len(own.cells)), count):
        rows = signs[functions * some[0] : functions * (some[-1] + 1)]
        yield _Block(body, body.material[own.name], state, own.word, own.cells[some], rows)


def _pinned(body: Body, corners: np.ndarray) -> BooleanArray:
    """(functions, dim) true where supports hold a displacement, and on cut faces and springs, of
    which the estimate leaves the error out.

    Args:
        corners: of `cubic_functions.CubicNumbers`.
    """
    pinned = np.zeros((len(corners), body.dim), bool)
    for held in _held_sets(body):
        for axis in range(body.dim):
            pinned[:, axis] |= functions_on(corners, held[:, axis])
    return pinned


def _held_sets(body: Body) -> Iterator[BooleanArray]:
    """(n_points, dim) displacements held, one support, symmetry plane or cut face at a time."""
    known = {**body.mesh.faces, **body.mesh.nodes}
    every = np.ones(body.dim, bool)
    whole = [(name, every) for name in (body.hold, "cyclic_low", "cyclic_high")]
    for axis, letter in enumerate("xyz"[: body.dim]):
        across = np.arange(body.dim) == axis
        whole += [(f"symmetry_{letter}", across), (f"antisymmetry_{letter}", ~across)]
    for name, letters in body.directions:
        if set(letters) & set(POLAR_DIRECTIONS):
            whole.append((name, np.arange(body.dim) < 2))
        yield held_directions(body, [(name, letters)])
    for name, directions in whole:
        if name in known:
            held = np.zeros((len(body.mesh.points), body.dim), bool)
            held[np.ix_(np.unique(known[name]), directions)] = True
            yield held
    if body.spring is not None:
        yield in_mesh_numbering(body, body.spring.getDiagonal().array) > 0


@dataclass(frozen=True)
class _Points:
    """The points of a quadrature in cells."""

    # (q, k) of the cells' own shape functions
    values: np.ndarray
    # (q, f) of the functions of third order
    added: np.ndarray
    # (nc, q) [m^3]
    volume: np.ndarray
    # (nc, q, k, d) and (nc, q, f, d) gradients in space [1/m]
    slopes: np.ndarray
    added_slopes: np.ndarray
    # (nc, q) [K]
    temperature: np.ndarray | None


def _points_of(block: _Block) -> _Points:
    dim = block.body.dim
    at, weight = few_points(FAMILY[block.word])
    values, gradients = tabulate(block.word, at)
    added, added_gradients = cubic_functions(block.word, at)
    places = block.body.mesh.points[block.cells][:, None, :, :dim].swapaxes(2, 3)
    tangents = places @ gradients
    depth = block.body.mesh.depth if dim == 2 else 1.0
    back = np.linalg.inv(tangents)
    return _Points(
        values,
        added,
        np.abs(np.linalg.det(tangents)) * weight * depth,
        gradients @ back,
        added_gradients @ back,
        point_temperatures(block.body.heat, block.cells, values),
    )


def _unbalanced(block: _Block, u: RealArray, squares: RealArray) -> RealArray:
    """(nc * f, dim * fields) omega^2 m(u, w) - a(u, w) of the functions w in cells.

    Args:
        u: (n_points, dim, fields).
    """
    body = block.body
    dim = body.dim
    points = _points_of(block)
    count, q = points.volume.shape
    fields = u.shape[2]
    # (nc, k, dim * fields)
    local = u[block.cells].reshape(count, -1, dim * fields)
    # d u_i / d x_j as (nc, q, j * i, fields)
    slope = points.slopes.swapaxes(2, 3).reshape(count, q * dim, -1) @ local
    stress = _tangent(block, points) @ slope.reshape(count, q, dim**2, fields)
    weighted = (points.added_slopes * points.volume[..., None, None]).transpose(0, 2, 1, 3)
    force = -(weighted.reshape(count, -1, q * dim) @ stress.reshape(count, q * dim, dim * fields))
    moved = (points.values @ local).reshape(count, q, dim, fields)
    pull = squares * moved
    if block.state is not None:
        unit = np.asarray(block.state.axis) / np.linalg.norm(block.state.axis)
        across = (np.eye(3) - np.outer(unit, unit))[:dim, :dim]
        pull = pull + block.state.speed**2 * (across @ moved)
    mass = points.volume * density_at(block.material, points.temperature)
    force += points.added.T @ (mass[..., None, None] * pull).reshape(count, q, -1)
    return np.asarray(force.reshape(-1, dim * fields))


def _stiffness(block: _Block) -> np.ndarray:
    """(nc, f * dim, f * dim) matrices of the functions in cells, single precision; material and
    static state are the means over a cell.
    """
    dim = block.body.dim
    points = _points_of(block)
    count, q, functions, _ = points.added_slopes.shape
    flat = points.added_slopes.reshape(count, q, -1)
    products = (flat * points.volume[..., None]).swapaxes(1, 2) @ flat
    # (nc, a * b, j * l) integrals of dw_a / dx_j dw_b / dx_l
    products = products.reshape(count, functions, dim, functions, dim).transpose(0, 1, 3, 2, 4)
    tangent = _tangent(block, points, mean=True).mean(axis=1)
    # rows j * l, columns i * k
    law = tangent.reshape(-1, dim, dim, dim, dim).swapaxes(2, 3).reshape(-1, dim**2, dim**2)
    local = products.reshape(count, -1, dim**2) @ law
    local = local.reshape(count, functions, functions, dim, dim).transpose(0, 1, 3, 2, 4)
    return local.reshape(count, functions * dim, -1).astype(np.float32)


def _tangent(block: _Block, points: _Points, mean: bool = False) -> RealArray:
    """(nc or 1, q or 1, dim * dim, dim * dim) first Piola stress P_ij, rows j * i, by displacement
    gradients d u_k / d x_l, columns l * k [Pa].

    With the deformation gradient F and the second Piola stress S of the static state it is
    P = F C : sym(F^T grad u) + (grad u) S.

    Args:
        mean: one static state for a cell.
    """
    dim = block.body.dim
    units = np.eye(dim**2).reshape(dim, dim, 1, 1, dim, dim)
    strain = (units + units.swapaxes(4, 5)) / 2
    stress = stress_of(block.material, strain, block.body.plane, points.temperature)
    # (nc or 1, q or 1, i, k, j, l)
    law = stress.transpose(2, 3, 4, 0, 5, 1)
    if block.state is not None:
        turn, static = _static(block, block.state, points)
        if mean:
            turn, static = (x.mean(axis=1, keepdims=True) for x in (turn, static))
        # matrix products: einsum takes several times as long
        for _ in range(2):
            turned = turn @ law.reshape(*law.shape[:2], dim, -1)
            law = turned.reshape(*turned.shape[:2], dim, dim, dim, dim).swapaxes(2, 3)
        for i in range(dim):
            law[:, :, i, i] += static
    return law.transpose(0, 1, 4, 2, 5, 3).reshape(*law.shape[:2], dim**2, dim**2)


def _static(block: _Block, state: SteadyState, points: _Points) -> tuple[RealArray, RealArray]:
    """(nc, q, dim, dim) deformation gradient and second Piola stress [Pa] of the static state."""
    body = block.body
    slope = state.displacement[block.cells][:, None].swapaxes(2, 3) @ points.slopes
    strain = (slope + slope.swapaxes(2, 3)) / 2
    if state.large:
        strain = strain + slope.swapaxes(2, 3) @ slope / 2
    if body.heat is not None and body.heat.strains:
        assert points.temperature is not None
        free = strain_tensor_at(block.material, body.heat, points.temperature, body.dim)
        strain = strain - (free + free @ free / 2 if state.large else free)
    stress = stress_of(block.material, strain, body.plane, points.temperature)
    return np.eye(body.dim) + slope, stress
