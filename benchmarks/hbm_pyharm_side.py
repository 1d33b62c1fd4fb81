"""pyHarm's half of benchmarks/hbm_pyharm.py, for the Python where
benchmarks/pyharm-requirements.txt is installed.

    python hbm_pyharm_side.py problem.npz result.npz
Solves each frequency by itself, pyHarm's Newton started from the last point, so that both codes do
the same work.
"""

from __future__ import annotations

import logging
import resource
import sys
import time
import warnings

import numpy as np
from pyHarm.Maestro import Maestro
from pyHarm.Solver import FirstSolution


def description(p: dict[str, np.ndarray]) -> dict:
    """The input dictionary: one substructure whose nodes carry one dof (tangential only) or all
    contact directions.
    """
    d = int(p["directions"])
    connectors = {
        "force": {
            "type": "CosinusForcing",
            "connect": {"body": [int(p["load"]) // d]},
            "dirs": [int(p["load"]) % d],
            "amp": float(p["force"]),
        }
    }
    for i, node in enumerate(p["nodes"]):
        one = {"connect": {"body": [int(node)]}}
        kt, kn, mu, n0 = (float(p[name][i]) for name in ("kt", "kn", "mu", "n0"))
        if d == 1:
            connectors[f"c{i}"] = one | {
                "type": "Jenkins",
                "dirs": [0],
                "mu": mu,
                "N0": n0,
                "k": kt,
            }
        else:
            # normal displacements open the contact here, and f = k x is counted from the preload N0
            connectors[f"c{i}"] = one | {
                "type": "Penalty3D",
                "dirs": [0, 1, 2],
                "mu": mu,
                "N0": n0,
                "g": 0.0,
                "k_n": kn,
                "k_t": kt,
            }
    return {
        "system": {"type": "Base", "nh": int(p["H"]), "nti": int(p["samples"])},
        "substructures": {
            "body": {"matrix": {"M": p["M"], "C": p["C"], "K": p["K"], "G": 0 * p["M"]}, "ndofs": d}
        },
        "connectors": connectors,
        "analysis": {
            "frf": {
                "study": "frf",
                "solver": "NewtonRaphson",
                "predictor": "previous",
                "corrector": "nocontinuation",
                "verbose": False,
                "puls_inf": float(p["omegas"][0]),
                "puls_sup": float(p["omegas"][-1]),
                "solver_options": {
                    "tol_residual": float(p["tolerance"]),
                    "tol_delta_x": 1e300,
                    "max_iter": 60,
                },
            }
        },
    }


def main(source: str, target: str) -> None:
    logging.disable(logging.CRITICAL)
    warnings.filterwarnings("ignore")
    p = dict(np.load(source))
    maestro = Maestro(description(p))
    frf, edf = maestro.nls["frf"], maestro.system.expl_dofs
    d, load = int(p["directions"]), int(p["load"])
    probe = edf[(edf.node_num == load // d) & (edf.dof_num == load % d)]
    cosine = probe[(probe.harm == 1) & (probe.cs == "c")].index[0]
    sine = probe[(probe.harm == 1) & (probe.cs == "s")].index[0]
    # its automatic derivative of |x| is not a number at rest: start next to it
    rest = 1e-4 * np.random.default_rng(0).normal(size=len(edf) + 1)
    x = rest.copy()
    amplitude, converged, seconds = [], [], []
    for i, omega in enumerate(
        np.concatenate([p["omegas"][:1], p["omegas"]])
    ):  # the first one compiles
        x[-1] = omega
        begin = time.process_time()
        solution = FirstSolution(x.copy())
        try:
            frf.solver.Solve(solution, [])
            found = solution.x_red
            residual = np.linalg.norm(frf.globalResidual(found, solution))
        except (np.linalg.LinAlgError, ValueError):
            found, residual = x, np.inf
        if i == 0:
            continue
        seconds.append(time.process_time() - begin)
        converged.append(residual <= 10 * p["tolerance"])
        amplitude.append(found[cosine] - 1j * found[sine])
        x = found.copy() if converged[-1] else rest.copy()
    np.savez(
        target,
        amplitude=amplitude,
        converged=converged,
        seconds=seconds,
        memory=resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    )


if __name__ == "__main__":
    main(*sys.argv[1:])
