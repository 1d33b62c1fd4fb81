"""Stability verdicts against marching: random models with lift-off, some points of each path.

    python benchmarks/verdicts.py [first seed] [last seed]

Each point is disturbed by a thousandth and marched for 400 periods. A motion that is called stable
has to stay, one that is called unstable has to leave. Where it does not, the multipliers of the
march's own periodic motion decide: an unstable motion may be left for one of two periods within a
hundredth of it, and a march leaves a point with few harmonics for the motion that it stands for.
Judged are the motion with 15 harmonics, and
as in a run that with 7, which is judged again with more where its contacts stay closed.
"""

from __future__ import annotations

import sys
import time
from collections import Counter

import numpy as np
from branch_models import Case, march, random_case, state_of
from march_multipliers import PERIODIC, STEPS, periodic_march

from bladefem import balance as bf
from bladefem.hbm.next_frequency import first_look
from bladefem.hbm.stability import UNKNOWN, stability_verdict
from bladefem.study.stability.verdicts import CONFIRMING, RicherModel, stability_of

# points of a model: its highest maxima, and others spread over the paths
MAXIMA = 2
OTHERS = 4
PERIODS = 400
DISTURBANCE = 1e-3
# relative change of the height beyond which the motion has left
LEFT = 0.05
# the same below which it has stayed
STAYED = 0.01
WRONG = (("stable", "leaves"), ("unstable", "stays"))
# growth of a multiplier of the march that is instability
GROWTH = 1e-3
# and up to which the motions with 7 and with 15 harmonics are one
SAME = 0.03


def chosen(case: Case, H: int, samples: int) -> list[bf.Solution]:
    """Points on the paths of a model, solved with more harmonics."""
    known = list(bf.response(case.model, first_look(case.model, case.band), H, samples))
    found = bf.find_branches(case.model, case.band, known, H, samples)
    points = found.points
    rng = np.random.default_rng(case.seed)
    some = [r.solution for r in found.resonances[:MAXIMA]]
    some += [points[i] for i in rng.choice(len(points), min(OTHERS, len(points)), replace=False)]
    falling = [p for p, q in zip(points[1:], points, strict=False) if p.branch == q.branch]
    if len(found.pieces) > 1:
        some += [falling[i] for i in rng.choice(len(falling), min(2, len(falling)), replace=False)]
    return some


def outcome(case: Case, point: bf.Solution) -> str:
    """What marching says: "stays", "leaves", or "unclear"."""
    state = state_of(case, point)
    reference = march(case, point.omega, state, 3)
    if abs(reference.height / bf.size(point) - 1) > 0.1:
        return "unclear"
    rng = np.random.default_rng(case.seed + 1)
    d = len(case.stiffness)
    disturbed = state.copy()
    disturbed[:d] += DISTURBANCE * abs(state[:d]).max() * rng.normal(size=d) / np.sqrt(d)
    end = march(case, point.omega, disturbed, PERIODS)
    change = abs(end.height / reference.height - 1)
    if change > LEFT or end.change > 2 * LEFT:
        return "leaves"
    return "stays" if change < STAYED and end.change < STAYED else "unclear"


def by_multipliers(case: Case, point: bf.Solution, seen: str) -> str:
    """What the march's own periodic motion says where marching contradicts the verdict: "stays",
    "leaves", or "unclear" where it is not the point's; what was seen where it has none.
    """
    found = periodic_march(case, point.omega, state_of(case, point))
    if found.change > PERIODIC:
        return seen
    height = march(case, point.omega, found.state, 2, STEPS).height
    if abs(height / bf.size(point) - 1) > SAME:
        return "unclear"
    return "leaves" if found.multiplier > 1 + GROWTH else "stays"


def verdicts(case: Case, rough: bf.Solution, point: bf.Solution) -> dict[str, tuple[str, str]]:
    """Verdict and what is known of it, of the motion with 15 harmonics and as a run judges."""
    reported = stability_verdict(case.model, point)
    richer = [RicherModel(case.model, harmonics, samples) for harmonics, samples in CONFIRMING]
    run = stability_of(case.model, [rough], richer)
    return {
        "15 harmonics": (
            reported.verdict,
            f"{reported.multiplier:.5f} {reported.bifurcation} {reported.reason}",
        ),
        "as in a run": (
            str(run.verdict[0]),
            f"{run.multiplier[0]:.5f} {run.bifurcation[0]} {run.reason}",
        ),
    }


def main(first: int, last: int) -> None:
    table: Counter[tuple[str, str, str, str]] = Counter()
    spent = Counter()
    for seed in range(first, last):
        case = random_case(seed, lifts=True)
        for rough in chosen(case, 7, 256):
            clock = time.process_time()
            point = bf.solve(case.model, rough.omega, 15, 1024, start=rough)
            spent["point"] += time.process_time() - clock
            if not point.converged:
                table["", "", "not converged", ""] += 1
                continue
            clock = time.process_time()
            reported = verdicts(case, rough, point)
            spent["verdict"] += time.process_time() - clock
            seen = outcome(case, point)
            own = rough if abs(bf.size(rough) / bf.size(point) - 1) > SAME else point
            marched = dict.fromkeys(reported, seen)
            if own is rough:
                marched["as in a run"] = outcome(case, rough)
            for way, (verdict, known) in reported.items():
                seen = marched[way]
                judged = own if way == "as in a run" else point
                contacts = "lift-off" if judged.states["lift"] else "closed"
                if (verdict, seen) in WRONG:
                    seen = by_multipliers(case, judged, seen)
                table[way, contacts, verdict, seen] += 1
                wrong = (verdict, seen) in WRONG
                if wrong or verdict == UNKNOWN:
                    print(
                        f"seed {seed}, {case.name}, {point.omega:.6g} rad/s, {contacts}, {way}: "
                        f"{verdict} ({known}), marching {seen}",
                        flush=True,
                    )
    for (way, contacts, verdict, seen), count in sorted(table.items()):
        print(f"{way:13} {contacts:9} {verdict:13} {seen:8} {count:5}")
    print(f"CPU of verdicts over that of points: {spent['verdict'] / spent['point']:.2f}")


if __name__ == "__main__":
    main(*(int(a) for a in sys.argv[1:3]) if len(sys.argv) > 2 else (0, 40))
