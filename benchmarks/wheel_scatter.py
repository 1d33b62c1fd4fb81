"""Amplification of a lumped wheel of 36 blades with a friction element between neighbours, against
the friction limit: table and picture for docs/mistuning.md.

    python benchmarks/wheel_scatter.py [wheels] [picture.png]
"""

from __future__ import annotations

import sys
import time

import numpy as np
from scipy import linalg

from bladefem.report.scatter_pictures import marked_optima
from bladefem.report.scatter_sentences import scatter_sentences
from bladefem.report.scatter_tables import scatter_table
from bladefem.view.wheel import draw_bands
from bladefem.wheel.lumped import LumpedBlades, lumped_matrices, lumped_pattern, lumped_wheel
from bladefem.wheel.scatter import Scatter, drawn_patterns
from bladefem.wheel.statistics import (
    band_search,
    free_respond,
    one_body_respond,
    quantile_interval,
    scatter_statistics,
)

LIMITS = (1.0, 2.0, 3.0, 4.0, 6.0, 12.0)
STIFFNESS = 1e5


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 60
    blades = LumpedBlades()
    M, K, _ = lumped_matrices(blades)
    own = np.sqrt(linalg.eigh(K, M)[0][0])
    wheels = {limit: lumped_wheel(blades, 9, 1.0, STIFFNESS, limit) for limit in LIMITS}
    drawn = drawn_patterns(wheels[1.0], Scatter(0.02), count, lambda d: lumped_pattern(blades, d))
    patterns = dict.fromkeys(LIMITS, drawn)
    start = time.process_time()
    free = scatter_statistics(
        {0.0: drawn},
        band_search(
            {0.0: wheels[1.0]},
            lambda load, pattern: own * np.linspace(0.96, 1.04, 120),
            free_respond,
        ),
    )
    found = scatter_statistics(
        patterns,
        band_search(
            wheels,
            lambda load, pattern: own * np.linspace(0.96, 1.05, 90),
            lambda wheel, pattern: one_body_respond(wheel, pattern, 3, 64),
        ),
    )
    seconds = time.process_time() - start
    p95 = quantile_interval(free.factor[0], 0.95)
    print(f"without friction: 95 % of wheels below {p95.value:.3f} ({p95.low:.3f}, {p95.high:.3f})")
    columns = ["load", "p50", "p95", "p95_low", "p95_high", "worst", "unconverged", "points"]
    print(scatter_table(found)[columns].to_string(index=False, float_format="%.3f"))
    print("\n".join(scatter_sentences(found)))
    print(f"{1e3 * seconds / found.points.sum():.2f} ms of CPU a point")
    if len(sys.argv) > 2:
        bands = {}
        for name, share in (("half of the wheels", 0.5), ("95 % of the wheels", 0.95)):
            rows = [quantile_interval(row, share) for row in found.peak]
            bands[name] = np.array([[q.value, q.low, q.high] for q in rows])
        draw_bands(found.loads, found.tuned, bands, marked_optima(found, None), sys.argv[2])


if __name__ == "__main__":
    main()
