"""Newton steps of single nodes towards the forces at the end of a step in time, eight nodes at a
time, and what they move.

The law is that of `bladefem.friction.time_step.step_2d`, which `bladefem.hbm.ring_contacts` has for
one node at a time. Arrays have rows of ``width`` numbers, one a node, filled up to a multiple of
eight.
"""

from __future__ import annotations

from collections.abc import Callable
from math import factorial

from bladefem.friction.simd.codegen import LANES_PER_VECTOR, Code, Lanes, kernel
from bladefem.friction.time_step import ROUNDING

# rows of the constants of nodes
KT, KN, MU = 0, 1, 2
# exp(-x) beyond is none; halvings of x before its series, and terms of that, exact to 1e-11
NO_DECAY = 40.0
DECAY_HALVINGS = 6
DECAY_TERMS = 13
# path over limit below which the mean of a decay is taken from its series
SHORT_PATH = 1e-5


def _decay(x: Lanes) -> Lanes:
    """exp(-x) for x >= 0."""
    part = -(0.5**DECAY_HALVINGS) * x.above(NO_DECAY, 0.0 * x + NO_DECAY, x)
    total = 0.0 * x + 1.0 / factorial(DECAY_TERMS - 1)
    for k in range(DECAY_TERMS - 2, -1, -1):
        total = total * part + 1.0 / factorial(k)
    for _ in range(DECAY_HALVINGS):
        total = total * total
    return total


def _stick_share(a: Lanes, b: Lanes, c: Lanes) -> Lanes:
    """The share of the step in stick, as `bladefem.friction.time_step` has it."""
    zero = 0.0 * a
    one = zero + 1.0
    c = c.above(0.0, zero, c)
    square = b * b - a * c
    root = square.above(0.0, square, zero).sqrt()
    leaving = -1.0 * c / (b + root)
    turning = (root - b) / a
    leaving = leaving.above(1.0, one, leaving)
    turning = turning.above(0.0, turning, zero)
    turning = turning.above(1.0, one, turning)
    return b.above(0.0, leaving, a.above(0.0, turning, zero))


def _slipping(
    p: tuple[Lanes, Lanes], d: tuple[Lanes, Lanes], before: Lanes, after: Lanes
) -> tuple[Lanes, Lanes, Lanes]:
    """Force x, y at the end of a step that slips there, and how far of the motion's last part it
    follows on average across itself.

    Args:
        p: force before the step; d: motion in it times the stiffness.
        before, after: limits.
    """
    (px, py), (dx, dy) = p, d
    square = dx * dx + dy * dy
    path = square.sqrt()
    grow = after - before
    share = _stick_share(
        square - grow * grow,
        px * dx + py * dy - before * grow,
        px * px + py * py - before * before,
    )
    hx, hy = px + share * dx, py + share * dy
    both = (hx * hx + hy * hy).sqrt() * path
    x = (1.0 - share) * path / (0.5 * (before + share * grow + after))
    kept = _decay(x)
    inverse = 1.0 / both
    cosine = (hx * dx + hy * dy) * inverse
    sine = (dx * hy - dy * hx) * inverse
    # tan(psi / 2) of the angle between force and motion as a fraction: none where they are opposite
    rise = cosine.above(0.0, sine, 1.0 - cosine) * kept
    run = cosine.above(0.0, 1.0 + cosine, sine)
    scale = after / (path * (run * run + rise * rise))
    along, across = scale * (run * run - rise * rise), 2.0 * scale * run * rise
    tx, ty = px + dx, py + dy
    radial = after / (tx * tx + ty * ty).sqrt()
    fx, fy = along * dx - across * dy, along * dy + across * dx
    # at the limit there, which follows the exact slope more closely than the mean one does
    x = (1.0 - share) * path / after
    followed = x.above(SHORT_PATH, (1.0 - _decay(x)) / x, 1.0 - 0.5 * x)
    return both.above(0.0, fx, radial * tx), both.above(0.0, fy, radial * ty), followed


def _wanted(
    code: Code, table, before, now, width, i
) -> tuple[tuple[Lanes, ...], tuple[Lanes, ...]]:
    """Forces by the law at the displacements: normal, x and y; and their derivatives by these:
    normal by normal, x and y by normal, and xx, xy, yy.

    Args:
        before: forces, displacements and loads before the step; now: displacements and loads.
    """
    f, old, load0 = before
    w, load = now
    kt, kn, mu = (code.load(table, (row, width), i) for row in (KT, KN, MU))
    px, py = (code.load(f, (row, width), i) for row in (1, 2))
    x0, y0 = (code.load(old, (row, width), i) for row in (1, 2))
    N0 = code.load(load0, i) + kn * code.load(old, i)
    N1 = code.load(load, i) + kn * code.load(w, i)
    zero = 0.0 * kt
    one = zero + 1.0
    # closed, of a node with friction
    after = mu * N1
    rise = N0.above(0.0, one, N1 - N0)
    part = N0.above(0.0, one, N1 / rise)
    kx = kt * (code.load(w, (1, width), i) - x0)
    ky = kt * (code.load(w, (2, width), i) - y0)
    dx, dy = part * kx, part * ky
    limit = mu * N0.above(0.0, N0, zero)
    fx, fy, followed = _slipping((px, py), (dx, dy), limit, after)
    tx, ty = px + dx, py + dy
    trial, most = tx * tx + ty * ty, (1.0 + ROUNDING) * after * after
    # of a node that closes in this step and sticks
    later = N0.above(0.0, zero, -1.0 * N0 / (rise * rise))
    nx, ny = fx / after, fy / after

    def chosen(slips: Lanes, sticks: Lanes) -> Lanes:
        return after.above(0.0, trial.above(most, slips, sticks), zero)

    stiff = kt * part
    across = stiff * followed
    forces = (N1.above(0.0, N1, zero), chosen(fx, tx), chosen(fy, ty))
    slopes = (
        N1.above(0.0, kn, zero),
        kn * chosen(mu * nx, later * kx),
        kn * chosen(mu * ny, later * ky),
        chosen(across * (1.0 - nx * nx), stiff),
        chosen(-1.0 * across * nx * ny, zero),
        chosen(across * (1.0 - ny * ny), stiff),
    )
    return forces, slopes


