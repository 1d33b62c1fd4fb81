"""Kernels of 2-D elements in vectors, along time: edges, stick, slip and how it turns the rows of
the derivative.

The arrays of one node along time have rows of ``width`` numbers, samples filled up to a multiple of
eight and eight more.
"""

from __future__ import annotations

from bladefem.friction.simd.codegen import LANES_PER_VECTOR, Code, Lanes, kernel

(
    DIRECTION_X,
    DIRECTION_Y,
    INVERSE_LENGTH,
    HALF,
    SLOPE,
    INVERSE_LIMIT,
    AHEAD,
    ACROSS,
    AWAY,
    FALL,
    LIMIT_AHEAD,
    TWICE_Y,
    LIMIT_AWAY,
    PAIR_AHEAD,
    PAIR_TO_P,
    PAIR_TO_Q,
    PAIR_AWAY,
    EDGE_ROWS,
) = range(18)
# m (3), a, t (3) of find_turns
TURN_ROWS = 7
# of the limit: the shortest edge
SHORTEST_EDGE = 1e-12
# [N]: the least limit
SMALLEST_LIMIT = 1e-60


def _edge_decay(dx: Lanes, dy: Lanes, limit: Lanes) -> tuple[Lanes, ...]:
    """1/length and 1/limit of edges (dx, dy), decay over half of them, x dln(decay)/dx."""
    twice = 2.0 * limit
    square = dx * dx + dy * dy
    least = SHORTEST_EDGE * limit
    square = square.above(least * least, square, least * least)
    # root = 2 limit sqrt(1 + x^2/4)
    length = square.sqrt()
    root = (square + twice * twice).sqrt()
    both = length * limit
    roots = root * (root + length)
    # one division for four
    product = 1.0 / (both * roots)
    by_both = roots * product
    by_roots = both * product
    half = twice * root * by_roots
    slope = -1.0 * length * (root + length) * by_roots
    return limit * by_both, length * by_both, half, slope


@kernel
def find_edges(
    code: Code,
    path,
    width,
    mu,
    out,
):
    """Fill out (17, width) from path (3, width), which is (kt w_1, kt w_2, N) at the knots [N].

    Rows: direction u (2), 1/length, decay over half an edge, x dln(decay)/dx, 1/limit; of the map
    of the half-angle vector (P, Q) its elements 11, 12 = 21, 22 and determinant; of the form in P
    and Q whose sign shows whether slip goes on its factors of P^2, P Q and -Q^2; of the map of this
    edge and the next its elements 11, 12, 21, 22. Lengths and limits are forces [N].
    """
    mu = code.spread(mu)
    with code.loop(0, code.place(width, -LANES_PER_VECTOR), LANES_PER_VECTOR) as i:
        dx, dy, dN = (
            code.load(path, (row, width), i, 1) - code.load(path, (row, width), i)
            for row in range(3)
        )
        limit = mu * (code.load(path, (2, width), i) + 0.5 * dN)
        limit = limit.above(SMALLEST_LIMIT, limit, limit * 0.0 + SMALLEST_LIMIT)
        inverse, inverse_limit, half, slope = _edge_decay(dx, dy, limit)
        ux = dx * inverse
        uy = dy * inverse
        fall = half * half
        a = 0.5 + 0.5 * fall
        b = 0.5 - 0.5 * fall
        growth = mu * dN * inverse
        # opens: no slip goes on
        growth = (code.load(path, (2, width), i, 1)).above(0.0, growth, growth * 0.0 + 2.0)
        for row, values in enumerate(
            (
                ux,
                uy,
                inverse,
                half,
                slope,
                inverse_limit,
                a + b * ux,
                b * uy,
                a - b * ux,
                fall,
                ux - growth,
                2.0 * uy,
                ux + growth,
            )
        ):
            code.store(values, out, (row, width), i)
    _write_pairs(code, width, out)


def _write_pairs(code: Code, width, out) -> None:
    """The maps of each edge and the next, from those of single edges."""
    with code.loop(0, code.place(width, -LANES_PER_VECTOR), LANES_PER_VECTOR) as i:
        a, b, d = (code.load(out, (row, width), i) for row in (AHEAD, ACROSS, AWAY))
        A, B, D = (code.load(out, (row, width), i, 1) for row in (AHEAD, ACROSS, AWAY))
        for row, values in (
            (PAIR_AHEAD, A * a + B * b),
            (PAIR_TO_P, A * b + B * d),
            (PAIR_TO_Q, B * a + D * b),
            (PAIR_AWAY, B * b + D * d),
        ):
            code.store(values, out, (row, width), i)


@kernel
def stuck_until(
    code: Code,
    path,
    width,
    begin,
    end,
    cx,
    cy,
    mu,
) -> int:
    """First edge i of begin <= i < end at whose end knot the force c + kt w is beyond the limit or
    the load is gone.

    It is end if there is none; path (3, width) as find_edges has it.
    """
    cx = code.spread(cx)
    cy = code.spread(cy)
    mu = code.spread(mu)

    def beyond(i):
        fx, fy, N = (code.load(path, (row, width), i, 1) for row in range(3))
        fx = cx + fx
        fy = cy + fy
        limit = mu * N
        return (fx * fx + fy * fy).over(N.above(0.0, limit * limit, N * 0.0 - 1.0))

    return code.search(begin, end, beyond)


