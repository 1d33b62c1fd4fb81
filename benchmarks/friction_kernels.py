"""Cost of the friction kernels in ns for each node and sample, with and without the Jacobian, 1000 nodes.

Processor time of this thread, the best of ten runs, so that other work on the machine counts little. Run it with
``python benchmarks/friction_kernels.py``. The first call compiles and is not measured.

Recorded in one run while the other core was busy. With the Jacobian summed in double, in single precision (as Newton
takes it), and without it:

    H, samples       3, 128              5, 128              7, 512
    3-D, stuck       8.7   8.6   5.7     15    15    7.2     9.8   9.6   5.2
    3-D, partial     51    48    28      68    60    31      52    40    20
    3-D, mixed       51    49    27      79    64    30      62    43    20
    3-D, gross       45    43    19      71    56    21      62    41    16
    1-D, stuck       6.9                 10                  7.9
    1-D, gross       10                  15 to 18            10

The kernel before, double only, minutes later: partial 59, 81, 61, mixed 50, 86, 62, gross 44, 74, 65; 1-D gross some
hours before 13, 17, 11. Partial slip took it 5.7, 4.9, 6.3 periods, now 3.8, 4.0, 4.0.

1-D meets the 15 ns wanted but for H 5 in gross slip: 15 to 18 in this run, 14 in a quieter hour. The 40 wanted for 3-D
are met in stick and without the derivative; in single precision H 7 is at 40 to 43, H 3 a tenth to a quarter above, H 5
half above. Parts of a sample in gross slip in single (double), each timed alone, ns at H 3, 5, 7: sums over time 4, 8,
9 (6, 14, 20), rows of the angle 2, 4, 4 (4, 9, 10). By a profile the rest is mostly not sums: two periods of the force
of 3.5 each, at the latency of the product that moves the half-angle vector from edge to edge; motion, edges and their
turns 6; joining and storing the Jacobian, 9 KB a node at H 5, 5; harmonics and Gram matrices 4. H 5 fills 11 columns up
to 16. That the caller hands in the array for the Jacobian saves nothing: its memory is reused from call to call.

Calls of Newton for scenes/wedge.toml at 20 %, 96 nodes: H 3, 64 samples, sticks for 0.54, slips 0.30, is open 0.17 of
the period, 2.6 periods: 54 ns in batches of 21 000 nodes, 67 in calls of 96. H 1: 0.67, 0.17, 0.17, 1.4 periods: 25 and
33. H 15, 256 samples: 0.51, 0.32, 0.17, 2.9 periods: 130 and 107 (in double 210).

Against the kernel before, these cases and 9600 random elements, with and without Jacobian: forces equal to 1e-12 of a
node's largest for all but 66 of 67 200, of which the worst shake down slowly and were left up to 1e-10 from their
limit. Jacobians in double are equal to 1e-9 for all but 29 of 33 600, the worst 2e-7, mostly the same nodes. In single
half are within 5e-8, all but 113 within 1e-6, the worst 7e-5; 32 points of square patches take as many Newton steps to
the same displacements, to 5e-13. Both forms compile in 42 s of processor time on the busy machine, the second in 15.

Tried, and slower:

- Rows of one node in lots of 32, added by matrix products of 32 samples (an earlier kernel).
- A reverse sweep (adjoint of 2K numbers, the same four samples added up before the products), with explicit vectors
  too: 1.4, 1.2 and 0.9 times as long as that kernel.
- Eight nodes in the lanes of one vector throughout; a lane that changes state does its edge alone. Gross 57, 90, 71 ns,
  but partial 140, 170, 134, as some lane of eight changes its state at a third of the samples. Its forces were equal to
  the kernel of its day to 1e-12 for nearly all nodes. One node took 1.7 times as long.
- A first period of which only the second half is followed: 1 ns less in gross slip, nothing elsewhere.
- Leaps as long as the number of stretches of slip stays, not all states: half the periods, but a wrong limit at times.
- References to arrays counted in the inner functions, as Numba does unless told: a fifth of the time.
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
    print("kernel      H  samples  mix      stick  slip   open   with dfdw    single   without   periods")
    for tangents in (1, 2):
        for H, samples in SIZES:
            for mix, amplitude in MIXES.items():
                elements, w = case(H, amplitude, tangents)
                forces = evaluate(elements, w, samples)
                calls = ({}, {"precision": "single"}, {"jacobian": False})
                ns = (1e9 * cost(lambda e=elements, w=w, s=samples, c=c: evaluate(e, w, s, **c)) / NODES / samples
                      for c in calls)
                shares = "  ".join(f"{x:.2f} " for x in forces.shares.mean(0))
                print(f"{2 * tangents - 1}-D sampled {H:2d} {samples:7d}  {mix:8s} {shares} "
                      f"{' '.join(f'{x:9.1f}' for x in ns)} {forces.cycles.mean():9.1f}")
    print("\nexact 1-D, microseconds a node (independent of samples)")
    for H, _ in SIZES:
        for mix, amplitude in MIXES.items():
            elements, w = case(H, amplitude, 1)
            print(f"H {H}  {mix:8s} {1e6 * cost(lambda e=elements, w=w: evaluate_exact(e, w)) / NODES:8.2f}")


if __name__ == "__main__":
    main()
