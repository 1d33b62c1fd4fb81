"""Cost of the friction kernels in ns for each node and sample, with and without the Jacobian, 1000 nodes.

Processor time of this thread, the best of ten runs, so that other work on the machine counts little. Run it with
``python benchmarks/friction_kernels.py``. The first call compiles and is not measured.

Recorded on an idle core whose matrix products run at 45 GFLOP/s, ns for each node and sample with (without) Jacobian:

    H, samples       3, 128         5, 128         7, 512
    1-D, stuck       7.4            9.7            6.6
    1-D, gross       12             16             9.2
    3-D, stuck       10 (8)         18 (11)        13 (8)
    3-D, partial     115 (59)       144 (62)       128 (50)
    3-D, mixed       96 (42)        138 (47)       131 (35)
    3-D, gross       94 (27)        138 (32)       150 (25)

The 40 ns wanted for 3-D are met in stick and without derivative in gross slip only. A sample in slip turns the row of
the angle, M = 3K + 3 numbers filled up to 24, 36, 48, by 20 M operations and adds it to both tangents' K harmonics by
4 K M: 1150, 2300 and 3840 operations for H 3, 5 and 7. At the speed of matrix products that alone is 26, 51 and 85 ns;
measured are 27, 37 and 57 % of it. Two other ways were tried:

- A reverse sweep (adjoint of 2K numbers, samples i, S/2 - i, S/2 + i, S - i added up before the products), with
  explicit vectors too: 580, 1020 and 1550 operations, but rows of 16 to 32 numbers are too short; 1.4, 1.2 and 0.9
  times as long.
- Eight nodes in the lanes of one vector throughout (march, coefficients, one row of the angle through slip and stick,
  the same four samples added up, sums over time); a lane that changes state does its edge alone. The sums alone take
  17, 29 and 39 ns instead of 70, 110 and 115. The whole, complete and equal to this kernel to 1e-13 in the forces, in
  the same runs on a busy machine, 8 lanes against this kernel with (without) derivative, ns:

      H, samples       3, 128                  5, 128                  7, 512
      stuck            31 (18) : 14 (9)        53 (22) : 24 (13)       44 (16) : 14 (9)
      partial          140 (113) : 132 (65)    170 (107) : 141 (64)    134 (75) : 132 (51)
      mixed            89 (60) : 101 (46)      142 (84) : 135 (50)     97 (43) : 135 (37)
      gross            57 (29) : 100-123 (30)  90 (35) : 133-140 (34)  71 (22) : 151 (26)

  It wins 1.5 to 2 times where all nodes slip and loses where they stick or change state: some lane of eight changes its
  state at a third of the samples, and alone it costs as much as eight together. Below 16 nodes it is slower too (one
  node 1.7 times). The time to compile is the same. Nodes sorted by their state might change this; that was not tried.
"""

from __future__ import annotations

import time

import numpy as np

from bladefem.data import Elements
from bladefem.friction.aft import evaluate
from bladefem.friction.events import evaluate_exact

NODES = 1000
MIXES = {"stuck": 0.03, "partial": 0.8, "mixed": 1.6, "gross": 12.0}    # tangential amplitude over mu N / kt, about
SIZES = ((3, 128), (5, 128), (7, 512))


def case(H: int, amplitude: float, tangents: int) -> tuple[Elements, np.ndarray]:
    """Elements under load that varies by a third or so, random motion with harmonics that fall as 1/h^2."""
    rng = np.random.default_rng(H)
    w = rng.normal(size=(NODES, 1 + tangents, 2 * H + 1))
    w /= np.r_[1, np.repeat(np.arange(1, H + 1), 2)] ** 2
    w[:, 1:] *= amplitude
    w[:, 1:, 0] *= 0.1
    w[:, 0] *= 0.3
    elements = Elements(kt=np.ones(NODES), kn=np.ones(NODES), mu=rng.uniform(0.8, 1.2, NODES),
                        n0=rng.uniform(0.7, 1.5, NODES), tangents=tangents)
    return elements, w


def cost(call, repeats: int = 10) -> float:
    """Best processor time of a call [s]."""
    call()
    best = np.inf
    for _ in range(repeats):
        begin = time.thread_time()
        call()
        best = min(best, time.thread_time() - begin)
    return best


def main() -> None:
    """Print the table."""
    print("kernel      H  samples  mix      stick  slip   open   with dfdw   without   periods")
    for tangents in (1, 2):
        for H, samples in SIZES:
            for mix, amplitude in MIXES.items():
                elements, w = case(H, amplitude, tangents)
                forces = evaluate(elements, w, samples)
                ns, bare = (1e9 * cost(lambda e=elements, w=w, s=samples, j=j: evaluate(e, w, s, j)) / NODES / samples
                            for j in (True, False))
                shares = "  ".join(f"{x:.2f} " for x in forces.shares.mean(0))
                print(f"{2 * tangents - 1}-D sampled {H:2d} {samples:7d}  {mix:8s} {shares} {ns:9.1f} {bare:9.1f} "
                      f"{forces.cycles.mean():9.1f}")
    print("\nexact 1-D, microseconds a node (independent of samples)")
    for H, _ in SIZES:
        for mix, amplitude in MIXES.items():
            elements, w = case(H, amplitude, 1)
            print(f"H {H}  {mix:8s} {1e6 * cost(lambda e=elements, w=w: evaluate_exact(e, w)) / NODES:8.2f}")


if __name__ == "__main__":
    main()