def _turned_vectors(P: Lanes, Q: Lanes, ux: Lanes, uy: Lanes, h: Lanes) -> tuple[Lanes, ...]:
    """Twice the half-angle vector (P, Q) in the middle and at the end of an edge along (ux, uy).

    Its parts along and across the direction's half angle, of which the second falls by the decay h
    on each half of the edge.
    """
    ax = (1.0 + ux) * P + uy * Q
    ay = uy * P + (1.0 - ux) * Q
    bx = (1.0 - ux) * P - uy * Q
    by = (1.0 + ux) * Q - uy * P
    return ax + h * bx, ay + h * by, ax + h * h * bx, ay + h * h * by


def _inverse_sizes(shrunk: Lanes, middle: Lanes, last: Lanes) -> tuple[Lanes, ...]:
    """1 over the product of the sizes of a half-angle vector, over that in the middle and over that
    at the end of an edge, by one division; shrunk is its size after half the edge.
    """
    inverse = 1.0 / (shrunk * middle * last)
    return inverse, shrunk * last * inverse, shrunk * middle * inverse


def _angle_rates(y: Lanes, gone: Lanes, rates: tuple[Lanes, ...]) -> tuple[Lanes, ...]:
    """How the angle follows normal load and motion along x and y, by its slope y with the length of
    the edge and the part of the row that is gone.
    """
    by_load, kx, ky = rates
    return -1.0 * y * by_load, y * kx - gone * ky, y * ky + gone * kx


@kernel
def find_turns(
    code: Code, begin, end, path, form, knots, slips, width, kt, kn, mu, turns, g, normal, trace
):
    """How the row of the angle turns along the edges begin <= i < end in slip, from half-angle
    vectors knots.

    With the pattern's rows p_q (normal, first, second tangent) the row of the angle in the middle
    of an edge is b (row + sum m_q p_q), at its end a row + sum t_q p_q: turns (7, width) takes m,
    a, t. The force there has the rows g (row + ..) + n p_0: g, normal (2, width), zero where slips
    (width,) is; trace (2, width) takes the force.
    """
    kt = code.spread(kt)
    mu = code.spread(mu)
    mukn = mu * code.spread(kn)
    with code.loop(
        code.builder.and_(begin, code.whole(-LANES_PER_VECTOR)), end, LANES_PER_VECTOR
    ) as i:
        ux, uy, h, slope, by_length, by_limit = (
            code.load(form, (row, width), i)
            for row in (DIRECTION_X, DIRECTION_Y, HALF, SLOPE, INVERSE_LENGTH, INVERSE_LIMIT)
        )
        P = code.load(knots, i)
        Q = code.load(knots, width, i)
        slip = code.load(slips, i)
        N = 0.5 * (code.load(path, (2, width), i) + code.load(path, (2, width), i, 1))
        Pm, Qm, P1, Q1 = _turned_vectors(P, Q, ux, uy, h)
        shrunk = 4.0 * h * (P * P + Q * Q)
        middle = Pm * Pm + Qm * Qm
        last = P1 * P1 + Q1 * Q1
        inverse, inverse_middle, inverse_last = _inverse_sizes(shrunk, middle, last)
        ex = (Pm * Pm - Qm * Qm) * inverse_middle
        ey = 2.0 * Pm * Qm * inverse_middle
        b = shrunk * inverse_middle
        a = h * shrunk * inverse_last
        ym = slope * (ux * ey - uy * ex)
        y1 = 2.0 * slope * (2.0 * ux * P1 * Q1 - uy * (P1 * P1 - Q1 * Q1)) * inverse_last
        rates = mukn * by_limit, kt * by_length * ux, kt * by_length * uy
        over = middle * (middle * last * inverse)
        m = _angle_rates(ym, 1.0 - b, rates)
        t = _angle_rates(y1, 1.0 - a, rates)
        for row, values in enumerate((*(over * x for x in m), a, *t)):
            code.store(values, turns, (row, width), i)
        R = slip * mu * N
        for row, across, along in ((0, -1.0 * ey, ex), (1, ex, ey)):
            for values, out in ((R * b * across, g), (mukn * along, normal), (R * along, trace)):
                # the trace keeps what it has where nothing slips
                rest = code.load(out, (row, width), i) if out is trace else slip * 0.0
                code.store(slip.above(0.5, values, rest), out, (row, width), i)


@kernel
def find_forces(
    code: Code,
    path,
    form,
    knots,
    slips,
    width,
    mu,
    trace,
):
    """Forces trace (2, width) in the middle of edges in slip [N], from their half-angle vectors
    knots (2, width).
    """
    mu = code.spread(mu)
    with code.loop(0, code.place(width, -LANES_PER_VECTOR), LANES_PER_VECTOR) as i:
        ux, uy, h = (code.load(form, (row, width), i) for row in (DIRECTION_X, DIRECTION_Y, HALF))
        P = code.load(knots, i)
        Q = code.load(knots, width, i)
        slip = code.load(slips, i)
        R = 0.5 * mu * (code.load(path, (2, width), i) + code.load(path, (2, width), i, 1))
        P, Q = (
            (1.0 + ux) * P + uy * Q + h * ((1.0 - ux) * P - uy * Q),
            uy * P + (1.0 - ux) * Q + h * ((1.0 + ux) * Q - uy * P),
        )
        R = R / (P * P + Q * Q)
        for row, along in enumerate((P * P - Q * Q, 2.0 * P * Q)):
            code.store(
                slip.above(0.5, R * along, code.load(trace, (row, width), i)),
                trace,
                (row, width),
                i,
            )
