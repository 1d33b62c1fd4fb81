"""Cost of the friction kernels in ns for each node and sample, with and without the Jacobian, 1000
nodes.

Processor time of this thread, the best of forty runs, so that other work on the machine counts
little. Run it with ``python benchmarks/friction_kernels.py``. The first call compiles and is not
measured.

Recorded in one run on an idle machine. With the Jacobian summed in double, in single precision (as
Newton takes it), and without it; 1-D costs the same in all three:

    H, samples    3, 128          5, 128          5, 256          7, 256          7, 512
    3-D, stuck   6.0  6.0  5.2   8.2  8.0  6.4   5.9  5.7  4.8   7.7  7.6  5.7   6.2  6.2  4.9
    3-D, partial  31   30   19    47   40   21    34   27   16    38   30   16    31   23   13
    3-D, mixed    36   33   20    53   42   21    42   31   16    45   34   17    38   27   14
    3-D, gross    32   30   15    49   38   16    41   29   13    45   33   14    37   26   12
    1-D, stuck   5.8             7.8             4.8             6.3             4.6
    1-D, partial 6.8             9.0             5.8             7.4             5.5
    1-D, mixed   7.3             9.9             6.4             8.3             6.0
    1-D, gross   7.7              13             6.7             9.4             6.5

Exact 1-D forces take 34 to 41 us a node at H 3, 64 to 68 at H 5 and 99 to 105 at H 7, whatever the
samples.

Of what was wanted, 40 ns in 3-D and 15 in 1-D, single precision meets both, but for 42 ns at H 5
and 128 samples in mixed slip. At H 5 a node costs 2.4 to 3.1 us and 15 to 20 ns a sample, at H 7
3.3 to 3.5 us and 16 to 21 ns: once a node come changes of state, the start of the period and
writing the Jacobian, 9 KB at H 5.

Parts of 47 ns at H 5, 128 samples, mixed, by a profile: sums over time 9, of which the part of the
normal load 4; slip from edge to edge 5; edges 3; how they turn the rows 2.5; rows 3; stick 1.5;
changes of state 3; motion and harmonics 2.5; Jacobian written 2.5. H 5 fills 11 columns up to 16.

Calls of Newton for scenes/wedge.toml at 20 %, 96 nodes: H 3, 64 samples, sticks for 0.54, slips
0.30, is open 0.17 of the period, 2.6 periods: 47 ns in batches of 21 000 nodes (before 56), 56 in
calls of 96. H 1: 0.67, 0.17, 0.17, 1.4 periods: 22 (25) and 36. H 15, 256 samples: 0.51, 0.32,
0.17, 2.9 periods: 123 (125) and 117 (in double 150, 160).

Against the kernel before, these cases and 9600 random elements, with and without Jacobian: forces
equal to 3e-13 of a node's largest, all but 5 of 67 200 to 1e-13; Jacobians in double to 3e-10. In
single half are within 9e-8 of double (6e-8 before), all but 100 of 21 600 within 1e-6 (113), the
worst 6e-5 (7e-5); 32 points of square patches take as many Newton steps to the same displacements,
to 4e-13. Both forms compile in 50 to 57 s of processor time here, the second in 20 (48 and 17).

What paid since: vectors look for the end of stick; an edge and its derivative share their roots;
slip goes on by two edges at once, as a product waits for the last; the normal load is summed with
the rows, not by means and Gram matrices; each number of the Jacobian is written once; scratch
begins at lines of the cache (a tenth at H 7); calls of a node in line (a twentieth); in single a
period is finished from 1e-8 of the limit, not 1e-11 (a twentieth of partial slip).

Tried, and slower or no faster:

- Rows of one node in lots of 32, added by matrix products of 32 samples (an earlier kernel).
- A reverse sweep (adjoint of 2K numbers, the same four samples added up before the products), with
  explicit vectors too: 1.4, 1.2 and 0.9 times as long as that kernel.
- Eight nodes in the lanes of one vector throughout; a lane that changes state does its edge alone.
  Gross 57, 90, 71 ns, but partial 140, 170, 134, as some lane of eight changes its state at a third
  of the samples. Its forces were equal to the kernel of its day to 1e-12 for nearly all nodes. One
  node took 1.7 times as long.
- A first period of which only the second half is followed: 1 ns less in gross slip, nothing
  elsewhere.
- Leaps as long as the number of stretches of slip stays, not all states: half the periods, but a
  wrong limit at times.
- References to arrays counted in the inner functions, as Numba does unless reported: a fifth of the
  time.
- Both tangents in one pass of the sums over time: a fiftieth less at H 3, a tenth more at H 5 for
  want of registers.
- The edges that slip marked once, not in each period; Gram matrices in vectors for 1-D: nothing.
- The Jacobian of a node written by masked stores: a tenth more than by stores that reach into the
  next row.
"""

from __future__ import annotations

import time

import numpy as np

from bladefem.data import Elements
from bladefem.friction.aft import evaluate
from bladefem.friction.kernel_1d_exact import evaluate_exact

NODES = 1000
MIXES = {
    "stuck": 0.03,
    "partial": 0.8,
    "mixed": 1.6,
    "gross": 12.0,
}  # tangential amplitude over mu N / kt, about
SIZES = ((3, 128), (5, 128), (5, 256), (7, 256), (7, 512))


def case(H: int, amplitude: float, tangents: int) -> tuple[Elements, np.ndarray]:
    """Elements under load that varies by a third or so, random motion with harmonics that fall as
    1/h^2.
    """
    rng = np.random.default_rng(H)
    w = rng.normal(size=(NODES, 1 + tangents, 2 * H + 1))
    w /= np.r_[1, np.repeat(np.arange(1, H + 1), 2)] ** 2
    w[:, 1:] *= amplitude
    w[:, 1:, 0] *= 0.1
    w[:, 0] *= 0.3
    elements = Elements(
        kt=np.ones(NODES),
        kn=np.ones(NODES),
        mu=rng.uniform(0.8, 1.2, NODES),
        n0=rng.uniform(0.7, 1.5, NODES),
        tangents=tangents,
    )
    return elements, w


def cost(call, repeats: int = 40) -> float:
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
    print(
        "kernel      H  samples  mix      stick  slip   open   with dfdw    single   without   "
        "periods"
    )
    for tangents in (1, 2):
        for H, samples in SIZES:
            for mix, amplitude in MIXES.items():
                elements, w = case(H, amplitude, tangents)
                forces = evaluate(elements, w, samples)
                calls = ({}, {"precision": "single"}, {"jacobian": False})
                ns = (
                    1e9
                    * cost(lambda e=elements, w=w, s=samples, c=c: evaluate(e, w, s, **c))
                    / NODES
                    / samples
                    for c in calls
                )
                shares = "  ".join(f"{x:.2f} " for x in forces.shares.mean(0))
                print(
                    f"{2 * tangents - 1}-D sampled {H:2d} {samples:7d}  {mix:8s} {shares} "
                    f"{' '.join(f'{x:9.1f}' for x in ns)} {forces.cycles.mean():9.1f}"
                )
    print("\nexact 1-D, microseconds a node (independent of samples)")
    for H in sorted({H for H, _ in SIZES}):
        for mix, amplitude in MIXES.items():
            elements, w = case(H, amplitude, 1)
            print(
                f"H {H}  {mix:8s} "
                f"{1e6 * cost(lambda e=elements, w=w: evaluate_exact(e, w)) / NODES:8.2f}"
            )


if __name__ == "__main__":
    main()
