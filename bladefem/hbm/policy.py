"""The way a point is solved: every size at which one method takes over from another, and the
choice.

Four ways lead to the same solution, the cheapest that applies is taken:

1. compiled point: linear part, Newton and works of a small model in one compiled call;
2. compiled Newton: the same kernels one after the other, for more contacts or another start;
3. NumPy Newton with a dense LU of the Jacobian (other 2-D elements and friction laws, few
unknowns);
4. NumPy Newton with iterations (conjugate residuals, then GMRES), dense LU where they fail.

NumPy Newton keeps the loop; an evaluation of 2-D Coulomb elements and the halvings of a step are
one compiled call all the same (`bladefem.hbm.solver.balance_2d`).

`Solution.route` says which one ran. Sizes count contact degrees of freedom (nodes times directions)
or unknowns (these times 2H+1). Each was measured on one thread as the size where both methods take
the same time, and is flat around it: a factor of two costs some per cent. Compiled code takes the
sizes of this file when it is compiled; after a change delete Numba's cache.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..friction.law_table import groups_by_law

if TYPE_CHECKING:
    from .model import ReducedModel

COMPILED_POINT = "compiled point"
COMPILED_NEWTON = "compiled Newton"
NUMPY_NEWTON = "NumPy Newton"
DENSE_LU = "dense LU"
ITERATIONS = "iterations"
ITERATIONS_THEN_LU = "iterations, then dense LU"

# Contact degrees of freedom up to which a point is one compiled call. NumPy's overhead, 0.4 ms a
# point, is 90 % of a point with one contact and 22 % at 48 degrees of freedom; beyond 200 it is
# lost in the dense products, and BLAS on whole arrays is faster.
COMPILED_POINT_DOFS = 200
# Unknowns up to which slopes and the steps of a path are one compiled call: 3.5 times as fast with
# sixty of them, twice with 400; with 500 a slope takes longer than with NumPy.
COMPILED_SLOPE_UNKNOWNS = 450
# Unknowns of 2-D elements up to which a point is one compiled call.
COMPILED_POINT_UNKNOWNS_2D = 300
# Unknowns of 1-D elements up to which Newton is compiled: 3.3 times as fast as NumPy with one
# contact, 1.2 times at some thousand unknowns; beyond 20000 a Jacobian no longer fits into memory.
COMPILED_NEWTON_UNKNOWNS = 20000
# Unknowns up to which NumPy's dense LU is faster than iterations.
DENSE_UNKNOWNS = 300
# Unknowns up to which the dense LU is the last resort where iterations fail: 200 MB, some seconds.
DENSE_FALLBACK_UNKNOWNS = 5000
# Unknowns above which the LU of compiled Newton works on blocks of columns.
BLOCKED_LU_UNKNOWNS = 64
# Unknowns above which compiled Newton iterates in place of factoring each Jacobian.
COMPILED_ITERATION_UNKNOWNS = 64
# Unknowns from which the second level of the iterations pays: 5 steps in place of 46 at 2500.
DEFLATION_UNKNOWNS = 300
# Unknowns up to which the sign of the Jacobian's determinant is worth its time.
DETERMINANT_UNKNOWNS = 600
# Contact degrees of freedom for each mode from which contact springs are added by the modes
# (Woodbury).
LOW_RANK_RATIO = 2
# Contact degrees of freedom from which one flexibility serves all harmonics without being formed:
# with H = 3 a point takes 0.02 s in place of 0.03 at 100 nodes in space, 0.06 in place of 0.14 at
# 196; at 1024 nodes 5 s with H = 5, where matrices took 130 s with H = 3.
SHARED_FLEXIBILITY_DOFS = 64
# Coordinates and elements up to which shooting is tried.
SHOOTING_SIZE = 200


def uses_coulomb_kernels(model: ReducedModel) -> bool:
    """True if every element follows Coulomb's law, for which the compiled loops are written."""
    return all(law is None for law, _ in groups_by_law(model.elements))


def uses_compiled_point(model: ReducedModel, harmonics: int) -> bool:
    """True if a whole point is one compiled call: few Coulomb elements."""
    dofs = model.springs.size
    unknowns = dofs * (2 * harmonics + 1)
    if not _compiles_small(model, harmonics):
        return False
    # with stiff layers that are split the step is lowered first, which the loop with two tangents
    # does not do
    few = unknowns <= COMPILED_POINT_UNKNOWNS_2D and model.series is None
    return model.elements.tangents == 1 or few


def uses_compiled_slope(model: ReducedModel, harmonics: int) -> bool:
    """True if slopes with the frequency, and the steps of a path in it, are one compiled call: few
    Coulomb elements.
    """
    few = model.unknowns(harmonics) <= COMPILED_SLOPE_UNKNOWNS
    return few and _compiles_small(model, harmonics)


def _compiles_small(model: ReducedModel, harmonics: int) -> bool:
    # what couples the modes of a circulatory model changes with the frequency
    return (
        not model.circulatory
        and model.springs.size <= COMPILED_POINT_DOFS
        and model.unknowns(harmonics) <= COMPILED_NEWTON_UNKNOWNS
        and uses_coulomb_kernels(model)
    )


def uses_compiled_newton(model: ReducedModel, unknowns: int) -> bool:
    """True if Newton's loop is compiled: 1-D Coulomb elements with few enough unknowns."""
    return (
        model.elements.tangents == 1
        and unknowns <= COMPILED_NEWTON_UNKNOWNS
        and uses_coulomb_kernels(model)
    )


def linear_solver(unknowns: int) -> str:
    """How NumPy Newton solves for a step, by the unknowns of the nodes that slip or lift off."""
    if unknowns <= DENSE_UNKNOWNS:
        return DENSE_LU
    return ITERATIONS_THEN_LU if unknowns <= DENSE_FALLBACK_UNKNOWNS else ITERATIONS


def shared_basis_size(dofs: int) -> int:
    """Vectors up to which one flexibility serves all harmonics, with what each of them adds in a
    basis of that size; 0 where a matrix for each harmonic is faster.
    """
    return dofs // LOW_RANK_RATIO if dofs >= SHARED_FLEXIBILITY_DOFS else 0


def updates_by_modes(dofs: int, modes: int) -> bool:
    """True if the contact springs are added by the modes."""
    return LOW_RANK_RATIO * modes <= dofs
