"""Cost of the friction kernels in ns for each node and sample, with and without the Jacobian, 1000 nodes.

Processor time of this thread, the best of ten runs, so that other work on the machine counts little. Run it with
``python benchmarks/friction_kernels.py``. The first call compiles and is not measured.

Recorded on one core whose matrix products run at 45 GFLOP/s while the other was busy, ns for each node and sample with
(without) Jacobian:

    H, samples       3, 128         5, 128         7, 512
    1-D, stuck       7.8            10             8.2
    1-D, gross       12             18             11
    3-D, stuck       7.8 (5.9)      19 (7.2)       13 (5.3)
    3-D, partial     61 (34)        82 (34)        61 (24)
    3-D, mixed       50 (27)        94 (34)        63 (19)
    3-D, gross       44 (20)        78 (21)        63 (15)

The kernel before, on the same machine in the same hours: stuck 11 (8), 22 (11), 14 (9); partial 142 (63), 153 (77),
139 (51); mixed 103 (43), 139 (48), 169 (49); gross 101 (27), 139 (32), 153 (26). One node with H 3 and 128 samples
takes 44 us stuck and 54 us in slip, sixteen 56 and 145 to 164 (before: 44 and 62, 64 and 260). All of it compiles in
33 s of processor time (before: 44 s).

The 40 ns wanted for 3-D are met in stick and without derivative, and missed with it: in gross slip by a tenth at H 3,
by nine and six tenths at H 5 and 7. Parts of a sample in gross slip at H 3, 5, 7, each timed alone, ns: sums over time
6, 19, 20; rows of the angle 4, 10, 13; motion and edges 4; a period of the force 4, of which it takes two; coefficients
of the rows 3; the rest are edges that change state, harmonics and the joining of the sums at the end of a period. Sums
run at the speed of the vectors: for each column block of eight, four samples i, S/2 - i, S/2 + i, S - i take 20
operations to be added up and 2K to be summed, 26, 66 and 75 cycles a sample. With one period of the force that makes
21, 40 and 44 ns before any edge changes state: H 5 and 7 cannot reach 40 in gross slip while rows are formed sample by
sample. H 5 fills 11 columns up to 16, and memory for the Jacobian, new in each call, costs it 10 ns. In partial slip
marching takes 5 to 6 periods where the median is 4: one or two nodes in a thousand shake down over a thousand periods.

Tried, and slower:

- Rows of one node in lots of 32, added by matrix products of 32 samples (the kernel before).
- A reverse sweep (adjoint of 2K numbers, the same four samples added up before the products), with explicit vectors
  too: 1.4, 1.2 and 0.9 times as long as the kernel before.
- Eight nodes in the lanes of one vector throughout; a lane that changes state does its edge alone. Gross 57, 90, 71 ns,
  but partial 140, 170, 134, as some lane of eight changes its state at a third of the samples. Its forces were equal to
  the kernel of its day to 1e-12 for nearly all nodes. One node took 1.7 times as long.
- References to arrays counted in the inner functions, as Numba does unless told: a fifth of the time.

Against the kernel before, these cases and 9600 random elements: forces equal to 1e-12 of a node's largest for all but
eight of 21 600 nodes; seven of these shake down slowly or touch the limit (1e-10), one has several periodic states and
takes another. Jacobians differ by up to 5e-9: against one with the periodic state to 1e-13, H 3, 52 of 1000 nodes in
partial slip were off by more than 1e-10 before, and 8 are now.
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