def _solved(F: list[Lanes], slopes: tuple[Lanes, ...], gap: list[Lanes]) -> tuple[Lanes, ...]:
    """The solution of (1 + B F) x = gap by Cramer's rule.

    Args:
        F: nine entries of a node's own flexibility, row by row.
        slopes: B as `_wanted` has it.
    """
    n0, n1, n2, s0, s1, s2, t0, t1, t2 = F
    b00, b10, b20, b11, b12, b22 = slopes
    a00, a01, a02 = 1.0 + b00 * n0, b00 * n1, b00 * n2
    a10 = b10 * n0 + b11 * s0 + b12 * t0
    a11 = 1.0 + b10 * n1 + b11 * s1 + b12 * t1
    a12 = b10 * n2 + b11 * s2 + b12 * t2
    a20 = b20 * n0 + b12 * s0 + b22 * t0
    a21 = b20 * n1 + b12 * s1 + b22 * t1
    a22 = 1.0 + b20 * n2 + b12 * s2 + b22 * t2
    c0, c1, c2 = a11 * a22 - a12 * a21, a12 * a20 - a10 * a22, a10 * a21 - a11 * a20
    scale = 1.0 / (a00 * c0 + a01 * c1 + a02 * c2)
    x, y, z = gap
    return (
        scale * (x * c0 + y * (a02 * a21 - a01 * a22) + z * (a01 * a12 - a02 * a11)),
        scale * (x * c1 + y * (a00 * a22 - a02 * a20) + z * (a02 * a10 - a00 * a12)),
        scale * (x * c2 + y * (a01 * a20 - a00 * a21) + z * (a00 * a11 - a01 * a10)),
    )


@kernel
def node_steps(code: Code, i, width, table, flexibility, before, old, load0, load1, w, f, step):
    """The Newton steps of the nodes from place i on: step (3, LANES_PER_VECTOR) takes them, and
    they are added to the forces f.

    Args:
        table: (3, width) kt, kn, mu; flexibility: (9, width) of the node's own forces.
        before: (3, width) forces, old: (3 width,) displacements, normal ones first, and load0:
            (width,) normal load at zero displacement, all before the step; w, f, load1: the same
            after it.
    """
    now = [code.load(f, (row, width), i) for row in range(3)]
    forces, slopes = _wanted(code, table, (before, old, load0), (w, load1), width, i)
    F = [code.load(flexibility, (row, width), i) for row in range(9)]
    gap = [force - own for force, own in zip(forces, now, strict=True)]
    for row, x in enumerate(_solved(F, slopes, gap)):
        code.store(x, step, row * LANES_PER_VECTOR)
        code.store(now[row] + x, f, (row, width), i)


def _subtracting(nodes: int) -> Callable:
    """What writes the displacements target (size,) less those by the forces of so many nodes from
    place i on.

    The kernel's arguments:
        columns: (3 width, size) displacements by each force on the first blade, blade by blade.
        begin, middle, end: those of them that are meant; up to the middle one the target has them
            ``shift`` places further on, from there on that less ``size``.
        forces: in rows of ``stride``, from a place there on.
    """

    def write(
        code: Code,
        columns,
        i,
        width,
        size,
        begin,
        middle,
        end,
        shift,
        forces,
        stride,
        place,
        target,
    ):
        places = [(row, lane) for row in range(3) for lane in range(nodes)]
        given = [code.spread(code.one(forces, (stride, row), place, lane)) for row, lane in places]
        back = code.place(shift, (size, -1))
        for first, last, moved in ((begin, middle, shift), (middle, end, back)):
            with code.loop(first, last, LANES_PER_VECTOR) as k:
                total = code.load(target, k, moved)
                for (row, lane), force in zip(places, given, strict=True):
                    column = code.place((width, row), i, lane)
                    total = total - code.load(columns, (column, size), k) * force
                code.store(total, target, k, moved)

    return write


subtract_block = kernel(_subtracting(LANES_PER_VECTOR))
subtract_node = kernel(_subtracting(1))
