"""Time, memory and unknowns of one point of a mistuned wheel, from 6 to 36 sectors and 8 to 126
contact nodes on each damper; or of its highest blade, closed in by some 15 frequencies.

    python benchmarks/wheel.py [sectors ...] [--nodes 8 32 126] [--harmonics 1 3]
    mpirun -n 2 python benchmarks/wheel.py 36 --nodes 126 --harmonics 3    one wheel shared by ranks
    python benchmarks/wheel.py 36 --nodes 126 --harmonics 7 --resonance         its highest blade

The sectors are random elastic bodies on a rigid damper of six motions, many of whose contacts slip;
CPU times include the parts that are made once a wheel. On several ranks time and memory are those
of the rank with most; the time of exchanges, in which waiting ranks spin, is given apart.
"""

from __future__ import annotations

import argparse
import resource
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from mpi4py import MPI

from bladefem.data import Elements, RigidBody
from bladefem.hbm.model import Damping
from bladefem.hbm.solver.newton import Options
from bladefem.reduction.matrices import port_model_from_matrices
from bladefem.wheel.model import Pattern, Wheel, engine_order, tuned_wheel
from bladefem.wheel.resonance import find_wheel_peak
from bladefem.wheel.solve import solve_wheel
from bladefem.wheel.statistics import wheel_respond

MODES = 20
# those of a scene whose accuracy is 5 %
SCENE_OPTIONS = Options(tolerance=1e-6)


def random_wheel(count: int, nodes: int, seed: int = 0) -> Wheel:
    """A wheel whose sectors couple through one row of their matrices."""
    rng = np.random.default_rng(seed)
    dofs = 3 * nodes + 4
    half = rng.normal(size=(dofs, dofs)) / np.sqrt(dofs)
    own = half @ half.T + 0.3 * np.eye(dofs)
    link = np.zeros((dofs, dofs))
    link[-1, -2] = -0.02
    ports = {
        "contact": np.arange(3 * nodes),
        "blade": np.array([dofs - 1, dofs - 2]),
        "load": np.array([dofs - 1]),
        "probe": np.array([dofs - 1]),
    }
    sectors = {}
    for d in range(count // 2 + 1):
        turn = np.exp(2j * np.pi * d / count)
        K = own + link * turn + link.T * turn.conj()
        K = K.real if 2 * d % count == 0 else K
        sectors[d] = port_model_from_matrices(np.eye(dofs), K, ports, count=MODES)
    share = 1.0 / nodes
    elements = Elements(
        np.full(nodes, 4 * share),
        np.full(nodes, 4 * share),
        np.full(nodes, 0.3),
        share * rng.uniform(0.5, 1.5, nodes),
    )
    damper = RigidBody(np.diag(rng.uniform(2.0, 4.0, 6)), rng.normal(size=(3 * nodes, 6)))
    excitation = {1: engine_order(count, 2, np.array([0.5]))}
    following = slice(3 * (nodes // 2), 3 * nodes)
    return tuned_wheel(
        count,
        sectors,
        following,
        elements,
        excitation,
        damping=Damping(ratio=0.005),
        damper=damper,
        coupled=False,
    )


class TimedExchange:
    """The communicator of all ranks, with the CPU time that its exchanges take."""

    def __init__(self) -> None:
        self.comm = MPI.COMM_WORLD
        self.rank = self.comm.rank
        self.size = self.comm.size
        self.seconds = 0.0

    def allgather(self, sendobj: Any) -> list[Any]:
        start = time.process_time()
        found = self.comm.allgather(sendobj)
        self.seconds += time.process_time() - start
        return found


def mistuned(wheel: Wheel) -> tuple[float, Pattern]:
    """Circular frequency of the excited mode [rad/s], and a pattern."""
    rng = np.random.default_rng(1)
    change = 0.01 * rng.normal(size=(wheel.count, 1, 1)) * np.eye(2)
    return float(wheel.sectors[min(2, wheel.count // 2)].omega[0]), Pattern(change)


def timed(work: Callable[[], Any], exchange: TimedExchange) -> tuple[Any, float, float, float]:
    """What the work gives, CPU time without exchanges and in them [s], and memory [MB], of the rank
    with most.
    """
    exchange.seconds = 0.0
    start = time.process_time()
    found = work()
    seconds = time.process_time() - start - exchange.seconds
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    of_ranks = exchange.allgather((seconds, exchange.seconds, memory))
    own, waiting, most = (max(column) for column in zip(*of_ranks, strict=True))
    return found, own, waiting, most


def measure_resonance(wheel: Wheel, H: int, exchange: TimedExchange) -> None:
    """One line on the highest blade, closed in to 0.5 %."""
    omega, pattern = mistuned(wheel)
    grid = omega * np.linspace(0.985, 1.03, 15)
    respond = wheel_respond(wheel, pattern, H, 64, SCENE_OPTIONS)
    peak, seconds, waiting, memory = timed(lambda: find_wheel_peak(respond, grid), exchange)
    unknowns = wheel.count * wheel.nodes * wheel.directions * (2 * H + 1)
    if exchange.rank == 0:
        print(
            f"{wheel.count:7d} {wheel.nodes:5d} {H:9d} {unknowns:8d} {seconds:8.2f} "
            f"{waiting:9.2f} {len(peak.omegas):11d} {peak.unsolved:10d} {peak.height:14.8g} "
            f"{memory:12.0f}",
            flush=True,
        )


def measure(wheel: Wheel, H: int, exchange: TimedExchange) -> None:
    """One line of the table."""
    omega, pattern = mistuned(wheel)
    point, seconds, waiting, memory = timed(
        lambda: solve_wheel(wheel, 1.001 * omega, H, 64, pattern=pattern), exchange
    )
    slipping = 100 * (point.shares[..., 1] > 0).mean()
    if exchange.rank == 0:
        print(
            f"{wheel.count:7d} {wheel.nodes:5d} {H:9d} {point.w.size:8d} {seconds:8.2f} "
            f"{waiting:9.2f} {point.iterations:7d} {point.products:9d} {slipping:8.0f} % "
            f"{point.converged!s:>9} {memory:12.0f}",
            flush=True,
        )


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("sectors", nargs="*", type=int, default=[6, 12, 36])
    arguments.add_argument("--nodes", nargs="*", type=int, default=[8, 32, 126])
    arguments.add_argument("--harmonics", nargs="*", type=int, default=[1, 3])
    arguments.add_argument("--resonance", action="store_true")
    options = arguments.parse_args()
    exchange = TimedExchange()
    if exchange.rank == 0:
        more = (
            "frequencies  unsolved  highest blade"
            if options.resonance
            else "Newton  products  slipping  converged"
        )
        print(f"sectors nodes harmonics unknowns  CPU [s]  exchange  {more}  memory [MB]")
    line = measure_resonance if options.resonance else measure
    for count in options.sectors:
        for nodes in options.nodes:
            wheel = random_wheel(count, nodes)
            if exchange.size > 1:
                wheel = replace(wheel, comm=exchange)
            for H in options.harmonics:
                line(wheel, H, exchange)


if __name__ == "__main__":
    main()
