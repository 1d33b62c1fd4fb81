"""Where methods fail: every method on every point of a grid, each outcome with its reason.

Outcomes: "converged", "false" (accepted by its own criterion, but more than 10 % off the
equilibrium it was meant to find), "diverged", "no convergence". The error of the paper's iterations
is measured against the equilibrium of the same one-harmonic equations, not against the full
balance, so that a wrong stop is not confused with a coarse model.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path

import numpy as np

from bladefem.damper.accelerate import Iterated, Rules, iterate
from bladefem.damper.paper import PlatformSide, platform
from bladefem.hbm.model import ReducedModel

VARIANTS = {
    "paper": ("amplitude", Rules(damper="march")),
    **{
        method: (method, Rules())
        for method in ("picard", "amplitude", "complex", "parts", "anderson")
    },
    "anderson, residual": ("anderson", Rules(criterion="residual", tolerance=1e-3)),
    "describing": ("describing", Rules(tolerance=1e-3, most=200)),
}
COLUMNS = (
    "load",
    "stiffness",
    "frequency",
    "method",
    "outcome",
    "iterations",
    "residual",
    "error",
    "reason",
)
# relative error of the platform motion beyond which an accepted point is false
FALSE = 0.1
Solver = Callable[[ReducedModel, float], tuple[bool, int, float, str]]


def method_map(
    points: Iterable[tuple[float, float, float]],
    model: Callable[[float, float], ReducedModel],
    solvers: Mapping[str, Solver],
    variants: Mapping[str, tuple[str, Rules]] = VARIANTS,
) -> Iterator[dict[str, float | str]]:
    """One row a point and method.

    The damper is solved exactly, so that the outer iteration alone is judged; "paper" also
    integrates it from rest.

    Args:
        points: (friction limit of a seat [N], tangential stiffness of a seat [N/m], frequency
            [Hz]).
        model: from limit and stiffness.
        solvers: full balances by name, from (model, circular frequency) to converged, iterations,
            residual, reason.
        variants: name to method and rules of the iterations on the platform motion.
    """
    for load, stiffness, frequency in points:
        body = model(load, stiffness)
        omega = 2 * np.pi * frequency
        key = {"load": load, "stiffness": stiffness, "frequency": frequency}
        side = platform(body, omega, 1)
        true = _equilibrium(side)
        for name, (method, rules) in variants.items():
            yield key | {"method": name} | _judge(iterate(side, method, rules), true)
        for name, solver in solvers.items():
            converged, iterations, error, reason = solver(body, omega)
            yield key | {
                "method": name,
                "outcome": "converged" if converged else "no convergence",
                "iterations": iterations,
                "residual": error,
                "error": np.nan,
                "reason": reason,
            }


def count_outcomes(rows: Iterable[Mapping[str, float | str]]) -> dict[str, dict[str, int]]:
    """Method to outcome to number of points."""
    table: dict[str, dict[str, int]] = {}
    for row in rows:
        counts = table.setdefault(str(row["method"]), {})
        counts[str(row["outcome"])] = counts.get(str(row["outcome"]), 0) + 1
    return table


def write_rows(rows: Iterable[Mapping[str, float | str]], path: str | Path) -> None:
    """Rows as CSV, numbers with six digits."""
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, COLUMNS)
        writer.writeheader()
        for row in rows:
            writer.writerow({k: f"{v:.6g}" if isinstance(v, float) else v for k, v in row.items()})


def _equilibrium(side: PlatformSide) -> np.ndarray | None:
    """Platform motion of the one-harmonic equilibrium to 1e-6, or None where it was not found."""
    exact = Rules(criterion="residual", tolerance=1e-6, most=200, damper="shooting")
    for method in ("describing", "anderson", "amplitude"):
        found = iterate(side, method, exact)
        if found.converged and found.residual < 1e-4:
            return found.u
    return None


def _judge(found: Iterated, true: np.ndarray | None) -> dict[str, float | str]:
    error = np.nan if true is None else float(np.linalg.norm(found.u - true) / np.linalg.norm(true))
    wrong = error > FALSE if true is not None else found.residual > FALSE
    if found.converged:
        outcome = "false" if wrong else "converged"
    else:
        outcome = "diverged" if found.reason == "diverged" else "no convergence"
    return {
        "outcome": outcome,
        "iterations": found.iterations,
        "residual": found.residual,
        "error": error,
        "reason": found.reason,
    }
